//! The omni robot in simulation: `cargo run --release`. What the simulator must know of it beyond the
//! [robot](omni_robot) itself stands in [`simulation`].
#![forbid(unsafe_code)]

pub mod plant;
pub mod simulation;

pub use omni_robot::{Motors, Name, Ports, Shared, base, table, task};
