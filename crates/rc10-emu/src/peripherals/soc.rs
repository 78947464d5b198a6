//! All peripherals together: who answers an access, who has a clock, whose interrupt is asked for.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rc10_sim::Nanos;

use super::access::{Access, AccessKind, BusFault, Counts, Refusal, Width, Write};
use super::clocks::Clocks;
use super::dma::{self, Dma, DmaMux, Transfer, UNREACHABLE};
use super::exti::Exti;
use super::gpio::{PINS, Port};
use super::map::{Block, MAP, Row, row_of};
use super::pins::{Signal, is_connected};
use super::power::{self, Power};
use super::rcc::{Rcc, ResetCause};
use super::registers::{self, Registers};
use super::timer::{TIMERS, Timer};
use super::usart::{Incoming, SentByte, USARTS, Usart};
use super::watchdog::Watchdog;
use crate::fdcan::Fdcans;
use crate::memory::{FLASH, Memory, PERIPHERALS};

/// External interrupts in words of 32.
const INTERRUPT_WORDS: usize = 6;
/// Ports A ..= K. There is no port I.
const PORTS: usize = 11;
/// Line 0 and line 1 of FDCAN1, FDCAN2, FDCAN3. Source: stm32-metapac.
const FDCAN_INTERRUPTS: [[usize; 2]; 3] = [[19, 21], [20, 22], [159, 160]];
/// Refused accesses kept until somebody takes them; more are only counted.
const REPORTS: usize = 256;

/// The STM32H723's peripherals.
///
/// Every method that takes a time lets the peripherals go on to it first; times must not decrease.
pub struct Soc {
    /// The FDCANs and their message RAM: their registers are reached through here, their wires are
    /// not.
    pub fdcan: Arc<Mutex<Fdcans>>,
    memory: Memory,
    rcc: Rcc,
    power: Power,
    flash: Registers,
    syscfg: Registers,
    debug: Registers,
    calibration: Registers,
    exti: Exti,
    ports: [Port; PORTS],
    timers: [Timer; TIMERS.len()],
    usarts: [Usart; USARTS.len()],
    dmas: [Dma; 2],
    mux: DmaMux,
    watchdog: Watchdog,
    /// Which rows of the map have a clock and are not held in reset.
    running: Vec<bool>,
    clocks: Clocks,
    flash_keeps_up: bool,
    next: Option<Nanos>,
    levels: [u32; INTERRUPT_WORDS],
    wants_reset: bool,
    reports: Vec<Access>,
    counts: Counts,
}

impl fmt::Debug for Soc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Soc").field("clocks", &self.clocks).finish_non_exhaustive()
    }
}

impl Soc {
    /// Peripherals as power-on leaves them, at time zero. `memory` is what the DMAs see.
    #[must_use]
    pub fn new(fdcan: Arc<Mutex<Fdcans>>, memory: Memory) -> Self {
        let mut soc = Self {
            fdcan,
            memory,
            rcc: Rcc::new(),
            power: Power::new(),
            flash: Registers::new(power::FLASH),
            syscfg: Registers::new(registers::SYSCFG),
            debug: Registers::new(registers::DEBUG),
            calibration: Registers::new(registers::CAN_CALIBRATION),
            exti: Exti::new(),
            ports: std::array::from_fn(Port::new),
            timers: TIMERS.each_ref().map(Timer::new),
            usarts: USARTS.each_ref().map(Usart::new),
            dmas: [Dma::new(0), Dma::new(1)],
            mux: DmaMux::default(),
            watchdog: Watchdog::new(),
            running: vec![false; MAP.len()],
            clocks: Clocks::default(),
            flash_keeps_up: true,
            next: None,
            levels: [0; INTERRUPT_WORDS],
            wants_reset: false,
            reports: Vec::new(),
            counts: Counts::default(),
        };
        soc.apply_switches();
        soc.apply_clocks(Nanos::ZERO);
        soc.settle(Nanos::ZERO);
        soc
    }

    /// Starts anew. What a reset of this kind leaves alone stays: flags of earlier resets, backup
    /// domain, supply, debug unit; what is outside: levels and bytes at the pins.
    pub fn reset(&mut self, cause: ResetCause, now: Nanos) {
        self.rcc.reset(cause, now);
        if cause == ResetCause::PowerOn {
            self.power = Power::new();
            self.debug.reset();
        } else {
            self.power.reset_but_supply();
        }
        self.flash.reset();
        self.watchdog = Watchdog::new();
        self.exti.reset();
        self.mux = DmaMux::default();
        self.wants_reset = false;
        for row in MAP.iter().filter(|row| row.switch.is_some()) {
            self.reset_block(row, now);
        }
        self.apply_switches();
        self.apply_clocks(now);
        self.connect_pins();
        self.settle(now);
    }

