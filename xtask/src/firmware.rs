//! Building the chip's programs.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::cargo::{chip, root, run};
use crate::setup::{TARGET, chip_toolchain};

/// The team's robot.
pub const TEAM: &str = "team-firmware";
/// The board that is not the default one, and the programs that are run on it.
pub const DM_MC02: &str = "dm-mc02";
pub const ON_DM_MC02: [&str; 4] = [TEAM, "lift-firmware", "omni-firmware", "owl-firmware"];

/// A robot of two programs.
pub const TWO_BOARDS: &str = "two-boards-firmware";

/// The firmware of every robot of the checkout: a folder in `examples` that has one.
pub fn robots() -> Result<Vec<String>> {
    let mut robots = Vec::new();
    for folder in fs::read_dir(root().join("examples")).context("no examples")? {
        let folder = folder?;
        if folder.path().join("firmware/Cargo.toml").is_file() {
            robots.push(format!("{}-firmware", folder.file_name().display()));
        }
    }
    robots.sort();
    Ok(robots)
}

/// Builds a program of the workspace `firmware/` for release, for its default board or another one; says where
/// its ELF file is.
pub fn build(package: &str, board: Option<&str>) -> Result<PathBuf> {
    build_with(package, board, chip_toolchain()?.as_deref())
}

/// The same with this compiler, if not the active toolchain's.
pub fn build_with(package: &str, board: Option<&str>, rustc: Option<&Path>) -> Result<PathBuf> {
    // By itself: features unify over packages that are built together.
    let arguments = format!("build --release --package {package}");
    let default = elf(package);
    let Some(board) = board.filter(|board| *board != "h723zg") else {
        run(&mut chip(&arguments, rustc))?;
        return Ok(default);
    };
    let features = format!("--no-default-features --features {board}");
    run(&mut chip(&format!("{arguments} {features}"), rustc))?;
    let own = elf(&format!("{package}-{board}"));
    // The next build for another board replaces its file.
    fs::copy(&default, &own).with_context(|| format!("cannot copy {}", default.display()))?;
    Ok(own)
}

/// Robots whose programs are built with a black box, too.
const WITH_BLACK_BOX: [&str; 5] =
    [TEAM, "omni-firmware", "lift-firmware", "swerve-firmware", "mixed-firmware"];

/// Builds everything that `emulate` runs; says where the team's ELF file is.
pub fn build_all(rustc: Option<&Path>) -> Result<PathBuf> {
    for package in ON_DM_MC02 {
        build_with(package, Some(DM_MC02), rustc)?;
    }
    let black_box = "rc10-board/black-box";
    let on_default = WITH_BLACK_BOX.map(|package| (package, String::new(), black_box.to_owned()));
    let board = format!("-{DM_MC02}");
    let on_other = (TEAM, board, format!("{DM_MC02},{black_box} --no-default-features"));
    for (package, board, features) in on_default.into_iter().chain([on_other]) {
        let build = format!("build --release --package {package} --features {features}");
        run(&mut chip(&build, rustc))?;
        fs::copy(elf(package), elf(&format!("{package}{board}-black-box")))
            .with_context(|| format!("cannot copy {package}"))?;
    }
    let others = ["interop", "selftest", "two-boards-uart-firmware"].map(str::to_owned);
    for package in robots()?.into_iter().chain(others) {
        build_with(&package, None, rustc)?;
    }
    build_with(TEAM, None, rustc)
}

/// Does what flashes a board, with nothing in the probe's place: the program is the one that is meant.
pub fn flash_nothing(rustc: Option<&Path>) -> Result<()> {
    let nothing = format!("run --release --config target.{TARGET}.runner=\"true\"");
    run(&mut chip(&nothing, rustc))?;
    let other = format!("--no-default-features --features {DM_MC02}");
    run(&mut chip(&format!("{nothing} {other}"), rustc))
}

fn elf(name: &str) -> PathBuf {
    let target =
        env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    target.join(TARGET).join("release").join(name)
}
