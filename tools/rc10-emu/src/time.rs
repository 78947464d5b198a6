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

/// A time, as periods of a clock go by: exact, to the fraction of a nanosecond.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lapse {
    /// The time before the periods, ..
    since: u64,
    /// .. with so much of a nanosecond, in units of 1/rate.
    fraction: u64,
    /// Periods a second.
    rate: u64,
    /// Periods that have gone by.
    pub periods: u64,
}

impl Lapse {
    pub const fn new(rate: u64) -> Self {
        Self { since: 0, fraction: 0, rate, periods: 0 }
    }

    /// Nanoseconds, and what is left in units of 1/rate.
    #[expect(clippy::cast_possible_truncation, reason = "centuries of nanoseconds")]
    const fn parts(&self) -> (u64, u64) {
        let (rate, units) = (self.rate as u128, self.periods as u128 * NANOS_PER_SECOND);
        let units = units + self.fraction as u128;
        (self.since + (units / rate) as u64, (units % rate) as u64)
    }

    pub const fn now(&self) -> u64 {
        self.parts().0
    }

    /// Goes on with periods of this rate; the fraction becomes one of it.
    pub const fn count_in(&mut self, rate: u64) {
        let (since, fraction) = self.parts();
        #[expect(clippy::cast_possible_truncation, reason = "less than the rate")]
        let fraction = (fraction as u128 * rate as u128 / self.rate as u128) as u64;
        *self = Self { since, fraction, rate, periods: 0 };
    }

    /// Lets `count` periods of a rate go by.
    #[inline]
    pub const fn pass(&mut self, count: u64, rate: u64) {
        if rate != self.rate {
            self.count_in(rate);
        }
        self.periods += count;
    }

    /// Nothing goes by until a time.
    pub const fn wait_until(&mut self, at: u64) {
        let (_, fraction) = self.parts();
        (self.since, self.fraction, self.periods) = (at, fraction, 0);
    }

    /// The number of periods with which a time is reached.
    pub fn periods_at(&self, at: u64) -> u64 {
        let units = u128::from(at.saturating_sub(self.since)) * u128::from(self.rate);
        let left = units.saturating_sub(u128::from(self.fraction)).div_ceil(NANOS_PER_SECOND);
        u64::try_from(left).unwrap_or(u64::MAX)
    }
}
