//! A robot of three vendors: a base on four omni wheels, an arm of Damiao's, a turret, and a flywheel on
//! a VESC, driven by a DR16. The same on a PC and on the chip.
//!
//! * [`table`]: its motors, and its measures.
//! * [`task`]: what the remote control makes of it.
#![no_std]
#![forbid(unsafe_code)]

pub mod table;
pub mod task;

pub use table::{Motors, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }>;

/// Everything that its tasks share.
pub type Shared<'p> = rc10_tasks::Common<'p, Name, { table::BUSES }>;
