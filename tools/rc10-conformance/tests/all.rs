//! The tests of this crate, in one program.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(
    clippy::duplicate_mod,
    reason = "the same declarations before the rules and in the stories"
)]

mod chaos;
mod conformance;
mod motors;
mod rule_breakers;
