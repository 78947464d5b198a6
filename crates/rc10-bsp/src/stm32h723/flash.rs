//! The flash that is kept free for parameters: sectors 6 and 7 of `memory.x`, in words of 256 bits.
//!
//! * **A word whose programming was cut** has a code that fits nothing: reading it is a bus fault, at each start anew,
//!   also with the flash's interrupt off. [`read`] reads with `FAULTMASK` and `BFHFNMIGN` set, so that the core goes on,
//!   and returns `None` if `DBECCERR` says so.
//! * **One bank**: while a word is programmed, 100 to 200 µs, or a sector is erased, 1 to 2 s, each fetch from the flash
//!   waits. DMAs and the CAN controllers go on. So [`program`] belongs between two ticks, and [`erase`] before the
//!   watchdog runs and motors are driven.
//! * **The status is cleared by `CCR` alone**: `SR` is read-only. Before each operation, so that an old flag is not
//!   taken for an error of this one.
//! * **64 bits at once** (`PSIZE` 3), each time: with what embassy-stm32 0.6.0 leaves there the next erase takes 2 to 4 s.
//!
//! embassy-stm32's own driver has all four wrong (`flash/h7.rs`: it clears `SR`, leaves `PSIZE` 0, reads without a guard,
//! touches a second bank). Nothing of it is used here but the register's names.
//!
//! All of these return with the interface locked. They are for one task: two at once would mix their words.

use core::ops::Range;

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use embassy_stm32::pac::flash::regs::{Ccr, Cr};

use super::{CORE_CLOCK, cycle_count};

/// Bytes of a word, which is programmed at once.
pub const WORD: usize = 32;
/// Words of a sector.
pub const WORDS: u32 = 128 * 1024 / 32;
/// The numbers of the sectors.
pub const SECTORS: Range<u8> = 6..8;

const FLASH: usize = 0x0800_0000;
/// All 64 bits at once: the fastest, at our supply of 3.3 V.
const X64: u8 = 3;
/// More than the longest of the data sheet, µs: what takes longer has failed.
const PROGRAMMED: u32 = 2_000;
const ERASED: u32 = 5_000_000;

/// An operation did not end well: the word or sector is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FlashError;

fn bank() -> pac::flash::Bank {
    pac::FLASH.bank(0)
}

/// The address of a word of a sector, counted from 0 in each; `None` if there is none.
fn place(sector: u8, word: u32) -> Option<*mut u32> {
    let is_there = SECTORS.contains(&(SECTORS.start + sector)) && word < WORDS;
    let sector = (usize::from(SECTORS.start) + usize::from(sector)) * WORDS as usize;
    is_there.then_some((FLASH + (sector + word as usize) * WORD) as *mut u32)
}

/// Reads a word; `None` if its code does not fit, or it does not exist.
#[must_use]
pub fn read(sector: u8, word: u32) -> Option<[u8; WORD]> {
    let address = place(sector, word)?;
    let (words, is_torn) = guarded(|| load(address));
    let mut bytes = [0; WORD];
    for (four, word) in bytes.chunks_exact_mut(4).zip(words) {
        four.copy_from_slice(&word.to_le_bytes());
    }
    (!is_torn).then_some(bytes)
}

/// The first word behind all whose first 32 bits do not read as erased. For the start: no interrupt is served for some
/// 1 ms.
#[must_use]
pub fn free(sector: u8) -> u32 {
    let is_erased = |word: &u32| {
        let Some(address) = place(sector, *word) else { return true };
        // SAFETY: a word of the flash begins there.
        let first = unsafe { address.read_volatile() };
        first == u32::MAX && !bank().sr().read().dbeccerr()
    };
    let (last, _) = guarded(|| (0..WORDS).rev().find(|word| !is_erased(word)));
    last.map_or(0, |word| word + 1)
}

#[inline]
fn load(address: *mut u32) -> [u32; WORD / 4] {
    // SAFETY: `place` has said that a word of the flash begins there.
    core::array::from_fn(|at| unsafe { address.add(at).read_volatile() })
}

