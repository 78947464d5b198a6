//! One controller: its registers, and what it does on the wire.

use rc10_can::{BusError, CanFrame};
use rc10_sim::{Activity, Nanos, Outcome, tolerance_ppm};

use super::counters::Counters;
use super::errors::Errors;
use super::link::Link;
use super::ram::MessageRam;
use super::registers::{TABLE, TEST_LBCK, at, cccr, ir};
use super::ring::{EVENTS, Ring};
use super::timing::Timestamp;
use super::transmit::Transmit;
use crate::peripherals::registers::Registers;
use crate::peripherals::{AccessKind, Answer, Width, Write};
use crate::time::{Period, time_of};

/// Sequences of eleven recessive bits before a controller takes part, and after bus-off (RM0468,
/// PSR.BO; ISO 11898-1).
const TO_JOIN: u64 = 1;
const TO_RECOVER: u64 = 129;
/// Recessive bits that an error-passive sender adds (ISO 11898-1, suspend transmission).
const SUSPEND_BITS: u64 = 8;
/// Periods of the kernel clock, the slower one, until a write to INIT or TXBCR can be read
/// back ("due to the synchronization mechanism between the two clock domains, there may be a delay"):
/// our estimate, two synchronizers and some. A driver has to ask, not to count.
const CROSSING: u64 = 16;

/// Without a clock nothing crosses.
const NEVER: Nanos = Nanos::new(u64::MAX);

#[derive(Default)]
pub(super) struct Controller {
    pub(super) registers: Registers,
    /// IR.
    pub(super) flags: u32,
    /// Its time quantum clock, and whether the calibration unit vouches for it.
    pub(super) kernel_hz: u64,
    is_clock_valid: bool,
    /// Until then CCCR.INIT reads as it was before it was written.
    init_told: Nanos,
    /// Whether the receive and the transmit pin lead to it.
    pub pins: (bool, bool),
    /// Whether its transceiver takes no part.
    pub is_deaf: bool,
    timestamp: Timestamp,
    link: Link,
    errors: Errors,
    /// NDAT1 and NDAT2: receive buffers that were not read yet.
    pub(super) new_data: [u32; 2],
    /// HPMS.
    pub(super) high_priority: u32,
    pub(super) transmit: Transmit,
    pub(super) rings: [Ring; 3],
    /// The frame that ended last was its own.
    sent_last: bool,
    suspended_until: Nanos,
    /// The latest time that it knows of.
    pub(super) now: Nanos,
    pub counters: Counters,
}

impl Controller {
    pub fn new() -> Self {
        Self { registers: Registers::new(TABLE), ..Self::default() }
    }

    /// The block's reset: everything outside of it (clock, pins, wire) stays.
    pub fn reset(&mut self) {
        let old = std::mem::replace(self, Self::new());
        (self.kernel_hz, self.is_clock_valid) = (old.kernel_hz, old.is_clock_valid);
        (self.pins, self.is_deaf, self.link) = (old.pins, old.is_deaf, old.link);
        (self.now, self.counters) = (old.now, old.counters);
        self.link.stop();
    }

    pub fn set_kernel_clock(&mut self, hz: u64, valid: bool) {
        let was_off = std::mem::replace(&mut self.kernel_hz, hz) == 0;
        if self.init_told == NEVER {
            self.init_told = self.after(CROSSING);
        }
        self.is_clock_valid = valid;
        self.restrict();
        self.set_timestamp_rate();
        if self.is(cccr::INIT) {
            return;
        }
        if hz == 0 {
            self.stop();
        } else if was_off {
            self.start();
        }
    }

    fn after(&self, periods: u64) -> Nanos {
        if self.kernel_hz == 0 {
            return NEVER;
        }
        self.now + time_of(periods, self.kernel_hz)
    }

    /// CCCR.INIT as it reads.
    fn told_init(&self) -> bool {
        self.is(cccr::INIT) != (self.now < self.init_told)
    }

    fn is(&self, bit: u32) -> bool {
        self.registers.has(at::CCCR, bit)
    }

    /// The first word in the message RAM: bits 15:2 of every start address.
    pub(super) fn start_word(&self, offset: u32) -> u32 {
        self.registers.field(offset, 2, 14)
    }

