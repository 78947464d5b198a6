//! All peripherals together: dispatch of accesses, clocks, interrupts.

use std::collections::HashMap;
use std::mem::{Discriminant, discriminant};
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rc10_sim::Nanos;

use super::access::{Access, AccessKind, Answer, BusFault, PinFault, Width, Write};
use super::adc::Adc;
use super::clocks::{self, Clocks, TooFast};
use super::dma::{self, Dma, DmaMux, Transfer, UNREACHABLE};
use super::exti::Exti;
use super::facts::{I2CS, SPIS, USARTS};
use super::flash::{self, Flash, FlashState, SECTOR};
use super::gpio::{PINS, Port, pins_where};
use super::i2c::I2c;
use super::map::{self, Block, MAP, Row, row_of};
use super::octospi::{OctoSpi, SerialMemory};
use super::outside::{Holder, Jumper, Recorder};
use super::pins::{Signal, pin_of, signal_at};
use super::power::{self, Power};
use super::rcc::{self, Rcc, ResetCause};
use super::registers::{self, Registers};
use super::spi::Spi;
use super::timer::{TIMERS, Timer};
use super::usart::Usart;
use super::watchdog::Watchdog;
use crate::board::Board;
use crate::core::INTERRUPT_WORDS;
use crate::fdcan::Fdcans;
use crate::machine::Options;
use crate::memory::{FLASH, Memory, PERIPHERALS};

/// Ports A ..= K. There is no port I.
const PORTS: usize = 11;
/// Line 0 and line 1 of FDCAN1, FDCAN2, FDCAN3. Source: stm32-metapac.
const FDCAN_INTERRUPTS: [[usize; 2]; 3] = [[19, 21], [20, 22], [159, 160]];
/// The flash's interrupt. Source: stm32-metapac.
const FLASH_INTERRUPT: usize = 4;
/// OCTOSPI1's. Source: stm32-metapac.
const OCTOSPI_INTERRUPT: usize = 92;
/// First port's mode register.
const GPIO: u32 = 0x5802_0000;
/// CCR1 ..= CCR4 of a timer.
const CAPTURED: RangeInclusive<u32> = 0x34..=0x43;
/// Refused accesses kept until they are taken; more are only counted.
const REPORTS: usize = 256;

/// The STM32H723's peripherals.
///
/// Every method that takes a time lets the peripherals go on to it first; times must not decrease.
pub struct Soc {
    /// The FDCANs and their message RAM: only their registers are reached through here.
    pub fdcan: Arc<Mutex<Fdcans>>,
    memory: Memory,
    options: Options,
    rcc: Rcc,
    power: Power,
    flash: Flash,
    /// The core has read or fetched from a flash that was busy: the time at which it gets an answer.
    stalls_until: Option<Nanos>,
    syscfg: Registers,
    debug: Registers,
    exti: Exti,
    pub(super) ports: [Port; PORTS],
    pub(super) timers: [Timer; TIMERS.len()],
    pub(super) usarts: [Usart; USARTS.len()],
    pub(super) spis: [Spi; SPIS.len()],
    pub(super) i2cs: [I2c; I2CS.len()],
    pub(super) adc: Adc,
    octospi: OctoSpi,
    octospi_manager: Registers,
    pub(super) dmas: [Dma; 2],
    mux: DmaMux,
    watchdog: Watchdog,
    /// Rows of the map that have a clock and are not held in reset.
    running: Vec<bool>,
    /// A level at a pin, or its observers, may have changed.
    pub(super) pins_changed: bool,
    pub(super) recorders: Vec<Recorder>,
    pub(super) jumpers: Vec<Jumper>,
    pub(super) holders: Vec<Holder>,
    clocks: Clocks,
    flash_keeps_up: bool,
    too_fast: Vec<TooFast>,
    next: Option<Nanos>,
    /// An access may have changed an interrupt, or what comes next.
    changed: bool,
    levels: [u32; INTERRUPT_WORDS],
    wants_reset: bool,
    reports: Vec<Access>,
    /// Number of refused accesses, by the variant of their kind.
    counts: HashMap<Discriminant<AccessKind>, u64>,
    /// Pins in use that do not lead outside, a bit each: told already.
    pins_told: [u32; PORTS],
    /// Rows of the map whose devices say nothing.
    silent: Vec<bool>,
}