    /// Reads a register. Sub-word reads give their part of the word.
    ///
    /// # Errors
    /// If nobody is there, or the access is not aligned.
    pub fn read(&mut self, address: u32, width: Width, now: Nanos) -> Result<u32, BusFault> {
        self.advance(now);
        let value = self.access_read(address, width, now)?;
        if let Some((_, Row { block: Block::Usart(_), .. })) = row_of(address) {
            // Reading its data clears flags.
            self.settle(now);
        }
        Ok(value)
    }

    /// Writes a register. Sub-word writes change their part of the word.
    ///
    /// # Errors
    /// If nobody is there, or the access is not aligned.
    pub fn write(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        now: Nanos,
    ) -> Result<(), BusFault> {
        self.advance(now);
        let block = self.access_write(address, width, value, now)?;
        // What the FDCANs' interrupt lines do is asked for anew each time.
        if !matches!(block, Block::Fdcan(_) | Block::FdcanRam) {
            self.settle(now);
        }
        Ok(())
    }

    /// Reports an access that nobody answers, whatever is at the address: instructions are not
    /// fetched from peripherals.
    pub fn refuse(&mut self, address: u32, write: bool) -> BusFault {
        self.report(address, write, AccessKind::Unowned);
        BusFault
    }

    /// When something happens without an access: the earliest time to call [`advance`](Self::advance)
    /// at. The FDCANs' own events are their wires'.
    #[must_use]
    pub const fn next_event(&self) -> Option<Nanos> {
        self.next
    }

    /// Lets everything happen that is due.
    pub fn advance(&mut self, now: Nanos) {
        while let Some(at) = self.next.filter(|&at| at <= now) {
            let clocks_changed = self.rcc.next_event().is_some_and(|event| event <= at);
            self.rcc.advance(at);
            if clocks_changed {
                self.apply_clocks(at);
            }
            self.watchdog.advance(at);
            self.timers.iter_mut().for_each(|timer| timer.advance(at));
            self.usarts.iter_mut().for_each(|usart| usart.advance(at));
            self.settle(at);
        }
    }

    /// Levels of the interrupt lines: bit n of word n / 32 is external interrupt n.
    #[must_use]
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

    /// The core's clock now, in hertz: 64 MHz after a reset.
    #[must_use]
    pub const fn core_clock_hz(&self) -> u64 {
        self.clocks.core
    }

    /// All clocks now.
    #[must_use]
    pub const fn clocks(&self) -> Clocks {
        self.clocks
    }

    /// When the system clock was switched to PLL1; `None` if not yet since the last reset.
    #[must_use]
    pub const fn system_ready_at(&self) -> Option<Nanos> {
        self.rcc.system_ready_at()
    }

    /// The reset that a peripheral asks for; forgets it. [`reset`](Self::reset) does it.
    pub fn take_reset(&mut self) -> Option<ResetCause> {
        std::mem::take(&mut self.wants_reset).then_some(ResetCause::Watchdog)
    }

    /// What the chip did not like since the last call; the first 256 of it.
    pub fn take_reports(&mut self) -> Vec<Access> {
        std::mem::take(&mut self.reports)
    }

    /// How much the chip did not like since it exists.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// [`Counts::unowned`].
    #[must_use]
    pub const fn unowned(&self) -> u64 {
        self.counts.unowned
    }

    /// [`Counts::gated`].
    #[must_use]
    pub const fn gated(&self) -> u64 {
        self.counts.gated
    }

    /// Something outside drives a pin of a port ('A' ..= 'K', 0 ..= 15) to a level, or lets go of
    /// it. `false`: there is no such pin.
    pub fn drive_pin(&mut self, port: char, pin: usize, level: Option<bool>, now: Nanos) -> bool {
        self.advance(now);
        let Some(port) = port_index(port).filter(|_| pin < PINS) else { return false };
        self.ports[port].drive(pin, level);
        self.settle(now);
        true
    }

    /// The level that the chip drives a pin to; `None` if it does not, or if there is no such pin.
    /// Only general-purpose outputs: alternate functions are not seen here.
    #[must_use]
    pub fn pin_output(&self, port: char, pin: usize) -> Option<bool> {
        let port = port_index(port).filter(|_| pin < PINS)?;
        self.ports[port].output(pin)
    }

