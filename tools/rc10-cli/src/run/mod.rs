//! Runs of a robot: in the simulator, and its firmware on the emulated chip.

pub mod board;
pub mod emulation;
pub mod fault_bench;
pub mod foreign;
pub mod line;
pub mod running;
pub mod simulate;
pub mod simulation;
pub mod watch;
