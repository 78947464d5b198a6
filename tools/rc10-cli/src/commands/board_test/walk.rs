//! A board, the person beside it, and what is kept of both.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use anyhow::{Context as _, Result};
use rc10_emu::Board;
use serde_json::{Value, json};

use crate::terminal::wrapped;

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
pub trait Bench {
    /// Puts the program into the chip and lets it run, its log being read from the start on.
    fn start(&mut self) -> Result<()>;
    /// Lets time pass; what was heard since the last call.
    fn listen(&mut self, seconds: f64) -> Result<Vec<Line>>;
    /// A word of the chip's memory, by the probe.
    fn read(&mut self, address: u32) -> Result<u32>;
    /// The person's answer; `None`: that is enough for now.
    fn ask(&mut self, question: &str) -> Result<Option<String>>;
    /// Lets go of the probe: the person needs it.
    fn let_go(&mut self) {}
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
    pub(super) fn of(word: &'static str, text: impl Into<String>) -> Result<Self> {
        Ok(Self { word, text: text.into(), mend: String::new() })
    }
}

/// Causes in words and what to do about them, by their keys: a line each.
pub(super) const CAUSES: &str = include_str!("causes.tsv");

/// A cause by its key, with its changing parts.
pub(super) fn wrong(key: &str, parts: &[&dyn Display]) -> Result<Outcome> {
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
    /// The cause that the log of this step names by itself.
    pub(super) fn said(&self) -> Option<Outcome> {
        let lines = self.heard.get(self.before..)?;
        let keys = CAUSES.lines().filter_map(|row| row.split('\t').next());
        keys.filter_map(|key| Some((key, key.strip_prefix("said ")?))).find_map(|(key, words)| {
            let rest = |it: &Line| Some(it.text.split_once(words)?.1.to_owned());
            wrong(key, &[&lines.iter().filter(|it| it.from != "probe").find_map(rest)?]).ok()
        })
    }

    pub(super) fn tell(&mut self, text: &str) -> io::Result<()> {
        self.out.write_all(wrapped(text).as_bytes())?;
        self.out.flush()
    }

    pub(super) fn keep(&mut self, record: &Value) -> io::Result<()> {
        writeln!(self.file, "{record}")?;
        self.file.flush()
    }

    /// Lets time pass; the lines that came.
    pub(super) fn listen(&mut self, seconds: f64) -> Result<Vec<Line>> {
        let lines = self.bench.listen(seconds * self.pace)?;
        for Line { from, at, text } in &lines {
            self.keep(&json!({ "from": from, "at": (at * 1e3).round() / 1e3, "text": text }))?;
        }
        self.heard.extend(lines.iter().cloned());
        Ok(lines)
    }

    pub(super) fn read(&mut self, address: u32) -> Result<u32> {
        let value = self.bench.read(address)?;
        self.keep(&json!({ "read": format!("{address:#010x}"), "is": format!("{value:#010x}") }))?;
        Ok(value)
    }

    pub(super) fn ask(&mut self, question: &str) -> Result<String> {
        let answer = self.bench.ask(question)?.map(|it| it.trim().to_owned());
        self.keep(&json!({ "asked": question, "answer": answer }))?;
        let answer = answer.filter(|answer| answer != "q");
        Ok(answer.ok_or(ErrorKind::UnexpectedEof).map_err(io::Error::from)?)
    }

    /// Has the person do something. Fails with [`ErrorKind::Interrupted`] if it is left out.
    pub(super) fn deed(&mut self, what: &str) -> Result<()> {
        let is_done = self.ask(&format!("{what}; s: leave out"))?.is_empty();
        Ok(is_done.then_some(()).ok_or(ErrorKind::Interrupted).map_err(io::Error::from)?)
    }

    /// A number that was measured; `None`: it was not.
    pub(super) fn measured(&mut self, question: &str) -> Result<Option<f64>> {
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
