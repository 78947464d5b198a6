//! Pages with figures that commands make.

use std::fs;

use anyhow::{Context, Result};

use crate::cargo::{answer, free, root};

/// The beginning of a block with a command and what it prints.
const BLOCK: &str = "```console\n$ cargo ";

/// Runs the commands of a page in `docs/` again, and writes what they print, also into its twin.
/// Fails if one of them fails, or the page is not as expected.
pub fn run(name: &str) -> Result<()> {
    let page = root().join(format!("docs/{name}.md"));
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
    let twin = root().join(format!("docs/{name}.zh-CN.md"));
    fs::write(&twin, with_blocks(&fs::read_to_string(&twin)?, &written)).context("the twin")?;
    fs::write(page, written).with_context(|| format!("docs/{name}.md"))
}

/// A page with the blocks of another one.
fn with_blocks(prose: &str, blocks: &str) -> String {
    let prose = prose.split("```").step_by(2);
    let blocks = blocks.split("```").skip(1).step_by(2).map(|block| format!("```{block}```"));
    prose.zip(blocks.chain([String::new()])).map(|(it, block)| it.to_owned() + &block).collect()
}

/// Not a line of cargo's or of the test harness.
fn is_figure(line: &str) -> bool {
    let others = ["setup: ", "$ ", "running ", "test ", "successes:", "----", "    "];
    !line.is_empty() && !others.iter().any(|begin| line.starts_with(begin))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Chinese pages have the same commands and figures, in the same order.
    #[test]
    fn both_languages_have_the_same_figures() {
        let read = |page: &str| fs::read_to_string(root().join(page)).unwrap();
        let blocks = |page| {
            let text = read(page);
            text.split("```").skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>()
        };
        for (page, twin, least) in [
            ("docs/figures.md", "docs/figures.zh-CN.md", 5),
            ("docs/evidence.md", "docs/evidence.zh-CN.md", 1),
        ] {
            let (english, chinese) = (blocks(page), blocks(twin));
            assert!(english.len() >= least, "{english:?}");
            assert_eq!(english, chinese);
        }

        // The check's table: the steps by their names, and their seconds.
        let rows = |page| {
            let text = read(page);
            let cells = text.lines().filter(|line| line.starts_with('|'));
            let cells = cells.flat_map(|row| row.split(|it: char| !it.is_ascii_alphanumeric()));
            let numbers = cells.filter(|it| it.starts_with(|it: char| it.is_ascii_digit()));
            numbers.map(str::to_owned).collect::<Vec<_>>()
        };
        let english = rows("docs/check.md");
        assert!(english.len() >= 40, "{english:?}");
        assert_eq!(english, rows("docs/check.zh-CN.md"));
    }

    #[test]
    fn the_twin_keeps_its_words() {
        let page = |words: &str, flash| format!("# {words}\n\n```\n$ a\n{flash}\n```\n\n{words}\n");
        assert_eq!(with_blocks(&page("数据", 1), &page("Figures", 2)), page("数据", 2));
    }
}
