//! `rc10 blackbox`: what a robot's chip has kept of the time before, fetched over the link.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_link::PIECE;
use rc10_motor::record::pages::{ERASED, Head, PAGES, ROUNDS};
use rc10_motor::record::ring::{CAUSE, HELD};
use rc10_motor::record::{LOST, TICK};
use rc10_time::Micros;

use super::session::{Session, stop};
use super::source::RunningArgs;
use crate::files::write_file;
use crate::lang::Language;
use crate::recording::sample::seconds;
use crate::replay::entries::entries;
use crate::terminal::{Progress, tell};
use crate::world::black_box::{BYTES, BlackBox, PAGE_BYTES, pages};
use crate::world::robot::Robot;

/// Arguments of `rc10 blackbox`.
#[derive(Args, Debug)]
pub struct BlackBoxArgs {
    #[command(flatten)]
    pub(crate) running: RunningArgs,
    /// A match in the board's flash, in place of what is in its RAM: 1 or nothing is the newest, 2 the one before
    #[arg(long = "match", value_name = "N", num_args = 0..=1, default_missing_value = "1", value_parser = clap::value_parser!(u16).range(1..))]
    pub round: Option<u16>,
    /// The file, for rc10 replay
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Write over the file, if it is there
    #[arg(long)]
    pub force: bool,
}

/// What ended the run before, by the number that a board gives it.
const CAUSES: [&str; 7] = [
    "what ended it is not known",
    "a panic ended it",
    "a fault of the core ended it",
    "an interrupt without a handler ended it",
    "it ended as the crystal stopped",
    "the watchdog ended it",
    "it ended as the supply fell",
];

/// Fetches a robot's black box. Fails without a robot or a black box, or if there is nothing in it.
pub fn black_box(args: &BlackBoxArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let path = &args.output;
    ensure!(args.force || !path.exists(), "{} is there: --force writes over it", path.display());
    let name =
        path.file_name().and_then(|it| it.to_str()).context("--output: no name of a file")?;
    let ended = stop()?;
    let mut session = Session::meet(args.running.open(&robot)?)?;
    let (bytes, words, notes) = match args.round {
        None => ring(&mut session, &ended)?,
        Some(back) => kept_match(&mut session, back, &ended)?,
    };
    let ticks = entries(&words).filter(|it| it.kind == TICK).map(|it| Micros::new(it.long(0)));
    let (first, last) = ticks.fold((None, Micros::ZERO), |(first, _), it| (first.or(Some(it)), it));
    write_file(path.parent().unwrap_or_else(|| Path::new("")), name, &bytes)?;
    let first = first.unwrap_or(last);
    let (from, to, length) = (seconds(first), seconds(last), seconds(last.since(first)));
    let mut lines =
        vec![format!("{length} s, from {from} s to {to} s after its start: {}", path.display())];
    lines.extend(notes);
    lines.push(format!("next: rc10 replay {}", path.display()));
    let spoken = Language::spoken();
    for line in lines {
        writeln!(out, "{}", spoken.say(&line))?;
    }
    Ok(())
}

/// What was fetched, the words of its entries, and what is to be said of it.
type Fetched = (Vec<u8>, Vec<u32>, Vec<String>);

/// Pieces of the ring in RAM.
const RING: usize = BYTES.div_ceil(PIECE);

fn ring(session: &mut Session<'_>, ended: &AtomicBool) -> Result<Fetched> {
    let mut memory = fetch(session, 0, RING, ended)?;
    ensure!(
        memory.len() == BYTES,
        "its black box is that of another program: {} bytes",
        memory.len()
    );
    let end = fetch(session, 0, 1, ended)?;
    let mut black_box = BlackBox::default();
    let gone = black_box.copied(&mut memory, &end);
    ensure!(black_box.is_kept(), "its black box is empty");
    let mut notes = Vec::new();
    match black_box.word(HELD) {
        0 => notes.push("the robot runs: it is no crash".into()),
        left => {
            let cause = CAUSES.get(black_box.word(CAUSE) as usize).unwrap_or(&CAUSES[0]);
            notes.push((*cause).into());
            notes.push(match left {
                1 => "the robot keeps it until it is armed once more".into(),
                left => format!("the robot keeps it until it is armed {left} times more"),
            });
        }
    }
    if gone > 0 {
        notes.push(format!("{gone} of 32 blocks were overwritten meanwhile, and are left out"));
    }
    Ok((memory, black_box.news(), notes))
}

