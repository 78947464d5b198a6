//! Crash handling: after a panic, a fault, an interrupt without a handler, or a crystal that stops.
//!
//! Interrupts go off; on every bus unsent frames are cancelled and the coast image is sent by
//! registers; memory that a reset keeps gets the cause, for [`take_last`]; the chip restarts.
//!
//! A hang ends by the watchdog; the [supervisor](super::supervisor) keeps what ran before.
//!
//! [`crash_handlers!`](crate::crash_handlers) puts it in place, also for stack overflows.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::{NVIC, SCB};
use embassy_stm32::pac;
use heapless::String;
use rc10_time::Micros;

use super::{can, crystal};

/// Why the chip restarted.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LastCrash {
    /// A panic.
    Panic {
        /// Source file, its last [`FILE_LENGTH`] bytes.
        file: String<FILE_LENGTH>,
        /// Line in it.
        line: u32,
    },
    /// A `HardFault`; every other fault escalates to it.
    Fault {
        /// Address of the instruction; 0 if the stack was no longer readable.
        program_counter: u32,
        /// The address to which that function returns; 0 likewise.
        link: u32,
        /// Configurable Fault Status Register (ARMv7-M manual, B3.2.15).
        status: u32,
        /// The address that could not be accessed; valid if `status` says so.
        address: u32,
    },
    /// An interrupt or exception without a handler.
    Interrupt {
        /// The exception's number; exceptions are negative, as cortex-m-rt counts.
        number: i16,
    },
    /// The crystal stopped.
    CrystalStopped,
    /// The watchdog was not fed: interrupts were masked, or one above the supervisor did not end.
    Watchdog,
    /// The watchdog was not fed in time, and this was executed shortly before: `addr2line` names it.
    Hang {
        /// Address of the instruction. That of the executor's sleep: nothing looped, and something was not woken.
        program_counter: u32,
    },
    /// The supply fell below the brown-out level. Where it was gone altogether that is no crash: [`power_came`].
    Supply,
}

/// Number of bytes of a file name that are kept.
pub const FILE_LENGTH: usize = 48;

const MAGIC: u32 = 0x5243_3130;
const PANIC: u32 = 1;
const FAULT: u32 = 2;
const INTERRUPT: u32 = 3;
const CRYSTAL: u32 = 4;
const HANG: u32 = 5;

const FILE_WORDS: usize = FILE_LENGTH / 4;
/// Magic, kind, four values, file name, checksum.
const WORDS: usize = 2 + 4 + FILE_WORDS + 1;

/// Outside what the start-up code clears. Whole words: ECC may lose a part in a reset.
#[unsafe(link_section = ".uninit.rc10_crash")]
static RECORD: [AtomicU32; WORDS] = [const { AtomicU32::new(0) }; WORDS];

/// Whether power has just come. To be asked before [`take_last`], which forgets it.
#[must_use]
pub fn power_came() -> bool {
    pac::RCC.rsr().read().porrstf()
}

/// The crash that ended the last run, if one did; forgets it.
#[must_use]
pub fn take_last() -> Option<LastCrash> {
    let words: [u32; WORDS] = core::array::from_fn(|index| RECORD[index].load(Ordering::Relaxed));
    RECORD[0].store(0, Ordering::Relaxed);
    let flags = pac::RCC.rsr().read();
    // "Set and reset by software": if it stayed set, it would hide the next cause.
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    pac::RCC.rsr().modify(|w| w.set_rmvf(false));

    let (checksum, kept) = words.split_last()?;
    let is_kept = kept[0] == MAGIC && *checksum == checksum_of(kept);
    match if is_kept { kept[1] } else { 0 } {
        // Else another reset came before the watchdog's.
        HANG if flags.iwdg1rstf() => Some(LastCrash::Hang { program_counter: kept[2] }),
        PANIC => {
            let mut file = String::new();
            for byte in kept[6..].iter().flat_map(|word| word.to_le_bytes()) {
                if byte.is_ascii_graphic() {
                    let _ = file.push(char::from(byte));
                }
            }
            Some(LastCrash::Panic { file, line: kept[2] })
        }
        FAULT => Some(LastCrash::Fault {
            program_counter: kept[2],
            link: kept[3],
            status: kept[4],
            address: kept[5],
        }),
        INTERRUPT => Some(LastCrash::Interrupt {
            number: i16::try_from(kept[2].cast_signed()).unwrap_or(i16::MAX),
        }),
        CRYSTAL => Some(LastCrash::CrystalStopped),
        _ if flags.iwdg1rstf() => Some(LastCrash::Watchdog),
        // RM0468, RCC, table of reset sources: power-on sets both flags of the supply.
        _ if flags.borrstf() && !flags.porrstf() => Some(LastCrash::Supply),
        _ => None,
    }
}

