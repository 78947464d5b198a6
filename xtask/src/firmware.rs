//! Building the chip's programs.

use std::env;
use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::cargo::{chip, root, run};
use crate::setup::{TARGET, chip_toolchain};

/// Builds the firmware for release; says where its ELF file is.
pub fn build() -> Result<PathBuf> {
    build_with(chip_toolchain()?.as_deref())
}

/// Builds the programs on other people's drivers, beside the firmware.
pub fn build_interop() -> Result<()> {
    build_interop_with(chip_toolchain()?.as_deref())
}

/// Builds the program that drives what the firmware does not, beside it.
pub fn build_selftest() -> Result<()> {
    build_selftest_with(chip_toolchain()?.as_deref())
}

/// Builds a program of the workspace `firmware/`; says where its ELF file is.
pub fn build_package(package: &str) -> Result<PathBuf> {
    build_package_with(package, chip_toolchain()?.as_deref())
}

/// Builds the serial port on USB, beside it.
pub fn build_usb_with(rustc: Option<&Path>) -> Result<()> {
    // By itself: features unify over packages that are built together.
    run(&mut chip("build --release --package usb", rustc))
}

/// Builds the program that [`count`](crate::count) runs; says where its ELF file is.
pub fn build_count() -> Result<PathBuf> {
    build_count_with(chip_toolchain()?.as_deref())
}

pub fn build_with(rustc: Option<&Path>) -> Result<PathBuf> {
    run(&mut chip("build --release", rustc))?;
    Ok(elf("rc10-firmware"))
}

pub fn build_count_with(rustc: Option<&Path>) -> Result<PathBuf> {
    // By itself: features unify over packages that are built together.
    run(&mut chip("build --release --package count", rustc))?;
    Ok(elf("count"))
}

pub fn build_interop_with(rustc: Option<&Path>) -> Result<()> {
    run(&mut chip("build --release --package interop", rustc))
}

pub fn build_selftest_with(rustc: Option<&Path>) -> Result<()> {
    // By itself: features unify over packages that are built together.
    run(&mut chip("build --release --package selftest", rustc))
}

pub fn build_package_with(package: &str, rustc: Option<&Path>) -> Result<PathBuf> {
    // By itself: features unify over packages that are built together.
    run(&mut chip(&format!("build --release --package {package}"), rustc))?;
    Ok(elf(package))
}

/// The firmware of the examples.
pub const EXAMPLES: [&str; 3] = ["mixed-firmware", "omni-firmware", "starter-firmware"];

fn elf(name: &str) -> PathBuf {
    let target =
        env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    target.join(TARGET).join("release").join(name)
}
