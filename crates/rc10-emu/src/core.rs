//! The processor behind a small trait, so that another interpreter can take its place.

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, Result};
use rc10_sim::Nanos;
use rsemu::core::error::BusError;
use rsemu::core::space::{
    AccessPurpose, AddressSpace, DispatchPolicy, Mapping, MappingId, MemAttrs, MemOps, MemResult,
    Perms, Region,
};
use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::{ArmV7m, Config, Regs};

use crate::memory::{FLASH, Memory};
use crate::peripherals::{Soc, Width};

/// External interrupts of the STM32H723, in words of 32: 0 ..= 162 (RM0468, NVIC chapter).
pub const INTERRUPT_WORDS: usize = 6;

/// The address space, bytes.
const EVERYTHING: u64 = 1 << 32;
/// It is looked up in pages of 64 KiB.
const PAGE_BITS: u32 = 16;

/// Memories that AHB2ENR gives a clock, in the order of their addresses.
const GATED: [&str; 2] = ["SRAM1", "SRAM2"];

/// Program counter of a core that locked up (Armv7-M Architecture Reference Manual, B1.5.15).
const LOCKED_UP: u32 = 0xFFFF_FFFE;

/// Result of one step of a core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// An instruction was executed.
    Instruction,
    /// An exception of this number was entered; its handler's first instruction comes next.
    Entry(u16),
    /// Nothing to do until an interrupt comes.
    Asleep,
    /// Nothing to do ever again, after a fault inside the fault handler: only a reset helps.
    LockedUp,
}

/// A Cortex-M7 that executes from the chip's memories and peripherals.
pub trait Core {
    /// Starts anew, as after a reset of the chip; memories keep their contents.
    fn reset(&mut self);
    /// Enters an exception, or executes one instruction; says what it was, and about how many
    /// clocks it took.
    fn step(&mut self) -> (Step, u64);
    /// Clocks until the core's own timer (`SysTick`) would end its sleep, if it runs.
    fn clocks_until_timer(&self) -> Option<u64>;
    /// Lets the core's own timer count while the core sleeps, or waits for a bus.
    fn sleep(&mut self, clocks: u64);
    /// Lets the core's own counters go on while the core waits for a bus: timer and cycle counter.
    fn wait(&mut self, clocks: u64);
    /// Lets the cycle counter go on by some clocks more, or less, than [`step`](Self::step) said.
    fn correct_cycles(&mut self, by: i64);
    /// The levels of the external interrupts: bit n of word n / 32.
    fn set_interrupts(&mut self, levels: [u32; INTERRUPT_WORDS]);
    /// The level of the non-maskable interrupt.
    fn set_nmi(&mut self, level: bool);
    /// Whether the program asked for a reset of the chip; forgets it.
    fn take_reset_request(&mut self) -> bool;
    /// Number of the exception that is handled; 0 in thread mode.
    fn exception(&self) -> u16;
    /// The priority of an exception as its register has it now, 0 to 255: lower is more urgent.
    fn priority(&self, exception: u16) -> u8;
    /// Address of the next instruction.
    fn program_counter(&self) -> u32;
    /// The stack pointer.
    fn stack_pointer(&self) -> u32;
    /// Return address of the executed function, at its first instruction.
    fn link_register(&self) -> u32;
    /// The first arguments of the executed function, at its first instruction.
    fn arguments(&self) -> [u32; 3];
    /// Goes on at an address, with the first registers set to `arguments`: for injected faults.
    fn call(&mut self, address: u32, arguments: [u32; 3]);
    /// Goes on at an address, which is to be an endless loop, with all interrupts masked (PRIMASK),
    /// as in a long critical section: for injected faults. `false`: they are masked
    /// already, by the program itself.
    fn hold(&mut self, address: u32) -> bool;
    /// Ends that loop, if it is still in it: everything is again as it was.
    fn release(&mut self);
}

/// A core with memories and no peripherals, after its reset: for programs that only compute.
///
/// # Errors
/// If the memories overlap.
pub fn bare(memory: &Memory) -> Result<impl Core + use<>> {
    Interpreter::new(memory, None)
}

/// State that core and peripherals share.
#[derive(Clone)]
pub(crate) struct Wiring {
    pub(crate) soc: Arc<Mutex<Soc>>,
    /// The time of the access, nanoseconds.
    pub(crate) now: Arc<AtomicU64>,
    /// Set by every access to a peripheral: it may have changed an interrupt, or what comes next.
    pub(crate) touched: Arc<AtomicBool>,
    /// Clocks that the core has waited for buses since this was last taken.
    pub(crate) waited: Arc<AtomicU64>,
}

