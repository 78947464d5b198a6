//! Exceptions: which one is next, entry, return, faults (B1.5).

use super::system::{
    BFAR, CCR, CFSR, FPCAR, FPCCR, FPDSCR, HFSR, MMFAR, SCR, SET_WORDS, SHCSR, System,
};
use super::{C, N, Q, V, Z};
use super::{Core, Done, EXCEPTION, FP_ACTIVE, GE, IT, LOCKED_UP, PROCESS_STACK, T};

pub(super) const NMI: u32 = 2;
pub(super) const HARD_FAULT: u32 = 3;
words! { MEM_MANAGE: 4, BUS_FAULT: 5, USAGE_FAULT: 6, SV_CALL: 11 }
pub(super) const PEND_SV: u32 = 14;
pub(super) const SYSTICK: u32 = 15;

/// A priority that everything can interrupt.
const LOWEST: i32 = 256;

// Bits of `HFSR`.
bits! { VECTTBL: 1, FORCED: 30, DEBUGEVT: 31 }
// Bits of `FPCCR`: FPU registers are kept, and only when they are needed; that is due; for code
// without privileges; for thread mode; and the faults that could have been taken then.
bits! {
    ASPEN: 31, LSPEN: 30, LSPACT: 0, USER: 1, THREAD: 3, HFRDY: 4, MMRDY: 5, BFRDY: 6, MONRDY: 8,
}
/// `SCR.SLEEPONEXIT`.
const SLEEPONEXIT: u32 = 1 << 1;
/// `CCR.NONBASETHRDENA`.
const TO_THREAD: u32 = 1;
/// Bit of a stacked xPSR: the stack pointer was not aligned to eight bytes.
const REALIGNED: u32 = 1 << 9;
/// Words of a frame with FPU registers, and without; the place of the former in it.
const FRAME: u32 = 8;
const FP_FRAME: u32 = 26;
/// Bits of FPSCR that FPDSCR has, too: half precision, default NaN, flush to zero, rounding.
const MODES: u32 = 0x07C0_0000;
/// Bits of FPSCR that can be written.
pub(super) const FPSCR: u32 = 0xF3C0_009F;

/// A reason for which an instruction is not executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// The MPU forbids it. (Each fault is its bits of `CFSR`.)
    FetchMpu = 1 << 0,
    DataMpu = 1 << 1 | 1 << 7,
    FetchBus = 1 << 8,
    DataBus = 1 << 9 | 1 << 15,
    Undefined = 1 << 16,
    /// Code that is not Thumb.
    State = 1 << 17,
    /// A return from an exception that cannot be.
    Return = 1 << 18,
    /// The coprocessor does not exist, or is off.
    NoCoprocessor = 1 << 19,
    Unaligned = 1 << 24,
    DivideByZero = 1 << 25,
}

impl Fault {
    const fn exception(self) -> u32 {
        match self as u32 {
            0..=0xFF => MEM_MANAGE,
            0x100..=0xFFFF => BUS_FAULT,
            _ => USAGE_FAULT,
        }
    }
}

pub(super) const fn is_set(set: &[u32; SET_WORDS], exception: u32) -> bool {
    set[exception as usize / 32 % SET_WORDS] >> (exception % 32) & 1 != 0
}

pub(super) const fn set_bit(set: &mut [u32; SET_WORDS], exception: u32, to: bool) {
    let word = &mut set[exception as usize / 32 % SET_WORDS];
    *word = *word & !(1 << (exception % 32)) | (to as u32) << (exception % 32);
}

fn members(set: [u32; SET_WORDS]) -> impl Iterator<Item = u32> {
    (0..).zip(set).flat_map(|(index, mut word)| {
        std::iter::from_fn(move || {
            let bit = word.trailing_zeros();
            word &= word.wrapping_sub(1);
            (bit < 32).then_some(32 * index + bit)
        })
    })
}

/// Addresses of words from one on, around the end of all addresses if need be.
pub(super) fn places(from: u32) -> impl Iterator<Item = u32> {
    (0..64).map(move |index| from.wrapping_add(4 * index))
}

impl System {
    /// The bits of a priority that decide who interrupts whom (`AIRCR.PRIGROUP`).
    const fn group_mask(&self) -> u32 {
        0xFF << (self.group + 1) & 0xFF
    }

    /// The priority that counts where one exception is to interrupt another.
    pub(super) const fn group_priority(&self, exception: u32) -> i32 {
        match exception {
            1..=HARD_FAULT => exception as i32 - 4,
            _ => (self.priority(exception) & self.group_mask()) as i32,
        }
    }