    /// Without a valid clock it is kept in restricted mode while it is not in INIT.
    fn restrict(&mut self) {
        if !self.is_clock_valid && !self.is(cccr::INIT) {
            self.registers.set(at::CCCR, self.registers.value(at::CCCR) | cccr::ASM);
        }
    }

    pub fn may_configure(&self) -> bool {
        self.is(cccr::INIT | cccr::CCE)
    }

    /// One nominal bit, of NBTP; `None` if the clock is off.
    pub fn bit(&self) -> Option<Period> {
        let part = |shift, bits| self.registers.field(at::NBTP, shift, bits) + 1;
        let quanta = 1 + part(8, 8) + part(0, 7);
        Period::new(u64::from(quanta * part(16, 9)), self.kernel_hz)
    }

    /// The difference of other nodes' bits that it follows, of NBTP: NTSEG1, NTSEG2, NSJW.
    pub fn tolerance_ppm(&self) -> u32 {
        let part = |shift, bits| self.registers.field(at::NBTP, shift, bits) + 1;
        tolerance_ppm(part(8, 8), part(0, 7), part(25, 7))
    }

    fn set_timestamp_rate(&mut self) {
        let prescaler = self.registers.field(at::TSCC, 16, 4) + 1;
        let counts_bits = self.registers.field(at::TSCC, 0, 2) == 1;
        let tick = self.bit().filter(|_| counts_bits).map(|bit| bit.times(prescaler.into()));
        self.timestamp.set_tick(tick, self.now);
    }

    /// The timestamp of something that began at `at`; 0 with the external counter, or with no
    /// counter.
    pub(super) fn stamp(&self, at: Nanos) -> u32 {
        match self.registers.field(at::TSCC, 0, 2) {
            1 => self.timestamp.value(at),
            _ => 0,
        }
    }

    pub fn interrupt_line(&self, line: u32) -> bool {
        let second = self.registers.value(at::ILS);
        let of_line = if line == 0 { !second } else { second };
        let enabled = self.registers.value(at::IE) & of_line;
        self.registers.value(at::ILE) >> line & 1 != 0 && self.flags & enabled != 0
    }

    // Time.

    pub fn settle(&mut self, now: Nanos) {
        self.now = self.now.max(now);
        if let Some(bit) = self.bit() {
            let seen = self.link.settle(self.now, bit);
            if seen > 0 && self.errors.bus_off {
                self.errors.recovering(seen);
                if self.link.is_joined() {
                    self.flags |= self.errors.recovered();
                }
            }
        }
        if self.timestamp.has_wrapped(self.now) {
            self.flags |= ir::TSW;
        }
        self.settle_transmit();
        self.stop_clock_if_asked();
    }

    pub fn next_event(&self) -> Option<Nanos> {
        let joins = self.bit().and_then(|bit| self.link.next_event(bit));
        let resumes = (self.transmit.pending != 0).then_some(self.suspended_until);
        let wraps = self.registers.has(at::IE, ir::TSW).then(|| self.timestamp.next_wrap());
        let cancelled = self.transmit.next_event();
        let events = joins.into_iter().chain(resumes).chain(wraps.flatten()).chain(cancelled);
        events.filter(|&event| event > self.now).min()
    }

    // Taking part.

    /// CCCR.INIT was cleared, or its clock is back.
    fn start(&mut self) {
        if self.kernel_hz == 0 {
            return;
        }
        if self.errors.bus_off {
            self.errors.start_recovery();
            self.link.start(TO_RECOVER, self.now);
        } else {
            self.link.start(TO_JOIN, self.now);
        }
    }

    /// CCCR.INIT was set, or its clock is off. Takes effect at once, in mid-frame too.
    fn stop(&mut self) {
        self.link.stop();
        self.abort();
        self.sent_last = false;
    }

    /// Clock stop request: granted as soon as nothing is pending and the wire is idle.
    fn stop_clock_if_asked(&mut self) {
        let is_quiet = !self.link.is_joined() || !self.link.busy;
        let idle = self.transmit.pending == 0 && !self.transmit.is_sending() && is_quiet;
        if self.is(cccr::CSR) && !self.is(cccr::CSA) && idle {
            let value = self.registers.value(at::CCCR) | cccr::INIT | cccr::CSA;
            self.registers.set(at::CCCR, value);
            self.stop();
        }
    }

