//! What must hold before a commit, in two sizes: for each day, and `--all`, as a CI machine runs it. All
//! steps run, also after one failed.

use std::env;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, Command};
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use crate::cargo::{cargo, chip, free, host, root, run as run_command};
use crate::firmware::{self, DM_MC02, ON_DM_MC02, TEAM, build_all, build_with, flash_nothing};
use crate::setup::{TARGET, browser, chip_toolchain, component, mdbook, python};
use crate::{book, count, deny, emulate, floors, golden, size, web};

/// A robot outside the workspace, as a user has it. It shares the target directory.
const TWO_WHEELS: &str = "--manifest-path examples/two-wheels/Cargo.toml";

/// A robot on other chips: a workspace of its own with its own settings. It shares the target directory.
const OTHER_CHIPS: &str = "examples/other-chips";
/// Its chips, one a feature, and the features with which `rc10-stm32-can` is for that chip.
const ITS_CHIPS: [(&str, &str); 2] = [
    ("f407", "bxcan,embassy-stm32/stm32f407vg"),
    ("g473", "fdcan,embassy-stm32/stm32g473ve,embassy-stm32/dual-bank"),
];

/// PCs that the tools are for, beside the one that they are tested on: there they are compiled.
const OTHER_PCS: [&str; 2] = ["x86_64-pc-windows-gnu", "aarch64-apple-darwin"];

/// The libraries: ready to be published.
const PUBLISHED: [&str; 12] = [
    "rc10-time",
    "rc10-can",
    "rc10-app",
    "rc10-message",
    "rc10-motor",
    "rc10-module",
    "rc10-link",
    "rc10-tasks",
    "rc10-sim",
    "rc10-conformance",
    "rc10-bsp",
    "rc10-stm32-can",
];

/// All of `rc10-bsp`'s, and a chip.
const CHIP_FEATURES: &str = "stm32h723,usb,defmt,freeze-watchdog,embassy-stm32/stm32h723zg";

/// Why a step cannot be done here: the error of one that did not fail.
#[derive(Debug)]
struct Skipped(String);

impl fmt::Display for Skipped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Skipped {}

/// What a step needs, or that it is skipped: `lacks` says what there is not.
fn needed<T>(found: Result<T>, lacks: &str) -> Result<T> {
    found.map_err(|error| Skipped(format!("{lacks}: {error:#}")).into())
}

fn need_component(name: &str) -> Result<()> {
    let lacks = Skipped(format!("cargo {name} is not there and cannot be installed"));
    ensure!(component(name), lacks);
    Ok(())
}

struct Report {
    /// The rarer steps, too.
    is_whole: bool,
    steps: Vec<(&'static str, Result<()>, u64)>,
}

/// The outcome of a step, as it is printed.
fn shown(outcome: &Result<()>) -> String {
    match outcome {
        Ok(()) => "ok".to_owned(),
        Err(error) if error.is::<Skipped>() => format!("SKIPPED: {error}"),
        Err(error) => format!("FAILED: {error:#}"),
    }
}

impl Report {
    fn step(&mut self, name: &'static str, work: impl FnOnce() -> Result<()>) {
        println!("\n== {name}");
        let start = Instant::now();
        let outcome = work();
        println!("== {name}: {}", shown(&outcome));
        self.steps.push((name, outcome, start.elapsed().as_secs()));
    }

    /// A step of the whole check alone.
    fn rare(&mut self, name: &'static str, work: impl FnOnce() -> Result<()>) {
        if self.is_whole {
            self.step(name, work);
        }
    }

