//! Reset and clock control: oscillators and PLLs that need time to start, the switch of the system
//! clock, gates and resets (RM0468, RCC chapter).
//!
//! While a PLL is on, writes to its input and dividers change nothing, and are not reported:
//! embassy relies on it at every boot.
//!
//! A crystal may be dead or die. With clock security on (`CR.HSECSSON`) the chip then switches to
//! HSI and raises an NMI; without it everything from the crystal stands still until it swings
//! again. The manual leaves open what a PLL without reference does; here its ready flag falls, too,
//! at once.
//!
//! MCO1 goes to TIM17, MCO2 nowhere. Only stored: ready interrupts, clock security of LSE,
//! calibration, low-power gates. A `CPURST` does nothing.

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Write};
use super::clocks::{
    self, CFGR, CSI_HZ, Clocks, D1CCIPR, D1CFGR, D2CCIP1R, D2CCIP2R, D2CFGR, D3CCIPR, HSI_HZ,
    LSE_HZ, LSI_HZ, Pll, Sources, Tones,
};
use super::map::Switch;
use super::registers::{Register, Registers, field, masked, plain};
use crate::machine::Options;
use crate::time::Period;

/// Cause of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Power came.
    PowerOn,
    /// The reset pin.
    Pin,
    /// The program asked for it (`SYSRESETREQ`).
    Software,
    /// The independent watchdog was not fed.
    Watchdog,
    /// The supply fell below the brown-out level, and came back.
    BrownOut,
}

impl ResetCause {
    /// Flags in `RCC_RSR` (RM0468, table of reset sources): CPURSTF 17, D1RSTF 19, D2RSTF 20,
    /// BORRSTF 21, PINRSTF 22, PORRSTF 23, SFTRSTF 24, IWDG1RSTF 26. Every reset also pulls the
    /// reset pin.
    const fn flags(self) -> u32 {
        const PIN: u32 = 1 << 22 | 1 << 17;
        match self {
            Self::PowerOn => 1 << 23 | 1 << 21 | 1 << 20 | 1 << 19 | PIN,
            Self::Pin => PIN,
            Self::Software => 1 << 24 | PIN,
            Self::Watchdog => 1 << 26 | PIN,
            Self::BrownOut => 1 << 21 | PIN,
        }
    }
}

/// The address of `RCC_CR`, used in reports of clocks that change without an access.
pub(super) const CONTROL: u32 = 0x5802_4400;
words! {
    CR: 0x00, PLLCKSELR: 0x28, PLLCFGR: 0x2C, CIFR: 0x64, CICR: 0x68, BDCR: 0x70, CSR: 0x74,
    RSR: 0xD0,
}
/// RSR.RMVF: removes the reset flags.
const REMOVE: u32 = 1 << 16;
/// First and last of the enable registers.
const ENABLES: std::ops::RangeInclusive<u32> = 0xD4..=0xF4;
/// The same registers, from RSR on, once more: "for core 1".
const CORE_1: std::ops::RangeInclusive<u32> = 0x130..=0x17C;

const fn divider(pll: u32) -> u32 {
    0x30 + 8 * pll
}
const fn fraction(pll: u32) -> u32 {
    0x34 + 8 * pll
}

