//! The `rc10` command and its library: runs a robot in a simulated world, draws a report, decodes
//! CAN captures, writes DBC files, puts a simulated bus on a pseudo-terminal. The only place where
//! robots, the simulator and the emulator meet.
//!
//! A robot crate needs no copy of this one: of a robot that is [`Simulated`], [`main_of`] is the same command line. A
//! [`Robot`] that is made by hand, a [`Description`] with buses and tasks, goes to [`main_for`]: `examples/two-wheels`.
//!
//! * [`robot`]: a robot as plain data: motors, base, remote, script.
//! * [`world`]: the simulated environment of a robot, and a robot with its tasks, ready to run.
//! * [`run`]: runs in the simulator and on the emulated chip.
//! * [`record`]: takes looks at a robot, and keeps them in a file. [`recording`]: a whole run.
//! * [`judge`], [`show`]: problems, figures, tables and the report of a recording.
//! * [`tune`]: what a motor moves, estimated from samples, and gains for it.
//! * [`live`]: a robot that runs. [`decode`], [`formats`]: captures, and files of other programs.
//! * [`commands`]: the other commands.
#![forbid(unsafe_code)]
// Figures for people and plots: a rounded digit does no harm here.
#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]

pub mod args;
pub mod commands;
pub mod decode;
mod files;
pub mod formats;
pub mod judge;
pub mod lang;
pub mod live;
pub mod record;
pub mod recording;
pub mod replay;
pub mod robot;
pub mod run;
pub mod show;
mod terminal;
#[cfg(test)]
mod tests;
pub mod tune;
pub mod world;

use std::ffi::OsString;
use std::io::{self, Write};
use std::process::ExitCode;
use std::{env, fs};

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use rc10_motor::Names as _;
use rc10_motor::embassy::{BusPort, PortsOf, Rs485Port};
use rc10_tasks::{Common, Program};
use rc10_time::Micros;

use crate::commands::board_test::{BoardTestArgs, board_test};
use crate::commands::doctor::{DoctorArgs, doctor};
use crate::commands::drive::{DriveArgs, drive};
use crate::commands::emulate::{EmuArgs, emulate};
use crate::commands::faults::FaultsArgs;
use crate::commands::new::NewArgs;
use crate::commands::plan::PlanArgs;
use crate::commands::pty::PtyArgs;
use crate::commands::report::{CsvArgs, ReportArgs, csv, report};
use crate::commands::run::RunArgs;
use crate::formats::dbc::DbcArgs;
use crate::lang::Language;
use crate::live::black_box::BlackBoxArgs;
use crate::live::commands::{
    ForgetArgs, GetArgs, ParamsArgs, RecordArgs, SaveArgs, SetArgs, StopArgs,
};
use crate::live::device::DeviceArgs;
use crate::live::page::LiveArgs;
use crate::live::ros2::Ros2Args;
use crate::live::web::Web;
use crate::replay::command::{ReplayArgs, replay as replay_record};
use crate::run::simulate::simulate;
use crate::tune::command::{TuneArgs, tune as tune_motor};
use commands::decode::DecodeArgs;
use terminal::{Painted, Plain, tell, tell_progress, width};

pub use crate::robot::base::Base;
pub use crate::robot::description::{
    ArmPart, ContactPart, Description, LinePart, Partner, SerialPart, Shape, Simulated, Twin,
    VoltagePart,
};
pub use crate::robot::mistake::Mistake;
pub use crate::robot::motor::{Device, Motor, Place, Plant};
pub use crate::robot::remote::{Receiver, RemoteControl};
pub use crate::robot::script::{Event, Script};
pub use crate::world::robot::Robot;
pub use recording::Recording;

/// RC10: a robot's motor buses, on a PC.
#[derive(Parser)]
#[command(name = "rc10", version, arg_required_else_help = false, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Language of help, verdicts, page and report [default: the environment's, of pages the browser's]
    #[arg(long, global = true, value_name = "LANGUAGE", hide_possible_values = true)]
    lang: Option<Language>,
}