impl Soc {
    /// Creates the peripherals at power-on, at time zero, but silences none; `memory` is what the
    /// DMAs see.
    pub fn new(options: Options, fdcan: Arc<Mutex<Fdcans>>, memory: Memory) -> Self {
        let mut soc = Self {
            fdcan,
            flash: Flash::new(memory.clone(), options.seed),
            stalls_until: None,
            memory,
            options,
            rcc: Rcc::new(options),
            power: Power::new(),
            syscfg: Registers::new(registers::SYSCFG),
            debug: Registers::new(registers::DEBUG),
            exti: Exti::new(),
            ports: std::array::from_fn(Port::new),
            timers: std::array::from_fn(Timer::new),
            usarts: std::array::from_fn(Usart::new),
            spis: std::array::from_fn(Spi::new),
            i2cs: std::array::from_fn(I2c::new),
            adc: Adc::new(),
            octospi: OctoSpi::new(),
            octospi_manager: Registers::new(registers::OCTOSPIM),
            dmas: [Dma::new(0), Dma::new(1)],
            mux: DmaMux::default(),
            watchdog: Watchdog::new(),
            running: vec![false; MAP.len()],
            pins_changed: true,
            recorders: Vec::new(),
            jumpers: Vec::new(),
            holders: Vec::new(),
            clocks: Clocks::default(),
            flash_keeps_up: true,
            too_fast: Vec::new(),
            next: None,
            changed: false,
            levels: [0; INTERRUPT_WORDS],
            wants_reset: false,
            reports: Vec::new(),
            counts: HashMap::new(),
            pins_told: [0; PORTS],
            silent: vec![false; MAP.len()],
        };
        soc.reset_syscfg();
        soc.apply_switches();
        soc.apply_clocks(Nanos::ZERO);
        soc.connect_pins(Nanos::ZERO);
        soc.settle(Nanos::ZERO);
        soc
    }

    /// Resets the chip. Flags of earlier resets, backup domain, supply and debug unit stay unless
    /// power was gone; levels and bytes at the pins stay.
    pub fn reset(&mut self, cause: ResetCause, now: Nanos) {
        self.rcc.reset(cause, now);
        if let ResetCause::PowerOn | ResetCause::BrownOut = cause {
            self.flash.cut(now);
        }
        if cause == ResetCause::PowerOn {
            self.power = Power::new();
            self.debug.reset();
        } else {
            self.power.reset_but_supply();
        }
        self.flash.reset();
        self.watchdog = Watchdog::new();
        self.exti.registers.reset();
        self.mux = DmaMux::default();
        self.wants_reset = false;
        for row in MAP.iter().filter(|row| row.switch.is_some()) {
            self.reset_block(row, now);
        }
        self.apply_switches();
        self.apply_clocks(now);
        self.connect_pins(now);
        self.settle(now);
    }

    /// Reads a register. Sub-word reads give their part of the word. Fails if there is no device at
    /// the address, or the access is not aligned.
    pub fn read(&mut self, address: u32, width: Width, now: Nanos) -> Result<u32, BusFault> {
        self.advance(now);
        if self.is_gated_memory(address) {
            self.report(address, false, AccessKind::Gated);
            return Ok(0);
        }
        if is_flash(address) {
            return self.read_flash(address, width);
        }
        let value = self.access_read(address, width, now)?;
        let changes = row_of(address).is_some_and(|(_, row)| match row.block {
            // Reading data clears flags, captured data of a timer, too.
            Block::Usart(_) | Block::Spi(_) | Block::I2c(_) | Block::Adc | Block::OctoSpi => true,
            Block::Timer(_) => CAPTURED.contains(&(address - row.base)),
            _ => false,
        });
        if changes {
            self.settle(now);
        }
        self.changed |= changes;
        Ok(value)
    }

    /// Writes a register. Sub-word writes change their part of the word. Fails if there is no
    /// device at the address, or the access is not aligned.
    pub fn write(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        now: Nanos,
    ) -> Result<(), BusFault> {
        self.advance(now);
        if self.is_gated_memory(address) {
            self.report(address, true, AccessKind::Gated);
            return Ok(());
        }
        if is_flash(address) {
            self.stalls_until = self.flash.busy_until();
            self.changed = true;
            let bytes = &value.to_le_bytes()[..width.bytes() as usize];
            let stored = self.flash.store(address, bytes, now);
            if stored.is_err() {
                self.report(address, true, AccessKind::Protected);
            }
            self.settle(now);
            return stored;
        }
        let block = self.access_write(address, width, value, now)?;
        // What is written to the message RAM is looked at when a register says so.
        self.changed |= block != Block::FdcanRam;
        // The FDCANs' interrupt lines are read anew each time.
        if !matches!(block, Block::Fdcan(_) | Block::FdcanRam) {
            self.settle(now);
        }
        Ok(())
    }

    /// What the core reads or fetches from a flash that is busy, or has a word whose code does not fit.
    pub(crate) fn read_flash(&mut self, address: u32, width: Width) -> Result<u32, BusFault> {
        self.stalls_until = self.flash.busy_until();
        self.changed = true;
        self.flash.check(address, width.bytes(), false)?;
        Ok(self.flash.word(address & !3) >> (8 * (address & 3)) & width.mask())
    }

    /// Whether an access since the last call may have changed an interrupt, or what comes next.
    pub(crate) const fn take_changed(&mut self) -> bool {
        std::mem::replace(&mut self.changed, false)
    }

    /// The time at which the core gets an answer of the flash, if it waits for one since the last call.
    pub(crate) fn take_stall(&mut self) -> Option<Nanos> {
        self.stalls_until.take()
    }

    /// How reads of the flash go now.
    pub(crate) fn flash_state(&self) -> FlashState {
        FlashState { is_busy: self.flash.busy_until().is_some(), sick: self.flash.sick_sectors() }
    }

