//! Matches in a serial flash: what a ring has while a robot is armed is read again from its pages, whenever the power is
//! cut, and whatever the flash has been before.
#![expect(clippy::cast_possible_truncation, reason = "random numbers below a bound")]

use std::io::Cursor;

use rc10_cli::replay::{Inputs, replayed};
use rc10_motor::record::pages::{ERASED, Flash, Head, Keeper, PAGE, PAGES, Page};
use rc10_motor::record::ring;
use rc10_motor::record::{LOST, head};
use rc10_sim::Random;
use rc10_time::Micros;

use crate::black_box::{plain, ring as new_ring};
use crate::replay::recorded;

/// A flash that keeps time in ms. A program of what is not erased is a mistake of its user.
struct Serial {
    pages: Vec<Page>,
    /// From this page on these are to be there, between two times.
    running: Option<(u32, Vec<Page>, [u64; 2])>,
    now: u64,
    random: Random,
    erased: u64,
}

impl Serial {
    fn new(seed: u64) -> Self {
        let pages = vec![[u32::MAX; PAGE]; PAGES as usize];
        Self { pages, running: None, now: 0, random: Random::new(seed), erased: 0 }
    }

    fn begin(&mut self, first: u32, wanted: Vec<Page>, times: [u64; 2]) {
        assert!(self.running.is_none(), "it takes nothing while it is busy");
        let ends = self.now + times[0] + self.random.below(times[1] - times[0]);
        self.running = Some((first, wanted, [self.now, ends]));
    }

    /// The power goes: each bit of what runs is done or not.
    fn cut(&mut self) {
        self.settle();
        let Some((first, wanted, _)) = self.running.take() else { return };
        let part = self.random.below(33);
        for (page, wanted) in self.pages[first as usize..].iter_mut().zip(wanted) {
            for (word, wanted) in page.iter_mut().zip(wanted) {
                let mask = (0..32)
                    .fold(0, |mask, bit| mask | u32::from(self.random.below(32) < part) << bit);
                *word = *word & !mask | wanted & mask;
            }
        }
    }

    fn settle(&mut self) {
        if let Some((first, wanted, _)) = self.running.take_if(|it| it.2[1] <= self.now) {
            self.pages[first as usize..][..wanted.len()].copy_from_slice(&wanted);
        }
    }

    /// The pages of a match, as a PC has them in a file.
    fn file(&self, round: u16) -> Vec<u8> {
        let heads =
            (0..).zip(&self.pages).filter_map(|(place, it)| Some((Head::of(it, place)?, it)));
        let mut pages: Vec<_> = heads.filter(|(head, _)| head.round == round).collect();
        pages.sort_by_key(|(head, _)| head.number);
        pages
            .into_iter()
            .flat_map(|(_, page)| page.iter().flat_map(|it| it.to_le_bytes()))
            .collect()
    }

    fn words(&self, round: u16) -> Vec<u32> {
        let file = self.file(round);
        if file.is_empty() {
            Vec::new()
        } else {
            Inputs::read(&mut Cursor::new(file)).unwrap().words
        }
    }
}

impl Flash for Serial {
    fn is_busy(&mut self) -> bool {
        self.settle();
        self.running.is_some()
    }

    fn read(&mut self, page: u32) -> Page {
        assert!(self.running.is_none());
        self.pages[page as usize]
    }

    fn program(&mut self, page: u32, content: &Page) {
        assert_eq!(self.pages[page as usize], [u32::MAX; PAGE], "page {page} is not erased");
        self.begin(page, vec![*content], [1, 4]);
    }

    fn erase(&mut self, first: u32) {
        assert!(first.is_multiple_of(ERASED));
        self.erased += 1;
        let slow = self.random.below(8) == 0;
        let times = if slow { [150, 2000] } else { [150, 300] };
        self.begin(first, vec![[u32::MAX; PAGE]; ERASED as usize], times);
    }
}

/// Entries of a ms.
const EACH: usize = 21;

/// Drives a robot from power-on on: armed within these ms, until the power is cut.
fn drive(flash: &mut Serial, put: &[&[u32]], armed: [u64; 2], until: u64) {
    let ((mut writer, mut memory), mut keeper) = (new_ring(), Keeper::NEW);
    let mut rest = put.iter();
    let begin = flash.now;
    for ms in 0..until {
        rest.by_ref().take(EACH).for_each(|entry| writer.put(&mut memory, entry));
        flash.now = begin + ms;
        let is_armed = ms >= armed[0] && ms < armed[1];
        let part = |block, from, to: &mut [u32]| ring::part(&memory, block, from, to);
        keeper.step(flash, part, is_armed, Micros::from_millis(ms));
    }
    flash.cut();
}

