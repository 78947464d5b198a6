//! The page of figures that change with the compiler.

use std::fs;

use anyhow::{Context, Result};

use crate::cargo::{answer, free, root};

/// The beginning of a block with a command and what it prints.
const BLOCK: &str = "```console\n$ cargo ";

/// Runs the commands of `docs/figures.md` again, and writes what they print.
///
/// # Errors
/// If one of them fails, or the page is not as expected.
pub fn run() -> Result<()> {
    let page = root().join("docs/figures.md");
    let text = fs::read_to_string(&page)?;
    let mut parts = text.split(BLOCK);
    let mut written = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (command, old) = part.split_once('\n').context("a block without a command")?;
        let (_, rest) = old.split_once("```").context("a block without an end")?;
        println!("$ cargo {command}");
        let output = answer(&mut free(command));
        let output = output.with_context(|| format!("failed: cargo {command}"))?;
        let figures = output.lines().filter(|line| is_figure(line));
        let figures: String = figures.map(|line| format!("{}\n", line.trim_end())).collect();
        written += &[BLOCK, command, "\n", &figures, "```", rest].concat();
    }
    fs::write(page, written).context("docs/figures.md")
}

/// Not a line of cargo's or of the test harness.
fn is_figure(line: &str) -> bool {
    let others = ["setup: ", "$ ", "running ", "test ", "successes:", "----", "    "];
    !line.is_empty() && !others.iter().any(|begin| line.starts_with(begin))
}