    /// Bytes that UARTs have sent at connected pins since the last call, in the order of their
    /// ends.
    pub fn take_sent(&mut self) -> Vec<SentByte> {
        let mut sent: Vec<_> = self.usarts.iter_mut().flat_map(Usart::take_sent).collect();
        sent.sort_by_key(|byte| (byte.end, byte.uart));
        sent
    }

    /// Bytes come in at a UART's receive pin (1 for USART1 ..= 10), one right after the other, the
    /// first start bit at `start`, which must be after what was fed before. `bits` is a frame's
    /// length with start, parity and stop bits. `false`: no such UART, or no such baud rate.
    pub fn feed_serial(
        &mut self,
        uart: u8,
        bytes: &[u8],
        baud: u32,
        bits: u32,
        start: Nanos,
    ) -> bool {
        let mut usarts = USARTS.iter().zip(&mut self.usarts);
        let Some((_, usart)) = usarts.find(|(facts, _)| facts.number == uart) else {
            return false;
        };
        if baud == 0 {
            return false;
        }
        let after = |frames: u64| {
            let nanos = u128::from(frames) * u128::from(bits) * 1_000_000_000 / u128::from(baud);
            start + Nanos::new(u64::try_from(nanos).unwrap_or(u64::MAX))
        };
        for (index, &byte) in (0..).zip(bytes) {
            let (start, end) = (after(index), after(index + 1));
            usart.feed(Incoming { value: byte.into(), baud, start, end });
        }
        self.schedule();
        true
    }

    fn fdcans(&self) -> MutexGuard<'_, Fdcans> {
        // What a panic left behind is as good as any state of a chip.
        self.fdcan.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn report(&mut self, address: u32, write: bool, kind: AccessKind) {
        self.counts.add(kind);
        if self.reports.len() < REPORTS {
            self.reports.push(Access { address, write, kind });
        }
    }