    /// Prints the table of docs/check.md. Fails if a step failed; or was skipped where the output
    /// is not looked at (`CI=true`).
    fn conclude(&self) -> Result<()> {
        println!("\n== summary");
        println!("| step | s | |\n|---|---:|---|");
        for (name, outcome, seconds) in &self.steps {
            println!("| {name} | {seconds} | {} |", shown(outcome));
        }
        let all: u64 = self.steps.iter().map(|(.., seconds)| seconds).sum();
        println!("| together | {all} | {:.1} min |", all as f64 / 60.0);
        let automatic = env::var("CI").is_ok_and(|value| value == "true");
        let is_bad = |outcome: &Result<()>| {
            outcome.as_ref().is_err_and(|error| automatic || !error.is::<Skipped>())
        };
        let bad = self.steps.iter().filter(|(_, outcome, _)| is_bad(outcome));
        let bad: Vec<_> = bad.map(|(name, ..)| *name).collect();
        ensure!(bad.is_empty(), "not all right: {}", bad.join(", "));
        Ok(())
    }
}

/// Scenarios on the emulated chip that the daily check runs: boot, budgets, and every way to crash.
const DAILY: [&str; 3] =
    ["boots_and_keeps_its_period", "within_their_budgets", "makes_every_bus_safe"];

/// Fails if a step failed, or was skipped on a CI machine.
pub fn run(is_whole: bool) -> Result<()> {
    let mut report = Report { is_whole, steps: Vec::new() };
    // The compiler for the steps on the chip, or why it is missing.
    let mut rustc: Result<Option<PathBuf>, String> = Err("not set up".to_owned());
    report.step("setup", || {
        rustc = chip_toolchain().map_err(|error| format!("{error:#}"));
        let lacks = |why| Skipped(format!("no chip build here: {why}")).into();
        rustc.as_ref().map(drop).map_err(lacks)
    });
    let rustc = || rustc.as_ref().map(Option::as_deref).map_err(|why| Skipped(why.clone()));
    report.step("python", || needed(python(), "no tests against Python here"));
    report.rare("browser", || needed(browser(), "the page is not tested"));
    report.rare("deny", deny::run);
    report.step("format", || {
        need_component("fmt")?;
        cargo("fmt --all --check")?;
        cargo(&format!("fmt {TWO_WHEELS} --check"))?;
        cargo(&format!("fmt --manifest-path {OTHER_CHIPS}/Cargo.toml --check"))?;
        run_command(&mut chip("fmt --all --check", None))
    });
    report.step("lint", || {
        need_component("clippy")?;
        cargo("clippy --workspace --exclude viewers --exclude ros2 --all-targets -- -D warnings")?;
        // Alone, without its feature `embassy`, as other firmware uses it.
        cargo("clippy --package rc10-motor -- -D warnings")?;
        if !is_whole {
            return Ok(());
        }
        // With Foxglove's SDK, which a plain build does not have.
        cargo("clippy --package viewers --all-targets -- -D warnings")?;
        // With zenoh, the same.
        cargo("clippy --package ros2 --all-targets -- -D warnings")?;
        cargo(&format!("clippy {TWO_WHEELS} --all-targets -- -D warnings"))
    });
    report.rare("lint chip", || {
        // clippy is a compiler of its own and knows only its own toolchain's targets.
        let lacks = Skipped("the active toolchain's clippy has no chip target".to_owned());
        ensure!(matches!(rustc(), Ok(None)), lacks);
        need_component("clippy")?;
        let bsp = format!("--package rc10-bsp --features {CHIP_FEATURES} --target {TARGET}");
        cargo(&format!("clippy {bsp} -- -D warnings"))?;
        run_command(&mut chip("clippy --workspace --release -- -D warnings", None))?;
        // A build has one chip, so the other board comes by itself.
        let packages = ON_DM_MC02.map(|name| format!(" --package {name}")).concat();
        let packages = format!("--package rc10-board{packages}");
        let board = format!("--no-default-features --features {DM_MC02},rc10-board/black-box");
        let board = format!("clippy --release {packages} {board} -- -D warnings");
        run_command(&mut chip(&board, None))?;
        docs(&mut host(&format!("doc --no-deps {bsp}")))?;
        for (board, chip_name) in [("h723zg", "stm32h723zg"), (DM_MC02, "stm32h723vg")] {
            let features = format!("--features {board},embassy-stm32/{chip_name}");
            docs(&mut chip(
                &format!("doc --release --no-deps --package rc10-board {features}"),
                None,
            ))?;
        }
        Ok(())
    });
    report.step("floors", || floors::run(None));
    report.step("test", || cargo("test --workspace --exclude viewers --exclude ros2"));
    report.rare("golden", || {
        needed(golden::python(), "no numpy, scipy and ruckig here")?;
        golden::run(true)
    });
    report.rare("viewers", || cargo("test --package viewers -- --show-output"));
    report.rare("ros2", || cargo("test --package ros2 -- --show-output"));
    report.rare("other PCs", compiles_for_other_pcs);
    report.step("robots", robots);
    report.rare("two wheels", two_wheels);
    report.rare("new robot", || new_robot(rustc().is_ok()));
    report.rare("package", package);
    report.step("docs", || {
        docs(&mut host("doc --workspace --exclude viewers --exclude ros2 --no-deps"))
    });
    let mut program = None;
    report.step("firmware", || {
        let rustc = rustc()?;
        if !is_whole {
            program = Some(build_with(TEAM, None, rustc)?);
            return Ok(());
        }
        // Before the rest: what it leaves is the other board's.
        flash_nothing(rustc)?;
        build_with("usb", None, rustc)?;
        program = Some(build_all(rustc)?);
        Ok(())
    });
    let program = || program.as_deref().ok_or_else(|| Skipped("no firmware".to_owned()));
    report.step("size", || size::run(program()?));
    report.step("emulate", || emulate::run(program()?, if is_whole { &[] } else { &DAILY }));
    report.rare("ros2 on the chip", || {
        build_with("swerve-firmware", None, rustc()?)?;
        let mut test = host("test --package ros2 emulated -- --ignored --show-output");
        run_command(test.env("RC10_FIRMWARE", program()?))
    });
    report.rare("web", || {
        needed(browser(), "the page is not tested")?;
        web::check(rustc()?)
    });
    report.rare("other chips", || other_chips(rustc()?));
    report.rare("count", || count::run(&build_with("count", None, rustc()?)?));
    report.rare("book", || book::run(&needed(mdbook(), "no book here")?));
    report.conclude()
}

/// Makes documentation in which nothing is amiss.
fn docs(command: &mut Command) -> Result<()> {
    run_command(command.env("RUSTDOCFLAGS", "-Dwarnings"))
}

/// The shipped robots drive, and have no problems. They are as the tests have compiled them.
fn robots() -> Result<()> {
    // A newcomer's first command names no package.
    firmware::robots()?.iter().try_for_each(|firmware| {
        let robot = firmware.trim_end_matches("-firmware");
        let package = if firmware == TEAM { String::new() } else { format!("--package {robot}") };
        cargo(&format!("run {package} -- run --strict --out target/rc10-{robot}"))
    })
}

/// Makes the packages that are published, and builds each from nothing but them. Cargo takes a
/// package of an earlier check for the same one while its version stands still: what is left of
/// earlier checks is removed.
fn package() -> Result<()> {
    let target = root().join("target/publish");
    let home = env::home_dir().context("there is no home folder")?.join(".cargo");
    let home = env::var_os("CARGO_HOME").map_or(home, PathBuf::from);
    let inside = |folder: PathBuf| fs::read_dir(folder).into_iter().flatten().flatten();
    let begins = |it: &fs::DirEntry, with| it.file_name().to_string_lossy().starts_with(with);
    // A registry without a host: a folder. Of it, our packages alone.
    let folders = inside(home.join("registry/src")).filter(|it| begins(it, "-"));
    let copies = folders.flat_map(|it| inside(it.path())).filter(|it| begins(it, "rc10-"));
    for folder in copies.map(|copy| copy.path()).chain([target.clone()]) {
        if folder.exists() {
            fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
        }
    }
    let packages = PUBLISHED.map(|name| format!(" --package {name}")).concat();
    // Their dependencies are here by now: a registry out of reach fails nothing.
    let mut command = free(&format!("package --offline --allow-dirty --quiet{packages}"));
    run_command(command.arg("--target-dir").arg(target))
}

/// Builds it with its own lock file, runs its test, and itself.
fn two_wheels() -> Result<()> {
    cargo(&format!("test {TWO_WHEELS}"))?;
    let arguments = "run --strict --seconds 2 --out target/two-wheels";
    cargo(&format!("run {TWO_WHEELS} -- {arguments}"))
}

/// Builds the robot on other chips for each, with its own lock file. With the active toolchain's compiler
/// it lints it, and what `rc10-stm32-can` has for the chip: clippy knows only its own targets.
fn other_chips(rustc: Option<&Path>) -> Result<()> {
    let lints = rustc.is_none() && component("clippy");
    for (name, port) in ITS_CHIPS {
        let own = |command: &str, rest: &str| {
            let arguments =
                format!("{command} --release --no-default-features --features {name} {rest}");
            run_command(chip(&arguments, rustc).current_dir(root().join(OTHER_CHIPS)))
        };
        own("build", "")?;
        if lints {
            own("clippy", "-- -D warnings")?;
            let port = format!("--package rc10-stm32-can --features {port} --target {TARGET}");
            cargo(&format!("clippy {port} -- -D warnings"))?;
            docs(&mut host(&format!("doc --no-deps {port}")))?;
        }
    }
    Ok(())
}

/// A robot of one's own, outside this tree: from its first command to its firmware on the emulated chip.
pub fn new_robot(has_chip: bool) -> Result<()> {
    let place = env::temp_dir().join(format!("rc10-new-{}", process::id()));
    fs::create_dir_all(&place)?;
    let made = || -> Result<()> {
        let new = |arguments: &[&str]| {
            let mut new = host("run --manifest-path");
            new.arg(root().join("Cargo.toml")).args(["--", "new"]).args(arguments);
            run_command(new.current_dir(&place))
        };
        let in_folder = |name: &str, arguments: &str| {
            let (target, folder) = (root().join("target"), place.join(name));
            run_command(free(arguments).current_dir(folder).env("CARGO_TARGET_DIR", target))
        };
        new(&["demo"])?;
        add_a_motor(&place.join("demo"))?;
        let own = |arguments: &str| in_folder("demo", arguments);
        own("run -- run --strict --seconds 5")?;
        own("test")?;
        if !has_chip {
            return Ok(());
        }
        own("run -- emu --strict --seconds 2")?;
        // For the other board: made for it, with something of every kind beside its motors; and on the first one.
        new(&["night-owl", "--board", DM_MC02])?;
        become_owl(&place.join("night-owl"))?;
        in_folder("night-owl", "test")?;
        in_folder("night-owl", "run -- emu --strict --seconds 7")?;
        in_folder("night-owl", "run -- emu --strict --seconds 7 --board h723zg")?;
        is_told(&place.join("demo"), "firmware/.cargo/config.toml", "DEFMT_LOG")?;
        is_told(&place.join("demo"), ".cargo/config.toml", "-Tlink.x")?;
        add_legs(&place.join("demo"))?;
        own(&format!("run -- emu --strict --seconds 1 --board {DM_MC02}"))
    };
    let outcome = made();
    fs::remove_dir_all(&place)?;
    outcome
}

/// A line that a firmware's settings lack is named by the compiler.
fn is_told(robot: &Path, settings: &str, word: &str) -> Result<()> {
    let settings = robot.join(settings);
    let whole = fs::read_to_string(&settings)?;
    let without: Vec<_> = whole.lines().filter(|line| !line.contains(word)).collect();
    fs::write(&settings, without.join("\n"))?;
    let mut build = free("build --release");
    let output = build
        .current_dir(robot.join("firmware"))
        .env("CARGO_TARGET_DIR", root().join("target"))
        .output()?;
    fs::write(&settings, whole)?;
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(!output.status.success() && text.contains(word), "without {word}: {text}");
    println!("without {word} it does not compile, and the error names it");
    Ok(())
}

/// Makes a robot of its name `examples/owl`.
fn become_owl(robot: &Path) -> Result<()> {
    fs::remove_file(robot.join("tests/drive.rs"))?;
    for folder in ["src", "tests"] {
        for file in fs::read_dir(root().join("examples/owl").join(folder))? {
            let file = file?;
            let text = fs::read_to_string(file.path())?.replace("owl::", "night_owl::");
            fs::write(robot.join(folder).join(file.file_name()), text)?;
        }
    }
    Ok(())
}

/// Does what the page of new robots says: a motor more.
fn add_a_motor(robot: &Path) -> Result<()> {
    let page = fs::read_to_string(root().join("docs/new-robot.md"))?;
    for (file, begin, before) in [
        ("src/table.rs", "Loader: Dji = ", "    }\n}\n\n/// On blocks"),
        ("src/task.rs", "shared.command(Name::Loader", "            let feeder = "),
    ] {
        let line = page.lines().find(|line| line.trim_start().starts_with(begin));
        let line = line.with_context(|| format!("docs/new-robot.md has no line {begin}"))?;
        insert(&robot.join(file), line, before)?;
    }
    Ok(())
}

/// Adds a motor on each of the two RS-485 lines that the DM-MC02 has.
fn add_legs(robot: &Path) -> Result<()> {
    let table = robot.join("src/table.rs");
    for (part, before) in [
        ("use rc10::motor::unitree::{GoM8010, LineConfig};", "use rc10::prelude::*;"),
        ("    line rs485 at 4_000_000, replies in Micros::new(200);", "    motors {"),
        ("    line rs485_2 at 4_000_000, replies in Micros::new(200);", "    motors {"),
        ("Leg: GoM8010 = Entry::new(Line(1), LineConfig::new(0)),", "    }\n}\n\n/// On blocks"),
        ("Foot: GoM8010 = Entry::new(Line(2), LineConfig::new(0)),", "    }\n}\n\n/// On blocks"),
    ] {
        insert(&table, part, before)?;
    }
    Ok(())
}

/// Inserts a line before a text that the file has once.
fn insert(file: &Path, line: &str, before: &str) -> Result<()> {
    let text = fs::read_to_string(file)?;
    ensure!(text.matches(before).count() == 1, "{} has no {before:?}", file.display());
    fs::write(file, text.replace(before, &format!("{line}\n{before}")))
        .with_context(|| file.display().to_string())
}

/// The compiler has no complaint about the tools on other PCs.
fn compiles_for_other_pcs() -> Result<()> {
    let mut targets = String::new();
    for target in OTHER_PCS {
        match run_command(Command::new("rustup").args(["target", "add", target])) {
            Ok(()) => targets += &format!(" --target {target}"),
            Err(error) => println!("NOT COMPILED for {target}: {error:#}"),
        }
    }
    if targets.is_empty() { Ok(()) } else { cargo(&format!("check --package rc10{targets}")) }
}