/// The match so many from the newest, which is 1.
fn kept_match(session: &mut Session<'_>, back: u16, ended: &AtomicBool) -> Result<Fetched> {
    let numbers = fetch(session, RING, 1, ended)?;
    let [next, newest] = [0, 4].map(|at| {
        let word = numbers.get(at..at + 4).and_then(|it| it.try_into().ok());
        word.map_or(0, u32::from_le_bytes)
    });
    ensure!(
        next < u32::MAX - ERASED,
        "its flash is searched in the first seconds after a start: again; or it does not answer: its log says so"
    );
    let mut read = |page: u32, count: u32| -> Result<Vec<u8>> {
        let from = (page % PAGES) as usize * PAGE_BYTES;
        let (piece, skipped) = (from / PIECE, from % PIECE);
        let length = count as usize * PAGE_BYTES;
        let bytes = fetch(session, RING + 1 + piece, (skipped + length).div_ceil(PIECE), ended)?;
        Ok(bytes.into_iter().skip(skipped).take(length).collect())
    };
    // How many matches a page is before the newest.
    let age = |head: Head| (newest as u16).wrapping_sub(head.round) & ROUNDS;
    // The parts that are not erased ahead; the match begins in the one before the first that begins with it.
    let high = next.div_ceil(ERASED);
    let (mut low, mut high) = ((high + 1).saturating_sub(PAGES / ERASED), high);
    let oldest = low;
    while low < high {
        let middle = u32::midpoint(low, high);
        // Its first page that is whole.
        let part = read(middle * ERASED, 8)?;
        let mut heads = pages(&part).map(|(head, ..)| head);
        match heads.find(|head| head.number / ERASED == middle) {
            Some(head) if age(head) < back => high = middle,
            _ => low = middle + 1,
        }
    }
    let (mut bytes, mut page) = (Vec::new(), low.saturating_sub(1).max(oldest) * ERASED);
    let mut ends = false;
    while page < next && !ends {
        let part = read(page, ERASED.min(next - page))?;
        // Not those that were written meanwhile in place of them.
        for (head, _, bits) in
            pages(&part).filter(|(head, ..)| head.number / ERASED == page / ERASED)
        {
            if age(head) + 1 == back {
                bytes.extend(bits);
            }
            ends |= age(head) + 1 < back;
        }
        page += ERASED;
    }
    ensure!(!bytes.is_empty(), "there is no such match in its flash");
    let (_, words) = BlackBox::of_pages(&bytes).unwrap_or_default();
    let lost: u64 =
        entries(&words).filter(|it| it.kind == LOST).map(|it| u64::from(it.word(0))).sum();
    let notes = (lost > 0).then(|| format!("{lost} words in it are missing"));
    Ok((bytes, words, notes.into_iter().collect()))
}

/// So many pieces from one on; fails if they do not come.
fn fetch(
    session: &mut Session<'_>,
    first: usize,
    count: usize,
    ended: &AtomicBool,
) -> Result<Vec<u8>> {
    let mut progress = Progress::new();
    let (mut begin, mut known) = (session.now(), first);
    session.client.fetch_black_box(first);
    loop {
        session.step()?;
        let (pieces, of, refused) = session.client.black_box();
        if let Some(why) = refused {
            bail!(
                "its program has no black box: build it with --features rc10-board/black-box (it answers: {why})"
            );
        }
        ensure!(of > first, "its board keeps no matches: a DM-MC02 does");
        if pieces.len() >= first + count || of > first + 1 && pieces.len() == of {
            return Ok(pieces[first..].iter().take(count).flatten().flatten().copied().collect());
        }
        let come = pieces.len();
        progress.tell_of(
            ((come - first) * PIECE / 1024) as u64,
            (count * PIECE / 1024) as f64,
            "KiB",
        );
        if come > known {
            (begin, known) = (session.now(), come);
        }
        ensure!(!ended.load(Ordering::Relaxed), "ended: no file is written");
        if session.now().since(begin) > Micros::from_millis(5000) {
            let why = session.trouble();
            tell(why.unwrap_or_else(|| "a program before this one does not answer at all".into()));
            bail!("its black box does not come");
        }
    }
}
