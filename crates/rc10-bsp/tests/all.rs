//! The tests of this crate, in one program.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod crystals;
mod filters;
mod serial_config;
mod serial_ring;
mod time_stamps;
