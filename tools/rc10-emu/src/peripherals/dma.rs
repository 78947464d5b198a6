//! DMA1 and DMA2, and the router DMAMUX1 in front of them (RM0468, DMA and DMAMUX chapters).
//!
//! An item moves when its peripheral asks, without bus delay; memory to memory when the stream is
//! enabled. Items are as wide as the peripheral's. A stream is not enabled while a flag of its last
//! transfer stands.
//!
//! With its FIFO (`FCR.DMDIS`) a stream from a peripheral writes to memory at the threshold, at the
//! end, or when switched off; one to a peripheral reads as far ahead as the FIFO holds.
//!
//! A stream that serves a UART without `CR.TRBUFF` locks when another stream of its controller
//! moves at that time, until it is enabled anew. Source: STM32H7 errata, "DMA stream locked when
//! transferring data to/from USART/UART"; ST's `stm32h7xx_hal_dma.c`; Zephyr (issue 72790).
//!
//! Not modelled, and reported when asked for: double buffers, flow control by the peripheral,
//! synchronised requests, request generators. Priorities are those of the streams' numbers.

use std::collections::VecDeque;
use std::ops::Range;

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Width, Write};

pub(super) const STREAMS: usize = 8;

/// Memories that DMA1 and DMA2 cannot reach: the core's own (RM0468, bus matrix).
pub(super) const UNREACHABLE: [Range<u32>; 2] =
    [0x0000_0000..0x0001_0000, 0x2000_0000..0x2002_0000];

// Flags of one stream: those of the FIFO and of direct mode never rise here.
bits! { ERROR: 3, HALF: 4, COMPLETE: 5 }

// CR.
const ENABLE: u32 = 1 << 0;
/// EN and the interrupt enables DMEIE, TEIE, HTIE, TCIE: may change while enabled.
const UNLOCKED: u32 = 0x1F;
/// PFCTRL, DBM.
const UNMODELLED: u32 = 1 << 5 | 1 << 18;
bits! { CIRCULAR: 8, PERIPHERAL_INCREMENT: 9, MEMORY_INCREMENT: 10 }
/// TRBUFF.
const BUFFERABLE: u32 = 1 << 20;
/// FCR.DMDIS.
const FIFO_MODE: u32 = 1 << 2;
const FIFO_BYTES: u32 = 16;
/// Distance in time at which two transfers are "concurrent": about that of one on the buses.
const CONCURRENT: Nanos = Nanos::new(100);

/// Interrupts of DMA1's and DMA2's streams. Source: stm32-metapac.
const INTERRUPTS: [[usize; STREAMS]; 2] =
    [[11, 12, 13, 14, 15, 16, 17, 47], [56, 57, 58, 59, 60, 68, 69, 70]];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    FromPeripheral,
    ToPeripheral,
    /// From the "peripheral" address to the other.
    MemoryToMemory,
}

#[derive(Debug, Default)]
pub(super) struct Stream {
    control: u32,
    /// Items that remain, and what it starts again with.
    items: u32,
    reload: u32,
    peripheral: u32,
    memory: [u32; 2],
    /// FCR without the FIFO's state.
    fifo: u32,
    flags: u32,
    /// Items done since it was enabled or started again.
    done: u32,
    pub(super) fails: bool,
    /// Contents of its FIFO: values, with their destination if that is memory.
    pub(super) held: VecDeque<(u32, u32)>,
    moved_at: Option<Nanos>,
    locked: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Transfer {
    pub from: u32,
    pub to: u32,
    pub width: Width,
    /// Through the FIFO: of the two only the peripheral's side is served now.
    pub buffered: bool,
}

impl Stream {
    fn new() -> Self {
        Self { fifo: 0x01, ..Self::default() }
    }

    const fn is(&self, bit: u32) -> bool {
        self.control & bit != 0
    }

    const fn direction(&self) -> Direction {
        match self.control >> 6 & 3 {
            0 => Direction::FromPeripheral,
            1 => Direction::ToPeripheral,
            _ => Direction::MemoryToMemory,
        }
    }

    const fn width(&self) -> Width {
        Width::of(1 << (self.control >> 11 & 3))
    }

    pub(super) const fn is_enabled(&self) -> bool {
        self.is(ENABLE)
    }

    /// The item to move next, if enabled; `None`: it waits for a request.
    pub(super) fn next(&self, requested: bool) -> Option<Transfer> {
        let moves = requested || self.direction() == Direction::MemoryToMemory;
        if !self.is(ENABLE) || self.locked || !moves {
            return None;
        }
        let width = self.width();
        let moved = self.done.wrapping_mul(width.bytes());
        let at = |base: u32, bit| if self.is(bit) { base.wrapping_add(moved) } else { base };
        let peripheral = at(self.peripheral, PERIPHERAL_INCREMENT);
        let memory = at(self.memory[0], MEMORY_INCREMENT);
        let (from, to) = match self.direction() {
            Direction::ToPeripheral => (memory, peripheral),
            Direction::FromPeripheral | Direction::MemoryToMemory => (peripheral, memory),
        };
        Some(Transfer { from, to, width, buffered: self.buffers() })
    }

