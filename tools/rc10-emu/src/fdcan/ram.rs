//! The message RAM that the three controllers share, and the elements in it.

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};

use crate::memory::noise;
use crate::peripherals::registers::field;

/// 10 KiB (RM0468, FDCAN message RAM).
pub(super) const WORDS: u32 = 2560;

pub(super) struct MessageRam {
    pub words: Vec<u32>,
    /// Elements configured to lie beyond the end that were read or written.
    pub misses: u64,
}

impl MessageRam {
    /// After power-on: noise, other noise for another seed.
    pub fn new(seed: u64) -> Self {
        let words = noise(seed).take(WORDS as usize).map(|word| (word >> 32) as u32);
        Self { words: words.collect(), misses: 0 }
    }

    /// A controller's read; beyond the end there is nothing.
    pub fn load(&mut self, index: u32) -> u32 {
        if let Some(&word) = self.words.get(index as usize) {
            return word;
        }
        self.misses += 1;
        0
    }

    /// A controller's write.
    pub fn store(&mut self, index: u32, value: u32) {
        match self.words.get_mut(index as usize) {
            Some(word) => *word = value,
            None => self.misses += 1,
        }
    }
}

const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;

/// Words of a buffer element: two of header and the data field of this RXESC or TXESC.
pub(super) const fn element_words(size_code: u32) -> u32 {
    2 + [2, 3, 4, 5, 6, 8, 12, 16][size_code as usize & 7]
}

/// First word of an element: identifier, its size, remote flag.
pub(super) fn header_word(frame: &CanFrame) -> u32 {
    let id = if frame.is_extended_id() { frame.raw_id() | EXTENDED } else { frame.raw_id() << 18 };
    id | if frame.is_remote() { REMOTE } else { 0 }
}

/// The data length code where the second word of every element has it.
pub(super) fn length_field(frame: &CanFrame) -> u32 {
    (u32::try_from(frame.len()).unwrap_or(8) & 0xF) << 16
}

/// A frame's data as words, byte 0 lowest; as many as it needs.
pub(super) fn data_words(frame: &CanFrame) -> impl Iterator<Item = u32> + '_ {
    frame
        .bytes()
        .chunks(4)
        .map(|bytes| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte)))
}

/// The identifier and the remote flag in the first word of a transmit buffer.
pub(super) fn urgency(header: u32) -> (Id, bool) {
    let id = if header & EXTENDED != 0 {
        Id::Extended(ExtendedId::new(field(header, 0, 29)).unwrap_or(ExtendedId::MAX))
    } else {
        #[expect(clippy::cast_possible_truncation, reason = "11 bits")]
        Id::Standard(StandardId::new(field(header, 18, 11) as u16).unwrap_or(StandardId::MAX))
    };
    (id, header & REMOTE != 0)
}

/// The classic frame of a transmit buffer. Length codes above 8 mean 8.
pub(super) fn frame(header: u32, control: u32, data: [u32; 2]) -> CanFrame {
    let (id, remote) = urgency(header);
    let length = field(control, 16, 4).min(8) as usize;
    let bytes = (u64::from(data[1]) << 32 | u64::from(data[0])).to_le_bytes();
    let frame = if remote {
        CanFrame::remote_frame(id, length)
    } else {
        CanFrame::data_frame(id, &bytes[..length])
    };
    frame.unwrap_or_else(|_| CanFrame::eight_bytes(id, bytes))
}