    /// The core has looked ahead into protected memory.
    pub(crate) fn speculate(&mut self, now: Nanos) {
        self.flash.speculate();
        self.settle(now);
    }

    /// Wears a sector of the flash out, 0 to 7: erasing it fails from now on.
    pub fn wear_flash(&mut self, sector: u32) {
        self.flash.wear(sector);
    }

    /// Reports an access without an answer; instructions are not fetched from peripherals.
    pub(crate) fn refuse(&mut self, address: u32, write: bool) -> BusFault {
        self.report(address, write, AccessKind::Unowned);
        BusFault
    }

    /// Earliest time to call [`advance`](Self::advance) at; the FDCANs' wires have their own.
    pub const fn next_event(&self) -> Option<Nanos> {
        self.next
    }

    /// Lets everything happen that is due.
    pub fn advance(&mut self, now: Nanos) {
        while let Some(at) = self.next.filter(|&at| at <= now) {
            self.changed = true;
            let clocks_changed = self.rcc.next_event().is_some_and(|event| event <= at);
            self.rcc.advance(at);
            if clocks_changed {
                self.apply_clocks(at);
                self.check_clocks(rcc::CONTROL, at);
            }
            self.watchdog.advance(at);
            self.timers.iter_mut().for_each(|timer| timer.advance(at));
            self.usarts.iter_mut().for_each(|usart| usart.advance(at));
            self.spis.iter_mut().for_each(|spi| spi.advance(at));
            self.i2cs.iter_mut().for_each(|i2c| i2c.advance(at));
            self.adc.advance(at);
            self.octospi.advance(at);
            self.flash.advance(at);
            self.settle(at);
        }
    }

    /// Levels of the interrupt lines: bit n of word n / 32 is external interrupt n.
    pub fn interrupt_levels(&self) -> [u32; INTERRUPT_WORDS] {
        let mut levels = self.levels;
        let lines = self.fdcans().interrupt_lines();
        for (number, high) in FDCAN_INTERRUPTS.iter().flatten().zip(lines.iter().flatten()) {
            if *high {
                raise(&mut levels, *number);
            }
        }
        levels
    }

    /// Clocks of the core that an access to a peripheral takes beyond the instruction's own. A
    /// posted write counts as a read: the next access waits for it. APB2 to APB4 count as APB1.
    pub fn access_clocks(&self, address: u32) -> u64 {
        if !PERIPHERALS.contains(&address) {
            return 0;
        }
        let (bus, apb) = map::way_to(address);
        let of = |hz| self.clocks.core.checked_div(hz).unwrap_or(0);
        bus * of(self.clocks.bus) + apb * of(self.clocks.apb[0])
    }

    /// Solders a memory to port 1 of the OCTOSPIs.
    pub(crate) fn attach_memory(&mut self, memory: Box<dyn SerialMemory>) {
        self.octospi.attach(memory);
    }

    /// Whether the core's non-maskable interrupt is asked for: by clock security.
    pub fn nmi(&self) -> bool {
        self.rcc.raises_nmi()
    }

    /// The board's crystal stops swinging, or can swing again. A reset changes nothing about it.
    pub fn set_crystal(&mut self, alive: bool, now: Nanos) {
        self.advance(now);
        self.rcc.set_crystal(alive, now);
        self.apply_clocks(now);
        self.settle(now);
    }

    /// All clocks now; the core has 64 MHz after a reset.
    pub const fn clocks(&self) -> Clocks {
        self.clocks
    }

    /// Time at which the system clock was switched to PLL1; `None` if not yet since the last reset.
    pub const fn system_ready_at(&self) -> Option<Nanos> {
        self.rcc.system_ready_at
    }

    /// The reset that a peripheral asks for; forgets it. [`reset`](Self::reset) does it.
    pub fn take_reset(&mut self) -> Option<ResetCause> {
        std::mem::take(&mut self.wants_reset).then_some(ResetCause::Watchdog)
    }

    /// Refused accesses since the last call; the first 256 of them.
    pub fn take_reports(&mut self) -> Vec<Access> {
        std::mem::take(&mut self.reports)
    }

    /// Number of accesses refused for this kind of reason since the chip exists.
    pub fn count(&self, kind: AccessKind) -> u64 {
        self.counts.get(&discriminant(&kind)).copied().unwrap_or(0)
    }

    /// Whether SRAM1 and SRAM2 have a clock (AHB2ENR).
    pub fn memories_run(&self) -> [bool; 2] {
        self.rcc.memories_run()
    }

    /// Sets the chip's identity, `DBGMCU_IDC`, if not that of an STM32H723.
    pub fn set_identity(&mut self, identity: u32) {
        self.debug.set(0, identity);
    }

    /// Sets [`Options::switches_closed`](crate::Options::switches_closed), and the switches now.
    pub fn set_switches_closed(&mut self, closed: bool, now: Nanos) {
        self.advance(now);
        self.options.switches_closed = closed;
        self.reset_syscfg();
        self.connect_pins(now);
        self.settle(now);
    }

