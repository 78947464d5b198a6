//! What must hold for every input, tried with thousands of them: the same ones in each run.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "properties/any.rs"]
mod any;
#[path = "properties/bus.rs"]
mod bus;
#[path = "properties/maths.rs"]
mod maths;
#[path = "properties/wire.rs"]
mod wire;
#[path = "properties/wiring.rs"]
mod wiring;