impl Wiring {
    pub(crate) fn soc(&self) -> std::sync::MutexGuard<'_, Soc> {
        // The state that a panic left behind is as good as any state of a chip.
        self.soc.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn time(&self) -> Nanos {
        Nanos::new(self.now.load(Ordering::Relaxed))
    }

    fn wait(&self, soc: &Soc, address: u32) {
        self.waited.fetch_add(soc.access_clocks(address), Ordering::Relaxed);
    }
}

impl fmt::Debug for Wiring {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("peripherals")
    }
}

fn width_of(bytes: usize) -> Result<Width, BusError> {
    match bytes {
        1 => Ok(Width::Byte),
        2 => Ok(Width::Half),
        4 => Ok(Width::Word),
        _ => Err(BusError::BadAccess),
    }
}

/// Everything in the address space that is no memory, or that a program cannot write to.
impl MemOps for Wiring {
    fn read(&self, offset: u64, to: &mut [u8], attributes: MemAttrs) -> MemResult {
        if attributes.debug {
            to.fill(0);
            return Ok(());
        }
        let width = width_of(to.len())?;
        let address = address_of(offset)?;
        self.touched.store(true, Ordering::Relaxed);
        // Instructions do not come from peripherals, at any address.
        let value = if attributes.purpose == AccessPurpose::FETCH {
            Err(self.soc().refuse(address, false))
        } else {
            let mut soc = self.soc();
            self.wait(&soc, address);
            soc.read(address, width, self.time())
        };
        let value = value.map_err(|_| BusError::Unassigned)?;
        to.copy_from_slice(&value.to_le_bytes()[..to.len()]);
        Ok(())
    }

    fn write(&self, offset: u64, from: &[u8], attributes: MemAttrs) -> MemResult {
        if attributes.debug {
            return Err(BusError::Protected);
        }
        let address = address_of(offset)?;
        if self.soc().write_early(address, from) {
            self.touched.store(true, Ordering::Relaxed);
            return Ok(());
        }
        let width = width_of(from.len())?;
        let mut bytes = [0; 4];
        bytes[..from.len()].copy_from_slice(from);
        self.touched.store(true, Ordering::Relaxed);
        let mut soc = self.soc();
        self.wait(&soc, address);
        let written = soc.write(address, width, u32::from_le_bytes(bytes), self.time());
        written.map_err(|_| BusError::Unassigned)
    }
}

fn address_of(offset: u64) -> Result<u32, BusError> {
    u32::try_from(offset).map_err(|_| BusError::Unassigned)
}

/// The interpreter of the `rsemu` package.
pub(crate) struct Interpreter {
    core: ArmV7m,
    space: Arc<AddressSpace>,
    levels: [u32; INTERRUPT_WORDS],
    exception: u16,
    program_counter: u32,
    stack_pointer: u32,
    /// xPSR's bits for the IT block that the next instruction is in.
    it_state: u32,
    /// Address at which it was held, and its registers before.
    held: Option<(u32, Regs)>,
    /// The memories that have a clock only if the program gives them one.
    gated: Vec<Gated>,
    /// The memories that must not be written yet.
    guarded: Vec<Gated>,
}

/// ICI/IT of xPSR (Armv7-M ARM B1.4.2).
const IT_STATE: u32 = 0x0600_FC00;

/// A memory that is not always mapped as it is to be.
struct Gated {
    mapping: Mapping,
    mapped: Option<MappingId>,
}

