//! A robot on four wheels, each steered by a motor of its own, driven by a DR16. The same on a PC and on
//! the chip.
//!
//! * [`table`]: its motors, and its measures.
//! * [`task`]: what the remote control makes of it, and where it is by its wheels.
#![no_std]
#![forbid(unsafe_code)]

use core::ops::Deref;

pub mod table;
pub mod task;

pub use table::{Motors, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }>;

type Common<'p> = rc10_tasks::Common<'p, Name, { table::BUSES }>;

/// Everything that its tasks share.
pub struct Shared<'p> {
    /// The state that every robot has.
    pub common: Common<'p>,
    /// Where it is by its wheels.
    pub live: Live,
}

rc10_tasks::live! {
    /// Signals for a PC beside the motors' own.
    pub struct Live {
        signals {
            x: "odometry x", "m";
            y: "odometry y", "m";
            heading: "odometry heading", "rad";
            slip: "wheels slip", "m/s";
        }
        parameters {}
    }
}

impl<'p> Deref for Shared<'p> {
    type Target = Common<'p>;

    fn deref(&self) -> &Self::Target {
        &self.common
    }
}

impl<'p> Shared<'p> {
    /// Creates the state of a robot that has not begun.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new(ports: &'p Ports) -> Self {
        Self { common: Common::new(ports), live: Live::new() }
    }
}
