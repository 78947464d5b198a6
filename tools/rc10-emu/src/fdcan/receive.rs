//! Storage of a good frame: FIFOs, dedicated buffers, priority.

use rc10_can::CanFrame;

use super::controller::Controller;
use super::filters::{self, Destination};
use super::ram::{self, MessageRam};
use super::registers::{at, ir};
use super::ring::RINGS;

/// HPMS.MSI: what became of the priority message.
mod stored {
    words! { pub NOWHERE: 0, LOST: 1, IN_FIFO_0: 2 }
}

impl Controller {
    /// Stores a frame where the filters want it.
    pub fn accept(&mut self, frame: &CanFrame, timestamp: u32, ram: &mut MessageRam) {
        let verdict = filters::judge(self, frame, ram);
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
                store(self.start_word(at::RXBC), size_code, buffer);
                self.new_data[buffer as usize / 32] |= 1 << (buffer % 32);
                self.counters.received_in_buffers += 1;
                self.flags |= ir::DRX;
                (0, stored::NOWHERE)
            }
            Destination::Fifo(fifo) => {
                let ring = fifo as usize;
                let was_full = self.is_full(ring);
                if let Some(index) = self.put(ring) {
                    let start = self.start_word(RINGS[ring].0);
                    store(start, self.registers.field(at::RXESC, 4 * fifo, 3), index);
                    self.counters.received[ring] += 1;
                    self.counters.overwritten[ring] += u64::from(was_full);
                    (index, stored::IN_FIFO_0 + fifo)
                } else {
                    self.counters.lost[ring] += 1;
                    (0, stored::LOST)
                }
            }
        };
        if verdict.priority {
            let list = u32::from(frame.is_extended_id()) << 15;
            self.high_priority = list | element << 8 | indicator << 6 | index;
            self.flags |= ir::HPM;
        }
    }
}
