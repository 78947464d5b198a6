//! Tests that a motor of [`rc10_motor`] keeps the rules of its trait, and a bench to drive it on:
//! one bus, our motors, and simulated devices on the wire.
#![forbid(unsafe_code)]

mod bench;

pub use bench::Bench;
