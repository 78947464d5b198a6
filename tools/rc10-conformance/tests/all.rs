//! The tests of this crate, in one program.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod chaos;
mod conformance;
mod motors;
mod rule_breakers;
