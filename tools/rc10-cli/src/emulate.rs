//! `rc10 emu`: runs the firmware itself, on an emulated chip, in the robot's environment.

pub(crate) mod board;
mod foreign;
mod line;
mod output;
mod problems;
mod text;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use std::{env, fs};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_can::Micros;
use rc10_emu::fault::{Fault, Kind};
use rc10_emu::{Board, Machine, Options, Rig};
use rc10_motor::dji::FeedbackRate;
use rc10_motor::{Loops, MotorBus, MotorStatus};
use rc10_sim::{Esc, Nanos, TraceEntry};
use sha2::{Digest, Sha256};

use self::line::LineListener;
use self::output::Outcome;
use crate::description::Description;
use crate::environment::{Environment, RemoteLink, operate};
use crate::figures::{Figures, verdict};
use crate::live::wire::{CONSOLE, Line};
use crate::look::{BusLook, Moment, RobotLook};
use crate::mistake::Mistake;
use crate::motor::{Device, Place};
use crate::record::{Heading, RecordWriter};
use crate::recorder::Recorder;
use crate::recording::{PathPoint, Recording, Source, hex_digits};
use crate::remote::{Operator, ReceiverWire, Sight, Watch};
use crate::robot::Robot;
use crate::run::{
    Injected, check_end, make_folder, print_files, seconds, seed, write_file, write_files,
};

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
    /// Its crystal, if another one is soldered on by mistake
    #[arg(long, value_name = "MHZ", value_parser = board::crystal)]
    pub crystal: Option<u64>,
    #[command(flatten)]
    #[expect(missing_docs, reason = "its fields say it")]
    pub injected: Injected,
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

/// Options of an emulation: its differences from a plain run.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Seed of the world.
    pub seed: u64,
    /// Instructions a second at the full clock, if not as many as a Cortex-M4 executes.
    pub speed: Option<u64>,
    /// The feedback rate set on all motors, if not the one that the robot expects.
    pub rate: Option<FeedbackRate>,
    /// Injected faults.
    pub faults: Vec<Fault>,
    /// Differences between the world and the robot's table.
    pub mistakes: Vec<Mistake>,
    /// Bits a second of a PC at its console, if there is to be one.
    pub console: Option<u32>,
    /// The board that the chip is on, if not the one that the program is for.
    pub board: Option<Board>,
    /// Its crystal, if it has another than its own: hertz.
    pub crystal: Option<u64>,
}

/// A chip in a robot's environment, and what the robot's own code on this machine hears on the
/// wires meanwhile.
pub struct Emulation<'r> {
    /// The scenario.
    pub rig: Rig,
    /// The motors, in the order of the description.
    pub motors: Vec<Esc>,
    /// The remote and its receiver, if the robot has one.
    pub remote: Option<RemoteLink>,
    /// The line from its console to a PC, if there is one.
    pub console: Option<Line>,
    description: Description,
    base: Option<rc10_sim::Base>,
    seed: u64,
    /// The robot's buses: they only listen.
    listeners: Vec<MotorBus<'r>>,
    /// Its lines. The same.
    lines: Vec<LineListener<'r>>,
    /// The control loops that its code has for each motor.
    loops: Vec<Option<Loops>>,
    heard: Vec<usize>,
    operator: Option<Operator>,
}

