//! Snapshots in a flash, which any cut of power leaves old or new, and whole.
//!
//! A snapshot is appended to the last one of its sector, its head last: until that is written the one before is the
//! newest. A sector is used when it was erased to the end, which a mark in its first word says; the other one is erased
//! at the next start. What was torn is read by [`Cells::read`] as zeros, so that no sum fits; and what only looks erased
//! is found when it is written: every word is read back, and the snapshot begins anew behind it.
//!
//! One flash word is written once for each erase. So this serves the STM32H7's flash, where a crate that writes a word
//! twice cannot: `sequential-storage` marks items as erased, and knows no word that cannot be read.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

/// Bytes of a word, which is programmed at once.
pub const WORD: usize = 32;

/// A word.
pub type Word = [u8; WORD];

/// The flash: two sectors.
pub trait Cells {
    /// Words of a sector.
    fn words(&self) -> u32;

    /// Reads a word; zeros if it cannot be read.
    fn read(&mut self, sector: u32, word: u32) -> Word;

    /// Programs a word, which was erased. It is read back: an error need not be told.
    fn program(&mut self, sector: u32, word: u32, bytes: &Word);

    /// Erases a sector. What fails is seen when it is read.
    fn erase(&mut self, sector: u32);
}

/// What a [`Store`] has found at its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Found {
    /// Length of the newest snapshot, bytes; `None`: there is no snapshot.
    pub length: Option<usize>,
    /// Sectors that were erased, which takes 1 to 2 s each.
    pub erased: u8,
    /// Sectors that could not be erased: they are worn out.
    pub worn: u8,
}

/// Why a snapshot was not kept: the one before stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// It has more bytes than a sector.
    #[error("too long for the flash")]
    TooLong,
    /// Its sector is full, and the other one is erased at the next start.
    #[error("the flash is full until the next start")]
    Full,
    /// Both sectors are worn out.
    #[error("the flash is worn out")]
    Worn,
}

/// First bytes of a mark and of a head.
const MARK: [u8; 4] = *b"RC0E";
const HEAD: [u8; 4] = *b"RC0S";
const ERASED: Word = [0xFF; WORD];

/// A head: behind the words of its snapshot.
#[derive(Clone, Copy, Debug)]
struct Head {
    sequence: u32,
    length: u32,
    sum: u32,
}

impl Head {
    fn words(self) -> u32 {
        words(self.length)
    }

    fn bytes(self) -> Word {
        let mut word = [0; WORD];
        let own =
            [HEAD, self.sequence.to_le_bytes(), self.length.to_le_bytes(), self.sum.to_le_bytes()];
        word[..16].copy_from_slice(own.as_flattened());
        let sum = SUM.checksum(&word[..16]);
        word[16..20].copy_from_slice(&sum.to_le_bytes());
        word
    }

    fn of(word: &Word) -> Option<Self> {
        let [_, sequence, length, sum] =
            [0, 4, 8, 12].map(|at| word[at..].first_chunk().copied().map_or(0, u32::from_le_bytes));
        let head = Self { sequence, length, sum };
        (head.bytes() == *word).then_some(head)
    }
}

fn mark() -> Word {
    let mut word = [0; WORD];
    word[..4].copy_from_slice(&MARK);
    word
}

const fn words(bytes: u32) -> u32 {
    bytes.div_ceil(32)
}

/// Without a table: a snapshot has a few hundred bytes.
const SUM: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// A store of snapshots in a flash.
pub struct Store<C> {
    cells: C,
    /// The sector that is written, and its first free word.
    place: Option<(u32, u32)>,
    /// The newest snapshot: its sector, its first word and its head.
    newest: Option<(u32, u32, Head)>,
}

