//! Periods of clocks, and time.

use rc10_sim::Nanos;

const NANOS_PER_SECOND: u128 = 1_000_000_000;

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
