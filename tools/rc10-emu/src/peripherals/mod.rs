//! The STM32H723's peripherals, from the reference manual's rules (RM0468).
//!
//! [`Soc`] answers register accesses at a time in nanoseconds, says when it next does something by
//! itself, and drives the interrupt lines. `map::MAP` declares which device is at which address, with
//! which clock gate and which reset bit; everything else follows from it.
//!
//! The chip refuses much, and so does the model. A refused access is kept as an [`Access`]:
//! a peripheral without clock, an address without a device, a register that is locked. Addresses,
//! bits and interrupt numbers are those of stm32-metapac 21.0.0 for the STM32H723ZG.
//!
//! To add a peripheral: give it a file with `read`, `write`, `advance` and `next_event`, a variant
//! in `map::Block`, a row in `map::MAP`, and an arm in `Soc`'s matches on the block.

mod access;
mod adc;
mod clocks;
mod dma;
mod exti;
mod facts;
mod flash;
mod gpio;
mod i2c;
mod map;
mod octospi;
mod outside;
mod pins;
mod power;
mod rcc;
pub(crate) mod registers;
mod soc;
mod spi;
mod timer;
mod usart;
mod watchdog;

pub use access::{Access, AccessKind, BusFault, PinFault, Width};
pub(crate) use access::{Answer, Write};
pub use adc::AdcFault;
pub use clocks::{Clocks, Limit, TooFast};
pub(crate) use flash::{FlashState, SECTOR};
pub use i2c::I2cDevice;
pub(crate) use octospi::{Header, SerialMemory};
pub use outside::{Edge, PinTime};
pub use rcc::ResetCause;
pub use soc::Soc;
pub(crate) use soc::lock;
pub use spi::SpiDevice;
pub use usart::{Character, Format, Parity, SentByte};
pub(crate) use usart::{Outgoing, Sampled, Sampling, Wire};