/// For [`crash_handlers!`](crate::crash_handlers).
#[doc(hidden)]
pub fn on_panic(info: &PanicInfo<'_>) -> ! {
    let (file, line) = info.location().map_or(("", 0), |at| (at.file(), at.line()));
    crash(PANIC, [line, 0, 0, 0], file)
}

/// For [`crash_handlers!`](crate::crash_handlers).
#[doc(hidden)]
pub fn on_interrupt(number: i16) -> ! {
    crash(INTERRUPT, [i32::from(number).cast_unsigned(), 0, 0, 0], "")
}

/// For [`crash_handlers!`](crate::crash_handlers): the exception that cannot be masked.
#[doc(hidden)]
pub fn on_nmi() -> ! {
    if crystal::take_stopped() {
        // First: without it the FDCANs have no clock to send with.
        crystal::replace();
        crash(CRYSTAL, [0; 4], "")
    }
    on_interrupt(-14)
}

/// For [`crash_handlers!`](crate::crash_handlers): `frame` is where the fault pushed the registers.
#[doc(hidden)]
pub extern "C" fn on_fault(frame: u32) -> ! {
    const MMARVALID: u32 = 1 << 7;
    let [link, program_counter, _] = stacked(frame);
    // SAFETY: reads of read-only or sticky registers of this core, which always exist.
    let (status, memory, bus) =
        unsafe { ((*SCB::PTR).cfsr.read(), (*SCB::PTR).mmfar.read(), (*SCB::PTR).bfar.read()) };
    let address = if status & MMARVALID == 0 { bus } else { memory };
    crash(FAULT, [program_counter, link, status, address], "")
}

/// lr, pc and xPSR of an exception's frame (ARMv7-M manual, B1.5.6); zeros of an overflowed stack.
fn stacked(frame: u32) -> [u32; 3] {
    const DTCM: core::ops::Range<u32> = 0x2000_0000..0x2002_0000 - 8 * 4;
    if !DTCM.contains(&frame) || !frame.is_multiple_of(4) {
        return [0; 3];
    }
    let frame = frame as *const u32;
    // SAFETY: eight words from `frame` on lie in DTCM, which is always readable.
    [5, 6, 7].map(|word| unsafe { frame.add(word).read_volatile() })
}

/// Looks of the supervisor that are left until the watchdog is about to bite; 0: there is no watchdog.
static LEFT: AtomicU32 = AtomicU32::new(0);
/// The last of them: what runs is kept from now on, until the watchdog is fed.
const LATE: u32 = 1;

/// The watchdog was fed: this number of looks of the supervisor may pass.
pub(super) fn fed(looks: u32) {
    if LEFT.swap(looks.max(LATE), Ordering::Relaxed) == LATE {
        // It was late, and hangs no longer.
        RECORD[0].store(0, Ordering::Relaxed);
    }
}

/// Whether the watchdog is about to bite. `PendSV` follows at once, on the same stack frame.
pub(super) fn supervised() -> bool {
    match LEFT.load(Ordering::Relaxed) {
        0 => {}
        LATE => {
            SCB::set_pendsv();
            return true;
        }
        left => LEFT.store(left - 1, Ordering::Relaxed),
    }
    false
}

