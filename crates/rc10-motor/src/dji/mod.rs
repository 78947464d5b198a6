//! DJI RoboMaster motors: M3508 with C620, M2006 with C610, GM6020 in current and voltage mode.
//!
//! Controllers send feedback by themselves (1 kHz by default); one command frame drives up to four,
//! two bytes each. Silence of commands is not documented: assume that they keep the last current. A
//! [`Dji`] runs a [`Cascade`](rc10_app::Cascade) at its output shaft: they have no loops.
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