    /// Silences a peripheral, by its name in `map::MAP`: see
    /// [`Options::silent`](crate::Options::silent). `false`: there is no such peripheral.
    pub fn silence(&mut self, name: &str) -> bool {
        let is_meant =
            |row: &Row| row.name == name || name == "ADC1" && row.block == Block::AdcCommon;
        for (silent, row) in self.silent.iter_mut().zip(MAP) {
            *silent |= is_meant(row);
        }
        MAP.iter().any(is_meant)
    }

    /// Sets whether ADC1 ends no conversion, calibration or start. Flags that are set stay.
    pub fn set_adc_fails(&mut self, fails: bool, now: Nanos) {
        self.advance(now);
        self.adc.set_fails(fails, now);
        self.settle(now);
    }

    /// Whether the core is kept from writing RAM.
    pub(crate) fn guards_ram(&self) -> bool {
        self.options.reports_early_ram && !self.power.is_supplied()
    }

    /// Does a write to a RAM that the core is kept from, and reports the first. `false`: there is
    /// no such RAM.
    pub(crate) fn write_early(&mut self, address: u32, bytes: &[u8]) -> bool {
        let is_ram = !is_flash(address) && !self.is_gated_memory(address);
        if !self.guards_ram() || !is_ram || self.memory.write(address, bytes).is_err() {
            return false;
        }
        if self.count(AccessKind::BeforeSupply) == 0 {
            self.report(address, true, AccessKind::BeforeSupply);
        }
        true
    }

    fn is_gated_memory(&self, address: u32) -> bool {
        match address {
            0x3000_0000..0x3000_4000 => !self.memories_run()[0],
            0x3000_4000..0x3000_8000 => !self.memories_run()[1],
            _ => false,
        }
    }

