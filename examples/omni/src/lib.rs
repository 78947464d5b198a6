//! A robot of three vendors: a base on four omni wheels that can follow a path, an arm of Damiao's, a
//! turret, and a flywheel on a VESC, driven by a DR16. The same on a PC and on the chip.
//!
//! * [`table`]: its motors, its measures, and its path.
//! * [`task`]: what the remote control makes of it.
//! * [`base`]: the base, by hand and along the path; [`mechanisms`]: what is on it.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

pub mod base;
pub mod mechanisms;
#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
pub mod task;

pub use table::{Motors, Name, Ports, Robot, Shared};

rc10::live! {
    /// Where it believes to be, where it is to be, and what it does: for a PC.
    pub struct Own {
        mechanisms {
            arm: "arm stage";
        }
        signals {
            x: "odometry x", "m";
            y: "odometry y", "m";
            yaw: "odometry heading", "rad";
            path_x: "path x", "m";
            path_y: "path y", "m";
            path_yaw: "path heading", "rad";
            heading: "heading", "deg";
            activity: "activity", "";
        }
    }
}
