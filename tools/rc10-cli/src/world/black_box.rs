//! The black box of a chip, as it lies in its memory: `rc10_bsp::black_box`.

use anyhow::Result;
use rc10_emu::Memory;
use rc10_motor::record::{LOST, head};

/// The symbol of the program.
pub(crate) const NAME: &str = "RC10_BLACK_BOX";
const MAGIC: u32 = 0x524E_4731;
/// Where a test bench says what it wishes, and the wish for more detail.
pub(crate) const WISH: u32 = 4;
pub(crate) const PROOF: u32 = 0x5052_4F46;
const ENDS: usize = 8;
const FIRST: usize = 24;
const WORDS: u32 = 65_536;
/// All of it.
pub(crate) const BYTES: usize = FIRST + 4 * WORDS as usize;

fn word(memory: &[u8], at: usize) -> Option<u32> {
    memory.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

/// The words in a memory, the oldest first; `None` if it is no black box, or an empty one.
pub(crate) fn words(memory: &[u8]) -> Option<Vec<u32>> {
    let [newest, oldest] = [word(memory, ENDS)?, word(memory, ENDS + 4)?];
    let count = newest.wrapping_sub(oldest);
    if word(memory, 0)? != MAGIC || count == 0 || count > WORDS {
        return None;
    }
    let places = (0..count).map(|it| (oldest.wrapping_add(it) % WORDS) as usize);
    places.map(|place| word(memory, FIRST + 4 * place)).collect()
}

/// The words that were added since, and how many have gone by.
pub(crate) fn news(memory: &Memory, at: u32, taken: &mut u32) -> Result<Vec<u32>> {
    if memory.word(at)? != MAGIC {
        return Ok(Vec::new());
    }
    let ends = at + ENDS as u32;
    let [newest, oldest] = [memory.word(ends)?, memory.word(ends + 4)?];
    let mut words = Vec::new();
    if newest.wrapping_sub(*taken) > i32::MAX as u32 {
        // It was cleared, as after a cut of power.
        *taken = oldest;
    }
    if newest.wrapping_sub(*taken) > newest.wrapping_sub(oldest) {
        words.extend([head(LOST, 0, 1, 0), oldest.wrapping_sub(*taken)]);
        *taken = oldest;
    }
    while *taken != newest {
        words.push(memory.word(at + FIRST as u32 + 4 * (*taken % WORDS))?);
        *taken = taken.wrapping_add(1);
    }
    Ok(words)
}
