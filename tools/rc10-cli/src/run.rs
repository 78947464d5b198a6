//! `rc10 run`: drives a robot in its environment and says how it went.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use rc10_can::Micros;
use rc10_emu::fault::{Fault, Kind};

use crate::figures::{
    Figures, Table, bus_table, line_table, motor_table, part_table, remote_lines, to_json, verdict,
};
use crate::mistake::{self, Mistake};
use crate::record::{Heading, RecordWriter};
use crate::recording::{Recording, Source};
use crate::remote::{self, Receiver};
use crate::report::report;
use crate::robot::Robot;
use crate::signal::signal_table;
use crate::simulate::simulate_into;
use crate::terminal::tell;

/// Help text of `--fault`.
const FAULTS: &str = "\
Something goes wrong, KIND@TIME or KIND@TIME..TIME: cut:2@0.3s..0.5s short:2@.. dominant:2@.. \
noise:2@0.3s power:2@.. load:2@.. remote-lost@0.5s..0.7s; cut:L1, noise:L1 and power:L1 for an RS-485 \
line, and cut:IMU and so on for a part on a UART; stuck:NAME, torn:NAME and bounces:NAME for the contact \
of a motor, with - for spaces; of the chip, in rc10 emu only: hang@0.3s..320ms mask@0.3s..305ms panic@0.3s hardfault@0.3s \
crystal-dead crystal-stops@0.3s; repeat for more";

/// What goes wrong on purpose.
#[derive(Args, Clone, Debug, Default)]
pub struct Injected {
    #[arg(long = "fault", value_name = "FAULT", help = FAULTS)]
    #[expect(missing_docs, reason = "its help says it")]
    pub faults: Vec<Fault>,
    #[arg(long = "mistake", value_name = "MISTAKE", help = mistake::HELP)]
    #[expect(missing_docs, reason = "its help says it")]
    pub mistakes: Vec<Mistake>,
}

impl Injected {
    /// Puts it into a robot that is to be simulated by `command`.
    ///
    /// # Errors
    /// If that cannot happen to the robot, or there is no chip that it could happen to.
    pub fn put_into(&self, robot: &mut Robot<'_>, command: &str) -> Result<()> {
        let mut kinds = self.faults.iter().map(|fault| &fault.kind);
        if let Some(kind) = kinds.find(|kind| matches!(kind, Kind::Other(_))) {
            bail!("--fault {kind}: {command} has no chip to do that to; rc10 emu does it");
        }
        robot.set_faults(&self.faults)?;
        robot.set_mistakes(&self.mistakes)
    }

    /// Whether nothing does.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.faults.is_empty() && self.mistakes.is_empty()
    }
}

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
    #[expect(missing_docs, reason = "its fields say it")]
    pub injected: Injected,
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

/// Logs of this many bytes are told of before they are written.
const LARGE: u64 = 100_000_000;

/// The settings of `rc10` without any argument.
impl Default for RunArgs {
    fn default() -> Self {
        Self {
            seconds: Micros::from_millis(10_000),
            seed: 1,
            remote: None,
            injected: Injected::default(),
            out: "target/rc10".into(),
            record: None,
            no_logs: false,
            json: false,
            strict: false,
            force: false,
        }
    }
}

/// A number of seconds with up to six decimals, exactly.
pub(crate) fn seconds(text: &str) -> Result<Micros, String> {
    const WANTED: &str = "must be a number of seconds from 0.001 to 3600";
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty()
        || whole.len() > 4
        || !digits(whole)
        || !digits(fraction)
        || fraction.len() > 6
    {
        return Err(WANTED.into());
    }
    let micros = format!("{whole}{fraction:0<6}").parse().map_err(|_| WANTED)?;
    match micros {
        1000..=3_600_000_000 => Ok(Micros::new(micros)),
        _ => Err(WANTED.into()),
    }
}

/// A seed.
pub(crate) fn seed(text: &str) -> Result<u64, &'static str> {
    text.parse().map_err(|_| "must be a whole number from 0 to 18446744073709551615")
}

