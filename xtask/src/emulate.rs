//! The firmware on an emulated chip: the scenarios of `tests/firmware.rs`, and the page and the
//! shells of `tests/live_page.rs` and `tests/live_reach.rs` before it.

use std::ffi::OsStr;
use std::path::Path;

use anyhow::Result;

use crate::cargo::{host, run as run_command};

/// Runs the scenarios on the program that have one of these in their names, or every one.
///
/// # Errors
/// If one of them fails.
pub fn run(program: &Path, names: &[impl AsRef<OsStr>]) -> Result<()> {
    let command = |test: &str, which: &str| {
        let test = format!("test --package rc10-tool --test {test} -- --{which} --show-output");
        let mut command = host(&test);
        command.env("RC10_FIRMWARE", program);
        command
    };
    run_command(command("firmware", "include-ignored").args(names))?;
    if names.is_empty() {
        run_command(command("all", "ignored").args(["live_page::", "live_reach::"]))
    } else {
        Ok(())
    }
}
