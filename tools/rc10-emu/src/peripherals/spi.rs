//! SPI1 to SPI5 as masters with devices on their buses (RM0468, SPI chapter), in frames.
//!
//! An SPI that is disabled at the end of a transfer without a size (TSIZE = 0) has clocked on: a
//! device that is still selected is late by [`SPURIOUS`] bits from then on. Seen on an STM32H7 by a
//! logic analyser, and by no loopback test: Zephyr issue 66326, PR 66503 (there with frames queued;
//! how many clocks is not said: this is the stricter reading).
//!
//! Modelled: full duplex, transmitter and receiver modes, transfers with and without a size, FIFOs
//! with packing, overrun, suspension, clock modes and bit order, DMA requests.
//! Not modelled, and reported when asked for: slaves, half duplex, CRC, I2S, the hardware's slave
//! select, TI mode. A mode fault never happens; slave select and delays take no time.

use std::collections::VecDeque;

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Width, Write};
use super::facts::{Facts, SPIS};
use crate::time::time_of;

/// A device on an SPI bus.
pub trait SpiDevice: Send {
    /// Whether it understands this clock mode (0 to 3: CPOL, CPHA) and clock; if not, the chip
    /// reads noise.
    fn understands(&self, _mode: u8, _clock_hz: u64) -> bool {
        true
    }

    /// The select pin went low: a transaction begins.
    fn select(&mut self, now: Nanos);

    /// The select pin went high: the transaction ends.
    fn deselect(&mut self, _now: Nanos) {}

    /// A frame has been exchanged, most significant bit first: what the chip sent, and the device's
    /// output, which cannot depend on it.
    fn exchange(&mut self, sent: u16, now: Nanos) -> u16;
}

pub(super) struct Attached {
    select: (usize, usize),
    selected: bool,
    /// Bits that it got between the chip's frames since it is selected, and what it has of its next frame.
    late: u32,
    begun: u16,
    device: Box<dyn SpiDevice>,
}

impl Attached {
    /// Exchanges a frame of some bits with a device that may be late: its bits stand over from
    /// frame to frame. The last ones of an answer would be the next one's first: zeros here.
    fn exchange(&mut self, sent: u16, bits: u32, now: Nanos) -> u16 {
        let (stream, late) = (u32::from(self.begun) << bits | u32::from(sent), self.late % bits);
        let own = stream >> late;
        let mask = u32::from(u16::MAX >> (16 - bits));
        self.begun = sent & !(u16::MAX << late);
        let answer = self.device.exchange(u16::try_from(own & mask).unwrap_or(0), now);
        answer << late
    }
}

/// Clocks behind the last frame of a transfer without a size: "several".
const SPURIOUS: u32 = 3;

// CR1.
bits! { ENABLE: 0, SUSPEND_AT_OVERRUN: 8, START: 9, SUSPEND: 10 }
/// `CRC33_17`, RCRCINI, TCRCINI.
const CR1_UNMODELLED: u32 = 0b111 << 13;
// CFG1.
bits! { RECEIVE_DMA: 14, TRANSMIT_DMA: 15, CRC: 22 }
// CFG2.
const MASTER: u32 = 1 << 22;
const LEAST_FIRST: u32 = 1 << 23;
/// SP: not Motorola's protocol; IOSWP.
const CFG2_UNMODELLED: u32 = 0b111 << 19 | 1 << 15;

// SR.
bits! {
    RECEIVED: 0, ROOM: 1, DUPLEX: 2, END: 3, FILLED: 4, OVERRUN: 6, SUSPENDED: 11, COMPLETE: 12,
    WORD: 15,
}
/// Bits that IFCR clears: EOT, TXTF, UDR, OVR, CRCE, TIFRE, MODF, TSERF, SUSP.
const CLEARED: u32 = 0x0FF8;

// CFG2.COMM; 0 is full duplex.
words! { TRANSMITS: 1, RECEIVES: 2, HALF_DUPLEX: 3 }

