//! All memory that a DMA reads or writes lies where a DMA reaches: by the symbols of the chip's
//! programs.
//!
//! That no transfer goes elsewhere is looked at while they run: the emulated DMA refuses what it does
//! not reach and reports it, and every scenario wants no report.

use std::ops::Range;

use rc10_emu::Image;

use super::program;

/// SRAM1, as memory.x has it.
const SRAM1: Range<u32> = 0x3000_0000..0x3000_4000;
/// The name that `rc10_bsp::dma_buffer!` gives its memory.
const BUFFER: &str = "::DMA_BUFFER";

/// Number of buffers of a program, and their bytes.
fn judge(program: &[u8]) -> Result<(usize, u32), String> {
    let image = Image::parse(program).unwrap();
    let buffers: Vec<_> =
        image.statics.iter().filter(|buffer| buffer.name.ends_with(BUFFER)).collect();
    for buffer in &buffers {
        let end = buffer.address + buffer.bytes;
        if buffer.address < SRAM1.start || end > SRAM1.end {
            let (name, start) = (&buffer.name, buffer.address);
            return Err(format!("{name} is at {start:#010x} .. {end:#010x}"));
        }
    }
    let section = image.sections.get(".sram1").cloned().unwrap_or(0..0);
    // Each begins at a word.
    let bytes = buffers.iter().map(|buffer| buffer.bytes.next_multiple_of(4)).sum();
    if section.len() != bytes as usize {
        return Err(format!("{bytes} bytes of buffers in a section {section:#010x?}"));
    }
    Ok((buffers.len(), bytes))
}

#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn every_dma_buffer_lies_in_sram1() {
    for (name, at_least) in [("team-firmware", 4), ("selftest", 11)] {
        let (buffers, bytes) = judge(&program(name)).unwrap();
        println!("{name}: {buffers} DMA buffers, {bytes} bytes");
        assert!(buffers >= at_least, "{name}: {buffers}");
    }
}

/// One that is somewhere else is found.
#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn a_buffer_in_dtcm_is_found() {
    let mut program = program("selftest");
    let buffer = Image::parse(&program).unwrap().statics;
    let buffer = buffer.into_iter().find(|buffer| buffer.name.ends_with(BUFFER)).unwrap();
    // Its symbol: value, then size.
    let symbol = [buffer.address.to_le_bytes(), buffer.bytes.to_le_bytes()];
    let at = program.windows(8).rposition(|bytes| bytes == symbol.as_flattened()).unwrap();
    program[at..at + 4].copy_from_slice(&0x2000_8000_u32.to_le_bytes());
    let error = judge(&program).unwrap_err();
    assert!(error.contains("is at 0x20008000"), "{error}");
}