    fn loops_back(&self) -> bool {
        self.is(cccr::TEST) && self.registers.has(at::TEST, TEST_LBCK)
    }

    pub fn is_on_bus(&self) -> bool {
        self.link.is_joined() && self.kernel_hz > 0 && !self.loops_back()
    }

    /// Its nominal bit, once it takes part, or did until it went bus-off.
    pub fn bit_in_use(&self) -> Option<Period> {
        let takes_part = !self.is(cccr::INIT) || self.errors.bus_off;
        self.bit().filter(|_| takes_part && self.is_connected() && !self.loops_back())
    }

    pub const fn is_connected(&self) -> bool {
        self.pins.0 && self.pins.1 && !self.is_deaf
    }

    // The wire.

    pub fn offer(&mut self, now: Nanos, ram: &mut MessageRam) -> Option<CanFrame> {
        let silent = self.is(cccr::MON) || self.is(cccr::ASM);
        if silent || !self.is_on_bus() || now < self.suspended_until {
            return None;
        }
        self.most_urgent(ram)
    }

    pub fn sent(&mut self, outcome: Outcome, ram: &mut MessageRam) {
        if !self.transmit.is_sending() {
            // It was stopped meanwhile.
            return;
        }
        self.sent_last = true;
        let error = match outcome {
            Outcome::Acknowledged => {
                self.succeeded(ram);
                self.flags |= self.errors.sent();
                return;
            }
            Outcome::Unacknowledged => BusError::Acknowledge,
            Outcome::Destroyed(error) => error,
        };
        self.failed();
        self.flags |= self.errors.transmission_failed(error);
        if self.errors.bus_off {
            self.counters.bus_offs += 1;
            self.registers.set(at::CCCR, self.registers.value(at::CCCR) | cccr::INIT);
            self.stop();
        }
    }

    pub fn received(&mut self, frame: &CanFrame, start: Nanos, ram: &mut MessageRam) {
        if !self.is_on_bus() {
            return;
        }
        self.flags |= self.errors.received(self.is(cccr::ASM));
        self.accept(frame, self.stamp(start), ram);
    }

    pub fn disturbed(&mut self, error: BusError) {
        if self.is_on_bus() {
            self.flags |= self.errors.reception_failed(error, self.is(cccr::ASM));
        }
    }

    pub fn wire_is(&mut self, activity: Activity, at: Nanos) {
        let bit = self.bit();
        self.link.wire_is(activity, at, bit);
        if activity == Activity::Idle
            && std::mem::take(&mut self.sent_last)
            && self.errors.is_passive()
            && let Some(bit) = bit
        {
            self.suspended_until = at + bit.many(SUSPEND_BITS);
        }
        self.settle(at);
    }

    // Registers.

    pub fn read(&mut self, offset: u32, now: Nanos) -> Answer<u32> {
        self.settle(now);
        Ok(match offset {
            at::TSCV => self.stamp(self.now),
            // The timeout counter does not count.
            at::TOCV => self.registers.field(at::TOCC, 16, 16),
            at::ECR => self.errors.read_ecr(),
            at::PSR => self.errors.read_psr() | self.activity() << 3,
            at::IR => self.flags,
            at::HPMS => self.high_priority,
            at::NDAT1 => self.new_data[0],
            at::NDAT2 => self.new_data[1],
            at::RXF0S => self.ring_status(0),
            at::RXF1S => self.ring_status(1),
            at::TXFQS => self.queue_status(),
            at::TXBRP => self.transmit.told_pending(),
            at::TXBAR => self.transmit.adding,
            at::TXBCR => self.transmit.being_cancelled(),
            at::TXBTO => self.transmit.occurred,
            at::TXBCF => self.transmit.cancelled,
            at::TXEFS => self.ring_status(EVENTS),
            at::CCCR => self.registers.value(offset) & !cccr::INIT | u32::from(self.told_init()),
            _ => return self.registers.read(offset).inspect_err(|_| self.flags |= ir::ARA),
        })
    }

    /// PSR.ACT: synchronizing, idle, receiver, transmitter.
    fn activity(&self) -> u32 {
        if !self.link.is_joined() {
            0
        } else if self.transmit.is_sending() {
            3
        } else {
            1 + u32::from(self.link.busy)
        }
    }

