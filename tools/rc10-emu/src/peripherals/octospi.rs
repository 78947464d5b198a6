//! OCTOSPI1 at port 1 of the I/O manager, with a memory (RM0468, OCTOSPI chapter).
//!
//! Modelled: indirect writes and reads, polling of a status, one to four data lines, a FIFO of 32 bytes. A read of the
//! data register that comes before its bytes are there waits on the bus; here it takes no time. Not modelled, and
//! reported when asked for: memory-mapped reads and writes, double rates, DMA, `HyperBus`, OCTOSPI2.

use std::collections::VecDeque;

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Width, Write};
use super::registers::{Register, Registers, field, masked, plain};
use crate::time::time_of;

/// The beginning of a command on the wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub instruction: u8,
    /// The address and its length in bits.
    pub address: Option<(u32, u32)>,
    /// Clocks between address and data: of alternate bytes and dummy ones.
    pub wait: u32,
    /// Lines of instruction, address and data; 0: that part is not sent.
    pub lines: [u32; 3],
    pub clock_hz: u64,
}

/// A memory at the wires.
pub(crate) trait SerialMemory: Send {
    /// A command begins.
    fn begin(&mut self, header: Header, now: Nanos);
    /// The next byte that it sends.
    fn read(&mut self, now: Nanos) -> u8;
    /// The next byte that it gets.
    fn write(&mut self, byte: u8);
    /// The select line goes high.
    fn end(&mut self, now: Nanos);
}

words! {
    CR: 0x00, DCR1: 0x08, DCR2: 0x0C, SR: 0x20, FCR: 0x24, DLR: 0x40, AR: 0x48, DR: 0x50,
    PSMKR: 0x80, PSMAR: 0x88, PIR: 0x90, CCR: 0x100, TCR: 0x108, IR: 0x110,
}

const TABLE: &[Register] = &[
    masked(CR, 0, 0x30DF_1FCF),
    masked(DCR1, 0, 0x071F_3F0B),
    masked(DCR2, 0, 0x0007_00FF),
    masked(0x10, 0, 0x001F_00FF),
    plain(0x14, 0),
    plain(DLR, 0),
    plain(AR, 0),
    plain(PSMKR, 0),
    plain(PSMAR, 0),
    masked(PIR, 0, 0xFFFF),
    masked(CCR, 0, 0xAF3F_3F3F),
    masked(TCR, 0, 0x5000_001F),
    plain(IR, 0),
    plain(0x120, 0),
    masked(0x130, 0, 0xFFFF),
];

// CR.
bits! { EN: 0, ABORT: 1, DMAEN: 2, APMS: 22, OR: 23 }
// SR; the same bits of CR from 16 on enable their interrupts.
bits! { TEF: 0, TCF: 1, FTF: 2, SMF: 3, BUSY: 5 }

// CR.FMODE.
words! { WRITES: 0, READS: 1, POLLS: 2 }

const FIFO: u32 = 32;

struct Running {
    mode: u32,
    /// Bytes that have still to go over the wires.
    left: u64,
    /// The time at which the next one has; `None`: it waits for the FIFO.
    next: Option<Nanos>,
    byte: Nanos,
}

#[derive(Default)]
pub(super) struct OctoSpi {
    registers: Registers,
    flags: u32,
    fifo: VecDeque<u8>,
    running: Option<Running>,
    memory: Option<Box<dyn SerialMemory>>,
    /// Kernel clock; 0 if gated.
    pub(super) hz: u64,
    /// Whether all its pins lead to the memory.
    pub(super) connected: bool,
}

impl OctoSpi {
    pub(super) fn new() -> Self {
        Self { registers: Registers::new(TABLE), ..Self::default() }
    }

    pub(super) fn attach(&mut self, memory: Box<dyn SerialMemory>) {
        self.memory = Some(memory);
    }

    pub(super) fn reset(&mut self, now: Nanos) {
        self.stop(now);
        self.registers.reset();
        (self.flags, self.running) = (0, None);
        self.fifo.clear();
    }

    fn level(&self) -> u32 {
        u32::try_from(self.fifo.len()).unwrap_or(FIFO)
    }

