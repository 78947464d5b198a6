//! A ring of entries in memory that stays over a reset: what a black box has. Chip and PC both know it from here.
//!
//! It has 32 blocks, each of which is read by itself: when it is full, the oldest goes. The page `docs/replay.md`
//! says what stands where.

use core::sync::atomic::{Ordering, compiler_fence};

use super::code::{Model, Pen, ZEROS};
use super::{LOST, head};

/// Words of the memory, 327,456 bytes.
pub const WORDS: usize = HEAD + BLOCKS as usize * BLOCK;
/// Tells a ring from memory that has no power since.
pub const MAGIC: u32 = 0x524E_4732;
/// The word with the wish of a test bench, and the wish for more detail.
pub const WISH: usize = 1;
/// See there.
pub const PROOF: u32 = 0x5052_4F46;
/// The word with the program's fingerprint: all [`START`](super::START) have one, and it is the exclusive or of them.
pub const PRINT: usize = 2;
/// The word with the cause of the crash, if it is known: a number of the board.
pub const CAUSE: usize = 3;
/// Two words with the number of times that the robot must be armed before what a crash has left goes. A reset may lose one.
pub const HELD: usize = 4;

/// The word with the number of the newest block.
pub const NEWEST: usize = 6;

const HEAD: usize = 8;
/// Its blocks.
pub const BLOCKS: u16 = 32;
/// Words of a block: those written before it and its number, those written up to its end and its mark; then bits.
const BLOCK: usize = 2_558;
const FIRST: usize = 4;
/// Bits of a mark that say how many there are; above them is the number.
const LENGTH: u32 = 17;
const NUMBERS: u16 = (1 << (32 - LENGTH)) - 1;
const MOST: usize = (BLOCK - FIRST) * 32;

/// A ring's memory.
pub type Memory = [u32; WORDS];

const fn place(number: u16) -> usize {
    HEAD + (number % BLOCKS) as usize * BLOCK
}

/// A block, if it is the one with this number.
fn block(memory: &Memory, number: u16) -> Option<&[u32]> {
    let block = &memory[place(number)..][..BLOCK];
    let number = u32::from(number);
    let is = block[1] == number && block[3] >> LENGTH == number && length(block) <= MOST;
    is.then_some(block)
}

const fn length(block: &[u32]) -> usize {
    (block[3] & ((1 << LENGTH) - 1)) as usize
}

/// The number of the newest block: that of which most others are near before it.
fn newest(memory: &Memory) -> Option<u16> {
    let numbers = (0..BLOCKS).map(|at| memory[place(at) + 1] as u16);
    let numbers = numbers.filter(|it| *it <= NUMBERS && block(memory, *it).is_some());
    let others = |newest: u16| {
        (0..BLOCKS).filter(move |back| block(memory, before(newest, *back)).is_some())
    };
    numbers.max_by_key(|it| others(*it).count()).filter(|_| memory[0] == MAGIC)
}

/// The number of the block so many before one.
#[must_use]
pub const fn before(number: u16, back: u16) -> u16 {
    number.wrapping_sub(back) & NUMBERS
}

/// The number of the block behind one.
#[must_use]
pub const fn after(number: u16) -> u16 {
    before(number, NUMBERS)
}

/// A part of a block, and what is known of it.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The number of the newest block.
    pub newest: u16,
    /// Whether this one is there.
    pub is_there: bool,
    /// The stream's words before it.
    pub before: u32,
    /// Its length so far, bits.
    pub length: usize,
    /// The program's fingerprint.
    pub print: u32,
    /// Whether the ring is what a crash has left, and nothing comes.
    pub is_held: bool,
}

/// Copies words of a block's bits, from one of them on, if it is there.
pub fn part(memory: &Memory, number: u16, from: usize, to: &mut [u32]) -> Part {
    let block = block(memory, number);
    if let Some(block) = block {
        to.iter_mut().zip(block.iter().skip(FIRST + from)).for_each(|(to, word)| *to = *word);
    }
    Part {
        newest: memory[NEWEST] as u16,
        is_there: block.is_some(),
        before: block.map_or(0, |block| block[0]),
        length: block.map_or(0, length),
        print: memory[PRINT],
        is_held: memory[HELD] != 0,
    }
}

