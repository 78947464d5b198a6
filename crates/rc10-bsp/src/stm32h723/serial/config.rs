//! Settings of a serial port. Without registers, to be tested on a PC.

/// Parity of a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Parity {
    /// No parity bit.
    #[default]
    None,
    /// An even number of ones, the parity bit included.
    Even,
    /// An odd number.
    Odd,
}

/// Length of the stop bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopBits {
    /// One bit.
    #[default]
    One,
    /// Two.
    Two,
}

/// Settings of a serial port: always eight data bits, the lowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialConfig {
    /// Bits a second: 1832 ..= 7 500 000 of 120 MHz, within 1 % of its whole fractions: 4 000 000,
    /// 1 000 000, 100 000, 9 600 are exact, 115 200 is 0.03 %, 420 000 0.1 % off.
    pub baud: u32,
    /// The parity bit, which comes after the data bits.
    pub parity: Parity,
    /// The least pause between bytes: one stop bit or two.
    pub stop_bits: StopBits,
    /// The receive pin is low when the line rests: SBUS without an inverter.
    pub invert_receive: bool,
    /// The transmit pin is to be low when the line rests.
    pub invert_transmit: bool,
}

impl SerialConfig {
    /// A configuration with this bit rate, 8N1, not inverted.
    #[must_use]
    pub const fn new(baud: u32) -> Self {
        Self {
            baud,
            parity: Parity::None,
            stop_bits: StopBits::One,
            invert_receive: false,
            invert_transmit: false,
        }
    }

    /// The divisor that makes this baud rate from a clock, with sixteen samples a bit.
    pub(crate) const fn divisor(&self, clock: u32) -> Result<u16, BaudError> {
        let error = Err(BaudError { baud: self.baud, clock });
        if self.baud == 0 {
            return error;
        }
        let divisor = (clock + self.baud / 2) / self.baud;
        // Sixteen samples a bit, and the register's width (RM0468, USART_BRR).
        if divisor < 16 || divisor > 0xFFFF {
            return error;
        }
        // A receiver takes 3.3 % at least (RM0468, tolerance of the receiver), for both ends.
        let off = (clock / divisor).abs_diff(self.baud);
        if off > self.baud / 100 {
            return error;
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked")]
        Ok(divisor as u16)
    }
}

/// A baud rate that the UART cannot make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("baud: {baud} is not within 1 % of {clock} Hz divided by a whole number, 16 ..= 65535")]
pub struct BaudError {
    /// The baud rate that was asked for.
    pub baud: u32,
    /// The UART's kernel clock, Hz.
    pub clock: u32,
}
