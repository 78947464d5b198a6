//! Parts of a CAN bus: the frame, its length on the wire, and the port.
//!
//! * [`CanFrame`]: a classic CAN 2.0 frame; implements [`embedded_can::Frame`].
//! * [`WireLength`]: how many bit times a frame takes, exactly (with its stuff bits) or at worst.
//! * [`IdPattern`]: one identifier, or a family of them (`id` under `mask`).
//! * [`CanPort`]: a port that never waits. [`NbPort`] makes one of any [`embedded_can::nb::Can`];
//!   [`Mailboxes`] stores the newest frame per stream for ports.
//! * [`Health`]: how a bus is, and what was lost on it; [`BusOffPolicy`]: who brings it back.
//! * [`BitTiming`]: a bit's quanta from a clock; [`m_can`]: a controller's frames and filters.
//!
//! The crate has no clock, no I/O and no allocation.
#![no_std]
#![forbid(unsafe_code)]

mod bit_timing;
mod bus_off;
mod frame;
mod health;
mod length;
pub mod m_can;
mod pattern;
mod port;
pub mod response;

pub use bit_timing::{BitTiming, BitTimingError, BitTimingLimits};
pub use bus_off::BusOffPolicy;
pub use embedded_can;
pub use frame::{CanFrame, FrameTooLong};
pub use health::{BusError, ErrorState, Health};
pub use length::{LengthBounds, WireLength};
pub use pattern::{EXTENDED_FILTERS, IdPattern, STANDARD_FILTERS};
pub use port::{CanPort, Mailboxes, NbPort, Queued, Submitted};
pub use rc10_time;
