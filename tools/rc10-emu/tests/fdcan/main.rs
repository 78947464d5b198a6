//! The FDCAN model against the reference manual's rules.
//!
//! `bench` is a controller on a wire that the test plays itself; `world` puts it on a simulated
//! one.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bench;
mod calibration;
mod errors;
mod fifos;
mod filters;
mod registers;
mod transmit;
mod world;
