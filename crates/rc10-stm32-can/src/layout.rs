//! Frames and filters in bxCAN's registers (RM0090, `CAN_TIxR`, `CAN_RIxR`, `CAN_FiRx`): the fields of
//! [`rc10_can::m_can`] in other places.

use rc10_can::m_can;
use rc10_can::{CanFrame, IdPattern};

/// Identifier, length, lower and upper four bytes.
pub const REGISTERS: usize = m_can::ELEMENT;

/// The identifier begins three bits higher than in `M_CAN`, the two flags for extended and remote 28 lower.
const IDENTIFIER_SHIFT: u32 = 3;
const FLAGS_SHIFT: u32 = 28;
const EXTENDED: u32 = 1 << 2;
const REMOTE: u32 = 1 << 1;
const LENGTH_SHIFT: u32 = 16;
/// A standard identifier has the upper 11 of the 29 bits.
const STANDARD_SHIFT: u32 = IDENTIFIER_SHIFT + 18;
/// Transmission request; not in received frames.
pub const REQUEST: u32 = 1 << 0;

/// The registers of a mailbox, without [`REQUEST`].
#[must_use]
pub fn encode(frame: &CanFrame) -> [u32; REGISTERS] {
    let [header, length, low, high] = m_can::encode(frame);
    let flags = header >> FLAGS_SHIFT & (EXTENDED | REMOTE);
    [header << IDENTIFIER_SHIFT | flags, length >> LENGTH_SHIFT, low, high]
}

/// The frame of the registers of a receive FIFO.
#[must_use]
pub fn decode([identifier, length, low, high]: [u32; REGISTERS]) -> CanFrame {
    let flags = (identifier & (EXTENDED | REMOTE)) << FLAGS_SHIFT;
    m_can::decode([identifier >> IDENTIFIER_SHIFT | flags, length << LENGTH_SHIFT, low, high])
}

/// Identifier and mask of a filter bank in 32-bit mask mode: lets the pattern's data frames in.
#[must_use]
pub fn filter(pattern: &IdPattern) -> [u32; 2] {
    let [identifier, ..] = encode(&CanFrame::eight_bytes(pattern.id(), [0; 8]));
    let shift = if pattern.is_extended() { IDENTIFIER_SHIFT } else { STANDARD_SHIFT };
    // The bits of a standard identifier that there are not are shifted out.
    [identifier, pattern.mask() << shift | EXTENDED | REMOTE]
}

#[cfg(test)]
mod tests {
    use rc10_can::embedded_can::{ExtendedId, Id, StandardId};

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