impl<'r> Emulation<'r> {
    /// Puts a program into a chip, and the chip into the environment of a robot.
    ///
    /// # Errors
    /// If the program or the robot's description is none, or a fault concerns a bus that is not
    /// there.
    pub fn new(program: &[u8], robot: Robot<'r>, setup: &Setup) -> Result<Self> {
        let mut robot = robot;
        robot.set_faults(&setup.faults)?;
        robot.set_mistakes(&setup.mistakes)?;
        let loops = robot.loops();
        let (mut description, listeners, lines) = robot.into_buses()?;
        if let Some(rate) = setup.rate {
            for motor in &mut description.motors {
                if let Device::Dji(config) = &mut motor.device {
                    config.rate = rate;
                }
            }
        }
        let lines: Vec<_> = lines.into_iter().map(LineListener::new).collect();
        let mut around = Environment::new(&description, setup.seed)?;
        if let Some(baud) = setup.console {
            around = around.with_console(baud);
        }
        let parts = around.parts(&description);
        let Environment { world, wires, lines: ends, motors, base, serials, contacts, .. } = around;
        let (remote, operator, console) = (around.remote, around.operator, around.console);
        ensure!(wires.len() <= 3, "the chip has three buses, the robot {}", wires.len());
        let board = board::of(program, setup)?;
        let options = Options { seed: setup.seed, board, ..Options::default() };
        let mut machine = Machine::with(program, options)?;
        if let Some(base) = &base {
            machine.mount_on(base);
        }
        if let Some(speed) = setup.speed {
            machine.set_speed(speed);
        }
        for (part, link) in description.serials.iter().zip(&serials) {
            machine.connect_serial(part.uart, link, false).context(part.label)?;
        }
        let inputs = board.switches;
        ensure!(
            contacts.len() <= inputs.len(),
            "{} has {} inputs for switches, the robot {} contacts",
            board.name,
            inputs.len(),
            contacts.len()
        );
        for (contact, pin) in contacts.iter().zip(inputs) {
            machine.connect_contact(pin, contact).context("contacts")?;
        }
        if let Some(line) = &console {
            machine.connect_serial(CONSOLE, line.serial(), false).context("console")?;
        }
        if let (Some(control), Some(link)) = (&description.remote, &remote) {
            match &link.wire {
                ReceiverWire::Serial(wire) => {
                    let inverted = link.receiver.serial().is_some_and(|serial| serial.inverted);
                    let inverted = inverted != board.inverts_remote;
                    machine.connect_serial(control.uart, wire, inverted)
                }
                ReceiverWire::Pulses(wire) => machine.connect_pulses(control.pulse_pin, wire),
            }
            .context("remote")?;
        }
        let on_buses = description.motors.iter().zip(&motors);
        let on_buses = on_buses.filter_map(|(motor, esc)| match motor.on {
            Place::Bus(bus) => Some((usize::from(bus) - 1, esc.clone())),
            Place::Line(_) => None,
        });
        let heard = vec![0; wires.len()];
        let mut of_chip = setup.faults.clone();
        of_chip.retain(|fault| fault.kind != Kind::RemoteLost);
        let uarts = description.lines.iter().map(|part| part.uart);
        let ends = uarts.zip(ends).collect();
        let mut rig = Rig::new(machine, world, wires, ends, on_buses.collect(), &of_chip)?;
        rig.connect_parts(parts.0, parts.1);
        let seed = setup.seed;
        Ok(Self {
            rig,
            motors,
            description,
            base,
            seed,
            listeners,
            lines,
            loops,
            heard,
            remote,
            console,
            operator,
        })
    }

    /// The base on its wheels, if that is simulated.
    #[must_use]
    pub const fn base(&self) -> Option<&rc10_sim::Base> {
        self.base.as_ref()
    }

    /// Lets everything go on up to a time since power-on.
    ///
    /// # Errors
    /// As [`Rig::run`].
    pub fn run(&mut self, until: Nanos) -> Result<()> {
        let Self { rig, operator, .. } = self;
        operate(operator.as_mut(), until.micros(), |until| rig.run(until.into()))?;
        rig.run(until)
    }

