//! A robot with something of every kind beside its motors: a range finder, a switch, a voltage, a servo, absolute encoders,
//! and a remote whose throttle does not spring back. The same on a PC and on the chip.
//!
//! * [`table`]: what it has, a line each, and its measures.
//! * `task`: what the remote control makes of it. `lift`, `arm`, `wall`: its parts.
//! * [`simulation`]: what is around it, for the tools on a PC.
#![cfg_attr(not(feature = "sim"), no_std)]

mod arm;
mod lift;
#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
mod task;
mod wall;

pub use table::*;
