//! ADC1: regular sequences started by software (RM0468, ADC chapter).
//!
//! Modelled: deep power-down, start-up and calibration times, channel preselection, sampling times,
//! resolutions, sequences, once or continuously, oversampling without shifts to the left, overrun,
//! DMA requests. A converter is exact; each conversion is an event.
//! Not modelled, and reported when asked for: triggers, injected channels, differential inputs,
//! watchdogs, offsets, discontinuous mode, AUTDLY, dual mode, ADC2 and ADC3, the channels inside of
//! the chip.
//! Not modelled, and not reported: the mode of an input's pin, and the switches of PC2 and PC3
//! (`PMCR`), which lead to inputs 12 and 13: voltages always come in.

use std::fmt;

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Write};
use super::clocks::{Clocks, Limit, PRESCALERS, TooFast};
use super::registers::{Register, Registers, field, fixed, masked, plain};
use crate::board::Pin;
use crate::time::time_of;

/// Number of its interrupt, and DMAMUX1's of its request. Source: stm32-metapac.
const INTERRUPT: usize = 18;
const REQUEST: u32 = 9;
/// The reference: VDDA, in microvolts.
const REFERENCE: u64 = 3_300_000;

/// Pins of its inputs `INP0` ..= `INP19`. Source: stm32-metapac; 0 and 1 are pads of larger
/// packages.
const INPUTS: [&str; 20] = [
    "", "", "F11", "A6", "C4", "B1", "F12", "A7", "C5", "B0", "C0", "C1", "C2", "C3", "A2", "A3",
    "A0", "A1", "A4", "A5",
];

/// Sampling times in half clocks, by `SMP`. Source: RM0468, `ADC_SMPR1`.
const SAMPLING: [u64; 8] = [3, 5, 17, 33, 65, 129, 775, 1_621];
/// Highest clock by `BOOST`, hertz. Source: RM0468, `ADC_CR`.
const BOOSTS: [u64; 4] = [6_250_000, 12_500_000, 25_000_000, 50_000_000];

/// Time until the regulator is up: data sheet, ADC characteristics, `tADCVREG_STUP`, maximum;
/// quoted from memory.
const REGULATOR: Nanos = Nanos::new(10_000);
/// Clocks of a calibration of the offset: not confirmed. Quoted from memory of the data sheet's ADC
/// characteristics; ST's drivers for Linux and U-Boot have 20 (`STM32H7_ADC_CALIB_TIMEOUT_US`).
const CALIBRATION: u64 = 1_280;
/// The same with linearity, at most. Source: ST's HAL, `ADC_CALIBRATION_TIMEOUT` of
/// `stm32h7xx_hal_adc_ex.c`. ST's drivers have 131,072 for Linux and 16,384 for U-Boot.
const LINEARITY: u64 = 165_010;
/// Clocks from ADEN to ADRDY: "one conversion cycle", data sheet, ADC characteristics, `tSTAB`;
/// quoted from memory.
const STABLE: u64 = 10;

words! { IER: 0x04, CFGR: 0x0C, CFGR2: 0x10 }
const SMPR: [u32; 2] = [0x14, 0x18];
const PCSEL: u32 = 0x1C;
const SQR: [u32; 4] = [0x30, 0x34, 0x38, 0x3C];

/// Registers that only store; DIFSEL and CALFACT read as zero. JQDIS is set in CFGR.
const TABLE: &[Register] = &[
    masked(IER, 0, 0x7FF),
    plain(CFGR, 1 << 31),
    plain(CFGR2, 0),
    masked(SMPR[0], 0, 0x3FFF_FFFF),
    masked(SMPR[1], 0, 0x3FFF_FFFF),
    masked(PCSEL, 0, 0xF_FFFF),
    plain(SQR[0], 0),
    plain(SQR[1], 0),
    plain(SQR[2], 0),
    plain(SQR[3], 0),
    fixed(0xC0, 0),
    fixed(0xC4, 0),
    fixed(0xC8, 0),
];

// CR.
bits! {
    ADEN: 0, ADDIS: 1, ADSTART: 2, JADSTART: 3, ADSTP: 4, JADSTP: 5, ADCALLIN: 16, ADVREGEN: 28,
    DEEPPWD: 29, ADCAL: 31,
}
/// Bits of CR that only keep what is written: BOOST, ADCALLIN, LINCALRDYW1 to 6, ADCALDIF.
const CR_STORED: u32 = 3 << 8 | ADCALLIN | 0x3F << 22 | 1 << 30;
// ISR.
bits! { ADRDY: 0, EOSMP: 1, EOC: 2, EOS: 3, OVR: 4, LDORDY: 12 }
// CFGR.
const EXTEN: u32 = 3 << 10;
const OVRMOD: u32 = 1 << 12;
const CONT: u32 = 1 << 13;
/// AUTDLY; DISCEN; JDISCEN, JQM; AWD1EN, JAWD1EN, JAUTO.
const CFGR_UNMODELLED: u32 = EXTEN | 1 << 14 | 1 << 16 | 3 << 20 | 7 << 23;
// CFGR2.
const ROVSE: u32 = 1 << 0;
/// JOVSE, TROVS, ROVSM, RSHIFT1 to 4, LSHIFT.
const CFGR2_UNMODELLED: u32 = 1 << 1 | 0x3F << 9 | 0xF << 28;

