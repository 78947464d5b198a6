//! The board with the STM32H723ZG, and a robot's program on it.
//!
//! * [`robot!`]: the whole program, of a robot and its tasks.
//! * [`board`]: the pins, by what they are for. [`robot`](mod@robot): what every robot does on them; a
//!   program that needs more than [`robot!`] has calls it by itself, as that of `rc10-robot` does.
//!
//! The memory map comes with this crate. What a program's own package must have besides stands in its
//! `.cargo/config.toml`; without it nothing is compiled, and the error says what is missing.
#![no_std]

pub mod board;
mod program;
pub mod robot;

#[doc(hidden)]
pub use {embassy_futures, rc10_bsp, rc10_motor, rc10_tasks, static_cell};
