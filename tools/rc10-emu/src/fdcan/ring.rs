//! The FIFO that both receive FIFOs and the transmit event FIFO are.

use super::controller::Controller;
use super::registers::{Register, at, field, ir};

/// FIFO 0, FIFO 1, and that of transmit events: configuration register, elements at most, and the
/// place of its flags in IR. Bit 31 is reserved in TXEFC and reads as 0: no overwriting.
pub(super) const RINGS: [(Register, u32, u32); 3] =
    [(at::RXF0C, 64, 0), (at::RXF1C, 64, 4), (at::TXEFC, 32, 12)];
/// The one of transmit events.
pub(super) const EVENTS: usize = 2;

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
    const fn new(register: u32, largest: u32) -> Self {
        let size = field(register, 16, 7);
        Self {
            size: if size < largest { size } else { largest },
            watermark: field(register, 24, 7),
            overwrites: register >> 31 != 0,
        }
    }
}

impl Controller {
    pub fn shape(&self, ring: usize) -> Shape {
        let (register, largest, _) = RINGS[ring];
        Shape::new(self.registers.at(register), largest)
    }

    /// The index that a new element is written to; `None`: it is lost.
    pub fn put(&mut self, ring: usize) -> Option<u32> {
        let (index, flags) = self.rings[ring].put(self.shape(ring));
        self.flags |= flags << RINGS[ring].2;
        index
    }

    /// RXF0A, RXF1A, TXEFA; `false` if that element is not in the FIFO.
    pub fn acknowledge(&mut self, ring: usize, index: u32) -> bool {
        let index = index % RINGS[ring].1;
        self.rings[ring].acknowledge(index, self.shape(ring))
    }

    /// RXF0S, RXF1S, TXEFS.
    pub fn ring_status(&self, ring: usize) -> u32 {
        let has_lost = self.flags >> RINGS[ring].2 & ir::RF0L != 0;
        self.rings[ring].status(self.shape(ring)) | u32::from(has_lost) << 25
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
    fn put(&mut self, shape: Shape) -> (Option<u32>, u32) {
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
    const fn acknowledge(&mut self, index: u32, shape: Shape) -> bool {
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
    const fn status(&self, shape: Shape) -> u32 {
        if shape.size == 0 {
            return 0;
        }
        let put = (self.get + self.level) % shape.size;
        let full = (self.level == shape.size) as u32;
        self.level | self.get << 8 | put << 16 | full << 24
    }
}
