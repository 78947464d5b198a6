//! Frames and filters in bxCAN's registers (RM0090, `CAN_TIxR`, `CAN_RIxR`, `CAN_FiRx`).

use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, IdPattern};

/// Identifier, length, lower and upper four bytes.
pub const REGISTERS: usize = 4;

const STANDARD_SHIFT: u32 = 21;
const EXTENDED_SHIFT: u32 = 3;
const EXTENDED: u32 = 1 << 2;
const REMOTE: u32 = 1 << 1;
/// Transmission request; not in received frames.
pub const REQUEST: u32 = 1 << 0;

/// The registers of a mailbox, without [`REQUEST`].
#[must_use]
pub fn encode(frame: &CanFrame) -> [u32; REGISTERS] {
    let remote = if frame.is_remote() { REMOTE } else { 0 };
    let mut data = [0; 8];
    data[..frame.bytes().len()].copy_from_slice(frame.bytes());
    let [a, b, c, d, e, f, g, h] = data;
    let (low, high) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    [identifier(frame.id()) | remote, u32::try_from(frame.len()).unwrap_or(8), low, high]
}

/// The frame of the registers of a receive FIFO.
#[must_use]
pub fn decode([identifier, length, low, high]: [u32; REGISTERS]) -> CanFrame {
    let id = if identifier & EXTENDED == 0 {
        let raw = u16::try_from(identifier >> STANDARD_SHIFT).unwrap_or(0);
        Id::Standard(StandardId::new(raw).unwrap_or(StandardId::ZERO))
    } else {
        Id::Extended(ExtendedId::new(identifier >> EXTENDED_SHIFT).unwrap_or(ExtendedId::ZERO))
    };
    // Lengths above 8 are legal on a classic wire and mean 8.
    let len = (length as usize & 0xF).min(8);
    let [a, b, c, d] = low.to_le_bytes();
    let [e, f, g, h] = high.to_le_bytes();
    let data = [a, b, c, d, e, f, g, h];
    let frame = if identifier & REMOTE != 0 {
        CanFrame::remote_frame(id, len)
    } else {
        CanFrame::data_frame(id, &data[..len])
    };
    // At most eight bytes: there is no error to hide.
    frame.unwrap_or_else(|_| CanFrame::eight_bytes(id, data))
}

/// Identifier and mask of a filter bank in 32-bit mask mode: lets the pattern's data frames in.
#[must_use]
pub fn filter(pattern: &IdPattern) -> [u32; 2] {
    let shift = if pattern.is_extended() { EXTENDED_SHIFT } else { STANDARD_SHIFT };
    // The bits of a standard identifier that there are not are shifted out.
    [identifier(pattern.id()), pattern.mask() << shift | EXTENDED | REMOTE]
}

fn identifier(id: Id) -> u32 {
    match id {
        Id::Standard(id) => u32::from(id.as_raw()) << STANDARD_SHIFT,
        Id::Extended(id) => id.as_raw() << EXTENDED_SHIFT | EXTENDED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standard_identifier_lies_in_the_upper_bits_and_data_little_endian() {
        let id = StandardId::new(0x201).unwrap();
        let frame = CanFrame::data_frame(id, &[1, 2, 3, 4, 5]).unwrap();
        let registers = [0x4020_0000, 5, 0x0403_0201, 0x0000_0005];
        assert_eq!(encode(&frame), registers);
        assert_eq!(decode(registers), frame);
        // What the receiver adds: filter match index, time; bytes past the length.
        assert_eq!(decode([0x4020_0000, 0xABCD_0705, 0x0403_0201, 0x9988_7705]), frame);
    }

    #[test]
    fn an_extended_identifier_is_marked_by_bit_2_and_a_remote_request_by_bit_1() {
        let id = ExtendedId::new(0x1ABC_DEF0).unwrap();
        let frame = CanFrame::remote_frame(id, 3).unwrap();
        let registers = [0x1ABC_DEF0 << 3 | 0b110, 3, 0, 0];
        assert_eq!(encode(&frame), registers);
        assert_eq!(decode(registers), frame);
    }

    #[test]
    fn a_filter_lets_in_what_its_pattern_matches() {
        let accepts = |pattern: IdPattern, frame: &CanFrame| {
            let [id, mask] = filter(&pattern);
            (encode(frame)[0] ^ id) & mask == 0
        };
        let patterns = [
            IdPattern::standard(0x205),
            IdPattern::standard(0x200).under(0x7F0),
            IdPattern::any_standard(),
            IdPattern::extended(0x205),
            IdPattern::extended(0x005).under(0x0FF),
            IdPattern::any_extended(),
        ];
        for raw in [0, 0x005, 0x105, 0x200, 0x205, 0x20F, 0x210, 0x7FF] {
            let standard = Id::Standard(StandardId::new(raw).unwrap());
            let extended = Id::Extended(ExtendedId::new(raw.into()).unwrap());
            for id in [standard, extended] {
                let data = CanFrame::eight_bytes(id, [0; 8]);
                let remote = CanFrame::remote_frame(id, 0).unwrap();
                for pattern in patterns {
                    assert_eq!(accepts(pattern, &data), pattern.matches(&data), "{pattern} {id:?}");
                    assert!(!accepts(pattern, &remote), "{pattern} {id:?}");
                }
            }
        }
    }
}
