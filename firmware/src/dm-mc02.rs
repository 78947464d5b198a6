//! The team's robot on a DM-MC02, which has its IMU and its status lamp on board.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_futures::join::join3;
use team::{chassis, driver, mechanisms, table};

rc10_board::robot! {
    robot: team;
    buses: three_buses(bus_1, bus_2, bus_3);
    console: table::CONSOLE;
    // The switched 5 V feed nothing of this robot.
    outputs: [First, Second];
    tasks: |shared| join3(chassis::run(shared), mechanisms::run(shared), driver::run(shared));
}