    const fn is_enabled(&self, exception: u32) -> bool {
        match exception {
            MEM_MANAGE..=USAGE_FAULT => self.word(SHCSR) >> (12 + exception) & 1 != 0,
            _ => is_set(&self.enabled, exception),
        }
    }

    /// The pending exception that is to be taken first, and its priority.
    pub(super) fn most_urgent(&self) -> Option<(u32, i32)> {
        let pending = members(self.pending).filter(|&exception| self.is_enabled(exception));
        // Of equal ones the first.
        let rank = |&exception: &u32| match exception {
            0..=HARD_FAULT => exception as i32 - 4,
            _ => self.priority(exception) as i32,
        };
        let first = pending.min_by_key(rank)?;
        Some((first, self.group_priority(first)))
    }

    /// Whether the execution's priority is that of NMI or `HardFault`.
    pub(super) const fn is_negative(&self, faultmask: bool) -> bool {
        faultmask || self.active[0] & (1 << NMI | 1 << HARD_FAULT) != 0
    }

    pub(super) fn active_count(&self) -> u32 {
        self.active.iter().map(|set| set.count_ones()).sum()
    }
}

impl Core {
    /// Priority of what is executed (B1.5.4).
    pub(super) fn execution_priority(&self) -> i32 {
        let active = members(self.system.active).map(|active| self.system.group_priority(active));
        let basepri = (u32::from(self.basepri) & self.system.group_mask()) as i32;
        let bounds = [
            if self.faultmask { -1 } else { LOWEST },
            if self.primask { 0 } else { LOWEST },
            if self.basepri == 0 { LOWEST } else { basepri },
        ];
        active.chain(bounds).min().unwrap_or(LOWEST)
    }

    pub(super) fn next_exception(&self) -> Option<u32> {
        let (exception, priority) = self.system.most_urgent()?;
        (priority < self.execution_priority()).then_some(exception)
    }

    /// The main stack pointer, or that of processes.
    pub(super) const fn stack(&mut self, process: bool) -> &mut u32 {
        if self.uses_process_stack() == process { &mut self.r[13] } else { &mut self.other_stack }
    }

    const fn uses_process_stack(&self) -> bool {
        self.psr & EXCEPTION == 0 && self.control & PROCESS_STACK != 0
    }

    /// Changes exception and CONTROL, and with them the stack pointer in use.
    pub(super) fn switch(&mut self, exception: u32, control: u32) {
        let before = self.uses_process_stack();
        self.psr = self.psr & !EXCEPTION | exception;
        self.control = control;
        if self.uses_process_stack() != before {
            std::mem::swap(&mut self.r[13], &mut self.other_stack);
        }
        self.attention = true;
        self.protect();
    }

    /// Takes a fault as its own exception, as `HardFault`, or by locking up.
    #[cold]
    pub(super) fn take(&mut self, fault: Fault, at: u32) {
        *self.system.word_mut(CFSR) |= fault as u32;
        match fault {
            Fault::DataMpu => *self.system.word_mut(MMFAR) = self.fault_address,
            Fault::DataBus => *self.system.word_mut(BFAR) = self.fault_address,
            _ => {}
        }
        match self.escalated(fault.exception()) {
            Some(exception) => self.enter(exception, at),
            None => self.lock_up(),
        }
    }

    /// The exception as which one is taken that cannot wait; `None`: the core locks up.
    fn escalated(&mut self, exception: u32) -> Option<u32> {
        let priority = self.execution_priority();
        if self.system.is_enabled(exception) && self.system.group_priority(exception) < priority {
            return Some(exception);
        }
        *self.system.word_mut(HFSR) |= FORCED;
        (priority > -1).then_some(HARD_FAULT)
    }

    const fn lock_up(&mut self) {
        (self.locked_up, self.attention, self.next) = (true, true, LOCKED_UP);
    }

    /// SVC, with the address behind it.
    pub(super) fn call_supervisor(&mut self) -> Done {
        match self.escalated(SV_CALL) {
            Some(exception) => self.enter(exception, self.next),
            None => self.lock_up(),
        }
        Ok(())
    }

    /// BKPT: there is no debugger.
    pub(super) fn break_point(&mut self) -> Done {
        *self.system.word_mut(HFSR) |= DEBUGEVT;
        if self.system.is_negative(self.faultmask) {
            self.lock_up();
        } else {
            self.enter(HARD_FAULT, self.next);
        }
        Ok(())
    }

