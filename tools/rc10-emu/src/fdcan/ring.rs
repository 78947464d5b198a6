//! The FIFO that both receive FIFOs and the transmit event FIFO are.

use super::registers::{field, ir};

/// Configuration of a FIFO; RXF0C, RXF1C and TXEFC share this layout.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Elements; 0: none are kept.
    pub size: u32,
    /// Fill level that raises the watermark flag; 0 or above the size: never.
    pub watermark: u32,
    /// A full FIFO gives up its oldest element rather than the new one.
    pub overwrites: bool,
}

impl Shape {
    pub const fn new(register: u32, largest: u32) -> Self {
        let size = field(register, 16, 7);
        Self {
            size: if size < largest { size } else { largest },
            watermark: field(register, 24, 7),
            overwrites: register >> 31 != 0,
        }
    }
}

#[derive(Default)]
pub(super) struct Ring {
    get: u32,
    level: u32,
}

impl Ring {
    /// The index that a new element is written to, if it is not lost, and the flags that this
    /// raises in IR, with those of FIFO 0.
    pub fn put(&mut self, shape: Shape) -> (Option<u32>, u32) {
        if self.level < shape.size {
            let index = (self.get + self.level) % shape.size;
            self.level += 1;
            let at = |level, flag| if self.level == level { flag } else { 0 };
            let flags = at(shape.watermark, ir::RF0W) | at(shape.size, ir::RF0F);
            (Some(index), ir::RF0N | flags)
        } else if shape.overwrites && shape.size > 0 {
            let index = self.get;
            self.get = (self.get + 1) % shape.size;
            (Some(index), ir::RF0N)
        } else {
            (None, ir::RF0L)
        }
    }

    pub const fn is_full(&self, shape: Shape) -> bool {
        self.level >= shape.size
    }

    /// Frees all elements up to and including this one; `false` if it is not in the FIFO.
    pub const fn acknowledge(&mut self, index: u32, shape: Shape) -> bool {
        if index >= shape.size {
            return false;
        }
        let freed = (index + shape.size - self.get) % shape.size + 1;
        if freed > self.level {
            return false;
        }
        self.get = (index + 1) % shape.size;
        self.level -= freed;
        true
    }

    /// The status register without its message-lost bit.
    pub const fn status(&self, shape: Shape) -> u32 {
        if shape.size == 0 {
            return 0;
        }
        let put = (self.get + self.level) % shape.size;
        let full = (self.level == shape.size) as u32;
        self.level | self.get << 8 | put << 16 | full << 24
    }
}
