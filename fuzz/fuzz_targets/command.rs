#![no_main]
rc10_fuzz::program!(command);
