//! A robot of motors of six vendors, to show how they live together: two CAN buses with standard and
//! extended identifiers, and an RS-485 line. The same on a PC and on the chip.
//!
//! * [`table`]: its motors.
//! * [`task`]: the script that it follows.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "sim")]
pub mod plant;
#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
pub mod task;

pub use table::{Motors, Name};

/// The robot's buses and its line as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }, 1>;

/// Everything that its tasks share.
pub type Shared<'p> = rc10_tasks::Common<'p, Name, { table::BUSES }, 1>;