    /// The row of an aligned access, if it has a clock.
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
        let running = self.running[index];
        if !running {
            self.report(address, write, AccessKind::Gated);
        }
        Ok((row, running))
    }

    fn access_read(&mut self, address: u32, width: Width, now: Nanos) -> Result<u32, BusFault> {
        let (row, running) = self.owner(address, width, false)?;
        if !running {
            return Ok(0);
        }
        let offset = (address - row.base) & !3;
        let word = self.read_block(row.block, offset, now).unwrap_or_else(|refusal| {
            self.report(address, false, refusal.into());
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
        let (row, running) = self.owner(address, width, true)?;
        if running {
            let write = Write::new(address - row.base, width, value);
            if let Err(refusal) = self.write_block(row.block, write, now) {
                self.report(address, true, refusal.into());
            }
            if matches!(row.block, Block::Rcc | Block::Power | Block::Flash) {
                self.check_flash(address, now);
            }
        }
        Ok(row.block)
    }

    fn read_block(&mut self, block: Block, offset: u32, now: Nanos) -> Result<u32, Refusal> {
        match block {
            Block::Rcc => self.rcc.read(offset),
            Block::Power => self.power.read(offset, now),
            Block::Flash => self.flash.read(offset & !0x100),
            Block::Syscfg => {
                let stored = self.syscfg.read(offset)?;
                // CCCSR.RDY: the compensation cell needs CSI.
                let ready = offset == 0x20 && stored & 1 != 0 && self.rcc.csi_is_ready();
                Ok(stored | u32::from(ready) << 8)
            }
            Block::Exti => self.exti.read(offset),
            Block::Debug => self.debug.read(offset),
            Block::Watchdog => self.watchdog.read(offset),
            Block::Gpio(port) => self.ports[port].read(offset),
            Block::Timer(timer) => self.timers[timer].read(offset, now),
            Block::Usart(usart) => self.usarts[usart].read(offset, now),
            Block::Dma(dma) => self.dmas[dma].read(offset),
            Block::DmaMux => self.mux.read(offset),
            Block::Fdcan(index) => {
                self.fdcans().read(index, offset, now).ok_or(Refusal::Unmodelled)
            }
            Block::FdcanRam => {
                self.fdcans().read_ram(offset as usize / 4).ok_or(Refusal::Unmodelled)
            }
            Block::FdcanCalibration => self.calibration.read(offset),
            Block::Unmodelled => Err(Refusal::Unmodelled),
        }
    }

    fn write_block(&mut self, block: Block, write: Write, now: Nanos) -> Result<(), Refusal> {
        match block {
            Block::Rcc => self.write_rcc(write, now),
            Block::Power => self.power.write(write, now),
            Block::Flash => self.flash.write(write.at(write.offset & !0x100)),
            Block::Syscfg => self.syscfg.write(write),
            Block::Exti => self.exti.write(write),
            Block::Debug => self.debug.write(write),
            Block::Watchdog => self.watchdog.write(write, now),
            Block::Gpio(port) => {
                let written = self.ports[port].write(write);
                // MODER, AFRL, AFRH.
                if let 0x00 | 0x20 | 0x24 = write.offset {
                    self.connect_pins();
                }
                written
            }
            Block::Timer(timer) => self.timers[timer].write(write, now),
            Block::Usart(usart) => self.usarts[usart].write(write, now),
            Block::Dma(dma) => self.dmas[dma].write(write),
            Block::DmaMux => self.mux.write(write),
            // Registers are words: a part of one writes zeros to the rest.
            Block::Fdcan(index) => {
                let known = self.fdcans().write(index, write.offset, write.ones(), now);
                if known { Ok(()) } else { Err(Refusal::Unmodelled) }
            }
            Block::FdcanRam => {
                let word = write.offset as usize / 4;
                let mut fdcans = self.fdcans();
                let old = fdcans.read_ram(word).ok_or(Refusal::Unmodelled)?;
                fdcans.write_ram(word, write.over(old));
                Ok(())
            }
            Block::FdcanCalibration => self.calibration.write(write),
            Block::Unmodelled => Err(Refusal::Unmodelled),
        }
    }

    fn write_rcc(&mut self, write: Write, now: Nanos) -> Result<(), Refusal> {
        let before = MAP.iter().map(|row| self.held_in_reset(row)).collect::<Vec<_>>();
        let written = self.rcc.write(write, now, self.power.backup_unlocked());
        if Rcc::switches_at(write.offset) {
            for (row, was_held) in MAP.iter().zip(before) {
                if self.held_in_reset(row) && !was_held {
                    self.reset_block(row, now);
                }
            }
            self.connect_pins();
            self.apply_switches();
        }
        self.apply_clocks(now);
        written
    }

    fn held_in_reset(&self, row: &Row) -> bool {
        let resets = |switch: super::map::Switch| {
            switch.reset.map_or(0, |offset| self.rcc.resets(offset) & switch.mask)
        };
        row.switch.is_some_and(|switch| resets(switch) != 0)
    }

    fn reset_block(&mut self, row: &Row, now: Nanos) {
        match row.block {
            Block::Syscfg => self.syscfg.reset(),
            Block::Gpio(port) => self.ports[port].reset(),
            Block::Timer(timer) => self.timers[timer].reset(now),
            Block::Usart(usart) => self.usarts[usart].reset(),
            Block::Dma(dma) => self.dmas[dma].reset(),
            // One bit resets all three: once is enough.
            Block::Fdcan(0) => self.fdcans().reset(),
            Block::FdcanCalibration => self.calibration.reset(),
            // The others have no reset of their own, or nothing to reset.
            Block::Rcc
            | Block::Power
            | Block::Flash
            | Block::Exti
            | Block::Debug
            | Block::Watchdog
            | Block::DmaMux
            | Block::Fdcan(_)
            | Block::FdcanRam
            | Block::Unmodelled => {}
        }
    }

    /// Gates and resets: who has a clock.
    fn apply_switches(&mut self) {
        for (running, row) in self.running.iter_mut().zip(MAP) {
            *running = row.switch.is_none_or(|switch| self.rcc.is_running(switch));
        }
    }

    /// Tells everybody the clock they have now.
    fn apply_clocks(&mut self, now: Nanos) {
        let clocks = self.rcc.clocks();
        if clocks.fdcan != self.clocks.fdcan {
            self.fdcans().set_kernel_clock(clocks.fdcan);
        }
        self.clocks = clocks;
        for (row, &running) in MAP.iter().zip(&self.running) {
            let gated = |hz| if running { hz } else { 0 };
            match row.block {
                Block::Timer(timer) => self.timers[timer].set_clock(gated(clocks.timers[0]), now),
                Block::Usart(usart) => {
                    let hz = clocks.usarts[USARTS[usart].bus];
                    self.usarts[usart].set_clock(gated(hz));
                }
                _ => {}
            }
        }
    }

    /// Tells peripherals which of their pins lead outside.
    fn connect_pins(&mut self) {
        let connected = |signal| is_connected(&self.ports, signal);
        let can = [0, 1, 2].map(|index| {
            (connected(Signal::CanReceive(index)), connected(Signal::CanTransmit(index)))
        });
        let serial: [(bool, bool); USARTS.len()] = std::array::from_fn(|index| {
            (connected(Signal::SerialReceive(index)), connected(Signal::SerialTransmit(index)))
        });
        let mut fdcans = self.fdcans();
        for (index, (receive, transmit)) in can.into_iter().enumerate() {
            fdcans.set_pins(index, receive, transmit);
        }
        drop(fdcans);
        for (usart, pins) in self.usarts.iter_mut().zip(serial) {
            usart.pins = pins;
        }
    }

    /// Reports once when the flash becomes too slow for its clock.
    fn check_flash(&mut self, address: u32, now: Nanos) {
        let (scale, wait_states) = (self.power.scale(now), self.flash.value(0) & 7);
        let keeps_up = power::flash_keeps_up(scale, self.clocks.bus, wait_states);
        if self.flash_keeps_up && !keeps_up {
            self.report(address, true, AccessKind::WaitStates);
        }
        self.flash_keeps_up = keeps_up;
    }

    /// After anything that may have changed: edges, transfers, interrupts, what comes next.
    fn settle(&mut self, now: Nanos) {
        self.exti.look(self.exti_levels());
        self.transfer(now);
        self.wants_reset |= self.watchdog.take_bite();
        let mut levels = [0; INTERRUPT_WORDS];
        let timers = self.timers.iter().filter_map(Timer::interrupt);
        let usarts = self.usarts.iter().filter_map(Usart::interrupt);
        let dmas = self.dmas.iter().flat_map(Dma::interrupts);
        for number in self.exti.interrupts().chain(timers).chain(usarts).chain(dmas) {
            raise(&mut levels, number);
        }
        self.levels = levels;
        self.schedule();
    }

    fn schedule(&mut self) {
        let timers = self.timers.iter().filter_map(Timer::next_event);
        let usarts = self.usarts.iter().filter_map(Usart::next_event);
        let others = [self.rcc.next_event(), self.watchdog.next_event()].into_iter().flatten();
        self.next = timers.chain(usarts).chain(others).min();
    }

    /// Levels of EXTI's lines 0 ..= 15: each is the pin of its number of the port that SYSCFG says.
    fn exti_levels(&self) -> u32 {
        (0..PINS)
            .map(|pin| {
                // Four lines in each of EXTICR1 ..= EXTICR4.
                let register = if pin < 4 {
                    0x08
                } else if pin < 8 {
                    0x0C
                } else if pin < 12 {
                    0x10
                } else {
                    0x14
                };
                let port = self.syscfg.value(register) >> (4 * (pin % 4)) & 0xF;
                let high = self.ports.get(port as usize).is_some_and(|port| port.input(pin));
                u32::from(high) << pin
            })
            .sum()
    }

    /// Moves what the DMAs can move now.
    fn transfer(&mut self, now: Nanos) {
        let mut moved = true;
        while std::mem::take(&mut moved) {
            for dma in 0..self.dmas.len() {
                if self.dmas[dma].is_idle() {
                    continue;
                }
                for stream in 0..dma::STREAMS {
                    let request = self.mux.request(dma, stream);
                    let requested = self.usarts.iter().any(|usart| usart.requests(request));
                    if let Some(transfer) = self.dmas[dma].next(stream, requested) {
                        let worked = self.move_item(transfer, now).is_some();
                        self.dmas[dma].moved(stream, worked);
                        moved = true;
                    }
                }
            }
        }
    }

    fn move_item(&mut self, transfer: Transfer, now: Nanos) -> Option<()> {
        let Transfer { from, to, width } = transfer;
        let is_peripheral = |address: u32| {
            address.checked_sub(PERIPHERALS.0).is_some_and(|offset| offset < PERIPHERALS.1)
        };
        let reachable = |address| !UNREACHABLE.iter().any(|range| range.contains(&address));
        let length = width.bytes() as usize;
        let value = if is_peripheral(from) {
            self.access_read(from, width, now).ok()?
        } else {
            let mut bytes = [0; 4];
            self.memory.read(from, &mut bytes[..length]).ok().filter(|()| reachable(from))?;
            u32::from_le_bytes(bytes)
        };
        if is_peripheral(to) {
            self.access_write(to, width, value, now).ok().map(drop)
        } else {
            // A plain write does not program the flash.
            let writable = reachable(to) && to >> 24 != FLASH >> 24;
            let bytes = value.to_le_bytes();
            if writable { self.memory.write(to, &bytes[..length]).ok() } else { None }
        }
    }
}

fn raise(levels: &mut [u32; INTERRUPT_WORDS], number: usize) {
    if let Some(word) = levels.get_mut(number / 32) {
        *word |= 1 << (number % 32);
    }
}

fn port_index(port: char) -> Option<usize> {
    let index = u32::from(port).checked_sub('A'.into())? as usize;
    (index < PORTS).then_some(index)
}