/// Enable and reset registers: the bits that stm32-metapac knows on any STM32H7. Low-power gates
/// are all open after a reset.
#[rustfmt::skip]
const TABLE: &[Register] = &[
    masked(CR, 0x0000_0001, 0x150D_129B), plain(0x04, 0x4000_0000), plain(0x08, 0),
    plain(0x0C, 0x2000_0000), masked(CFGR, 0, 0xFFFC_FFC7), masked(D1CFGR, 0, 0xF7F),
    masked(D2CFGR, 0, 0x770), masked(0x20, 0, 0x70),
    masked(PLLCKSELR, 0x0202_0200, 0x03F3_F3F3), masked(PLLCFGR, 0x01FF_0000, 0x01FF_0FFF),
    masked(divider(0), 0x0101_0280, 0x7F7F_FFFF), masked(fraction(0), 0, 0xFFF8),
    masked(divider(1), 0x0101_0280, 0x7F7F_FFFF), masked(fraction(1), 0, 0xFFF8),
    masked(divider(2), 0x0101_0280, 0x7F7F_FFFF), masked(fraction(2), 0, 0xFFF8),
    masked(D1CCIPR, 0, 0x3001_0133), masked(D2CCIP1R, 0, 0xB137_71C7),
    masked(D2CCIP2R, 0, 0x70F0_333F), masked(D3CCIPR, 0, 0x7FE3_FF07),
    masked(0x60, 0, 0x27F), masked(CIFR, 0, 0), masked(CICR, 0, 0),
    masked(BDCR, 0, 0x1_833D), masked(CSR, 0, 1),
    masked(0x7C, 0, 0x80E9_5031), masked(0x80, 0, 0x0A00_C023), masked(0x84, 0, 0x0003_0271),
    masked(0x88, 0, 0x0328_07FF), masked(0x8C, 0, 0x18), masked(0x90, 0, 0xEAFF_C3FF),
    masked(0x94, 0, 0x0300_0136), masked(0x98, 0, 0x31D7_30F3), masked(0x9C, 0, 0x0420_FEAA),
    masked(0xA0, 0, 0xF), masked(0xA8, 0, 0x3529_FEA9), masked(RSR, 0, 0),
    masked(0xD4, 0, 0xF0E9_5031), masked(0xD8, 0, 0x1E03_C023), masked(0xDC, 0, 0xE003_0271),
    masked(0xE0, 0, 0x1328_07FF), masked(0xE4, 0, 0x58), masked(0xE8, 0, 0xEAFF_CBFF),
    masked(0xEC, 0, 0x0300_0136), masked(0xF0, 0, 0x31D7_30F3),
    masked(0xF4, 0x0001_0000, 0x0421_FEAA),
    plain(0xFC, 0xF0E9_5131), plain(0x100, 0x1E03_C023), plain(0x104, 0xE003_0271),
    plain(0x108, 0x3128_07FF), plain(0x10C, 0x58), plain(0x110, 0xEAFF_CBFF),
    plain(0x114, 0x0300_0136), plain(0x118, 0x31D7_3033), plain(0x11C, 0x0421_FEAA),
];

/// A clock source that has to start: its bit and its ready flag in CR, and its start-up time.
/// Source: STM32H723 data sheet, maximum or typical times of the oscillator tables.
#[rustfmt::skip]
const STARTERS: [(u32, u32, Nanos); 4] = [
    (HSI, 2, Nanos::new(2_000)),
    (CSI, 8, Nanos::new(2_000)),
    (HSI48, 13, Nanos::new(3_500)),
    (HSE, 17, Nanos::new(2_000_000)),
];
const HSI: u32 = 0;
pub(super) const CSI: u32 = 7;
const HSI48: u32 = 12;
const HSI48_HZ: u64 = 48_000_000;
const HSE: u32 = 16;
/// HSECSSON in CR; HSECSSF in CIFR, HSECSSC in CICR.
const SECURITY: u32 = 1 << 19;
const SECURITY_FLAG: u32 = 1 << 10;
/// CFGR.STOPWUCK: what clock security falls back to is CSI.
const FALL_BACK_TO_CSI: u32 = 1 << 6;
/// PLL1's bit in CR; PLL2 and PLL3 are two further each.
const PLL: u32 = 24;
const fn pll_bit(pll: u32) -> u32 {
    PLL + 2 * pll
}
/// Bits in CR of the sources of the system clock, by SW; the first three are also the PLLs'.
const SOURCES: [u32; 4] = [HSI, CSI, HSE, PLL];
/// Data sheet, PLL characteristics, typical.
const LOCK: Nanos = Nanos::new(50_000);
/// Data sheet, LSI characteristics, typical.
const LSI_START: Nanos = Nanos::new(80_000);
/// Data sheet, LSE characteristics, typical.
const LSE_START: Nanos = Nanos::new(2_000_000_000);

/// Places of LSI and LSE in `Rcc::ready`; CR's are at their bit.
const LSI: u32 = 32;
const LSE: u32 = 33;

#[derive(Debug)]
pub(super) struct Rcc {
    registers: Registers,
    /// Time at which each source becomes ready, by its bit in CR.
    ready: [Option<Nanos>; 34],
    options: Options,
    /// HSI's frequency, hertz.
    pub(super) hsi_hz: u64,
    /// Whether the crystal swings when it is asked to.
    crystal: bool,
    /// SWS.
    source: u32,
    /// Until when changes that need no access are taken into account.
    settled: Nanos,
    pub(super) system_ready_at: Option<Nanos>,
}

