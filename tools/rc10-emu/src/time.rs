//! Periods of clocks, and time.

use rc10_sim::Nanos;

pub(crate) const NANOS_PER_SECOND: u128 = 1_000_000_000;

/// The time until this number of periods of a clock is over, in whole nanoseconds.
pub(crate) fn time_of(periods: impl Into<u128>, hz: u64) -> Nanos {
    let nanos = (periods.into() * NANOS_PER_SECOND).div_ceil(hz.max(1).into());
    Nanos::new(u64::try_from(nanos).unwrap_or(u64::MAX))
}

/// The number of periods of a clock that are over after this time.
pub(crate) fn periods_in(time: Nanos, hz: u64) -> u64 {
    let periods = u128::from(time.get()) * u128::from(hz) / NANOS_PER_SECOND;
    u64::try_from(periods).unwrap_or(u64::MAX)
}

/// A period as whole cycles of a clock: exact for every clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Period {
    /// Not zero.
    pub cycles: u64,
    /// Not zero.
    pub hz: u64,
}

impl Period {
    /// `None`: the clock stands.
    pub fn new(cycles: u64, hz: u64) -> Option<Self> {
        (cycles > 0 && hz > 0).then_some(Self { cycles, hz })
    }

    pub const fn times(self, factor: u64) -> Self {
        Self { cycles: self.cycles * factor, ..self }
    }

    /// Periods a second, to the nearest.
    pub fn rate(self) -> u64 {
        (self.hz + self.cycles / 2) / self.cycles
    }

    /// To the nearest nanosecond.
    pub fn nanos(self) -> u32 {
        let half = u128::from(self.hz / 2);
        let nanos = (u128::from(self.cycles) * NANOS_PER_SECOND + half) / u128::from(self.hz);
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
