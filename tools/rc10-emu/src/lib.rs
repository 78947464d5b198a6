//! An emulated STM32H723 that runs the firmware's ELF unchanged, on the wires of `rc10-sim`.
#![forbid(unsafe_code)]

#[macro_use]
mod constants;

pub mod board;
pub mod core;
pub mod fault;
pub mod fdcan;
mod figures;
pub mod image;
mod links;
mod log;
mod machine;
pub mod memory;
pub mod parts;
pub mod peripherals;
pub mod profile;
mod rig;
pub mod strip;
mod time;
pub mod w25q64;

pub use board::{Board, Heater, ImuWiring, Package, Pin, SupplySense};
pub use fdcan::Spread;
pub use figures::{BusFigures, Figures};
pub use image::{Image, MadeFor, Static};
pub use machine::{LogLine, Machine, Options, Report, Restart};
pub use memory::Memory;
pub use profile::{ExceptionCost, Profile};
pub use rig::Rig;
