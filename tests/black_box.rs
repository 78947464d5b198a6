//! The ring of a black box: what is put into it comes out again as it was, whenever the writing ends, and whatever the
//! memory has become.
#![expect(
    clippy::cast_possible_truncation,
    reason = "random numbers below a bound, and counts of words"
)]

use rc10_motor::record::ring::{MAGIC, Memory, NEWEST, Reader, WORDS, Writer};
use rc10_motor::record::{FRAME, LOST, SENT, STATE, head};
use rc10_sim::Random;

use crate::replay::recorded;

/// Where the first block begins, and their words and number; as the page has it.
const HEAD: usize = 8;
const BLOCK: usize = 2_558;
const BLOCKS: usize = 32;

pub(crate) fn ring() -> (Box<Writer>, Box<Memory>) {
    let mut memory: Box<Memory> = vec![0xDEAD_BEEF; WORDS].try_into().unwrap();
    let mut writer = Box::new(Writer::NEW);
    writer.clear(&mut memory, 7);
    (writer, memory)
}

/// The entries of a run as a chip has them that no test bench watches.
pub(crate) fn plain(words: &[u32]) -> Vec<&[u32]> {
    let (mut all, mut rest) = (Vec::new(), words);
    while let Some(head) = rest.first() {
        let [kind, _, length, more] = head.to_le_bytes();
        let (entry, behind) = rest.split_at(1 + usize::from(length));
        if kind != STATE && (kind != SENT || more >> 4 != 0) {
            all.push(entry);
        }
        rest = behind;
    }
    all
}

fn read(memory: &Memory) -> Vec<Vec<u32>> {
    let (mut entries, mut reader) = (Vec::new(), Reader::NEW);
    reader.read(memory, &mut |entry| entries.push(entry.to_vec()));
    entries
}

#[track_caller]
fn is_end_of(read: &[Vec<u32>], put: &[&[u32]]) {
    assert!(read.len() <= put.len());
    assert!(read.iter().eq(&put[put.len() - read.len()..]), "{} of {}", read.len(), put.len());
}

#[test]
fn what_reaches_a_robot_comes_out_as_it_went_in() {
    fn check<P: rc10_cli::Simulated>(millis: u64, least: usize) {
        let words = recorded::<P>(&["power:1@1.2s..1.5s", "babble:1@2s..2.1s"], millis);
        let put = plain(&words);
        let ((mut writer, mut memory), mut random) = (ring(), Random::new(1));
        // Some that read while it is written miss nothing.
        let (mut reader, mut news) = (Box::new(Reader::NEW), Vec::new());
        for entry in &put {
            writer.put(&mut memory, entry);
            if random.below(500) == 0 {
                reader.read(&memory, &mut |entry| news.push(entry.to_vec()));
            }
        }
        reader.read(&memory, &mut |entry| news.push(entry.to_vec()));
        assert!(news.iter().eq(&put));
        let kept = read(&memory);
        is_end_of(&kept, &put);
        println!("{} of {} entries are kept", kept.len(), put.len());
        assert!(kept.len() > least);
    }
    check::<team::Robot>(13_000, 172_000);
    // Its line is asked again and again.
    check::<mixed::Robot>(2_000, 100_000);
}

/// Of any kind and length, with any content.
fn anything(random: &mut Random) -> Vec<u32> {
    let kind = random.below(17) as u8;
    let words = if random.below(20) == 0 { random.below(256) } else { random.below(6) } as u8;
    let mut entry = vec![head(kind, random.below(3) as u8, words, random.below(4) as u8)];
    for _ in 0..words {
        let word = random.below(1 << 32) as u32;
        entry.push(word >> (random.below(9) * 4).min(31) << (random.below(3) * 7));
    }
    entry
}

#[test]
fn anything_comes_out_as_it_went_in() {
    for seed in 0..40 {
        let (mut random, (mut writer, mut memory)) = (Random::new(seed), ring());
        let put: Vec<_> = (0..12_000).map(|_| anything(&mut random)).collect();
        put.iter().for_each(|entry| writer.put(&mut memory, entry));
        let put: Vec<_> = put.iter().map(Vec::as_slice).collect();
        let kept = read(&memory);
        assert!(kept.len() > 1000);
        is_end_of(&kept, &put);
    }
}

/// A reader that comes late is told how many words are gone.
#[test]
fn what_was_overwritten_is_told() {
    let (mut random, (mut writer, mut memory)) = (Random::new(5), ring());
    let mut reader = Box::new(Reader::NEW);
    let (mut words, mut told, mut lost) = (0, 0, 0);
    for round in 0..6 {
        for _ in 0..9_000 * round {
            let entry = anything(&mut random);
            words += entry.len() as u64;
            writer.put(&mut memory, &entry);
        }
        reader.read(&memory, &mut |entry| {
            let is_lost = entry[0] == head(LOST, 0, 1, 0);
            told += if is_lost { u64::from(entry[1]) } else { entry.len() as u64 };
            lost += u64::from(is_lost);
        });
        assert_eq!(told, words, "round {round}");
    }
    assert!(lost >= 2, "{lost}");
}

