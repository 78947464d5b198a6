//! `rc10 emu`: runs the firmware itself, on an emulated chip, in the robot's surroundings.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use std::{env, fs};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_can::Micros;
use rc10_emu::{BusFigures, Fault, Figures, LogLine, Machine, Rig, Spread};
use rc10_motor::dji::FeedbackRate;
use rc10_motor::embassy::BusStatus;
use rc10_motor::{MotorBus, MotorStatus};
use rc10_sim::{Esc, Nanos, TraceEntry};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::figures::motor_table;
use crate::recorder::Recorder;
use crate::recording::Recording;
use crate::robot::{Description, Robot};
use crate::run::seconds;
use crate::surroundings::Surroundings;

/// What `rc10 emu` is told.
#[derive(Args, Debug)]
pub struct EmuArgs {
    /// The program to run; without one the firmware is built first
    pub elf: Option<PathBuf>,
    /// Virtual seconds to run, up to 3600
    #[arg(long, value_name = "S", default_value = "1", value_parser = seconds)]
    pub seconds: Micros,
    /// Seed of everything random in the world: two runs with one seed are the same to the bit
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Million instructions a second that the core executes at its full clock [default: as many as
    /// a Cortex-M4 would]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub mips: Option<u64>,
    /// Something goes wrong: cut:2@0.3s..0.5s short:2@.. dominant:2@.. noise:2@0.3s power:2@..
    /// load:2@.. mask@0.3s..305ms panic@0.3s hardfault@0.3s hang@0.3s; repeat for more
    #[arg(long = "fault", value_name = "FAULT")]
    pub faults: Vec<Fault>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// How many functions are listed.
const TOP_FUNCTIONS: usize = 12;

/// What is different from a plain run.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Seed of the world.
    pub seed: u64,
    /// Instructions a second at the full clock, if not as many as a Cortex-M4 executes.
    pub speed: Option<u64>,
    /// The feedback rate set on all motors, if not the one that the robot expects.
    pub rate: Option<FeedbackRate>,
    /// What goes wrong.
    pub faults: Vec<Fault>,
}

/// A chip in a robot's surroundings, and what the robot's own code on this machine hears on the
/// wires meanwhile.
pub struct Emulation<'r> {
    /// The scenario.
    pub rig: Rig,
    /// The motors, in the order of the description.
    pub motors: Vec<Esc>,
    description: Description,
    base: Option<rc10_sim::Base>,
    seed: u64,
    /// The robot's buses: they only listen.
    listeners: Vec<MotorBus<'r>>,
    heard: Vec<usize>,
}

impl<'r> Emulation<'r> {
    /// Puts a program into a chip, and the chip into the surroundings of a robot.
    ///
    /// # Errors
    /// If the program or the robot's description is none, or a fault concerns a bus that is not
    /// there.
    pub fn new(program: &[u8], robot: Robot<'r>, setup: &Setup) -> Result<Self> {
        let (mut description, listeners) = robot.into_buses()?;
        if let Some(rate) = setup.rate {
            description.motors.iter_mut().for_each(|motor| motor.rate = rate);
        }
        let Surroundings { world, wires, motors, base } =
            Surroundings::new(&description, setup.seed)?;
        ensure!(wires.len() <= 3, "the chip has three buses, the robot {}", wires.len());
        let mut machine = Machine::new(program)?;
        if let Some(speed) = setup.speed {
            machine.set_speed(speed);
        }
        let on_buses = description.motors.iter().zip(&motors);
        let on_buses = on_buses.map(|(motor, esc)| (usize::from(motor.bus) - 1, esc.clone()));
        let heard = vec![0; wires.len()];
        let rig = Rig::new(machine, world, wires, on_buses.collect(), &setup.faults)?;
        let seed = setup.seed;
        Ok(Self { rig, motors, description, base, seed, listeners, heard })
    }

    /// Lets everything go on up to a time since power-on.
    ///
    /// # Errors
    /// As [`Rig::run`].
    pub fn run(&mut self, until: Nanos) -> Result<()> {
        self.rig.run(until)
    }

    /// What is new on the wires since the last call, bus by bus; the listeners have heard it.
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
        news
    }

    /// Runs up to a time and writes down what the wires and the motors do.
    ///
    /// # Errors
    /// As [`Rig::run`].
    pub fn record(mut self, length: Micros) -> Result<(Self, Recording)> {
        let description = self.description.clone();
        let mut recorder = Recorder::new(&description, self.seed);
        let mut now = Micros::ZERO;
        while now < length {
            now = Recorder::next_sample(now, length);
            self.run(now.into())?;
            for (bus, entries) in self.listen().iter().enumerate() {
                recorder.frames(bus, entries);
            }
            recorder.sample(&self.motors, self.base.as_ref(), |line| self.status(line, now));
        }
        let recording = recorder.finish(
            length,
            self.rig.buses(),
            &self.motors,
            |line| self.status(line, now),
            |number| {
                let mut status = BusStatus::default();
                if let Some(bus) = self.listeners.get(usize::from(number) - 1) {
                    status.received = bus.counters();
                    status.load = bus.load(1_000_000);
                }
                status
            },
        );
        Ok((self, recording))
    }

    /// What is heard of a motor.
    fn status(&self, line: usize, now: Micros) -> MotorStatus {
        let found = self.description.place(line).and_then(|(bus, motor)| {
            self.listeners.get(bus).and_then(|listener| listener.status(motor, now))
        });
        found.unwrap_or(MotorStatus::NEW)
    }
}

