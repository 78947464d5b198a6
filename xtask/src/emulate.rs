//! The firmware on an emulated chip: the scenarios of `tests/firmware.rs`, and the page and the
//! shells of `tests/live_page.rs`, `tests/live_reach.rs` and `tests/tune.rs` before it.

use std::path::Path;

use anyhow::Result;

use crate::cargo::{host, run as run_command};

/// Runs the scenarios on the program that have one of these in their names, or every one. Fails if
/// one of them fails.
pub fn run(program: &Path, names: &[&str]) -> Result<()> {
    let run = |test: &str, which: &str, names: &[&str]| {
        let test = format!("test --package rc10-tool --test {test} -- --{which} --show-output");
        run_command(host(&test).args(names).env("RC10_FIRMWARE", program))
    };
    run("firmware", "include-ignored", names)?;
    if names.is_empty() {
        run("all", "ignored", &["live_page::", "live_reach::", "tune::"])
    } else {
        Ok(())
    }
}
