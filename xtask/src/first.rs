//! The compile time of a newcomer's first command.

use std::fs;

use anyhow::{Context, Result};

use crate::cargo::{host, root, run as run_command};

/// A clock tick of `/proc`, in seconds: 100 a second on every Linux of today.
const TICK: f64 = 0.01;

/// Compiles what `cargo run` compiles, from nothing, and prints the CPU seconds of it. Those hardly depend on
/// what else the machine does. Fails if it does not compile, or this is no Linux.
pub fn run() -> Result<()> {
    let target = root().join("target/first");
    let empty = || if target.exists() { fs::remove_dir_all(&target) } else { Ok(()) };
    empty()?;
    let before = of_children()?;
    let built = run_command(host("build --bin rc10").env("CARGO_TARGET_DIR", &target));
    let after = of_children()?;
    empty()?;
    built?;
    println!("first compile: {:.1} CPU s", after - before);
    Ok(())
}

/// CPU seconds of all processes that this one has waited for, and theirs.
fn of_children() -> Result<f64> {
    let stat = fs::read_to_string("/proc/self/stat").context("this needs Linux's /proc")?;
    // The second field is the name in brackets; `cutime` and `cstime` are the 16th and the 17th (proc(5)).
    let (_, fields) = stat.rsplit_once(") ").context("/proc/self/stat has no name")?;
    let mut ticks = 0.0;
    for field in fields.split(' ').skip(13).take(2) {
        ticks += field.parse::<f64>().with_context(|| format!("/proc/self/stat: {field}"))?;
    }
    Ok(ticks * TICK)
}
