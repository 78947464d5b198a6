#![no_main]
rc10_fuzz::program!(unitree_module);
