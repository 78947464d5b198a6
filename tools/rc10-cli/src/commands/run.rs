//! `rc10 run`: drives a robot in its environment and says how it went.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Result;
use clap::Args;
use rc10_time::Micros;

use crate::args::{Injected, check_end, seconds, seed};
use crate::files::make_folder;
use crate::record::RecordWriter;
use crate::recording::origin::Origin;
use crate::robot::remote::{self, Receiver};
use crate::run::simulate::{heading, simulate_into};
use crate::show::figures::{Figures, to_json};
use crate::show::print::print;
use crate::show::report::write_files;
use crate::terminal::tell;
use crate::world::robot::Robot;

/// Arguments of `rc10 run`.
#[derive(Args, Debug)]
#[command(allow_negative_numbers = true)]
pub struct RunArgs {
    /// Virtual seconds to run, up to 3600
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    pub seconds: Micros,
    /// Seed of everything random in the world: two runs with one seed are the same to the bit
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = seed)]
    pub seed: u64,
    /// The receiver of the robot's remote control [default: the one that the robot names]
    #[arg(long, value_name = "RECEIVER", value_parser = remote::parser(), ignore_case = true)]
    pub remote: Option<Receiver>,
    #[command(flatten)]
    pub(crate) injected: Injected,
    /// Folder for report.html and the bus logs
    #[arg(long, value_name = "DIR", default_value = "target/rc10")]
    pub out: PathBuf,
    /// Write a record: every millisecond of every motor, for rc10 report, rc10 csv and viewers of
    /// MCAP files; some 2 MB a second
    #[arg(long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Write no bus logs: those of an hour take some 2.5 GB
    #[arg(long)]
    pub no_logs: bool,
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

/// Size of logs, in bytes, from which on it is announced before they are written.
const LARGE: u64 = 100_000_000;

/// Runs a robot, writes the files and prints the figures; returns whether the run had problems.
/// Fails if the folder cannot be written, or the robot is not as described or does not fit on its
/// buses.
pub fn run(args: &RunArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    check_end(&args.injected.faults, args.seconds)?;
    if let Some(receiver) = args.remote {
        robot.set_remote(receiver)?;
    }
    robot.inject(&args.injected, "rc10 run")?;
    robot.fit(args.force)?;
    robot.set_no_logs(args.no_logs);
    // First, so that a wrong folder is known at once.
    make_folder(&args.out)?;
    if let size @ LARGE.. = robot.log_size(args.seconds) {
        let (folder, size) = (args.out.display(), size / 1_000_000);
        tell(format!("the bus logs will take some {size} MB in {folder}; --no-logs writes none"));
    }
    let started = Instant::now();
    if args.record.is_some() {
        robot.record_inputs();
    }
    let record = |path: &PathBuf| RecordWriter::new(path, args.force, &heading(&robot, args.seed));
    let record = args.record.as_ref().map(record).transpose()?;
    let origin = Origin::now(&robot.description().name);
    let mut recording = simulate_into(robot, args.seed, args.seconds, record)?;
    recording.faults.clone_from(&args.injected.faults);
    recording.mistakes = args.injected.mistakes.iter().map(ToString::to_string).collect();
    recording.origin = origin;
    let wall = started.elapsed().as_secs_f64();
    let figures = Figures::of(&recording);
    write_files(&recording, &figures, &args.out, None)?;
    if args.json {
        writeln!(out, "{}", to_json(&recording, &figures, Some(wall)))?;
    } else {
        let (length, seed) = (recording.length.get() as f64 * 1e-6, recording.seed);
        let headline = format!("{length} s of virtual time in {wall:.2} s, seed {seed}");
        print(&recording, &figures, &headline, &args.out, out)?;
    }
    Ok(figures.any_problems())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_exact_and_bounded() {
        assert_eq!(seconds("0.1").unwrap(), Micros::new(100_000));
        assert_eq!(seconds("10").unwrap(), Micros::new(10_000_000));
        assert_eq!(seconds("3600").unwrap(), Micros::new(3_600_000_000));
        for bad in
            ["", ".", "-1", "0", "0.0009", "3600.1", "1e3", "nan", "1.0000001", "99999", "1.-1"]
        {
            assert!(seconds(bad).is_err(), "{bad}");
        }
    }
}