/// A use of ADC1 against the manual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcFault {
    /// The regulator is off, or switched on less than 10 us ago.
    RegulatorNotUp,
    /// A conversion is started before `ADRDY`.
    NotReady,
    /// A channel is converted that is not preselected in `PCSEL`: its switch is open.
    NotPreselected(u8),
    /// There is no clock to calibrate, start or convert with.
    NoClock,
}

impl fmt::Display for AdcFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RegulatorNotUp => f.write_str("ADC1's regulator is not up yet"),
            Self::NotReady => f.write_str("ADC1 is to convert, and has no ADRDY"),
            Self::NotPreselected(channel) => {
                write!(f, "ADC1 converts channel {channel}, which is not preselected (PCSEL)")
            }
            Self::NoClock => f.write_str("ADC1 has no clock"),
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Work {
    Calibrates,
    Starts,
    /// The rank in the sequence, 0 for the first.
    Converts(usize),
}

#[derive(Debug, Default)]
pub(super) struct Adc {
    registers: Registers,
    flags: u32,
    control: u32,
    data: u32,
    /// CCR.
    common: u32,
    regulated_at: Option<Nanos>,
    /// The present work, and its end.
    work: Option<(Work, Nanos)>,
    bus_hz: u64,
    kernel_hz: u64,
    /// Voltages at the inputs, in microvolts.
    inputs: [u32; INPUTS.len()],
    /// Whether it ends nothing that it has begun.
    fails: bool,
}

impl Adc {
    pub(super) fn new() -> Self {
        Self { registers: Registers::new(TABLE), control: DEEPPWD, ..Self::default() }
    }

    /// The voltages outside stay, and a defect.
    pub(super) fn reset(&mut self) {
        let Self { bus_hz, kernel_hz, inputs, fails, .. } = *self;
        *self = Self { bus_hz, kernel_hz, inputs, fails, ..Self::new() };
    }

    /// Sets whether it ends no work. When it does again, what would have ended meanwhile ends.
    pub(super) fn set_fails(&mut self, fails: bool, now: Nanos) {
        self.fails = fails;
        if let Some((_, until)) = &mut self.work {
            *until = now.max(*until);
        }
    }

    /// Its clocks from now on. One that changes counts for what begins then.
    pub(super) const fn set_clocks(&mut self, clocks: &Clocks, runs: bool) {
        (self.bus_hz, self.kernel_hz) = if runs { (clocks.bus, clocks.adc) } else { (0, 0) };
    }

    /// The voltage at a pin from now on. `false`: no input of this converter is there.
    pub(super) fn set_voltage(&mut self, pin: Pin, microvolts: u32) -> bool {
        let name = format!("{}{}", pin.0, pin.1);
        let input = INPUTS.iter().position(|input| *input == name);
        input.map(|input| self.inputs[input] = microvolts).is_some()
    }

    /// Half clocks a second of the analog part, which has half of the given clock. Source: RM0433
    /// Rev 7, figure 136, as stm32h7xx-hal's `adc.rs` quotes it; ST's HAL
    /// (`ADC_ConfigureBoostMode`).
    fn half_clocks_hz(&self) -> u64 {
        self.half_clocks_of(self.bus_hz, self.kernel_hz)
    }

    fn half_clocks_of(&self, bus_hz: u64, kernel_hz: u64) -> u64 {
        match field(self.common, 16, 2) {
            0 => PRESCALERS.get(field(self.common, 18, 4) as usize).map_or(0, |by| kernel_hz / by),
            1 => bus_hz,
            2 => bus_hz / 2,
            _ => bus_hz / 4,
        }
    }

    /// The nominal clock, if that is too fast.
    pub(super) fn too_fast(&self, nominal: &Clocks) -> Option<TooFast> {
        let hz = self.half_clocks_of(nominal.bus, nominal.adc) / 2;
        let limit = BOOSTS[field(self.control, 8, 2) as usize % BOOSTS.len()];
        let is_on = self.control & ADEN != 0 && self.half_clocks_hz() > 0;
        let clock = "ADC1's clock";
        (is_on && hz > limit).then_some(TooFast { clock, hz, limit: Limit::Boost(limit) })
    }

