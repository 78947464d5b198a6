//! Board support: clocks, ports and peripherals of the chip, and what happens after a crash.
//!
//! The chip side is behind the feature `stm32h723`, for the target `thumbv7em-none-eabihf` only:
//! clocks, the FDCAN ports and their `Bus::start`, UARTs, timers and other peripherals, the supervisor
//! and the watchdog, and what happens after a crash. Without it the crate is empty. What tasks are
//! made of, on a chip and on a PC, is in [`rc10_message`].
#![no_std]
#![cfg_attr(not(feature = "stm32h723"), forbid(unsafe_code))]

#[cfg(feature = "stm32h723")]
mod stm32h723;

#[cfg(feature = "usb")]
pub use stm32h723::usb;
#[cfg(feature = "stm32h723")]
pub use stm32h723::{
    CORE_CLOCK, Crystal, CrystalState, FDCAN_CLOCK, TIMER_CLOCK, can, clocks, crash, crystal,
    cycle_count, dma, i2c, initialise, other_chip, pulse_input, pulse_output, pwm, quadrature,
    serial, spi, supervisor, voltage, watchdog,
};
