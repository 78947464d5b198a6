//! USARTs and UARTs (RM0468, USART chapter): asynchronous mode, FIFOs, driver enable, DMA requests.
//! The receiver samples levels on a wire: a wrong rate, format or polarity acts as on the chip.
//!
//! Not modelled, and reported when asked for: synchronous, half-duplex, LIN, infrared and smartcard
//! modes, receiver timeout, FIFO thresholds, automatic baud rate, sending breaks, most significant
//! bit first. Error flags belong to the receiver, not to a byte in the FIFO; no idle frame is sent.
//!
//! Two rules that drivers get wrong. With `DMAR` and without `DDRE` a character with an error is
//! not transferred, only flagged (RM0468, CR3). And while `ORE` is set nothing is received, on
//! every STM32 (efton.sk, "STM32 gotchas", 24).

mod receiver;
mod transmitter;
mod wire;

use std::collections::VecDeque;

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Write};
use super::clocks::PRESCALERS;
use super::facts::{Facts, USARTS};
use receiver::{Heard, Receiver};
pub(crate) use transmitter::Outgoing;
use transmitter::{Sending, Transmitter};
pub use wire::{Character, Format, Parity};
pub(crate) use wire::{Sampled, Sampling, Wire};

/// A byte that has left at a transmit pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentByte {
    /// 1 for USART1 ..= 10 for USART10.
    pub uart: u8,
    /// Data bits, 7 to 9 of them, without parity.
    pub value: u16,
    /// Start of its start bit.
    pub start: Nanos,
    /// End of its last stop bit.
    pub end: Nanos,
}

// CR1.
bits! { ENABLE: 0, RECEIVER: 2, TRANSMITTER: 3, PARITY: 10, OVERSAMPLE_8: 15, FIFOS: 29 }
/// RTOIE, EOBIE, MME, CMIE.
const CR1_UNMODELLED: u32 = 1 << 26 | 1 << 27 | 1 << 13 | 1 << 14;
/// M, OVER8, PCE, PS, WAKE, DEDT, DEAT, FIFOEN: written while disabled only.
const CR1_LOCKED: u32 =
    1 << 12 | 1 << 28 | 1 << 15 | 1 << 10 | 1 << 9 | 1 << 11 | 0x3FF << 16 | FIFOS;
const ODD_PARITY: u32 = 1 << 9;
// CR2.
bits! { SWAP: 15, INVERT_RECEIVE: 16, INVERT_TRANSMIT: 17 }
/// DATAINV.
const INVERT_DATA: u32 = 1 << 18;
/// LBDIE, CLKEN, LINEN, MSBFIRST, ABREN, RTOEN.
const CR2_UNMODELLED: u32 = 1 << 6 | 1 << 11 | 1 << 14 | 1 << 19 | 1 << 20 | 1 << 23;
/// STOP, SWAP, RXINV, TXINV, DATAINV, MSBFIRST, and the synchronous mode's bits.
const CR2_LOCKED: u32 = 3 << 12 | 0xF << 8 | 1 << 14 | 0x1F << 15;
// CR3.
bits! { ERROR_INTERRUPT: 0, DMA_RECEIVE: 6, DMA_TRANSMIT: 7, ONE_SAMPLE: 11, OVERRUN_DISABLE: 12 }
/// DDRE.
const DMA_STOPS_AT_ERROR: u32 = 1 << 13;
/// DEM, DEP.
const DRIVER_ENABLE: u32 = 1 << 14;
const DRIVER_LOW: u32 = 1 << 15;
/// IREN, HDSEL, NACK, SCEN, RTSE, CTSE, ONEBIT, OVRDIS, DDRE, DEM, DEP.
const CR3_LOCKED: u32 = 1 << 1 | 1 << 3 | 1 << 4 | 1 << 5 | 1 << 8 | 1 << 9 | 0x1F << 11;
/// IREN, HDSEL, SCEN, RTSE, CTSE, TXFTIE, RXFTIE.
const CR3_UNMODELLED: u32 = 1 << 1 | 1 << 3 | 1 << 5 | 1 << 8 | 1 << 9 | 1 << 23 | 1 << 28;

// ISR.
bits! {
    PARITY_ERROR: 0, FRAMING: 1, NOISE: 2, OVERRUN: 3, IDLE: 4, RECEIVED: 5, COMPLETE: 6, ROOM: 7,
    BUSY: 16, TRANSMIT_ACKNOWLEDGE: 21, RECEIVE_ACKNOWLEDGE: 22, TRANSMIT_EMPTY: 23,
    RECEIVE_FULL: 24,
}
/// Flags that stay until ICR clears them.
const STICKY: u32 = PARITY_ERROR | FRAMING | NOISE | OVERRUN | IDLE | COMPLETE;