    fn fdcans(&self) -> MutexGuard<'_, Fdcans> {
        lock(&self.fdcan)
    }

    fn report(&mut self, address: u32, write: bool, kind: AccessKind) {
        self.changed = true;
        *self.counts.entry(discriminant(&kind)).or_default() += 1;
        if self.reports.len() < REPORTS {
            self.reports.push(Access { address, write, kind });
        }
    }

    /// The row of an aligned access, and whether it answers: it has a clock.
    fn owner(
        &mut self,
        address: u32,
        width: Width,
        write: bool,
    ) -> Result<(&'static Row, bool), BusFault> {
        let Some((index, row)) = row_of(address).filter(|_| address.is_multiple_of(width.bytes()))
        else {
            return Err(self.refuse(address, write));
        };
        let answers = self.running[index] && !self.silent[index];
        if !answers && !self.silent[index] {
            self.report(address, write, AccessKind::Gated);
        }
        Ok((row, answers))
    }

    fn access_read(&mut self, address: u32, width: Width, now: Nanos) -> Result<u32, BusFault> {
        let (row, answers) = self.owner(address, width, false)?;
        if !answers {
            return Ok(0);
        }
        let offset = (address - row.base) & !3;
        let word = self.read_block(row.block, offset, width, now).unwrap_or_else(|refusal| {
            self.report(address, false, refusal);
            0
        });
        Ok(word >> (8 * (address & 3)) & width.mask())
    }

    fn access_write(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        now: Nanos,
    ) -> Result<Block, BusFault> {
        let (row, answers) = self.owner(address, width, true)?;
        if answers {
            let write = Write::new(address - row.base, width, value);
            let written = if row.block == Block::Flash {
                self.flash.write(write.at(write.offset & !0x100), now)?
            } else {
                self.write_block(row.block, write, now)
            };
            if let Err(refusal) = written {
                self.report(address, true, refusal);
            }
            if matches!(row.block, Block::Rcc | Block::Power | Block::Flash) {
                self.check_flash(address, now);
            }
            if matches!(row.block, Block::Rcc | Block::Power | Block::FdcanCalibration | Block::Adc)
            {
                self.check_clocks(address, now);
            }
        }
        Ok(row.block)
    }

    fn read_block(&mut self, block: Block, offset: u32, width: Width, now: Nanos) -> Answer<u32> {
        match block {
            Block::Rcc => self.rcc.read(offset),
            Block::Power => {
                let told = self.power.read(offset, now)?;
                let never = offset == power::CSR1 && !self.options.board.core_supply;
                Ok(if never { told & !power::READY } else { told })
            }
            Block::Flash if offset & !0x100 == flash::OPTSR => {
                Ok(flash::READABLE | u32::from(self.options.board.brown_out & 3) << 2)
            }
            Block::Flash => self.flash.read(offset & !0x100),
            Block::Syscfg => {
                let stored = self.syscfg.read(offset)?;
                // CCCSR.RDY: the compensation cell needs CSI.
                let ready = offset == 0x20 && stored & 1 != 0 && self.rcc.is_ready(rcc::CSI);
                Ok(stored | u32::from(ready) << 8)
            }
            Block::Exti => self.exti.registers.read(offset),
            Block::Debug => self.debug.read(offset),
            Block::Watchdog => self.watchdog.read(offset),
            Block::Gpio(port) => {
                let word = self.ports[port].read(offset)?;
                // IDR.
                Ok(if offset == 0x10 { word & !self.held_low(port) } else { word })
            }
            Block::Timer(timer) => self.timers[timer].read(offset, now),
            Block::Usart(usart) => self.usarts[usart].read(offset, now),
            Block::Spi(spi) => self.spis[spi].read(offset, width, now),
            Block::I2c(i2c) => self.i2cs[i2c].read(offset, now),
            Block::Adc => self.adc.read(offset, now),
            Block::AdcCommon => self.adc.read_common(offset),
            Block::OctoSpi => self.octospi.read(offset, width, now),
            Block::OctoSpiManager => self.octospi_manager.read(offset),
            Block::Dma(dma) => self.dmas[dma].read(offset),
            Block::DmaMux => self.mux.read(offset),
            Block::Fdcan(index) => self.fdcans().read(index, offset, now),
            Block::FdcanRam => {
                self.fdcans().read_ram(offset as usize / 4).ok_or(AccessKind::Unmodelled)
            }
            Block::FdcanCalibration => self.fdcans().read_calibration(offset),
            Block::Unmodelled => Err(AccessKind::Unmodelled),
        }
    }

    fn write_block(&mut self, block: Block, write: Write, now: Nanos) -> Answer {
        match block {
            Block::Rcc => self.write_rcc(write, now),
            Block::Power => self.power.write(write, now),
            Block::Syscfg => {
                let written = self.syscfg.write(write);
                self.connect_pins(now);
                written
            }
            Block::Exti => self.exti.write(write),
            Block::Debug => self.debug.write(write),
            Block::Watchdog => self.watchdog.write(write, now),
            Block::Gpio(port) => {
                let written = self.ports[port].write(write);
                self.pins_changed = true;
                // MODER, AFRL, AFRH.
                if let 0x00 | 0x20 | 0x24 = write.offset {
                    self.connect_pins(now);
                }
                written
            }
            Block::Timer(timer) => {
                let listened = self.timers[timer].listens();
                let written = self.timers[timer].write(write.repeated(), now);
                if !listened && self.timers[timer].listens() {
                    self.show_pins(timer, true, now);
                }
                written
            }
            Block::Usart(usart) => self.usarts[usart].write(write.repeated(), now),
            Block::Spi(spi) => self.spis[spi].write(write, now),
            Block::I2c(i2c) => self.i2cs[i2c].write(write.repeated(), now),
            Block::Adc => self.adc.write(write, now),
            Block::AdcCommon => self.adc.write_common(write),
            Block::OctoSpi => self.octospi.write(write, now),
            Block::OctoSpiManager => {
                let written = self.octospi_manager.write(write);
                self.connect_pins(now);
                written
            }
            Block::Dma(dma) => self.dmas[dma].write(write),
            Block::DmaMux => self.mux.write(write),
            // Registers are words: a part of one writes zeros to the rest.
            Block::Fdcan(index) => self.fdcans().write(index, write.offset, write.ones(), now),
            Block::FdcanRam => {
                let word = write.offset as usize / 4;
                let mut fdcans = self.fdcans();
                let old = fdcans.read_ram(word).ok_or(AccessKind::Unmodelled)?;
                fdcans.write_ram(word, write.over(old));
                Ok(())
            }
            Block::FdcanCalibration => self.fdcans().write_calibration(write.offset, write.ones()),
            Block::Flash | Block::Unmodelled => Err(AccessKind::Unmodelled),
        }
    }

    fn write_rcc(&mut self, write: Write, now: Nanos) -> Answer {
        let is_held =
            |rcc: &Rcc, row: &Row| row.switch.is_some_and(|switch| rcc.holds_in_reset(switch));
        let before = MAP.iter().map(|row| is_held(&self.rcc, row)).collect::<Vec<_>>();
        let written = self.rcc.write(write, now, self.power.backup_unlocked());
        if Rcc::switches_at(write.offset) {
            for (row, was_held) in MAP.iter().zip(before) {
                if is_held(&self.rcc, row) && !was_held {
                    self.reset_block(row, now);
                }
            }
            self.connect_pins(now);
            self.apply_switches();
        }
        self.apply_clocks(now);
        written
    }

    fn reset_block(&mut self, row: &Row, now: Nanos) {
        match row.block {
            Block::Syscfg => self.reset_syscfg(),
            Block::Gpio(port) => self.ports[port].registers.reset(),
            Block::Timer(timer) => self.timers[timer].reset(now),
            Block::Usart(usart) => self.usarts[usart].reset(now),
            Block::Spi(spi) => self.spis[spi].reset(),
            Block::I2c(i2c) => self.i2cs[i2c].reset(now),
            Block::Adc => self.adc.reset(),
            Block::OctoSpi => self.octospi.reset(now),
            Block::OctoSpiManager => self.octospi_manager.reset(),
            Block::Dma(dma) => self.dmas[dma] = Dma::new(dma),
            // One bit resets all three and the calibration unit: once is enough.
            Block::Fdcan(0) => self.fdcans().reset(),
            // The others have no reset of their own, or nothing to reset.
            _ => {}
        }
    }

    fn reset_syscfg(&mut self) {
        self.syscfg.reset();
        if !self.options.switches_closed {
            let reset = self.syscfg.value(registers::PMCR);
            self.syscfg.set(registers::PMCR, reset | registers::SWITCHES);
        }
    }

    /// Gates and resets: which peripherals have a clock.
    fn apply_switches(&mut self) {
        for (running, row) in self.running.iter_mut().zip(MAP) {
            *running = row.switch.is_none_or(|switch| self.rcc.is_running(switch));
        }
    }

    fn apply_clocks(&mut self, now: Nanos) {
        let mut clocks = self.rcc.clocks(self.rcc.hsi_hz);
        if clocks.fdcan != self.clocks.fdcan {
            self.fdcans().set_kernel_clock(clocks.fdcan);
        }
        self.clocks = clocks;
        let tones = self.rcc.tones();
        for (row, &running) in MAP.iter().zip(&self.running) {
            let hz = if running { *kernel_clock(&mut clocks, row.block) } else { 0 };
            match row.block {
                Block::Timer(timer) => {
                    self.timers[timer].set_clock(hz, now);
                    self.timers[timer].set_tones(tones, now);
                }
                Block::Usart(usart) => self.usarts[usart].set_clock(hz, now),
                Block::Spi(spi) => self.spis[spi].hz = hz,
                Block::I2c(i2c) => self.i2cs[i2c].hz = hz,
                Block::Adc => self.adc.set_clocks(&clocks, running),
                // HCLK3, after a reset.
                Block::OctoSpi => self.octospi.hz = hz,
                _ => {}
            }
        }
    }

    fn connect_pins(&mut self, now: Nanos) {
        self.pins_changed = true;
        self.cut_pins();
        self.find_signals();
        let ports = &self.ports;
        let connected = |signal| pin_of(ports, signal).is_some();
        for (index, usart) in self.usarts.iter_mut().enumerate() {
            let pins = [Signal::SerialReceive(index), Signal::SerialTransmit(index)];
            usart.set_pins(pins.map(connected), now);
        }
        for (index, spi) in self.spis.iter_mut().enumerate() {
            let pins = [Signal::SpiClock(index), Signal::SpiIn(index), Signal::SpiOut(index)];
            spi.pins = pins.map(connected);
        }
        for (index, i2c) in self.i2cs.iter_mut().enumerate() {
            let pins = [Signal::I2cClock(index), Signal::I2cData(index)];
            i2c.connected = pins.into_iter().all(connected);
        }
        // A memory is soldered to its pins; a port that is not OCTOSPI1's, or in part, does not lead there.
        let is_wired = self.options.board.memory.is_some_and(|pins| {
            (0..).zip(pins).all(|(line, (port, pin))| {
                let port = port_index(port).unwrap_or(PORTS);
                signal_at(ports, port, pin) == Some(Signal::Octo(line))
            })
        });
        self.octospi.connected =
            is_wired && registers::is_octospi_1(self.octospi_manager.value(registers::P1CR));
        let mut fdcans = lock(&self.fdcan);
        for index in 0..3 {
            let pins = [Signal::CanReceive(index), Signal::CanTransmit(index)];
            let [receive, transmit] = pins.map(connected);
            fdcans.set_pins(index, receive, transmit);
        }
    }

    /// Tells the ports which of their pins do not lead outside; reports those that are used.
    fn cut_pins(&mut self) {
        let package = self.options.board.package;
        for (index, letter) in (0..PORTS).zip('A'..) {
            let absent = pins_where(|pin| !package.bonds(letter, pin));
            // PC2SO is bit 26, PC3SO bit 27.
            let switches = self.syscfg.value(registers::PMCR) >> 24;
            let open = switches & pins_where(|pin| package.is_behind_switch(letter, pin));
            self.ports[index].cut = absent | open;
            let used = self.ports[index].cut_in_use();
            let new = used & !self.pins_told[index];
            self.pins_told[index] |= new;
            // A switch that was closed may be opened again.
            self.pins_told[index] &= absent | used;
            for pin in (0..PINS).filter(|pin| new >> pin & 1 != 0) {
                let is_switch_open = open >> pin & 1 != 0;
                let (pin, chip) = ((letter, pin), self.options.board.chip);
                let fault = PinFault { pin, chip, package, is_switch_open };
                let register = GPIO + 0x400 * u32::try_from(index).unwrap_or(0);
                self.report(register, true, AccessKind::Pin(fault));
            }
        }
    }

    /// The board that the chip is on.
    pub const fn board(&self) -> Board {
        self.options.board
    }

    /// Reports once when the flash becomes too slow for its clock.
    fn check_flash(&mut self, address: u32, now: Nanos) {
        let (scale, wait_states) = (self.power.scale(now), self.flash.wait_states() & 7);
        let keeps_up = power::flash_keeps_up(scale, self.clocks.bus, wait_states);
        if self.flash_keeps_up && !keeps_up {
            self.report(address, true, AccessKind::WaitStates);
        }
        self.flash_keeps_up = keeps_up;
    }

    /// Reports each clock once when it becomes too fast for what it drives.
    fn check_clocks(&mut self, address: u32, now: Nanos) {
        let mut nominal = self.rcc.clocks(clocks::HSI_HZ);
        // What drives nothing may be as fast as it is.
        let mut used = Clocks { fdcan: 0, usarts: [0; 2], spis: [0; 2], i2cs: 0, ..nominal };
        for (row, _) in MAP.iter().zip(&self.running).filter(|(_, running)| **running) {
            *kernel_clock(&mut used, row.block) = *kernel_clock(&mut nominal, row.block);
        }
        let time_quantum = self.fdcans().time_quantum_of(used.fdcan);
        let too_fast = clocks::too_fast(&used, time_quantum, self.power.scale(now));
        let too_fast: Vec<_> = too_fast.chain(self.adc.too_fast(&nominal)).collect();
        let before = std::mem::replace(&mut self.too_fast, too_fast.clone());
        for clock in too_fast.into_iter().filter(|clock| !before.contains(clock)) {
            self.report(address, true, AccessKind::TooFast(clock));
        }
    }

    /// After anything that may have changed: edges, transfers, interrupts, what comes next.
    pub(super) fn settle(&mut self, now: Nanos) {
        loop {
            while std::mem::take(&mut self.pins_changed) {
                self.exti.look(self.exti_levels());
                self.look_at_pins(now);
            }
            self.transfer(now);
            if !self.carry() {
                break;
            }
        }
        self.record(now);
        self.wants_reset |= std::mem::take(&mut self.watchdog.bites);
        let mut levels = [0; INTERRUPT_WORDS];
        let timers = self.timers.iter().flat_map(Timer::interrupts);
        let usarts = self.usarts.iter().filter_map(Usart::interrupt);
        let spis = self.spis.iter().filter_map(Spi::interrupt);
        let i2cs = self.i2cs.iter().flat_map(I2c::interrupts);
        let dmas = self.dmas.iter().flat_map(Dma::interrupts);
        let adc = self.adc.interrupt();
        let devices = timers.chain(adc).chain(usarts).chain(spis).chain(i2cs).chain(dmas);
        for number in self.exti.interrupts().chain(devices) {
            raise(&mut levels, number);
        }
        for (is_high, number) in [
            (self.flash.interrupts(), FLASH_INTERRUPT),
            (self.octospi.interrupts(), OCTOSPI_INTERRUPT),
        ] {
            if is_high {
                raise(&mut levels, number);
            }
        }
        self.levels = levels;
        self.schedule();
    }

    pub(super) fn schedule(&mut self) {
        let timers = self.timers.iter().filter_map(Timer::next_event);
        let usarts = self.usarts.iter().filter_map(Usart::next_event);
        let spis = self.spis.iter().filter_map(Spi::next_event);
        let i2cs = self.i2cs.iter().filter_map(I2c::next_event);
        let others = [
            self.rcc.next_event(),
            self.watchdog.next_event(),
            self.adc.next_event(),
            self.flash.busy_until(),
            self.octospi.next_event(),
        ];
        let others = others.into_iter().flatten();
        self.next = timers.chain(usarts).chain(spis).chain(i2cs).chain(others).min();
    }

    /// Levels of EXTI's lines 0 ..= 15: each is the pin of its number of the port that SYSCFG says.
    fn exti_levels(&self) -> u32 {
        pins_where(|pin| {
            // Four lines in each of EXTICR1 ..= EXTICR4.
            let register = registers::EXTICR[pin / 4];
            let port = self.syscfg.value(register) >> (4 * (pin % 4)) & 0xF;
            self.ports.get(port as usize).is_some_and(|port| port.input(pin))
        })
    }

    fn transfer(&mut self, now: Nanos) {
        let mut moved = true;
        while std::mem::take(&mut moved) {
            for dma in 0..self.dmas.len() {
                for stream in 0..dma::STREAMS {
                    self.empty_fifo(dma, stream);
                }
                if self.dmas[dma].is_idle() {
                    continue;
                }
                for stream in 0..dma::STREAMS {
                    moved |= self.dmas[dma].streams[stream].is_enabled()
                        && self.transfer_one(dma, stream, now);
                }
            }
        }
    }

    fn transfer_one(&mut self, dma: usize, stream: usize, now: Nanos) -> bool {
        self.read_ahead(dma, stream);
        let request = self.mux.request(dma, stream);
        let requested = self.is_requested(request);
        if requested && self.locks(dma, stream, request, now) {
            return false;
        }
        let one = &mut self.dmas[dma].streams[stream];
        let Some(transfer) = one.next(requested) else { return false };
        let fails = std::mem::take(&mut one.fails);
        self.timers.iter_mut().for_each(|timer| timer.acknowledge(request));
        let worked = !fails && self.move_item(dma, stream, transfer, now).is_some();
        self.dmas[dma].streams[stream].moved(worked, now);
        self.empty_fifo(dma, stream);
        true
    }

    /// Whether a stream that serves a UART is locked, or locks now.
    fn locks(&mut self, dma: usize, stream: usize, request: u32, now: Nanos) -> bool {
        if !self.usarts.iter().any(|usart| usart.requests(request)) {
            return false;
        }
        let requested =
            std::array::from_fn(|other| self.is_requested(self.mux.request(dma, other)));
        let locked = self.dmas[dma].locks(stream, requested, now);
        if locked {
            let address = self.dmas[dma].control_address(stream);
            self.report(address, true, AccessKind::Locked);
        }
        locked
    }

    fn read_ahead(&mut self, dma: usize, stream: usize) {
        while let Some((from, width)) = self.dmas[dma].streams[stream].ahead() {
            let item = self.read_item(from, width);
            let stream = &mut self.dmas[dma].streams[stream];
            match item {
                Some(value) => stream.held.push_back((0, value)),
                None => return stream.moved(false, Nanos::ZERO),
            }
        }
    }

    /// Writes to memory what the FIFO of a stream from a peripheral has to give.
    fn empty_fifo(&mut self, dma: usize, stream: usize) {
        for (to, value, width) in self.dmas[dma].streams[stream].give_due() {
            if self.write_item(to, value, width).is_none() {
                self.dmas[dma].streams[stream].moved(false, Nanos::ZERO);
            }
        }
    }

    fn is_requested(&self, request: u32) -> bool {
        self.usarts.iter().any(|usart| usart.requests(request))
            || self.timers.iter().any(|timer| timer.requests(request))
            || self.spis.iter().any(|spi| spi.requests(request))
            || self.i2cs.iter().any(|i2c| i2c.requests(request))
            || self.adc.requests(request)
    }

    /// Whether a DMA reaches a `known` memory address with a clock; else that is reported.
    fn reaches(&mut self, address: u32, write: bool, known: bool) -> bool {
        let kind = if self.is_gated_memory(address) {
            AccessKind::Gated
        } else if !known || UNREACHABLE.iter().any(|range| range.contains(&address)) {
            AccessKind::OutOfReach
        } else {
            return true;
        };
        self.report(address, write, kind);
        false
    }

    fn move_item(
        &mut self,
        dma: usize,
        stream: usize,
        transfer: Transfer,
        now: Nanos,
    ) -> Option<()> {
        let Transfer { from, to, width, buffered } = transfer;
        let value = if PERIPHERALS.contains(&from) {
            self.access_read(from, width, now).ok()?
        } else if buffered {
            self.dmas[dma].streams[stream].held.pop_front()?.1
        } else {
            self.read_item(from, width)?
        };
        if PERIPHERALS.contains(&to) {
            self.access_write(to, width, value, now).ok().map(drop)
        } else if buffered {
            self.dmas[dma].streams[stream].held.push_back((to, value));
            Some(())
        } else {
            self.write_item(to, value, width)
        }
    }

    fn read_item(&mut self, from: u32, width: Width) -> Option<u32> {
        let mut bytes = [0; 4];
        let known = self.memory.read(from, &mut bytes[..width.bytes() as usize]).is_ok();
        if is_flash(from) {
            // A DMA takes the bytes as they are: only flags tell.
            let _ = self.flash.check(from, width.bytes(), true);
        }
        self.reaches(from, false, known).then(|| u32::from_le_bytes(bytes))
    }

    fn write_item(&mut self, to: u32, value: u32, width: Width) -> Option<()> {
        // A plain write does not program the flash.
        let known = !is_flash(to) && self.memory.word(to & !3).is_ok();
        let bytes = &value.to_le_bytes()[..width.bytes() as usize];
        if self.reaches(to, true, known) { self.memory.write(to, bytes).ok() } else { None }
    }
}

/// Whether an address lies in the flash, or where it would.
const fn is_flash(address: u32) -> bool {
    address.wrapping_sub(FLASH) < 8 * SECTOR
}

/// A lock. The state that a panic left behind is as good as any state of a chip.
pub(crate) fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The clock that a device works with; that of its bus if it has no other.
const fn kernel_clock(clocks: &mut Clocks, block: Block) -> &mut u64 {
    match block {
        Block::Timer(timer) => &mut clocks.timers[TIMERS[timer].bus],
        Block::Usart(usart) => &mut clocks.usarts[USARTS[usart].clock],
        Block::Spi(spi) => &mut clocks.spis[SPIS[spi].clock],
        Block::I2c(_) => &mut clocks.i2cs,
        Block::Fdcan(_) => &mut clocks.fdcan,
        _ => &mut clocks.bus,
    }
}

fn raise(levels: &mut [u32; INTERRUPT_WORDS], number: usize) {
    if let Some(word) = levels.get_mut(number / 32) {
        *word |= 1 << (number % 32);
    }
}

pub(super) fn port_index(port: char) -> Option<usize> {
    let index = u32::from(port).checked_sub('A'.into())? as usize;
    (index < PORTS).then_some(index)
}