    /// Puts the registers on the stack and begins a handler (B1.5.6).
    pub(super) fn enter(&mut self, exception: u32, return_address: u32) {
        self.asleep = false;
        let with_fpu = self.control & FP_ACTIVE != 0 && self.system.has_fpu(self.is_privileged());
        let realigned = self.r[13] & 4 != 0;
        let length = 4 * if with_fpu { FP_FRAME } else { FRAME };
        let frame = self.r[13].wrapping_sub(length) & !7;
        self.r[13] = frame;
        let psr = self.psr & !REALIGNED | if realigned { REALIGNED } else { 0 };
        let [r0, r1, r2, r3, .., r12, _, r14, _] = self.r;
        let words = [r0, r1, r2, r3, r12, r14, return_address, psr];
        let mut failure = None;
        for (at, word) in places(frame).zip(words) {
            failure = self.store(at, 4, word).err().or(failure);
        }
        if with_fpu {
            failure = self.keep_fpu(frame.wrapping_add(4 * FRAME)).err().or(failure);
        }
        let kind = match (self.psr & EXCEPTION != 0, self.uses_process_stack()) {
            (true, _) => 0xFFFF_FFF1,
            (false, false) => 0xFFFF_FFF9,
            (false, true) => 0xFFFF_FFFD,
        };
        self.r[14] = if with_fpu { kind & !0x10 } else { kind };
        let exception = failure.map_or(exception, |fault| self.after_stacking(fault, exception));
        self.clocks += 12;
        self.begin(exception);
    }

    /// A fault of the stack at entry or return (B1.5.14); `bit`: its place in MMFSR and BFSR.
    /// Returns the exception as which it is taken.
    fn stack_fault(&mut self, fault: Fault, bit: u32) -> Option<u32> {
        let (exception, bit) = match fault {
            Fault::DataMpu => (MEM_MANAGE, bit),
            _ => (BUS_FAULT, bit + 8),
        };
        *self.system.word_mut(CFSR) |= 1 << bit;
        self.escalated(exception)
    }

    /// The frame of an exception could not be written: what is handled now. The other waits.
    fn after_stacking(&mut self, fault: Fault, exception: u32) -> u32 {
        let fault = self.stack_fault(fault, 4).unwrap_or(HARD_FAULT);
        let comes_first = self.system.group_priority(fault) < self.system.group_priority(exception);
        let (first, second) = if comes_first { (fault, exception) } else { (exception, fault) };
        set_bit(&mut self.system.pending, second, true);
        first
    }

    fn begin(&mut self, exception: u32) {
        set_bit(&mut self.system.active, exception, true);
        set_bit(&mut self.system.pending, exception, false);
        self.exclusive = None;
        self.psr &= !IT;
        self.switch(exception, self.control & !FP_ACTIVE);
        if let Some(handler) = self.bus.word(self.system.vector(exception)) {
            self.next = handler & !1;
            self.psr = self.psr & !T | if handler & 1 == 0 { 0 } else { T };
        } else {
            *self.system.word_mut(HFSR) |= VECTTBL;
            self.lock_up();
        }
    }

    /// Returns from a handler, or goes on to the next one (B1.5.8).
    pub(super) fn leave(&mut self, kind: u32) -> Done {
        let exception = self.psr & EXCEPTION;
        let with_fpu = kind & 0x10 == 0;
        let (to_handler, process) = match kind | 0x10 {
            0xFFFF_FFF1 => (true, false),
            0xFFFF_FFF9 => (false, false),
            0xFFFF_FFFD => (false, true),
            _ => return Err(Fault::Return),
        };
        let is_last = self.system.active_count() <= 1;
        let fits = to_handler != is_last || !to_handler && self.system.word(CCR) & TO_THREAD != 0;
        if !is_set(&self.system.active, exception) || !fits {
            return Err(Fault::Return);
        }
        if with_fpu && !self.system.has_fpu(true) {
            return Err(Fault::NoCoprocessor);
        }
        set_bit(&mut self.system.active, exception, false);
        self.faultmask &= exception == NMI;
        self.system.latch();
        if let Some(next) = self.next_exception() {
            self.r[14] = kind;
            self.clocks += 6;
            self.begin(next);
            return Ok(());
        }
        let stack = if process { PROCESS_STACK } else { 0 };
        let control = self.control & !(PROCESS_STACK | FP_ACTIVE) | stack;
        self.switch(if to_handler { exception } else { 0 }, control);
        self.restore(with_fpu);
        if (self.psr & EXCEPTION != 0) != to_handler && !self.locked_up {
            self.take(Fault::Return, self.next);
        }
        self.asleep = !to_handler && self.system.word(SCR) & SLEEPONEXIT != 0;
        Ok(())
    }

