//! The FIFO that both receive FIFOs and the transmit event FIFO are.

use super::controller::Controller;
use super::registers::{at, ir};

/// FIFO 0, FIFO 1, and that of transmit events: configuration register, elements at most, and the
/// place of its flags in IR. The registers share their layout; bit 31 is reserved in TXEFC and
/// reads as 0: no overwriting.
pub(super) const RINGS: [(u32, u32, u32); 3] =
    [(at::RXF0C, 64, 0), (at::RXF1C, 64, 4), (at::TXEFC, 32, 12)];
/// The one of transmit events.
pub(super) const EVENTS: usize = 2;

#[derive(Default)]
pub(super) struct Ring {
    get: u32,
    level: u32,
}

impl Controller {
    /// Elements; 0: none are kept.
    fn size(&self, ring: usize) -> u32 {
        let (register, largest, _) = RINGS[ring];
        self.registers.field(register, 16, 7).min(largest)
    }

    pub fn is_full(&self, ring: usize) -> bool {
        self.rings[ring].level >= self.size(ring)
    }

    /// The index that a new element is written to; `None`: it is lost.
    pub fn put(&mut self, ring: usize) -> Option<u32> {
        let (size, (register, _, place)) = (self.size(ring), RINGS[ring]);
        // Fill level that raises the watermark flag; 0 or above the size: never.
        let watermark = self.registers.field(register, 24, 7);
        // A full FIFO gives up its oldest element rather than the new one.
        let overwrites = self.registers.has(register, 1 << 31);
        let ring = &mut self.rings[ring];
        let (index, flags) = if ring.level < size {
            let index = (ring.get + ring.level) % size;
            ring.level += 1;
            let at = |level, flag| if ring.level == level { flag } else { 0 };
            let flags = at(watermark, ir::RF0W) | at(size, ir::RF0F);
            (Some(index), ir::RF0N | flags)
        } else if overwrites && size > 0 {
            let index = ring.get;
            ring.get = (ring.get + 1) % size;
            (Some(index), ir::RF0N)
        } else {
            (None, ir::RF0L)
        };
        self.flags |= flags << place;
        index
    }

    /// RXF0A, RXF1A, TXEFA: frees all elements up to and including this one, if it is in the FIFO.
    pub fn acknowledge(&mut self, ring: usize, index: u32) {
        let (size, index) = (self.size(ring), index % RINGS[ring].1);
        let ring = &mut self.rings[ring];
        let freed = (index < size).then(|| (index + size - ring.get) % size + 1);
        let Some(freed) = freed.filter(|&freed| freed <= ring.level) else {
            self.counters.bad_acknowledges += 1;
            return;
        };
        ring.get = (index + 1) % size;
        ring.level -= freed;
    }

    /// RXF0S, RXF1S, TXEFS.
    pub fn ring_status(&self, ring: usize) -> u32 {
        let lost = u32::from(self.flags >> RINGS[ring].2 & ir::RF0L != 0) << 25;
        let (size, Ring { get, level }) = (self.size(ring), &self.rings[ring]);
        if size == 0 {
            return lost;
        }
        let (put, full) = ((get + level) % size, u32::from(*level == size));
        lost | level | get << 8 | put << 16 | full << 24
    }
}
