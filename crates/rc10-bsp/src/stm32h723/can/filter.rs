//! The acceptance filters in the message RAM. Without registers, to be tested on a PC.

use rc10_can::{IdPattern, m_can};

/// Filters for standard identifiers; one word each.
pub const STANDARD: usize = rc10_can::STANDARD_FILTERS;
/// Filters for extended identifiers; two words each.
pub const EXTENDED: usize = rc10_can::EXTENDED_FILTERS;
/// Words of all filters.
pub const WORDS: usize = STANDARD + m_can::EXTENDED_FILTER * EXTENDED;

/// The filters of both sizes, the standard ones first: see [`m_can::filters`].
pub fn words(patterns: &[IdPattern]) -> [u32; WORDS] {
    let mut words = [0; WORDS];
    let (standard, extended) = words.split_at_mut(STANDARD);
    m_can::filters(patterns, standard, extended);
    words
}
