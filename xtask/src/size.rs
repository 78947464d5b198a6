//! Flash and RAM of a firmware.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use rc10_emu::Image;

/// Budget of flash, of 1024 KiB.
const FLASH_BUDGET: u32 = 200 * 1024;
/// Budget of statics, of 96 KiB RAM and 16 KiB for DMA buffers. The stack has 32 KiB of its own:
/// memory.x.
const RAM_BUDGET: u32 = 64 * 1024;

/// Prints what the program takes. Fails if it takes more than its budget, or cannot be read.
pub fn run(program: &Path) -> Result<()> {
    let file = fs::read(program).with_context(|| format!("{}", program.display()))?;
    let size = Image::parse(&file)?;
    println!("{}", size.compiler.as_deref().unwrap_or("an unknown compiler"));
    let line = |what, bytes: u32, budget: u32| {
        println!("{what:<6} {bytes:>7} of {budget:>7} bytes, {:>3} %", bytes * 100 / budget);
    };
    line("flash", size.flash, FLASH_BUDGET);
    line("RAM", size.ram, RAM_BUDGET);
    ensure!(size.flash <= FLASH_BUDGET, "the firmware takes too much flash");
    ensure!(size.ram <= RAM_BUDGET, "the firmware takes too much RAM");
    Ok(())
}
