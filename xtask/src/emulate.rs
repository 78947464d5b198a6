//! The firmware on an emulated chip: the scenarios of `tests/firmware.rs`, and the page of `tests/live_page.rs`
//! before it.

use std::path::Path;

use anyhow::Result;

use crate::cargo::{host, run as run_command};

/// Runs every scenario on the program, or those of a module.
///
/// # Errors
/// If one of them fails.
pub fn run(program: &Path, module: Option<&str>) -> Result<()> {
    let run = |test: &str, module: Option<&str>| {
        let test = format!("test --package rc10 --test {test} -- --include-ignored --show-output");
        run_command(host(&test).args(module).env("RC10_FIRMWARE", program))
    };
    run("firmware", module)?;
    if module.is_none() { run("all", Some("live_page::")) } else { Ok(()) }
}