/// The entries before `end` that these words are, the first and the number behind the last; nothing is missing.
#[track_caller]
fn place(words: &[u32], put: &[&[u32]]) -> [usize; 2] {
    let read = plain(words);
    assert!(!read.is_empty() && read.iter().all(|entry| entry[0] != head(LOST, 0, 1, 0)));
    let first = (0..put.len()).find(|at| put[*at..].starts_with(&read));
    let first = first.expect("what comes out is not what went in");
    [first, first + read.len()]
}

#[test]
fn a_match_is_read_as_it_was_whenever_the_power_goes() {
    let words = recorded::<team::Robot>(&["power:1@1.2s..1.5s"], 9_000);
    let put = plain(&words);
    let mut missing = Vec::new();
    for seed in 0..24 {
        let (mut flash, mut random) = (Serial::new(seed), Random::new(seed ^ 0x99));
        if seed % 4 == 3 {
            // Something else was in it.
            flash.pages.iter_mut().flatten().for_each(|it| *it = random.below(1 << 32) as u32);
        }
        for round in 1..=3 {
            let armed = [2_500 + random.below(1_000), 5_000 + random.below(1_000)];
            // The erases behind the search take 4 s at worst.
            let until = if round == 2 { 8_500 } else { 5_000 + random.below(3_000) };
            drive(&mut flash, &put, armed, until);
            let [first, last] = place(&flash.words(round), &put).map(|it| (it / EACH) as u64);
            // From some blocks before arming, up to some time after disarming or to the cut.
            let end = until.min(armed[1] + 2_000);
            assert!(first + 1_000 < armed[0], "{first} of {armed:?}");
            // What waited for an erase is written, too.
            assert!(last <= until && last + 4_500 > end, "{last} of {end}, round {round}");
            missing.push(end.saturating_sub(last));
        }
        // Nothing of the matches before has gone.
        assert!((1..=3).all(|round| place(&flash.words(round), &put)[1] > 0));
    }
    missing.sort_unstable();
    println!("of the half are missing {} ms at most, {} at worst", missing[36], missing[71]);
    assert!(missing[36] < 20, "{missing:?}");
}

#[test]
fn the_oldest_goes_when_the_flash_is_full_and_a_match_of_it_is_replayed() {
    let words = recorded::<team::Robot>(&[], 9_000);
    let put = plain(&words);
    let mut flash = Serial::new(7);
    // A match of four seconds is 2 % of it.
    for round in 1..=60 {
        drive(&mut flash, &put, [2_000, 6_000], 8_200);
        place(&flash.words(round), &put);
    }
    let kept = (1..=60).filter(|round| !flash.words(*round).is_empty());
    let kept: Vec<u16> = kept.collect();
    println!("{} matches of 60 are kept, {} parts erased", kept.len(), flash.erased);
    assert!(kept.len() > 20 && kept.len() < 60 && kept.contains(&60));
    for round in &kept[1..] {
        place(&flash.words(*round), &put);
    }
    let (told, difference) = rc10_cli::with::<team::Robot, _>(|shared, motors| {
        let robot = rc10_cli::robot_of::<team::Robot>(shared, motors).unwrap();
        replayed(&flash.words(60), robot).unwrap()
    });
    assert_eq!((difference, told.lost), (None, 0));
    assert!(told.states > 40, "{told:?}");
}

#[test]
fn a_page_that_is_not_whole_is_missing_and_told() {
    let words = recorded::<team::Robot>(&[], 9_000);
    let put = plain(&words);
    let mut flash = Serial::new(3);
    drive(&mut flash, &put, [2_000, 6_000], 8_200);
    let all = plain(&flash.words(1)).len();
    let mut random = Random::new(1);
    let bit = random.index(PAGE * 32);
    flash.pages[300][bit / 32] ^= 1 << (bit % 32);
    let words = flash.words(1);
    let read = plain(&words);
    let lost: Vec<_> = read.iter().filter(|entry| entry[0] == head(LOST, 0, 1, 0)).collect();
    assert_eq!(lost.len(), 1, "{lost:?}");
    // What is missing is the rest of a block at most.
    assert!(read.len() < all && read.len() + 8_000 > all, "{} of {all}", read.len());
}
