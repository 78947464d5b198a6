//! Timestamps.

use rc10_sim::Nanos;

use crate::time::Period;

/// The timestamp counter, TSCV.
#[derive(Default)]
pub(super) struct Timestamp {
    /// `None`: it stands.
    tick: Option<Period>,
    /// Time at which it had the value `base`; wrap-arounds included.
    from: Nanos,
    base: u64,
    wraps_told: u64,
}

impl Timestamp {
    fn total(&self, at: Nanos) -> u64 {
        self.base + self.tick.map_or(0, |tick| tick.count_in(at.since(self.from)))
    }

    /// The counter, 16 bits.
    pub fn value(&self, at: Nanos) -> u32 {
        (self.total(at) & 0xFFFF) as u32
    }

    /// From now on it counts at another rate.
    pub fn set_tick(&mut self, tick: Option<Period>, now: Nanos) {
        if tick != self.tick {
            self.base = self.total(now);
            self.from = now;
            self.tick = tick;
        }
    }

    pub const fn restart(&mut self, now: Nanos) {
        self.base = 0;
        self.wraps_told = 0;
        self.from = now;
    }

    /// Whether it has wrapped around since this was last asked.
    pub fn has_wrapped(&mut self, now: Nanos) -> bool {
        let wraps = self.total(now) >> 16;
        std::mem::replace(&mut self.wraps_told, wraps) != wraps
    }

    /// Time of its next wrap-around after `has_wrapped` was asked last.
    pub fn next_wrap(&self) -> Option<Nanos> {
        let ticks = ((self.wraps_told + 1) << 16) - self.base;
        Some(self.from + self.tick?.many(ticks))
    }
}
