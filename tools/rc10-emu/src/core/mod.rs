//! The processor: a Cortex-M7, by the Armv7-M Architecture Reference Manual (ARM DDI 0403E), with the
//! clocks of a Cortex-M4.
//!
//! Clocks: 1 for an instruction, and more if it
//!
//! | does | clocks |
//! |---|---|
//! | load or store: for each access | 1 |
//! | branch | 2 |
//! | multiply to two registers, or parts of registers; move two registers to or from the FPU | 1 |
//! | divide; multiply and add in the FPU | 2 |
//! | divide in the FPU, or take a square root | 13 |
//! | enter an exception; return from one; go from one handler to the next | 12; 10; 6 |

#![expect(clippy::cast_possible_truncation, reason = "registers are taken apart")]

mod arithmetic;
mod bus;
mod decode;
mod dsp;
mod exceptions;
mod float;
mod ieee;
mod mpu;
mod system;
#[cfg(test)]
mod tests;
mod transfer;

use std::sync::{Arc, Mutex};

use crate::memory::Memory;
use crate::peripherals::Soc;

use self::bus::Bus;
use self::decode::{Decoded, SLOTS};
use self::exceptions::Fault;
use self::system::System;

/// External interrupts of the STM32H723, in words of 32: 0 ..= 162 (RM0468, NVIC chapter).
pub(crate) const INTERRUPT_WORDS: usize = 6;

/// Program counter of a core that locked up (B1.5.15).
const LOCKED_UP: u32 = 0xFFFF_FFFE;

// Bits of xPSR (B1.4.2): conditions, saturation, ..
bits! { N: 31, Z: 30, C: 29, V: 28, Q: 27 }
/// .. Thumb, which is always set in code that runs, ..
const T: u32 = 1 << 24;
/// .. results of parallel additions, the state of an IT block, and the exception.
const GE: u32 = 0xF << 16;
const IT: u32 = 0x0600_FC00;
const EXCEPTION: u32 = 0x1FF;

// Bits of CONTROL (B1.4.4): thread mode without privilege, its stack, and FPU registers in use.
bits! { UNPRIVILEGED: 0, PROCESS_STACK: 1, FP_ACTIVE: 2 }

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

/// Result of an instruction: in the registers, or a fault.
type Done = Result<(), Fault>;

/// A Cortex-M7 that executes from the chip's memories and peripherals.
pub struct Core {
    /// R13 is the stack pointer in use. While an instruction is executed, R15 is its address plus 4.
    r: [u32; 16],
    /// The stack pointer that is not in use.
    other_stack: u32,
    psr: u32,
    primask: bool,
    faultmask: bool,
    basepri: u8,
    control: u32,
    s: [u32; 32],
    fpscr: u32,
    system: System,
    pub(crate) bus: Bus,
    slots: Box<[Decoded; SLOTS]>,
    /// Address of the instruction that is executed, ..
    at: u32,
    /// .. and of the next one.
    next: u32,
    clocks: u64,
    /// Something may keep the next instruction from being executed: look before it.
    attention: bool,
    asleep: bool,
    /// The event that SEV leaves and WFE takes.
    event: bool,
    locked_up: bool,
    /// Address of the last LDREX.
    exclusive: Option<u32>,
    fault_address: u32,
    /// State that the MPU's answers depend on.
    context: u8,
    /// Address of the loop in which it is held, and program counter and xPSR before.
    held: Option<(u32, u32, u32)>,
    #[cfg(test)]
    watch: tests::witness::Watch,
}

/// A core with memories and no peripherals, after its reset: for programs that only compute.
pub fn bare(memory: &Memory) -> Core {
    Core::new(memory, None)
}

impl Core {
    pub(crate) fn new(memory: &Memory, soc: Option<Arc<Mutex<Soc>>>) -> Self {
        let mut core = Self {
            r: [0; 16],
            other_stack: 0,
            psr: T,
            primask: false,
            faultmask: false,
            basepri: 0,
            control: 0,
            s: [0; 32],
            fpscr: 0,
            system: System::new(),
            bus: Bus::new(memory, soc),
            slots: decode::no_slots(),
            at: 0,
            next: 0,
            clocks: 0,
            attention: true,
            asleep: false,
            event: false,
            locked_up: false,
            exclusive: None,
            fault_address: 0,
            context: 0,
            held: None,
            #[cfg(test)]
            watch: tests::witness::Watch::new(memory),
        };
        core.reset();
        core
    }

