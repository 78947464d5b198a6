//! Parts for the tasks of a robot: messages between them, and work on a grid of time.
//!
//! * [`Topic`]: a stream of messages to several subscribers; who is slow learns what it missed.
//! * [`Latest`]: the newest value of something, and how old it is.
//! * [`Every`]: work on a grid of time, without drift, with [`Statistics`].
//! * [`Cycles`]: the cost of work, in cycles of the core's clock.
//! * [`Service`]: a request and its response, with a timeout; no response goes to another caller.
//!
//! All of them may be statics, have no heap, and may be shared between executors and interrupts of
//! any priority: each locks with a critical section for the length of a copy, and never over an
//! `await`. They need a [`critical_section`](https://docs.rs/critical-section) implementation and,
//! for timeouts, an [`embassy_time`] driver, which the binary chooses: this crate enables neither.
//!
//! A crate of its own: motors and boards use it, and do not know each other. `docs/messages.md` has
//! every message, and translates for readers of ROS.
#![no_std]
#![forbid(unsafe_code)]

mod cycles;
mod latest;
mod periodic;
mod service;
mod topic;

pub use cycles::{CycleCount, Cycles};
pub use latest::{Changes, Latest, Stamped};
pub use periodic::{Every, Load, Statistics, Tick};
pub use service::{AlreadyServed, CallError, Caller, Calls, Server, Service};
pub use topic::{Message, SubscribersFull, Subscription, Topic};
// Whose `Micros` are in all of them.
pub use rc10_time;

/// The time, by embassy's clock.
#[must_use]
pub fn now() -> rc10_time::Micros {
    rc10_time::Micros::new(embassy_time::Instant::now().as_micros())
}
