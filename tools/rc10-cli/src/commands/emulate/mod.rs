//! `rc10 emu`: runs the firmware itself, on an emulated chip, in the robot's environment.

pub(crate) mod output;
pub(crate) mod problems;
pub(crate) mod text;

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use rc10_emu::Board;
use rc10_time::Micros;

use crate::args::{Injected, check_end, seconds, seed};
use crate::commands::emulate::output::Outcome;
use crate::files::{make_folder, write_file};
use crate::record::RecordWriter;
use crate::recording::origin::Origin;
use crate::robot::build::Wanted;
use crate::run::board::{self, partner, program};
use crate::run::emulation::{Emulation, Setup};
use crate::show::figures::{Figures, verdict};
use crate::show::print::print_files;
use crate::show::report::write_files;
use crate::world::robot::Robot;

/// Arguments of `rc10 emu`.
#[derive(Args, Debug)]
#[command(allow_negative_numbers = true)]
pub struct EmuArgs {
    /// The program to run; without one the firmware is built first
    pub elf: Option<PathBuf>,
    /// Virtual seconds to run, up to 3600
    #[arg(long, value_name = "S", default_value = "1", value_parser = seconds)]
    pub seconds: Micros,
    /// Seed of everything random in the world: two runs with one seed are the same to the bit
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = seed)]
    pub seed: u64,
    /// Million instructions a second that the core executes at its full clock [default: as many as
    /// a Cortex-M4 would]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub mips: Option<u64>,
    /// The board, h723zg or dm-mc02 [default: the one that the program is for]; without a program, the one to build it for
    #[arg(long, value_name = "NAME", value_parser = board::named)]
    pub board: Option<Board>,
    /// Crystal on the board in MHz, if another one is soldered on by mistake
    #[arg(long, value_name = "MHZ", value_parser = board::crystal)]
    pub crystal: Option<u64>,
    #[command(flatten)]
    pub(crate) injected: Injected,
    /// Folder for report.html, the bus logs and what the chip's UARTs said
    #[arg(long, value_name = "DIR", default_value = "target/rc10-emu")]
    pub out: PathBuf,
    /// Write a record: every millisecond of every motor as it is seen from outside, for rc10 report,
    /// rc10 csv and viewers of MCAP files
    #[arg(long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
    /// Exit code 3 if the run had problems
    #[arg(long)]
    pub strict: bool,
    /// Run even if the motors of a bus do not fit on it, and write over the file of --record
    #[arg(long)]
    pub force: bool,
}

/// The file with what a chip's black box has.
const BLACK_BOX: &str = "black-box.bin";

/// Runs a program, writes the files and prints the figures; returns whether the run had problems.
/// Fails if the program is missing, invalid or for another chip; a fault cannot happen; the robot's
/// motors do not fit on their buses; or the folder cannot be written.
pub fn emulate(args: &EmuArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    check_end(&args.injected.faults, args.seconds)?;
    robot.fit(args.force)?;
    let wanted = Wanted { board: args.board, black_box: args.record.is_some() };
    let (path, program) = program(args.elf.as_deref(), robot.description(), wanted)?;
    let Injected { faults, mistakes } = args.injected.clone();
    let setup = Setup {
        seed: args.seed,
        speed: args.mips.map(|mips| mips * 1_000_000),
        faults,
        mistakes,
        board: args.board,
        crystal: args.crystal,
        partner: partner(robot.description(), wanted)?,
        record: args.record.is_some(),
        ..Setup::default()
    };
    let started = Instant::now();
    let named = || path.display().to_string();
    let emulation = Emulation::new(&program, robot, &setup).with_context(named)?;
    make_folder(&args.out)?;
    let record = |path: &PathBuf| RecordWriter::new(path, args.force, &emulation.heading());
    let record = args.record.as_ref().map(record).transpose()?;
    let (mut emulation, mut recording) =
        emulation.record_into(args.seconds, record).with_context(named)?;
    let took = started.elapsed();
    recording.faults.clone_from(&args.injected.faults);
    recording.mistakes = args.injected.mistakes.iter().map(ToString::to_string).collect();
    recording.origin = Origin::now(&emulation.description.name);
    let mut figures = Figures::of(&recording);
    let Emulation { rig, description, .. } = &mut emulation;
    let log = rig.machine.take_log();
    problems::search(rig, description, &recording, &log, &mut figures.problems);
    problems::warnings(&log, &recording, &mut figures.problems);
    write_files(&recording, &figures, &args.out, None)?;
    if let Some(memory) = emulation.black_box() {
        write_file(&args.out, BLACK_BOX, &memory)?;
    }
    let sent = emulation.rig.machine.soc().take_sent();
    let texts = text::of(&sent);
    for text in &texts {
        write_file(&args.out, &text.file_name, text.lines.as_bytes())?;
    }
    let (rig, recording, run, log) = (&emulation.rig, &recording, &figures, log.as_slice());
    let outcome = Outcome { rig, figures: rc10_emu::Figures::of(rig), recording, run, log };
    if args.json {
        writeln!(out, "{:#}", outcome.to_json())?;
    } else {
        outcome.write(out, took)?;
        print_files(recording, &args.out, out)?;
        for text in &texts {
            writeln!(out, "text  {}", args.out.join(&text.file_name).display())?;
        }
        write!(out, "\n{}", verdict(recording, run))?;
    }
    Ok(figures.any_problems())
}