const FIFO_DEPTH: usize = 16;
#[derive(Debug, Default)]
pub(super) struct Usart {
    /// Index in [`USARTS`].
    index: usize,
    hz: u64,
    control: [u32; 3],
    divisor: u32,
    prescaler: u32,
    /// GTPR, RTOR: only stored.
    stored: [u32; 2],
    flags: u32,
    pub(super) transmitter: Transmitter,
    pub(super) receiver: Receiver,
    received: VecDeque<u16>,
    /// The character received last, good or not: it stays in RDR until the next one.
    latest: u16,
    /// Whether its receive and its transmit pin lead outside.
    pins: [bool; 2],
    pub(super) sent: Vec<SentByte>,
    /// For the far end of the transmit pin.
    pub(super) outgoing: Vec<Outgoing>,
}

impl Usart {
    pub(super) fn new(index: usize) -> Self {
        Self { index, flags: COMPLETE, ..Self::default() }
    }

    const fn facts(&self) -> &'static Facts {
        &USARTS[self.index]
    }

    /// Everything outside stays: its pins, bytes on their way in, bytes that have left.
    pub(super) fn reset(&mut self, now: Nanos) {
        let fresh = Self::new(self.index);
        let old = std::mem::replace(self, fresh);
        (self.hz, self.pins, self.receiver) = (old.hz, old.pins, old.receiver);
        (self.sent, self.outgoing) = (old.sent, old.outgoing);
        self.transmitter.tells = old.transmitter.tells;
        self.receiver.reset(now);
    }

    pub(super) fn set_clock(&mut self, hz: u64, now: Nanos) {
        if self.hz != hz {
            self.hz = hz;
            self.listen(now);
        }
    }

    pub(super) fn set_pins(&mut self, pins: [bool; 2], now: Nanos) {
        if self.pins != pins {
            self.pins = pins;
            self.listen(now);
        }
    }

    pub(super) const fn listens(&self) -> bool {
        self.is(1, ENABLE | RECEIVER)
    }

    const fn is(&self, register: usize, bits: u32) -> bool {
        self.control[register - 1] & bits == bits
    }

    fn capacity(&self) -> usize {
        if self.is(1, FIFOS) { FIFO_DEPTH } else { 1 }
    }

    /// Length of a bit, femtoseconds; `None` if the baud rate is not set.
    fn bit_fs(&self) -> Option<u64> {
        let prescaler = PRESCALERS.get(self.prescaler as usize)?;
        let divisor = u64::from(self.divisor);
        let (divider, twice) = if self.is(1, OVERSAMPLE_8) {
            (divisor & 0xFFF0 | (divisor & 7) << 1, 1)
        } else {
            (divisor, 2)
        };
        if divider < 16 || self.hz == 0 {
            return None;
        }
        // Kernel clocks of two bits.
        let femtos = u128::from(divider * prescaler * twice) * 1_000_000_000_000_000;
        u64::try_from(femtos / u128::from(2 * self.hz)).ok()
    }

    /// Bits between start and stop, parity included (M0 and M1).
    const fn word(&self) -> u32 {
        match (self.control[0] >> 28 & 1, self.control[0] >> 12 & 1) {
            (0, 0) => 8,
            (0, _) => 9,
            _ => 7,
        }
    }

    fn format(&self) -> Format {
        let parity = if self.is(1, ODD_PARITY) { Parity::Odd } else { Parity::Even };
        let parity = self.is(1, PARITY).then_some(parity);
        // STOP: 1, 0.5, 2, 1.5 bits.
        let half_stops = [2, 1, 4, 3][(self.control[1] >> 12 & 3) as usize];
        Format { data_bits: self.word() - u32::from(parity.is_some()), parity, half_stops }
    }

    /// Settings of its transmitter; `None` if it does not send.
    fn sending(&self) -> Option<Sending> {
        if !self.is(1, ENABLE | TRANSMITTER) {
            return None;
        }
        // DEAT, DEDT, in samples.
        let samples = if self.is(1, OVERSAMPLE_8) { 8 } else { 16 };
        let time = |shift: u32| 16 * u64::from(self.control[0] >> shift & 0x1F) / samples;
        Some(Sending {
            format: self.format(),
            bit_fs: self.bit_fs()?,
            inverted: self.is(2, INVERT_TRANSMIT),
            driver: self.is(3, DRIVER_ENABLE).then(|| (time(21), time(16))),
        })
    }

    fn send_next(&mut self, now: Nanos) {
        if !self.transmitter.waiting.is_empty()
            && let Some(how) = self.sending()
        {
            self.transmitter.start(now, &how);
        }
    }

    /// The same of those that it uses.
    const fn pins_in_use(&self) -> [bool; 2] {
        let [receive, transmit] = self.pins;
        if self.is(2, SWAP) { [transmit, receive] } else { self.pins }
    }

    fn listen(&mut self, now: Nanos) {
        let on = self.listens() && self.pins_in_use()[0];
        let sampling = self.bit_fs().filter(|_| on).map(|bit_fs| Sampling {
            format: self.format(),
            bit_fs,
            inverted: self.is(2, INVERT_RECEIVE),
            by_8: self.is(1, OVERSAMPLE_8),
            one_sample: self.is(3, ONE_SAMPLE),
        });
        self.receiver.listen(sampling, now);
    }

    /// The level at the driver enable pin; `None` if there is no such pin.
    pub(super) fn driver_level(&self) -> Option<bool> {
        let active = self.is(1, ENABLE) && self.transmitter.driver;
        self.is(3, DRIVER_ENABLE).then(|| active != self.is(3, DRIVER_LOW))
    }

    fn heard(&mut self, heard: Heard, at: Nanos) {
        let Heard::Character { sampled, late } = heard else {
            self.flags |= IDLE;
            return;
        };
        if self.flags & OVERRUN != 0 {
            return;
        }
        if late || self.received.len() >= self.capacity() {
            if self.is(3, OVERRUN_DISABLE) {
                self.received.pop_back();
            } else {
                self.flags |= OVERRUN;
                return;
            }
        }
        let noise = sampled.noise && !self.is(3, ONE_SAMPLE);
        let found = [(sampled.framing, FRAMING), (sampled.parity, PARITY_ERROR), (noise, NOISE)];
        let errors: u32 = found.iter().filter(|(is, _)| *is).map(|(_, flag)| flag).sum();
        self.flags |= errors;
        let inversion = if self.is(2, INVERT_DATA) { (1 << self.word()) - 1 } else { 0 };
        self.latest = sampled.word ^ inversion;
        if errors != 0 && self.is(3, DMA_RECEIVE) && !self.is(3, DMA_STOPS_AT_ERROR) {
            return;
        }
        self.received.push_back(self.latest);
        self.receiver.arm(at);
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        let both = [self.transmitter.next_event(), self.receiver.next_event()];
        both.into_iter().flatten().min()
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while let Some(at) = self.next_event().filter(|&at| at <= now) {
            if self.transmitter.next_event() == Some(at) {
                let how = self.sending();
                if let Some(outgoing) = self.transmitter.happens(at, how.as_ref()) {
                    self.sent(outgoing);
                }
            } else if let Some(heard) = self.receiver.happens(at) {
                self.heard(heard, at);
            }
        }
    }

    fn sent(&mut self, outgoing: Outgoing) {
        if outgoing.has_ended && self.transmitter.sending.is_none() {
            self.flags |= COMPLETE;
        }
        if !self.pins_in_use()[1] {
            return;
        }
        let Outgoing { character, end, has_ended } = outgoing;
        if has_ended {
            let (uart, value, start) = (self.facts().number, character.value, character.start);
            self.sent.push(SentByte { uart, value, start, end });
        }
        if self.transmitter.tells {
            self.outgoing.push(outgoing);
        }
    }

    fn status(&self, now: Nanos) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let on = self.is(1, ENABLE);
        self.flags
            | flag(!self.received.is_empty(), RECEIVED)
            | flag(self.transmitter.waiting.len() < self.capacity(), ROOM)
            | flag(self.receiver.is_busy(now), BUSY)
            | flag(on && self.is(1, TRANSMITTER), TRANSMIT_ACKNOWLEDGE)
            | flag(on && self.is(1, RECEIVER), RECEIVE_ACKNOWLEDGE)
            | flag(self.is(1, FIFOS) && self.transmitter.waiting.is_empty(), TRANSMIT_EMPTY)
            | flag(self.is(1, FIFOS) && self.received.len() == FIFO_DEPTH, RECEIVE_FULL)
    }

    pub(super) fn interrupt(&self) -> Option<usize> {
        if !self.is(1, ENABLE) {
            return None;
        }
        let status = self.status(Nanos::ZERO);
        // IDLEIE, RXNEIE, TCIE, TXEIE, PEIE, TXFEIE, RXFFIE with their flags.
        let sources = [
            (4, IDLE),
            (5, RECEIVED | OVERRUN),
            (6, COMPLETE),
            (7, ROOM),
            (8, 1),
            (30, TRANSMIT_EMPTY),
            (31, RECEIVE_FULL),
        ];
        let asked = sources.iter().any(|&(bit, flags)| self.is(1, 1 << bit) && status & flags != 0);
        let errors = self.is(3, ERROR_INTERRUPT) && status & (FRAMING | NOISE | OVERRUN) != 0;
        (asked || errors).then_some(self.facts().interrupts[0])
    }

    pub(super) fn requests(&self, request: u32) -> bool {
        let (facts, waiting) = (self.facts(), self.transmitter.waiting.len());
        self.is(1, ENABLE)
            && (facts.reads(request) && self.is(3, DMA_RECEIVE) && self.offers_to_dma()
                || facts.writes(request) && self.is(3, DMA_TRANSMIT) && waiting < self.capacity())
    }

    fn offers_to_dma(&self) -> bool {
        let errors = self.flags & (PARITY_ERROR | FRAMING | NOISE) != 0;
        let stopped = errors && self.is(3, DMA_STOPS_AT_ERROR);
        !self.received.is_empty() && !stopped
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Answer<u32> {
        self.advance(now);
        Ok(match offset {
            0x00 | 0x04 | 0x08 => self.control[offset as usize / 4],
            0x0C => self.divisor,
            0x10 | 0x14 => self.stored[(offset as usize - 0x10) / 4],
            0x1C => self.status(now),
            // RM0468, framing error and its like: the invalid data is in RDR too.
            0x24 => self.received.pop_front().unwrap_or(self.latest).into(),
            0x18 | 0x20 | 0x28 => 0,
            0x2C => self.prescaler,
            _ => return Err(AccessKind::Unmodelled),
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        self.advance(now);
        match write.offset {
            0x00 | 0x04 | 0x08 => {
                let index = write.offset as usize / 4;
                let (was_on, old) = (self.is(1, ENABLE), self.control[index]);
                let wanted = write.over(old);
                let locked = [CR1_LOCKED, CR2_LOCKED, CR3_LOCKED][index];
                let locked = if was_on { locked & (old ^ wanted) } else { 0 };
                self.control[index] = wanted & !locked | old & locked;
                if was_on && !self.is(1, ENABLE) {
                    // RM0468, UE: current operations are discarded, flags are reset.
                    self.transmitter.stop();
                    self.received.clear();
                    self.flags = COMPLETE;
                }
                self.listen(now);
                self.send_next(now);
                let unmodelled = [CR1_UNMODELLED, CR2_UNMODELLED, CR3_UNMODELLED][index];
                AccessKind::Unmodelled.when(self.control[index] & unmodelled != 0)?;
                // Who switches it off writes them with the same write, and means nothing by it.
                AccessKind::Protected.when(locked != 0 && self.is(1, ENABLE))?;
            }
            // BRR, PRESC: locked while enabled.
            0x0C | 0x2C if self.is(1, ENABLE) => return Err(AccessKind::Protected),
            0x0C => self.divisor = write.over(self.divisor) & 0xFFFF,
            0x2C => self.prescaler = write.over(self.prescaler) & 0xF,
            0x10 | 0x14 => {
                let stored = &mut self.stored[(write.offset as usize - 0x10) / 4];
                *stored = write.over(*stored);
            }
            0x18 => {
                if write.ones() & 1 << 3 != 0 {
                    self.received.clear();
                }
                if write.ones() & 1 << 4 != 0 {
                    self.transmitter.waiting.clear();
                }
                AccessKind::Unmodelled.when(write.ones() & 0b111 != 0)?;
            }
            0x20 => self.flags &= !(write.ones() & STICKY),
            0x28 => {
                self.flags &= !COMPLETE;
                if self.transmitter.waiting.len() == self.capacity() {
                    // The register is overwritten; a full FIFO takes nothing.
                    AccessKind::Protected.when(self.is(1, FIFOS))?;
                    self.transmitter.waiting.clear();
                }
                // Nine bits at most.
                let value = if self.is(2, INVERT_DATA) { !write.ones() } else { write.ones() };
                self.transmitter.waiting.push_back(u16::try_from(value & 0x1FF).unwrap_or(0));
                self.send_next(now);
            }
            // ISR and RDR cannot be written.
            0x1C | 0x24 => {}
            _ => return Err(AccessKind::Unmodelled),
        }
        Ok(())
    }
}
