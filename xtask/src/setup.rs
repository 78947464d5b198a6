//! Making a machine able to build for the chip.
//!
//! A `targets` line in rust-toolchain.toml is not enough: with `RUSTUP_AUTO_INSTALL=0` it installs
//! nothing. So the target is asked for explicitly.
//!
//! The tests against programs of others need a Python that can make virtual environments.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::cargo::{answer, paths, run};

/// The chip's target.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Makes sure that the active toolchain builds for the chip.
pub fn chip_toolchain() -> Result<()> {
    if !has_target() {
        println!("setup: the active toolchain has no {TARGET}; asking rustup for it");
        run(Command::new("rustup").args(["target", "add", TARGET]))?;
        ensure!(has_target(), "rustup added {TARGET} to another toolchain than the active one");
    }
    println!("setup: the active toolchain builds for {TARGET}");
    Ok(())
}

/// Makes sure that `cargo fmt` or `cargo clippy` is there.
pub fn component(name: &str) -> bool {
    let there = || answer(Command::new("cargo").args([name, "--version"])).is_some();
    // The component of `cargo fmt` is called rustfmt.
    let component = if name == "fmt" { "rustfmt" } else { name };
    there() || run(Command::new("rustup").args(["component", "add", component])).is_ok() && there()
}

/// Makes sure that `python3` can make a virtual environment; Debian packs that apart.
pub fn python() -> Result<()> {
    let can_make_environments =
        || answer(Command::new("python3").args(["-c", "import venv, ensurepip"])).is_some();
    if !can_make_environments() {
        println!("setup: no python3 that can make virtual environments; asking Debian for one");
        let mut install = Command::new("apt-get");
        install.args(["install", "--quiet", "--yes", "--no-install-recommends"]);
        install.args(["python3", "python3-venv"]).env("DEBIAN_FRONTEND", "noninteractive");
        run(Command::new("apt-get").args(["update", "--quiet"]))
            .and_then(|()| run(&mut install))
            .context("install Python 3.10 or newer, with venv and ensurepip")?;
    }
    ensure!(can_make_environments(), "python3 cannot make virtual environments");
    println!("setup: python3 makes virtual environments");
    Ok(())
}

/// The first probe-rs whose `run` knows the flags that `.cargo/config.toml` gives it (its change log,
/// 0.28.0): major and minor version.
const PROBE_RS: [u32; 2] = [0, 28];

/// Says whether a board can be flashed from here. Never fails: a board is not required.
pub fn probe() {
    let version = answer(Command::new("probe-rs").arg("--version"));
    println!("setup: {}", judge_probe_rs(version.as_deref()));
}

/// The message for an answer to `probe-rs --version`.
fn judge_probe_rs(version: Option<&str>) -> String {
    let [major, minor] = PROBE_RS;
    let wanted = format!("to flash a board, install probe-rs {major}.{minor} or newer");
    let Some(version) = version else { return format!("no probe-rs here; {wanted}") };
    // `probe-rs 0.29.1 (git commit: ..)`
    let number = version.split_whitespace().nth(1).unwrap_or_default();
    let mut parts = number.split('.').map_while(|part| part.parse::<u32>().ok());
    match (parts.next(), parts.next()) {
        (Some(major), Some(minor)) if [major, minor] >= PROBE_RS => {
            format!("probe-rs {number} flashes a board")
        }
        (Some(_), Some(_)) => format!("probe-rs {number} is too old; {wanted}"),
        _ => format!("probe-rs says {version:?}, which is no version; {wanted}"),
    }
}

fn has_target() -> bool {
    let question = ["--print", "target-libdir", "--target", TARGET];
    let Some(folder) = answer(Command::new("rustc").args(question)) else {
        return false;
    };
    // The folder's name is answered whether it exists or not.
    let is_core = |path: &Path| {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        file.starts_with("libcore-") && file.ends_with(".rlib")
    };
    paths(Path::new(&folder)).is_ok_and(|found| found.iter().any(|path| is_core(path)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probe_rs_that_refuses_the_flags_is_called_too_old() {
        for (version, said) in [
            (None, "no probe-rs here; to flash a board, install probe-rs 0.28 or newer"),
            (Some("probe-rs 0.28.0 (git commit: 0123abc)"), "probe-rs 0.28.0 flashes a board"),
            (Some("probe-rs 1.0.0"), "probe-rs 1.0.0 flashes a board"),
            (Some("probe-rs 0.27.0 (git commit: 0123abc)"), "probe-rs 0.27.0 is too old"),
            (Some("probe-rs"), "probe-rs says \"probe-rs\", which is no version"),
        ] {
            let judged = judge_probe_rs(version);
            assert!(judged.starts_with(said), "{version:?}: {judged}");
        }
    }
}
