//! The part that the chip's binaries share: the [`board`], and what every [`robot`] does on it.
#![no_std]

pub mod board;
pub mod robot;