/// For [`crash_handlers!`](crate::crash_handlers): keeps what was interrupted. Of several looks the least urgent
/// one, and of those the last: what hangs is interrupted by what does not, and by nothing that hangs less.
#[doc(hidden)]
pub extern "C" fn on_late(frame: u32) {
    let [link, program_counter, status] = stacked(frame);
    let level = match status & 0x1FF {
        0 => u32::from(u8::MAX) + 1,
        // SAFETY: a read of this core's interrupt controller, which has a priority for each number.
        number @ 16.. => unsafe { (*NVIC::PTR).ipr[number as usize - 16].read() }.into(),
        _ => 0,
    };
    let is_kept = RECORD[0].load(Ordering::Relaxed) == MAGIC;
    if !is_kept || level >= RECORD[4].load(Ordering::Relaxed) {
        keep(HANG, [program_counter, link, level, 0], "");
    }
}

fn crash(kind: u32, values: [u32; 4], file: &str) -> ! {
    cortex_m::interrupt::disable();
    // Registers alone make the motors safe.
    for controller in can::ALL {
        controller.send_coast_image();
    }
    // Before the wait, in which the watchdog could strike.
    keep(kind, values, file);
    wait_for_coast_images();
    SCB::sys_reset()
}

/// Bounded: 20 ms of the watchdog's 70. Eight frames take 1 ms; a bus back from bus-off 1.4 to 17
/// ms; one without another node all of it.
///
/// The clock runs if there is an image, and needs no interrupt for half its period, 32 ms.
fn wait_for_coast_images() {
    let until = rc10_message::now() + Micros::from_millis(20);
    while !can::ALL.iter().all(|controller| controller.coast_image_sent()) {
        if rc10_message::now() >= until {
            return;
        }
    }
}

fn keep(kind: u32, values: [u32; 4], file: &str) {
    let mut words = [0; WORDS];
    words[0] = MAGIC;
    words[1] = kind;
    words[2..6].copy_from_slice(&values);
    let bytes = file.as_bytes();
    let bytes = &bytes[bytes.len().saturating_sub(FILE_LENGTH)..];
    for (word, chunk) in words[6..].iter_mut().zip(bytes.chunks(4)) {
        let mut whole = [0; 4];
        whole[..chunk.len()].copy_from_slice(chunk);
        *word = u32::from_le_bytes(whole);
    }
    words[WORDS - 1] = checksum_of(&words[..WORDS - 1]);
    for (place, word) in RECORD.iter().zip(words) {
        place.store(word, Ordering::Relaxed);
    }
    cortex_m::asm::dsb();
}

/// FNV-1a over words: tells a record from what memory holds after power-on.
fn checksum_of(words: &[u32]) -> u32 {
    words.iter().fold(0x811C_9DC5, |hash, word| (hash ^ word).wrapping_mul(0x0100_0193))
}

/// Defines handlers of panic, `HardFault`, NMI, `PendSV` and others: [`crash`](crate::crash).
#[macro_export]
macro_rules! crash_handlers {
    () => {
        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::crash::on_panic(info)
        }

        // SAFETY: cortex-m-rt's vector table asks for the name. In assembly, because the stack may
        // be gone: it keeps the old pointer for the report and starts at the top.
        #[unsafe(export_name = "HardFault")]
        #[unsafe(naked)]
        unsafe extern "C" fn hard_fault() -> ! {
            core::arch::naked_asm!(
                "mrs r0, msp",
                "ldr r1, =_stack_start",
                "msr msp, r1",
                "b {on_fault}",
                on_fault = sym $crate::crash::on_fault,
            )
        }

        // SAFETY: as above. It leaves all as it finds it: what it goes on in returns for it.
        #[unsafe(export_name = "PendSV")]
        #[unsafe(naked)]
        unsafe extern "C" fn late() {
            core::arch::naked_asm!(
                "mrs r0, msp",
                "b {on_late}",
                on_late = sym $crate::crash::on_late,
            )
        }

        // SAFETY: as above.
        #[unsafe(export_name = "NonMaskableInt")]
        unsafe extern "C" fn non_maskable_interrupt() -> ! {
            $crate::crash::on_nmi()
        }

        // SAFETY: as above; cortex-m-rt calls it for every vector without a handler.
        #[unsafe(export_name = "DefaultHandler")]
        unsafe extern "C" fn unexpected_interrupt() -> ! {
            let number: u32;
            // SAFETY: reads the number of the active exception.
            unsafe { core::arch::asm!("mrs {}, ipsr", out(reg) number) };
            $crate::crash::on_interrupt((number as i16) - 16)
        }
    };
}