    /// Starts anew, as after a reset of the chip; memories keep their contents.
    pub(crate) fn reset(&mut self) {
        self.system = System::new();
        #[cfg(test)]
        self.watch.reset(&self.bus.memory);
        (self.s, self.fpscr) = ([0; 32], 0);
        (self.primask, self.faultmask, self.basepri, self.control) = (false, false, 0, 0);
        (self.asleep, self.event, self.locked_up, self.attention) = (false, false, false, true);
        (self.exclusive, self.held, self.context) = (None, None, 0);
        self.bus.forget();
        let [stack, start] = [0, 1].map(|at| self.bus.word(self.system.vector(at)).unwrap_or(0));
        (self.r, self.other_stack) = ([0; 16], 0);
        self.r[13] = stack & !3;
        self.r[15] = start & !1;
        self.psr = if start & 1 == 0 { 0 } else { T };
    }

    /// Enters an exception, or executes an instruction; also says how many clocks it took, about.
    #[inline]
    pub fn step(&mut self) -> (Step, u64) {
        #[cfg(test)]
        self.begin_watch();
        self.clocks = 0;
        self.next = self.r[15];
        let before = self.psr & EXCEPTION;
        let step = if self.attention || self.bus.memory.is_stale() { self.attend() } else { None };
        let step = step.unwrap_or_else(|| {
            self.execute();
            Step::Instruction
        });
        self.r[15] = self.next;
        self.wait(self.clocks);
        let step = if self.psr & EXCEPTION == before { step } else { self.entered(step) };
        let step = if self.locked_up { Step::LockedUp } else { step };
        #[cfg(test)]
        self.end_watch(step);
        (step, self.clocks)
    }

    /// The kind of a step that changed the exception's number: returns do so, too.
    fn entered(&self, step: Step) -> Step {
        let exception = self.exception();
        let vector = self.system.vector(exception.into());
        let is_at_handler = self.bus.word(vector).is_some_and(|at| at & !1 == self.r[15]);
        if exception != 0 && is_at_handler { Step::Entry(exception) } else { step }
    }

    /// Does what comes before the next instruction, or in its place.
    #[cold]
    fn attend(&mut self) -> Option<Step> {
        if self.bus.memory.is_stale() {
            self.forget_code();
        }
        if self.locked_up {
            self.clocks = 1;
            return Some(Step::LockedUp);
        }
        self.system.latch();
        if let Some(exception) = self.next_exception() {
            self.enter(exception, self.r[15]);
            return Some(Step::Instruction);
        }
        self.asleep &= self.system.most_urgent().is_none();
        if self.asleep {
            self.clocks = 1;
            return Some(Step::Asleep);
        }
        self.attention = self.psr & T == 0;
        self.attention.then(|| {
            self.clocks = 1;
            self.take(Fault::State, self.r[15]);
            Step::Instruction
        })
    }

    #[inline]
    fn execute(&mut self) {
        let at = self.r[15];
        self.at = at;
        self.clocks = 1;
        let found = self.slots[Decoded::slot(at)];
        let decoded = if found.address == at && self.bus.executes(at) {
            found
        } else {
            match self.decode(at) {
                Ok(decoded) => decoded,
                Err(fault) => return self.take(fault, at),
            }
        };
        self.r[15] = at.wrapping_add(4);
        self.next = at.wrapping_add(decoded.bytes());
        let psr = self.psr;
        let Decoded { run, bits, .. } = decoded;
        let done = if psr & IT == 0 { run(self, bits) } else { self.execute_in_block(decoded) };
        if let Err(fault) = done {
            // It may be executed again, in its place of an IT block.
            self.psr = self.psr & !IT | psr & IT;
            self.take(fault, at);
        }
    }

    /// Executes an instruction of an IT block, if its condition holds (A7.3).
    fn execute_in_block(&mut self, decoded: Decoded) -> Done {
        let state = self.psr >> 8 & 0xFC | self.psr >> 25 & 3;
        let next = if state & 7 == 0 { 0 } else { state & 0xE0 | state << 1 & 0x1F };
        self.set_it_state(next);
        let Decoded { run, bits, .. } = decoded.without_flags();
        if self.holds(state >> 4) { run(self, bits) } else { Ok(()) }
    }

    const fn set_it_state(&mut self, state: u32) {
        self.psr = self.psr & !IT | (state & 0xFC) << 8 | (state & 3) << 25;
    }

    #[inline]
    fn holds(&self, condition: u32) -> bool {
        let flag = |flag| self.psr & flag != 0;
        let same = flag(N) == flag(V);
        let holds = match condition >> 1 & 7 {
            0 => flag(Z),
            1 => flag(C),
            2 => flag(N),
            3 => flag(V),
            4 => flag(C) && !flag(Z),
            5 => same,
            6 => same && !flag(Z),
            _ => return true,
        };
        holds != (condition & 1 == 1)
    }

