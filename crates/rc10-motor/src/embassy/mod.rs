//! The bus under Embassy: a runner with the motors, and the port shared with all other tasks.
//!
//! No other task ever touches a motor: a [`MotorPort`] is a mailbox for the newest command and a
//! copy of the newest status. No lock is held over an `await`, so no task can stall another's bus.
//!
//! A bus on RS-485 has the same: [`run_rs485`], [`Rs485Port`] and the same [`MotorPort`]s.
//!
//! The runner is generic over [`CanPort`](rc10_can::CanPort): the same code runs on the chip and,
//! with a virtual clock, on a PC. It enables no time driver and no executor.

mod clock;
mod motors;
mod port;
mod ports;
mod recovery;
mod rs485;
mod runner;
mod subscription;

pub use motors::{MotorPort, MotorPorts};
pub use port::{BusPort, BusStatus, OutboxError};
pub use ports::Ports;
pub use rs485::{Rs485Port, Rs485Status, run_rs485};
pub use runner::{Runner, run_bus, run_buses};
pub use subscription::{Filter, NoFreeSubscription, Received, Subscription};
