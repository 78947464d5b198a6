//! The layout of acceptance filters in the message RAM, word by word (RM0468, FDCAN chapter,
//! "Standard message ID filter element" and "Extended message ID filter element").
#![cfg(test)]

#[path = "../src/stm32h723/can/filter.rs"]
mod filter;

use filter::{EXTENDED, STANDARD, WORDS, words};
use rc10_can::IdPattern;
use rc10_can::embedded_can::{ExtendedId, StandardId};

fn standard(raw: u16) -> IdPattern {
    IdPattern::exact(StandardId::new(raw).unwrap())
}

fn extended(raw: u32) -> IdPattern {
    IdPattern::exact(ExtendedId::new(raw).unwrap())
}

/// The hardware's handling of a data frame: whether a filter by mask sends it to FIFO 0.
fn accepts(words: &[u32; WORDS], raw: u32, is_extended: bool) -> bool {
    let (short, long) = words.split_at(STANDARD);
    if is_extended {
        long.chunks(2).any(|words| {
            let (to, id, kind, mask) =
                (words[0] >> 29, words[0] & 0x1FFF_FFFF, words[1] >> 30, words[1] & 0x1FFF_FFFF);
            (to, kind) == (1, 2) && (id ^ raw) & mask == 0
        })
    } else {
        short.iter().any(|word| {
            let (kind, to, id, mask) =
                (word >> 30, (word >> 27) & 7, (word >> 16) & 0x7FF, word & 0x7FF);
            (kind, to) == (2, 1) && (id ^ raw) & mask == 0
        })
    }
}

#[test]
fn an_exact_identifier_is_a_filter_of_all_its_bits() {
    let words = words(&[extended(0x1ABC_DEF0), standard(0x205)]);
    assert_eq!(words[0], 0x8800_0000 | 0x205 << 16 | 0x7FF);
    assert_eq!(words[STANDARD..STANDARD + 2], [0x3ABC_DEF0, 0x9FFF_FFFF]);
    // Zeros are no filters.
    assert!(words[1..STANDARD].iter().chain(&words[STANDARD + 2..]).all(|&word| word == 0));
}

#[test]
fn filters_let_in_what_the_patterns_match_and_nothing_else() {
    let module = IdPattern::exact(ExtendedId::new(0x1D00_1000).unwrap()).under(0x1F00_FF00);
    let group = IdPattern::exact(StandardId::new(0x200).unwrap()).under(0x7F8);
    let words = words(&[group, module, standard(0x301)]);
    for raw in 0..=0x7FF {
        assert_eq!(accepts(&words, raw, false), raw & 0x7F8 == 0x200 || raw == 0x301, "{raw:x}");
    }
    assert!(accepts(&words, 0x1D55_1023, true));
    assert!(!accepts(&words, 0x1D55_1123, true));
    assert!(!accepts(&words, 0x205, true));
}

#[test]
fn nothing_wanted_is_kept_out_when_there_are_too_many_patterns() {
    let most: Vec<_> = (0..).step_by(3).take(STANDARD + 1).map(standard).collect();
    // One for each filter: exact still.
    assert!(!accepts(&words(&most[..STANDARD]), 1, false));
    let all = words(&most);
    assert!((0..=0x7FF).all(|raw| accepts(&all, raw, false)));
    assert!(!accepts(&all, 1, true));

    let most: Vec<_> = (0..).take(EXTENDED + 1).map(extended).collect();
    assert!(!accepts(&words(&most[..EXTENDED]), 99, true));
    assert!(accepts(&words(&most), 99, true));
}

#[test]
fn a_filter_stays_where_it_was_when_others_follow() {
    let motors = [standard(0x201), extended(7), standard(0x202)];
    let (before, after) = (words(&motors), words(&[&motors[..], &[standard(1)]].concat()));
    let changed: Vec<_> = (0..WORDS).filter(|&word| before[word] != after[word]).collect();
    assert_eq!(changed, [2]);
}
