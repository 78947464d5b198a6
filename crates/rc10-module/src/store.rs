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

    /// The first word behind all that do not read as erased: the first four bytes of one that was programmed do not.
    /// Only at the start: it looks at thousands of words.
    fn free(&mut self, sector: u32) -> u32 {
        let last = (0..self.words()).rev().find(|word| self.read(sector, *word) != ERASED);
        last.map_or(0, |word| word + 1)
    }
}

impl<C: Cells + ?Sized> Cells for &mut C {
    fn words(&self) -> u32 {
        (**self).words()
    }

    fn read(&mut self, sector: u32, word: u32) -> Word {
        (**self).read(sector, word)
    }

    fn program(&mut self, sector: u32, word: u32, bytes: &Word) {
        (**self).program(sector, word, bytes);
    }

    fn erase(&mut self, sector: u32) {
        (**self).erase(sector);
    }

    fn free(&mut self, sector: u32) -> u32 {
        (**self).free(sector)
    }
}

/// What a [`Store`] has found at its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Found {
    /// Words of the newest snapshot; `None`: there is no snapshot.
    pub length: Option<u32>,
    /// Sectors that were erased, which takes 1 to 2 s each.
    pub erased: u8,
    /// Sectors that could not be erased: they are worn out.
    pub worn: u8,
    /// Whether a newer snapshot was there, of which a word can no longer be read.
    pub is_damaged: bool,
}

/// Why a snapshot was not kept: the one before stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// It has more words than a sector.
    #[error("too long for the flash")]
    TooLong,
    /// Its sector is full, and the other one is erased at the next start.
    #[error("the flash is full until the next start")]
    Full,
    /// Both sectors are worn out.
    #[error("the flash is worn out")]
    Worn,
    /// It was given up before its end.
    #[error("given up before its end")]
    GivenUp,
}

/// First bytes of a mark and of a head.
const MARK: [u8; 4] = *b"RC0E";
const HEAD: [u8; 4] = *b"RC0S";
const ERASED: Word = [0xFF; WORD];

/// A head: behind the words of its snapshot.
#[derive(Clone, Copy, Debug)]
struct Head {
    sequence: u32,
    /// Words.
    length: u32,
    sum: u32,
}

impl Head {
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

/// Without a table: a snapshot has some hundred bytes.
const SUM: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// A store of snapshots in a flash.
pub struct Store<C> {
    cells: C,
    /// The sector that is written, and its first free word.
    place: Option<(u32, u32)>,
    /// The newest snapshot: its sector, its first word and its head.
    newest: Option<(u32, u32, Head)>,
    /// Whether the other sector is erased.
    has_other: bool,
}

impl<C: Cells> Store<C> {
    /// Looks for the newest snapshot. A sector that has none is erased if it was not erased to the end, but only when a
    /// quarter of the other one is used: each second counts. Both sectors of a new chip read as erased, and are.
    pub fn start(cells: C) -> (Self, Found) {
        let mut store = Self { cells, place: None, newest: None, has_other: false };
        let mut found = Found::default();
        let mut free = [0, 1].map(|sector| store.cells.free(sector));
        let damaged =
            (0..2).zip(free).filter_map(|(sector, free)| store.search(sector, free)).max();
        found.is_damaged = damaged > store.newest.map(|(.., head)| head.sequence);
        found.length = store.newest.map(|(.., head)| head.length);
        if free == [0, 0] {
            store.cells.program(0, 0, &mark());
            free[0] = u32::from(store.is_marked(0));
        }
        // Without a snapshot it is the first that was erased to the end, whatever a cut save left in it.
        let marked = (0..2).find(|sector| store.is_marked(*sector));
        let used = store.newest.map(|(sector, ..)| sector).or(marked);
        if let Some(sector) = used {
            let free = free[sector as usize];
            // A word that was being programmed when the power went may only look erased.
            store.place = Some((sector, if free == 1 { 1 } else { free + 1 }));
            if free <= store.cells.words() / 4 {
                return (store, found);
            }
        }
        for sector in (0..2).filter(|sector| Some(*sector) != used) {
            let is_ready =
                |store: &mut Self| store.is_marked(sector) && store.cells.free(sector) == 1;
            if !is_ready(&mut store) {
                if store.is_marked(sector) {
                    // Not to be taken for erased if the power goes meanwhile.
                    store.cells.program(sector, 0, &[0; WORD]);
                }
                store.cells.erase(sector);
                found.erased += 1;
                if store.cells.free(sector) == 0 {
                    store.cells.program(sector, 0, &mark());
                }
                if !is_ready(&mut store) {
                    found.worn += 1;
                    continue;
                }
            }
            if store.place.is_some() {
                store.has_other = true;
            } else {
                store.place = Some((sector, 1));
                break;
            }
        }
        (store, found)
    }

