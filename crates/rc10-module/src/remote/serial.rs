use super::Receiver;

/// Settings of a UART to hear a receiver. Eight data bits, the lowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SerialSettings {
    /// Bits per second.
    pub baud: u32,
    /// A bit after the data bits.
    pub parity: Parity,
    /// Stop bits: 1 or 2.
    pub stop_bits: u8,
    /// Whether the output is low when idle: either board or UART inverts it (STM32H7 `RXINV`).
    pub inverted: bool,
}

/// A bit that makes errors show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Parity {
    /// No such bit.
    None,
    /// With it, the number of ones is even.
    Even,
}

impl SerialSettings {
    /// Bits of a character on the wire: start, data, parity and stop.
    #[must_use]
    pub const fn character_bits(&self) -> u8 {
        let parity = match self.parity {
            Parity::None => 0,
            Parity::Even => 1,
        };
        1 + 8 + parity + self.stop_bits
    }
}

impl Receiver {
    /// Settings of the UART; `None` for pulses. DR16 manual; Futaba's SBUS; `ExpressLRS` (TBS's
    /// 416,666 baud are heard too); DJI's VT03 notes.
    #[must_use]
    pub const fn serial(self) -> Option<SerialSettings> {
        let (baud, parity, stop_bits, inverted) = match self {
            Self::Dr16 => (100_000, Parity::Even, 1, true),
            Self::Sbus => (100_000, Parity::Even, 2, true),
            Self::Crsf => (420_000, Parity::None, 1, false),
            Self::Vt03 => (921_600, Parity::None, 1, false),
            Self::Ppm => return None,
        };
        Some(SerialSettings { baud, parity, stop_bits, inverted })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_are_as_long_as_they_are() {
        let bits = |receiver: Receiver| receiver.serial().map(|serial| serial.character_bits());
        assert_eq!(bits(Receiver::Dr16), Some(11));
        assert_eq!(bits(Receiver::Sbus), Some(12));
        assert_eq!(bits(Receiver::Crsf), Some(10));
        assert_eq!(bits(Receiver::Vt03), Some(10));
        assert_eq!(bits(Receiver::Ppm), None);
    }
}