    fn after(&self, half_clocks: u64, now: Nanos) -> Answer<Nanos> {
        let hz = self.half_clocks_hz();
        AccessKind::Adc(AdcFault::NoClock).when(hz == 0)?;
        Ok(now + time_of(half_clocks, hz))
    }

    fn is_regulated(&self, now: Nanos) -> bool {
        self.regulated_at.is_some_and(|at| at <= now)
    }

    pub(super) fn interrupt(&self) -> Option<usize> {
        (self.flags & self.registers.value(IER) != 0).then_some(INTERRUPT)
    }

    pub(super) fn requests(&self, request: u32) -> bool {
        // DMNGT: by DMA, once or round and round.
        let by_dma = self.registers.value(CFGR) & 1 != 0;
        request == REQUEST && by_dma && self.flags & EOC != 0
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Answer<u32> {
        Ok(match offset {
            0x00 => self.flags | if self.is_regulated(now) { LDORDY } else { 0 },
            0x08 => self.control,
            0x40 => {
                self.flags &= !EOC;
                self.data
            }
            _ => return self.registers.read(offset),
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        let converts = self.control & ADSTART != 0;
        match write.offset {
            0x00 => self.flags &= !write.ones(),
            0x08 => return self.control(write.over(self.control), now),
            0x40 => {}
            // RM0468: allowed only while ADSTART is zero.
            CFGR..=0x3C if converts => return Err(AccessKind::Protected),
            // Differential inputs; calibration factors.
            0xC0 if write.ones() != 0 => return Err(AccessKind::Unmodelled),
            0xC4 | 0xC8 => return Err(AccessKind::Unmodelled),
            _ => self.registers.write(write)?,
        }
        // DMNGT of the DFSDM.
        let config = self.registers.value(CFGR);
        let unmodelled = match write.offset {
            CFGR => config & CFGR_UNMODELLED != 0 || config & 3 == 2,
            CFGR2 => self.registers.value(CFGR2) & CFGR2_UNMODELLED != 0,
            _ => false,
        };
        AccessKind::Unmodelled.when(unmodelled)
    }

    /// CCR and the other registers that it shares with ADC2.
    pub(super) const fn read_common(&self, offset: u32) -> Answer<u32> {
        match offset {
            // CSR: the master's flags.
            0x00 => Ok(self.flags & 0x7FF),
            0x08 => Ok(self.common),
            _ => Err(AccessKind::Unmodelled),
        }
    }

    pub(super) fn write_common(&mut self, write: Write) -> Answer {
        AccessKind::Unmodelled.when(write.offset != 0x08)?;
        // RM0468: allowed only while the ADCs are disabled.
        AccessKind::Protected.when(self.control & (ADEN | ADCAL) != 0)?;
        self.common = write.over(self.common);
        // DUAL; VREFEN, VSENSEEN, VBATEN lead to ADC3.
        AccessKind::Unmodelled.when(self.common & 0x1F != 0)
    }

    /// CR: most bits are set by the program and cleared by the converter.
    fn control(&mut self, wanted: u32, now: Nanos) -> Answer {
        let new = wanted & !self.control;
        self.control = self.control & !CR_STORED | wanted & CR_STORED;
        if self.control & (ADEN | ADCAL) == 0 {
            self.regulate(wanted, now);
        }
        AccessKind::Unmodelled.when(new & (JADSTART | JADSTP) != 0)?;
        if new & ADCAL != 0 {
            self.may_begin(self.control & ADEN == 0, now)?;
            let clocks = if self.control & ADCALLIN == 0 { CALIBRATION } else { LINEARITY };
            self.work = Some((Work::Calibrates, self.after(2 * clocks, now)?));
            self.control |= ADCAL;
        }
        if new & ADEN != 0 {
            self.may_begin(true, now)?;
            self.work = Some((Work::Starts, self.after(2 * STABLE, now)?));
            self.control |= ADEN;
        }
        if new & ADSTP != 0 {
            AccessKind::Protected.when(self.control & ADSTART == 0)?;
            self.work = None;
            self.control &= !ADSTART;
        }
        if new & ADSTART != 0 {
            AccessKind::Adc(AdcFault::NotReady)
                .when(self.control & ADEN == 0 || self.work.is_some())?;
            self.convert(0, now)?;
            self.control |= ADSTART;
            return self.check_preselection();
        }
        if new & ADDIS != 0 {
            AccessKind::Protected.when(self.control & ADEN == 0 || self.control & ADSTART != 0)?;
            self.work = None;
            self.control &= !ADEN;
            self.flags &= !ADRDY;
        }
        Ok(())
    }

    /// DEEPPWD and ADVREGEN.
    fn regulate(&mut self, wanted: u32, now: Nanos) {
        let bits = wanted & (DEEPPWD | ADVREGEN);
        // No regulator in deep power-down.
        let bits = if bits & DEEPPWD != 0 { DEEPPWD } else { bits };
        self.control = self.control & !(DEEPPWD | ADVREGEN) | bits;
        let started = self.regulated_at.unwrap_or(now + REGULATOR);
        self.regulated_at = (bits & ADVREGEN != 0).then_some(started);
    }

    fn may_begin(&self, allowed: bool, now: Nanos) -> Answer {
        AccessKind::Adc(AdcFault::RegulatorNotUp).when(!self.is_regulated(now))?;
        if allowed && self.work.is_none() { Ok(()) } else { Err(AccessKind::Protected) }
    }

    fn length(&self) -> usize {
        self.registers.field(SQR[0], 0, 4) as usize + 1
    }

    /// The channel of a rank, 0 for the first.
    fn channel(&self, rank: usize) -> u32 {
        // SQR1 has L and four ranks, the others five each.
        let (register, place) = ((rank + 1) / 5, (rank + 1) % 5);
        let shift = u32::try_from(6 * place).unwrap_or(0);
        SQR.get(register).map_or(0, |at| self.registers.field(*at, shift, 5))
    }

    fn check_preselection(&self) -> Answer {
        let mut channels = (0..self.length()).map(|rank| self.channel(rank));
        let open = channels.find(|channel| self.registers.value(PCSEL) >> channel & 1 == 0);
        open.map_or(Ok(()), |channel| {
            let channel = u8::try_from(channel).unwrap_or(u8::MAX);
            Err(AccessKind::Adc(AdcFault::NotPreselected(channel)))
        })
    }

    fn bits(&self) -> u32 {
        // RES; 5 and 6 are 14 and 12 bits with less power.
        match self.registers.field(CFGR, 2, 3) {
            0 => 16,
            1 | 5 => 14,
            2 | 6 => 12,
            3 => 10,
            _ => 8,
        }
    }

    /// Conversions that are summed up for one result.
    fn oversampling(&self) -> u64 {
        let config = self.registers.value(CFGR2);
        if config & ROVSE == 0 { 1 } else { u64::from(field(config, 16, 10)) + 1 }
    }

    fn convert(&mut self, rank: usize, now: Nanos) -> Answer {
        let channel = self.channel(rank);
        let times = self.registers.value(SMPR[channel as usize / 10 % 2]);
        let sampling = field(times, 3 * (channel % 10), 3);
        // RM0468: 8.5 clocks for 16 bits, one less for every two bits less.
        let approximation = 17 - (16 - u64::from(self.bits()));
        let half_clocks = SAMPLING[sampling as usize % SAMPLING.len()] + approximation;
        let until = self.after(half_clocks * self.oversampling(), now)?;
        self.work = Some((Work::Converts(rank), until));
        Ok(())
    }

    fn result(&self, channel: u32) -> u32 {
        if self.registers.value(PCSEL) >> channel & 1 == 0 {
            return 0;
        }
        let input = self.inputs.get(channel as usize).copied().unwrap_or(0);
        let (bits, largest) = (self.bits(), (1 << self.bits()) - 1);
        let one = ((u64::from(input) << bits) / REFERENCE).min(largest);
        let config = self.registers.value(CFGR2);
        let shift = if config & ROVSE == 0 { 0 } else { field(config, 5, 4) };
        // OVSS; results have 32 bits at most.
        u32::try_from((one * self.oversampling()) >> shift).unwrap_or(u32::MAX)
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        self.work.filter(|_| !self.fails).map(|(_, until)| until)
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while let Some((work, at)) = self.work.filter(|&(_, until)| until <= now && !self.fails) {
            self.work = None;
            match work {
                Work::Calibrates => self.control &= !ADCAL,
                Work::Starts => self.flags |= ADRDY,
                Work::Converts(rank) => self.converted(rank, at),
            }
        }
    }

    fn converted(&mut self, rank: usize, at: Nanos) {
        let lost = self.flags & EOC != 0;
        if lost {
            self.flags |= OVR;
        }
        if !lost || self.registers.value(CFGR) & OVRMOD != 0 {
            self.data = self.result(self.channel(rank));
        }
        self.flags |= EOSMP | EOC;
        let is_last = rank + 1 >= self.length();
        if is_last {
            self.flags |= EOS;
        }
        let goes_on = !is_last || self.registers.value(CFGR) & CONT != 0;
        let next = if is_last { 0 } else { rank + 1 };
        if !goes_on || self.convert(next, at).is_err() {
            self.control &= !ADSTART;
        }
    }
}
