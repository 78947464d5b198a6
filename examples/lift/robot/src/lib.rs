//! A lift on two motors that finds its bottom and does not tilt, and a feeder that finds its index and
//! counts, driven by a DR16. The same on a PC and on the chip.
//!
//! * [`table`]: its motors, and its measures.
//! * [`Lift`]: homes both motors together, and then moves them together.
//! * `indexed`: a feeder whose pockets stand where its index says.
//! * [`task`]: what the remote control makes of it.
#![no_std]
#![forbid(unsafe_code)]

mod indexed;
mod lift;
pub mod table;
pub mod task;

use core::ops::Deref;

pub use lift::{Goal, Lift};
use rc10_tasks::Common;
pub use table::{Motors, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, { table::BUSES }>;

/// Everything that the tasks share: what every robot has, and this one's own signals.
pub struct Shared<'p> {
    /// The switch, the ports, the remote and the status.
    pub common: Common<'p, Name, { table::BUSES }>,
    /// Signals and mechanisms for a PC beside the motors' own.
    pub live: Live,
}

rc10_tasks::live! {
    /// Signals and mechanisms for a PC beside the motors' own.
    pub struct Live {
        mechanisms {
            lift: "lift";
            feeder: "feeder";
        }
        signals {
            blamed: "lift blames motor", "";
            height: "lift height", "deg";
            tilt: "lift tilt", "deg";
            fed: "pieces fed", "";
            jams: "feeder jams", "";
        }
        parameters {}
    }
}

impl<'p> Deref for Shared<'p> {
    type Target = Common<'p, Name, { table::BUSES }>;

    fn deref(&self) -> &Self::Target {
        &self.common
    }
}

impl<'p> Shared<'p> {
    /// The shared state of a robot that has not begun, and its ports.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new(ports: &'p Ports) -> Self {
        Self { common: Common::new(ports), live: Live::new() }
    }
}
