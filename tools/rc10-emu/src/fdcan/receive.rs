//! Storage of a good frame: FIFOs, dedicated buffers, priority.

use rc10_can::CanFrame;

use super::controller::Controller;
use super::filters::{self, Destination};
use super::ram::{self, MessageRam};
use super::registers::{Register, at, ir};
use super::ring::{Ring, Shape};

/// Configuration registers of FIFO 0, FIFO 1.
const FIFOS: [Register; 2] = [at::RXF0C, at::RXF1C];
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

impl Receive {
    /// CCCR.CCE was set.
    pub fn reset(&mut self) {
        self.fifos = Default::default();
        self.high_priority = 0;
    }

    /// NDAT1 (0), NDAT2 (1).
    pub const fn new_data(&self, half: u32) -> u32 {
        (self.new_data >> (32 * half) & 0xFFFF_FFFF) as u32
    }

    pub fn clear_new_data(&mut self, half: u32, bits: u32) {
        self.new_data &= !(u64::from(bits) << (32 * half));
    }
}

impl Controller {
    /// The shape of FIFO 0, FIFO 1.
    fn shape(&self, fifo: usize) -> Shape {
        Shape::new(self.registers.at(FIFOS[fifo]), LARGEST_FIFO)
    }

    /// RXF0S, RXF1S without the message-lost bit.
    pub fn fifo_status(&self, fifo: usize) -> u32 {
        self.receive.fifos[fifo].status(self.shape(fifo))
    }

    /// RXF0A, RXF1A; `false` if that element is not in the FIFO.
    pub fn acknowledge(&mut self, fifo: usize, index: u32) -> bool {
        let shape = self.shape(fifo);
        self.receive.fifos[fifo].acknowledge(index & 0x3F, shape)
    }

    /// Stores a frame where the filters want it.
    pub fn accept(&mut self, frame: &CanFrame, timestamp: u32, ram: &mut MessageRam) {
        let verdict = filters::judge(frame, &self.registers, self.receive.new_data, ram);
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
        let (index, indicator) = match verdict.destination {
            Destination::Nowhere => {
                self.counters.rejected += 1;
                (0, stored::NOWHERE)
            }
            Destination::Buffer(buffer) => {
                let size_code = self.registers.field(at::RXESC, 8, 3);
                store(self.registers.start_word(at::RXBC), size_code, buffer);
                self.receive.new_data |= 1 << buffer;
                self.counters.received_in_buffers += 1;
                self.flags |= ir::DRX;
                (0, stored::NOWHERE)
            }
            Destination::Fifo(fifo) => match self.put(fifo as usize) {
                Some(index) => {
                    let start = self.registers.start_word(FIFOS[fifo as usize]);
                    store(start, self.registers.field(at::RXESC, 4 * fifo, 3), index);
                    self.counters.received[fifo as usize] += 1;
                    (index, stored::IN_FIFO_0 + fifo)
                }
                None => (0, stored::LOST),
            },
        };
        if verdict.priority {
            let list = u32::from(frame.is_extended_id()) << 15;
            self.receive.high_priority = list | element << 8 | indicator << 6 | index;
            self.flags |= ir::HPM;
        }
    }

    /// The index of a place in a FIFO; `None`: the frame is lost.
    fn put(&mut self, fifo: usize) -> Option<u32> {
        let shape = self.shape(fifo);
        let ring = &mut self.receive.fifos[fifo];
        let was_full = ring.is_full(shape);
        let (index, flags) = ring.put(shape);
        self.counters.overwritten[fifo] += u64::from(was_full && index.is_some());
        self.counters.lost[fifo] += u64::from(index.is_none());
        self.flags |= flags << (4 * fifo);
        index
    }
}
