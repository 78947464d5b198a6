//! The lift on the chip.
#![no_std]
#![no_main]

use defmt_rtt as _;
use lift::task;

rc10_board::robot! {
    robot: lift;
    buses: two_buses(bus_1, bus_2);
    console: 921_600;
    tasks: |shared, index, bottom| task::run(shared, index, bottom);
}
