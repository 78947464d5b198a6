//! Frames and filters in the message RAM of Bosch's `M_CAN` (ST: FDCAN), the same in every chip.

use embedded_can::{ExtendedId, Id, StandardId};

use crate::{CanFrame, IdPattern};

/// Words of an element with eight data bytes: two of header, two of data.
pub const ELEMENT: usize = 4;

// Header bits of receive and transmit elements (RM0468, FDCAN, "Rx FIFO element"; RM0440 too).
const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;
const STANDARD_ID_SHIFT: u32 = 18;
const LENGTH_SHIFT: u32 = 16;
/// Lengths 8 ..= 15: those above 8 are legal on a classic wire and mean 8.
const WHOLE: u32 = 8 << LENGTH_SHIFT;

/// A frame as a transmit buffer holds it.
#[inline]
#[must_use]
pub fn encode(frame: &CanFrame) -> [u32; ELEMENT] {
    let id = match frame.id() {
        Id::Standard(id) => u32::from(id.as_raw()) << STANDARD_ID_SHIFT,
        Id::Extended(id) => id.as_raw() | EXTENDED,
    };
    match frame.all_eight() {
        Some(data) => element(id, 8, *data),
        None => encode_other(frame, id),
    }
}

#[cold]
fn encode_other(frame: &CanFrame, id: u32) -> [u32; ELEMENT] {
    let length = u32::try_from(frame.len()).unwrap_or(8);
    let remote = if frame.is_remote() { REMOTE } else { 0 };
    let mut data = [0; 8];
    data[..frame.bytes().len()].copy_from_slice(frame.bytes());
    element(id | remote, length, data)
}

#[inline]
const fn element(header: u32, length: u32, [a, b, c, d, e, f, g, h]: [u8; 8]) -> [u32; ELEMENT] {
    let (low, high) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    [header, length << LENGTH_SHIFT, low, high]
}

/// The frame of an element of a receive FIFO.
#[inline]
#[must_use]
pub fn decode(element: [u32; ELEMENT]) -> CanFrame {
    let [header, length, low, high] = element;
    // Nearly every motor's frames are standard ones of eight bytes.
    if header & (EXTENDED | REMOTE) == 0 && length & WHOLE != 0 {
        CanFrame::eight_bytes(standard(header), bytes(low, high))
    } else {
        decode_other(element)
    }
}

#[inline(never)]
fn decode_other([header, length, low, high]: [u32; ELEMENT]) -> CanFrame {
    let id = if header & EXTENDED == 0 {
        Id::Standard(standard(header))
    } else {
        Id::Extended(ExtendedId::new(header & 0x1FFF_FFFF).unwrap_or(ExtendedId::ZERO))
    };
    let len = ((length >> LENGTH_SHIFT) as usize & 0xF).min(8);
    let data = bytes(low, high);
    let frame = if header & REMOTE != 0 {
        CanFrame::remote_frame(id, len)
    } else {
        CanFrame::data_frame(id, &data[..len])
    };
    // At most eight bytes: there is no error to hide.
    frame.unwrap_or_else(|_| CanFrame::eight_bytes(id, data))
}

#[inline]
fn standard(header: u32) -> StandardId {
    let raw = (header >> STANDARD_ID_SHIFT) & 0x7FF;
    StandardId::new(raw as u16).unwrap_or(StandardId::ZERO)
}

#[inline]
const fn bytes(low: u32, high: u32) -> [u8; 8] {
    let [a, b, c, d] = low.to_le_bytes();
    let [e, f, g, h] = high.to_le_bytes();
    [a, b, c, d, e, f, g, h]
}

/// The time stamp of a receive element: bit times modulo 2¹⁶ when the frame began.
#[inline]
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "the lower half of the word")]
pub const fn time_stamp([_, length, ..]: [u32; ELEMENT]) -> u16 {
    length as u16
}

// An identifier and a mask, to FIFO 0 (RM0468, FDCAN, "filter element"); zeros are no filter.
const STANDARD_BY_MASK: u32 = 0b10 << 30;
const STANDARD_TO_FIFO_0: u32 = 0b001 << 27;
const STANDARD_FILTER_ID_SHIFT: u32 = 16;
const EXTENDED_TO_FIFO_0: u32 = 0b001 << 29;
const EXTENDED_BY_MASK: u32 = 0b10 << 30;

/// Words of a filter for extended identifiers; one for standard identifiers has one.
pub const EXTENDED_FILTER: usize = 2;

