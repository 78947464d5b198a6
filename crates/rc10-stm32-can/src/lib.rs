//! CAN ports for STM32 chips with bxCAN or the small FDCAN, like `rc10-bsp` on an STM32H723.
//!
//! * [`Driver`]: mailboxes, replaced and lost frames, bus-off; without registers, on a PC.
//! * [`Hardware`]: what a controller with three transmit mailboxes does for it.
//! * [`BusOff`]: what bxCAN's registers tell of bus-off.
//! * [`SharedDriver`] and [`Port`]: a driver shared with its interrupt, as an [`rc10_can::CanPort`].
//! * [`layout`]: frames and filters in bxCAN's registers; those of FDCAN are in [`rc10_can::m_can`].
//! * `InterruptHandler`, for `bind_interrupts!`; `Controller`: the one of the feature.
//! * `bxcan`, with the feature of that name: F4, F7, F3, L4. `fdcan`: G4, H5, L5, U5.
//!
//! ```ignore
//! rc10_stm32_can::bxcan_bus!(Drive on CAN1);
//! bind_interrupts!(struct Irqs {
//!     CAN1_TX => InterruptHandler<Drive>;
//!     CAN1_RX0 => InterruptHandler<Drive>;
//! });
//! let port = bxcan::start::<Drive>(p.CAN1, p.PD0, p.PD1, Irqs, 1_000_000)?;
//! ```
//!
//! **Beside embassy-stm32's driver.** Pins, clock and interrupts are embassy's; the controller is
//! set up here. `embassy_stm32::can::Can` and `CanConfigurator` are not used: their handlers clear
//! flags that tell a frame's fate, stop the receive interrupt until a task reads, and come back
//! from bus-off by themselves. `start` takes the peripheral.
#![no_std]
#![cfg_attr(not(any(feature = "bxcan", feature = "fdcan")), forbid(unsafe_code))]

#[cfg(all(feature = "bxcan", feature = "fdcan"))]
compile_error!("choose the feature bxcan or fdcan, not both: a chip has one of them");

mod bus_off;
#[cfg(feature = "bxcan")]
pub mod bxcan;
mod driver;
#[cfg(feature = "fdcan")]
pub mod fdcan;
mod hardware;
pub mod layout;
mod port;
#[cfg(any(feature = "bxcan", feature = "fdcan"))]
mod start;

pub use bus_off::BusOff;
pub use driver::{Driver, RECEIVE_QUEUE, TRANSMIT_QUEUE};
#[cfg(any(feature = "bxcan", feature = "fdcan"))]
#[doc(hidden)]
pub use embassy_stm32;
pub use hardware::{Ended, Errors, Hardware, MAILBOXES};
pub use port::{Port, SharedDriver};
#[cfg(any(feature = "bxcan", feature = "fdcan"))]
pub use start::{Bus, Controller, InterruptHandler, StartError};
