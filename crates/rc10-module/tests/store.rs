//! The store of snapshots: any cut of power leaves the old one or the new one, whole.

use embassy_futures::block_on;
use rc10_module::store::{Found, Store, StoreError, WORD, Word};
use rc10_sim::Random;

mod flash;

use flash::{Cell, Flash};

const OWN: Word = [9; WORD];

fn snapshot(random: &mut Random) -> Vec<Word> {
    let length = random.index(7);
    (0..length).map(|_| std::array::from_fn(|_| random.bits().to_le_bytes()[0])).collect()
}

fn save(store: &mut Store<Flash>, words: &[Word]) -> Result<(), StoreError> {
    block_on(store.save(|_, at| words.get(at as usize).copied(), async || true))
}

/// The newest snapshot; no words are none.
fn newest(store: &mut Store<Flash>) -> Vec<Word> {
    (0..store.len()).map(|at| store.word(at).unwrap()).collect()
}

/// The power comes back.
fn start(mut flash: Flash) -> (Store<Flash>, Found) {
    (flash.left, flash.done) = (u64::MAX, 0);
    Store::start(flash)
}

/// Saves, with a cut at an operation; the flash after it, and how many operations it takes without a cut.
fn save_with_cut(flash: &Flash, words: &[Word], at: u64, seed: u64) -> Flash {
    let mut flash = flash.clone();
    (flash.left, flash.random) = (u64::MAX, Random::new(seed));
    let (mut store, _) = Store::start(flash);
    let mut cells = store.into_cells();
    cells.left = at;
    // It was started already, and nothing is to be erased: the cut is in the save.
    (store, _) = Store::start(cells);
    let _ = save(&mut store, words);
    store.into_cells()
}

#[test]
fn what_was_saved_is_there_after_every_start() {
    let mut random = Random::new(1);
    let mut flash = Flash::new(64, 1);
    let mut expected = Vec::new();
    let mut erased = 0;
    for _ in 0..2_000 {
        let (mut store, found) = start(flash);
        assert_eq!(newest(&mut store), expected);
        assert_eq!(found.length.unwrap_or(0) as usize, expected.len());
        assert!(!found.is_damaged);
        erased += u32::from(found.erased);
        let words = snapshot(&mut random);
        save(&mut store, &words).unwrap();
        assert_eq!(newest(&mut store), words, "and at once");
        expected = words;
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
    let mut old = Vec::new();
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
        let words = snapshot(&mut random);
        let mut whole = ready.clone();
        whole.done = 0;
        let (mut store, _) = Store::start(whole);
        save(&mut store, &words).unwrap();
        let whole = store.into_cells();
        for at in 1..=whole.done {
            let cut = save_with_cut(&ready, &words, at, random.bits());
            let (mut store, _) = start(cut.clone());
            let kept = newest(&mut store);
            assert!(kept == old || kept == words, "round {round}, cut at {at}");
            cuts += 1;
            lost += u32::from(kept == old);
            // Another save, cut too, at any place: a start in between, or none.
            for _ in 0..2 {
                let next = snapshot(&mut random);
                let at = 1 + random.below(10);
                let cut = save_with_cut(&cut, &next, at, random.bits());
                let (mut store, _) = start(cut);
                let after = newest(&mut store);
                assert!(after == kept || after == next, "round {round}, second");
                // It takes the next one all the same.
                assert_eq!(save(&mut store, &words), Ok(()));
                assert_eq!(newest(&mut store), words);
                second += 1;
            }
        }
        (flash, old) = (whole, words);
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
        assert_eq!((found.length, newest(&mut store)), (None, vec![]));
        save(&mut store, &[OWN]).unwrap();
        let (mut store, _) = start(store.into_cells());
        assert_eq!(newest(&mut store), [OWN]);
    }
}