impl<C: Cells> Store<C> {
    /// Looks for the newest snapshot, and erases a sector that has none if it was not erased to the end.
    pub fn start(cells: C) -> (Self, Found) {
        let mut store = Self { cells, place: None, newest: None };
        let mut found = Found::default();
        for sector in 0..2 {
            store.search(sector);
        }
        found.length = store.newest.map(|(.., head)| head.length as usize);
        let used = store.newest.map(|(sector, ..)| sector);
        if let Some(sector) = used {
            // A word that was being programmed when the power went may only look erased.
            store.place = Some((sector, store.free(sector) + 1));
        }
        for sector in (0..2).filter(|sector| Some(*sector) != used) {
            let is_ready = |store: &mut Self| store.is_marked(sector) && store.free(sector) == 1;
            if !is_ready(&mut store) {
                if store.is_marked(sector) {
                    // Not to be taken for erased if the power goes meanwhile.
                    store.cells.program(sector, 0, &[0; WORD]);
                }
                store.cells.erase(sector);
                found.erased += 1;
                if store.free(sector) == 0 {
                    store.cells.program(sector, 0, &mark());
                }
                if !is_ready(&mut store) {
                    found.worn += 1;
                    continue;
                }
            }
            if store.place.is_none() {
                store.place = Some((sector, 1));
                break;
            }
        }
        (store, found)
    }

    fn is_marked(&mut self, sector: u32) -> bool {
        self.cells.read(sector, 0) == mark()
    }

    /// The first word behind all that are not erased.
    fn free(&mut self, sector: u32) -> u32 {
        let words = self.cells.words();
        let last = (0..words).rev().find(|word| self.cells.read(sector, *word) != ERASED);
        last.map_or(0, |word| word + 1)
    }

    fn search(&mut self, sector: u32) {
        if !self.is_marked(sector) {
            return;
        }
        for at in (1..self.cells.words()).rev() {
            let Some(head) = Head::of(&self.cells.read(sector, at)) else { continue };
            let is_newer = self.newest.is_none_or(|(.., newest)| head.sequence > newest.sequence);
            let Some(first) = at.checked_sub(head.words()).filter(|first| *first > 0) else {
                continue;
            };
            if is_newer && self.sum_of(sector, first, head.length) == head.sum {
                self.newest = Some((sector, first, head));
                return;
            }
        }
    }

    fn sum_of(&mut self, sector: u32, first: u32, length: u32) -> u32 {
        let mut digest = SUM.digest();
        let mut rest = length as usize;
        for word in first..first + words(length) {
            digest.update(&self.cells.read(sector, word)[..rest.min(WORD)]);
            rest = rest.saturating_sub(WORD);
        }
        digest.finalize()
    }

    /// Copies the newest snapshot out; `None` without one, or if it is longer.
    pub fn load<'a>(&mut self, to: &'a mut [u8]) -> Option<&'a [u8]> {
        let (sector, first, head) = self.newest?;
        let to = to.get_mut(..head.length as usize)?;
        for (word, bytes) in (first..).zip(to.chunks_mut(WORD)) {
            bytes.copy_from_slice(&self.cells.read(sector, word)[..bytes.len()]);
        }
        Some(to)
    }

    /// Keeps a snapshot; when it returns, a cut of power no longer loses it. It takes a word each for 32 bytes, and one.
    ///
    /// # Errors
    /// If there is no room: the snapshot before stands.
    pub fn save(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        let length = u32::try_from(bytes.len()).map_err(|_| StoreError::TooLong)?;
        let count = words(length);
        if count + 2 > self.cells.words() {
            return Err(StoreError::TooLong);
        }
        let (mut sector, mut first) = self.place.ok_or(StoreError::Worn)?;
        let sequence = self.newest.map_or(0, |(.., head)| head.sequence + 1);
        let head = Head { sequence, length, sum: SUM.checksum(bytes) };
        loop {
            if first + count + 1 > self.cells.words() {
                let other = 1 - sector;
                if !self.is_marked(other) || self.free(other) != 1 {
                    return Err(StoreError::Full);
                }
                (sector, first) = (other, 1);
            }
            let body = bytes.chunks(WORD).map(|bytes| {
                let mut word = ERASED;
                word[..bytes.len()].copy_from_slice(bytes);
                word
            });
            let all = (first..).zip(body.chain([head.bytes()]));
            let bad = all.into_iter().find(|(at, word)| {
                self.cells.program(sector, *at, word);
                self.cells.read(sector, *at) != *word
            });
            match bad {
                // It only looked erased.
                Some((at, _)) => first = at + 1,
                None => {
                    self.newest = Some((sector, first, head));
                    self.place = Some((sector, first + count + 1));
                    return Ok(());
                }
            }
        }
    }

    /// The flash.
    pub fn into_cells(self) -> C {
        self.cells
    }
}
