//! Integer time: a count of microseconds, the grid of a periodic task, and its measured periods.
//!
//! * [`Micros`]: time, or a length of time, in whole microseconds.
//! * [`Schedule`]: when a periodic task is to start, and by how much it is late.
//! * [`Timing`]: shortest, mean and longest of measured durations.
//!
//! The crate has no clock, no I/O and no allocation.
#![no_std]
#![forbid(unsafe_code)]

use core::fmt;
use core::ops::{Add, AddAssign, Sub};

/// Time, or a length of time, in whole microseconds since a start that all share.
///
/// 64 bits last 584,000 years: nothing wraps, and a difference is exact after any uptime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Micros(u64);

impl Micros {
    /// The start of time, or no time at all.
    pub const ZERO: Self = Self(0);

    /// A number of microseconds.
    #[inline]
    #[must_use]
    pub const fn new(micros: u64) -> Self {
        Self(micros)
    }

    /// A number of milliseconds.
    #[inline]
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis * 1000)
    }

    /// The number of microseconds.
    #[inline]
    #[must_use]
    pub const fn get(self) -> u64 {
        self.0
    }

    /// Time since `earlier`; zero if that is not earlier.
    #[inline]
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

impl Add for Micros {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        // Cannot happen to real times; wrapping costs nothing and never panics.
        Self(self.0.wrapping_add(other.0))
    }
}

impl AddAssign for Micros {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Micros {
    type Output = Self;
    /// Like [`Micros::since`]: never below zero.
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.since(other)
    }
}

impl fmt::Display for Micros {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:06} s", self.0 / 1_000_000, self.0 % 1_000_000)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Micros {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=u64:us}", self.0);
    }
}

/// A drift-free plan: starts are whole periods after the first; the caller has the clock.
///
/// ```
/// use rc10_time::{Micros, Schedule};
/// let mut plan = Schedule::new(Micros::new(1_000), Micros::new(1_000));
/// // Woken late by 1.2 periods: one start was missed, the next one is on the grid again.
/// let start = plan.start(Micros::new(2_200));
/// assert_eq!((start.late.get(), start.missed), (1_200, 1));
/// assert_eq!(plan.next(), Micros::new(3_000));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Schedule {
    next: Micros,
    period: Micros,
}

/// Result of [`Schedule::start`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Start {
    /// Delay of the start of the work after its planned time.
    pub late: Micros,
    /// Planned starts that were skipped because their time had gone by too.
    pub missed: u32,
}

impl Schedule {
    /// First start at `first`, then one every `period` (at least 1 µs).
    #[must_use]
    pub fn new(first: Micros, period: Micros) -> Self {
        Self { next: first, period: period.max(Micros::new(1)) }
    }

    /// Time of the next planned start.
    #[inline]
    #[must_use]
    pub const fn next(&self) -> Micros {
        self.next
    }

    /// The planned time between two starts.
    #[inline]
    #[must_use]
    pub const fn period(&self) -> Micros {
        self.period
    }

    /// The work starts now. Starts whose time has gone by entirely are skipped and counted.
    pub fn start(&mut self, now: Micros) -> Start {
        let late = now.since(self.next);
        self.next += self.period;
        if late < self.period {
            return Start { late, missed: 0 };
        }
        let missed = late.get() / self.period.get();
        self.next += Micros::new(missed.saturating_mul(self.period.get()));
        Start { late, missed: u32::try_from(missed).unwrap_or(u32::MAX) }
    }
}

/// Smallest, mean and largest of a series of durations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Timing {
    count: u32,
    min: u32,
    max: u32,
    sum: u64,
}

impl Timing {
    /// Nothing measured yet.
    pub const fn new() -> Self {
        Self { count: 0, min: u32::MAX, max: 0, sum: 0 }
    }

    /// Number, shortest, longest and sum of the measurements: what it consists of, to be kept elsewhere.
    #[must_use]
    pub fn parts(&self) -> [u64; 4] {
        [self.count.into(), self.min.into(), self.max.into(), self.sum]
    }

    /// The same again, of its [`parts`](Self::parts).
    pub fn from_parts([count, min, max, sum]: [u64; 4]) -> Self {
        let short = |part: u64| u32::try_from(part).unwrap_or(u32::MAX);
        Self { count: short(count), min: short(min), max: short(max), sum }
    }

    /// Adds one duration; more than 71 minutes counts as 71 minutes.
    #[inline]
    pub fn add(&mut self, duration: Micros) {
        let micros = u32::try_from(duration.get()).unwrap_or(u32::MAX);
        self.count = self.count.saturating_add(1);
        self.min = self.min.min(micros);
        self.max = self.max.max(micros);
        self.sum = self.sum.saturating_add(u64::from(micros));
    }

    /// Number of measurements.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// The smallest, in microseconds; `None` before the first.
    #[must_use]
    pub fn min(&self) -> Option<u32> {
        (self.count > 0).then_some(self.min)
    }

    /// The largest, in microseconds; `None` before the first.
    #[must_use]
    pub fn max(&self) -> Option<u32> {
        (self.count > 0).then_some(self.max)
    }

    /// The mean, in microseconds; `None` before the first.
    #[must_use]
    pub fn mean(&self) -> Option<f32> {
        #[expect(clippy::cast_precision_loss, reason = "a mean for people")]
        (self.count > 0).then(|| self.sum as f32 / self.count as f32)
    }
}

impl Default for Timing {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_starts_do_not_move_the_grid() {
        let mut plan = Schedule::new(Micros::ZERO, Micros::new(1000));
        let mut missed = 0;
        for now in [0, 1999, 2000, 3500, 4001, 9999] {
            missed += plan.start(Micros::new(now)).missed;
            assert_eq!(plan.next().get() % 1000, 0);
            assert!(plan.next().get() > now);
        }
        // Of the ten starts 0 ..= 9000 six happened.
        assert_eq!(missed, 4);
    }

    #[test]
    fn timing_of_nothing_is_nothing() {
        let mut timing = Timing::new();
        assert_eq!((timing.min(), timing.mean(), timing.max()), (None, None, None));
        timing.add(Micros::new(10));
        timing.add(Micros::new(20));
        assert_eq!((timing.min(), timing.mean(), timing.max()), (Some(10), Some(15.0), Some(20)));
    }
}
