//! The three FDCAN buses: 1 Mbit/s, classic frames.
//!
//! Receiving: a frame passes the controller's FIFO of [`HARDWARE_RECEIVE`] frames, the interrupt
//! moves it with its arrival time into a queue of [`RECEIVE_QUEUE`], and
//! [`FdcanPort::receive`](rc10_can::CanPort::receive) takes it from there. Where the queue is full
//! the oldest frame goes, and is counted: a control loop wants the newest.
//!
//! Sending: 24 of the controller's 32 transmit buffers take frames, and the controller sends the
//! one that wins arbitration first. No interrupt is needed. A newer frame cancels the unsent older
//! one of its identifier, so that nothing stale leaves after an outage. The other eight buffers
//! hold the bus's coast image ([`FdcanPort::keep_coast_image`]): what the crash handler sends.
//!
//! embassy-stm32's own CAN driver is not used: its FIFOs are three frames deep, it does not see
//! overruns, and it cannot take a frame back. This port shares the pin and interrupt types with it.

mod bus;
mod controller;
mod element;
mod port;

pub use bus::{Bus, BusParts};
pub use controller::{COAST_FRAMES, HARDWARE_RECEIVE};
pub use port::{BusPeripheral, CoastImageFull, FdcanPort, Interrupt, RECEIVE_QUEUE};

pub(super) use controller::ALL;
