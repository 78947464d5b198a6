//! The robot in simulation: `cargo run --release`. What the simulator must know of it beyond the
//! [robot](starter_robot) itself stands in [`simulation`].
#![forbid(unsafe_code)]

pub mod simulation;

pub use starter_robot::{Motors, Name, Ports, Shared, table, task};
