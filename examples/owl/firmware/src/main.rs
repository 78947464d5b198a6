//! The robot on the chip.
#![no_std]
#![no_main]

rc10_board::program!(owl);