/// Puts a whole block into a memory, as its writer had it: the stream's words before it and those up to its end.
pub fn put_block(
    memory: &mut Memory,
    number: u16,
    [before, end]: [u32; 2],
    bits: &[u32],
    length: usize,
) {
    memory[0] = MAGIC;
    memory[NEWEST] = number.into();
    let mark = u32::from(number) << LENGTH | length.min(MOST) as u32;
    let block = &mut memory[place(number)..][..BLOCK];
    block[..FIRST].copy_from_slice(&[before, number.into(), end, mark]);
    block.iter_mut().skip(FIRST).zip(bits).for_each(|(to, word)| *to = *word);
}

/// Whether entries are there.
#[must_use]
pub fn is_kept(memory: &Memory) -> bool {
    newest(memory).is_some_and(|it| memory[place(it) + 2] > 0)
}

/// Takes out of a copy what was overwritten while it was made, at the end of which the newest block had this number; returns
/// how many blocks that are.
pub fn trim(copy: &mut Memory, end: u32) -> usize {
    let mut gone = 0;
    for at in 0..BLOCKS {
        let start = &mut copy[place(at)..][..FIRST];
        if start[1] != 0 && before(end as u16, start[1] as u16) >= BLOCKS {
            start.fill(0);
            gone += 1;
        }
    }
    gone
}

/// Writes entries into a ring.
pub struct Writer {
    model: Model,
    number: u16,
    /// Words written so far.
    total: u32,
    at: usize,
    word: u32,
}

impl Writer {
    /// One that goes on nowhere yet.
    pub const NEW: Self = Self { model: Model::NEW, number: 0, total: 0, at: MOST, word: 0 };

    /// Begins anew, with the program's fingerprint.
    pub fn clear(&mut self, memory: &mut Memory, print: u32) {
        (0..BLOCKS).for_each(|at| memory[place(at)..][..FIRST].fill(0));
        let wish = memory[WISH];
        memory[..HEAD].copy_from_slice(&[MAGIC, wish, print, 0, 0, 0, 0, 0]);
        (self.number, self.total, self.at) = (0, 0, MOST);
    }

    /// Goes on behind what is there.
    pub fn resume(&mut self, memory: &Memory) {
        self.number = newest(memory).unwrap_or_default();
        (self.total, self.at) = (memory[place(self.number) + 2], MOST);
    }

    /// Writes an entry. When the ring is full, the oldest block goes.
    pub fn put(&mut self, memory: &mut Memory, entry: &[u32]) {
        let words = entry.first().map_or(0, |head| head.to_le_bytes()[2]);
        // More than it can take: a word that is not as guessed is 36 bits and a number.
        if self.at + 336 + usize::from(words) * 80 > MOST {
            self.number = after(self.number);
            let number = u32::from(self.number);
            memory[NEWEST] = number;
            let block = &mut memory[place(self.number)..];
            block[..FIRST].copy_from_slice(&[self.total, number, self.total, number << LENGTH]);
            self.model.clear();
            (self.at, self.word) = (0, 0);
        }
        let Some((start, block)) = memory[place(self.number)..].split_first_chunk_mut::<FIRST>()
        else {
            return;
        };
        let Some((bits, _)) = block.split_first_chunk_mut() else { return };
        let Some(pen) = self.model.entry(Writing { to: bits, entry, at: self.at, word: self.word })
        else {
            return;
        };
        (self.at, self.word) = (pen.at, pen.word);
        pen.to[self.at / 32] = self.word;
        self.total = self.total.wrapping_add(entry.len() as u32);
        // Last: a reset in between finds the entries before.
        compiler_fence(Ordering::SeqCst);
        start[2] = self.total;
        start[3] = u32::from(self.number) << LENGTH | self.at as u32;
    }
}

struct Writing<'w> {
    to: &'w mut [u32; BLOCK - FIRST],
    entry: &'w [u32],
    /// Bits, and those that are no whole word yet.
    at: usize,
    word: u32,
}

