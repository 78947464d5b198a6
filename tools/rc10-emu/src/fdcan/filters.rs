//! Acceptance filtering (RM0468, "Acceptance filtering").

use rc10_can::CanFrame;

use super::controller::Controller;
use super::ram::MessageRam;
use super::registers::at;
use crate::peripherals::registers::field;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Destination {
    Fifo(u32),
    Buffer(u32),
    Nowhere,
}

pub(super) struct Verdict {
    pub destination: Destination,
    pub element: Option<u32>,
    pub priority: bool,
}

/// A filter element of either list. Field numbers are those of the manual.
struct Element {
    /// SFT, EFT.
    kind: u32,
    /// SFEC, EFEC.
    configuration: u32,
    /// SFID1, EFID1 and SFID2, EFID2.
    id: [u32; 2],
}

const DISABLED: u32 = 0;
const INTO_BUFFER: u32 = 7;

/// EFT: a range over identifiers as sent, without XIDAM.
const EXTENDED_RANGE_UNMASKED: u32 = 3;

/// The first element that matches decides.
pub(super) fn judge(of: &Controller, frame: &CanFrame, ram: &mut MessageRam) -> Verdict {
    let (registers, new_data) = (&of.registers, of.new_data);
    let extended = frame.is_extended_id();
    let global = registers.value(at::GFC);
    let (reject_remote, unmatched) =
        if extended { (1 << 0, field(global, 2, 2)) } else { (1 << 1, field(global, 4, 2)) };
    if frame.is_remote() && global & reject_remote != 0 {
        return Verdict { destination: Destination::Nowhere, element: None, priority: false };
    }
    let (list, largest, words) = if extended { (at::XIDFC, 64, 2) } else { (at::SIDFC, 128, 1) };
    let elements = registers.field(list, 16, 8).min(largest);
    for index in 0..elements {
        let address = of.start_word(list) + index * words;
        let element = if extended { extended_at(address, ram) } else { standard_at(address, ram) };
        if element.configuration == DISABLED {
            continue;
        }
        let masked = frame.raw_id() & registers.value(at::XIDAM);
        let matches = match (extended, element.kind) {
            (true, EXTENDED_RANGE_UNMASKED) if element.configuration != INTO_BUFFER => {
                element.ranges_over(frame.raw_id())
            }
            (true, _) => element.matches(masked, new_data),
            (false, _) => element.matches(frame.raw_id(), new_data),
        };
        if matches {
            return element.verdict(index);
        }
    }
    let destination =
        if unmatched < 2 { Destination::Fifo(unmatched) } else { Destination::Nowhere };
    Verdict { destination, element: None, priority: false }
}

fn standard_at(address: u32, ram: &mut MessageRam) -> Element {
    let word = ram.load(address);
    Element {
        kind: field(word, 30, 2),
        configuration: field(word, 27, 3),
        id: [field(word, 16, 11), field(word, 0, 11)],
    }
}

fn extended_at(address: u32, ram: &mut MessageRam) -> Element {
    let words = [ram.load(address), ram.load(address + 1)];
    Element {
        kind: field(words[1], 30, 2),
        configuration: field(words[0], 29, 3),
        id: words.map(|word| field(word, 0, 29)),
    }
}

impl Element {
    fn matches(&self, id: u32, new_data: [u32; 2]) -> bool {
        let [first, second] = self.id;
        match (self.configuration, self.kind) {
            // A buffer that was not read yet is locked: the search goes on.
            (INTO_BUFFER, _) => {
                let is_new = new_data[field(second, 5, 1) as usize] >> field(second, 0, 5) & 1;
                id == first && is_new == 0
            }
            (_, 0) => self.ranges_over(id),
            (_, 1) => id == first || id == second,
            (_, 2) => (id ^ first) & second == 0,
            _ => false,
        }
    }

    const fn ranges_over(&self, id: u32) -> bool {
        self.id[0] <= id && id <= self.id[1]
    }

    const fn verdict(&self, index: u32) -> Verdict {
        let destination = match self.configuration {
            1 | 5 => Destination::Fifo(0),
            2 | 6 => Destination::Fifo(1),
            // 01, 10 and 11 above the buffer number are debug messages A, B, C, which land in a
            // buffer as well.
            INTO_BUFFER => Destination::Buffer(field(self.id[1], 0, 6)),
            // 3: reject; 4: priority alone.
            _ => Destination::Nowhere,
        };
        let priority = matches!(self.configuration, 4..=6);
        Verdict { destination, element: Some(index), priority }
    }
}
