//! A robot of motors of six vendors, to show how they live together: two CAN buses with standard and
//! extended identifiers, and an RS-485 line. `cargo run --release` drives it in simulation; `firmware`
//! is it on the chip.
//!
//! * [`table`]: its motors.
//! * [`task`]: the script that it follows.
//! * [`simulation`]: what the simulator must know of it beyond that.
#![cfg_attr(target_os = "none", no_std)]
#![forbid(unsafe_code)]

#[cfg(not(target_os = "none"))]
pub mod simulation;
pub mod table;
pub mod task;

pub use table::{Motors, Name};

/// The robot's buses and its line as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }, 1>;

/// Everything that its tasks share.
pub type Shared<'p> = rc10_tasks::Common<'p, Name, { table::BUSES }, 1>;
