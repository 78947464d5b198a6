//! UARTs as [`embedded_io_async`] ports.
//!
//! **Receiving.** A DMA fills a ring and never stops; an error flag stops it neither. The interrupt
//! keeps accounts: how far the DMA has come, and where an error was. It comes when the line pauses,
//! when the ring is half full and full, and on an error, and wakes the reader. So a frame costs one
//! interrupt and one read, whatever its length. An error stands between the bytes, where the interrupt saw
//! it (late by what a bus tick takes, if it waits for one): the
//! reader gets those before it, then the error instead of the damaged byte, then those after it.
//!
//! **Sending.** One copy into a buffer that belongs to the driver, from which a DMA sends.
//!
//! **Losses** are counted: [`SerialCounters`]. A slow reader gets [`SerialError::TooSlow`].
//!
//! embassy-stm32's UART drivers are not used: a line error stops and empties their ring, and a
//! transfer error panics. Its pins, DMA channels and bindings are.

mod config;
mod port;
mod ring;
mod uart;

pub use config::{BaudError, Parity, SerialConfig, StopBits};
pub use port::{ReceiverParts, Serial, SerialParts, SerialReceiver, SerialTransmitter};
pub use ring::{SerialCounters, SerialError};
pub use uart::{Interrupt, SerialPeripheral};
