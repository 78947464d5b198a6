//! The project's chores. `cargo xtask` lists them.
#![forbid(unsafe_code)]

mod cargo;
mod check;
mod count;
mod emulate;
mod firmware;
mod fuzz;
mod scaffold;
mod setup;
mod size;

use std::process::ExitCode;

use anyhow::Result;

const USAGE: &str = "\
cargo xtask setup   make this machine able to build for the chip, and to test against Python
cargo xtask check   everything that must hold before a commit
cargo xtask firmware [PACKAGE]   build the firmware, say where it is; an example's, such as mixed-firmware
cargo xtask emulate   the firmware on an emulated chip: every scenario, against its budgets
cargo xtask phases  the least and the most of what faults cost, over fifty phases
cargo xtask size    flash and RAM of the firmware, against their budgets
cargo xtask count   instructions of the control loop and of every codec, against their budgets
cargo xtask scaffold   lines that the examples cost beside table, kinematics and tasks
cargo xtask new-robot   rc10 new outside the tree: compiled, driven, tested, on the emulated chip
cargo xtask fuzz [seconds] [target ..]   throws bytes at every decoder, 60 s each; needs nightly";

fn main() -> ExitCode {
    let task: fn() -> Result<()> = match std::env::args().nth(1).as_deref() {
        Some("setup") => || {
            setup::probe();
            setup::chip_toolchain().and_then(|_| setup::python())
        },
        Some("check") => check::run,
        Some("firmware") => || {
            let elf = match std::env::args().nth(2).as_deref() {
                None => firmware::build()?,
                Some(package) => firmware::build_package(package)?,
            };
            println!("{}", elf.display());
            Ok(())
        },
        Some("scaffold") => scaffold::run,
        Some("new-robot") => || check::new_robot(setup::chip_toolchain().is_ok()),
        Some("emulate") => || {
            let firmware = firmware::build()?;
            firmware::build_interop()?;
            firmware::build_selftest()?;
            for package in firmware::EXAMPLES {
                firmware::build_package(package)?;
            }
            emulate::run(&firmware, None)
        },
        Some("phases") => || emulate::run(&firmware::build()?, Some("phases::")),
        Some("size") => || size::run(&firmware::build()?),
        Some("count") => || count::run(&firmware::build_count()?),
        Some("fuzz") => || fuzz::run(std::env::args().skip(2)),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match task() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}
