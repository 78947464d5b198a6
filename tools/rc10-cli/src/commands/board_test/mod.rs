//! `rc10 board-test`: leads a person with a first board through `docs/bring-up.md`, reads what can be read by probe and
//! console, asks for the rest, and keeps all of it in one file to send back.
//!
//! Judged is what a real board gives: lines of the log and of the console, words of memory by the probe, answers.

mod probe;
mod steps;

use std::collections::BTreeSet;
use std::fmt::Display;
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
use crate::run::board;
use crate::terminal::wrapped;
use crate::world::console::BAUD;
use crate::world::robot::Robot;

use probe::Probe;
pub use steps::steps;

/// Arguments of `rc10 board-test`.
#[derive(Args, Debug)]
pub struct BoardTestArgs {
    /// The program for the board; without one the robot's firmware is built first
    elf: Option<PathBuf>,
    /// The board, h723zg or dm-mc02 [default: the one that the program is for]
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

/// A line that was heard.
#[derive(Clone, Debug)]
pub struct Line {
    /// Where it comes from: `log`, `console`, or `probe`, the program that speaks with the probe.
    pub from: &'static str,
    /// Seconds on the clock of the bench at which it was heard.
    pub at: f64,
    /// Its text.
    pub text: String,
}

/// A board with its probe, and a person beside it. Each fails if there is no answer.
#[expect(clippy::missing_errors_doc, reason = "above")]
pub trait Bench {
    /// Puts the program into the chip and lets it run, its log being read from the start on.
    fn start(&mut self) -> Result<()>;
    /// Lets time pass; what was heard since the last call.
    fn listen(&mut self, seconds: f64) -> Result<Vec<Line>>;
    /// A word of the chip's memory, by the probe.
    fn read(&mut self, address: u32) -> Result<u32>;
    /// The person's answer; `None`: that is enough for now.
    fn ask(&mut self, question: &str) -> Result<Option<String>>;
}

/// How a step ended.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// `right`, `wrong`, `told` by the person, or `skipped`.
    pub word: &'static str,
    /// What was seen or told; of what is wrong the cause.
    pub text: String,
    /// What to do about it.
    pub mend: String,
}

impl Outcome {
    fn of(word: &'static str, text: impl Into<String>) -> Result<Self> {
        Ok(Self { word, text: text.into(), mend: String::new() })
    }
}

/// Causes in words and what to do about them, by their keys: a line each.
const CAUSES: &str = include_str!("causes.tsv");

/// A cause by its key, with its changing parts.
fn wrong(key: &str, parts: &[&dyn Display]) -> Result<Outcome> {
    let rows = CAUSES.lines().filter_map(|row| row.split_once('\t'));
    let (_, row) = rows.clone().find(|row| row.0 == key).with_context(|| key.to_owned())?;
    let fill = |text: String, (at, part): (usize, &&dyn Display)| {
        text.replace(&format!("{{{at}}}"), &part.to_string())
    };
    let row = parts.iter().enumerate().fold(row.to_owned(), fill);
    let (text, mend) = row.split_once('\t').unwrap_or((&row, ""));
    Ok(Outcome { word: "wrong", text: text.into(), mend: mend.into() })
}

/// A board on its way through the list.
pub struct Walk<'w> {
    /// The board with its probe and its person.
    pub bench: &'w mut dyn Bench,
    /// Where the person reads.
    pub out: &'w mut dyn Write,
    /// Gets a line of JSON for all that happens.
    pub file: &'w mut dyn Write,
    /// The board that the program is for.
    pub board: Board,
    /// Buses that the robot uses.
    pub buses: usize,
    /// Whether there is an adapter at the console.
    pub has_console: bool,
    /// The share of all waiting that this bench needs: 1 of a real board.
    pub pace: f64,
    /// Lines since the program began.
    pub heard: Vec<Line>,
    /// How many of them belong to steps before.
    pub before: usize,
}

