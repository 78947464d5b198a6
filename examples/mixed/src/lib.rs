//! A robot of motors of six vendors, to show how they live together: two CAN buses with standard and
//! extended identifiers, and an RS-485 line. The same on a PC and on the chip.
//!
//! * [`table`]: its motors.
//! * [`task`]: the script that it follows.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
pub mod task;

pub use table::{Motors, Name, Ports, Robot, Shared};
