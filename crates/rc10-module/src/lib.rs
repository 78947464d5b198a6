//! Parts on a robot that are no motors: remote controls, laser ranging, IMUs, positioning, LED
//! strips.
//!
//! **Parsers do no input and output.** A [`Protocol`] says what some bytes are; a [`Stream`] finds
//! its frames among whatever else is on the wire. **One driver loop serves every serial device**:
//! [`listen`] reads any [`embedded_io_async::Read`], of any HAL or of a simulated line, and hands
//! over messages; what was lost stands in [`Reception`].
//!
//! This crate knows no board and no motors: they meet in a robot. `docs/modules` has a page for each
//! device: wiring, frame, how it fails, sources; and how to add one.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod encoder;
pub mod imu;
pub mod led;
pub mod limit_switch;
mod listen;
pub mod positioning;
pub mod ranging;
pub mod remote;
mod stream;
mod sum;

pub use listen::{Reception, listen};
pub use stream::{Buffer, Counters, Found, Pause, Protocol, Stream};
