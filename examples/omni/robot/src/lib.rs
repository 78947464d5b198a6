//! A robot of three vendors: a base on four omni wheels that can follow a path, an arm of Damiao's, a
//! turret, and a flywheel on a VESC, driven by a DR16. The same on a PC and on the chip.
//!
//! * [`table`]: its motors, its measures, and its path.
//! * [`task`]: what the remote control makes of it.
//! * [`base`]: the base, by hand and along the path; [`mechanisms`]: what is on it.
#![no_std]
#![forbid(unsafe_code)]

pub mod base;
pub mod mechanisms;
pub mod table;
pub mod task;

use core::ops::Deref;

pub use table::{Motors, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }>;

/// Everything that its tasks share: what every robot has, and what a PC may watch of this one.
pub struct Shared<'p> {
    /// The switch, the ports, the remote and the status.
    pub common: rc10_tasks::Common<'p, Name, { table::BUSES }>,
    /// Where it believes to be, where it is to be, and what it does.
    pub live: Live,
}

rc10_tasks::live! {
    /// Signals for a PC beside the motors' own.
    pub struct Live {
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
        parameters {}
    }
}

impl<'p> Shared<'p> {
    /// Creates the state of a robot that has not begun.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new(ports: &'p Ports) -> Self {
        Self { common: rc10_tasks::Common::new(ports), live: Live::new() }
    }
}

impl<'p> Deref for Shared<'p> {
    type Target = rc10_tasks::Common<'p, Name, { table::BUSES }>;

    fn deref(&self) -> &Self::Target {
        &self.common
    }
}