impl Rcc {
    pub(super) fn new(options: Options) -> Self {
        let ppm = i64::from(options.hsi_deviation_ppm);
        let off = i64::try_from(HSI_HZ).unwrap_or(0) / 1_000_000 * ppm;
        let mut ready = [None; 34];
        ready[HSI as usize] = Some(Nanos::ZERO);
        let mut registers = Registers::new(TABLE);
        registers.set(RSR, ResetCause::PowerOn.flags());
        Self {
            registers,
            ready,
            options,
            hsi_hz: HSI_HZ.saturating_add_signed(off),
            crystal: true,
            source: 0,
            settled: Nanos::ZERO,
            system_ready_at: None,
        }
    }

    /// A reset of the chip. The backup domain stays, unless power was gone.
    pub(super) fn reset(&mut self, cause: ResetCause, now: Nanos) {
        let (flags, backup) = (self.registers.value(RSR), self.registers.value(BDCR));
        let lse = self.ready[LSE as usize];
        *self = Self { crystal: self.crystal, settled: now, ..Self::new(self.options) };
        if cause != ResetCause::PowerOn {
            let held = flags & REMOVE != 0;
            self.registers.set(RSR, if held { REMOVE } else { flags | cause.flags() });
            self.registers.set(BDCR, backup);
            self.ready[LSE as usize] = lse;
        }
    }

    pub(super) fn set_crystal(&mut self, alive: bool, now: Nanos) {
        self.advance(now);
        let was_ready = self.is_ready(HSE);
        self.crystal = alive;
        let secured = self.registers.value(CR) & SECURITY != 0;
        if !alive && was_ready && secured {
            self.fall_back();
        }
        if !alive {
            self.ready[HSE as usize] = None;
            if self.plls_are_fed_by_hse() {
                (0..3).for_each(|pll| self.ready[pll_bit(pll) as usize] = None);
            }
        }
        self.start(now);
    }

    /// PLLSRC.
    fn pll_source(&self) -> usize {
        self.registers.field(PLLCKSELR, 0, 2) as usize
    }

    fn plls_are_fed_by_hse(&self) -> bool {
        self.pll_source() == 2
    }

    /// Clock security: RM0468, "Clock security system on HSE".
    fn fall_back(&mut self) {
        let mut off = SECURITY | 1 << HSE;
        let fed = self.plls_are_fed_by_hse();
        if fed {
            off |= (0..3).map(|pll| 1 << pll_bit(pll)).sum::<u32>();
        }
        let mut on = 0;
        if self.source == 2 || self.source == 3 && fed {
            let configuration = self.registers.value(CFGR);
            let to_csi = configuration & FALL_BACK_TO_CSI != 0;
            self.source = u32::from(to_csi);
            self.registers.set(CFGR, configuration & !7 | self.source);
            on = if to_csi { 1 << CSI } else { 1 << HSI };
        }
        self.registers.set(CR, self.registers.value(CR) & !off | on);
        self.registers.set(CIFR, SECURITY_FLAG);
    }

    /// Whether clock security raises its NMI: until the program clears the flag.
    pub(super) fn raises_nmi(&self) -> bool {
        self.registers.value(CIFR) & SECURITY_FLAG != 0
    }

    /// Whether a source of clocks is, by its bit in CR.
    pub(super) fn is_ready(&self, source: u32) -> bool {
        self.ready[source as usize].is_some_and(|at| at <= self.settled)
    }

    fn pll_is_on(&self, pll: u32) -> bool {
        self.registers.field(CR, pll_bit(pll), 1) != 0
    }

    /// Whether one of `mask`'s bits is set in the enable register, and none in the reset register.
    pub(super) fn is_running(&self, switch: Switch) -> bool {
        self.registers.value(switch.enable) & switch.mask != 0 && !self.holds_in_reset(switch)
    }

    pub(super) fn holds_in_reset(&self, switch: Switch) -> bool {
        switch.reset.is_some_and(|offset| self.registers.value(offset) & switch.mask != 0)
    }

    pub(super) fn memories_run(&self) -> [bool; 2] {
        [29, 30].map(|bit| self.registers.field(0xDC, bit, 1) != 0)
    }

    /// Whether gates or resets may have changed by a write there.
    pub(super) fn switches_at(offset: u32) -> bool {
        let offset = alias(offset);
        ENABLES.contains(&offset) || (0x7C..=0x9C).contains(&offset)
    }

