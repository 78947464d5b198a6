//! The `rc10` command: runs the robot in a simulated world, draws a report, decodes CAN captures.
//! The only place where robot and simulator meet.
#![forbid(unsafe_code)]
// Figures for people and plots: a rounded digit does no harm here.
#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]

pub mod candump;
pub mod decode;
pub mod recording;
pub mod report;
pub mod run;
pub mod simulate;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use decode::DecodeArgs;
use run::RunArgs;

/// RC10: a robot's motor buses, on a PC.
#[derive(Parser)]
#[command(name = "rc10", version, arg_required_else_help = false, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Drives the robot of crates/rc10-robot in a simulated world (also without any command)
    Run(RunArgs),
    /// Says in words what a candump log of the robot's buses contains
    Decode(DecodeArgs),
}

const EXAMPLES: &str = "\
Examples:
  rc10                                   ten seconds of the robot, and target/rc10/report.html
  rc10 run --seconds 3 --seed 7          three seconds of another world
  rc10 run --out /tmp/tonight --json     all figures as one JSON object
  rc10 decode target/rc10/bus1.log       what was said on bus 1
  rc10 decode capture.log --bus can0=2   a capture whose can0 is the robot's bus 2

From a checkout: cargo run --release -- run --seconds 3";

/// Runs the command line. Exit code 0: fine; 1: the input has broken lines; 2: bad arguments, or a
/// file that cannot be read or written.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let mut out = io::BufWriter::new(io::stdout().lock());
    let mut err = io::stderr().lock();
    let result = match arguments.command {
        None => run::run(&RunArgs::default(), &mut out).map(|()| false),
        Some(Command::Run(args)) => run::run(&args, &mut out).map(|()| false),
        Some(Command::Decode(args)) => decode::decode(&args, &mut out, &mut err),
    };
    let result = result.and_then(|broken| Ok(out.flush().map(|()| broken)?));
    match result {
        Ok(false) => ExitCode::SUCCESS,
        Ok(true) => ExitCode::from(1),
        // Whoever reads our output has read enough (`| head`).
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(err, "rc10: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<io::Error>();
    io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}