#[derive(Subcommand)]
enum Command {
    /// Drives the robot in a simulated world (also without any command)
    Run(RunArgs),
    /// Runs the firmware itself, on an emulated chip
    Emu(EmuArgs),
    /// Shows the robot while it runs: plots, gains, stop and record, on a page in the browser
    Live(LiveArgs),
    /// Drives the real robot from this PC, through CAN adapters; on the page is its remote
    Drive(DriveArgs),
    /// Lists the gains, limits and parameters of the robot that runs
    Params(ParamsArgs),
    /// Prints parameters of the robot that runs
    Get(GetArgs),
    /// Changes parameters of the robot that runs, until power-off; rc10 save keeps them
    Set(SetArgs),
    /// Keeps the parameters of the robot that runs over a power-off
    Save(SaveArgs),
    /// Has the robot that runs keep no longer what was saved
    Forget(ForgetArgs),
    /// Reads and writes the registers of a motor's own device, through the robot that runs
    Device(DeviceArgs),
    /// Stops the robot that runs: sent until the robot says that it is stopped
    Stop(StopArgs),
    /// Makes the robot that runs a node of ROS 2, over zenoh; needs a build with --features ros2
    Ros2(Ros2Args),
    /// Records the robot that runs
    Record(RecordArgs),
    /// Fetches the seconds before a crash from the robot's black box, for rc10 replay
    #[command(name = "blackbox")]
    BlackBox(BlackBoxArgs),
    /// Estimates what a motor moves, and prints gains for it
    Tune(TuneArgs),
    /// Makes the report of a record, or of captures of the robot's buses
    Report(ReportArgs),
    /// Runs a record again through the robot's own code, and compares it bit for bit
    Replay(ReplayArgs),
    /// Names what is wrong with a robot that runs, or was recorded: the likeliest cause first, and what to do
    Doctor(DoctorArgs),
    /// Writes a record as CSV files
    Csv(CsvArgs),
    /// Says in words what a candump log of the robot's buses contains
    Decode(DecodeArgs),
    /// Writes what stands in the frames of each bus as a DBC file
    Dbc(DbcArgs),
    /// Shows how late each frame of the buses can be, and what else fits
    Plan(PlanArgs),
    /// Shows what every motor model does in every fault, and how long it takes
    Faults(FaultsArgs),
    /// Leads through the first tests of a board, with its probe, and keeps a file to send back
    BoardTest(BoardTestArgs),
    /// Makes a robot of your own: a folder with its table, its simulation and its firmware
    New(NewArgs),
    /// Puts a simulated bus on a pseudo-terminal, as an slcan adapter (Unix)
    Pty(PtyArgs),
}

/// Examples for any robot; the help of `--robot` lists its choices.
const EXAMPLES: &str = include_str!("examples.txt").trim_ascii_end();

impl Arguments {
    fn command_line(self) -> CommandLine {
        match self.command {
            Some(command) => CommandLine(command),
            None => Self::parse_from(["rc10", "run"]).command_line(),
        }
    }
}

/// The parsed arguments of the command line.
pub struct CommandLine(Command);

impl CommandLine {
    /// Parses arguments, the first of which is the command's own name; fails unless they fit the
    /// help.
    pub fn parse<T: Into<OsString> + Clone>(
        arguments: impl IntoIterator<Item = T>,
    ) -> anyhow::Result<Self> {
        Ok(Arguments::try_parse_from(arguments)?.command_line())
    }

    /// Runs the command with `robot`, and writes to standard output. Exit code 0: fine; 1: the
    /// input has broken lines; 3: the run had problems, and `--strict` was given. Fails if the
    /// robot is not as described, does not fit on its buses, or a file cannot be read or written.
    pub fn run(self, robot: Robot<'_>) -> anyhow::Result<ExitCode> {
        let mut out = Painted(io::BufWriter::new(anstream::stdout().lock()));
        let code = self.run_to(robot, &mut out)?;
        out.flush()?;
        Ok(ExitCode::from(code))
    }

