//! The three FDCAN buses: 1 Mbit/s, classic frames. No interrupts.
//!
//! **Receiving.** The controller's filters sort. What motors and subscriptions want goes to FIFO 0,
//! of [`HARDWARE_RECEIVE`] frames; once a tick [`receive`](rc10_can::CanPort::receive) takes it
//! from the message RAM, in order, with the controller's time stamps: an interrupt for every frame
//! would move it twice. All else goes to FIFO 1, where the newest overwrites the oldest; one is
//! looked at in a tick, the rest is counted.
//!
//! **Sending.** 24 of the controller's 32 transmit buffers are for commands, and the controller
//! sends the one that wins arbitration first. A newer frame cancels the unsent older one of its
//! identifier and takes another buffer: its own may be on the wire, and then must not be rewritten,
//! and with a spare buffer no frame has to wait for that. So each identifier has one live buffer,
//! and nothing stale leaves after an outage: what is sent is as old as the tick before, at most. If
//! the ticks stop, the supervisor takes it back (not while interrupts are masked: then nothing
//! can). The other eight buffers hold the bus's coast image ([`FdcanPort::keep_coast_image`]): what
//! the [`supervisor`](crate::supervisor) and the [crash handler](crate::crash) send.
//!
//! **Losses** are counted, all of them: see [`Health`](rc10_can::Health) and [`FdcanPort`].
//!
//! embassy-stm32's CAN driver has FIFOs of three frames, sees no overruns, and takes none back.

mod bus;
mod clock;
mod controller;
mod filter;
mod port;

pub use bus::{Bus, BusParts};
pub use controller::{COAST_FRAMES, HARDWARE_RECEIVE};
pub use port::{BusPeripheral, CoastImageFull, FdcanPort};

pub(super) use controller::ALL;