    pub fn write(&mut self, offset: u32, value: u32, now: Nanos) -> Answer {
        self.settle(now);
        let written = self.act(offset, value);
        self.settle(now);
        written
    }

    /// Writes a register that only stores.
    fn store(&mut self, offset: u32, value: u32, is_unlocked: bool) -> Answer {
        let write = Write::new(offset, Width::Word, value);
        let written = self.registers.write_if(is_unlocked, write);
        self.set_timestamp_rate();
        if written == Err(AccessKind::Protected) {
            self.refuse_if(true);
            return Ok(());
        }
        written.inspect_err(|_| self.flags |= ir::ARA)
    }

    fn refuse_if(&mut self, changes: bool) {
        self.counters.protected_writes += u64::from(changes);
    }

    fn act(&mut self, offset: u32, value: u32) -> Answer {
        match offset {
            at::CCCR => self.write_cccr(value),
            // It needs CCCR.TEST as well.
            at::TEST => {
                let is_unlocked = self.may_configure() && self.is(cccr::TEST);
                return self.store(offset, value, is_unlocked);
            }
            at::TSCV => self.timestamp.restart(self.now),
            at::IR => self.flags &= !value,
            at::NDAT1 => self.new_data[0] &= !value,
            at::NDAT2 => self.new_data[1] &= !value,
            at::TXBAR => self.ask(value),
            at::TXBCR => self.ask_to_cancel(value),
            at::RXF0A => self.acknowledge(0, value),
            at::RXF1A => self.acknowledge(1, value),
            at::TXEFA => self.acknowledge(EVENTS, value),
            // TOCV stands at its preset.
            _ => return self.store(offset, value, self.may_configure()),
        }
        Ok(())
    }

    fn ask(&mut self, buffers: u32) {
        if buffers == 0 {
            return;
        }
        self.counters.requested(self.now);
        if self.is(cccr::CCE) {
            self.refuse_if(true);
        } else if self.is(cccr::MON) {
            self.counters.requests_ignored += u64::from(buffers.count_ones());
        } else {
            self.request(buffers);
        }
    }

    fn ask_to_cancel(&mut self, buffers: u32) {
        if self.is(cccr::CCE) {
            self.refuse_if(buffers != 0);
        } else {
            let done = if self.kernel_hz == 0 { self.now } else { self.after(CROSSING) };
            self.cancel(buffers, done);
        }
    }

    fn write_cccr(&mut self, value: u32) {
        let old = self.registers.value(at::CCCR);
        let was_init = old & cccr::INIT != 0;
        let may_configure = self.may_configure();

        // While the clock is stopped, INIT stays set.
        let clock_stopped = value & cccr::CSR != 0 && old & cccr::CSA != 0;
        let wanted = value & cccr::INIT != 0 || clock_stopped;
        // "The programmer has to assure that the previous value written to INIT has been accepted".
        let is_crossing = self.now < self.init_told;
        self.refuse_if(is_crossing && wanted != was_init);
        let init = if is_crossing { was_init } else { wanted };
        let may_set_cce = was_init && self.told_init() && init;
        let cce = value & cccr::CCE != 0 && may_set_cce;
        self.refuse_if(value & cccr::CCE != 0 && value & cccr::INIT != 0 && !may_set_cce);

        let mut guarded = value & (cccr::PROTECTED | cccr::SET_PROTECTED);
        if !may_configure {
            let held = old & cccr::PROTECTED | old & guarded & cccr::SET_PROTECTED;
            self.refuse_if(held != guarded);
            guarded = held;
        }
        let mut new = guarded | value & cccr::CSR;
        new |= if init { cccr::INIT } else { 0 };
        new |= if cce { cccr::CCE } else { 0 };
        new |= if clock_stopped { cccr::CSA } else { 0 };
        self.registers.set(at::CCCR, new);
        if init != was_init {
            self.init_told = self.after(CROSSING);
        }
        self.restrict();

        if new & cccr::TEST == 0 {
            self.registers.set(at::TEST, 0);
        }
        if cce && old & cccr::CCE == 0 {
            self.rings = Default::default();
            self.high_priority = 0;
            self.reset_transmit();
        }
        if new & cccr::MON != 0 {
            self.drop_requests();
        }
        match (was_init, init) {
            (false, true) => self.stop(),
            (true, false) => self.start(),
            _ => (),
        }
    }
}
