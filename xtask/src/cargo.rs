//! Running other programs.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, iter};

use anyhow::{Context, Result, ensure};

/// The folder of the root workspace.
pub fn root() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().unwrap_or(xtask).to_path_buf()
}

/// A cargo command in the root workspace. A lock file that is stale is an error.
pub fn host(arguments: &str) -> Command {
    let (command, rest) = arguments.split_once(' ').unwrap_or((arguments, ""));
    match command {
        "fmt" => free(arguments),
        _ => free(&format!("{command} --locked {rest}")),
    }
}

/// The same where there need be no lock file.
pub fn free(arguments: &str) -> Command {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(arguments.split_whitespace()).current_dir(root());
    cargo
}

/// A cargo command in the firmware workspace. `rustc` is the compiler to use if it is not the
/// active toolchain's.
pub fn chip(arguments: &str, rustc: Option<&Path>) -> Command {
    let mut cargo = host(arguments);
    cargo.current_dir(root().join("firmware"));
    if let Some(rustc) = rustc {
        cargo.env("RUSTC", rustc);
    }
    cargo
}

/// Prints a command, runs it, and wants it to succeed.
pub fn run(command: &mut Command) -> Result<()> {
    let line = shown(command);
    println!("$ {line}");
    let status = command.status().with_context(|| format!("cannot start: {line}"))?;
    ensure!(status.success(), "failed ({status}): {line}");
    Ok(())
}

/// Runs a cargo command in the root workspace.
pub fn cargo(arguments: &str) -> Result<()> {
    run(&mut host(arguments))
}

/// The output of a command, without its last line break; `None` if it cannot be started or fails.
pub fn answer(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.trim_end().to_owned())
}

/// The paths of what is in a folder.
pub fn paths(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    entries.map(|entry| Ok(entry?.path())).collect()
}

fn shown(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or_default();
    let words = iter::once(program).chain(command.get_args()).map(OsStr::to_string_lossy);
    words.collect::<Vec<_>>().join(" ")
}