    fn mode(&self) -> u32 {
        self.registers.field(CR, 28, 2)
    }

    /// The header of CCR, TCR, IR and AR.
    fn header(&self) -> Header {
        let lines = |low| match self.registers.field(CCR, low, 3) {
            0 => 0,
            mode => 1 << (mode - 1),
        };
        let [instruction, address, alternate, data] = [0, 8, 16, 24].map(lines);
        let bits = |low| 8 + 8 * self.registers.field(CCR, low, 2);
        let alternate = bits(20).checked_div(alternate).unwrap_or(0);
        Header {
            instruction: self.registers.value(IR).to_le_bytes()[0],
            address: (address != 0).then(|| (self.registers.value(AR), bits(12))),
            wait: alternate + self.registers.field(TCR, 0, 5),
            lines: [instruction, address, data],
            clock_hz: self.hz / u64::from(self.registers.field(DCR2, 0, 8) + 1),
        }
    }

    fn begin(&mut self, now: Nanos) {
        let header = self.header();
        let cycles = |bits: u32, lines| if lines == 0 { 0 } else { bits.div_ceil(lines) };
        let [instruction, address, data] = header.lines;
        let before = cycles(8, instruction)
            + cycles(header.address.map_or(0, |(_, bits)| bits), address)
            + header.wait;
        let mode = self.mode();
        let left = if data == 0 { 0 } else { u64::from(self.registers.value(DLR)) + 1 };
        // Without a clock nothing moves.
        let time = |cycles: u32| time_of(u64::from(cycles), header.clock_hz.max(1));
        let byte = time(cycles(8, data));
        if let Some(memory) = self.memory.as_mut().filter(|_| self.connected) {
            memory.begin(header, now);
        }
        self.fifo.clear();
        let next = Some(now + time(before) + byte);
        self.running = Some(Running { mode, left, next, byte });
    }

    /// Ends what runs; the memory does what it was told.
    fn stop(&mut self, now: Nanos) {
        if self.running.take().is_some()
            && let Some(memory) = self.memory.as_mut().filter(|_| self.connected)
        {
            memory.end(now);
        }
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        self.running.as_ref()?.next
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while let Some(at) = self.next_event().filter(|at| *at <= now) {
            self.pass_byte(at);
        }
    }

    /// A byte has gone over the wires, or the command's end has come.
    fn pass_byte(&mut self, at: Nanos) {
        let is_full = self.level() == FIFO;
        let Some(running) = &mut self.running else { return };
        let memory = self.memory.as_mut().filter(|_| self.connected);
        if running.left > 0 {
            if running.mode == WRITES {
                let Some(byte) = self.fifo.pop_front() else {
                    running.next = None;
                    return;
                };
                memory.into_iter().for_each(|memory| memory.write(byte));
            } else {
                if is_full {
                    running.next = None;
                    return;
                }
                // Open lines are pulled up.
                self.fifo.push_back(memory.map_or(0xFF, |memory| memory.read(at)));
            }
            running.left -= 1;
            if running.left > 0 {
                running.next = Some(at + running.byte);
                return;
            }
        }
        if running.mode == POLLS {
            return self.poll(at);
        }
        self.stop(at);
        self.flags |= TCF;
    }

    /// A status has been read: it is what was asked for, or is read again.
    fn poll(&mut self, at: Nanos) {
        let mut bytes = [0; 4];
        for (byte, read) in bytes.iter_mut().zip(self.fifo.drain(..)) {
            *byte = read;
        }
        let [mask, wanted] = [PSMKR, PSMAR].map(|register| self.registers.value(register));
        let differs = (u32::from_le_bytes(bytes) ^ wanted) & mask;
        let matches = if self.registers.has(CR, OR) { differs != mask } else { differs == 0 };
        self.stop(at);
        if matches {
            self.flags |= SMF;
            if self.registers.has(CR, APMS) {
                return;
            }
        }
        let pause = self.registers.value(PIR).max(1);
        self.begin(at + time_of(pause, self.header().clock_hz.max(1)));
    }