#[derive(Default)]
pub(super) struct Spi {
    /// SPI1 is 0.
    index: usize,
    /// Kernel clock; 0 if gated.
    pub(super) hz: u64,
    control: u32,
    /// TSIZE.
    size: u32,
    config: [u32; 2],
    interrupts: u32,
    /// CRCPOLY, TXCRC, RXCRC, UDRDR, I2SCFGR: only stored.
    stored: [u32; 5],
    flags: u32,
    to_send: VecDeque<u16>,
    received: VecDeque<u16>,
    /// The frame on the wires, and its end.
    frame: Option<(u16, Nanos)>,
    /// Frames of a transfer with a size that were put into the FIFO, and that are done.
    submitted: u32,
    done: u32,
    /// Whether its clock, input and output lead outside.
    pub(super) pins: [bool; 3],
    pub(super) devices: Vec<Attached>,
}

impl Spi {
    pub(super) fn new(index: usize) -> Self {
        let (config, stored) = ([0x0007_0007, 0], [0x107, 0, 0, 0, 0]);
        Self { index, config, stored, ..Self::default() }
    }

    const fn facts(&self) -> &'static Facts {
        &SPIS[self.index]
    }

    /// Devices outside stay.
    pub(super) fn reset(&mut self) {
        let old = std::mem::replace(self, Self::new(self.index));
        (self.hz, self.pins, self.devices) = (old.hz, old.pins, old.devices);
    }

    pub(super) fn attach(&mut self, select: (usize, usize), device: Box<dyn SpiDevice>) {
        self.devices.push(Attached { select, selected: false, late: 0, begun: 0, device });
    }

    /// Tells the devices their select pins: `is_low` of each.
    pub(super) fn look(&mut self, is_low: impl Fn((usize, usize)) -> bool, now: Nanos) {
        for attached in &mut self.devices {
            let selected = is_low(attached.select);
            if std::mem::replace(&mut attached.selected, selected) != selected {
                (attached.late, attached.begun) = (0, 0);
                if selected {
                    attached.device.select(now);
                } else {
                    attached.device.deselect(now);
                }
            }
        }
    }

    const fn is(&self, bits: u32) -> bool {
        self.control & bits == bits
    }

    const fn frame_bits(&self) -> u32 {
        (self.config[0] & 0x1F) + 1
    }

    /// Bytes that a frame takes in a FIFO.
    const fn frame_bytes(&self) -> usize {
        if self.frame_bits() <= 8 { 1 } else { 2 }
    }

    const fn capacity(&self) -> usize {
        // RM0468, SPI implementation: 16 bytes in SPI1 to 3, 8 in the others.
        (16 >> self.facts().clock) / self.frame_bytes()
    }

    /// FTHLV: frames of a packet.
    const fn packet(&self) -> usize {
        (self.config[0] >> 5 & 0xF) as usize + 1
    }

    const fn communication(&self) -> u32 {
        self.config[1] >> 17 & 3
    }

    /// MBR.
    const fn clock_hz(&self) -> u64 {
        self.hz >> ((self.config[0] >> 28 & 7) + 1)
    }

    fn go_on(&mut self, now: Nanos) {
        if self.frame.is_some() || !self.is(ENABLE | START) || self.clock_hz() == 0 {
            return;
        }
        if self.is(SUSPEND) {
            self.control &= !(START | SUSPEND);
            self.flags |= SUSPENDED;
            return;
        }
        let full = self.received.len() >= self.capacity();
        if self.size != 0 && self.done >= self.size || full && self.is(SUSPEND_AT_OVERRUN) {
            return;
        }
        let receives = self.communication() == RECEIVES;
        let value = if receives { Some(0) } else { self.to_send.pop_front() };
        let end = now + time_of(self.frame_bits(), self.clock_hz());
        self.frame = value.map(|value| (value, end));
    }

    fn exchange(&mut self, value: u16, at: Nanos) -> u16 {
        // CPOL, CPHA.
        let mode = u8::try_from(self.config[1] >> 24 & 3).unwrap_or(0);
        let clock_hz = self.clock_hz();
        let unused = 16 - self.frame_bits().min(16);
        let mask = u16::MAX >> unused;
        let turned = |value: u16| {
            if self.config[1] & LEAST_FIRST != 0 { value.reverse_bits() >> unused } else { value }
        };
        let [clock, input, output] = self.pins;
        if !clock {
            return 0;
        }
        let sent = if output { turned(value & mask) } else { 0 };
        let selected = self.devices.iter_mut().filter(|attached| attached.selected);
        let answers = selected.map(|attached| {
            if attached.device.understands(mode, clock_hz) {
                attached.exchange(sent, 16 - unused, at)
            } else {
                // It takes the bits at the wrong edges.
                0xA5A5
            }
        });
        // A device that drives low wins. No device drives the line: it reads low. Our choice.
        let answer = answers.reduce(|one, other| one & other).unwrap_or(0) & mask;
        if input { turned(answer) } else { 0 }
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        self.frame.map(|(_, end)| end)
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while let Some((value, end)) = self.frame.take_if(|(_, end)| *end <= now) {
            let answer = self.exchange(value, end);
            self.done += 1;
            if self.communication() != TRANSMITS {
                if self.received.len() < self.capacity() {
                    self.received.push_back(answer);
                } else {
                    self.flags |= OVERRUN;
                }
            }
            if self.size != 0 && self.done == self.size {
                self.flags |= END;
                self.control &= !START;
            }
            self.go_on(end);
        }
    }

    fn has_room(&self) -> bool {
        let all_submitted = self.size != 0 && self.submitted >= self.size;
        self.to_send.len() + self.packet() <= self.capacity()
            && !all_submitted
            && self.communication() != RECEIVES
    }

    fn has_packet(&self) -> bool {
        // The last packet of a transfer may be shorter.
        let ended = self.size != 0 && self.done >= self.size;
        let last = ended && !self.received.is_empty();
        self.received.len() >= self.packet() || last
    }

    fn status(&self) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let idle = self.to_send.is_empty() && self.frame.is_none();
        let complete = if self.size == 0 { idle } else { idle && self.done >= self.size };
        let bytes = self.received.len() * self.frame_bytes();
        let level = u32::try_from(self.received.len() % (4 / self.frame_bytes())).unwrap_or(0);
        let remaining = self.size.saturating_sub(self.done);
        self.flags
            | flag(self.has_packet(), RECEIVED)
            | flag(self.has_room(), ROOM)
            | flag(self.has_packet() && self.has_room(), DUPLEX)
            | flag(complete || !self.is(ENABLE), COMPLETE)
            | level << 13
            | flag(bytes >= 4, WORD)
            | remaining << 16
    }

    pub(super) fn interrupt(&self) -> Option<usize> {
        // IER's bits stand where the flags do, but EOTIE is for EOT, SUSP and TXC.
        let status = self.status();
        let enabled = self.interrupts & 0x7F7;
        let ends = self.interrupts & END != 0 && status & (END | SUSPENDED | COMPLETE) != 0;
        (self.is(ENABLE) && (status & enabled != 0 || ends)).then_some(self.facts().interrupts[0])
    }

    pub(super) fn requests(&self, request: u32) -> bool {
        let (facts, config) = (self.facts(), self.config[0]);
        self.is(ENABLE)
            && (facts.reads(request) && config & RECEIVE_DMA != 0 && self.has_packet()
                || facts.writes(request) && config & TRANSMIT_DMA != 0 && self.has_room())
    }

    pub(super) fn read(&mut self, offset: u32, width: Width, now: Nanos) -> Answer<u32> {
        self.advance(now);
        Ok(match offset {
            0x00 => self.control,
            0x04 => self.size,
            0x08 | 0x0C => self.config[(offset as usize - 0x08) / 4],
            0x10 => self.interrupts,
            0x14 => self.status(),
            0x18 | 0x20 => 0,
            0x30 => {
                // As many frames as fit into the access.
                let count = (width.bytes() as usize / self.frame_bytes()).max(1);
                let bits = 8 * self.frame_bytes();
                let count = count.min(self.received.len());
                let frames = self.received.drain(..count).enumerate();
                let value = frames.map(|(index, frame)| u32::from(frame) << (bits * index)).sum();
                self.go_on(now);
                value
            }
            0x40..=0x50 => self.stored[(offset as usize - 0x40) / 4],
            _ => return Err(AccessKind::Unmodelled),
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        self.advance(now);
        let enabled = self.is(ENABLE);
        match write.offset {
            0x00 => return self.write_control(write, now),
            0x04 => self.size = write.over(self.size) & 0xFFFF,
            0x08 | 0x0C => {
                let index = (write.offset as usize - 0x08) / 4;
                let (old, wanted) = (self.config[index], write.over(self.config[index]));
                let unlocked = [RECEIVE_DMA | TRANSMIT_DMA, 0][index];
                let locked = if enabled { !unlocked } else { 0 };
                self.config[index] = wanted & !locked | old & locked;
                AccessKind::Protected.when((old ^ wanted) & locked != 0)?;
            }
            0x10 => self.interrupts = write.over(self.interrupts) & 0x7FF,
            // SR, RXDR cannot be written.
            0x14 | 0x30 => {}
            0x18 => self.flags &= !(write.ones() & CLEARED),
            0x20 if !enabled => return Err(AccessKind::Protected),
            0x20 => {
                let bits = 8 * self.frame_bytes();
                let count = (write.width().bytes() as usize / self.frame_bytes()).max(1);
                for index in 0..count {
                    if self.to_send.len() >= self.capacity() {
                        // A full FIFO takes nothing.
                        return Err(AccessKind::Protected);
                    }
                    let mask = u32::MAX >> (32 - bits);
                    let frame = write.ones() >> (bits * index) & mask;
                    self.to_send.push_back(u16::try_from(frame).unwrap_or(0));
                    self.submitted += 1;
                }
                if self.size != 0 && self.submitted >= self.size {
                    self.flags |= FILLED;
                }
                self.go_on(now);
            }
            0x40..=0x50 => {
                let stored = &mut self.stored[(write.offset as usize - 0x40) / 4];
                *stored = write.over(*stored);
                // I2SMOD.
                AccessKind::Unmodelled.when(write.offset == 0x50 && *stored & 1 != 0)?;
            }
            _ => return Err(AccessKind::Unmodelled),
        }
        Ok(())
    }

    fn write_control(&mut self, write: Write, now: Nanos) -> Answer {
        let was_enabled = self.is(ENABLE);
        let wanted = write.over(self.control);
        // CSTART is set by the program, and cleared by the end of a transfer.
        let started = if was_enabled { self.control & START } else { 0 };
        self.control = wanted | started;
        if !self.is(ENABLE) {
            if self.size == 0 && self.done > 0 {
                let selected = self.devices.iter_mut().filter(|attached| attached.selected);
                selected.for_each(|attached| attached.late += SPURIOUS);
            }
            self.control &= !(START | SUSPEND);
            self.to_send.clear();
            self.received.clear();
            self.frame = None;
            (self.submitted, self.done) = (0, 0);
            return Ok(());
        }
        if !was_enabled {
            // RM0468, SPI_SR: OVR is cleared when the SPI is enabled again, EOT and TXTF are not.
            self.flags &= !OVERRUN;
        }
        let new_transfer = self.control & START != 0 && started == 0;
        if new_transfer && self.done > 0 {
            self.submitted -= self.submitted.min(self.done);
            self.done = 0;
        }
        let unmodelled = self.config[1] & MASTER == 0
            || self.config[1] & CFG2_UNMODELLED != 0
            || self.config[0] & CRC != 0
            || self.communication() == HALF_DUPLEX
            || self.frame_bits() > 16
            || self.control & CR1_UNMODELLED != 0;
        AccessKind::Unmodelled.when(unmodelled)?;
        self.go_on(now);
        Ok(())
    }
}
