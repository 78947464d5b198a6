//! The omni robot on the chip.
#![no_std]
#![no_main]

use defmt_rtt as _;
use omni::task;

rc10_board::robot! {
    robot: omni;
    buses: three_buses(bus_1, bus_2, bus_3);
    console: 921_600;
    imu: wit;
    tasks: |shared| task::run(shared);
}
