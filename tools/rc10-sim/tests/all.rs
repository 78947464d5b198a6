//! The tests of this crate, in one program.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod arm;
mod base;
mod bases;
mod controller;
mod esc;
mod faults;
mod line;
mod motor;
mod nonlinear;
mod receivers;
mod serial;
mod time;
mod wire;
