//! Counts the instructions of code that runs every millisecond, on an interpreter of the core.
//!
//! firmware/count is a bare program. Every function in it whose symbol is `count_<units>_<name>` is
//! a measurement: from each call to its return the instructions are counted, and reported per
//! call and per unit. The program calls them as often as it likes and ends in `count_done`.
//!
//! It also takes the walks through rc10-app: this PC takes them too, and both must see the same bits.
//!
//! Instructions, not cycles: the same on every machine, and so a budget that can be kept. A
//! Cortex-M7 does up to two of them in a cycle.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use rc10_emu::core::{Step, bare};
use rc10_emu::{Image, Memory};

#[path = "../../crates/rc10-app/tests/walk/mod.rs"]
mod walk;

/// Budgets: the beginning of a measurement's name, the instructions that a unit of it may cost at
/// most, and whether that goes for the mean of all calls or for the worst one.
const BUDGETS: &[(&str, u64, Of)] = &[
    // A step of a PID controller: proportional and integral part, deadband, limits, anti-windup.
    ("pid plain", 60, Of::Worst),
    // With filtered derivative and weighted setpoint.
    ("pid whole", 75, Of::Mean),
    // At its limit, with back-calculation.
    ("limited pid", 150, Of::Worst),
    // One motor in one tick: a received frame, a cascade, its share of a group frame.
    ("motor", 400, Of::Mean),
    // Angle loops run in other ticks for each motor of a bus.
    ("motor", 420, Of::Worst),
    // Wheel speeds of a base on four wheels, limited where they have to be.
    ("base", 80, Of::Worst),
    // Four steered wheels.
    ("swerve", 1200, Of::Worst),
    // A step of odometry, with a gyro, slip and all.
    ("odometry", 200, Of::Worst),
    // Torques within a limit of power, for each of four motors; a step of the limiter that learns, and a reading.
    ("allocate", 60, Of::Worst),
    ("limiter", 1_000, Of::Worst),
    // A tick of a base on four wheels that follows its path.
    ("path", 1_000, Of::Worst),
    // What one tick does of a plan.
    ("plan portion", 20_000, Of::Worst),
    // A frame packed or unpacked.
    ("codec", 150, Of::Worst),
    // The same with a CRC in software.
    ("crc", 300, Of::Worst),
    // One byte of good frames on a serial line.
    ("stream", 60, Of::Worst),
    // One byte of noise there.
    ("noise", 60, Of::Worst),
    // One byte of what takes a parser longest: the beginning of a frame, again and again. Every one
    // is a frame until its checksum says otherwise, so this bounds what garbage can do.
    ("garbage", 750, Of::Worst),
    // A tick of a motion profile on its way.
    ("follow", 400, Of::Worst),
    // A new target for one, at any state.
    ("plan target", 4000, Of::Worst),
    ("plan moving target", 4000, Of::Worst),
    ("plan angle", 4000, Of::Worst),
    ("plan velocity", 4000, Of::Worst),
];

/// The value that a budget bounds.
#[derive(Clone, Copy, Debug)]
enum Of {
    Mean,
    Worst,
}

/// A program that takes longer than this has lost its way.
const INSTRUCTION_LIMIT: u64 = 500_000_000;

/// Cost of the calls of one function, in instructions.
#[derive(Clone, Debug, Default)]
struct Measurement {
    name: String,
    units: u64,
    calls: u64,
    sum: u64,
    worst: u64,
    /// Of `sum`, how much each function of the program took, by its address.
    functions: BTreeMap<u32, u64>,
}

impl Measurement {
    /// Mean per call and unit; rounded up, for a budget is a limit.
    fn each(&self) -> u64 {
        self.sum.div_ceil(self.calls * self.units)
    }

    fn budgets(&self) -> impl Iterator<Item = &(&str, u64, Of)> {
        BUDGETS.iter().filter(|(start, ..)| self.name.starts_with(start))
    }

    /// The budget that it is above, if so.
    fn broken_budget(&self) -> Option<u64> {
        let is_broken = |(_, budget, of): &&(&str, u64, Of)| {
            *budget
                < match of {
                    Of::Mean => self.each(),
                    Of::Worst => self.worst.div_ceil(self.units),
                }
        };
        self.budgets().find(is_broken).map(|(_, budget, _)| *budget)
    }
}

