//! How much of the chip a firmware takes.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use object::elf::{FileHeader32, SHF_ALLOC, SHT_NOBITS};
use object::read::elf::{FileHeader, SectionHeader};
use object::{Endianness, elf};

/// What the firmware may take of 1024 KiB flash.
const FLASH_BUDGET: u32 = 64 * 1024;
/// What statics may take of 96 KiB RAM. The stack has 32 KiB of its own: memory.x.
const RAM_BUDGET: u32 = 29 * 1024;

/// What a program takes, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Size {
    /// Code, constants, and the initial values of statics.
    flash: u32,
    /// Statics: initialised, zeroed, and those that a reset keeps.
    ram: u32,
}

/// Prints what the program takes.
///
/// # Errors
/// If it takes more than its budget, or cannot be read.
pub fn run(program: &Path) -> Result<()> {
    let file = fs::read(program).with_context(|| format!("{}", program.display()))?;
    let size = measure(&file)?;
    let line = |what, bytes: u32, budget: u32| {
        println!("{what:<6} {bytes:>7} of {budget:>7} bytes, {:>3} %", bytes * 100 / budget);
    };
    line("flash", size.flash, FLASH_BUDGET);
    line("RAM", size.ram, RAM_BUDGET);
    ensure!(size.flash <= FLASH_BUDGET, "the firmware takes too much flash");
    ensure!(size.ram <= RAM_BUDGET, "the firmware takes too much RAM");
    Ok(())
}

fn measure(file: &[u8]) -> Result<Size> {
    let header = FileHeader32::<Endianness>::parse(file)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, file)?;
    let mut size = Size::default();
    for section in sections.iter() {
        let bytes = section.sh_size(endian);
        if section.sh_flags(endian) & SHF_ALLOC == 0 {
            continue;
        }
        if section.sh_type(endian) != SHT_NOBITS {
            size.flash += bytes;
        }
        // Writable: `.data` is in both, once as itself and once as its initial values.
        if section.sh_flags(endian) & elf::SHF_WRITE != 0 {
            size.ram += bytes;
        }
    }
    Ok(size)
}
