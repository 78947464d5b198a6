//! `rc10 board-test`: leads a person with a first board through `docs/bring-up.md`, reads what can be read by probe and
//! console, asks for the rest, and keeps all of it in one file to send back.
//!
//! Judged is what a real board gives: lines of the log and of the console, words of memory by the probe, answers.

mod probe;
mod steps;
mod walk;

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_emu::{Board, Image};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::files::unreadable;
use crate::recording::sample::hex_digits;
use crate::robot::build::Wanted;
use crate::run::board::{self, program};
use crate::world::console::BAUD;
use crate::world::robot::Robot;

use probe::Probe;
pub use steps::steps;
pub use walk::{Bench, Line, Outcome, Walk};

/// Arguments of `rc10 board-test`.
#[derive(Args, Debug)]
pub struct BoardTestArgs {
    /// The program to run; without one the firmware is built first
    elf: Option<PathBuf>,
    /// The board, h723zg or dm-mc02 [default: the one that the program is for]; without a program, the one to build it for
    #[arg(long, value_name = "NAME", value_parser = board::named)]
    board: Option<Board>,
    /// The serial port of a USB adapter at the board's console, such as /dev/ttyUSB0
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// Only this step, once more; may be said several times
    #[arg(long, value_name = "NUMBER")]
    step: Vec<String>,
    /// The file that is written, and gone on with
    #[arg(long, value_name = "FILE", default_value = "board-test.jsonl")]
    out: PathBuf,
}

/// Leads a person through the list; returns whether something is wrong. Fails if there is no
/// program, no such step, or the file cannot be written.
pub fn board_test(args: &BoardTestArgs, robot: &Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    let description = robot.description();
    let (elf, program) =
        program(args.elf.as_deref(), description, Wanted { board: args.board, black_box: false })?;
    let named = || elf.display().to_string();
    let board = board::of(&program, args.board, None).with_context(named)?;
    let made_for = Image::parse(&program).with_context(named)?.made_for;
    if let Some(why) = board::mismatch(made_for.as_ref(), &board) {
        bail!("{}: {why}", elf.display());
    }
    let all: Vec<_> = steps(&board).collect();
    if let Some(unknown) = args.step.iter().find(|it| !all.contains(&it.as_str())) {
        bail!("no step {unknown} is led: {}", all.join(" "));
    }
    let console = args.port.as_deref().map(|port| (port, description.console.unwrap_or(BAUD)));
    let mut probe = Probe::new(board.chip, &elf, console)?;
    let sha256 = hex_digits(Sha256::new().chain_update(&program));
    let heading = json!({
        "kit": 1, "rc10": env!("CARGO_PKG_VERSION"), "robot": description.name, "board": board.name,
        "chip": board.chip, "elf": elf, "sha256": sha256, "probe": probe::version(),
    });
    let (mut file, done) = open(&args.out, &heading)?;
    writeln!(out, "{} on {}, program {}", description.name, board.name, elf.display())?;
    writeln!(out, "Enter: done, or as it should be; s: leave out; q: end, go on another time")?;
    if !done.is_empty() && args.step.is_empty() {
        let (path, count) = (args.out.display(), done.len());
        writeln!(out, "{path} has {count} steps already; --step NUMBER repeats one")?;
    }
    let (mut wrong, mut walk) = (
        Vec::new(),
        Walk {
            bench: &mut probe,
            out,
            file: &mut file,
            board,
            buses: description.buses.into(),
            has_console: console.is_some(),
            pace: 1.0,
            heard: Vec::new(),
            before: 0,
        },
    );
    let lead = || {
        for number in all {
            let is_wanted = args.step.iter().any(|it| it == number);
            while is_wanted || args.step.is_empty() && !done.contains(number) {
                let outcome = walk.step(number)?;
                if outcome.word != "wrong" {
                    break;
                }
                wrong.push(format!("✗ {number}: {}\n", outcome.text));
                if walk.ask("Enter: on to the next step; r: this one again")? != "r" {
                    break;
                }
                wrong.pop();
            }
        }
        anyhow::Ok(())
    };
    let is_end = |it: &io::Error| it.kind() == ErrorKind::UnexpectedEof;
    match lead() {
        Err(error) if !error.downcast_ref().is_some_and(is_end) => return Err(error),
        Err(_) => writeln!(out, "\nended; the same command goes on from here")?,
        Ok(()) => writeln!(out, "\nthat was all; with motors armed docs/bring-up.md goes on")?,
    }
    writeln!(out, "{}to send back: {}", wrong.concat(), args.out.display())?;
    Ok(!wrong.is_empty())
}

/// A file that is begun or gone on with, and the steps that it has already, of this program on this board. Fails on a
/// file of something else.
fn open(path: &Path, heading: &Value) -> Result<(fs::File, BTreeSet<String>)> {
    let before = match fs::read_to_string(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        before => before.with_context(|| unreadable(path))?,
    };
    ensure!(
        before.is_empty() || before.starts_with("{\"kit\":"),
        "{} is no file of rc10 board-test: name another one by --out",
        path.display()
    );
    let (mut done, mut is_ours) = (BTreeSet::new(), false);
    for record in before.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()) {
        if record.get("kit").is_some() {
            is_ours = ["sha256", "board"].iter().all(|key| record[*key] == heading[*key]);
        }
        let Some(step) = record["step"].as_str().filter(|_| is_ours) else { continue };
        match record["outcome"].as_str() {
            Some("right" | "told") => done.insert(step.to_owned()),
            _ => done.remove(step),
        };
    }
    let written = || format!("cannot write {}", path.display());
    let mut file = OpenOptions::new().create(true).append(true).open(path).with_context(written)?;
    // A line that was cut off stays as it is, by itself.
    let cut_off = if before.is_empty() || before.ends_with('\n') { "" } else { "\n" };
    writeln!(file, "{cut_off}{heading}").with_context(written)?;
    Ok((file, done))
}