impl Pen for Writing<'_> {
    const WRITES: bool = true;

    #[inline(always)]
    fn bits(&mut self, value: u32, count: u32) -> u32 {
        let (at, used) = (self.at, self.at as u32 % 32);
        self.word |= value << used;
        self.at += count as usize;
        if self.at / 32 != at / 32 {
            self.to[at / 32] = self.word;
            self.word = value >> ((32 - used) % 32);
        }
        value
    }

    #[inline(always)]
    fn number(&mut self, number: u32, low: u32) -> (u32, u32) {
        let zeros = number >> low;
        if zeros >= ZEROS {
            self.bits(0, ZEROS);
            return (ZEROS, number);
        }
        let rest = number & !(u32::MAX << low);
        self.bits((rest << 1 | 1) << zeros, zeros + 1 + low);
        (zeros, number)
    }

    #[inline]
    fn get(&self, at: usize) -> u32 {
        self.entry.get(at).copied().unwrap_or_default()
    }

    #[inline]
    fn set(&mut self, _: usize, _: u32) {}
}

/// Reads entries out of a ring, also while more come: each once. Whatever the memory, it comes to an end.
pub struct Reader {
    model: Model,
    /// The block that is read, and how far.
    number: Option<u16>,
    at: usize,
    is_damaged: bool,
    /// Words that were told, as the writer counts.
    told: Option<u32>,
}

impl Reader {
    /// One that has read nothing.
    pub const NEW: Self =
        Self { model: Model::NEW, number: None, at: 0, is_damaged: false, told: None };

    fn begin(&mut self, number: u16) -> u16 {
        (self.number, self.at, self.is_damaged) = (Some(number), 0, false);
        self.model.clear();
        number
    }

    /// Tells what is missing before this word.
    fn lose(&mut self, before: u32, to: &mut impl FnMut(&[u32])) {
        let missing = before.wrapping_sub(self.told.unwrap_or(before));
        if missing.cast_signed() > 0 {
            to(&[head(LOST, 0, 1, 0), missing]);
        }
        self.told = Some(before);
    }

    /// Reads what is new: entries, and [`LOST`] where some cannot be read or are gone.
    pub fn read(&mut self, memory: &Memory, to: &mut impl FnMut(&[u32])) {
        let Some(newest) = newest(memory) else {
            (self.number, self.told) = (None, None);
            return;
        };
        let oldest = (0..BLOCKS)
            .rev()
            .map(|back| before(newest, back))
            .find(|it| block(memory, *it).is_some());
        let is_shorter = |it: u16| block(memory, it).is_some_and(|block| length(block) < self.at);
        if self.number.is_some_and(|it| before(newest, it) > NUMBERS / 2 || is_shorter(it)) {
            // It was cleared, as after a cut of power.
            (self.number, self.told) = (None, None);
        }
        let known = self.number.filter(|it| before(newest, *it) < BLOCKS);
        let mut number = known.unwrap_or_else(|| self.begin(oldest.unwrap_or(newest)));
        loop {
            if let Some(block) = block(memory, number) {
                if self.at == 0 {
                    self.lose(block[0], to);
                }
                let end = length(block);
                let mut entry = [0; 256];
                while !self.is_damaged && self.at < end {
                    let pen = Reading { from: &block[FIRST..], entry: &mut entry, at: self.at };
                    let read = self.model.entry(pen).map(|pen| pen.at).filter(|at| *at <= end);
                    let Some(at) = read else {
                        self.is_damaged = true;
                        break;
                    };
                    self.at = at;
                    let words = 1 + usize::from(entry[0].to_le_bytes()[2]);
                    to(&entry[..words]);
                    self.told = self.told.map(|told| told.wrapping_add(words as u32));
                }
                self.at = end;
                self.lose(block[2], to);
            }
            if number == newest {
                return;
            }
            number = self.begin(after(number));
        }
    }
}

struct Reading<'r> {
    from: &'r [u32],
    entry: &'r mut [u32; 256],
    at: usize,
}

impl Pen for Reading<'_> {
    const WRITES: bool = false;

    fn bits(&mut self, _: u32, count: u32) -> u32 {
        let word = |at: usize| u64::from(self.from.get(at).copied().unwrap_or_default());
        let both = word(self.at / 32) | word(self.at / 32 + 1) << 32;
        let value = both >> (self.at % 32) & ((1 << count) - 1);
        self.at += count as usize;
        value as u32
    }

    fn number(&mut self, _: u32, low: u32) -> (u32, u32) {
        match (0..ZEROS).find(|_| self.bits(0, 1) == 1) {
            Some(zeros) => (zeros, zeros << low | self.bits(0, low)),
            None => (ZEROS, ZEROS),
        }
    }

    fn get(&self, _: usize) -> u32 {
        0
    }

    fn set(&mut self, at: usize, word: u32) {
        self.entry[at] = word;
    }
}
