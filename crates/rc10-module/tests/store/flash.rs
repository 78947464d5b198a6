//! A flash whose power goes in the middle of an operation: words are torn, or only look erased.

use rc10_module::store::{Cells, WORD, Word};
use rc10_sim::Random;

/// How a word is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Cell {
    Erased,
    /// It reads as erased, and takes no word.
    Weak,
    Whole(Word),
    /// Its code does not fit.
    Torn,
}

/// A flash whose power goes at an operation, in the middle of it.
#[derive(Clone)]
pub struct Flash {
    /// Its words.
    pub sectors: [Vec<Cell>; 2],
    /// Operations until then; an erase is one for each word of its sector.
    pub left: u64,
    /// Those that were done.
    pub done: u64,
    pub random: Random,
    /// Sectors that no longer erase.
    pub worn: [bool; 2],
}

impl Flash {
    pub fn new(words: usize, seed: u64) -> Self {
        let sectors = [vec![Cell::Erased; words], vec![Cell::Erased; words]];
        Self { sectors, left: u64::MAX, done: 0, random: Random::new(seed), worn: [false; 2] }
    }

    /// Whether the next operation is done; one that is cut is torn.
    fn goes_on(&mut self) -> Option<bool> {
        self.done += 1;
        self.left = self.left.checked_sub(1)?;
        Some(self.left > 0)
    }

    fn torn(&mut self, before: Cell, goal: Cell) -> Cell {
        match self.random.below(5) {
            0 => before,
            1 => goal,
            2 if before == Cell::Erased || goal == Cell::Erased => Cell::Weak,
            _ => Cell::Torn,
        }
    }
}

impl Cells for Flash {
    fn words(&self) -> u32 {
        u32::try_from(self.sectors[0].len()).unwrap()
    }

    fn read(&mut self, sector: u32, word: u32) -> Word {
        match self.sectors[sector as usize][word as usize] {
            _ if self.left == 0 => [0; WORD],
            Cell::Erased | Cell::Weak => [0xFF; WORD],
            Cell::Whole(word) => word,
            Cell::Torn => [0; WORD],
        }
    }

    fn program(&mut self, sector: u32, word: u32, bytes: &Word) {
        let before = self.sectors[sector as usize][word as usize];
        let goal = match before {
            Cell::Erased => Cell::Whole(*bytes),
            Cell::Whole(old) if old == *bytes => before,
            Cell::Weak | Cell::Whole(_) | Cell::Torn => Cell::Torn,
        };
        let after = match self.goes_on() {
            None => before,
            Some(true) => goal,
            Some(false) => self.torn(before, goal),
        };
        self.sectors[sector as usize][word as usize] = after;
    }

    fn erase(&mut self, sector: u32) {
        if self.worn[sector as usize] {
            return;
        }
        // All words change at once: the cut is somewhere in it.
        let steps = self.sectors[sector as usize].len() as u64;
        let is_whole = self.left > steps;
        self.done += steps;
        if self.left == 0 {
            return;
        }
        for word in 0..self.sectors[sector as usize].len() {
            let before = self.sectors[sector as usize][word];
            let after = if is_whole { Cell::Erased } else { self.torn(before, Cell::Erased) };
            self.sectors[sector as usize][word] = after;
        }
        self.left = self.left.saturating_sub(steps);
    }
}
