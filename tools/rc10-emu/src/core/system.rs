//! The core's own registers: from `0xE000_0000` on (B3.2 to B3.5, C1.8), and of MRS and MSR (B5.2).

use super::exceptions::{HARD_FAULT, NMI, PEND_SV, SYSTICK, is_set, set_bit};
use super::mpu::Mpu;
use super::{
    C, Core, Done, EXCEPTION, FP_ACTIVE, GE, INTERRUPT_WORDS, N, PROCESS_STACK, Q, UNPRIVILEGED, V,
    Z,
};

/// Bits of a set of exceptions, in words of 32.
pub(super) const SET_WORDS: usize = 8;

/// Words of the System Control Space, by their addresses.
const SYST_CSR: usize = word(0x010);
const SYST_RVR: usize = word(0x014);
const SYST_CVR: usize = word(0x018);
const VTOR: usize = word(0xD08);
pub(super) const SCR: usize = word(0xD10);
pub(super) const CCR: usize = word(0xD14);
pub(super) const SHCSR: usize = word(0xD24);
pub(super) const CFSR: usize = word(0xD28);
pub(super) const HFSR: usize = word(0xD2C);
pub(super) const MMFAR: usize = word(0xD34);
pub(super) const BFAR: usize = word(0xD38);
const CPACR: usize = word(0xD88);
const DEMCR: usize = word(0xDFC);
pub(super) const FPCCR: usize = word(0xF34);
pub(super) const FPCAR: usize = word(0xF38);
pub(super) const FPDSCR: usize = word(0xF3C);
const MVFR0: usize = word(0xF40);

const fn word(offset: usize) -> usize {
    offset / 4
}

/// `SYST_CSR.COUNTFLAG`.
const COUNTED: u32 = 1 << 16;
/// `DEMCR.TRCENA`.
const TRACE: u32 = 1 << 24;

/// Registers with a value after a reset, which is zero in all others, and the bits that keep what is
/// written to them: a Cortex-M7 r1p0 with FPU for both precisions.
const REGISTERS: [(usize, u32, u32); 17] = [
    (SYST_RVR, 0, 0x00FF_FFFF),
    // There is no reference clock, and no calibration.
    (word(0x01C), 0xC000_0000, 0),
    (word(0xD00), 0x411F_C271, 0),
    (VTOR, crate::memory::FLASH, 0xFFFF_FF80),
    (SCR, 0, 0x1E),
    // STKALIGN: frames of exceptions are always aligned.
    (CCR, 1 << 9, 0x11B),
    (MMFAR, 0, u32::MAX),
    (BFAR, 0, u32::MAX),
    (word(0xD3C), 0, u32::MAX),
    (CPACR, 0, 0x00F0_0000),
    (DEMCR, 0, TRACE),
    // ASPEN, LSPEN.
    (FPCCR, 0xC000_0000, 0xC000_017B),
    (FPCAR, 0, !7),
    (FPDSCR, 0, 0x03C0_0000),
    (MVFR0, 0x1011_0221, 0),
    (MVFR0 + 1, 0x1200_0011, 0),
    (MVFR0 + 2, 0x0000_0040, 0),
];

/// Exceptions with their bits in `SHCSR`: active, and pending.
const SHCSR_ACTIVE: [(u32, u32); 7] =
    [(4, 0), (5, 1), (6, 3), (11, 7), (12, 8), (PEND_SV, 10), (SYSTICK, 11)];
const SHCSR_PENDING: [(u32, u32); 4] = [(6, 12), (4, 13), (5, 14), (11, 15)];
/// Bits of `ICSR` that make an exception pending, or take that back.
const ICSR_PENDING: [(u32, u32, bool); 5] = [
    (31, NMI, true),
    (28, PEND_SV, true),
    (27, PEND_SV, false),
    (26, SYSTICK, true),
    (25, SYSTICK, false),
];

/// Whether an address is the core's own: between TPIU and ROM table is the chip's debug unit.
pub(super) const fn is_own(address: u32) -> bool {
    matches!(address, 0xE000_0000..0xE004_2000 | 0xE00F_F000..0xE010_0000)
}