/// Runs the program and prints what it measured. Fails if something is above its budget, or nothing
/// was measured, or the program went astray.
pub fn run(program: &Path) -> Result<()> {
    let file = fs::read(program).with_context(|| format!("{}", program.display()))?;
    let program = Program::parse(&file)?;
    let Ran { measurements, walked } = program.run()?;
    ensure!(!measurements.is_empty(), "the program calls nothing that is named count_*");
    println!(
        "{:<32}{:>8}{:>8}{:>8}{:>10}  budget",
        "instructions", "calls", "mean", "worst", "per unit"
    );
    for one in &measurements {
        let (mean, worst, each) = (one.sum / one.calls, one.worst, one.each());
        print!("{:<32}{:>8}{mean:>8}{worst:>8}{each:>10}", one.name, one.calls);
        one.budgets().for_each(|(_, budget, of)| print!("  {budget} {of:?}"));
        println!();
    }
    let mut complaints = Vec::new();
    for measurement in &measurements {
        if let Some(budget) = measurement.broken_budget() {
            program.explain(measurement);
            complaints.push(format!("{} (at most {budget} per unit)", measurement.name));
        }
    }
    ensure!(complaints.is_empty(), "too many instructions: {}", complaints.join(", "));
    same_walks(&walked)
}

/// Fails if the chip saw other bits than this PC does.
fn same_walks(walked: &[(u32, u64)]) -> Result<()> {
    ensure!(walked.len() == walk::WALKS.len(), "{} walks were taken", walked.len());
    for (&(name, walk), (_, chip)) in walk::WALKS.iter().zip(walked) {
        let pc = walk::hash(walk);
        ensure!(pc == *chip, "rc10-app, {name}: the chip computes {chip:016x}, this PC {pc:016x}");
        println!("rc10-app, {name}: chip and PC compute the same bits, {pc:016x}");
    }
    Ok(())
}

/// The results of a run of the program.
struct Ran {
    measurements: Vec<Measurement>,
    /// The numbers of the walks, and their hashes.
    walked: Vec<(u32, u64)>,
}

/// The program, and what in it is to be measured.
struct Program {
    image: Image,
    /// Entry address of every function to measure: name and units.
    measured: BTreeMap<u32, (String, u64)>,
    done: u32,
    walked: u32,
}

impl Program {
    fn parse(file: &[u8]) -> Result<Self> {
        let image = Image::parse(file)?;
        let mut measured = BTreeMap::new();
        for (&address, name) in &image.functions {
            let Some(name) = name.strip_prefix("count_").filter(|name| *name != "done") else {
                continue;
            };
            let (units, title) = name.split_once('_').unwrap_or((name, ""));
            let units = units.parse().with_context(|| name.to_owned())?;
            ensure!(units > 0, "{name} measures no units");
            measured.insert(address, (title.replace('_', " "), units));
        }
        let done = image.symbol("count_done")? & !1;
        let walked = image.symbol("walked")? & !1;
        Ok(Self { image, measured, done, walked })
    }

    fn run(&self) -> Result<Ran> {
        let mut core = bare(&Memory::with(&self.image, 1)?);
        let mut results: BTreeMap<u32, Measurement> = BTreeMap::new();
        // The call being measured: its entry, its return address, and its instructions so far.
        let mut call: Option<(u32, u32, u64)> = None;
        let mut walked = Vec::new();
        for _ in 0..INSTRUCTION_LIMIT {
            let at = core.program_counter();
            if let Some((entry, back, taken)) = call
                && at == back
            {
                let result = results.entry(entry).or_default();
                result.calls += 1;
                result.sum += taken;
                result.worst = result.worst.max(taken);
                call = None;
            }
            if at == self.done {
                let named = results.into_iter().map(|(entry, result)| {
                    let (name, units) = self.measured[&entry].clone();
                    Measurement { name, units, ..result }
                });
                return Ok(Ran { measurements: named.collect(), walked });
            }
            if at == self.walked {
                let [number, high, low, ..] = core.registers();
                walked.push((number, u64::from(high) << 32 | u64::from(low)));
            }
            if call.is_none() && self.measured.contains_key(&at) {
                call = Some((at, core.registers()[14] & !1, 0));
            }
            if let Some((entry, _, taken)) = &mut call {
                *taken += 1;
                let function = self.image.function_at(at).map_or(0, |(start, _)| start);
                *results.entry(*entry).or_default().functions.entry(function).or_default() += 1;
            }
            ensure!(core.step().0 == Step::Instruction, "a fault at {at:#010x}");
        }
        bail!("the program did not reach count_done")
    }

    /// Prints where the instructions went.
    fn explain(&self, measurement: &Measurement) {
        println!("\n{}: where the instructions go, per call", measurement.name);
        let mut functions: Vec<_> = measurement.functions.iter().collect();
        functions.sort_by_key(|(_, instructions)| std::cmp::Reverse(**instructions));
        for (address, instructions) in functions.into_iter().take(8) {
            let name = self.image.functions.get(address).map_or("?", String::as_str);
            println!("{:>8}  {name}", instructions / measurement.calls);
        }
    }
}
