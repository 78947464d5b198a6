//! The STM32H7's three FDCAN controllers and the message RAM they share, for classic CAN.
//!
//! Each is Bosch's `M_CAN`, release 3.2.1. [`Fdcans`] is what the processor sees: registers, message
//! RAM, interrupt lines. [`Node`] is what a wire sees: a [`Controller`](rc10_sim::Controller).
//!
//! Not modelled, beside CAN FD frames (counted and cancelled): the bits themselves. A frame is
//! received when it ends, not at the last bit of its end-of-frame but one; a sender's broken frame
//! is always a bit error ([`BusError::Bit`] reads as `Bit0Error`). Further:
//! * Loop-back: a controller in it is not on the bus.
//! * Bus monitoring sends nothing, but a wire takes every listener for one that acknowledges.
//! * The timeout counter, the RAM watchdog, the external timestamp counter (reads as 0) and
//!   transmit pause hold a written value and do nothing. The time-triggered registers do not exist.
//! * The clock calibration unit does not calibrate: bypassed, or without a valid clock.
//! * Remote frames and length codes above 8 are those of [`CanFrame`]: 8 at most.
//! * While in bus-off, TEC keeps its last value, which the manual leaves open.
//! * Acknowledging an element that is not in the FIFO is ignored, where the chip's indices would go
//!   astray.

mod calibration;
mod controller;
mod counters;
mod errors;
mod filters;
mod link;
mod ram;
mod receive;
mod registers;
mod ring;
mod timing;
mod transmit;

use std::sync::{Arc, Mutex};

use rc10_can::{BusError, CanFrame};
use rc10_sim::{Activity, Nanos, Outcome};

use crate::peripherals::registers::Registers;
use crate::peripherals::{AccessKind, Answer, lock};
use crate::time::Period;
use controller::Controller;
pub use counters::{Counters, Spread};
use ram::MessageRam;

/// FDCAN1, FDCAN2, FDCAN3 and their message RAM. Controllers are counted from 0.
pub struct Fdcans {
    controllers: [Controller; 3],
    calibration: Registers,
    /// Whether the controllers need it to be bypassed or calibrated at all.
    calibration_needed: bool,
    kernel_hz: u64,
    ram: MessageRam,
}

impl Fdcans {
    /// FDCANs after power-on: no kernel clock, no pins, noise in the message RAM by the seed.
    pub fn new(seed: u64) -> Self {
        Self {
            controllers: std::array::from_fn(|_| Controller::new()),
            calibration: Registers::new(calibration::TABLE),
            calibration_needed: true,
            kernel_hz: 0,
            ram: MessageRam::new(seed),
        }
    }

    /// Resets all registers, as RCC does. Message RAM, clock, pins and [`Counters`] stay.
    pub fn reset(&mut self) {
        self.controllers.iter_mut().for_each(Controller::reset);
        self.calibration.reset();
        self.apply_clock();
    }

    /// Reads a register at an offset in bytes from the controller's base. Fails if there is no such
    /// register.
    pub fn read(&mut self, index: usize, offset: u32, now: Nanos) -> Answer<u32> {
        self.controllers.get_mut(index).ok_or(AccessKind::Unmodelled)?.read(offset, now)
    }

    /// Writes a register; read-only and protected bits stay. Fails if there is no such register.
    pub fn write(&mut self, index: usize, offset: u32, value: u32, now: Nanos) -> Answer {
        self.controllers.get_mut(index).ok_or(AccessKind::Unmodelled)?.write(offset, value, now)
    }

    /// Sets whether the clock calibration unit has to be bypassed before a controller may send.
    pub fn set_calibration_needed(&mut self, needed: bool) {
        self.calibration_needed = needed;
        self.apply_clock();
    }

    /// A word of the message RAM, 0 ..= 2559; `None` beyond.
    pub fn read_ram(&self, word: usize) -> Option<u32> {
        self.ram.words.get(word).copied()
    }

    /// Writes a word of the message RAM, 0 ..= 2559; `false` beyond.
    pub fn write_ram(&mut self, word: usize, value: u32) -> bool {
        self.ram.words.get_mut(word).map(|slot| *slot = value).is_some()
    }

    /// Times a controller went beyond the message RAM's end, where a register had sent it.
    pub const fn ram_misses(&self) -> u64 {
        self.ram.misses
    }

    /// The frequency of all three kernel clocks in hertz; 0: off, then no controller takes part.
    pub fn set_kernel_clock(&mut self, hz: u64) {
        self.kernel_hz = hz;
        self.apply_clock();
    }

