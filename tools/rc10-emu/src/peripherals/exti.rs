//! External interrupts: edges on pins, software triggers (RM0468, EXTI chapter). Lines 0 ..= 15 are
//! pins, 16 ..= 21 have software triggers, the others only store. Not modelled: events (`EMR`),
//! wake-up, the D3 domain's pending flags.

use super::access::{Answer, Write};
use super::registers::{Register, Registers, masked, plain};

words! { RISING: 0x00, FALLING: 0x04, SOFTWARE: 0x08, MASK: 0x80, PENDING: 0x88 }

/// Lines of the first register that have a pending flag.
const LINES: u32 = 0x3F_FFFF;

#[rustfmt::skip]
const TABLE: &[Register] = &[
    masked(0x00, 0, LINES), masked(0x04, 0, LINES), masked(0x08, 0, 0), plain(0x0C, 0),
    plain(0x10, 0), plain(0x14, 0),
    plain(0x20, 0), plain(0x24, 0), plain(0x28, 0), plain(0x2C, 0), plain(0x30, 0),
    plain(0x34, 0),
    plain(0x40, 0), plain(0x44, 0), plain(0x48, 0), plain(0x4C, 0), plain(0x50, 0),
    plain(0x54, 0),
    plain(0x80, 0xFFC0_0000), plain(0x84, 0), masked(0x88, 0, 0),
    plain(0x90, 0xFFF5_FFFF), plain(0x94, 0), masked(0x98, 0, 0),
    plain(0xA0, 0x0188_7FFF), plain(0xA4, 0), masked(0xA8, 0, 0),
];

/// Lines that share an interrupt, as a mask, and its number.
const INTERRUPTS: [(u32, usize); 12] = [
    (1 << 0, 6),
    (1 << 1, 7),
    (1 << 2, 8),
    (1 << 3, 9),
    (1 << 4, 10),
    (0x1F << 5, 23),
    (0x3F << 10, 40),
    (1 << 16, 1),
    (1 << 17, 41),
    (1 << 18, 2),
    (1 << 19, 3),
    (3 << 20, 137),
];

#[derive(Debug)]
pub(super) struct Exti {
    pub(super) registers: Registers,
    /// Levels of lines 0 ..= 15 when last looked at.
    levels: u32,
}

impl Exti {
    pub(super) fn new() -> Self {
        Self { registers: Registers::new(TABLE), levels: 0 }
    }

    pub(super) fn write(&mut self, write: Write) -> Answer {
        match write.offset {
            SOFTWARE => self.pend(write.ones() & LINES),
            PENDING => {
                let pending = self.registers.value(PENDING) & !write.ones();
                self.registers.set(PENDING, pending);
            }
            _ => self.registers.write(write)?,
        }
        Ok(())
    }

    fn pend(&mut self, lines: u32) {
        self.registers.set(PENDING, self.registers.value(PENDING) | lines);
    }

    pub(super) fn look(&mut self, levels: u32) {
        let (rose, fell) = (levels & !self.levels, self.levels & !levels);
        self.levels = levels;
        let lines = rose & self.registers.value(RISING) | fell & self.registers.value(FALLING);
        if lines != 0 {
            self.pend(lines);
        }
    }

    pub(super) fn interrupts(&self) -> impl Iterator<Item = usize> {
        let lines = self.registers.value(PENDING) & self.registers.value(MASK);
        INTERRUPTS.iter().filter(move |(mask, _)| lines & mask != 0).map(|&(_, number)| number)
    }
}
