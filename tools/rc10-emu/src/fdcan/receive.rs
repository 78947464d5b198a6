//! Storage of a good frame: FIFOs, dedicated buffers, priority.

use rc10_can::CanFrame;

use super::counters::Counters;
use super::filters::{self, Destination};
use super::ram::{self, MessageRam};
use super::registers::{Registers, at, ir};
use super::ring::{Put, Ring, Shape};

/// Configuration, status and acknowledge registers of FIFO 1 lie this far behind FIFO 0's.
const FIFO_STRIDE: u32 = at::RXF1C - at::RXF0C;
/// Elements of a receive FIFO at most.
const LARGEST_FIFO: u32 = 64;

/// HPMS.MSI: what became of the priority message.
mod stored {
    pub const NOWHERE: u32 = 0;
    pub const LOST: u32 = 1;
    pub const IN_FIFO_0: u32 = 2;
}

#[derive(Default)]
pub(super) struct Receive {
    fifos: [Ring; 2],
    /// NDAT1 and NDAT2: receive buffers that were not read yet.
    new_data: u64,
    /// HPMS.
    pub high_priority: u32,
}

/// The flags of a receive FIFO.
const fn flags(fifo: u32, flags: u32) -> u32 {
    flags << (4 * fifo)
}

fn shape(fifo: u32, registers: &Registers) -> Shape {
    Shape::new(registers.at(at::RXF0C + fifo * FIFO_STRIDE), LARGEST_FIFO)
}

impl Receive {
    /// CCCR.CCE was set.
    pub fn reset(&mut self) {
        self.fifos = Default::default();
        self.high_priority = 0;
    }

    /// RXF0S, RXF1S without the message-lost bit.
    pub fn status(&self, fifo: u32, registers: &Registers) -> u32 {
        self.fifos[(fifo & 1) as usize].status(shape(fifo, registers))
    }

    /// RXF0A, RXF1A; `false` if that element is not in the FIFO.
    pub fn acknowledge(&mut self, fifo: u32, index: u32, registers: &Registers) -> bool {
        self.fifos[(fifo & 1) as usize].acknowledge(index & 0x3F, shape(fifo, registers))
    }

    /// NDAT1 (0), NDAT2 (1).
    pub const fn new_data(&self, half: u32) -> u32 {
        (self.new_data >> (32 * half) & 0xFFFF_FFFF) as u32
    }

    pub fn clear_new_data(&mut self, half: u32, bits: u32) {
        self.new_data &= !(u64::from(bits) << (32 * half));
    }

    /// Stores a frame where the filters want it; the flags that this raises in IR.
    pub fn accept(
        &mut self,
        frame: &CanFrame,
        timestamp: u32,
        registers: &Registers,
        ram: &mut MessageRam,
        counters: &mut Counters,
    ) -> u32 {
        let verdict = filters::judge(frame, registers, self.new_data, ram);
        let unmatched = if verdict.element.is_none() { 1 << 31 } else { 0 };
        let element = verdict.element.unwrap_or(0);
        let control = unmatched | element << 24 | ram::length_field(frame) | timestamp;
        let mut store = |start: u32, size_code: u32, index: u32| {
            let address = start + index * ram::element_words(size_code);
            ram.store(address, ram::header_word(frame));
            ram.store(address + 1, control);
            for (word, data) in (address + 2..).zip(ram::data_words(frame)) {
                ram.store(word, data);
            }
        };
        let (flags, index, indicator) = match verdict.destination {
            Destination::Nowhere => {
                counters.rejected += 1;
                (0, 0, stored::NOWHERE)
            }
            Destination::Buffer(buffer) => {
                let size_code = registers.field(at::RXESC, 8, 3);
                store(registers.start_word(at::RXBC), size_code, buffer);
                self.new_data |= 1 << buffer;
                counters.received_in_buffers += 1;
                (ir::DRX, 0, stored::NOWHERE)
            }
            Destination::Fifo(fifo) => {
                let place = (fifo & 1) as usize;
                let (flags, index) = self.put(fifo, registers, counters);
                match index {
                    Some(index) => {
                        let start = registers.start_word(at::RXF0C + fifo * FIFO_STRIDE);
                        store(start, registers.field(at::RXESC, 4 * fifo, 3), index);
                        counters.received[place] += 1;
                        (flags, index, stored::IN_FIFO_0 + fifo)
                    }
                    None => (flags, 0, stored::LOST),
                }
            }
        };
        if !verdict.priority {
            return flags;
        }
        let list = u32::from(frame.is_extended_id()) << 15;
        self.high_priority = list | element << 8 | indicator << 6 | index;
        flags | ir::HPM
    }

    /// A place in a FIFO: the flags that its taking raises, and its index unless it is lost.
    fn put(
        &mut self,
        fifo: u32,
        registers: &Registers,
        counters: &mut Counters,
    ) -> (u32, Option<u32>) {
        let shape = shape(fifo, registers);
        let place = (fifo & 1) as usize;
        let ring = &mut self.fifos[place];
        match ring.put(shape) {
            Put::Kept(index) => {
                let watermark = if ring.level() == shape.watermark { ir::RF0W } else { 0 };
                let full = if ring.level() == shape.size { ir::RF0F } else { 0 };
                (flags(fifo, ir::RF0N | watermark | full), Some(index))
            }
            Put::KeptForOldest(index) => {
                counters.overwritten[place] += 1;
                (flags(fifo, ir::RF0N), Some(index))
            }
            Put::Lost => {
                counters.lost[place] += 1;
                (flags(fifo, ir::RF0L), None)
            }
        }
    }
}
