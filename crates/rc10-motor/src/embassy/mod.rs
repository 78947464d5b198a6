//! The bus under Embassy: a runner that owns the motors and ticks every millisecond, and the port
//! that all other tasks share with it.
//!
//! No other task ever touches a motor: a [`MotorPort`] is a mailbox for the newest command and a
//! copy of the newest status. No lock is held over an `await`, so no task can stall another's bus.
//!
//! A serial line of motors has the same: [`run_rs485`], [`Rs485Port`] and the same [`MotorPort`]s.
//!
//! The runner is generic over [`CanPort`](rc10_can::CanPort): the same code runs on the chip and,
//! with a virtual clock, on a PC. It enables no time driver and no executor.

mod line;
mod motors;
mod port;
mod recovery;
mod runner;
mod subscription;

pub use line::{LineStatus, Rs485Port, run_rs485};
pub use motors::MotorPort;
pub use port::{BusPort, BusStatus, OutboxError};
pub use runner::{Runner, run_bus, run_buses};
pub use subscription::{Filter, NoFreeSubscription, Received, Subscription};