impl Interpreter {
    pub(crate) fn new(memory: &Memory, wiring: Option<Wiring>) -> Result<Self> {
        // A table instead of a search: it is asked for every instruction.
        let table = DispatchPolicy::Dense { page_bits: PAGE_BITS, cover: EVERYTHING };
        let space = AddressSpace::new("cpu", 32).with_dispatch(table);
        let (mut gated, mut guarded) = (Vec::new(), Vec::new());
        let guards = wiring.as_ref().is_some_and(|wiring| wiring.soc().guards_ram());
        for bank in memory.banks() {
            // A plain write does not program the flash.
            let allowed = if bank.base == FLASH { Perms::RX } else { Perms::RWX };
            let region = Region::ram(bank.name, bank.store());
            let mapping = Mapping::new(region, bank.base.into()).with_perms(allowed);
            if wiring.is_some() && GATED.contains(&bank.name) {
                gated.push(Gated { mapping, mapped: None });
            } else if guards && bank.base != FLASH {
                let locked = mapping.clone().with_perms(Perms::RX);
                let mapped = Some(space.topology().map_with(locked).context(bank.name)?);
                guarded.push(Gated { mapping, mapped });
            } else {
                space.topology().map_with(mapping).context(bank.name)?;
            }
        }
        if let Some(wiring) = wiring {
            let region = Region::io("peripherals", EVERYTHING, Arc::new(wiring));
            space.topology().map_with_priority(region, 0, -1).context("peripherals")?;
        }
        let space = Arc::new(space);
        let mut interpreter = Self {
            core: fresh(&space),
            space,
            levels: [0; INTERRUPT_WORDS],
            exception: 0,
            program_counter: 0,
            stack_pointer: 0,
            it_state: 0,
            held: None,
            gated,
            guarded,
        };
        interpreter.reset();
        Ok(interpreter)
    }

