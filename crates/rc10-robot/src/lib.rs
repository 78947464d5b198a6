//! The example robot: a mecanum base, a two-axis gimbal with a feeder, and a lift on four motors.
//! Copy this crate to make your own; nothing else has to be edited.
//!
//! * [`table`]: **which motor, on which bus, with which id, gains and safe state.** Start here.
//! * [`Shared`]: what its tasks share. [`Motors`]: where its motors
//!   stand. No statics: on the chip both
//!   live in a `StaticCell`, on a PC there is one of each per simulated world.
//! * [`chassis`], [`mechanisms`]: from what the robot shall do to motor targets.
//! * [`driver`]: turns the remote control into commands for base and mechanisms, and handles its loss.
//! * [`imu`]: what the IMU on its serial port says.
//!
//! Each task is an `async fn run(shared: &Shared<'_>) -> !`. The chip's executor or a simulated world polls
//! it.
#![no_std]
#![forbid(unsafe_code)]

pub mod chassis;
pub mod driver;
pub mod imu;
pub mod mechanisms;
mod robot;
pub mod table;

pub use robot::{BaseCommand, Goal, MechanismCommand, Own, Ports, Shared};
pub use table::{Motors, Name};