    pub(super) fn read(&self, offset: u32) -> Answer<u32> {
        let offset = alias(offset);
        let stored = self.registers.read(offset)?;
        let ready = |source, flag: u32| u32::from(self.is_ready(source)) << flag;
        Ok(match offset {
            CR => {
                // D1CKRDY, D2CKRDY, and HSIDIVF: dividers change at once.
                let always = 1 << 14 | 1 << 15 | 1 << 5;
                let plls = (0..3).map(pll_bit).map(|bit| ready(bit, bit + 1));
                let starters = STARTERS.iter().map(|&(bit, flag, _)| ready(bit, flag));
                starters.chain(plls).fold(stored | always, |sum, flag| sum | flag)
            }
            CFGR => stored | self.source << 3,
            BDCR => stored | ready(LSE, 1),
            CSR => stored | ready(LSI, 1),
            _ => stored,
        })
    }

    /// `backup_unlocked`: `PWR_CR1.DBP`.
    pub(super) fn write(&mut self, write: Write, now: Nanos, backup_unlocked: bool) -> Answer {
        self.advance(now);
        let write = write.at(alias(write.offset));
        let off = |pll, mask| if self.pll_is_on(pll) { 0 } else { mask };
        match write.offset {
            CR => {
                // The source of the system clock cannot be switched off.
                let before = self.registers.value(CR);
                self.registers.write(write)?;
                // Clock security is only ever switched on.
                let held = before & (self.in_use() | SECURITY);
                self.registers.set(CR, self.registers.value(CR) | held);
            }
            CICR => {
                self.registers.set(CIFR, self.registers.value(CIFR) & !write.ones());
            }
            PLLCKSELR => {
                let sources = off(0, 3) & off(1, 3) & off(2, 3);
                let dividers = off(0, 0x3F << 4) | off(1, 0x3F << 12) | off(2, 0x3F << 20);
                self.registers.write_only(write, sources | dividers)?;
            }
            PLLCFGR => {
                let fractions = 0x111;
                let each = |pll: u32| off(pll, 0xE << (4 * pll) | 7 << (16 + 3 * pll));
                self.registers.write_only(write, fractions | each(0) | each(1) | each(2))?;
            }
            0x30 | 0x38 | 0x40 => {
                let unlocked = off((write.offset - 0x30) / 8, u32::MAX);
                self.registers.write_only(write, unlocked)?;
            }
            BDCR if !backup_unlocked => return Err(AccessKind::Protected),
            BDCR => {
                const RTCSEL: u32 = 3 << 8;
                const BDRST: u32 = 1 << 16;
                let old = self.registers.value(BDCR);
                // RTCSEL is written once; only a reset of the domain lets it go.
                let unlocked = if old & RTCSEL == 0 { u32::MAX } else { !RTCSEL };
                self.registers.write_only(write, unlocked)?;
                if self.registers.value(BDCR) & BDRST != 0 {
                    self.registers.set(BDCR, BDRST);
                }
            }
            RSR if write.ones() & REMOVE != 0 => {
                self.registers.set(RSR, if self.options.removal_stays { REMOVE } else { 0 });
            }
            RSR if write.zeros() & REMOVE != 0 => {
                self.registers.set(RSR, self.registers.value(RSR) & !REMOVE);
            }
            _ => self.registers.write(write)?,
        }
        self.start(now);
        Ok(())
    }

    /// Bits of CR that the system clock needs.
    fn in_use(&self) -> u32 {
        match self.source {
            3 => 1 << PLL | 1 << SOURCES[self.pll_source().min(2)],
            source => 1 << SOURCES[source as usize],
        }
    }

    /// Notes when sources that were switched on are ready, and which were switched off.
    fn start(&mut self, now: Nanos) {
        for (bit, _, time) in STARTERS {
            let is_on = self.registers.value(CR) & 1 << bit != 0;
            let swings = bit != HSE || self.crystal;
            self.note(bit, is_on, swings.then_some(now + time));
        }
        self.note(LSI, self.registers.value(CSR) & 1 != 0, Some(now + LSI_START));
        self.note(LSE, self.registers.value(BDCR) & 1 != 0, Some(now + LSE_START));
        for pll in 0..3 {
            // Its input may still be starting.
            let input = SOURCES[..3].get(self.pll_source());
            let input = input.and_then(|&input| self.ready[input as usize]);
            let locks = clocks::pll(self.pll_input(self.hsi_hz), &self.pll(pll)).is_some();
            let at = input.filter(|_| locks).map(|input| now.max(input) + LOCK);
            self.note(pll_bit(pll), self.pll_is_on(pll), at);
        }
        self.advance(now);
    }

