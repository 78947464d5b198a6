//! The bus under Embassy: a runner with the motors, and the port shared with all other tasks.
//!
//! A [`MotorPort`] is a mailbox and a status: no lock is held over an `await`, no task stalls.
//!
//! A bus on RS-485 has the same: [`run_rs485`], [`Rs485Port`] and the same [`MotorPort`]s.
//!
//! The runner takes any [`CanPort`](rc10_can::CanPort): on the chip, or with virtual time.

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
pub use ports::{Ports, PortsOf};
#[cfg(feature = "record")]
pub use rs485::Runner as LineRunner;
pub use rs485::{Rs485Port, Rs485Status, run_rs485};
pub use runner::{Runner, run_bus, run_buses};
pub use subscription::{Filter, NoFreeSubscription, Received, Subscription};
