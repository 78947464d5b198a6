//! Board support: what a robot's tasks are made of, and what is under them.
//!
//! The portable part knows no chip and runs on a PC too:
//!
//! * [`Topic`], [`Latest`] and [`Service`]: what tasks say to each other, from [`rc10_message`].
//! * [`periodic`]: work on a grid of time, without drift, with [`Statistics`].
//! * [`Cycles`]: what work costs, in cycles of the core's clock.
//!
//! All of them may be statics and may be shared between executors and interrupts. They need a
//! [`critical_section`](https://docs.rs/critical-section) implementation and an
//! [`embassy_time`] driver, which the binary chooses: this crate enables neither.
//!
//! The chip side is behind the feature `stm32h723`, for the target `thumbv7em-none-eabihf` only:
//! clocks, the FDCAN ports and their `Bus::start`, UARTs, timers and other peripherals, the supervisor
//! and the watchdog, and what happens after a crash.
#![no_std]
#![cfg_attr(not(feature = "stm32h723"), forbid(unsafe_code))]

mod cycles;
mod periodic;

#[cfg(feature = "stm32h723")]
mod stm32h723;

pub use cycles::{CycleCount, Cycles};
pub use periodic::{Load, Overrun, Statistics, Tick, periodic};
pub use rc10_message::{
    AlreadyServed, CallError, Caller, Calls, Changes, Latest, Message, Server, Service, Stamped,
    SubscribersFull, Subscription, Topic,
};
#[cfg(feature = "usb")]
pub use stm32h723::usb;
#[cfg(feature = "stm32h723")]
pub use stm32h723::{
    CORE_CLOCK, FDCAN_CLOCK, TIMER_CLOCK, can, clocks, crash, cycle_count, dma, has_crystal, i2c,
    initialise, pulse_input, pulse_output, quadrature, serial, spi, supervisor, watchdog,
};

use embassy_time::Instant;
use rc10_can::Micros;

/// What time it is, by embassy's clock.
#[must_use]
pub fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}