    fn apply_clock(&mut self) {
        let (hz, valid) = (self.time_quantum_of(self.kernel_hz), self.is_clock_valid());
        self.controllers.iter_mut().for_each(|one| one.set_kernel_clock(hz, valid));
    }

    /// Sets whether pins lead to a controller's input and output: it needs both.
    pub fn set_pins(&mut self, index: usize, receive: bool, transmit: bool) {
        if let Some(one) = self.controllers.get_mut(index) {
            one.pins = (receive, transmit);
        }
    }

    /// Sets whether the transceiver of each controller takes part.
    pub fn set_transceivers(&mut self, take_part: [bool; 3]) {
        for (one, takes_part) in self.controllers.iter_mut().zip(take_part) {
            one.is_deaf = !takes_part;
        }
    }

    /// Both interrupt lines of each controller.
    pub fn interrupt_lines(&self) -> [[bool; 2]; 3] {
        self.controllers.each_ref().map(|one| [one.interrupt_line(0), one.interrupt_line(1)])
    }

    /// Counters of one controller.
    pub fn counters(&self, index: usize) -> Counters {
        self.controllers.get(index).map(|one| one.counters.clone()).unwrap_or_default()
    }

    /// Bits a second of a controller, and nanoseconds of one; `None` while it takes no part.
    pub(crate) fn bit_rate(&self, index: usize) -> Option<(u64, u32)> {
        let bit = self.controllers.get(index)?.bit_in_use()?;
        Some((bit.rate(), bit.nanos()))
    }
}

/// One controller at its end of a wire.
pub struct Node {
    fdcans: Arc<Mutex<Fdcans>>,
    index: usize,
}

impl Node {
    /// Controller 0, 1 or 2; any other is never on the bus.
    pub const fn new(fdcans: Arc<Mutex<Fdcans>>, index: usize) -> Self {
        Self { fdcans, index }
    }

    /// Does something with the controller, if it exists.
    fn with<R: Default>(&self, act: impl FnOnce(&mut Controller, &mut MessageRam) -> R) -> R {
        let mut fdcans = lock(&self.fdcans);
        let Fdcans { controllers, ram, .. } = &mut *fdcans;
        controllers.get_mut(self.index).map_or_else(R::default, |one| act(one, ram))
    }

    /// Does something with the controller at a time up to which everything has happened.
    fn at<R: Default>(
        &self,
        now: Nanos,
        act: impl FnOnce(&mut Controller, &mut MessageRam) -> R,
    ) -> R {
        self.with(|one, ram| {
            one.settle(now);
            act(one, ram)
        })
    }
}

impl rc10_sim::Controller for Node {
    fn is_on_bus(&self) -> bool {
        self.with(|one, _| one.is_on_bus())
    }
    fn is_connected(&self) -> bool {
        self.with(|one, _| one.is_connected())
    }
    fn hears_itself(&self) -> bool {
        self.with(|one, _| !one.is_deaf)
    }
    fn bit_time_ns(&self) -> Option<u32> {
        self.with(|one, _| one.bit().map(Period::nanos))
    }
    fn tolerance_ppm(&self) -> u32 {
        self.with(|one, _| one.tolerance_ppm())
    }
    fn offer(&mut self, now: Nanos) -> Option<CanFrame> {
        self.at(now, |one, ram| one.offer(now, ram))
    }
    fn sending(&mut self, start: Nanos) {
        self.at(start, |one, _| one.sending(start));
    }
    fn lost_arbitration(&mut self, start: Nanos) {
        self.at(start, |one, _| one.lost_arbitration());
    }
    fn sent(&mut self, outcome: Outcome, end: Nanos) {
        self.at(end, |one, ram| one.sent(outcome, ram));
    }
    fn received(&mut self, frame: &CanFrame, start: Nanos, end: Nanos) {
        self.at(end, |one, ram| one.received(frame, start, ram));
    }
    fn disturbed(&mut self, error: BusError, at: Nanos) {
        self.at(at, |one, _| one.disturbed(error));
    }
    fn wire_is(&mut self, activity: Activity, at: Nanos) {
        self.at(at, |one, _| one.wire_is(activity, at));
    }
    fn next_event(&self) -> Option<Nanos> {
        self.with(|one, _| one.next_event())
    }
    fn advance(&mut self, now: Nanos) {
        self.at(now, |_, _| ());
    }
}
