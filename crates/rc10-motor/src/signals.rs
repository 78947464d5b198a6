//! What stands where in a vendor's frames, as data: for DBC files, and for who wants to read a bus
//! without this crate's types. Each vendor's table stands beside its codec and is tested against
//! it, bit for bit.

use embedded_can::Id;

/// One sort of frame of one device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message {
    /// Its name: letters, digits and underscores.
    pub name: &'static str,
    /// Its identifier.
    pub id: Id,
    /// Data bytes.
    pub len: u8,
    /// Whether the device sends it; else it is sent to the device.
    pub from_device: bool,
    /// What stands in it.
    pub signals: &'static [Signal],
}

/// Some bits of a frame, as a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Its name: letters, digits and underscores.
    pub name: &'static str,
    /// Where it begins, as a DBC file counts: bit 0 is the lowest of byte 0, bit 8 the lowest of
    /// byte 1. Little endian: its lowest bit; big endian: its highest.
    pub start: u8,
    /// Bits, 1 ..= 64.
    pub bits: u8,
    /// In which order its bytes come.
    pub order: ByteOrder,
    /// What its bits are.
    pub kind: Kind,
    /// Physical value = raw value · `factor` + `offset`.
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
    /// Unit of the physical value; empty if it has none.
    pub unit: &'static str,
    /// What raw values mean.
    pub values: &'static [(u32, &'static str)],
    /// When it is there at all.
    pub presence: Presence,
}

/// In which order a signal's bytes come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Lowest first (DBC: 1, "Intel").
    Little,
    /// Highest first (DBC: 0, "Motorola").
    Big,
}

/// What a signal's bits are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number from 0.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float,
}

/// When a signal is there (DBC: multiplexing).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// In every frame.
    Always,
    /// In every frame, and it says which others are there. One in a message.
    Switch,
    /// If the switch has this raw value.
    If(u32),
}

impl Signal {
    /// An unsigned signal of these bits, factor 1, without unit, always there.
    #[must_use]
    pub const fn new(name: &'static str, order: ByteOrder, start: u8, bits: u8) -> Self {
        Self {
            name,
            start,
            bits,
            order,
            kind: Kind::Unsigned,
            factor: 1.0,
            offset: 0.0,
            unit: "",
            values: &[],
            presence: Presence::Always,
        }
    }

    /// Of `bytes` whole bytes from byte `first` on, highest first.
    #[must_use]
    pub const fn big(name: &'static str, first: u8, bytes: u8) -> Self {
        Self::new(name, ByteOrder::Big, first * 8 + 7, bytes * 8)
    }

    /// Of `bytes` whole bytes from byte `first` on, lowest first.
    #[must_use]
    pub const fn little(name: &'static str, first: u8, bytes: u8) -> Self {
        Self::new(name, ByteOrder::Little, first * 8, bytes * 8)
    }

    /// The same in two's complement.
    #[must_use]
    pub const fn signed(mut self) -> Self {
        self.kind = Kind::Signed;
        self
    }

    /// The same as an IEEE 754 number.
    #[must_use]
    pub const fn float(mut self) -> Self {
        self.kind = Kind::Float;
        self
    }

    /// The same with a factor and a unit.
    #[must_use]
    pub const fn scaled(mut self, factor: f64, unit: &'static str) -> Self {
        (self.factor, self.unit) = (factor, unit);
        self
    }

    /// The same with an offset.
    #[must_use]
    pub const fn offset(mut self, offset: f64) -> Self {
        self.offset = offset;
        self
    }

    /// The same with names for raw values.
    #[must_use]
    pub const fn named(mut self, values: &'static [(u32, &'static str)]) -> Self {
        self.values = values;
        self
    }

    /// The same, there only when `presence` says so.
    #[must_use]
    pub const fn when(mut self, presence: Presence) -> Self {
        self.presence = presence;
        self
    }

    /// Its raw bits in a payload; `None` if the payload is too short.
    #[must_use]
    pub fn raw(&self, payload: &[u8]) -> Option<u64> {
        let mut raw = 0_u64;
        // Big endian: highest bit first, downwards within a byte and on to the next one's highest.
        let mut bit = u32::from(self.start);
        for index in 0..u32::from(self.bits) {
            let byte = payload.get((bit / 8) as usize)?;
            let set = u64::from(byte >> (bit % 8) & 1);
            match self.order {
                ByteOrder::Little => {
                    raw |= set << index;
                    bit += 1;
                }
                ByteOrder::Big => {
                    raw = raw << 1 | set;
                    bit = if bit % 8 == 0 { bit + 15 } else { bit - 1 };
                }
            }
        }
        Some(raw)
    }

    /// Its physical value in a payload; `None` if the payload is too short. Whether it is
    /// [present](Presence) is the caller's to know.
    #[must_use]
    #[expect(
        clippy::cast_precision_loss,
        reason = "no signal here has more than 53 bits that count"
    )]
    pub fn physical(&self, payload: &[u8]) -> Option<f64> {
        let raw = self.raw(payload)?;
        let unused = 64_u32.saturating_sub(self.bits.into());
        let number = match self.kind {
            Kind::Unsigned => raw as f64,
            Kind::Signed => (raw.cast_signed() << unused >> unused) as f64,
            Kind::Float => f32::from_bits(u32::try_from(raw).ok()?).into(),
        };
        Some(number * self.factor + self.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAYLOAD: [u8; 8] = [0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xF0];

    #[test]
    fn bits_are_counted_as_a_dbc_file_counts_them() {
        assert_eq!(Signal::big("a", 1, 2).raw(&PAYLOAD), Some(0x3456));
        assert_eq!(Signal::little("a", 1, 2).raw(&PAYLOAD), Some(0x5634));
        // 12 bits from the highest of byte 3; 12 bits from the middle of byte 4.
        assert_eq!(Signal::new("a", ByteOrder::Big, 31, 12).raw(&PAYLOAD), Some(0x789));
        assert_eq!(Signal::new("a", ByteOrder::Big, 35, 12).raw(&PAYLOAD), Some(0xABC));
        assert_eq!(Signal::new("a", ByteOrder::Little, 4, 12).raw(&PAYLOAD), Some(0x341));
        assert_eq!(Signal::big("a", 7, 2).raw(&PAYLOAD), None);
    }

    #[test]
    fn numbers_have_signs_scales_and_offsets() {
        let near = |value: Option<f64>, wanted: f64| (value.unwrap() - wanted).abs() < 1e-9;
        let signed = Signal::big("a", 6, 2).signed().scaled(0.5, "A").offset(1.0);
        assert!(near(signed.physical(&PAYLOAD), f64::from(-0x2110) * 0.5 + 1.0));
        assert!(near(Signal::little("a", 0, 1).physical(&PAYLOAD), 18.0));
        let float = Signal::little("a", 0, 4).float();
        assert!(near(float.physical(&[0, 0, 0x80, 0x3F]), 1.0));
    }
}
