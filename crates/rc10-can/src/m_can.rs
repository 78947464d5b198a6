//! Frames and filters as they lie in the message RAM of Bosch's `M_CAN`, which ST calls FDCAN. It is
//! the same in every chip that has one; only the number of elements differs.

use embedded_can::{ExtendedId, Id, StandardId};

use crate::{CanFrame, IdPattern};

/// Words of an element with eight data bytes: two of header, two of data.
pub const ELEMENT: usize = 4;

// Header bits that receive and transmit elements have in common (RM0468, FDCAN chapter, "Rx FIFO
// element" and "Tx buffer element"; RM0440 has the same).
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

/// The time stamp of a receive element: the controller's time stamp counter when the frame began,
/// which counts bit times modulo 2¹⁶.
#[inline]
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "the lower half of the word")]
pub const fn time_stamp([_, length, ..]: [u32; ELEMENT]) -> u16 {
    length as u16
}

// RM0468, FDCAN chapter, "Standard message ID filter element" and "Extended message ID filter
// element": an identifier and a mask; what matches goes to FIFO 0. A word of zeros is no filter.
const STANDARD_BY_MASK: u32 = 0b10 << 30;
const STANDARD_TO_FIFO_0: u32 = 0b001 << 27;
const STANDARD_FILTER_ID_SHIFT: u32 = 16;
const EXTENDED_TO_FIFO_0: u32 = 0b001 << 29;
const EXTENDED_BY_MASK: u32 = 0b10 << 30;

/// Words of a filter for extended identifiers; one for standard identifiers has one.
pub const EXTENDED_FILTER: usize = 2;

/// Writes all filters of both sizes, one for each pattern, in the patterns' order; the others are
/// none. Where there are more patterns than filters of a size, the last one lets every identifier of
/// that size in: rather too much than too little. `standard` has one word a filter and `extended`
/// has [`EXTENDED_FILTER`], each for one filter at least.
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
