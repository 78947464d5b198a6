//! The swerve robot in simulation: `cargo run --release`. What the simulator must know of it beyond the
//! [robot](swerve_robot) itself stands in [`simulation`].
#![forbid(unsafe_code)]

pub mod plant;
pub mod simulation;

pub use swerve_robot::{Motors, Name, Ports, Shared, table, task};
