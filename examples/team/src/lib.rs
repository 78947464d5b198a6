//! The team's robot: a mecanum base, a two-axis gimbal with a feeder, and a lift on four motors.
//!
//! * [`table`]: **which motor, on which bus, with which id, gains and safe state.** Start here.
//! * [`Shared`]: what its tasks share. [`Motors`]: where its motors
//!   stand. No statics: on the chip both
//!   live in a `StaticCell`, on a PC there is one of each per simulated world.
//! * [`chassis`], [`mechanisms`]: from what the robot shall do to motor targets.
//! * [`driver`]: turns the remote control into commands for base and mechanisms, and handles its loss.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
//!
//! Each task is an `async fn run(shared: &Shared<'_>) -> !`. The chip's executor or a simulated world polls
//! it.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

pub mod chassis;
pub mod driver;
pub mod mechanisms;
#[cfg(feature = "sim")]
mod operator;
mod robot;
#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;

pub use robot::{BaseCommand, Goal, MechanismCommand, Own};
pub use table::{Motors, Name, Ports, Robot, Shared};