    fn is_marked(&mut self, sector: u32) -> bool {
        self.cells.read(sector, 0) == mark()
    }

    /// Looks for the newest snapshot before the first free word. Returns the sequence of the newest that is not whole.
    fn search(&mut self, sector: u32, free: u32) -> Option<u32> {
        let mut damaged = None;
        if !self.is_marked(sector) {
            return damaged;
        }
        for at in (1..free).rev() {
            let Some(head) = Head::of(&self.cells.read(sector, at)) else { continue };
            let is_newer = self.newest.is_none_or(|(.., newest)| head.sequence > newest.sequence);
            let Some(first) = at.checked_sub(head.length).filter(|first| *first > 0) else {
                continue;
            };
            if self.sum_of(sector, first, head.length) != head.sum {
                damaged = damaged.max(Some(head.sequence));
            } else if is_newer {
                self.newest = Some((sector, first, head));
                break;
            }
        }
        damaged
    }

    fn sum_of(&mut self, sector: u32, first: u32, length: u32) -> u32 {
        let mut digest = SUM.digest();
        for word in first..first + length {
            digest.update(&self.cells.read(sector, word));
        }
        digest.finalize()
    }

    /// The number of words of the newest snapshot.
    pub fn len(&self) -> u32 {
        self.newest.map_or(0, |(.., head)| head.length)
    }

    /// Whether the newest snapshot has no words, or there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A word of the newest snapshot; `None` behind its last.
    pub fn word(&mut self, at: u32) -> Option<Word> {
        let (sector, first, head) = self.newest?;
        (at < head.length).then(|| self.cells.read(sector, first + at))
    }

    /// Keeps a snapshot of the words that `next` gives, by their number, up to `None`; the one before can be read
    /// meanwhile. When it returns, a cut of power no longer loses it. Before each word, and one behind them, it waits
    /// until `moment` says whether it goes on. It may begin anew, and asks for all words again then.
    ///
    /// # Errors
    /// If there is no room, or it was given up: the snapshot before stands.
    pub async fn save(
        &mut self,
        mut next: impl FnMut(&mut Self, u32) -> Option<Word>,
        mut moment: impl AsyncFnMut() -> bool,
    ) -> Result<(), StoreError> {
        let (mut sector, mut first) = self.place.ok_or(StoreError::Worn)?;
        let sequence = self.newest.map_or(0, |(.., head)| head.sequence.wrapping_add(1));
        let (mut length, mut digest) = (0, SUM.digest());
        loop {
            if first + length >= self.cells.words() {
                let other = 1 - sector;
                if first == 1 {
                    return Err(StoreError::TooLong);
                }
                if !core::mem::take(&mut self.has_other) {
                    return Err(StoreError::Full);
                }
                (sector, first, length, digest) = (other, 1, 0, SUM.digest());
            }
            let body = next(self, length);
            let word = body.unwrap_or_else(|| {
                Head { sequence, length, sum: digest.clone().finalize() }.bytes()
            });
            if !moment().await {
                return Err(StoreError::GivenUp);
            }
            self.cells.program(sector, first + length, &word);
            self.place = Some((sector, first + length + 1));
            if self.cells.read(sector, first + length) != word {
                // It only looked erased.
                (first, length, digest) = (first + length + 1, 0, SUM.digest());
                continue;
            }
            if body.is_none() {
                let head = Head { sequence, length, sum: digest.finalize() };
                self.newest = Some((sector, first, head));
                return Ok(());
            }
            digest.update(&word);
            length += 1;
        }
    }

    /// The flash.
    pub fn into_cells(self) -> C {
        self.cells
    }
}
