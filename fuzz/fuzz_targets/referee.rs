#![no_main]
rc10_fuzz::program!(referee);
