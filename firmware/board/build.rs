//! Puts the memory map where the linker finds it, for every program that has this crate; and says what that
//! program's workspace lacks, because a program without it links, and does nothing or says nothing.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    // Of the checkout that this crate is in, wherever the robot is.
    let memory = "../../memory.x";
    println!("cargo::rerun-if-changed={memory}");
    println!("cargo::rerun-if-env-changed=DEFMT_LOG");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let map = fs::read_to_string(memory).expect("memory.x is at the top of the checkout");
    // defmt's part of the linker script: every program with this crate has its log.
    fs::write(out.join("memory.x"), map + "\nINCLUDE defmt.x\n").expect("OUT_DIR can be written");
    println!("cargo::rustc-link-search={}", out.display());

    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    match (has("H723ZG"), has("DM_MC02")) {
        (true, false) | (false, true) => {}
        (true, true) => {
            println!("cargo::error=rc10-board is for one board: h723zg or dm-mc02, not both");
        }
        (false, false) => println!(
            "cargo::error=which board is this for? rc10-board wants the feature h723zg or dm-mc02, and embassy-stm32 that of \
             its chip: stm32h723zg or stm32h723vg"
        ),
    }

    let is_chip = env::var("TARGET").is_ok_and(|target| target == "thumbv7em-none-eabihf");
    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    for (holds, missing) in [
        (is_chip, "it is compiled for a PC: [build] target = \"thumbv7em-none-eabihf\""),
        (
            flags.contains("-Tlink.x"),
            "the linker is not told how the chip's memory is used: [target.thumbv7em-none-eabihf] \
             rustflags = [\"-C\", \"link-arg=-Tlink.x\", \"-C\", \"link-arg=--nmagic\"]",
        ),
        (
            flags.matches("-Tlink.x").count() < 2,
            "-Tlink.x is told twice: by this folder's .cargo/config.toml, and by that of a folder above; move the \
             robot elsewhere. One is enough",
        ),
        (
            env::var_os("DEFMT_LOG").is_some(),
            "the log would be empty but for errors: [env] DEFMT_LOG = \"info\"",
        ),
    ] {
        if !holds {
            println!(
                "cargo::error={missing}, in .cargo/config.toml of the robot or of its firmware"
            );
        }
    }
}