impl Walk<'_> {
    /// Does the step with this number.
    ///
    /// # Errors
    /// If the person ends, or file or terminal cannot be written.
    pub fn step(&mut self, number: &str) -> Result<Outcome> {
        let [what, right, _] = steps::row(number);
        let right = if right.is_empty() { right } else { format!("   right: {right}\n") };
        self.tell(&format!("\n{number}. {what}\n{right}"))?;
        self.keep(&json!({ "begin": number }))?;
        self.before = self.heard.len();
        let judged = match steps::judge(self, number) {
            Err(error) if error.is::<io::Error>() => return Err(error),
            Err(error) => wrong("unread", &[&format!("{error:#}")])?,
            Ok(outcome) => outcome,
        };
        let Outcome { word, text, mend } = &self.said().unwrap_or(judged);
        self.keep(&json!({ "step": number, "outcome": word, "text": text, "do": mend }))?;
        let sign = if *word == "wrong" { "✗" } else { "✓" };
        self.tell(&format!("{sign} {}\n", if text.is_empty() { word } else { text.as_str() }))?;
        if !mend.is_empty() {
            self.tell(&format!("   do: {mend}\n"))?;
        }
        Ok(Outcome { word, text: text.clone(), mend: mend.clone() })
    }

    /// The cause that the log of this step names by itself.
    fn said(&self) -> Option<Outcome> {
        let lines = self.heard.get(self.before..)?;
        let keys = CAUSES.lines().filter_map(|row| row.split('\t').next());
        keys.filter_map(|key| Some((key, key.strip_prefix("said ")?))).find_map(|(key, words)| {
            let rest = |it: &Line| Some(it.text.split_once(words)?.1.to_owned());
            wrong(key, &[&lines.iter().filter(|it| it.from != "probe").find_map(rest)?]).ok()
        })
    }

    fn tell(&mut self, text: &str) -> io::Result<()> {
        self.out.write_all(wrapped(text).as_bytes())?;
        self.out.flush()
    }

    fn keep(&mut self, record: &Value) -> io::Result<()> {
        writeln!(self.file, "{record}")?;
        self.file.flush()
    }

    /// Lets time pass; the lines that came.
    fn listen(&mut self, seconds: f64) -> Result<Vec<Line>> {
        let lines = self.bench.listen(seconds * self.pace)?;
        for Line { from, at, text } in &lines {
            self.keep(&json!({ "from": from, "at": (at * 1e3).round() / 1e3, "text": text }))?;
        }
        self.heard.extend(lines.iter().cloned());
        Ok(lines)
    }

    fn read(&mut self, address: u32) -> Result<u32> {
        let value = self.bench.read(address)?;
        self.keep(&json!({ "read": format!("{address:#010x}"), "is": format!("{value:#010x}") }))?;
        Ok(value)
    }

    fn ask(&mut self, question: &str) -> Result<String> {
        let answer = self.bench.ask(question)?.map(|it| it.trim().to_owned());
        self.keep(&json!({ "asked": question, "answer": answer }))?;
        let answer = answer.filter(|answer| answer != "q");
        Ok(answer.ok_or(ErrorKind::UnexpectedEof).map_err(io::Error::from)?)
    }

    /// A number that was measured; `None`: it was not.
    fn measured(&mut self, question: &str) -> Result<Option<f64>> {
        loop {
            let answer = self.ask(&format!("{question} [a number; Enter: not measured]"))?;
            let number = answer.split_whitespace().next().unwrap_or_default().replace(',', ".");
            match number.parse() {
                _ if number.is_empty() || number == "s" => return Ok(None),
                Ok(number) => return Ok(Some(number)),
                Err(_) => self.tell("   that is no number\n")?,
            }
        }
    }
}

/// Leads a person through the list; returns whether something is wrong.
///
/// # Errors
/// There is no program, no such step, or the file cannot be written.
pub fn board_test(args: &BoardTestArgs, robot: &Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    let description = robot.description();
    let elf = match (&args.elf, description.firmware) {
        (Some(elf), _) => elf.clone(),
        (None, Some(build)) => build(args.board)?,
        (None, None) => bail!("this robot does not say how to build a firmware: name an ELF file"),
    };
    let program = fs::read(&elf).with_context(|| unreadable(&elf))?;
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