    /// Memory to memory has its FIFO too, but nothing to wait for.
    fn buffers(&self) -> bool {
        self.fifo & FIFO_MODE != 0 && self.direction() != Direction::MemoryToMemory
    }

    /// Bytes in the FIFO.
    fn level(&self) -> u32 {
        u32::try_from(self.held.len()).unwrap_or(0) * self.width().bytes()
    }

    /// Memory address to be read ahead into the FIFO, if there is room, and the item's width.
    pub(super) fn ahead(&self) -> Option<(u32, Width)> {
        let (width, level) = (self.width(), self.level());
        let next = self.done + level / width.bytes();
        let wanted =
            self.is(ENABLE) && self.buffers() && self.direction() == Direction::ToPeripheral;
        if !wanted || level + width.bytes() > FIFO_BYTES {
            return None;
        }
        let next = if self.is(CIRCULAR) { next % self.reload } else { next };
        let moved = if self.is(MEMORY_INCREMENT) { next.wrapping_mul(width.bytes()) } else { 0 };
        (next < self.reload).then(|| (self.memory[0].wrapping_add(moved), width))
    }

    /// Whether what the FIFO holds is to go to memory now.
    fn is_due(&self) -> bool {
        let threshold = FIFO_BYTES / 4 * ((self.fifo & 3) + 1);
        let from = self.direction() == Direction::FromPeripheral;
        // Circular, it begins again.
        let ends = !self.is(ENABLE) || self.done == 0;
        from && !self.held.is_empty() && (self.level() >= threshold || ends)
    }

    /// FCR.FS: how full it is.
    fn fill(&self) -> u32 {
        match self.level() {
            0 => 4,
            FIFO_BYTES.. => 5,
            bytes => bytes / (FIFO_BYTES / 4),
        }
    }

    /// The writes to memory that are due: address, value, width.
    pub(super) fn give_due(&mut self) -> Vec<(u32, u32, Width)> {
        if !self.is_due() {
            return Vec::new();
        }
        let width = self.width();
        self.held.drain(..).map(|(to, value)| (to, value, width)).collect()
    }

    /// The transfer that [`next`](Self::next) named was made, or could not be.
    pub(super) fn moved(&mut self, worked: bool, now: Nanos) {
        self.moved_at = Some(now);
        if !worked {
            self.flags |= ERROR;
            self.control &= !ENABLE;
            return;
        }
        self.done += 1;
        self.items = self.items.saturating_sub(1);
        if self.done == self.reload / 2 {
            self.flags |= HALF;
        }
        if self.items == 0 {
            self.flags |= COMPLETE;
            if self.is(CIRCULAR) {
                self.items = self.reload;
                self.done = 0;
            } else {
                self.control &= !ENABLE;
            }
        }
    }

    fn write(&mut self, register: u32, write: Write) -> Answer {
        let locked = self.is(ENABLE);
        match register {
            0x00 => {
                let wanted = write.over(self.control);
                let unlocked = if locked { UNLOCKED } else { 0x01FF_FFFF };
                self.control = self.control & !unlocked | wanted & unlocked;
                if locked && !self.is(ENABLE) {
                    // RM0468, EN: the flag tells that the stream has come to its end.
                    self.flags |= COMPLETE;
                }
                if !locked && self.is(ENABLE) {
                    // RM0468, NDTR: enabled again, it starts with what it started with before.
                    if self.items == 0 {
                        self.items = self.reload;
                    }
                    let refusal = if self.is(UNMODELLED) {
                        Some(AccessKind::Unmodelled)
                    } else {
                        (self.items == 0 || self.flags != 0).then_some(AccessKind::Protected)
                    };
                    if let Some(refusal) = refusal {
                        self.control &= !ENABLE;
                        return Err(refusal);
                    }
                    self.reload = self.items;
                    (self.done, self.locked) = (0, false);
                    self.held.clear();
                }
            }
            0x04 | 0x08 | 0x0C if locked => return Err(AccessKind::Protected),
            0x04 => {
                self.items = write.over(self.items) & 0xFFFF;
                self.reload = self.items;
            }
            0x08 => self.peripheral = write.over(self.peripheral),
            0x0C => self.memory[0] = write.over(self.memory[0]),
            0x10 => self.memory[1] = write.over(self.memory[1]),
            _ if locked => return Err(AccessKind::Protected),
            _ => self.fifo = write.over(self.fifo) & 0x87,
        }
        Ok(())
    }
}

#[derive(Debug)]
pub(super) struct Dma {
    index: usize,
    pub(super) streams: [Stream; STREAMS],
}

/// Position of a stream's flags in LISR or HISR.
const FLAG_SHIFTS: [u32; 4] = [0, 6, 16, 22];
const FLAGS: u32 = 0x3D;

fn stream_of(offset: u32) -> Option<(usize, u32)> {
    let offset = offset.checked_sub(0x10)?;
    let stream = (offset / 0x18) as usize;
    (stream < STREAMS).then_some((stream, offset % 0x18))
}

impl Dma {
    /// DMA1 is 0.
    pub(super) fn new(index: usize) -> Self {
        Self { index, streams: std::array::from_fn(|_| Stream::new()) }
    }

