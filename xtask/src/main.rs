//! The project's chores. `cargo xtask` lists them.
#![forbid(unsafe_code)]

mod book;
mod cargo;
mod check;
mod count;
mod deny;
mod emulate;
mod evidence;
mod figures;
mod firmware;
mod first;
mod floors;
mod fuzz;
mod golden;
mod setup;
mod size;
mod web;

use std::process::ExitCode;

use anyhow::Result;

const USAGE: &str = "\
cargo xtask setup   make this machine able to build for the chip, and to test against Python
cargo xtask check   what must hold before each commit; with --all, all that a CI machine runs
cargo xtask firmware [PACKAGE [BOARD]]   build the firmware, say where it is; an example's, such as mixed-firmware;
                    for another board: dm-mc02
cargo xtask emulate [NAME ..]   the firmware on an emulated chip: every scenario, against its budgets; or those
                    of the team's robot with such names
cargo xtask board-test   leads through the first tests of a board, with its probe, and keeps a file to send back
cargo xtask phases  the least and the most of what faults cost, over fifty phases
cargo xtask size    flash and RAM of the firmware, against their budgets
cargo xtask count   instructions of the control loop and of every codec, against their budgets
cargo xtask figures docs/figures.md and its Chinese twin anew, by the commands that stand there
cargo xtask evidence [commits]   docs/evidence.md and its twin anew, or its table alone
cargo xtask book    the docs as one site in target/book, in English and Chinese; its links and its search
cargo xtask floors [FOLDER]   which file imports which, as floors: of the tools, or of another crate's src
cargo xtask web     target/web: the page with its robots in the browser, as static files
cargo xtask first   CPU seconds of the first compile, that of cargo run
cargo xtask deny    licences and sources of all packages, and that no lock file is stale
cargo xtask golden [check]   makes the golden files of rc10-app anew, with numpy, scipy and ruckig; or compares them
cargo xtask new-robot   rc10 new outside the tree: compiled, driven, tested, on the emulated chip
cargo xtask fuzz [seconds] [target ..]   throws bytes at every decoder, 60 s each; needs nightly";

fn main() -> ExitCode {
    let task: fn() -> Result<()> = match std::env::args().nth(1).as_deref() {
        Some("setup") => || {
            setup::probe();
            // A board or a browser is not required.
            setup::browser().unwrap_or_else(|error| println!("setup: {error:#}"));
            setup::chip_toolchain().and_then(|_| setup::python())
        },
        Some("check") => || check::run(std::env::args().any(|it| it == "--all")),
        Some("firmware") => || {
            let (package, board) = (std::env::args().nth(2), std::env::args().nth(3));
            let package = package.as_deref().unwrap_or(firmware::TEAM);
            let elf = firmware::build(package, board.as_deref())?;
            println!("{}", elf.display());
            Ok(())
        },
        Some("first") => first::run,
        Some("web") => || web::run(setup::chip_toolchain()?.as_deref()).map(drop),
        Some("floors") => || floors::run(std::env::args().nth(2).as_deref()),
        Some("new-robot") => || check::new_robot(setup::chip_toolchain().is_ok()),
        Some("emulate") => || {
            let names: Vec<_> = std::env::args().skip(2).collect();
            let names: Vec<_> = names.iter().map(String::as_str).collect();
            let program = match names[..] {
                [] => firmware::build_all(setup::chip_toolchain()?.as_deref())?,
                _ => firmware::build(firmware::TEAM, None)?,
            };
            emulate::run(&program, &names)
        },
        Some("board-test") => || {
            let args = std::env::args().skip(2);
            cargo::run(cargo::host("run --quiet --bin rc10 -- board-test").args(args))
        },
        Some("phases") => || emulate::run(&firmware::build(firmware::TEAM, None)?, &["phases::"]),
        Some("figures") => || figures::run("figures"),
        Some("evidence") => || evidence::run(std::env::args().nth(2).as_deref()),
        Some("book") => || book::run(&setup::mdbook()?),
        Some("size") => || size::run(&firmware::build(firmware::TEAM, None)?),
        Some("count") => || count::run(&firmware::build("count", None)?),
        Some("deny") => deny::run,
        Some("golden") => || golden::run(std::env::args().nth(2).as_deref() == Some("check")),
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