pub(super) struct System {
    words: [u32; 1024],
    pub(super) pending: [u32; SET_WORDS],
    pub(super) active: [u32; SET_WORDS],
    pub(super) enabled: [u32; SET_WORDS],
    pub(super) levels: [u32; INTERRUPT_WORDS],
    pub(super) nmi: bool,
    pub(super) group: u32,
    pub(super) wants_reset: bool,
    pub(super) mpu: Mpu,
    /// `DWT_CTRL.CYCCNTENA`, and whether its counter counts.
    dwt_enabled: bool,
    counts_cycles: bool,
    pub(super) cycles: u32,
}

impl System {
    pub(super) fn new() -> Self {
        let mut words = [0; 1024];
        REGISTERS.iter().for_each(|&(word, value, _)| words[word] = value);
        let mut enabled = [0; SET_WORDS];
        // SVCall, PendSV and SysTick, and what is more urgent than every priority.
        enabled[0] = 1 << HARD_FAULT | 1 << NMI | 1 << 11 | 1 << PEND_SV | 1 << SYSTICK;
        Self {
            words,
            pending: [0; SET_WORDS],
            active: [0; SET_WORDS],
            enabled,
            levels: [0; INTERRUPT_WORDS],
            nmi: false,
            group: 0,
            wants_reset: false,
            mpu: Mpu::default(),
            dwt_enabled: false,
            counts_cycles: false,
            cycles: 0,
        }
    }

    #[inline]
    pub(super) const fn word(&self, word: usize) -> u32 {
        self.words[word]
    }

    pub(super) const fn word_mut(&mut self, word: usize) -> &mut u32 {
        &mut self.words[word]
    }

    pub(super) const fn vector(&self, exception: u32) -> u32 {
        self.words[VTOR].wrapping_add(4 * exception)
    }

    #[inline]
    pub(super) const fn has_fpu(&self, privileged: bool) -> bool {
        let access = self.words[CPACR] >> 20 & 3;
        access == 3 || access == 1 && privileged
    }

    pub(super) const fn priority(&self, exception: u32) -> u32 {
        let exception = exception & 0xFF;
        let byte = if exception < 16 { 0xD14 + exception } else { 0x3F0 + exception };
        self.words[byte as usize / 4] >> (8 * (byte & 3)) & 0xFF
    }

    pub(super) const fn timer_runs(&self) -> bool {
        self.words[SYST_CSR] & 1 != 0 && self.words[SYST_RVR] != 0
    }

    /// Lets the timer count; whether its exception became pending.
    pub(super) fn count(&mut self, clocks: u64) -> bool {
        let (mut left, mut has_ended) = (clocks, false);
        while left > 0 && self.timer_runs() {
            let reload = self.words[SYST_RVR];
            let value = &mut self.words[SYST_CVR];
            let step = u64::from(*value).min(left).max(1);
            has_ended |= u64::from(*value) == step;
            // From zero it goes on in the next clock.
            *value = if *value == 0 { reload } else { *value - step as u32 };
            left -= step;
        }
        let interrupts = has_ended && self.words[SYST_CSR] & 2 != 0;
        self.words[SYST_CSR] |= if has_ended { COUNTED } else { 0 };
        self.pending[0] |= u32::from(interrupts) << SYSTICK;
        interrupts
    }

    #[inline]
    pub(super) const fn count_cycles(&mut self, clocks: u64) {
        if self.counts_cycles {
            self.cycles = self.cycles.wrapping_add(clocks as u32);
        }
    }

    /// An interrupt whose level is high is pending, unless it is being handled.
    pub(super) fn latch(&mut self) {
        self.pending[0] |= u32::from(self.nmi) << NMI;
        for (index, level) in self.levels.into_iter().enumerate() {
            self.pending[index] |= level << 16 & !self.active[index];
            self.pending[index + 1] |= level >> 16 & !self.active[index + 1];
        }
    }

    /// 32 external interrupts of a set of exceptions.
    fn interrupts(set: &[u32; SET_WORDS], index: usize) -> u32 {
        set[index] >> 16 | set.get(index + 1).map_or(0, |next| next << 16)
    }

