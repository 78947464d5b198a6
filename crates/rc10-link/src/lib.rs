//! The messages that a robot and a PC exchange over a serial line, and the frames around them.
//!
//! * [`Ask`] of a PC and [`Tell`] of a robot are [postcard](https://postcard.jamesmunns.com)
//!   messages: a new one is one line. [samples] are raw words: they are many; [commands], too: a robot that takes
//!   none has nothing of them.
//! * [`frame`]: how a message becomes bytes, and how it is found in a stream that also has other bytes.
//!
//! **The robot describes itself**: [`Tell::Signal`] and [`Tell::Parameter`], with units and ranges.
//!
//! **Versions**: messages and fields are only added, at the end; an older side skips them.
//!
//! **The link is up** from [`Ask::Hello`] until none came for [`SILENCE`]; else a robot is silent.
#![no_std]
#![forbid(unsafe_code)]

pub mod commands;
pub mod frame;
mod message;
pub mod samples;

pub use message::{
    Action, Ask, Bits, CHANGES, Change, Declaration, GROUPS, Outcome, SIGNALS, Tell, Topic, Urgent,
};

/// The version of these messages.
pub const VERSION: u16 = 3;

/// A link is down after this silence, µs. A PC says hello every quarter of it.
pub const SILENCE: u64 = 1_000_000;

/// A jog that was asked for longer ago is refused, in microseconds by the robot's clock.
pub const JOG_AGE: u64 = 150_000;

/// Page size: [`Ask::Signals`] and [`Ask::Parameters`] get those up to the next multiple.
pub const AT_ONCE: u16 = 8;

/// Bytes of a piece of a black box.
pub const PIECE: usize = 896;

/// Longest period, ms, of the first group's samples on which all else rides: see [`frame::CARRIER`].
pub const RIDES: u16 = 10;
