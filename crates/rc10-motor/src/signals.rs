//! The layout of a vendor's frames, as data: for DBC files, `rc10 decode` and programs that read a
//! bus. Each table stands beside its codec and is tested against it, bit for bit.
//!
//! Plain messages come first, then what no DBC file describes: told by data, or remote.

use embedded_can::Id;
use rc10_can::{CanFrame, IdPattern};

/// The first bit of the identifier, for [`Signal::start`]: behind those of eight bytes.
const IDENTIFIER: u8 = 64;

/// One sort of frame of one device.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Message {
    /// The name: letters, digits and underscores.
    pub name: &'static str,
    /// The identifier.
    pub id: Id,
    /// Bits of the identifier that carry content and differ from frame to frame; 0 for most.
    pub varies: u32,
    /// Data bytes.
    pub len: u8,
    /// Whether it is a remote request: it has no data bytes, whatever its length.
    pub remote: bool,
    /// Whether the device sends it; else it is sent to the device.
    pub from_device: bool,
    /// The values that its data must have: they tell it from other frames with its identifier.
    pub marks: Marks,
    /// The signals.
    pub signals: &'static [Signal],
}

impl Message {
    /// A data frame with an identifier and a length of its own.
    pub const fn new(
        name: &'static str,
        id: Id,
        len: u8,
        from_device: bool,
        signals: &'static [Signal],
    ) -> Self {
        let (varies, remote, marks) = (0, false, Marks::NONE);
        Self { name, id, varies, len, remote, from_device, marks, signals }
    }

    /// The same, and these bits of its identifier are content.
    pub const fn varying(mut self, bits: u32) -> Self {
        self.varies = bits;
        self
    }

    /// The same, and its data must be so.
    pub const fn marked(mut self, marks: Marks) -> Self {
        self.marks = marks;
        self
    }

    /// The remote request for it, which is sent to the device.
    pub const fn requested(mut self) -> Self {
        (self.remote, self.from_device, self.signals) = (true, false, &[]);
        self
    }

    /// Whether identifier and length alone tell it, as in a DBC file. All others are *special*.
    pub fn is_plain(&self) -> bool {
        self.varies == 0 && !self.remote && self.marks == Marks::NONE
    }

    /// Whether a frame is one of these. Of several that fit, the last in a vendor's table is it.
    pub fn matches(&self, frame: &CanFrame) -> bool {
        IdPattern::exact(self.id).under(!self.varies).contains(frame.id())
            && frame.is_remote() == self.remote
            && (self.remote || frame.len() == usize::from(self.len))
            && self.marks.are_in(frame.bytes())
    }
}

/// Data bytes, or bits of them, that a frame must have. What lies behind the data counts as zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Marks {
    mask: u64,
    value: u64,
}

impl Marks {
    /// Any data.
    pub const NONE: Self = Self { mask: 0, value: 0 };

    /// These bytes, from the first on.
    pub const fn bytes<const N: usize>(bytes: [u8; N]) -> Self {
        let (mut mask, mut value) = ([0; 8], [0; 8]);
        let mut index = 0;
        while index < N && index < 8 {
            (mask[index], value[index]) = (0xFF, bytes[index]);
            index += 1;
        }
        Self::masked(mask, value)
    }

    /// These bits, where `mask` has ones.
    pub const fn masked(mask: [u8; 8], value: [u8; 8]) -> Self {
        let mask = u64::from_le_bytes(mask);
        Self { mask, value: u64::from_le_bytes(value) & mask }
    }

    /// Nothing behind `len` bytes: makes a message special that a DBC file has no room for.
    pub const fn behind(len: u8) -> Self {
        let mut mask = [0; 8];
        let mut index = len as usize;
        while index < 8 {
            mask[index] = 0xFF;
            index += 1;
        }
        Self::masked(mask, [0; 8])
    }

    fn are_in(&self, data: &[u8]) -> bool {
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(data).for_each(|(byte, data)| *byte = *data);
        u64::from_le_bytes(bytes) & self.mask == self.value
    }
}

/// Some bits of a frame, as a number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Signal {
    /// The name: letters, digits and underscores.
    pub name: &'static str,
    /// The first bit, as a DBC file counts: bit 0 is the lowest of byte 0, bit 8 of byte 1. Little
    /// endian: its lowest bit; big endian: its highest. From 64 on: the identifier's bits.
    pub start: u8,
    /// Bits, 1 ..= 64.
    pub bits: u8,
    /// In which order its bytes come.
    pub order: ByteOrder,
    /// The kind of number that its bits are.
    pub kind: Kind,
    /// Physical value = raw value · `factor` + `offset`.
    pub factor: f64,
    /// The offset; see `factor`.
    pub offset: f64,
    /// Unit of the physical value; empty if it has none.
    pub unit: &'static str,
    names: Names,
    /// The frames in which the signal is present.
    pub presence: Presence,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Names {
    /// Names of these values.
    Of(&'static [(u32, &'static str)]),
    /// Names of this value and of those that follow it.
    From(u32, &'static [&'static str]),
}

/// The order of a signal's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Lowest first (DBC: 1, "Intel").
    Little,
    /// Highest first (DBC: 0, "Motorola").
    Big,
}

/// The kind of number that a signal's bits are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number from 0.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float,
}

