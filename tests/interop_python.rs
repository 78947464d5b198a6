//! Programs of others against ours: `cantools` reads our DBC files, `mcap-ros2-support` our records, and
//! the drivers `damiao-motor` and `python-cybergear` drive our simulated motors.
//!
//! They run in a virtual environment below the target directory, made once with the exact versions
//! of `tests/python/requirements.txt`. Where there is no Python or no network, the tests say that
//! they are skipped; with `CI=true` they fail.

use crate::common::scratch;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use crate::common::scratch::Scratch;
use serde_json::Value;

mod dbc;
#[cfg(unix)]
mod drivers;
mod others;
mod record;
mod referee;
mod vision;

/// The interpreter of the virtual environment; `None` if it cannot be set up.
pub(crate) fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match PYTHON.get_or_init(environment) {
        Ok(python) => Some(python),
        Err(why) if env::var("CI").is_ok_and(|value| value == "true") => panic!("{why}"),
        Err(why) => {
            println!("SKIPPED: {why}");
            None
        }
    }
}

fn environment() -> Result<PathBuf, String> {
    let requirements = script("requirements.txt");
    let wanted = fs::read_to_string(&requirements).unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("python");
    let interpreter = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
    let python = folder.join(interpreter);
    // Written last: an environment without it, or with another one, is set up anew.
    let stamp = folder.join("requirements.txt");
    if fs::read_to_string(&stamp).is_ok_and(|there| there == wanted) {
        return Ok(python);
    }
    // Made elsewhere and moved here when it is whole: another run may be at the same.
    let made = Scratch::new("python");
    let base = if cfg!(windows) { "python" } else { "python3" };
    run(Command::new(base).args(["-m", "venv"]).arg(&*made))
        .map_err(|why| format!("{why} (cargo xtask setup installs what is missing)"))?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let exact = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r"];
    run(Command::new(made.join(interpreter)).args(install).args(exact).arg(&requirements))?;
    fs::write(made.join("requirements.txt"), &wanted).unwrap();
    let is_there = || fs::read_to_string(&stamp).is_ok_and(|there| there == wanted);
    if !is_there() {
        let _ = fs::remove_dir_all(&folder);
        // Fails if the other run was first: then its environment is there.
        let moved = fs::rename(&*made, &folder);
        assert!(moved.is_ok() || is_there(), "{}: {moved:?}", folder.display());
    }
    Ok(python)
}

fn run(command: &mut Command) -> Result<Output, String> {
    let name = format!("{command:?}");
    let output = command.output().map_err(|error| format!("{name}: {error}"))?;
    if output.status.success() {
        return Ok(output);
    }
    let error = String::from_utf8_lossy(&output.stderr);
    let last = error.trim().lines().last().or(Some("no reason given"));
    Err(format!("{name}: {}", last.unwrap_or_default()))
}

/// A file of tests/python.
pub(crate) fn script(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "python", name].iter().collect()
}

/// Bytes that Python wrote in hex.
fn bytes_of(hex: &Value) -> Vec<u8> {
    let hex = hex.as_str().unwrap();
    let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
    (0..hex.len()).step_by(2).map(byte).collect()
}

/// Runs a script of tests/python to its end; what it printed.
fn must_succeed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    String::from_utf8(output.stdout).unwrap()
}
