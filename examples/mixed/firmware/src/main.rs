//! The mixed robot on the chip: eight motors on an RS-485 line, six more on two CAN buses. The line waits
//! for the buses, a few microseconds of each tick, and for nothing else: each exchange of a motor waits for
//! the one before.
#![no_std]
#![no_main]

rc10_board::program!(mixed);
