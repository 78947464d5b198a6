//! Lines that a robot costs beside its table, its kinematics and its tasks.

use std::fs;

use anyhow::{Context, Result, ensure};

use crate::cargo::root;

/// Files that are not the robot's own matter, and what they hold.
const FILES: [(&str, &str); 4] = [
    ("src/lib.rs", "modules, types"),
    ("src/main.rs", "command line"),
    ("src/simulation.rs", "description, tasks in simulation"),
    ("firmware/src/main.rs", "firmware"),
];

/// The most of them.
const MOST: usize = 150;

/// Counts the lines of each example that are neither empty nor comments; too many are an error, and so
/// are others than the docs say.
pub fn run() -> Result<()> {
    let page = fs::read_to_string(root().join("docs/declaration.md"))?;
    for example in ["lift", "mixed", "omni", "starter", "swerve"] {
        let (mut sum, mut parts) = (0, [0; 2]);
        for (file, what) in FILES {
            let path = root().join("examples").join(example).join(file);
            let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            let lines = text.lines().map(str::trim);
            let count = lines.filter(|line| !line.is_empty() && !line.starts_with("//")).count();
            println!("{example:5}  {count:4}  {file} ({what})");
            sum += count;
            parts[usize::from(file.starts_with("firmware/"))] += count;
        }
        println!("{example:5}  {sum:4}  in all, at most {MOST}");
        let [robot, firmware] = parts;
        let row = format!("| {robot} | {firmware} | {sum} |");
        ensure!(
            page.contains(&row),
            "docs/declaration.md does not say of examples/{example}: {row}"
        );
        ensure!(sum <= MOST, "examples/{example} has more than {MOST} lines beside its own matter");
    }
    Ok(())
}
