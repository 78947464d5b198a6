//! The robot, the same on a PC and on the chip.
//!
//! * [`table`]: its motors, and its measures.
//! * [`task`]: what the remote control makes of it.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
pub mod task;

pub use table::{Motors, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }>;

/// Everything that its tasks share.
pub type Shared<'p> = rc10_tasks::Common<'p, Name, { table::BUSES }>;
