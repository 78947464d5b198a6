//! `rc10 blackbox`: what a robot's chip has kept of the time before, fetched over the link.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_link::PIECE;
use rc10_motor::record::TICK;
use rc10_motor::record::ring::{CAUSE, HELD};
use rc10_time::Micros;

use super::session::{Session, stop};
use super::source::RunningArgs;
use crate::files::write_file;
use crate::lang::Language;
use crate::recording::sample::seconds;
use crate::replay::entries::entries;
use crate::terminal::{Progress, tell};
use crate::world::black_box::{BYTES, BlackBox};
use crate::world::robot::Robot;

/// Arguments of `rc10 blackbox`.
#[derive(Args, Debug)]
pub struct BlackBoxArgs {
    #[command(flatten)]
    pub(crate) running: RunningArgs,
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
    let mut memory = fetch(&mut session, BYTES.div_ceil(PIECE), &ended)?;
    ensure!(
        memory.len() == BYTES,
        "its black box is that of another program: {} bytes",
        memory.len()
    );
    let end = fetch(&mut session, 1, &ended)?;
    let mut black_box = BlackBox::default();
    let gone = black_box.copied(&mut memory, &end);
    ensure!(black_box.is_kept(), "its black box is empty");
    let words = black_box.news();
    let ticks = entries(&words).filter(|it| it.kind == TICK).map(|it| Micros::new(it.long(0)));
    let (first, last) = ticks.fold((None, Micros::ZERO), |(first, _), it| (first.or(Some(it)), it));
    write_file(path.parent().unwrap_or_else(|| Path::new("")), name, &memory)?;
    let first = first.unwrap_or(last);
    let (from, to, length) = (seconds(first), seconds(last), seconds(last.since(first)));
    let mut lines =
        vec![format!("{length} s, from {from} s to {to} s after its start: {}", path.display())];
    match black_box.word(HELD) {
        0 => lines.push("the robot runs: it is no crash".into()),
        left => {
            let cause = CAUSES.get(black_box.word(CAUSE) as usize).unwrap_or(&CAUSES[0]);
            lines.push((*cause).into());
            lines.push(format!("the robot keeps it until it is armed {left} times more"));
        }
    }
    if gone > 0 {
        lines.push(format!("{gone} of 32 blocks were overwritten meanwhile, and are left out"));
    }
    lines.push(format!("next: rc10 replay {}", path.display()));
    let spoken = Language::spoken();
    for line in lines {
        writeln!(out, "{}", spoken.say(&line))?;
    }
    Ok(())
}

/// The first pieces, at least so many; fails if they do not come.
fn fetch(session: &mut Session<'_>, least: usize, ended: &AtomicBool) -> Result<Vec<u8>> {
    let mut progress = Progress::new();
    let (mut begin, mut known) = (session.now(), 0);
    session.client.fetch_black_box();
    loop {
        session.step()?;
        let (pieces, of, refused) = session.client.black_box();
        if let Some(why) = refused {
            bail!(
                "its program has no black box: build it with --features rc10-board/black-box (it answers: {why})"
            );
        }
        if of > 1 && pieces.len() >= least.min(of) {
            return Ok(pieces.iter().flatten().flatten().copied().collect());
        }
        let come = pieces.len();
        progress.tell_of((come * PIECE / 1024) as u64, (of * PIECE / 1024) as f64, "KiB");
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
