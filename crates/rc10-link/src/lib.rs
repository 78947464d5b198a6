//! The messages that a robot and a PC exchange over a serial line, and the frames around them.
//!
//! * [`Ask`]: what a PC asks. [`Tell`]: what a robot tells. Both are [postcard](https://postcard.jamesmunns.com)
//!   messages, so that a new one is one line; but for [samples], which are raw words: they are
//!   many, and a robot has few instructions for each.
//! * [`frame`]: how a message becomes bytes, and how it is found in a stream that also has other bytes.
//!
//! **The robot describes itself**: [`Tell::Signal`] and [`Tell::Parameter`] name everything that it can
//! show or change, with its unit and its range. A PC has no list of its own.
//!
//! **Versions**: messages and fields are only ever added, messages behind the others and fields at the
//! end of a message. So either side may be older: it skips what it does not know.
//!
//! **The link is up** from a PC's [`Ask::Hello`] until none has come for [`SILENCE`]. Until then, and
//! from then on, a robot sends no frame.
#![no_std]
#![forbid(unsafe_code)]

pub mod frame;
mod message;
pub mod samples;

pub use message::{
    Action, Ask, Bits, CHANGES, Change, Declaration, GROUPS, Outcome, SIGNALS, Tell, Topic, Urgent,
};

/// The version of these messages.
pub const VERSION: u16 = 2;

/// A link is down after this silence, in microseconds. A PC says hello at least every
/// quarter of it.
pub const SILENCE: u64 = 1_000_000;

/// A jog that was asked for longer ago is refused, in microseconds by the robot's clock.
pub const JOG_AGE: u64 = 150_000;

/// Signals and parameters come in pages of this size: [`Ask::Signals`] and [`Ask::Parameters`] get those up
/// to the next multiple of it.
pub const AT_ONCE: u16 = 8;
