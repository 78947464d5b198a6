//! Board support: clocks, ports and peripherals of the chip, and what happens after a crash.
//!
//! The chip side is behind feature `stm32h723`, for `thumbv7em-none-eabihf`: clocks, FDCAN ports,
//! UARTs, timers and other peripherals, supervisor, watchdog, and what follows a crash. Tasks are
//! made of [`rc10_message`].
#![no_std]
#![cfg_attr(not(feature = "stm32h723"), forbid(unsafe_code))]

#[cfg(feature = "stm32h723")]
mod stm32h723;

#[cfg(feature = "usb")]
pub use stm32h723::usb;
#[cfg(feature = "stm32h723")]
pub use stm32h723::{
    CORE_CLOCK, Crystal, CrystalState, FDCAN_CLOCK, TIMER_CLOCK, can, clocks, crash, crystal,
    cycle_count, dma, flash, i2c, initialise, other_chip, pulse_input, pulse_output, pwm,
    quadrature, serial, servo, spi, supervisor, voltage, watchdog,
};
#[cfg(feature = "black-box")]
pub use stm32h723::{black_box, w25q64};