/// Reads so that the core goes on at a word whose code does not fit; whether there was one.
fn guarded<R>(read: impl FnOnce() -> R) -> (R, bool) {
    const BFHFNMIGN: u32 = 1 << 8;
    /// The bus fault's part of CFSR, which the fault leaves set.
    const BUS_FAULT: u32 = 0xFF00;
    bank().ccr().write_value(CLEAR_ALL);
    // SAFETY: with FAULTMASK and BFHFNMIGN a bus fault of this is ignored, and nothing else runs meanwhile. Both are as
    // before behind it.
    let outcome = unsafe {
        core::arch::asm!("cpsid f");
        (*SCB::PTR).ccr.modify(|ccr| ccr | BFHFNMIGN);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        let outcome = read();
        cortex_m::asm::dsb();
        (*SCB::PTR).ccr.modify(|ccr| ccr & !BFHFNMIGN);
        cortex_m::asm::dsb();
        core::arch::asm!("cpsie f");
        outcome
    };
    let is_torn = bank().sr().read().dbeccerr();
    if is_torn {
        // SAFETY: it is cleared by ones. Left set, it would be told as the cause of the next crash.
        unsafe { (*SCB::PTR).cfsr.write(BUS_FAULT) };
    }
    bank().ccr().write_value(CLEAR_ALL);
    (outcome, is_torn)
}

/// Programs a word, which was erased, as soon as `may_begin` says so: with all interrupts masked, so that it holds
/// until the word is under way.
///
/// # Errors
/// If the flash says so. What it does not say is found by reading.
pub fn program(
    sector: u8,
    word: u32,
    bytes: &[u8; WORD],
    may_begin: impl Fn() -> bool,
) -> Result<(), FlashError> {
    let address = place(sector, word).ok_or(FlashError)?;
    unlock(|w| w.set_pg(true));
    loop {
        let has_begun = cortex_m::interrupt::free(|_| {
            let begins = may_begin();
            if begins {
                for (at, four) in bytes.as_chunks::<4>().0.iter().enumerate() {
                    // SAFETY: the address lies in a sector that holds neither code nor data of this program, and takes
                    // words of 32 bits; the eighth begins the programming.
                    unsafe { address.add(at).write_volatile(u32::from_le_bytes(*four)) };
                }
                cortex_m::asm::dsb();
            }
            begins
        });
        if has_begun {
            return finish(PROGRAMMED);
        }
    }
}

/// Erases a sector: the core waits for 1 to 2 s.
///
/// # Errors
/// If the flash says so, as of a worn out sector.
pub fn erase(sector: u8) -> Result<(), FlashError> {
    place(sector, 0).ok_or(FlashError)?;
    let erases = |w: &mut Cr| {
        w.set_ser(true);
        w.set_snb(SECTORS.start + sector);
    };
    unlock(erases);
    bank().cr().modify(|w| w.set_start(true));
    cortex_m::asm::dsb();
    finish(ERASED)
}

/// All that CCR clears.
const CLEAR_ALL: Ccr = Ccr(0x1FEF_0000);

/// Unlocks the interface for an operation.
fn unlock(operation: impl FnOnce(&mut Cr)) {
    const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
    // A wrong sequence is a bus fault, and a key for what is not locked is wrong.
    if bank().cr().read().lock() {
        KEYS.into_iter().for_each(|key| bank().keyr().write_value(key));
    }
    bank().ccr().write_value(CLEAR_ALL);
    let mut control = Cr(0);
    control.set_psize(X64);
    operation(&mut control);
    bank().cr().write_value(control);
    cortex_m::asm::dsb();
}

/// Waits for the end, at most so many µs, and locks.
fn finish(most: u32) -> Result<(), FlashError> {
    let begin = cycle_count();
    let most = most.saturating_mul(CORE_CLOCK.0 / 1_000_000);
    while bank().sr().read().qw() && cycle_count().wrapping_sub(begin) < most {}
    let status = bank().sr().read();
    bank().ccr().write_value(CLEAR_ALL);
    let mut control = Cr(0);
    control.set_psize(X64);
    control.set_lock(true);
    bank().cr().write_value(control);
    let failed = status.qw()
        || status.wrperr()
        || status.pgserr()
        || status.strberr()
        || status.incerr()
        || status.operr();
    if failed { Err(FlashError) } else { Ok(()) }
}