/// Runs a robot, writes the files, prints the figures. Whether the run had problems.
///
/// # Errors
/// If the folder cannot be written, the robot is not as described, or its motors do not fit on
/// their buses.
pub fn run(args: &RunArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    check_end(&args.injected.faults, args.seconds)?;
    if let Some(receiver) = args.remote {
        robot.set_remote(receiver)?;
    }
    args.injected.put_into(&mut robot, "rc10 run")?;
    robot.fit(args.force)?;
    robot.set_no_logs(args.no_logs);
    // Before the work, so that a wrong folder is known at once.
    make_folder(&args.out)?;
    if let size @ LARGE.. = robot.log_size(args.seconds) {
        let (folder, size) = (args.out.display(), size / 1_000_000);
        tell(format_args!(
            "the bus logs will take some {size} MB in {folder}; --no-logs writes none"
        ));
    }
    let started = Instant::now();
    let record = match &args.record {
        Some(path) => Some(RecordWriter::new(path, args.force, &Heading::of(&robot, args.seed))?),
        None => None,
    };
    let mut recording = simulate_into(robot, args.seed, args.seconds, record)?;
    recording.faults.clone_from(&args.injected.faults);
    let wall = started.elapsed().as_secs_f64();
    let figures = Figures::of(&recording);
    write_files(&recording, &figures, &args.out)?;
    if args.json {
        writeln!(out, "{}", to_json(&recording, &figures, Some(wall)))?;
    } else {
        let length = recording.length.get() as f64 * 1e-6;
        let headline =
            format!("{length} s of virtual time in {wall:.2} s, seed {}", recording.seed);
        print(&recording, &figures, &headline, &args.out, out)?;
    }
    Ok(figures.any_problems())
}

/// # Errors
/// If a fault would begin when all is over.
pub(crate) fn check_end(faults: &[Fault], end: Micros) -> Result<()> {
    match faults.iter().find(|fault| fault.from >= end.into()) {
        Some(Fault { kind, from, .. }) => {
            let [from, end] = [from.micros(), end].map(|time| time.get() as f64 * 1e-6);
            bail!("{kind} would begin at {from} s, after the end at {end} s: see --seconds")
        }
        None => Ok(()),
    }
}

pub(crate) fn print(
    recording: &Recording,
    figures: &Figures,
    headline: &str,
    folder: &Path,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "{headline}\n")?;
    let (motors, buses) = (motor_table(recording, figures), bus_table(recording));
    let lines = line_table(recording).as_ref().map_or_else(String::new, Table::text);
    let lines = if lines.is_empty() { lines } else { format!("\n{lines}") };
    writeln!(out, "{}\n{}{lines}{}", motors.text(), buses.text(), remote_lines(recording))?;
    for table in [part_table(recording), signal_table(recording)].iter().flatten() {
        writeln!(out, "{}", table.text())?;
    }
    if let Some(path) = &figures.path {
        writeln!(out, "{}", path.lines())?;
    }
    if recording.source == Source::Simulation {
        writeln!(
            out,
            "A tick takes 0 us here: virtual time stands still while code runs. Instructions per tick\n\
             on the chip: cargo xtask count.\n"
        )?;
    }
    if recording.source.is_simulated() {
        writeln!(out, "trace {}", recording.trace_hash())?;
    }
    print_files(recording, folder, out)?;
    write!(out, "\n{}", verdict(recording, figures))
}

/// Says where the files of a run are.
pub(crate) fn print_files(
    recording: &Recording,
    folder: &Path,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "open  {}", folder.join("report.html").display())?;
    if recording.no_logs {
        return Ok(());
    }
    writeln!(out, "logs  {}  (rc10 decode reads them)", folder.join("bus*.log").display())
}

/// Makes the folder for a run's files, if it is not there.
///
/// # Errors
/// If it cannot be made.
pub fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))
}

/// Writes the report and the buses' logs of a run into a folder that is there.
///
/// # Errors
/// If they cannot be written.
pub fn write_files(recording: &Recording, figures: &Figures, folder: &Path) -> Result<()> {
    write_file(folder, "report.html", report(recording, figures).as_bytes())?;
    for bus in &recording.buses {
        let name = format!("bus{}.log", bus.number);
        if recording.no_logs {
            // One of a run before would be taken for this one's.
            let _ = fs::remove_file(folder.join(name));
        } else {
            write_file(folder, &name, bus.log.as_bytes())?;
        }
    }
    Ok(())
}

/// A file that is written beside its place, and removed unless it is put there.
pub(crate) struct Unfinished(PathBuf);

impl Unfinished {
    /// For this place.
    pub(crate) fn new(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Self(path.with_file_name(format!(".{name}.{}", std::process::id())))
    }

    pub(crate) fn create(&self) -> Result<File> {
        File::create(&self.0).with_context(|| format!("cannot write {}", self.0.display()))
    }

    pub(crate) fn put(self, path: &Path) -> io::Result<()> {
        fs::rename(&self.0, path)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Writes a whole file or none.
pub(crate) fn write_file(folder: &Path, name: &str, content: &[u8]) -> Result<()> {
    let path = folder.join(name);
    let beside = Unfinished::new(&path);
    let written = fs::write(&beside.0, content).and_then(|()| beside.put(&path));
    written.with_context(|| format!("cannot write {}", path.display()))
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