    /// A look at the remote and the motors from outside; `None` without a remote.
    fn sight(&self) -> Option<Sight<'_>> {
        let remote = self.remote.as_ref()?;
        let motors = &self.description.motors;
        Some(Sight { sent: remote.remote.sent(), motors, twins: &self.motors, arm: None })
    }

    /// The new frames on the wires since the last call, bus by bus; the listeners have heard them.
    fn listen(&mut self) -> Vec<Vec<TraceEntry>> {
        let mut news = Vec::new();
        for ((log, heard), bus) in
            self.rig.logs().iter().zip(&mut self.heard).zip(&mut self.listeners)
        {
            let new = log.frames[*heard..].to_vec();
            *heard = log.frames.len();
            for entry in new.iter().filter(|entry| !entry.from_controller) {
                bus.on_frame(&entry.frame, entry.at);
            }
            news.push(new);
        }
        for (bytes, line) in self.rig.take_line_bytes().iter().zip(&mut self.lines) {
            line.listen(bytes);
        }
        news
    }

    /// Runs up to a time and writes down what the wires and the motors do.
    ///
    /// # Errors
    /// As [`Rig::run`].
    pub fn record(self, length: Micros) -> Result<(Self, Recording)> {
        self.record_into(length, None)
    }

    /// The same, with every look written into a record.
    ///
    /// # Errors
    /// As [`record`](Self::record), and if that cannot be written.
    pub fn record_into(
        mut self,
        length: Micros,
        record: Option<RecordWriter>,
    ) -> Result<(Self, Recording)> {
        let description = self.description.clone();
        let (loops, twins, source) = (&self.loops, &self.motors, Source::Emulation);
        let mut recorder =
            Recorder::new(&description, self.seed, loops, twins, source).with_record(record);
        let mut watch = Watch::new(description.remote.as_ref());
        let mut now = Micros::ZERO;
        let mut next_look = Recorder::next_look(now, length);
        while now < length {
            now = watch.next(now).map_or(next_look, |look| look.min(next_look));
            self.run(now.into())?;
            if let Some(sight) = self.sight() {
                watch.look(now, sight);
            }
            if now < next_look {
                continue;
            }
            next_look = Recorder::next_look(now, length);
            let machine = &self.rig.machine;
            if let (None, Some(other)) = (machine.ready(), foreign::chip_of(machine.reports())) {
                bail!("this ELF is not for an STM32H723: {other}");
            }
            let news = self.listen();
            for (bus, entries) in news.iter().enumerate() {
                recorder.frames(bus, entries);
            }
            if !recorder.look((now, length), &self.motors, |line| self.status(line, now))? {
                continue;
            }
            let pose = PathPoint::of(self.base.as_ref());
            let moment = Moment {
                // What the chip hears of its IMU is not seen from here.
                robot: RobotLook { pose, ..RobotLook::default() },
                buses: self.listeners.iter().map(BusLook::heard).collect(),
                lines: self.lines.iter().map(LineListener::status).collect(),
                parts: Vec::new(),
                remote: self.sight().map(|sight| sight.remote(None)),
            };
            recorder.sample(now, self.rig.buses(), moment)?;
        }
        let recording = recorder.finish(length, self.rig.buses(), watch.finish())?;
        Ok((self, recording))
    }

    /// What a record of it begins with.
    #[must_use]
    pub fn heading(&self) -> Heading<'_> {
        let Self { seed, description, .. } = self;
        Heading { seed: *seed, source: Source::Emulation, description, signals: &[] }
    }

    /// The status of a motor, by the frames that are heard of it.
    fn status(&self, entry: usize, now: Micros) -> MotorStatus {
        let index = |number: u8| usize::from(number).checked_sub(1);
        let heard = || {
            let motor = self.description.number(entry)?;
            match self.description.motors.get(entry)?.on {
                Place::Bus(bus) => self.listeners.get(index(bus)?)?.status(motor, now),
                Place::Line(line) => self.lines.get(index(line)?)?.motor(motor, now),
            }
        };
        heard().unwrap_or(MotorStatus::NEW)
    }
}