    /// Goes on elsewhere, after this instruction.
    #[inline]
    const fn branch(&mut self, to: u32) {
        self.next = to & !1;
        self.clocks += 2;
    }

    /// Goes on at an address with the state of its code, or returns from an exception
    /// (`BXWritePC`).
    #[inline]
    fn branch_exchange(&mut self, to: u32) -> Done {
        if to >> 28 == 0xF && self.psr & EXCEPTION != 0 {
            return self.leave(to);
        }
        if to & 1 == 0 {
            return Err(Fault::State);
        }
        self.branch(to);
        Ok(())
    }

    /// Writes a register that is not the program counter; that is left alone.
    #[inline]
    const fn set(&mut self, register: u32, value: u32) {
        if register != 15 {
            self.r[(register & 15) as usize] = value;
        }
    }

    #[inline]
    const fn get(&self, register: u32) -> u32 {
        self.r[(register & 15) as usize]
    }

    const fn is_privileged(&self) -> bool {
        self.psr & EXCEPTION != 0 || self.control & UNPRIVILEGED == 0
    }

    /// Lets the core's own timer count while the core sleeps, or waits for a bus.
    pub(crate) fn sleep(&mut self, clocks: u64) {
        self.attention |= self.system.count(clocks);
    }

    /// Lets the core's own counters go on while the core waits for a bus: timer and cycle counter.
    #[inline]
    pub(crate) fn wait(&mut self, clocks: u64) {
        self.system.count_cycles(clocks);
        if self.system.timer_runs() {
            self.sleep(clocks);
        }
    }

    /// The clocks that the core has waited for peripherals since the last call; its own counters have counted them.
    #[inline]
    pub(crate) fn take_waited(&mut self) -> u64 {
        let waited = std::mem::take(&mut self.bus.waited);
        if waited > 0 {
            self.wait(waited);
        }
        waited
    }

    /// Lets the cycle counter go on by some clocks more, or less, than [`step`](Self::step) said.
    pub(crate) const fn correct_cycles(&mut self, by: i64) {
        // It wraps.
        self.system.count_cycles(by.cast_unsigned());
    }

    /// The levels of the external interrupts: bit n of word n / 32.
    pub(crate) fn set_interrupts(&mut self, levels: [u32; INTERRUPT_WORDS]) {
        self.attention |= std::mem::replace(&mut self.system.levels, levels) != levels;
    }

    /// The level of the non-maskable interrupt.
    pub(crate) const fn set_nmi(&mut self, level: bool) {
        self.attention |= level;
        self.system.nmi = level;
    }

    /// Whether the program asked for a reset of the chip; forgets it.
    pub(crate) const fn take_reset_request(&mut self) -> bool {
        std::mem::replace(&mut self.system.wants_reset, false)
    }

    /// Number of the exception that is handled; 0 in thread mode.
    #[inline]
    pub(crate) const fn exception(&self) -> u16 {
        (self.psr & EXCEPTION) as u16
    }

    /// The priority of an exception as its register has it now, 0 to 255: lower is more urgent.
    pub(crate) fn priority(&self, exception: u16) -> u8 {
        // Reset, NMI and hard fault have none: nothing is more urgent.
        u8::try_from(self.system.group_priority(exception.into())).unwrap_or(0)
    }

    /// Address of the next instruction.
    #[inline]
    pub const fn program_counter(&self) -> u32 {
        self.r[15]
    }

    /// The stack pointer.
    #[inline]
    pub(crate) const fn stack_pointer(&self) -> u32 {
        self.r[13]
    }

    /// R0 ..= R15. At a function's first instruction the first ones are its arguments, R14 is its
    /// return address.
    pub const fn registers(&self) -> [u32; 16] {
        self.r
    }

    /// Goes on at an address, with the first registers set to `arguments`: for injected faults.
    pub(crate) fn call(&mut self, address: u32, arguments: [u32; 3]) {
        self.r[..3].copy_from_slice(&arguments);
        self.r[15] = address & !1;
        // Not in the middle of an IT block of the interrupted code.
        self.psr &= !IT;
    }

    /// Goes on at an address of an endless loop with all interrupts masked (PRIMASK): an injected
    /// fault. `false`: the program masks them itself.
    pub(crate) const fn hold(&mut self, address: u32) -> bool {
        if self.primask {
            return false;
        }
        self.held = Some((address, self.r[15], self.psr));
        self.primask = true;
        self.r[15] = address;
        self.psr &= !IT;
        true
    }

    /// Ends that loop, if it is still in it: everything is again as it was.
    pub(crate) fn release(&mut self) {
        if let Some((address, at, psr)) = self.held.take()
            && address == self.r[15]
        {
            (self.r[15], self.psr, self.primask, self.attention) = (at, psr, false, true);
        }
    }
}
