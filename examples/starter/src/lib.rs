//! The robot, the same on a PC and on the chip.
//!
//! * `table`: its motors, and its measures.
//! * `task`: what the remote control makes of it.
//! * `simulation`: what is on the shafts, and an operator's script, for the tools on a PC.
#![cfg_attr(not(feature = "sim"), no_std)]

#[cfg(feature = "sim")]
mod simulation;
mod table;
mod task;

pub use table::*;
