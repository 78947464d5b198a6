use crate::CanFrame;

/// Duration of a frame on the bus, in bit times, interframe space included.
///
/// Start to CRC is stuffed: a bit after five equal ones (ISO 11898-1, "Bit stuffing").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireLength {
    /// Bits without stuffing, with the 3-bit interframe space.
    pub unstuffed: u16,
    /// Bits that stuffing inserts into this very frame.
    pub stuff_bits: u16,
    /// The 15-bit CRC the frame carries.
    pub crc15: u16,
}

impl WireLength {
    /// All bit times the frame takes: microseconds at 1 Mbit/s.
    #[inline]
    #[must_use]
    pub const fn total(self) -> u32 {
        self.unstuffed as u32 + self.stuff_bits as u32
    }
}

/// Shortest and longest length on the wire, in bit times, with interframe space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct LengthBounds {
    /// No stuff bit at all.
    pub min: u32,
    /// A stuff bit after the first five bits and then after every fourth.
    pub max: u32,
}

/// Stuffed bits around the data field: start-of-frame, identifier, control bits, CRC.
const STUFFED_STANDARD: u32 = 34;
const STUFFED_EXTENDED: u32 = 54;
/// Bits never stuffed: CRC delimiter, ACK slot and delimiter, end (7), interframe space (3).
const UNSTUFFED_TAIL: u32 = 13;

impl LengthBounds {
    /// Bounds for a data frame with `len` data bytes (0 ..= 8; more counts as 8).
    ///
    /// Source: `8n + g + 13` and `⌊(g + 8n - 1) / 4⌋` stuff bits, g = 34 or 54; Davis, Burns, Bril,
    /// Lukkien, "Controller Area Network (CAN) schedulability analysis", 2007.
    pub const fn of(len: usize, extended: bool) -> Self {
        let g = if extended { STUFFED_EXTENDED } else { STUFFED_STANDARD };
        let bytes = if len < 8 { len } else { 8 };
        #[expect(clippy::cast_possible_truncation, reason = "at most 64")]
        let stuffed = g + 8 * bytes as u32;
        let min = stuffed + UNSTUFFED_TAIL;
        Self { min, max: min + (stuffed - 1) / 4 }
    }

    /// Typical length: 30 % of the most stuff bits, as motors show (118 of 111 ..= 135 bits).
    #[must_use]
    pub const fn typical(self) -> u32 {
        self.min + (self.max - self.min) * 3 / 10
    }
}

/// CRC-15/CAN: polynomial 0x4599, initial value 0 (ISO 11898-1).
const CRC15_POLYNOMIAL: u16 = 0x4599;

/// Feeds bits through the CRC and the stuffing rule at once.
struct Wire {
    crc: u16,
    count: u16,
    stuff_bits: u16,
    run: u8,
    last: bool,
}

impl Wire {
    fn bit(&mut self, bit: bool) {
        if (self.crc & 0x4000 != 0) == bit {
            self.crc = (self.crc << 1) & 0x7FFF;
        } else {
            self.crc = ((self.crc << 1) & 0x7FFF) ^ CRC15_POLYNOMIAL;
        }
        self.stuff(bit);
    }

    fn stuff(&mut self, bit: bool) {
        self.count += 1;
        if self.run > 0 && bit == self.last {
            self.run += 1;
        } else {
            self.run = 1;
            self.last = bit;
        }
        if self.run == 5 {
            // The stuff bit is the first of the next run.
            self.stuff_bits += 1;
            self.last = !bit;
            self.run = 1;
        }
    }

    fn bits(&mut self, value: u32, width: u32) {
        for shift in (0..width).rev() {
            self.bit(value >> shift & 1 != 0);
        }
    }
}

impl CanFrame {
    /// The exact length of this frame on the wire.
    #[must_use]
    pub fn wire_length(&self) -> WireLength {
        let mut wire = Wire { crc: 0, count: 0, stuff_bits: 0, run: 0, last: true };
        let remote = self.is_remote();
        let id = self.raw_id();
        wire.bit(false); // start of frame
        if self.is_extended_id() {
            wire.bits(id >> 18, 11);
            wire.bits(0b11, 2); // SRR, IDE
            wire.bits(id & 0x3_FFFF, 18);
            wire.bit(remote);
            wire.bits(0, 2); // r1, r0
        } else {
            wire.bits(id, 11);
            wire.bit(remote);
            wire.bits(0, 2); // IDE, r0
        }
        #[expect(clippy::cast_possible_truncation, reason = "0 ..= 8")]
        wire.bits(self.len() as u32, 4);
        for &byte in self.bytes() {
            wire.bits(u32::from(byte), 8);
        }
        let crc15 = wire.crc;
        for shift in (0..15).rev() {
            wire.stuff(crc15 >> shift & 1 != 0);
        }
        #[expect(clippy::cast_possible_truncation, reason = "13")]
        let unstuffed = wire.count + UNSTUFFED_TAIL as u16;
        WireLength { unstuffed, stuff_bits: wire.stuff_bits, crc15 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};

    #[test]
    fn an_all_zero_command_is_the_longest_usual_frame() {
        let frame = CanFrame::eight_bytes(StandardId::new(0x200).unwrap(), [0; 8]);
        let length = frame.wire_length();
        assert_eq!((length.unstuffed, length.stuff_bits, length.crc15), (111, 15, 0x55BD));
    }

    /// Every shape once by hand: runs of exactly five, a run that goes on after its stuff bit, and
    /// one that the stuff bit itself begins.
    #[test]
    fn a_stuff_bit_follows_five_equal_bits_and_begins_the_next_run() {
        let stuffed = |bits: &str| {
            let mut wire = Wire { crc: 0, count: 0, stuff_bits: 0, run: 0, last: true };
            bits.bytes().for_each(|bit| wire.bit(bit == b'1'));
            wire.stuff_bits
        };
        for (bits, expected) in [
            ("1111", 0),
            ("11110", 0),
            ("11111", 1),
            ("0111110", 1),
            // Nine equal bits: one after the fifth, and none again before the tenth.
            ("111111111", 1),
            ("1111111111", 2),
            // The stuff bit and four more like it.
            ("000001111", 2),
            ("00000111", 1),
            ("0101010101", 0),
        ] {
            assert_eq!(stuffed(bits), expected, "{bits}");
        }
    }

    #[test]
    fn bounds_hold_for_every_shape() {
        for len in 0..=8 {
            for pattern in [0x00, 0xFF, 0x0F, 0x07, 0x1F, 0x3C, 0xAA] {
                for id in [0, 0x0F, 0x1F, 0x5A5, 0x7FF] {
                    let data = [pattern; 8];
                    let short = CanFrame::data_frame(StandardId::new(id).unwrap(), &data[..len]);
                    let id = ExtendedId::new(u32::from(id) << 18 | 0x1F0F0).unwrap();
                    let long = CanFrame::data_frame(id, &data[..len]);
                    for frame in [short.unwrap(), long.unwrap()] {
                        let bounds = LengthBounds::of(len, frame.is_extended_id());
                        let length = frame.wire_length();
                        assert_eq!(bounds.min, u32::from(length.unstuffed), "{frame}");
                        assert!(length.total() <= bounds.max, "{frame}");
                    }
                }
            }
        }
    }

    #[test]
    fn typical_is_118_bits_for_a_motor_frame() {
        assert_eq!(LengthBounds::of(8, false), LengthBounds { min: 111, max: 135 });
        assert_eq!(LengthBounds::of(8, false).typical(), 118);
    }
}
