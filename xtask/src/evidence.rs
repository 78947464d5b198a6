//! The table of `docs/evidence.md`: what the firmware cost, by commit.

use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::cargo::{answer, root};
use crate::figures;

/// Makes the table, or the page with it. Fails if there is no such table, or git has no history
/// here.
pub fn run(what: Option<&str>) -> Result<()> {
    match what {
        None => figures::run("evidence"),
        Some("commits") => commits(),
        Some(other) => bail!("no `{other}`: commits"),
    }
}

/// A column: its heading, and the beginnings of lines that have it with the place of the number in them. The second
/// form is that of the pages before 28 November 2026.
const COLUMNS: [(&str, [(&str, usize); 2]); 4] = [
    ("flash KiB", [("flash  ", 0), ("| flash", 0)]),
    ("static KiB", [("RAM  ", 0), ("| static RAM", 0)]),
    ("stack KiB", [("static RAM + stack  ", 3), ("| static RAM and deepest stack", 1)]),
    ("million instr./s", [("a second  ", 0), ("| instructions of everything, a second", 0)]),
];

/// Prints what the team's firmware cost, whenever the pages said something new of it.
fn commits() -> Result<()> {
    let pages = ["docs/figures.md", "README.md"];
    let log = git(&[&["log", "--reverse", "--format=%h %cs", "--"], &pages[..]].concat());
    let log = log.context("git has no history here")?;
    println!("commit   date       {}", COLUMNS.map(|(name, _)| format!("{name:>18}")).concat());
    let mut last = String::new();
    for commit in log.lines() {
        let hash = commit.split(' ').next().unwrap_or_default();
        let page = |page: &&str| git(&["show", &format!("{hash}:{page}")]);
        let text: String = pages.iter().filter_map(page).collect();
        let cell = |(_, forms): (&str, [(&str, usize); 2])| match value(&text, forms) {
            Some(value) => format!("{value:>18.1}"),
            None => format!("{:>18}", "–"),
        };
        let row = COLUMNS.map(cell).concat();
        if row != last && row.contains(|it: char| it.is_ascii_digit()) {
            println!("{commit}{row}");
            last = row;
        }
    }
    Ok(())
}

/// The number of the first form that the text has; bytes in KiB.
fn value(text: &str, forms: [(&str, usize); 2]) -> Option<f64> {
    let found = forms.iter().find_map(|&(begin, place)| {
        let line = text.lines().find_map(|line| line.strip_prefix(begin))?;
        // In a table the cell behind, and not the budget beside it.
        let line = if begin.starts_with('|') { line.split('|').nth(1)? } else { line };
        let words = line.split(|it: char| !(it.is_ascii_digit() || it == '.'));
        words.filter_map(|word| word.parse().ok()).nth(place)
    })?;
    Some(if found > 1000.0 { found / 1024.0 } else { found })
}

fn git(arguments: &[&str]) -> Option<String> {
    answer(Command::new("git").args(arguments).current_dir(root()))
}