    /// Runs the command like [`run`](Self::run) with another output; returns the exit code.
    pub fn run_to(self, robot: Robot<'_>, out: &mut dyn Write) -> anyhow::Result<u8> {
        let out = &mut Plain(out);
        Ok(match self.0 {
            Command::Run(args) => strict(args.strict, commands::run::run(&args, robot, out)?),
            Command::Emu(args) => strict(args.strict, emulate(&args, robot, out)?),
            Command::Live(args) => match args.at.record() {
                Some(path) => live::playback::play(path, args.page, robot, out).map(|()| 0)?,
                None => live::live(&args, robot, out).map(|()| 0)?,
            },
            Command::Drive(args) => drive(&args, robot, out).map(|()| 0)?,
            Command::Params(args) => live::params(&args, robot, out).map(|()| 0)?,
            Command::Get(args) => live::get(&args, robot, out).map(|()| 0)?,
            Command::Set(args) => live::set(&args, robot, out).map(|()| 0)?,
            Command::Save(args) => live::save(&args, robot, out).map(|()| 0)?,
            Command::Forget(args) => live::forget(&args, robot, out).map(|()| 0)?,
            Command::Device(args) => live::device(&args, robot, out).map(|()| 0)?,
            Command::Ros2(args) => live::ros2(&args, robot).map(|()| 0)?,
            Command::Stop(args) => live::stop_robot(&args, robot, out).map(|()| 0)?,
            Command::Record(args) => live::record(&args, robot, out).map(|()| 0)?,
            Command::BlackBox(args) => live::black_box(&args, robot, out).map(|()| 0)?,
            Command::Tune(args) => tune_motor(&args, robot, out).map(|()| 0)?,
            Command::Report(args) => strict(args.strict, report(&args, robot, out)?),
            Command::Replay(args) => strict(true, replay_record(&args, robot, out)?),
            Command::Doctor(args) => strict(args.strict, doctor(&args, robot, out)?),
            Command::Csv(args) => csv(&args, out).map(|()| 0)?,
            Command::Decode(args) => {
                let err = &mut Plain(io::stderr().lock());
                commands::decode::decode(&args, robot, out, err)?.into()
            }
            Command::Dbc(args) => formats::dbc::dbc(&args, robot.description(), out).map(|()| 0)?,
            Command::Plan(args) => {
                commands::plan::plan(&args, robot.description(), out).map(|()| 0)?
            }
            Command::Faults(args) => strict(true, commands::faults::faults(&args, out)?),
            Command::BoardTest(args) => strict(true, board_test(&args, &robot, out)?),
            Command::New(args) => commands::new::new(&args, out).map(|()| 0)?,
            Command::Pty(args) => commands::pty::pty(&args, robot, out).map(|()| 0)?,
        })
    }
}

const fn strict(is_strict: bool, has_problems: bool) -> u8 {
    if is_strict && has_problems { 3 } else { 0 }
}

/// Runs the command line for a robot: `robot` sets it up and gives it to [`CommandLine::run`]. An
/// error that names a motor by model and identifier gets its label and bus from the `description`.
/// Exit code 2: bad arguments, a robot that cannot be set up, motors that do not fit on a bus, or a
/// file that cannot be read or written; the others are those of [`CommandLine::run`].
#[must_use]
pub fn main_for(
    description: &Description,
    robot: impl FnOnce(CommandLine) -> anyhow::Result<ExitCode>,
) -> ExitCode {
    let language = Language::spoken();
    tell_progress();
    let command = language.help(Arguments::command()).term_width(width().unwrap_or(80));
    let parsed = command.try_get_matches();
    let arguments = match parsed.and_then(|it| Arguments::from_arg_matches(&it)) {
        Ok(arguments) => arguments,
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    if let Some(other) = other_robot() {
        tell(other);
    }
    match robot(arguments.command_line()).map_err(|error| description.label(error)) {
        Ok(code) => code,
        // The reader of our output has read enough (`| head`).
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            tell(format_args!("{error:#}"));
            ExitCode::from(2)
        }
    }
}

/// Runs the command line for the robot of a program: the whole `main` of a robot's package.
#[must_use]
pub fn main_of<P: Simulated>() -> ExitCode {
    let description = P::description();
    main_for(&description, |command| {
        if let CommandLine(Command::Replay(ReplayArgs { check: true, seed, seconds, .. })) = command
        {
            return Ok(match replayed::<P>(seed, seconds) {
                Ok(told) => (println!("{told}"), ExitCode::SUCCESS).1,
                Err(error) => (println!("{error:#}"), ExitCode::from(3)).1,
            });
        }
        with::<P, _>(|shared, motors| {
            command.run(Robot::of::<P>(P::description(), shared, motors)?)
        })
    })
}