    /// A source that has just been switched on is ready at that time.
    fn note(&mut self, source: u32, is_on: bool, at: Option<Nanos>) {
        let ready = &mut self.ready[source as usize];
        *ready = ready.or(at).filter(|_| is_on);
    }

    /// Nominal and actual frequency at the PLLs' input, running or not.
    fn pll_input(&self, hsi_hz: u64) -> [u64; 2] {
        match self.pll_source() {
            0 => [HSI_HZ, hsi_hz].map(|hz| hz >> self.hsi_shift()),
            1 => [CSI_HZ; 2],
            2 => [self.options.board.crystal_hz; 2],
            _ => [0; 2],
        }
    }

    /// HSIDIV.
    fn hsi_shift(&self) -> u32 {
        self.registers.field(CR, 3, 2)
    }

    fn pll(&self, pll: u32) -> Pll {
        let [config, dividers] = [PLLCFGR, divider(pll)].map(|at| self.registers.value(at));
        let has_fraction = field(config, 4 * pll, 1) != 0;
        let output = |index, shift| {
            let enabled = field(config, 16 + 3 * pll + index, 1) != 0;
            enabled.then(|| u64::from(field(dividers, shift, 7)) + 1)
        };
        Pll {
            pre_divider: self.registers.field(PLLCKSELR, 4 + 8 * pll, 6),
            multiplier: field(dividers, 0, 9) + 1,
            fraction: if has_fraction { self.registers.field(fraction(pll), 3, 13) } else { 0 },
            wide: field(config, 4 * pll + 1, 1) == 0,
            range: field(config, 4 * pll + 2, 2),
            dividers: [output(0, 9), output(1, 16), output(2, 24)],
        }
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        self.ready.iter().flatten().copied().filter(|&at| at > self.settled).min()
    }

    /// Sources that are due become ready; the system clock is switched when its new source is.
    pub(super) fn advance(&mut self, now: Nanos) {
        self.settled = now.max(self.settled);
        let wanted = self.registers.field(CFGR, 0, 3);
        let Some(&bit) = SOURCES.get(wanted as usize) else { return };
        if wanted != self.source && self.is_ready(bit) {
            self.source = wanted;
            if wanted == 3 && self.system_ready_at.is_none() {
                self.system_ready_at = Some(now);
            }
        }
    }

    pub(super) fn tones(&self) -> Tones {
        let config = self.registers.value(CFGR);
        let Sources { hsi, hse, lse, plls, .. } = self.sources(self.hsi_hz);
        // RM0468, RCC_CFGR.RTCPRE: 0 and 1 are no clock.
        let for_rtc = field(config, 8, 6);
        // MCO1, MCO1PRE: 0 is no clock.
        let output = match field(config, 22, 3) {
            0 => hsi,
            1 => lse,
            2 => hse,
            3 => plls[0][1],
            4 => self.if_ready(HSI48, HSI48_HZ),
            _ => 0,
        };
        let divided = |hz, by: u32| Period::new(by.into(), hz);
        let lsi = divided(self.if_ready(LSI, LSI_HZ), 1);
        let hse = divided(hse, for_rtc).filter(|_| for_rtc > 1);
        [lsi, divided(lse, 1), hse, divided(output, field(config, 18, 4)), None]
    }

    /// The clocks with HSI at this frequency: limits are those of nominal ones.
    pub(super) fn clocks(&self, hsi_hz: u64) -> Clocks {
        Clocks::new(&self.sources(hsi_hz), self.source, |at| self.registers.value(at))
    }

    fn if_ready(&self, source: u32, hz: u64) -> u64 {
        if self.is_ready(source) { hz } else { 0 }
    }

    fn sources(&self, hsi_hz: u64) -> Sources {
        let outputs = |pll| {
            let outputs = clocks::pll(self.pll_input(hsi_hz), &self.pll(pll)).unwrap_or_default();
            outputs.map(|hz| self.if_ready(pll_bit(pll), hz))
        };
        Sources {
            hsi: self.if_ready(HSI, hsi_hz >> self.hsi_shift()),
            csi: self.if_ready(CSI, CSI_HZ),
            hse: self.if_ready(HSE, self.options.board.crystal_hz),
            lse: self.if_ready(LSE, LSE_HZ),
            plls: [0, 1, 2].map(outputs),
        }
    }
}

/// The register that an offset means.
fn alias(offset: u32) -> u32 {
    if CORE_1.contains(&offset) { offset - 0x60 } else { offset }
}
