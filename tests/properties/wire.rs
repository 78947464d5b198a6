//! Frames and identifiers, against slow and obvious versions of the same thing.

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_can::{CanFrame, IdPattern, LengthBounds};
use rc10_motor::TxBatch;

use super::any;

fn standard(raw: u16) -> StandardId {
    StandardId::new(raw).unwrap()
}

fn extended(raw: u32) -> ExtendedId {
    ExtendedId::new(raw).unwrap()
}

/// Every bit from the start of the frame to the end of the data.
fn bits(frame: &CanFrame) -> Vec<bool> {
    let mut text = String::from("0");
    let id = frame.raw_id();
    let remote = u8::from(frame.is_remote());
    if frame.is_extended_id() {
        text += &format!("{:011b}11{:018b}{remote}00", id >> 18, id & 0x3_FFFF);
    } else {
        text += &format!("{id:011b}{remote}00");
    }
    text += &format!("{:04b}", frame.len());
    frame.bytes().iter().for_each(|byte| text += &format!("{byte:08b}"));
    text.chars().map(|digit| digit == '1').collect()
}

/// The remainder of the polynomial division by x¹⁵ + x¹⁴ + x¹⁰ + x⁸ + x⁷ + x⁴ + x³ + 1.
fn remainder(bits: &[bool]) -> u16 {
    let mut rest: Vec<_> = bits.iter().copied().chain([false; 15]).collect();
    for at in 0..bits.len() {
        if rest[at] {
            for power in [15, 14, 10, 8, 7, 4, 3, 0] {
                rest[at + 15 - power] ^= true;
            }
        }
    }
    rest[bits.len()..].iter().fold(0, |sum, &bit| sum << 1 | u16::from(bit))
}

/// The bits with a stuff bit after every five equal ones.
fn stuffed(bits: &[bool]) -> Vec<bool> {
    let mut sent: Vec<bool> = Vec::new();
    for &bit in bits {
        sent.push(bit);
        if sent.len() >= 5 && sent[sent.len() - 5..].iter().all(|&other| other == bit) {
            // A stuff bit counts in the next run, so what is behind it must not count any more.
            sent.push(!bit);
        }
    }
    sent
}

proptest! {
    #![proptest_config(any::cases(3000))]

    #[test]
    fn lengths_are_those_of_the_bits_on_the_wire(
        id in any::id(),
        byte in any::<u8>(),
        monotonous in any::<bool>(),
        mut bytes in vec(any::<u8>(), 0..=8),
        remote in any::<bool>(),
    ) {
        if monotonous {
            bytes.fill(if byte & 1 == 0 { 0 } else { byte });
        }
        let frame = if remote {
            CanFrame::remote_frame(id, bytes.len()).unwrap()
        } else {
            CanFrame::data_frame(id, &bytes).unwrap()
        };
        let mut bits = bits(&frame);
        let length = frame.wire_length();
        prop_assert_eq!(length.crc15, remainder(&bits));
        bits.extend((0..15).rev().map(|place| length.crc15 >> place & 1 == 1));
        // CRC delimiter, acknowledge slot and delimiter, end of frame, interframe space.
        prop_assert_eq!(usize::from(length.unstuffed), bits.len() + 1 + 2 + 7 + 3);
        prop_assert_eq!(usize::from(length.stuff_bits), stuffed(&bits).len() - bits.len());
        let bounds = LengthBounds::of(frame.bytes().len(), frame.is_extended_id());
        prop_assert_eq!(bounds.min, u32::from(length.unstuffed));
        prop_assert!((bounds.min..=bounds.max).contains(&length.total()));
        prop_assert!((bounds.min..=bounds.max).contains(&bounds.typical()));
    }

    #[test]
    fn standard_patterns_overlap_where_an_id_belongs_to_both(
        ids in (0..=0x7FF_u16, 0..=0x7FF_u16),
        masks in (any::<u32>(), any::<u32>()),
        sparse in any::<bool>(),
    ) {
        // Half of the random masks have more bits than any overlap allows.
        let thin = |mask: u32| if sparse { mask & mask >> 3 & mask >> 7 } else { mask };
        let one = IdPattern::exact(standard(ids.0)).under(thin(masks.0));
        let other = IdPattern::exact(standard(ids.1)).under(thin(masks.1));
        let both = |id: IdPattern| one.contains(id.id()) && other.contains(id.id());
        let shared = (0..=0x7FF).any(|raw| both(standard(raw).into()));
        let overlap = one.overlap(&other);
        prop_assert_eq!(overlap.is_some(), shared);
        prop_assert!(overlap.is_none_or(both));
        prop_assert_eq!(other.overlap(&one).is_some(), shared);
        let exact = (0..=0x7FF).filter(|&raw| one.contains(standard(raw).into())).count() == 1;
        prop_assert_eq!(one.is_exact(), exact);
    }

    #[test]
    fn extended_patterns_overlap_where_an_id_belongs_to_both(
        ids in (0..=0x1FFF_FFFF_u32, 0..=0x1FFF_FFFF_u32),
        masks in (any::<u32>(), any::<u32>()),
        related in any::<bool>(),
    ) {
        let one = IdPattern::exact(extended(ids.0)).under(masks.0);
        let second = if related { ids.0 ^ (ids.1 & !masks.1 & 0x1FFF_FFFF) } else { ids.1 };
        let other = IdPattern::exact(extended(second)).under(masks.1);
        let overlap = one.overlap(&other);
        prop_assert!(!related || overlap.is_some());
        prop_assert!(overlap.is_none_or(|id| one.contains(id.id()) && other.contains(id.id())));
        prop_assert_eq!(overlap.is_some(), (ids.0 ^ second) & masks.0 & masks.1 & 0x1FFF_FFFF == 0);
        prop_assert!(!one.contains(standard(0x123).into()));
    }

    /// Lanes and whole frames in any order: as if written into a list of frames by hand.
    #[test]
    fn a_batch_keeps_what_was_written(
        steps in vec(
            (0..24_u16, prop_oneof![0..9_usize, Just(usize::MAX)], any::<[u8; 2]>(), 0..10_u8),
            1..80,
        ),
    ) {
        let mut tx = TxBatch::new();
        let mut model: Vec<(u16, Vec<u8>)> = Vec::new();
        for (id, offset, bytes, what) in steps {
            let full = model.len() == TxBatch::CAPACITY;
            let (outcome, expected) = if what == 0 {
                let data = vec![bytes[0]; offset.min(8)];
                let frame = CanFrame::data_frame(standard(id), &data).unwrap();
                if !full {
                    model.push((id, data));
                }
                (tx.push(frame), !full)
            } else {
                let newest = model.iter_mut().rev().find(|(known, _)| *known == id);
                let room = match newest {
                    Some((_, data)) if data.len() == 8 && offset <= 6 => {
                        data[offset..offset + 2].copy_from_slice(&bytes);
                        true
                    }
                    None if offset <= 6 && !full => {
                        let mut data = vec![0; 8];
                        data[offset..offset + 2].copy_from_slice(&bytes);
                        model.push((id, data));
                        true
                    }
                    _ => false,
                };
                (tx.lane(standard(id), offset, bytes), room)
            };
            prop_assert_eq!(outcome.is_ok(), expected);
            if !expected {
                prop_assert_eq!(tx.refused(), Some(standard(id).into()));
            }
        }
        let written = model.iter().map(|(id, data)| CanFrame::data_frame(standard(*id), data));
        let written: Result<Vec<_>, _> = written.collect();
        prop_assert_eq!(tx.frames(), written.unwrap());
    }
}
