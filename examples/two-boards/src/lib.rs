//! A robot of two boards: a gimbal with the remote's receiver, and the chassis under it, on one CAN bus.
//!
//! * [`boards`]: what they tell each other, declared once.
//! * [`gimbal`]: its board leads: it arms both.
//! * [`chassis`]: its board follows.
//! * `simulation`: both for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

pub mod boards;
pub mod chassis;
pub mod gimbal;
#[cfg(feature = "sim")]
pub mod simulation;