/// Runs a program, prints the figures.
///
/// # Errors
/// If there is no program, it is none, or its core locks up.
pub fn emulate(args: &EmuArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let path = match &args.elf {
        Some(path) => path.clone(),
        None => build()?,
    };
    let program = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let setup = Setup {
        seed: args.seed,
        speed: args.mips.map(|mips| mips * 1_000_000),
        rate: None,
        faults: args.faults.clone(),
    };
    let started = Instant::now();
    let emulation =
        Emulation::new(&program, robot, &setup).with_context(|| format!("{}", path.display()))?;
    let (mut emulation, recording) = emulation.record(args.seconds)?;
    let wall = started.elapsed().as_secs_f64();
    let figures = Figures::of(&emulation.rig);
    let log = emulation.rig.machine.take_log();
    if args.json {
        writeln!(out, "{:#}", to_json(&emulation.rig, &figures, &recording, &log))?;
    } else {
        let mut text = String::new();
        print(&mut text, &emulation.rig, &figures, &recording, &log, wall)?;
        out.write_all(text.as_bytes())?;
    }
    Ok(())
}

/// Builds the firmware of the checkout; says where its ELF file is.
fn build() -> Result<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    ensure!(
        root.join("firmware").is_dir(),
        "there is no firmware/ here to build: say which ELF file to run"
    );
    let output = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["xtask", "firmware"])
        .current_dir(&root)
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo to build the firmware")?;
    ensure!(output.status.success(), "the firmware cannot be built: cargo xtask setup first?");
    // It ends with the path.
    match String::from_utf8_lossy(&output.stdout).lines().last() {
        Some(path) => Ok(path.into()),
        None => bail!("cargo xtask firmware does not say what it built"),
    }
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
    hash.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn micros(time: Nanos) -> f64 {
    time.get() as f64 * 1e-3
}

/// How often `part` fits into `all`; `None` where there is nothing to divide by.
fn ratio(all: u64, part: u64) -> Option<u64> {
    all.checked_div(part)
}

fn to_json(rig: &Rig, figures: &Figures, recording: &Recording, log: &[LogLine]) -> Value {
    let spread = |bus: &BusFigures| {
        bus.tick_period.map(|period| {
            json!({
                "min": micros(period.min),
                "mean": micros(period.mean),
                "max": micros(period.max),
            })
        })
    };
    let buses = figures.buses.iter().zip(1..).map(|(bus, number)| {
        json!({
            "bus": number,
            "frames": bus.frames,
            "sent": bus.sent,
            "received": bus.received,
            "rx_lost": bus.lost,
            "foreign": bus.foreign,
            "failed": bus.failed,
            "bus_offs": bus.bus_offs,
            "load_percent": bus.load,
            "tick_period_us": spread(bus),
        })
    });
    let profile = rig.machine.profile();
    let functions = profile.by_function(rig.machine.image());
    let all_periods = figures.buses.iter().filter_map(|bus| bus.tick_period);
    let worst = all_periods.clone().map(|period| micros(period.max)).fold(0.0, f64::max);
    let least = all_periods.clone().map(|period| micros(period.min)).fold(f64::MAX, f64::min);
    let count: u64 = all_periods.clone().map(|period| period.count).sum();
    let sum: f64 = all_periods.map(|period| micros(period.mean) * period.count as f64).sum();
    let period =
        (count > 0).then(|| json!({ "min": least, "mean": sum / count as f64, "max": worst }));
    json!({
        "seed": recording.seed,
        "virtual_seconds": figures.length.get() as f64 * 1e-9,
        "frames": figures.buses.iter().map(|bus| bus.frames).sum::<u64>(),
        "content_hash": content_hash(rig),
        "rx_lost": figures.lost(),
        "tick_period_us": period,
        "boot_us": figures.boot.map(micros),
        "instructions": figures.instructions,
        "instructions_per_tick": ratio(figures.instructions, figures.ticks()),
        "instructions_per_received_frame": ratio(figures.instructions, figures.received()),
        "stack_bytes": figures.stack_bytes,
        "static_ram_bytes": rig.machine.image().ram,
        "flash_bytes": rig.machine.image().flash,
        "unowned_accesses": figures.unowned_accesses,
        "gated_accesses": figures.gated_accesses,
        "restarts": rig.machine.restarts().iter().map(|restart| json!({
            "at_us": micros(restart.at),
            "cause": format!("{:?}", restart.cause),
        })).collect::<Vec<_>>(),
        "buses": buses.collect::<Vec<_>>(),
        "motors": recording.motors.iter().map(|track| json!({
            "motor": track.motor.label,
            "bus": track.motor.bus,
            "link": format!("{:?}", track.last.link),
            "rpm": track.samples.last().map(|sample| sample.rpm),
            "received": track.last.counters.received,
            "malformed": track.last.counters.malformed,
            "feedback_overwritten": track.overwritten,
        })).collect::<Vec<_>>(),
        "functions": functions.iter().take(TOP_FUNCTIONS).map(|(name, instructions)| json!({
            "function": name,
            "instructions": instructions,
        })).collect::<Vec<_>>(),
        "log": log.iter().map(|line| json!({
            "at_us": micros(line.at),
            "text": line.text,
        })).collect::<Vec<_>>(),
    })
}