/// Runs a program, writes the files, prints the figures. Whether the run had problems.
///
/// # Errors
/// If there is no program, or it is none, or one for another chip; if a fault cannot happen; if the
/// robot's motors do not fit on their buses; if the folder cannot be written.
pub fn emulate(args: &EmuArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    check_end(&args.injected.faults, args.seconds)?;
    robot.fit(args.force)?;
    let path = match (&args.elf, robot.description().firmware) {
        (Some(path), _) => path.clone(),
        (None, Some(build)) => build(args.board)?,
        (None, None) => bail!("this robot does not say how to build a firmware: name an ELF file"),
    };
    let program = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let setup = Setup {
        seed: args.seed,
        speed: args.mips.map(|mips| mips * 1_000_000),
        rate: None,
        faults: args.injected.faults.clone(),
        mistakes: args.injected.mistakes.clone(),
        console: None,
        board: args.board,
        crystal: args.crystal,
    };
    let started = Instant::now();
    let named = || path.display().to_string();
    let emulation = Emulation::new(&program, robot, &setup).with_context(named)?;
    make_folder(&args.out)?;
    let record = match &args.record {
        Some(path) => Some(RecordWriter::new(path, args.force, &emulation.heading())?),
        None => None,
    };
    let (mut emulation, mut recording) =
        emulation.record_into(args.seconds, record).with_context(named)?;
    let took = started.elapsed();
    recording.faults.clone_from(&args.injected.faults);
    let mut figures = Figures::of(&recording);
    let Emulation { rig, description, .. } = &mut emulation;
    let log = rig.machine.take_log();
    problems::search(rig, description, &recording, &log, &mut figures.problems);
    problems::warnings(&log, &recording, &mut figures.problems);
    write_files(&recording, &figures, &args.out)?;
    let sent = emulation.rig.machine.soc().take_sent();
    let texts = text::of(&sent);
    for text in &texts {
        write_file(&args.out, &text.file_name(), text.lines.as_bytes())?;
    }
    let outcome = Outcome::new(&emulation.rig, &recording, &figures, &args.injected.faults, &log);
    if args.json {
        writeln!(out, "{:#}", outcome.to_json())?;
    } else {
        out.write_all(outcome.text(took).as_bytes())?;
        print_files(&recording, &args.out, out)?;
        for text in &texts {
            writeln!(out, "text  {}", args.out.join(text.file_name()).display())?;
        }
        write!(out, "\n{}", verdict(&recording, &figures))?;
    }
    Ok(figures.any_problems())
}

/// Builds a program of this checkout's `firmware/`, by the name of its package, for a board or the one that it
/// is for by itself; says where its ELF file is.
///
/// # Errors
/// If there is no checkout, or the program cannot be built.
pub fn build_firmware_of(package: &str, board: Option<Board>) -> Result<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    ensure!(
        root.join("firmware").is_dir(),
        "there is no firmware/ here to build: say which ELF file to run"
    );
    let output = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["xtask", "firmware", package])
        .args(board.map(|board| board.name))
        .current_dir(&root)
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo to build the firmware")?;
    ensure!(output.status.success(), "the firmware was not built: the error above says why");
    // It ends with the path.
    match String::from_utf8_lossy(&output.stdout).lines().last() {
        Some(path) => Ok(path.into()),
        None => bail!("cargo xtask firmware does not say what it built"),
    }
}

/// Builds the program in the folder `firmware` of a robot's own repository, by its own settings, for a board or
/// the one that it is for by itself; says where its ELF file is.
///
/// # Errors
/// If there is none, or it cannot be built.
pub fn build_firmware_in(repository: &str, board: Option<Board>) -> Result<PathBuf> {
    let folder = Path::new(repository).join("firmware");
    ensure!(
        folder.is_dir(),
        "there is no {} to build: say which ELF file to run",
        folder.display()
    );
    let features = board.map(|board| ["--no-default-features", "--features", board.name]);
    let output = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["build", "--release", "--message-format=json-render-diagnostics"])
        .args(features.into_iter().flatten())
        .current_dir(&folder)
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo to build the firmware")?;
    if !output.status.success() {
        ensure!(has_target(&folder), "the chip's target is missing: rustup target add {TARGET}");
        bail!("the firmware was not built: the error above says why");
    }
    let messages = String::from_utf8_lossy(&output.stdout);
    let messages =
        messages.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let mut programs = messages.filter_map(|it| Some(PathBuf::from(it["executable"].as_str()?)));
    programs.next_back().with_context(|| format!("{} has no program", folder.display()))
}

/// The chip's target.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Whether the compiler that is used in a folder has the chip's target, or does not say.
fn has_target(folder: &Path) -> bool {
    let ask = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", TARGET])
        .current_dir(folder)
        .output();
    ask.map_or(true, |told| Path::new(String::from_utf8_lossy(&told.stdout).trim()).is_dir())
}

/// SHA-256 over identifier, length and data of all frames in the order of the wire, bus by bus.
#[must_use]
pub fn content_hash(rig: &Rig) -> String {
    let mut hash = Sha256::new();
    for log in rig.logs() {
        for TraceEntry { frame, .. } in &log.frames {
            hash.update(frame.key().to_le_bytes());
            hash.update([frame.len() as u8]);
            hash.update(frame.bytes());
        }
    }
    hex_digits(hash)
}
