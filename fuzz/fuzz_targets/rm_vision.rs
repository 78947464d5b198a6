#![no_main]
rc10_fuzz::program!(rm_vision);