fn print(
    text: &mut String,
    rig: &Rig,
    figures: &Figures,
    recording: &Recording,
    log: &[LogLine],
    wall: f64,
) -> std::fmt::Result {
    let machine = &rig.machine;
    let seconds = figures.length.get() as f64 * 1e-9;
    for line in log {
        writeln!(text, "{:>10.3} ms  {}", micros(line.at) * 1e-3, line.text)?;
    }
    for report in machine.reports() {
        writeln!(text, "{:>10.3} ms  {}", micros(report.at) * 1e-3, report.text)?;
    }
    for restart in machine.restarts() {
        let at = micros(restart.at) * 1e-3;
        writeln!(text, "{at:>10.3} ms  the chip restarted: {:?}", restart.cause)?;
    }
    writeln!(
        text,
        "\n{seconds:.3} s on the emulated chip in {wall:.1} s, seed {}\n",
        recording.seed
    )?;
    writeln!(text, "{}", motor_table(recording))?;
    writeln!(
        text,
        "{:<5} {:>8} {:>8} {:>8} {:>9} {:>6} {:>8} {:>8} {:>8}  {:<30}",
        "bus",
        "load %",
        "frames",
        "sent",
        "received",
        "lost",
        "foreign",
        "failed",
        "bus-offs",
        "tick period us"
    )?;
    for (bus, number) in figures.buses.iter().zip(1..) {
        let period = bus.tick_period.map_or("-".into(), |period| {
            let Spread { min, mean, max, .. } = period;
            format!("{:.2} / {:.2} / {:.2}", micros(min), micros(mean), micros(max))
        });
        writeln!(
            text,
            "{number:<5} {:>8.1} {:>8} {:>8} {:>9} {:>6} {:>8} {:>8} {:>8}  {period}",
            bus.load,
            bus.frames,
            bus.sent,
            bus.received,
            bus.lost,
            bus.foreign,
            bus.failed,
            bus.bus_offs,
        )?;
    }
    let per = |part: u64| ratio(figures.instructions, part).map_or("-".into(), |n| n.to_string());
    writeln!(text)?;
    if let Some(boot) = figures.boot {
        writeln!(
            text,
            "boot           {:.1} us from the end of clock start to the first frames",
            micros(boot)
        )?;
    }
    writeln!(
        text,
        "instructions   {} ({:.2} million a second), {} a tick, {} a received frame",
        figures.instructions,
        figures.instructions as f64 * 1e-6 / seconds,
        per(figures.ticks()),
        per(figures.received()),
    )?;
    writeln!(
        text,
        "memory         stack {} + static {} bytes of RAM, {} bytes of flash",
        figures.stack_bytes,
        machine.image().ram,
        machine.image().flash
    )?;
    writeln!(
        text,
        "bad accesses   {} unowned, {} without a clock",
        figures.unowned_accesses, figures.gated_accesses
    )?;
    writeln!(text, "content        {}\n", content_hash(rig))?;
    let share = |instructions: u64| instructions as f64 * 100.0 / figures.instructions as f64;
    writeln!(text, "{:>12} {:>6} {:>10}  exception", "instructions", "%", "entries")?;
    for cost in machine.profile().by_exception() {
        let name = match cost.exception.checked_sub(16) {
            Some(interrupt) => format!("interrupt {interrupt} ({})", handler(rig, cost.exception)),
            None if cost.exception == 0 => "thread mode".into(),
            None => format!("exception {}", cost.exception),
        };
        let share = share(cost.instructions);
        writeln!(text, "{:>12} {share:>6.1} {:>10}  {name}", cost.instructions, cost.entries)?;
    }
    writeln!(text, "\n{:>12} {:>6}  function", "instructions", "%")?;
    for (name, instructions) in
        machine.profile().by_function(machine.image()).into_iter().take(TOP_FUNCTIONS)
    {
        writeln!(text, "{instructions:>12} {:>6.1}  {name}", share(instructions))?;
    }
    Ok(())
}

/// The function that handles an exception.
fn handler(rig: &Rig, exception: u16) -> &str {
    let vector = rc10_emu::memory::FLASH + 4 * u32::from(exception);
    let address = rig.machine.memory().word(vector).unwrap_or(0) & !1;
    rig.machine.image().function_at(address).map_or("?", |(_, name)| name)
}
