//! The robot on the chip.
#![no_std]
#![no_main]

use defmt_rtt as _;
use starter::task;

rc10_board::robot! {
    robot: starter;
    buses: two_buses(bus_1, bus_2);
    console: 921_600;
    tasks: |shared| task::run(shared);
}
