//! A robot on four wheels, each steered by a motor of its own, driven by a DR16. The same on a PC and on
//! the chip.
//!
//! * [`table`]: its motors, and its measures.
//! * [`task`]: what the remote control makes of it, and where it is by its wheels.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
pub mod task;

pub use table::{Motors, Name, Ports, Robot, Shared};

rc10::live! {
    /// Where it is by its wheels: signals for a PC. And what a PC may command: its twist.
    pub struct Own {
        auto {
            "vx", "m/s", table::BASE.full_stick.vx;
            "vy", "m/s", table::BASE.full_stick.vy;
            "wz", "rad/s", table::BASE.full_stick.wz;
        }
        signals {
            x: "odometry x", "m";
            y: "odometry y", "m";
            heading: "odometry heading", "rad";
            slip: "wheels slip", "m/s";
        }
    }
}