    /// Adds external interrupts to a set, or takes them out.
    fn change(set: &mut [u32; SET_WORDS], index: usize, bits: u32, to: bool) {
        let mut change = |word: usize, bits: u32| {
            if let Some(word) = set.get_mut(word) {
                *word = if to { *word | bits } else { *word & !bits };
            }
        };
        change(index, bits << 16);
        change(index + 1, bits >> 16);
    }

    /// ICSR: what is executed, what comes next, whether it is the only one.
    fn control_state(&self, exception: u32) -> u32 {
        let next = self.most_urgent().map_or(0, |(next, _)| next);
        let external = self.pending[0] >> 16 != 0 || self.pending[1..].iter().any(|&set| set != 0);
        let is_base = self.active_count() <= 1;
        let pending = ICSR_PENDING
            .iter()
            .filter(|&&(_, exception, to)| to && is_set(&self.pending, exception));
        pending.fold(exception, |state, (bit, ..)| state | 1 << bit)
            | u32::from(is_base) << 11
            | next << 12
            | u32::from(external) << 22
    }

    fn handler_state(&self) -> u32 {
        let bits = |pairs: &[(u32, u32)], set| {
            let of_set = pairs.iter().filter(|&&(exception, _)| is_set(set, exception));
            of_set.fold(0, |state, (_, bit)| state | 1 << bit)
        };
        self.words[SHCSR] | bits(&SHCSR_ACTIVE, &self.active) | bits(&SHCSR_PENDING, &self.pending)
    }

    fn read(&mut self, offset: usize, exception: u32, has_effect: bool) -> u32 {
        let index = offset / 4 % SET_WORDS;
        match offset {
            0x010 => {
                let status = self.words[SYST_CSR];
                self.words[SYST_CSR] &= if has_effect { !COUNTED } else { u32::MAX };
                status
            }
            0x100..0x120 | 0x180..0x1A0 => Self::interrupts(&self.enabled, index),
            0x200..0x220 | 0x280..0x2A0 => Self::interrupts(&self.pending, index),
            0x300..0x320 => Self::interrupts(&self.active, index),
            0xD04 => self.control_state(exception),
            0xD0C => 0xFA05_0000 | self.group << 8,
            0xD24 => self.handler_state(),
            0xD90..0xDBC => self.mpu.read(offset as u32 - 0xD90),
            _ => self.words[offset / 4],
        }
    }

    fn write(&mut self, offset: usize, value: u32) {
        let (word, index) = (offset / 4, offset / 4 % SET_WORDS);
        match offset {
            0x010 => self.words[SYST_CSR] = self.words[SYST_CSR] & COUNTED | value & 7,
            0x018 => {
                self.words[SYST_CVR] = 0;
                self.words[SYST_CSR] &= !COUNTED;
            }
            0x100..0x120 => Self::change(&mut self.enabled, index, value, true),
            0x180..0x1A0 => Self::change(&mut self.enabled, index, value, false),
            0x200..0x220 => Self::change(&mut self.pending, index, value, true),
            0x280..0x2A0 => Self::change(&mut self.pending, index, value, false),
            // Four of the eight bits of a priority exist.
            0x400..0x4F0 | 0xD18..0xD24 => self.words[word] = value & 0xF0F0_F0F0,
            0xD04 => {
                let asked = ICSR_PENDING.iter().filter(|&&(bit, ..)| value >> bit & 1 != 0);
                asked.for_each(|&(_, exception, to)| set_bit(&mut self.pending, exception, to));
            }
            0xD0C if value >> 16 == 0x05FA => {
                self.group = value >> 8 & 7;
                self.wants_reset |= value & 1 << 2 != 0;
                if value & 1 << 1 != 0 {
                    self.active = [0; SET_WORDS];
                }
            }
            0xD24 => {
                self.words[SHCSR] = value & 7 << 16;
                for (exception, bit) in SHCSR_PENDING {
                    set_bit(&mut self.pending, exception, value >> bit & 1 != 0);
                }
            }
            0xD28 | 0xD2C => self.words[word] &= !value,
            0xD90..0xDBC => self.mpu.write(offset as u32 - 0xD90, value),
            0xF00 => {
                Self::change(&mut self.pending, value as usize / 32 % 16, 1 << (value & 31), true);
            }
            _ => {
                for &(.., bits) in REGISTERS.iter().filter(|(kept, ..)| *kept == word) {
                    self.words[word] = self.words[word] & !bits | value & bits;
                }
            }
        }
    }
}

