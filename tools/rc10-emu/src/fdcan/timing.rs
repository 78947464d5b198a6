//! Bits and ticks in nanoseconds.

use rc10_sim::Nanos;

use super::registers::field;
use crate::time::{periods_in, time_of};

/// A period as whole cycles of the kernel clock: exact for every clock.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Period {
    cycles: u64,
    /// Not zero.
    hz: u64,
}

impl Period {
    /// One nominal bit, of NBTP; `None` if the clock is off.
    pub fn of_bit(nbtp: u32, hz: u64) -> Option<Self> {
        let quanta = 3 + field(nbtp, 8, 8) + field(nbtp, 0, 7);
        let prescaler = 1 + field(nbtp, 16, 9);
        (hz > 0).then_some(Self { cycles: u64::from(quanta * prescaler), hz })
    }

    /// One period of a clock that is on.
    pub const fn of_clock(hz: u64) -> Self {
        Self { cycles: 1, hz }
    }

    pub const fn times(self, factor: u32) -> Self {
        Self { cycles: self.cycles * factor as u64, ..self }
    }

    /// Periods a second, to the nearest.
    pub fn rate(self) -> u64 {
        (self.hz + self.cycles / 2) / self.cycles
    }

    /// To the nearest nanosecond.
    pub fn nanos(self) -> u32 {
        let half = u128::from(self.hz / 2);
        let nanos = (u128::from(self.cycles) * 1_000_000_000 + half) / u128::from(self.hz);
        u32::try_from(nanos).unwrap_or(u32::MAX)
    }

    /// Time until this number of periods is over, in whole nanoseconds.
    pub fn many(self, count: u64) -> Nanos {
        time_of(u128::from(count) * u128::from(self.cycles), self.hz)
    }

    /// Number of periods that are over after this time.
    pub fn count_in(self, time: Nanos) -> u64 {
        periods_in(time, self.hz) / self.cycles
    }
}

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