/// The frames in which a signal is present (DBC: multiplexing).
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
            names: Names::Of(&[]),
            presence: Presence::Always,
        }
    }

    /// A signal of `bytes` whole bytes from byte `first` on, highest first.
    pub const fn big(name: &'static str, first: u8, bytes: u8) -> Self {
        Self::new(name, ByteOrder::Big, first * 8 + 7, bytes * 8)
    }

    /// A signal of `bytes` whole bytes from byte `first` on, lowest first.
    pub const fn little(name: &'static str, first: u8, bytes: u8) -> Self {
        Self::new(name, ByteOrder::Little, first * 8, bytes * 8)
    }

    /// A signal of `bits` bits of the identifier from bit `first` on.
    pub const fn in_id(name: &'static str, first: u8, bits: u8) -> Self {
        Self::new(name, ByteOrder::Little, IDENTIFIER + first, bits)
    }

    /// The same in two's complement.
    pub const fn signed(mut self) -> Self {
        self.kind = Kind::Signed;
        self
    }

    /// The same as an IEEE 754 number.
    pub const fn float(mut self) -> Self {
        self.kind = Kind::Float;
        self
    }

    /// The same with a factor and a unit.
    pub const fn scaled(mut self, factor: f64, unit: &'static str) -> Self {
        (self.factor, self.unit) = (factor, unit);
        self
    }

    /// The same with an offset.
    pub const fn offset(mut self, offset: f64) -> Self {
        self.offset = offset;
        self
    }

    /// The same with names for raw values.
    pub const fn named(mut self, values: &'static [(u32, &'static str)]) -> Self {
        self.names = Names::Of(values);
        self
    }

    /// The same with names for the raw values from `first` on.
    pub const fn listed(mut self, first: u32, names: &'static [&'static str]) -> Self {
        self.names = Names::From(first, names);
        self
    }

    /// The same as a bit that means this if it is set.
    pub const fn flag(self, name: &'static &'static str) -> Self {
        self.listed(1, core::slice::from_ref(name))
    }

    /// The raw values that have names, and their names.
    pub fn values(&self) -> impl Iterator<Item = (u32, &'static str)> + use<> {
        let (named, first, listed): (&[_], _, &[_]) = match self.names {
            Names::Of(named) => (named, 0, &[]),
            Names::From(first, listed) => (&[], first, listed),
        };
        named.iter().copied().chain((first..).zip(listed.iter().copied()))
    }

    /// The same, there only when `presence` says so.
    pub const fn when(mut self, presence: Presence) -> Self {
        self.presence = presence;
        self
    }

    /// The raw bits in a payload; `None` if the payload is too short.
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

    /// The raw bits in a frame; `None` if the frame is too short.
    pub fn raw_in(&self, frame: &CanFrame) -> Option<u64> {
        match self.start.checked_sub(IDENTIFIER) {
            Some(start) => Self { start, ..*self }.raw(&frame.raw_id().to_le_bytes()),
            None => self.raw(frame.bytes()),
        }
    }

    /// The physical value in a payload, [present](Presence) or not; `None` if that is too short.
    pub fn physical(&self, payload: &[u8]) -> Option<f64> {
        self.scale(self.raw(payload)?)
    }

    /// The physical value in a frame, like [`physical`](Self::physical).
    pub fn physical_in(&self, frame: &CanFrame) -> Option<f64> {
        self.scale(self.raw_in(frame)?)
    }

    /// Exact: no signal here has more than 53 bits that count.
    fn scale(&self, raw: u64) -> Option<f64> {
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
    use embedded_can::{ExtendedId, StandardId};

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
    fn a_message_is_told_by_identifier_length_and_marks() {
        let standard = |id| StandardId::new(id).unwrap();
        let frame = |id, data: &[u8]| CanFrame::data_frame(standard(id), data).unwrap();
        let plain = Message::new("A", standard(0x123).into(), 3, false, &[]);
        assert!(plain.is_plain() && plain.matches(&frame(0x123, &[1, 2, 3])));
        assert!(!plain.matches(&frame(0x122, &[1, 2, 3])));
        assert!(!plain.matches(&frame(0x123, &[1, 2])));
        let extended = ExtendedId::new(0x123).unwrap();
        assert!(!plain.matches(&CanFrame::data_frame(extended, &[1, 2, 3]).unwrap()));
        assert!(!plain.matches(&CanFrame::remote_frame(standard(0x123), 3).unwrap()));

        let marked = plain.marked(Marks::bytes([1, 2]));
        assert!(!marked.is_plain() && marked.matches(&frame(0x123, &[1, 2, 9])));
        assert!(!marked.matches(&frame(0x123, &[1, 3, 9])));
        let bits = Marks::masked([0, 0x0F, 0, 0, 0, 0, 0, 0], [0xFF, 0xF2, 0, 0, 0, 0, 0, 0]);
        assert!(plain.marked(bits).matches(&frame(0x123, &[7, 0x52, 9])));
        assert!(!plain.marked(bits).matches(&frame(0x123, &[7, 0x53, 9])));

        let varying = plain.varying(0x0F0);
        assert!(!varying.is_plain() && varying.matches(&frame(0x1F3, &[0; 3])));
        assert!(!varying.matches(&frame(0x223, &[0; 3])));
        let nibble = Signal::in_id("N", 4, 4).scaled(0.5, "A").offset(1.0);
        assert_eq!(nibble.raw_in(&frame(0x1F3, &[0; 3])), Some(0xF));
        assert!((nibble.physical_in(&frame(0x1A3, &[0; 3])).unwrap() - 6.0).abs() < 1e-9);
        assert_eq!(Signal::big("P", 1, 1).raw_in(&frame(0x1A3, &[0, 7])), Some(7));

        let request = plain.requested();
        assert!(!request.is_plain() && !request.matches(&frame(0x123, &[1, 2, 3])));
        assert!(request.matches(&CanFrame::remote_frame(standard(0x123), 8).unwrap()));
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