impl Core {
    /// Clocks until the core's own timer (`SysTick`) would end its sleep, if it runs.
    pub(crate) fn clocks_until_timer(&self) -> Option<u64> {
        let [value, reload] = [SYST_CVR, SYST_RVR].map(|word| self.system.word(word));
        // It reloads in the clock after zero.
        self.system.timer_runs().then(|| u64::from(if value == 0 { reload + 1 } else { value }))
    }

    pub(super) fn read_system(&mut self, address: u32, has_effect: bool) -> u32 {
        match address {
            // DWT: CTRL says that there are no comparators, no traces and no profiling counters.
            0xE000_1000 => 0x0D00_0000 | u32::from(self.system.dwt_enabled),
            0xE000_1004 => self.system.cycles,
            0xE000_101C => self.at,
            0xE000_E000..0xE000_F000 => {
                self.system.read((address & 0xFFF) as usize, self.psr & EXCEPTION, has_effect)
            }
            _ => 0,
        }
    }

    pub(super) fn write_system(&mut self, address: u32, value: u32) {
        let traces = self.system.word(DEMCR) & TRACE != 0;
        match address {
            0xE000_1000 if traces => self.system.dwt_enabled = value & 1 != 0,
            0xE000_1004 if traces => self.system.cycles = value,
            0xE000_E000..0xE000_F000 => self.system.write((address & 0xFFF) as usize, value),
            _ => {}
        }
        self.system.counts_cycles = self.system.dwt_enabled && self.system.word(DEMCR) & TRACE != 0;
        self.attention = true;
        self.protect();
        if matches!(address, 0xE000_ED90..0xE000_EDBC) {
            self.bus.forget();
        }
    }

    /// MRS (B5.2.2).
    pub(super) fn read_special(&mut self, number: u32, to: u32) -> Done {
        let privileged = self.is_privileged();
        let flags = N | Z | C | V | Q | GE;
        let value = match number {
            0 | 2 => self.psr & flags,
            1 | 3 => self.psr & (flags | EXCEPTION),
            5 | 7 => self.psr & EXCEPTION,
            8 => *self.stack(false),
            9 => *self.stack(true),
            16 if privileged => self.primask.into(),
            17 | 18 if privileged => self.basepri.into(),
            19 if privileged => self.faultmask.into(),
            20 => self.control,
            _ => 0,
        };
        self.set(to & 15, value);
        Ok(())
    }

    /// MSR (B5.2.3); of the flags those that `mask` says.
    pub(super) fn write_special(&mut self, number: u32, mask: u32, from: u32) -> Done {
        let value = self.get(from);
        self.attention = true;
        match number {
            0..=3 => {
                let of_flags = if mask & 2 == 0 { 0 } else { N | Z | C | V | Q };
                let bits = of_flags | if mask & 1 == 0 { 0 } else { GE };
                self.psr = self.psr & !bits | value & bits;
            }
            _ if !self.is_privileged() => {}
            8 => *self.stack(false) = value & !3,
            9 => *self.stack(true) = value & !3,
            16 => self.primask = value & 1 != 0,
            17 => self.basepri = value as u8 & 0xF0,
            18 => {
                let (new, old) = (value as u8 & 0xF0, self.basepri);
                self.basepri = if new != 0 && (old == 0 || new < old) { new } else { old };
            }
            19 => self.set_faultmask(value & 1 != 0),
            20 => {
                let in_handler = self.psr & EXCEPTION != 0;
                let stack = if in_handler { 0 } else { PROCESS_STACK };
                let bits = UNPRIVILEGED | FP_ACTIVE | stack;
                self.switch(self.psr & EXCEPTION, self.control & !bits | value & bits);
            }
            _ => {}
        }
        self.protect();
        Ok(())
    }

    /// FAULTMASK cannot be set where it would change nothing.
    pub(super) fn set_faultmask(&mut self, to: bool) {
        self.faultmask = to && (self.faultmask || self.execution_priority() > -1);
    }
}
