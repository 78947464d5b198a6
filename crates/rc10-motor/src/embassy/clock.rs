use rc10_time::{Micros, Schedule, Timing};

/// Length of a tick.
pub(super) const PERIOD: Micros = Micros::from_millis(1);

/// The ticks of a runner: when the next is due, and what its status tells of those before.
#[derive(Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Clock {
    schedule: Schedule,
    last: Option<Micros>,
    /// Starts over: a watchdog must not see it stand still at the largest value.
    pub(super) ticks: u32,
    pub(super) overruns: u32,
    pub(super) period: Timing,
}

impl Clock {
    /// The first tick is due at `first`, and one every [`PERIOD`] from then on.
    pub(super) fn new(first: Micros) -> Self {
        let schedule = Schedule::new(first, PERIOD);
        Self { schedule, last: None, ticks: 0, overruns: 0, period: Timing::new() }
    }

    #[inline]
    pub(super) const fn next(&self) -> Micros {
        self.schedule.next()
    }

    /// A tick happens now. Returns the time since the last one.
    #[inline]
    pub(super) fn tick(&mut self, now: Micros) -> Option<Micros> {
        let start = self.schedule.start(now);
        self.ticks = self.ticks.wrapping_add(1);
        self.overruns = self.overruns.saturating_add(start.missed);
        let elapsed = self.last.replace(now).map(|last| now.since(last));
        if let Some(elapsed) = elapsed {
            self.period.add(elapsed);
        }
        elapsed
    }
}

pub(super) fn now() -> Micros {
    Micros::new(embassy_time::Instant::now().as_micros())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_that_are_late_and_ticks_that_are_missed_are_counted() {
        let mut clock = Clock::new(Micros::from_millis(1));
        assert_eq!(clock.tick(Micros::from_millis(1)), None);
        assert_eq!(clock.tick(Micros::new(2_300)), Some(Micros::new(1_300)));
        // Three periods after the last plan: two of its ticks did not happen.
        assert_eq!(clock.tick(Micros::new(5_100)), Some(Micros::new(2_800)));
        assert_eq!((clock.ticks, clock.overruns), (3, 2));
        assert_eq!((clock.period.min(), clock.period.max()), (Some(1_300), Some(2_800)));
        assert_eq!(clock.next(), Micros::from_millis(6));
    }
}
