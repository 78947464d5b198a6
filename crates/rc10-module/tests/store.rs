//! The store of snapshots: any cut of power leaves the old one or the new one, whole.

use rc10_module::store::{Cells, Found, Store, StoreError, WORD, Word};
use rc10_sim::Random;

/// How a word is.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Cell {
    Erased,
    /// It reads as erased, and takes no word.
    Weak,
    Whole(Word),
    /// Its code does not fit.
    Torn,
}

/// A flash whose power goes at an operation, in the middle of it.
#[derive(Clone)]
struct Flash {
    sectors: [Vec<Cell>; 2],
    /// Operations until then; an erase is one for each word of its sector.
    left: u64,
    done: u64,
    random: Random,
    worn: [bool; 2],
}

impl Flash {
    fn new(words: usize, seed: u64) -> Self {
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

fn snapshot(random: &mut Random) -> Vec<u8> {
    let length = random.index(6 * WORD);
    (0..length).map(|_| random.bits().to_le_bytes()[0]).collect()
}

fn newest(store: &mut Store<Flash>) -> Option<Vec<u8>> {
    let mut bytes = [0; 8 * WORD];
    store.load(&mut bytes).map(<[u8]>::to_vec)
}

/// The power comes back.
fn start(mut flash: Flash) -> (Store<Flash>, Found) {
    (flash.left, flash.done) = (u64::MAX, 0);
    Store::start(flash)
}

/// Saves, with a cut at an operation; the flash after it, and how many operations it takes without a cut.
fn save_with_cut(flash: &Flash, bytes: &[u8], at: u64, seed: u64) -> Flash {
    let mut flash = flash.clone();
    (flash.left, flash.random) = (u64::MAX, Random::new(seed));
    let (mut store, _) = Store::start(flash);
    let mut cells = store.into_cells();
    cells.left = at;
    // It was started already, and nothing is to be erased: the cut is in the save.
    (store, _) = Store::start(cells);
    let _ = store.save(bytes);
    store.into_cells()
}

#[test]
fn what_was_saved_is_there_after_every_start() {
    let mut random = Random::new(1);
    let mut flash = Flash::new(64, 1);
    let mut expected = None;
    let mut erased = 0;
    for _ in 0..2_000 {
        let (mut store, found) = start(flash);
        assert_eq!(newest(&mut store), expected);
        assert_eq!(found.length, expected.as_ref().map(Vec::len));
        erased += u32::from(found.erased);
        let bytes = snapshot(&mut random);
        store.save(&bytes).unwrap();
        assert_eq!(newest(&mut store), Some(bytes.clone()), "and at once");
        expected = Some(bytes);
        flash = store.into_cells();
    }
    println!("{erased} erased sectors for 2,000 saves");
    assert!(erased > 50);
}

/// A cut at every word of every save and at every step of every erase, then another one at some of the next.
#[test]
fn a_cut_leaves_the_old_snapshot_or_the_new_one() {
    let mut random = Random::new(2);
    let mut flash = Flash::new(32, 2);
    let (mut cuts, mut second, mut lost) = (0, 0, 0);
    let mut old: Option<Vec<u8>> = None;
    for round in 0..10_000 {
        // At the start: of what is erased there.
        let mut fresh = flash.clone();
        (fresh.left, fresh.done) = (u64::MAX, 0);
        let (store, _) = Store::start(fresh);
        let ready = store.into_cells();
        for at in 1..=ready.done {
            let mut cut = flash.clone();
            (cut.left, cut.done, cut.random) = (at, 0, Random::new(random.bits()));
            let (store, _) = Store::start(cut);
            let (mut store, _) = start(store.into_cells());
            assert_eq!(newest(&mut store), old, "round {round}, start cut at {at}");
            cuts += 1;
        }
        let bytes = snapshot(&mut random);
        let mut whole = ready.clone();
        whole.done = 0;
        let (mut store, _) = Store::start(whole);
        store.save(&bytes).unwrap();
        let whole = store.into_cells();
        for at in 1..=whole.done {
            let cut = save_with_cut(&ready, &bytes, at, random.bits());
            let (mut store, _) = start(cut.clone());
            let kept = newest(&mut store);
            assert!(kept == old || kept.as_ref() == Some(&bytes), "round {round}, cut at {at}");
            cuts += 1;
            lost += u32::from(kept == old);
            // Another save, cut too, at any place: a start in between, or none.
            for _ in 0..2 {
                let next = snapshot(&mut random);
                let at = 1 + random.below(10);
                let cut = save_with_cut(&cut, &next, at, random.bits());
                let (mut store, _) = start(cut);
                let after = newest(&mut store);
                assert!(after == kept || after.as_ref() == Some(&next), "round {round}, second");
                // It takes the next one all the same.
                assert_eq!(store.save(&bytes), Ok(()));
                assert_eq!(newest(&mut store).as_ref(), Some(&bytes));
                second += 1;
            }
        }
        (flash, old) = (whole, Some(bytes));
    }
    println!("{cuts} cuts, {lost} of them left the old snapshot; {second} second cuts");
    assert!(cuts > 50_000 && second > 50_000 && lost > 1_000);
}

#[test]
fn foreign_content_is_no_snapshot() {
    for kind in 0..4_u64 {
        let mut flash = Flash::new(64, kind);
        let mut random = Random::new(kind);
        for sector in &mut flash.sectors {
            for cell in sector {
                *cell = match kind {
                    0 => Cell::Whole([0; WORD]),
                    1 => Cell::Torn,
                    2 => Cell::Whole([b'R'; WORD]),
                    _ => Cell::Whole(std::array::from_fn(|_| random.bits().to_le_bytes()[0])),
                };
            }
        }
        let (mut store, found) = start(flash);
        assert_eq!((found.length, newest(&mut store)), (None, None));
        store.save(b"own").unwrap();
        let (mut store, _) = start(store.into_cells());
        assert_eq!(newest(&mut store), Some(b"own".to_vec()));
    }
}

/// A word that can no longer be read takes its snapshot with it, and no other.
#[test]
fn a_snapshot_that_rots_is_not_used() {
    let mut store = start(Flash::new(64, 1)).0;
    store.save(b"old").unwrap();
    store.save(&[5; 3 * WORD]).unwrap();
    let mut flash = store.into_cells();
    let at = flash.sectors[0].iter().position(|cell| *cell == Cell::Whole([5; WORD])).unwrap();
    flash.sectors[0][at + 1] = Cell::Torn;
    let (mut store, _) = start(flash);
    assert_eq!(newest(&mut store), Some(b"old".to_vec()));
}

#[test]
fn a_worn_sector_is_told_and_the_other_one_serves() {
    let mut flash = Flash::new(32, 1);
    flash.sectors[0].fill(Cell::Torn);
    flash.worn[0] = true;
    let (mut store, found) = start(flash);
    assert_eq!(found.worn, 1);
    let mut saved = 0;
    while store.save(&[7; 40]).is_ok() {
        saved += 1;
    }
    assert!(saved > 8, "{saved}");
    assert_eq!(store.save(&[7; 40]), Err(StoreError::Full));
    let (mut store, found) = start(store.into_cells());
    assert_eq!((found.worn, newest(&mut store)), (1, Some(vec![7; 40])));
    assert_eq!(store.save(&[8; 40]), Err(StoreError::Full), "what is there stays");
    let mut flash = store.into_cells();
    flash.sectors[1].fill(Cell::Torn);
    flash.worn = [true; 2];
    let (mut store, found) = start(flash);
    assert_eq!((found.worn, store.save(&[1])), (2, Err(StoreError::Worn)));
    assert_eq!(store.save(&[0; 32 * WORD]), Err(StoreError::TooLong));
}