/// A word that can no longer be read takes its snapshot with it, and no other.
#[test]
fn a_snapshot_that_rots_is_not_used() {
    let mut store = start(Flash::new(64, 1)).0;
    save(&mut store, &[OWN]).unwrap();
    save(&mut store, &[[5; WORD]; 3]).unwrap();
    let mut flash = store.into_cells();
    let at = flash.sectors[0].iter().position(|cell| *cell == Cell::Whole([5; WORD])).unwrap();
    flash.sectors[0][at + 1] = Cell::Torn;
    let (mut store, found) = start(flash);
    assert_eq!((newest(&mut store), found.is_damaged), (vec![OWN], true));
}

#[test]
fn a_worn_sector_is_told_and_the_other_one_serves() {
    let mut flash = Flash::new(32, 1);
    flash.sectors[0].fill(Cell::Torn);
    flash.worn[0] = true;
    let (mut store, found) = start(flash);
    assert_eq!(found.worn, 1);
    let mut saved = 0;
    while save(&mut store, &[[7; WORD]; 2]).is_ok() {
        saved += 1;
    }
    assert!(saved > 8, "{saved}");
    assert_eq!(save(&mut store, &[[7; WORD]; 2]), Err(StoreError::Full));
    let (mut store, found) = start(store.into_cells());
    assert_eq!((found.worn, newest(&mut store)), (1, vec![[7; WORD]; 2]));
    assert_eq!(save(&mut store, &[[8; WORD]; 2]), Err(StoreError::Full), "what is there stays");
    let mut flash = store.into_cells();
    flash.sectors[1].fill(Cell::Torn);
    flash.worn = [true; 2];
    let (mut store, found) = start(flash);
    assert_eq!((found.worn, save(&mut store, &[OWN])), (2, Err(StoreError::Worn)));
}

#[test]
fn what_does_not_fit_is_refused_and_what_was_given_up_leaves_the_one_before() {
    let mut store = start(Flash::new(32, 1)).0;
    assert_eq!(save(&mut store, &[OWN; 31]), Err(StoreError::TooLong));
    let mut store = start(store.into_cells()).0;
    save(&mut store, &[OWN]).unwrap();
    for end in 0..=3 {
        let mut left = end;
        let moment = async || {
            left -= 1;
            left >= 0
        };
        let outcome = block_on(store.save(|_, at| (at < 2).then_some([3; WORD]), moment));
        let is_whole = end == 3;
        assert_eq!(outcome, if is_whole { Ok(()) } else { Err(StoreError::GivenUp) });
        assert_eq!(newest(&mut store).len(), if is_whole { 2 } else { 1 });
        let again = start(store.into_cells()).0;
        store = again;
    }
}

/// A chip that was never used, or wholly erased, begins without the seconds of an erase.
#[test]
fn a_new_chip_is_ready_at_once() {
    let (mut store, found) = start(Flash::new(64, 1));
    assert_eq!((found.erased, found.length), (0, None));
    save(&mut store, &[OWN]).unwrap();
    // The other sector, once, when it is to be needed.
    let mut erased = Vec::new();
    for _ in 0..20 {
        let (again, found) = start(store.into_cells());
        (store, erased) = (again, [erased, vec![found.erased]].concat());
        save(&mut store, &[OWN]).unwrap();
    }
    assert_eq!(erased.iter().position(|count| *count > 0), Some(5));
    assert_eq!(erased.iter().map(|count| u32::from(*count)).sum::<u32>(), 1);
    // A first save that was cut leaves the sector as it is.
    let mut flash = start(Flash::new(64, 1)).0.into_cells();
    flash.left = 1;
    let mut store = Store::start(flash).0;
    let _ = save(&mut store, &[OWN; 3]);
    let (mut store, found) = start(store.into_cells());
    assert_eq!((found.erased, store.len()), (0, 0));
    save(&mut store, &[OWN; 3]).unwrap();
    assert_eq!(newest(&mut start(store.into_cells()).0), [OWN; 3]);
}
