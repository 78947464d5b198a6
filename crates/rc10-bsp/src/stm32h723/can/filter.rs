//! The acceptance filters as they lie in the message RAM. Knows no register, so that it can be
//! tested on a PC.

use embedded_can::Id;
use rc10_can::{IdPattern, embedded_can};

/// Filters for standard identifiers; one word each.
pub const STANDARD: usize = rc10_can::STANDARD_FILTERS;
/// Filters for extended identifiers; two words each.
pub const EXTENDED: usize = rc10_can::EXTENDED_FILTERS;
/// Words of all filters.
pub const WORDS: usize = STANDARD + 2 * EXTENDED;

// RM0468, FDCAN chapter, "Standard message ID filter element" and "Extended message ID filter
// element": an identifier and a mask; what matches goes to FIFO 0. A word of zeros is no filter.
const STANDARD_BY_MASK: u32 = 0b10 << 30;
const STANDARD_TO_FIFO_0: u32 = 0b001 << 27;
const STANDARD_ID_SHIFT: u32 = 16;
const EXTENDED_TO_FIFO_0: u32 = 0b001 << 29;
const EXTENDED_BY_MASK: u32 = 0b10 << 30;

/// The filters of both sizes, one for each pattern, in the patterns' order. Where there are more
/// patterns than filters of a size, the last one lets every identifier of that size in: rather
/// too much than too little.
pub fn words(patterns: &[IdPattern]) -> [u32; WORDS] {
    let mut words = [0; WORDS];
    let (standard, extended) = words.split_at_mut(STANDARD);
    let (mut standards, mut extendeds) = (0, 0);
    for pattern in patterns {
        match pattern.id() {
            Id::Standard(id) => {
                let (place, mask) = place(&mut standards, STANDARD, pattern.mask() & 0x7FF);
                let id = u32::from(id.as_raw()) << STANDARD_ID_SHIFT;
                standard[place] = STANDARD_BY_MASK | STANDARD_TO_FIFO_0 | id | mask;
            }
            Id::Extended(id) => {
                let (place, mask) = place(&mut extendeds, EXTENDED, pattern.mask());
                extended[2 * place] = EXTENDED_TO_FIFO_0 | id.as_raw();
                extended[2 * place + 1] = EXTENDED_BY_MASK | mask;
            }
        }
    }
    words
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
