//! The tables of `docs/evidence.md`: figures by commit, lines that tests run, and mistakes that tests find.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::cargo::{answer, free, root, run as run_command};
use crate::figures;

/// Every how many mistakes one is tried.
const SAMPLE: u32 = 600;

/// Makes one of the tables, or the page with all of them.
///
/// # Errors
/// There is no such table, or a tool cannot be installed or fails.
pub fn run(what: Option<&str>) -> Result<()> {
    match what {
        None => figures::run("evidence"),
        Some("commits") => commits(),
        Some("coverage") => coverage(),
        Some("mutants") => mutants(),
        Some(other) => bail!("no `{other}`: commits, coverage or mutants"),
    }
}

/// A column: its heading, and the beginnings of lines that have it with the place of the number in them. The second
/// form is that of the pages before 28 November 2026.
const COLUMNS: [(&str, [(&str, usize); 2]); 4] = [
    ("flash KiB", [("flash  ", 0), ("| flash", 0)]),
    ("static KiB", [("RAM  ", 0), ("| static RAM", 0)]),
    ("stack KiB", [("static RAM + stack  ", 3), ("| static RAM and deepest stack", 1)]),
    ("million instr./s", [("a second  ", 0), ("| instructions of everything, a second", 1)]),
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
        let words = line.split(|it: char| !(it.is_ascii_digit() || it == '.'));
        words.filter_map(|word| word.parse().ok()).nth(place)
    })?;
    Some(if found > 1000.0 { found / 1024.0 } else { found })
}

fn git(arguments: &[&str]) -> Option<String> {
    answer(Command::new("git").args(arguments).current_dir(root()))
}

/// Prints how many lines of code the tests run, by crate.
fn coverage() -> Result<()> {
    run_command(Command::new("rustup").args(["component", "add", "llvm-tools"]))?;
    let tool = installed("cargo-llvm-cov", "0.6.21")?;
    let packages =
        ["rc10-app", "rc10-motor", "rc10-module", "rc10-conformance"].map(|it| ["-p", it]);
    let mut test = Command::new(tool);
    test.args(["llvm-cov", "--locked", "--summary-only"]).args(packages.as_flattened());
    let table = answer(test.current_dir(root())).context("cargo llvm-cov failed")?;
    let mut crates = BTreeMap::<&str, [u32; 2]>::new();
    for line in table.lines() {
        let cells: Vec<_> = line.split_whitespace().collect();
        // The name, then three of regions, three of functions, three of lines.
        let &[file, _, _, _, _, _, _, lines, missed, ..] = cells.as_slice() else { continue };
        let Some((name, _)) = file.split_once("/src/") else { continue };
        let (Ok(lines), Ok(missed)) = (lines.parse::<u32>(), missed.parse::<u32>()) else {
            continue;
        };
        let name = name.rsplit('/').next().unwrap_or(name);
        let [all, run] = crates.entry(name).or_default();
        (*all, *run) = (*all + lines, *run + lines - missed);
    }
    for (name, [all, run]) in crates {
        println!("{name:<18} {run:>6} of {all:>6} lines, {:>3} %", 100 * run / all.max(1));
    }
    Ok(())
}

/// Makes some mistakes in motors and control maths, always the same ones, and prints how many the tests find.
fn mutants() -> Result<()> {
    let tool = installed("cargo-mutants", "25.3.1")?;
    let out = root().join("target/mutants");
    fs::create_dir_all(&out)?;
    let mut test = Command::new(tool);
    test.args(["mutants", "-p", "rc10-app", "-p", "rc10-motor", "--shard", &format!("0/{SAMPLE}")]);
    test.args(["--test-package", "rc10-app,rc10-motor,rc10-conformance", "--timeout", "600"]);
    test.args(["--no-shuffle", "--baseline", "skip", "--colors", "never", "--output"]).arg(&out);
    // It fails if a mistake is not found, which is what is asked.
    let _ = test.current_dir(root()).status().context("cargo mutants cannot be started")?;
    let list = |name| fs::read_to_string(out.join(format!("mutants.out/{name}.txt")));
    let names = ["caught", "timeout", "missed", "unviable"];
    let [caught, timeout, missed, unviable] = names.map(list);
    let (missed, caught) = (missed?, caught?.lines().count() + timeout?.lines().count());
    let all = caught + missed.lines().count();
    println!(
        "{caught} of {all} mistakes found, one in {SAMPLE} of all; {} more do not compile",
        unviable?.lines().count()
    );
    missed.lines().for_each(|line| println!("not found: {line}"));
    Ok(())
}

/// The path of a tool of cargo's, in a folder of the build's.
fn installed(name: &str, version: &str) -> Result<std::path::PathBuf> {
    let folder = root().join("target/tools");
    let mut install = free(&format!("install --quiet --locked --debug {name} --version {version}"));
    run_command(install.arg("--root").arg(&folder).env("CARGO_PROFILE_DEV_DEBUG", "0"))?;
    Ok(folder.join("bin").join(name))
}
