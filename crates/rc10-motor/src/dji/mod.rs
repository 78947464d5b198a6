//! DJI RoboMaster motors: M3508 with C620, M2006 with C610, GM6020 in current and voltage mode.
//!
//! The controllers send their feedback by themselves (1 kHz by default); one command frame drives
//! up to four of them, two bytes each. What they do when commands stop is not documented: assume
//! that they keep the last current. They have no speed or angle control of their own, so a
//! [`Dji`] runs a [`Cascade`](rc10_app::Cascade) at its output shaft.
//!
//! Sources: C620, C610 and GM6020 manuals (CAN tables), RoboMaster Development-Board-C examples.

mod config;
mod motor;
pub mod signals;
mod wire;

pub use config::{
    Config, Effort, FeedbackRate, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508, Model,
};
pub use motor::Dji;
pub use wire::RawFeedback;