    pub(super) fn read(&self, offset: u32) -> Answer<u32> {
        if let 0x00 | 0x04 = offset {
            let half = self.streams.iter().skip(offset as usize).take(4);
            return Ok(half.zip(FLAG_SHIFTS).map(|(stream, shift)| stream.flags << shift).sum());
        }
        if let 0x08 | 0x0C = offset {
            return Ok(0);
        }
        let (stream, register) = stream_of(offset).ok_or(AccessKind::Unmodelled)?;
        let stream = &self.streams[stream];
        Ok(match register {
            0x00 => stream.control,
            0x04 => stream.items,
            0x08 => stream.peripheral,
            0x0C => stream.memory[0],
            0x10 => stream.memory[1],
            _ => stream.fifo | stream.fill() << 3,
        })
    }

    pub(super) fn write(&mut self, write: Write) -> Answer {
        match write.offset {
            // LISR, HISR cannot be written.
            0x00 | 0x04 => Ok(()),
            0x08 | 0x0C => {
                let half = self.streams.iter_mut().skip(write.offset as usize - 0x08).take(4);
                for (stream, shift) in half.zip(FLAG_SHIFTS) {
                    stream.flags &= !(write.ones() >> shift & FLAGS);
                }
                Ok(())
            }
            _ => {
                let (stream, register) = stream_of(write.offset).ok_or(AccessKind::Unmodelled)?;
                self.streams[stream].write(register, write)
            }
        }
    }

    /// Locks a stream that serves a UART without TRBUFF, if another moves now or has a request.
    /// `true`: it just did.
    pub(super) fn locks(&mut self, stream: usize, requested: [bool; STREAMS], now: Nanos) -> bool {
        let concurrent = (0..STREAMS).filter(|other| *other != stream).any(|other| {
            let one = &self.streams[other];
            let moved = one.moved_at.is_some_and(|at| now.since(at) < CONCURRENT);
            moved || one.is(ENABLE) && requested[other]
        });
        let stream = &mut self.streams[stream];
        let is_at_risk = stream.is(ENABLE) && !stream.is(BUFFERABLE) && !stream.locked;
        stream.locked |= is_at_risk && concurrent;
        is_at_risk && stream.locked
    }

    pub(super) fn control_address(&self, stream: usize) -> u32 {
        let offset = u32::try_from(0x400 * self.index + 0x18 * stream).unwrap_or(0);
        0x4002_0010 + offset
    }

    pub(super) fn is_idle(&self) -> bool {
        self.streams.iter().all(|stream| !stream.is(ENABLE))
    }

    pub(super) fn interrupts(&self) -> impl Iterator<Item = usize> {
        let asks = |stream: &Stream| {
            // TEIE, HTIE, TCIE are one bit below their flags.
            stream.flags & (stream.control << 1) & (ERROR | HALF | COMPLETE) != 0
        };
        let streams = self.streams.iter().zip(INTERRUPTS[self.index]);
        streams.filter(move |(stream, _)| asks(stream)).map(|(_, number)| number)
    }
}

/// Routes requests: channels 0 ..= 7 belong to DMA1's streams, the others to DMA2's.
#[derive(Debug, Default)]
pub(super) struct DmaMux {
    channels: [u32; 2 * STREAMS],
}

impl DmaMux {
    pub(super) fn read(&self, offset: u32) -> Answer<u32> {
        match offset {
            0x80 | 0x84 => Ok(0),
            _ => self.channels.get(offset as usize / 4).copied().ok_or(AccessKind::Unmodelled),
        }
    }

    pub(super) fn write(&mut self, write: Write) -> Answer {
        if let 0x80 | 0x84 = write.offset {
            return Ok(());
        }
        let channel =
            self.channels.get_mut(write.offset as usize / 4).ok_or(AccessKind::Unmodelled)?;
        *channel = write.over(*channel);
        // SOIE, SE. EGE alone does nothing. Requests go up to 137 here: eight bits.
        AccessKind::Unmodelled.when(*channel & (1 << 8 | 1 << 16) != 0)
    }

    /// The request that a stream listens to; 0: none.
    pub(super) fn request(&self, dma: usize, stream: usize) -> u32 {
        self.channels[dma * STREAMS + stream] & 0xFF
    }
}