    fn restore(&mut self, with_fpu: bool) {
        let frame = self.r[13];
        let mut words = [0; FRAME as usize];
        let mut failure = None;
        for (at, word) in places(frame).zip(&mut words) {
            match self.load(at, 4) {
                Ok(read) => *word = read,
                Err(fault) => failure = Some(fault),
            }
        }
        if with_fpu {
            failure = self.restore_fpu(frame.wrapping_add(4 * FRAME)).err().or(failure);
        }
        let [r0, r1, r2, r3, r12, r14, at, psr] = words;
        self.r[..4].copy_from_slice(&[r0, r1, r2, r3]);
        (self.r[12], self.r[14], self.next) = (r12, r14, at & !1);
        let length = 4 * if with_fpu { FP_FRAME } else { FRAME };
        let realigned = if psr & REALIGNED == 0 { 0 } else { 4 };
        self.r[13] = frame.wrapping_add(length).wrapping_add(realigned);
        let control = self.control | if with_fpu { FP_ACTIVE } else { 0 };
        self.psr = self.psr & EXCEPTION | psr & (N | Z | C | V | Q | GE | T | IT);
        self.switch(psr & EXCEPTION, control);
        self.exclusive = None;
        self.clocks += 10;
        if let Some(fault) = failure {
            match self.stack_fault(fault, 3) {
                Some(exception) => self.enter(exception, self.next),
                None => self.lock_up(),
            }
        }
    }

    /// Writes the FPU registers to an exception's frame, or promises to (B1.5.7).
    fn keep_fpu(&mut self, place: u32) -> Done {
        let status = self.system.word(FPCCR);
        if status & LSPEN == 0 {
            return self.store_fpu(place, true);
        }
        let ready = |exception, bit| if self.system.is_enabled(exception) { bit } else { 0 };
        let own = USER | THREAD | HFRDY | MMRDY | BFRDY | MONRDY;
        let status = status & !own
            | LSPACT
            | if self.is_privileged() { 0 } else { USER }
            | if self.psr & EXCEPTION == 0 { THREAD } else { 0 }
            | if self.faultmask { 0 } else { HFRDY }
            | ready(MEM_MANAGE, MMRDY)
            | ready(BUS_FAULT, BFRDY);
        *self.system.word_mut(FPCCR) = status;
        *self.system.word_mut(FPCAR) = place;
        Ok(())
    }

    fn store_fpu(&mut self, place: u32, privileged: bool) -> Done {
        let words = self.s.into_iter().take(16).chain([self.fpscr]);
        for (at, word) in places(place).zip(words) {
            self.store_as(at, 4, word, privileged)?;
        }
        Ok(())
    }

    fn restore_fpu(&mut self, place: u32) -> Done {
        let status = self.system.word_mut(FPCCR);
        if *status & LSPACT != 0 {
            // Nothing has used them since.
            *status &= !LSPACT;
            return Ok(());
        }
        for index in 0..16 {
            self.s[index as usize] = self.load(place.wrapping_add(4 * index), 4)?;
        }
        self.fpscr = self.load(place.wrapping_add(64), 4)? & FPSCR;
        Ok(())
    }

    /// Comes before every instruction of the FPU: is it on, and are registers to be kept first?
    #[inline]
    pub(super) fn claim_fpu(&mut self) -> Done {
        if !self.system.has_fpu(self.is_privileged()) {
            return Err(Fault::NoCoprocessor);
        }
        let status = self.system.word(FPCCR);
        if status & LSPACT != 0 {
            *self.system.word_mut(FPCCR) = status & !LSPACT;
            self.store_fpu(self.system.word(FPCAR), status & USER == 0)?;
        }
        if status & ASPEN != 0 && self.control & FP_ACTIVE == 0 {
            // A new context (B1.5.7, ExecuteFPCheck); the conditions of the one before are not touched: a handler that
            // does not use the FPU leaves them as they are.
            self.fpscr = self.fpscr & !MODES | self.system.word(FPDSCR) & MODES;
            self.control |= FP_ACTIVE;
        }
        Ok(())
    }

    pub(super) fn wait_for(&mut self, event: bool) {
        self.asleep = !(event && std::mem::take(&mut self.event));
        self.attention = true;
    }

    /// What the MPU permits depends on mode and priority: has it changed?
    pub(super) fn protect(&mut self) {
        let negative = self.system.is_negative(self.faultmask);
        let context = self.system.mpu.context(self.is_privileged(), negative);
        if std::mem::replace(&mut self.context, context) != context {
            self.bus.forget();
        }
    }
}