    /// Lets a command begin that has all that it needs.
    fn start_by(&mut self, register: u32, now: Nanos) -> Answer {
        let header = self.header();
        let has_address = header.address.is_some();
        let waits_for_data = self.mode() == WRITES && header.lines[2] != 0;
        let begins = match register {
            IR => !has_address && !waits_for_data,
            AR => has_address && !waits_for_data,
            _ => waits_for_data && self.running.is_none(),
        };
        if !begins || !self.registers.has(CR, EN) {
            return Ok(());
        }
        AccessKind::Unmodelled.when(self.mode() > POLLS || self.registers.has(CR, DMAEN))?;
        // Double rates, and more lines than four.
        let ccr = self.registers.value(CCR);
        let is_wide = header.lines.iter().any(|lines| *lines > 4);
        AccessKind::Unmodelled
            .when(ccr & (1 << 3 | 1 << 11 | 1 << 19 | 1 << 27) != 0 || is_wide)?;
        let size = 2_u64 << self.registers.field(DCR1, 16, 5);
        let end = header.address.map_or(0, |(address, _)| u64::from(address));
        if header.lines[2] != 0 && end + u64::from(self.registers.value(DLR)) >= size && has_address
        {
            self.flags |= TEF;
            return Ok(());
        }
        self.begin(now);
        Ok(())
    }

    pub(super) fn read(&mut self, offset: u32, width: Width, now: Nanos) -> Answer<u32> {
        self.advance(now);
        Ok(match offset {
            SR => {
                let level = self.level();
                let threshold = self.registers.field(CR, 8, 5) + 1;
                let room = FIFO - level;
                let filled = if self.mode() == WRITES { room } else { level } >= threshold;
                let rest = self.mode() == READS && self.running.is_none() && level > 0;
                let busy = self.running.is_some() || rest;
                self.flags
                    | if filled || rest { FTF } else { 0 }
                    | if busy { BUSY } else { 0 }
                    | level << 8
            }
            FCR => 0,
            DR => {
                let mut bytes = [0; 4];
                for byte in bytes.iter_mut().take(width.bytes() as usize) {
                    while self.fifo.is_empty() && self.running.is_some() {
                        self.pass_next(now);
                    }
                    *byte = self.fifo.pop_front().unwrap_or(0);
                }
                self.wake(now);
                u32::from_le_bytes(bytes)
            }
            _ => self.registers.read(offset)?,
        })
    }

    /// What waited for the FIFO goes on.
    fn wake(&mut self, now: Nanos) {
        if let Some(running) = self.running.as_mut().filter(|running| running.next.is_none()) {
            running.next = Some(now + running.byte);
        }
    }

    /// The next byte on the lines, at once: the core waits for it.
    fn pass_next(&mut self, now: Nanos) {
        self.wake(now);
        let at = self.next_event().unwrap_or(now).max(now);
        self.pass_byte(at);
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        self.advance(now);
        let is_busy = self.running.is_some();
        match write.offset {
            SR => Err(AccessKind::Protected),
            FCR => {
                self.flags &= !write.ones();
                Ok(())
            }
            CR => {
                self.registers.write(write)?;
                if write.ones() & ABORT != 0 || !self.registers.has(CR, EN) {
                    self.stop(now);
                    self.fifo.clear();
                    let value = self.registers.value(CR) & !ABORT;
                    self.registers.set(CR, value);
                    self.flags |= TCF;
                }
                Ok(())
            }
            DR => {
                self.start_by(DR, now)?;
                let bytes = write.over(0).to_le_bytes();
                let taken = bytes.into_iter().take(write.width().bytes() as usize);
                // The bus waits for room.
                for byte in taken {
                    while self.level() == FIFO && self.running.is_some() {
                        self.pass_next(now);
                    }
                    self.fifo.push_back(byte);
                }
                self.wake(now);
                Ok(())
            }
            // They are of the command that runs.
            DLR | AR | CCR | TCR | IR | PSMKR | PSMAR | PIR if is_busy => {
                Err(AccessKind::Protected)
            }
            AR | IR => {
                self.registers.write(write)?;
                self.start_by(write.offset, now)
            }
            _ => self.registers.write(write),
        }
    }

    pub(super) fn interrupts(&self) -> bool {
        self.flags & field(self.registers.value(CR), 16, 5) != 0
    }
}
