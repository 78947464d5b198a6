//! Test that external memories, which the board does not have, cannot be reached.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::Peripherals;
use cortex_m::peripheral::scb::Exception;

use crate::report::Outcome;
use crate::{say, want};

/// Number of refused accesses.
static REFUSED: AtomicU32 = AtomicU32::new(0);

// SAFETY: cortex-m-rt's vector table asks for the name. It goes on behind the refused instruction,
// of four bytes: pc is the seventh pushed word (ARMv7-M manual, B1.5.6), on Thread mode's stack.
#[unsafe(export_name = "MemoryManagement")]
#[unsafe(naked)]
unsafe extern "C" fn skip() {
    core::arch::naked_asm!(
        "ldr r1, [sp, #24]",
        "adds r1, #4",
        "str r1, [sp, #24]",
        // CFSR: writing ones clears.
        "ldr r0, =0xE000ED28",
        "ldr r1, [r0]",
        "str r1, [r0]",
        "ldr r0, ={REFUSED}",
        "ldr r1, [r0]",
        "adds r1, #1",
        "str r1, [r0]",
        "dsb",
        "bx lr",
        REFUSED = sym REFUSED,
    )
}

/// Whether a word can be read.
fn reads(address: u32) -> bool {
    let before = REFUSED.load(Ordering::Relaxed);
    // SAFETY: reading changes nothing here; without memory the handler above skips this.
    unsafe {
        core::arch::asm!(
            "ldr.w {word}, [{address}]",
            "dsb",
            word = out(reg) _,
            address = in(reg) address,
        );
    }
    REFUSED.load(Ordering::Relaxed) == before
}

/// From `0x6000_0000` to `0xDFFF_FFFF` nothing can be read; elsewhere it can.
pub async fn protection() -> Outcome {
    // SAFETY: nothing else in this program touches the core's own registers.
    let mut core = unsafe { Peripherals::steal() };
    core.SCB.enable(Exception::MemoryManagement);
    // NOR and PSRAM, NAND, OCTOSPI, SDRAM, and the last word.
    for address in [0x6000_0000, 0x8000_0000, 0x9000_0000, 0xC000_0000, 0xDFFF_FFFC] {
        want!(!reads(address), "{address:#010x} can be read");
    }
    // Flash, DTCM, SRAM1, PWR, SCB.
    for address in [0x0800_0000, 0x2000_0000, 0x3000_0000, 0x5802_4800, 0xE000_ED00] {
        want!(reads(address), "{address:#010x} cannot be read");
    }
    Ok(say!("external memories are out of reach"))
}
