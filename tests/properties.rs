//! Properties of every input, tried with thousands of them: the same ones in each run.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "properties/any.rs"]
mod any;
#[path = "properties/bus.rs"]
mod bus;
#[path = "properties/cybergear.rs"]
mod cybergear;
#[path = "properties/damiao.rs"]
mod damiao;
#[path = "properties/lk.rs"]
mod lk;
#[path = "properties/maths.rs"]
mod maths;
#[path = "properties/odrive.rs"]
mod odrive;
#[path = "properties/unitree.rs"]
mod unitree;
#[path = "properties/vesc.rs"]
mod vesc;
#[path = "properties/wire.rs"]
mod wire;
#[path = "properties/wiring.rs"]
mod wiring;