/// The words that a put writes, in their order: to each its place, and what it is then.
fn writes(before: &Memory, after: &Memory) -> Vec<(usize, u32)> {
    let number = after[NEWEST] as usize;
    let at = HEAD + number % BLOCKS * BLOCK;
    let mut writes = Vec::new();
    if before[NEWEST] != after[NEWEST] {
        let (total, number) = (after[at], number as u32);
        writes.push((NEWEST, number));
        writes.extend((at..).zip([total, number, total, number << 17]));
    }
    let bits = at + 4..at + BLOCK;
    writes.extend(bits.filter(|at| before[*at] != after[*at]).map(|at| (at, after[at])));
    writes.extend([at + 2, at + 3].map(|at| (at, after[at])));
    writes
}

/// A reset between any two words. The memory takes 64 bits at once: the last half that was written alone is lost.
#[test]
fn ten_thousand_cuts_leave_all_entries_but_the_last() {
    let words = recorded::<team::Robot>(&[], 4_000);
    let put = plain(&words);
    let mut random = Random::new(9);
    let (mut cuts, mut lasts, mut torn) = (0, 0, 0);
    while cuts < 10_000 {
        let (mut writer, mut memory) = ring();
        let first = random.index(put.len() / 2);
        let until = put.len().min(first + 20_000);
        for at in first..until {
            let before = memory.clone();
            writer.put(&mut memory, put[at]);
            // At each begin of a block, and now and then.
            if before[NEWEST] == memory[NEWEST] && random.below(60) != 0 {
                continue;
            }
            let writes = writes(&before, &memory);
            let count = random.index(writes.len() + 1);
            let mut cut = before.clone();
            writes[..count].iter().for_each(|(at, word)| cut[*at] = *word);
            let is_whole = count > 1 && writes[count - 2].0 ^ 1 == writes[count - 1].0;
            if let (Some((at, _)), false) = (writes[..count].last(), is_whole) {
                let earlier = writes[..count - 1].iter().rev().find(|it| it.0 == *at);
                cut[*at] = earlier.map_or(before[*at], |it| it.1);
                torn += 1;
            }
            let mut kept = read(&cut);
            if kept.last().is_some_and(|it| it[0] == head(LOST, 0, 1, 0)) {
                // The count was written, and not the mark: what is missing is the last one.
                assert_eq!(kept.pop().unwrap()[1] as usize, put[at].len());
            }
            let missing = at + 1 - first - kept.len();
            assert!(missing <= 1, "{missing} of {} are missing", at + 1 - first);
            assert!(kept.iter().eq(&put[first..first + kept.len()]));
            (cuts, lasts) = (cuts + 1, lasts + usize::from(missing == 0));
        }
    }
    println!("{cuts} cuts, {torn} of them in 64 bits; of {lasts} the last entry was whole");
    assert!(lasts > cuts / 20 && torn > cuts / 4);
}

/// Whatever the memory has become, reading it ends, and says no more than fits.
#[test]
fn damaged_memory_is_read_as_far_as_it_goes() {
    let words = recorded::<team::Robot>(&[], 3_000);
    let put = plain(&words);
    let (mut writer, mut whole) = ring();
    put.iter().for_each(|entry| writer.put(&mut whole, entry));
    let count = |memory: &Memory| {
        let (mut entries, mut lost, mut reader) = (0_usize, 0, Reader::NEW);
        reader.read(memory, &mut |entry| {
            assert_eq!(entry.len(), 1 + usize::from(entry[0].to_le_bytes()[2]));
            (entries, lost) = (entries + 1, lost + u32::from(entry[0] == head(LOST, 0, 1, 0)));
        });
        (entries, lost)
    };
    assert_eq!(count(&whole), (put.len(), 0));
    let (mut random, mut told) = (Random::new(2), 0);
    for round in 0..300 {
        let mut memory = whole.clone();
        for _ in 0..1 << (round % 12) {
            let at = random.index(HEAD + 8 * BLOCK);
            match random.below(3) {
                0 => memory[at] ^= 1 << random.below(32),
                1 => memory[at] = random.below(1 << 32) as u32,
                _ => memory[at..].iter_mut().take(64).for_each(|it| *it = 0),
            }
        }
        let (entries, lost) = count(&memory);
        assert!(entries < 40 * WORDS);
        told += u32::from(lost > 0);
    }
    assert!(told > 150, "{told}");
    for round in 0..60 {
        let filled = [0, u32::MAX, 0x5555_5555][round % 3];
        let mut memory: Box<Memory> = vec![filled; WORDS].try_into().unwrap();
        memory[0] = MAGIC;
        let is_noise = round >= 30;
        for (at, word) in memory.iter_mut().enumerate().skip(HEAD) {
            let noise = random.below(1 << 32) as u32;
            let (block, inner) = ((at - HEAD) / BLOCK, (at - HEAD) % BLOCK);
            // Each block is as it is said to be, and full of something.
            match inner {
                1 => *word = 64 + block as u32,
                3 => *word = (64 + block as u32) << 17 | 81_728,
                _ if is_noise => *word = noise,
                _ => {}
            }
        }
        let (entries, _) = count(&memory);
        assert!(entries < 40 * WORDS, "{entries}");
    }
}

/// A frame of a motor that stands still takes some bits, and not a word.
#[test]
fn what_does_not_change_takes_a_bit_a_number() {
    let (mut writer, mut memory) = ring();
    for tick in 0..200_u32 {
        writer.put(&mut memory, &[head(FRAME, 0, 4, 8), tick * 1000, 0x201, 0x1234, 0x19_0000]);
    }
    let bits = memory[HEAD + BLOCK + 3] & 0x1_FFFF;
    assert!(bits < 200 * 6 + 900, "{bits}");
}
