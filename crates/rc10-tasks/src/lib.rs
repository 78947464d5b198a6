//! Tasks that every robot has, whatever its motors: they are tested here, and a team only says
//! which switch does what.
//!
//! * [`arming`]: the switches of a remote control arm, disarm and stop; its failsafe in two steps.
//! * [`heading`]: which way the robot looks, counted from where it was armed.
//! * [`status`]: the state of a bus in a few numbers; whether every bus ticks, for a watchdog.
//! * [`status_led`]: the state of the robot on an LED strip.
#![no_std]
#![forbid(unsafe_code)]

pub mod arming;
pub mod heading;
pub mod status;
pub mod status_led;

pub use arming::{Arming, ArmingConfig, ArmingError, SwitchAt, SwitchName};
pub use status::{BusSummary, TickWatch};
