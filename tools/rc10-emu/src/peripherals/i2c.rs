//! I2C1, 2, 3 and 5 as masters with devices (RM0468, I2C chapter), in bytes of nine clocks.
//!
//! Modelled: 7-bit addresses, reload, automatic and software stop, repeated start, refused
//! addresses and bytes, clock stretching, a bus held low, DMA requests, interrupts.
//! Not modelled, and reported when asked for: 10-bit addresses, slaves, `SMBus`, time-outs in
//! hardware. Filters and edges take no time; there is no other master.

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Write};
use super::facts::{Facts, I2CS};
use crate::time::time_of;

/// A device on an I2C bus.
pub trait I2cDevice: Send {
    /// The 7-bit address.
    fn address(&self) -> u8;

    /// It is addressed, to be read or to be written; whether it acknowledges that.
    fn start(&mut self, reads: bool, now: Nanos) -> bool;

    /// A byte for it; whether it acknowledges that.
    fn write(&mut self, byte: u8, now: Nanos) -> bool;

    /// The byte that it sends.
    fn read(&mut self, now: Nanos) -> u8;

    /// The transaction has ended: by a stop, or by the chip's leaving the bus.
    fn stop(&mut self, _now: Nanos) {}

    /// Time for which it holds the clock low behind each byte; [`Nanos`] of all ones: for ever.
    fn stretch(&self) -> Nanos {
        Nanos::ZERO
    }
}

// CR1.
const ENABLE: u32 = 1 << 0;
/// TXIE, RXIE, NACKIE, STOPIE, TCIE, ERRIE and their flags in ISR.
const ERROR_INTERRUPT: u32 = 1 << 7;
const TRANSMIT_DMA: u32 = 1 << 14;
const RECEIVE_DMA: u32 = 1 << 15;
/// SBC, NOSTRETCH, WUPEN, GCEN, SMBHEN, SMBDEN, ALERTEN, PECEN.
const CR1_UNMODELLED: u32 = 0xFF << 16;
// CR2.
bits! { READ: 10, LONG_ADDRESS: 11, START: 13, STOP: 14, RELOAD: 24, AUTOMATIC_END: 25 }
// ISR.
bits! {
    EMPTY: 0, WANTS_BYTE: 1, RECEIVED: 2, REFUSED: 4, STOPPED: 5, COMPLETE: 6, COMPLETE_RELOAD: 7,
    BUS_ERROR: 8, ARBITRATION_LOST: 9, OVERRUN: 10, BUSY: 15,
}
/// Bits that ICR clears: ADDR, NACK, STOP, BERR, ARLO, OVR, PECERR, TIMEOUT, ALERT.
const CLEARED: u32 = 0x3F38;

const CLOCKS_OF_BYTE: u64 = 9;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Idle,
    Addressing,
    Sending(u8),
    Receiving,
    /// The clock is held low until the program gives a byte, ..
    WaitsForByte,
    /// .. takes one, ..
    WaitsForRoom(u8),
    /// .. or says what comes next.
    WaitsForCommand,
    Stopping,
}

#[derive(Default)]
pub(super) struct I2c {
    /// Index in [`I2CS`].
    index: usize,
    /// Kernel clock; 0 if gated.
    pub(super) hz: u64,
    control: [u32; 2],
    timing: u32,
    /// OAR1, OAR2, TIMEOUTR: only stored.
    own: [u32; 2],
    timeout: u32,
    flags: u32,
    transmit: Option<u8>,
    receive: Option<u8>,
    state: State,
    /// End of the present transfer on the wires.
    due: Option<Nanos>,
    reads: bool,
    /// Bytes of this part's NBYTES: put into TXDR; done.
    submitted: u32,
    done: u32,
    /// Another node holds the data line low: nothing can start.
    held: bool,
    /// A start condition was seen, and no stop condition since.
    held_busy: bool,
    /// Bytes to come in which BERR is raised for nothing (ST's errata, "spurious bus error
    /// detection").
    pub(super) disturbed: u32,
    /// Whether both pins lead outside.
    pub(super) connected: bool,
    pub(super) devices: Vec<Box<dyn I2cDevice>>,
    addressed: Option<usize>,
}

