//! Fuzzing: bytes thrown at every decoder, by libFuzzer, which sees what code they reach.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::cargo::{answer, cargo, paths, root, run as run_command};

/// Seconds for each target, unless told.
const SECONDS: &str = "60";
/// No frame sequence needs more bytes to show something.
const LONGEST: u32 = 512;

/// Fuzzes all targets, or those named. What it finds worth keeping is added to fuzz/corpus; what
/// breaks a rule is left in fuzz/artifacts. Fails if a rule is broken, there is no such target, or
/// the tools cannot be installed.
pub fn run(arguments: impl Iterator<Item = String>) -> Result<()> {
    let mut arguments = arguments.peekable();
    let seconds = arguments.next_if(|text| text.parse::<u32>().is_ok());
    let seconds = seconds.as_deref().unwrap_or(SECONDS);
    let all = targets()?;
    let named: Vec<String> = arguments.collect();
    for name in &named {
        ensure!(all.contains(name), "no target {name}: there are {}", all.join(", "));
    }
    install()?;
    for target in if named.is_empty() { &all } else { &named } {
        let options = format!("-max_total_time={seconds} -max_len={LONGEST} -print_final_stats=0");
        // The proxy of rustup, which understands +nightly; the toolchain's own cargo does not.
        let mut nightly = Command::new("cargo");
        nightly.current_dir(root().join("fuzz")).env_remove("RUSTUP_TOOLCHAIN");
        nightly.args(["+nightly", "fuzz", "run", target, "--"]).args(options.split_whitespace());
        run_command(&mut nightly)?;
    }
    Ok(())
}

/// The names of all targets.
fn targets() -> Result<Vec<String>> {
    let files = paths(&root().join("fuzz/fuzz_targets"))?;
    let names = files.iter().filter_map(|path| path.file_stem());
    let mut names: Vec<_> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    Ok(names)
}

/// A nightly compiler and cargo-fuzz, if they are not there.
fn install() -> Result<()> {
    let there = |tool: &mut Command| answer(tool.arg("--version")).is_some();
    if !there(Command::new("cargo").env_remove("RUSTUP_TOOLCHAIN").arg("+nightly")) {
        let install = ["toolchain", "install", "nightly", "--profile", "minimal"];
        run_command(Command::new("rustup").args(install))?;
    }
    if !there(Command::new("cargo").arg("fuzz")) {
        cargo("install cargo-fuzz")?;
    }
    Ok(())
}