/// Writes all filters, one for each pattern in order; others let nothing in. With too many patterns
/// the last filter of a size lets all of it in: too much, never too little. `standard` has one word
/// a filter, `extended` [`EXTENDED_FILTER`], one filter at least.
pub fn filters(patterns: &[IdPattern], standard: &mut [u32], extended: &mut [u32]) {
    standard.fill(0);
    extended.fill(0);
    let (mut standards, mut extendeds) = (0, 0);
    for pattern in patterns {
        match pattern.id() {
            Id::Standard(id) => {
                let (place, mask) = place(&mut standards, standard.len(), pattern.mask() & 0x7FF);
                let id = u32::from(id.as_raw()) << STANDARD_FILTER_ID_SHIFT;
                standard[place] = STANDARD_BY_MASK | STANDARD_TO_FIFO_0 | id | mask;
            }
            Id::Extended(id) => {
                let most = extended.len() / EXTENDED_FILTER;
                let (place, mask) = place(&mut extendeds, most, pattern.mask());
                extended[EXTENDED_FILTER * place] = EXTENDED_TO_FIFO_0 | id.as_raw();
                extended[EXTENDED_FILTER * place + 1] = EXTENDED_BY_MASK | mask;
            }
        }
    }
}

/// The place and the mask of the next filter.
const fn place(used: &mut usize, most: usize, mask: u32) -> (usize, u32) {
    if *used == most {
        // Every identifier equals the one that is there in no bit at all.
        return (most - 1, 0);
    }
    *used += 1;
    (*used - 1, mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hardware's handling of an identifier (RM0468, as above).
    fn is_let_in(id: Id, standard: &[u32], extended: &[u32]) -> bool {
        match id {
            Id::Standard(id) => standard.iter().any(|filter| {
                let matches = (filter >> 16 ^ u32::from(id.as_raw())) & filter & 0x7FF == 0;
                filter >> 27 == 0b10_001 && matches
            }),
            Id::Extended(id) => extended.chunks(EXTENDED_FILTER).any(|filter| {
                let matches = (filter[0] ^ id.as_raw()) & filter[1] & 0x1FFF_FFFF == 0;
                filter[0] >> 29 == 0b001 && filter[1] >> 30 == 0b10 && matches
            }),
        }
    }

    fn ids() -> impl Iterator<Item = Id> {
        let raws = [0, 0x005, 0x105, 0x200, 0x201, 0x205, 0x20F, 0x210, 0x7FF];
        let extended = [0x0800, 0x1ABC_DEF0, 0x1FFF_FFFF].into_iter();
        let standard = raws.into_iter().map(|raw| Id::Standard(StandardId::new(raw).unwrap()));
        let extended = raws.into_iter().map(u32::from).chain(extended);
        standard.chain(extended.map(|raw| Id::Extended(ExtendedId::new(raw).unwrap())))
    }

    #[test]
    fn a_filter_is_an_identifier_and_a_mask_to_fifo_0_and_the_others_are_none() {
        let (mut standard, mut extended) = ([!0; 3], [!0; 4]);
        let patterns = [IdPattern::extended(0x1ABC_DEF0), IdPattern::standard(0x205).under(0x7F0)];
        filters(&patterns, &mut standard, &mut extended);
        // SFT = mask, SFEC = FIFO 0, SFID1, SFID2.
        assert_eq!(standard, [0x8A05_07F0, 0, 0]);
        // EFEC = FIFO 0, EFID1; EFT = mask, EFID2.
        assert_eq!(extended, [0x3ABC_DEF0, 0x9FFF_FFFF, 0, 0]);
    }

    #[test]
    fn filters_let_in_what_their_patterns_match_and_nothing_without_patterns() {
        let all = [
            IdPattern::standard(0x205),
            IdPattern::standard(0x200).under(0x7F0),
            IdPattern::extended(0x205),
            IdPattern::extended(0x005).under(0x0FF),
        ];
        let any = [IdPattern::any_standard(), IdPattern::any_extended()];
        for patterns in [&all[..], &all[..1], &all[2..], &any, &any[..1], &any[1..], &[]] {
            let (mut standard, mut extended) = ([!0; 3], [!0; 6]);
            filters(patterns, &mut standard, &mut extended);
            for id in ids() {
                let frame = CanFrame::eight_bytes(id, [0; 8]);
                let is_wanted = patterns.iter().any(|pattern| pattern.matches(&frame));
                assert_eq!(is_let_in(id, &standard, &extended), is_wanted, "{id:?} {patterns:?}");
            }
        }
    }

    #[test]
    fn with_more_patterns_than_filters_every_identifier_of_that_size_comes_in() {
        let three = |pattern: fn(u16) -> IdPattern| [0x201, 0x202, 0x203].map(pattern);
        let standards = three(IdPattern::standard);
        let extendeds = three(|raw| IdPattern::extended(raw.into()));
        for (patterns, is_extended) in [(standards, false), (extendeds, true)] {
            let (mut standard, mut extended) = ([0; 2], [0; 4]);
            filters(&patterns, &mut standard, &mut extended);
            for id in ids() {
                let is_of_that_size = matches!(id, Id::Extended(_)) == is_extended;
                assert_eq!(is_let_in(id, &standard, &extended), is_of_that_size, "{id:?}");
            }
            // As many as there are filters are exact.
            filters(&patterns[..2], &mut standard, &mut extended);
            assert_eq!(ids().filter(|id| is_let_in(*id, &standard, &extended)).count(), 1);
        }
    }
}
