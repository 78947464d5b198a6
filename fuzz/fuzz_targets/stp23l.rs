#![no_main]
rc10_fuzz::program!(stp23l);
