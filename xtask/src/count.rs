//! Counts the instructions of what runs every millisecond, on an interpreter of the chip's core.
//!
//! firmware/count is a bare program. Every function in it whose symbol is `count_<units>_<name>` is
//! a measurement: from each call to its return the instructions are counted, and reported per
//! call and per unit. The program calls them as often as it likes and ends in `count_done`.
//!
//! Instructions, not cycles: the same on every machine, and so a budget that can be kept. A
//! Cortex-M7 does up to two of them in a cycle.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use object::Endianness;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader, Sym};
use rsemu::core::space::{AddressSpace, RamStore, Region};
use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::{ArmV7m, Config};

/// Instructions that one motor may cost in one tick: a received frame, a cascade, its share of a
/// group frame.
const MOTOR_BUDGET: u64 = 260;
/// The measurements that this budget is for start so.
const BUDGETED: &str = "motor";

/// Where memory is, and how much: memory.x.
const FLASH: (u32, u64) = (0x0800_0000, 1 << 20);
const DTCM: (u32, u64) = (0x2000_0000, 128 << 10);

/// A program that takes longer than this has lost its way.
const INSTRUCTION_LIMIT: u64 = 50_000_000;

/// What the calls of one function cost, in instructions.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Measurement {
    name: String,
    units: u64,
    calls: u64,
    sum: u64,
    max: u64,
}

/// Runs the program and prints what it measured.
///
/// # Errors
/// If something is above its budget, or nothing was measured, or the program went astray.
pub fn run(program: &Path) -> Result<()> {
    let file = fs::read(program).with_context(|| format!("{}", program.display()))?;
    let program = Program::parse(&file)?;
    let measurements = program.run()?;
    ensure!(!measurements.is_empty(), "the program calls nothing that is named count_*");
    println!("{:<44}{:>8}{:>10}{:>10}{:>10}", "instructions", "calls", "mean", "worst", "per unit");
    let mut above = Vec::new();
    for measurement in &measurements {
        let Measurement { name, units, calls, sum, max } = measurement;
        // Rounded up: a budget is a limit.
        let each = max.div_ceil(*units);
        println!("{name:<44}{calls:>8}{:>10}{max:>10}{each:>10}", sum / calls);
        if name.starts_with(BUDGETED) && each > MOTOR_BUDGET {
            above.push(format!("{name}: {each}"));
        }
    }
    ensure!(above.is_empty(), "above {MOTOR_BUDGET} instructions a motor: {}", above.join(", "));
    Ok(())
}

/// What the ELF file says.
struct Program {
    /// Physical address and bytes.
    segments: Vec<(u32, Vec<u8>)>,
    /// Entry address of every function to measure: name and units.
    measured: BTreeMap<u32, (String, u64)>,
    done: u32,
}

impl Program {
    fn parse(file: &[u8]) -> Result<Self> {
        let header = FileHeader32::<Endianness>::parse(file)?;
        let endian = header.endian()?;
        let mut segments = Vec::new();
        for segment in header.program_headers(endian, file)? {
            if segment.p_type(endian) == PT_LOAD {
                let bytes = segment.data(endian, file).ok().context("a segment is cut short")?;
                segments.push((segment.p_paddr(endian), bytes.to_vec()));
            }
        }
        let sections = header.sections(endian, file)?;
        let symbols = sections.symbols(endian, file, object::elf::SHT_SYMTAB)?;
        let mut measured = BTreeMap::new();
        let mut done = None;
        for symbol in symbols.iter() {
            let name = symbol.name(endian, symbols.strings())?;
            // The lowest bit says "Thumb code".
            let address = symbol.st_value(endian) & !1;
            let Some(name) = std::str::from_utf8(name)?.strip_prefix("count_") else {
                continue;
            };
            if name == "done" {
                done = Some(address);
            } else if let Some((units, name)) = name.split_once('_') {
                let units = units.parse().with_context(|| format!("count_{units}_{name}"))?;
                ensure!(units > 0, "count_{units}_{name} measures no units");
                measured.insert(address, (name.replace('_', " "), units));
            }
        }
        Ok(Self { segments, measured, done: done.context("the program has no count_done")? })
    }

    fn run(&self) -> Result<Vec<Measurement>> {
        let core = self.load()?;
        let mut results: BTreeMap<u32, Measurement> = BTreeMap::new();
        // The function being measured: its entry, where it returns to, and when it was called.
        let mut inside: Option<(u32, u32, u64)> = None;
        for executed in 0..INSTRUCTION_LIMIT {
            let at = core.pc() & !1;
            if let Some((entry, back, called)) = inside
                && at == back
            {
                let (name, units) = &self.measured[&entry];
                let result = results.entry(entry).or_insert_with(|| Measurement {
                    name: name.clone(),
                    units: *units,
                    calls: 0,
                    sum: 0,
                    max: 0,
                });
                result.calls += 1;
                result.sum += executed - called;
                result.max = result.max.max(executed - called);
                inside = None;
            }
            if at == self.done {
                let mut results: Vec<_> = results.into_values().collect();
                results.sort_by(|one, other| one.name.cmp(&other.name));
                return Ok(results);
            }
            if inside.is_none() && self.measured.contains_key(&at) {
                inside = Some((at, core.reg(14) & !1, executed));
            }
            ensure!(core.step() > 0 && !core.is_locked_up(), "the core stopped at {at:#010x}");
            ensure!(core.current_exception() == Exception::THREAD, "a fault at {at:#010x}");
        }
        bail!("the program did not reach count_done")
    }

    fn load(&self) -> Result<ArmV7m> {
        let space = AddressSpace::new("cpu", 32);
        for (name, (base, length)) in [("flash", FLASH), ("dtcm", DTCM)] {
            let memory = Arc::new(RamStore::new(length));
            for (address, bytes) in &self.segments {
                if let Some(offset) = address.checked_sub(base)
                    && u64::from(offset) < length
                {
                    memory
                        .write_at(u64::from(offset), bytes)
                        .map_err(|error| anyhow::anyhow!("{error:?}"))?;
                }
            }
            let region = Region::ram(name, memory);
            space
                .topology()
                .map(region, u64::from(base))
                .map_err(|error| anyhow::anyhow!("{error:?}"))?;
        }
        let mut config = Config::CORTEX_M7F;
        config.reset_vtor = FLASH.0;
        let core = ArmV7m::new(config);
        core.attach_space(Arc::new(space));
        core.step(); // the reset
        Ok(core)
    }
}
