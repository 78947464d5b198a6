//! The part that the chip's binaries share: the [`board`].
#![no_std]

pub mod board;
