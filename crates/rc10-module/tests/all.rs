//! The tests of this crate, in one program.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod attitude;
mod bmi088;
mod heater;
mod jrt;
mod pages;
mod referee;
mod servo;
mod store;
mod vision;
mod waiting;
