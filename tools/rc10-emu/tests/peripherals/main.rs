//! The emulated peripherals, by their registers. Offsets and bits are written out: they are the
//! reference manual's, and must not come from the model.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod adc;
mod advanced;
mod boards;
mod capture;
mod chip;
mod clocks;
mod dma;
mod drivers;
mod formats;
mod i2c;
mod interrupts;
mod measure;
mod pins;
mod refusals;
mod serial;
mod spi;
mod strip;
mod timers;
mod watchdog;
mod watching;