/// Simulates the robot of a program in a world of `description` and `seed`, for this time. Fails as
/// [`Robot::of`] and [`simulate`] do.
pub fn simulated<P: Program>(
    description: Description,
    seed: u64,
    time: Micros,
) -> anyhow::Result<Recording> {
    with::<P, _>(|shared, motors| {
        simulate(Robot::of::<P>(description, shared, motors)?, seed, time)
    })
}

/// Simulates the robot of a program in its own world of this seed twice, and replays what reached its buses: a line that
/// says that all is the same, bit for bit. For a robot's tests: a clock, a random number or the order of a `HashMap` in a
/// task is found by it. Fails as [`Robot::of`] and [`simulate`] do; or with what differs first, when and where.
pub fn replayed<P: Simulated>(seed: u64, time: Micros) -> anyhow::Result<String> {
    let run = || {
        with::<P, _>(|shared, motors| {
            replay::check::inputs_of(robot_of::<P>(shared, motors)?, seed, time)
        })
    };
    let (first, second) = (run()?, run()?);
    with::<P, _>(|shared, motors| {
        let told = replay::check::compare(&first, &second, robot_of::<P>(shared, motors)?)?;
        Ok(replay::command::equal(&told))
    })
}

/// The robot of a program, in its own world, before it runs. Fails as [`Robot::of`] does.
pub fn robot_of<'r, P: Simulated>(
    shared: &'r Common<'_, P::Name, P::Own>,
    motors: &'r mut P::Motors,
) -> anyhow::Result<Robot<'r>> {
    Robot::of::<P>(P::description(), shared, motors)
}

/// Does something with the state and the motors of a robot that has not begun.
pub fn with<P: Program, R>(
    work: impl FnOnce(&Common<'_, P::Name, P::Own>, &mut P::Motors) -> R,
) -> R {
    let buses: Vec<_> = P::Name::BUSES.iter().map(|_| BusPort::new()).collect();
    let lines: Vec<_> = (0..P::Name::LINES).map(|_| Rs485Port::new()).collect();
    let shared = Common::new(PortsOf::new(&buses, &lines));
    work(&shared, &mut P::Motors::default())
}

/// The robot of a program, in its own world, before it runs; its state lives as long as this program.
/// Fails as [`Robot::of`] does.
pub fn robot_for_good<P: Simulated>() -> anyhow::Result<Robot<'static>> {
    Robot::for_good::<P>(P::description())
}

/// Begins `rc10 live` with these words, `--sim` or `--emu ELF` among them, for a page in the same browser. `again` sets
/// the robot up for reports. Fails if the words are invalid, or the robot cannot begin.
pub fn web(
    words: &[String],
    robot: Robot<'static>,
    again: fn() -> anyhow::Result<Robot<'static>>,
) -> anyhow::Result<Web> {
    let CommandLine(Command::Live(args)) = CommandLine::parse(words)? else {
        anyhow::bail!("only `rc10 live` has a page")
    };
    Web::new(&args, robot, move |path| {
        let out = path.with_extension("report");
        let words = ["rc10".as_ref(), "report".as_ref(), "--out".as_ref(), out.as_os_str()];
        CommandLine::parse(words.into_iter().chain([path.as_os_str()]))?
            .run_to(again()?, &mut io::sink())?;
        Ok(fs::read(out.join("report.html"))?)
    })
}

/// The robot in this folder, if it is another one than this program's.
fn other_robot() -> Option<String> {
    // By cargo, the folder's own is run, or one that was named.
    if env::var_os("CARGO_MANIFEST_DIR").is_some() {
        return None;
    }
    let (here, program) = (env::current_dir().ok()?, env::current_exe().ok()?);
    let mut folders = here.ancestors();
    let (folder, manifest) = folders
        .find_map(|folder| Some((folder, fs::read_to_string(folder.join("Cargo.toml")).ok()?)))?;
    let is_robot = ["rc10-cli", "rc10/sim"].iter().any(|it| manifest.contains(it));
    let name = manifest.lines().find_map(|line| line.strip_prefix("name = \""))?;
    let (theirs, own) = (name.trim_end_matches('"'), program.file_stem()?.to_str()?);
    (is_robot && theirs != own && !program.starts_with(folder)).then(|| {
        format!(
            "this is the robot of `{own}`; the one in this folder is `{theirs}`: cargo run -- .."
        )
    })
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<io::Error>();
    io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}