impl I2c {
    pub(super) fn new(index: usize) -> Self {
        Self { index, ..Self::default() }
    }

    const fn facts(&self) -> &'static Facts {
        &I2CS[self.index]
    }

    /// Devices outside stay.
    pub(super) fn reset(&mut self, now: Nanos) {
        self.leave(now);
        let old = std::mem::replace(self, Self::new(self.index));
        (self.hz, self.connected, self.devices) = (old.hz, old.connected, old.devices);
        self.held = old.held;
    }

    /// Another node holds the data line low, or lets go of it.
    pub(super) fn hold(&mut self, held: bool, now: Nanos) {
        self.held = held;
        if held && !matches!(self.state, State::Idle | State::Stopping) {
            self.flags |= ARBITRATION_LOST;
            self.leave(now);
        }
        self.held_busy = held && self.control[0] & ENABLE != 0 && self.connected;
        if !held {
            self.try_start(now);
        }
    }

    fn leave(&mut self, now: Nanos) {
        if let Some(device) = self.addressed.take() {
            self.devices[device].stop(now);
        }
        self.state = State::Idle;
        self.due = None;
        self.control[1] &= !(START | STOP);
        (self.transmit, self.receive) = (None, None);
    }

    const fn is(&self, register: usize, bits: u32) -> bool {
        self.control[register - 1] & bits == bits
    }

    /// NBYTES.
    const fn bytes(&self) -> u32 {
        self.control[1] >> 16 & 0xFF
    }

    /// Duration of a number of clocks: SCLL and SCLH in periods of the prescaled kernel clock.
    fn clocks(&self, clocks: u64) -> Nanos {
        let field = |shift: u32, mask: u32| u64::from(self.timing >> shift & mask) + 1;
        time_of(clocks * (field(0, 0xFF) + field(8, 0xFF)) * field(28, 0xF), self.hz)
    }

    fn put(&mut self, state: State, clocks: u64, now: Nanos) {
        let stretch = self.addressed.map_or(Nanos::ZERO, |device| self.devices[device].stretch());
        let ends = self.hz != 0 && stretch.get() != u64::MAX;
        self.state = state;
        self.due = ends.then(|| now + self.clocks(clocks) + stretch);
    }

    /// Begins what START asks for, if the bus is free.
    fn try_start(&mut self, now: Nanos) {
        let may = matches!(self.state, State::Idle | State::WaitsForCommand);
        if self.is(1, ENABLE) && self.is(2, START) && may && !self.held && self.connected {
            self.flags &= !(COMPLETE | COMPLETE_RELOAD);
            self.reads = self.is(2, READ);
            (self.submitted, self.done) = (0, 0);
            self.put(State::Addressing, 1 + CLOCKS_OF_BYTE, now);
        }
    }

    fn stop(&mut self, now: Nanos) {
        self.flags &= !(COMPLETE | COMPLETE_RELOAD);
        self.put(State::Stopping, 1, now);
    }

    fn refuse(&mut self, now: Nanos) {
        self.flags |= REFUSED;
        self.stop(now);
    }

    fn addressed(&mut self, now: Nanos) {
        self.control[1] &= !START;
        let address = self.control[1] >> 1 & 0x7F;
        let reads = self.reads;
        let mut devices = self.devices.iter_mut();
        let device = devices.position(|device| u32::from(device.address()) == address);
        if let Some(before) = self.addressed.take().filter(|&before| Some(before) != device) {
            self.devices[before].stop(now);
        }
        match device {
            Some(device) if self.devices[device].start(reads, now) => {
                self.addressed = Some(device);
                self.go_on(now);
            }
            _ => self.refuse(now),
        }
    }

    /// The next byte, or the end of this part of the transfer.
    fn go_on(&mut self, now: Nanos) {
        if self.is(2, STOP) {
            self.stop(now);
        } else if self.done < self.bytes() {
            if self.reads {
                self.put(State::Receiving, CLOCKS_OF_BYTE, now);
            } else if let Some(byte) = self.transmit.take() {
                self.put(State::Sending(byte), CLOCKS_OF_BYTE, now);
            } else {
                (self.state, self.due) = (State::WaitsForByte, None);
            }
        } else if self.is(2, RELOAD) {
            self.flags |= COMPLETE_RELOAD;
            (self.state, self.due) = (State::WaitsForCommand, None);
        } else if self.is(2, AUTOMATIC_END) {
            self.stop(now);
        } else {
            self.flags |= COMPLETE;
            (self.state, self.due) = (State::WaitsForCommand, None);
            self.try_start(now);
        }
    }

    pub(super) const fn next_event(&self) -> Option<Nanos> {
        self.due
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while let Some(at) = self.due.take_if(|due| *due <= now) {
            match self.state {
                State::Addressing => self.addressed(at),
                State::Sending(byte) => {
                    if self.disturbed > 0 {
                        self.disturbed -= 1;
                        self.flags |= BUS_ERROR;
                    }
                    let device = self.addressed.and_then(|device| self.devices.get_mut(device));
                    if device.is_some_and(|device| device.write(byte, at)) {
                        self.done += 1;
                        self.go_on(at);
                    } else {
                        self.refuse(at);
                    }
                }
                State::Receiving => {
                    let device = self.addressed.and_then(|device| self.devices.get_mut(device));
                    let byte = device.map_or(0xFF, |device| device.read(at));
                    if self.receive.is_some() {
                        self.state = State::WaitsForRoom(byte);
                    } else {
                        self.take(byte, at);
                    }
                }
                State::Stopping => {
                    self.flags |= STOPPED;
                    self.control[1] &= !STOP;
                    self.state = State::Idle;
                    if let Some(device) = self.addressed.take() {
                        self.devices[device].stop(at);
                    }
                    self.try_start(at);
                }
                // The others have no end.
                _ => {}
            }
        }
    }

    fn take(&mut self, byte: u8, now: Nanos) {
        self.receive = Some(byte);
        self.done += 1;
        self.go_on(now);
    }

    /// TXIS.
    fn wants_byte(&self) -> bool {
        let writes = matches!(self.state, State::Sending(_) | State::WaitsForByte);
        writes && self.transmit.is_none() && self.submitted < self.bytes()
    }

    fn status(&self) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        self.flags
            | flag(self.transmit.is_none(), EMPTY)
            | flag(self.wants_byte(), WANTS_BYTE)
            | flag(self.receive.is_some(), RECEIVED)
            | flag(self.state != State::Idle || self.held_busy, BUSY)
    }

    /// Whether clock and data are held low now; while a byte is on the wires, both.
    pub(super) const fn holds_low(&self) -> [bool; 2] {
        match self.state {
            State::Idle => [false; 2],
            State::WaitsForByte | State::WaitsForRoom(_) | State::WaitsForCommand => [true, false],
            State::Addressing | State::Sending(_) | State::Receiving | State::Stopping => [true; 2],
        }
    }

    pub(super) fn interrupts(&self) -> impl Iterator<Item = usize> + use<> {
        let status = self.status();
        let sources = [
            (1, WANTS_BYTE),
            (2, RECEIVED),
            (4, REFUSED),
            (5, STOPPED),
            (6, COMPLETE | COMPLETE_RELOAD),
        ];
        let on = self.is(1, ENABLE);
        let event = sources.iter().any(|&(bit, flags)| self.is(1, 1 << bit) && status & flags != 0);
        let errors = status & (BUS_ERROR | ARBITRATION_LOST | OVERRUN) != 0;
        let asked = [on && event, on && self.is(1, ERROR_INTERRUPT) && errors];
        let numbers = self.facts().interrupts.into_iter().zip(asked);
        numbers.filter(|(_, asked)| *asked).map(|(number, _)| number)
    }

    pub(super) fn requests(&self, request: u32) -> bool {
        let facts = self.facts();
        self.is(1, ENABLE)
            && (facts.reads(request) && self.is(1, RECEIVE_DMA) && self.receive.is_some()
                || facts.writes(request) && self.is(1, TRANSMIT_DMA) && self.wants_byte())
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Answer<u32> {
        self.advance(now);
        Ok(match offset {
            0x00 | 0x04 => self.control[offset as usize / 4],
            0x08 | 0x0C => self.own[(offset as usize - 0x08) / 4],
            0x10 => self.timing,
            0x14 => self.timeout,
            0x18 => self.status(),
            0x1C | 0x20 => 0,
            0x24 => {
                let byte = self.receive.take();
                if let State::WaitsForRoom(next) = self.state {
                    self.take(next, now);
                }
                byte.map_or(0, u32::from)
            }
            0x28 => self.transmit.map_or(0, u32::from),
            _ => return Err(AccessKind::Unmodelled),
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        self.advance(now);
        match write.offset {
            0x00 => {
                let was_on = self.is(1, ENABLE);
                self.control[0] = write.over(self.control[0]);
                if was_on && !self.is(1, ENABLE) {
                    // RM0468, software reset: lines released, flags back to their reset values.
                    self.leave(now);
                    self.flags = 0;
                    self.held_busy = false;
                }
                self.try_start(now);
                AccessKind::Unmodelled.when(self.control[0] & CR1_UNMODELLED != 0)?;
            }
            0x04 => return self.write_control_2(write, now),
            0x08 | 0x0C => {
                let own = &mut self.own[(write.offset as usize - 0x08) / 4];
                *own = write.over(*own);
                // OAxEN.
                AccessKind::Unmodelled.when(*own & 1 << 15 != 0)?;
            }
            0x10 if self.is(1, ENABLE) => return Err(AccessKind::Protected),
            0x10 => self.timing = write.over(self.timing) & 0xF0FF_FFFF,
            0x14 => {
                self.timeout = write.over(self.timeout);
                // TIMOUTEN, TEXTEN.
                AccessKind::Unmodelled.when(self.timeout & (1 << 15 | 1 << 31) != 0)?;
            }
            // TXE: flushes.
            0x18 => {
                if write.ones() & EMPTY != 0 {
                    self.transmit = None;
                }
            }
            0x1C => self.flags &= !(write.ones() & CLEARED),
            0x24 => {}
            0x28 => {
                let byte = u8::try_from(write.ones() & 0xFF).unwrap_or(0);
                if self.wants_byte() {
                    self.submitted += 1;
                }
                self.transmit = Some(byte);
                if self.state == State::WaitsForByte {
                    self.go_on(now);
                }
            }
            _ => return Err(AccessKind::Unmodelled),
        }
        Ok(())
    }

    fn write_control_2(&mut self, write: Write, now: Nanos) -> Answer {
        if !self.is(1, ENABLE) {
            // START and STOP mean nothing then.
            self.control[1] = write.over(self.control[1]) & !(START | STOP);
            return Ok(());
        }
        // Both are set by the program and cleared by what they ask for.
        let standing = self.control[1] & (START | STOP);
        self.control[1] = write.over(self.control[1]) | standing;
        AccessKind::Unmodelled.when(self.is(2, LONG_ADDRESS))?;
        match self.state {
            // Nothing to stop.
            State::Idle => self.control[1] &= !STOP,
            State::WaitsForByte | State::WaitsForCommand if self.is(2, STOP) => self.stop(now),
            State::WaitsForCommand if self.flags & COMPLETE_RELOAD != 0 && self.bytes() != 0 => {
                self.flags &= !COMPLETE_RELOAD;
                (self.submitted, self.done) = (0, 0);
                if !self.is(2, START) {
                    self.go_on(now);
                }
            }
            _ => {}
        }
        self.try_start(now);
        Ok(())
    }
}
