//! The lift in simulation: `cargo run --release`. What the simulator must know of it beyond the
//! [robot](lift_robot) itself stands in [`simulation`].
#![forbid(unsafe_code)]

pub mod plant;
pub mod simulation;

pub use lift_robot::{Lift, Motors, Name, Ports, Shared, table, task};
