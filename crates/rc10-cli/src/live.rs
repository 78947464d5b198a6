//! `rc10 live` and its like: a robot that runs, watched and tuned.

mod client;
pub mod wire;

pub use client::{Answer, Client, Losses, Parameter, Sample, Signal};
pub use rc10_link::Action;
