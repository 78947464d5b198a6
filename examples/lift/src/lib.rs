//! A lift on two motors that finds its bottom and does not tilt, a hoist with a switch at its bottom, and a
//! feeder that finds its index and counts, driven by a DR16. The same on a PC and on the chip.
//!
//! * [`table`]: its motors, and its measures.
//! * [`Lift`]: homes both motors together, and then moves them together.
//! * `hoist`: homes by its switch, and then moves within its range.
//! * `indexed`: a feeder whose pockets stand where its index says.
//! * [`task`]: what the remote control makes of it.
//! * `simulation`: the robot for the tools on a PC, with an operator's script.
#![cfg_attr(not(feature = "sim"), no_std)]
#![forbid(unsafe_code)]

mod hoist;
mod indexed;
mod lift;
#[cfg(feature = "sim")]
pub mod simulation;
pub mod table;
pub mod task;

pub use lift::{Goal, Lift};
pub use table::{Motors, Name, Ports, Robot, Shared};

rc10::live! {
    /// Signals and mechanisms for a PC.
    pub struct Own {
        mechanisms {
            lift: "lift";
            feeder: "feeder";
            hoist: "hoist";
        }
        contacts {
            index: "feeder index";
            bottom: "hoist bottom";
        }
        signals {
            blamed: "lift blames motor", "";
            height: "lift height", "deg";
            tilt: "lift tilt", "deg";
            hoisted: "hoist height", "deg";
            fed: "pieces fed", "";
            jams: "feeder jams", "";
        }
    }
}
