//! The mixed robot on the chip: eight motors on an RS-485 line, six more on two CAN buses. The line waits
//! for the buses, a few microseconds of each tick, and for nothing else: each exchange of a motor waits for
//! the one before.
#![no_std]
#![no_main]

use defmt_rtt as _;
use mixed::{table::REPLY, task};

rc10_board::robot! {
    robot: mixed;
    buses: two_buses(bus_1, bus_2);
    line: rs485 at 4_000_000, replies in REPLY;
    console: 921_600;
    tasks: |shared| task::run(shared);
}