    /// The clocks of SRAM1 and SRAM2 now. An access to one that has none is a peripheral's,
    /// and is told there.
    ///
    /// # Errors
    /// If the memories overlap.
    pub(crate) fn set_memories(&mut self, running: [bool; 2]) -> Result<()> {
        for (gated, running) in self.gated.iter_mut().zip(running) {
            match gated.mapped {
                None if running => {
                    let mapping = gated.mapping.clone();
                    gated.mapped = Some(self.space.topology().map_with(mapping).context("SRAM")?);
                }
                Some(id) if !running => {
                    self.space.topology().unmap(id).context("SRAM")?;
                    gated.mapped = None;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Lets the program write RAM from now on.
    ///
    /// # Errors
    /// If the memories overlap.
    pub(crate) fn unlock_memories(&mut self) -> Result<()> {
        for Gated { mapping, mapped } in self.guarded.drain(..) {
            if let Some(id) = mapped {
                self.space.topology().unmap(id).context("RAM")?;
            }
            self.space.topology().map_with(mapping).context("RAM")?;
        }
        Ok(())
    }

    /// Whether the next instruction is the first one of the handler of the exception that is
    /// handled. A return to a handler that was interrupted changes the exception's number too.
    fn is_at_handler(&self) -> bool {
        let vector = self.core.vtor() + 4 * u32::from(self.exception);
        let handler =
            self.space.read(vector.into(), rsemu::core::value::Width::U32, MemAttrs::DEBUG);
        handler.is_ok_and(|handler| handler & !1 == u64::from(self.program_counter))
    }

    /// Puts the state of an IT block into the frame of the exception that has just been taken in it.
    /// The interpreter (0.0.7) stacks xPSR without it, and would execute the rest of the block
    /// independent of its condition (Armv7-M ARM B1.5.6: the whole xPSR is stacked).
    fn keep_it_state(&mut self, state: u32, interrupted: u32) {
        let registers = self.core.regs();
        let on_process_stack = registers.r[14] & 4 != 0;
        let frame = if on_process_stack { self.core.psp() } else { self.core.msp() };
        let word = |offset: u64| u64::from(frame) + offset;
        let read = |at| self.space.read(at, rsemu::core::value::Width::U32, MemAttrs::DEBUG);
        let (Ok(address), Ok(status)) = (read(word(24)), read(word(28))) else { return };
        // One exception after another without a return between stacks nothing.
        if address == u64::from(interrupted) {
            let status = status | u64::from(state);
            let _ =
                self.space.write(word(28), rsemu::core::value::Width::U32, status, MemAttrs::DEBUG);
        }
    }

    fn look(&mut self) {
        let registers = self.core.regs();
        self.it_state = registers.xpsr & IT_STATE;
        self.exception = registers.exception().0;
        self.program_counter = registers.r[15];
        self.stack_pointer = registers.r[13];
    }
}

/// A core after its reset: the interpreter's own reset leaves the interrupt controller as it was.
fn fresh(space: &Arc<AddressSpace>) -> ArmV7m {
    // The STM32H7 has 16 priorities.
    let config = Config::CORTEX_M7F.with_priority_bits(4).with_reset_vtor(FLASH);
    let core = ArmV7m::new(config);
    core.attach_space(Arc::clone(space));
    // The reset sequence: stack pointer and first address are read.
    core.step();
    core
}

impl Core for Interpreter {
    fn reset(&mut self) {
        self.core = fresh(&self.space);
        self.levels = [0; INTERRUPT_WORDS];
        self.held = None;
        self.look();
    }

    fn step(&mut self) -> (Step, u64) {
        let (before, was_at, it_state) = (self.exception, self.program_counter, self.it_state);
        let clocks = self.core.step();
        self.look();
        // It waits at an address where no program can be.
        if self.program_counter == LOCKED_UP && self.core.is_locked_up() {
            return (Step::LockedUp, clocks);
        }
        if self.exception != before && self.exception != 0 && self.is_at_handler() {
            if it_state != 0 {
                self.keep_it_state(it_state, was_at);
            }
            return (Step::Entry(self.exception), clocks);
        }
        if was_at == self.program_counter && self.core.is_asleep() {
            return (Step::Asleep, clocks);
        }
        (Step::Instruction, clocks)
    }

    fn clocks_until_timer(&self) -> Option<u64> {
        self.core.with_sys(|system| {
            let counts = system.syst_csr & 1 != 0 && system.syst_rvr != 0;
            // It reloads in the clock after zero.
            counts.then(|| {
                u64::from(if system.syst_cvr == 0 { system.syst_rvr + 1 } else { system.syst_cvr })
            })
        })
    }

    fn sleep(&mut self, clocks: u64) {
        self.core.with_sys(|system| {
            let interrupts = system.syst_csr & 0b10 != 0;
            if system.tick_systick(clocks) && interrupts {
                system.set_pending(Exception::SYSTICK, true);
            }
        });
    }

    fn wait(&mut self, clocks: u64) {
        self.sleep(clocks);
        self.core.with_sys(|system| system.tick_cyccnt(clocks));
    }

    fn correct_cycles(&mut self, by: i64) {
        // It wraps.
        self.core.with_sys(|system| system.tick_cyccnt(by.cast_unsigned()));
    }

    fn set_interrupts(&mut self, levels: [u32; INTERRUPT_WORDS]) {
        for ((word, &new), old) in (0_u16..).zip(&levels).zip(&mut self.levels) {
            let mut changed = new ^ std::mem::replace(old, new);
            while changed != 0 {
                let bit = changed.trailing_zeros();
                changed &= changed - 1;
                #[expect(clippy::cast_possible_truncation, reason = "below 32")]
                self.core.set_irq(word * 32 + bit as u16, new & (1 << bit) != 0);
            }
        }
    }

    fn set_nmi(&mut self, level: bool) {
        self.core.set_nmi(level);
    }

    fn take_reset_request(&mut self) -> bool {
        let requested = self.core.reset_requested();
        if requested {
            self.core.clear_reset_request();
        }
        requested
    }

    fn exception(&self) -> u16 {
        self.exception
    }

    fn priority(&self, exception: u16) -> u8 {
        let priority = self.core.with_sys(|system| system.priority_of(Exception(exception)));
        // Reset, NMI and hard fault have none: nothing is more urgent.
        u8::try_from(priority).unwrap_or(0)
    }

    fn program_counter(&self) -> u32 {
        self.program_counter
    }

    fn stack_pointer(&self) -> u32 {
        self.stack_pointer
    }

    fn link_register(&self) -> u32 {
        self.core.reg(14)
    }

    fn arguments(&self) -> [u32; 3] {
        [0, 1, 2].map(|register| self.core.reg(register))
    }

    fn call(&mut self, address: u32, arguments: [u32; 3]) {
        let mut registers = self.core.regs();
        registers.r[..3].copy_from_slice(&arguments);
        registers.r[15] = address & !1;
        // Not in the middle of an IT block of the interrupted code.
        registers.xpsr &= !rsemu::cpu::arm::v7m::xpsr::IT_MASK;
        self.core.set_regs(registers);
        self.look();
    }

    fn hold(&mut self, address: u32) -> bool {
        let mut registers = self.core.regs();
        if registers.primask {
            return false;
        }
        self.held = Some((address, registers));
        registers.primask = true;
        self.core.set_regs(registers);
        let arguments = std::array::from_fn(|index| registers.r[index]);
        self.call(address, arguments);
        true
    }

    fn release(&mut self) {
        if let Some((address, registers)) = self.held.take()
            && address == self.program_counter
        {
            self.core.set_regs(registers);
            self.look();
        }
    }
}
