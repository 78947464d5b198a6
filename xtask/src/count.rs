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
use object::elf::{FileHeader32, PT_LOAD, SHT_SYMTAB, STT_FUNC};
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
    println!("{:<32}{:>8}{:>8}{:>8}{:>10}", "instructions", "calls", "mean", "worst", "per unit");
    for one in &measurements {
        let mean = one.sum / one.calls;
        println!("{:<32}{:>8}{mean:>8}{:>8}{:>10}", one.name, one.calls, one.worst, one.each());
    }
    let budgeted = measurements.iter().filter(|one| one.name.starts_with(BUDGETED));
    let above: Vec<_> = budgeted.filter(|one| one.each() > MOTOR_BUDGET).collect();
    for measurement in &above {
        program.explain(measurement);
    }
    let names: Vec<_> = above.iter().map(|one| one.name.as_str()).collect();
    ensure!(names.is_empty(), "above {MOTOR_BUDGET} instructions per unit: {}", names.join(", "));
    Ok(())
}

/// What the ELF file says.
struct Program {
    /// Physical address and bytes.
    segments: Vec<(u32, Vec<u8>)>,
    /// Every function by its address.
    functions: BTreeMap<u32, String>,
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
        let symbols = sections.symbols(endian, file, SHT_SYMTAB)?;
        let mut functions = BTreeMap::new();
        let mut measured = BTreeMap::new();
        let mut done = None;
        for symbol in symbols.iter().filter(|symbol| symbol.st_type() == STT_FUNC) {
            let name = std::str::from_utf8(symbol.name(endian, symbols.strings())?)?;
            // The lowest bit says "Thumb code".
            let address = symbol.st_value(endian) & !1;
            functions.insert(address, format!("{:#}", rustc_demangle::demangle(name)));
            match name.strip_prefix("count_").map(|name| name.split_once('_').unwrap_or((name, "")))
            {
                None => {}
                Some(("done", _)) => done = Some(address),
                Some((units, title)) => {
                    let units = units.parse().with_context(|| name.to_owned())?;
                    ensure!(units > 0, "{name} measures no units");
                    measured.insert(address, (title.replace('_', " "), units));
                }
            }
        }
        let done = done.context("the program has no count_done")?;
        Ok(Self { segments, functions, measured, done })
    }

    fn run(&self) -> Result<Vec<Measurement>> {
        let core = self.load()?;
        let mut results: BTreeMap<u32, Measurement> = BTreeMap::new();
        // The call being measured: its entry, where it returns to, and what it took so far.
        let mut call: Option<(u32, u32, u64)> = None;
        for _ in 0..INSTRUCTION_LIMIT {
            let at = core.pc() & !1;
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
                return Ok(named.collect());
            }
            if call.is_none() && self.measured.contains_key(&at) {
                call = Some((at, core.reg(14) & !1, 0));
            }
            if let Some((entry, _, taken)) = &mut call {
                *taken += 1;
                let function = self.functions.range(..=at).next_back().map_or(0, |found| *found.0);
                *results.entry(*entry).or_default().functions.entry(function).or_default() += 1;
            }
            ensure!(core.step() > 0 && !core.is_locked_up(), "the core stopped at {at:#010x}");
            ensure!(core.current_exception() == Exception::THREAD, "a fault at {at:#010x}");
        }
        bail!("the program did not reach count_done")
    }

    /// A Cortex-M7 with the program in its memory, after its reset.
    fn load(&self) -> Result<ArmV7m> {
        let space = AddressSpace::new("cpu", 32);
        for (name, (base, length)) in [("flash", FLASH), ("dtcm", DTCM)] {
            let memory = Arc::new(RamStore::new(length));
            for (address, bytes) in &self.segments {
                let offset = u64::from(address.wrapping_sub(base));
                if offset < length {
                    let written = memory.write_at(offset, bytes);
                    ensure!(written.is_ok(), "a segment does not fit into {name}");
                }
            }
            let mapped = space.topology().map(Region::ram(name, memory), u64::from(base));
            ensure!(mapped.is_ok(), "{name} cannot be mapped");
        }
        let mut config = Config::CORTEX_M7F;
        config.reset_vtor = FLASH.0;
        let core = ArmV7m::new(config);
        core.attach_space(Arc::new(space));
        core.step();
        Ok(core)
    }

    /// Prints where the instructions went.
    fn explain(&self, measurement: &Measurement) {
        println!("\n{}: where the instructions go, per call", measurement.name);
        let mut functions: Vec<_> = measurement.functions.iter().collect();
        functions.sort_by_key(|(_, instructions)| std::cmp::Reverse(**instructions));
        for (address, instructions) in functions.into_iter().take(8) {
            let name = self.functions.get(address).map_or("?", String::as_str);
            println!("{:>8}  {name}", instructions / measurement.calls);
        }
    }
}
