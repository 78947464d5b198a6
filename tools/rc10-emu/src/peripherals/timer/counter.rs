//! The counter: exact to the nanosecond, and cheap however seldom it is read.

use rc10_sim::Nanos;

use super::{ENABLE, ONE_PULSE, Preloaded, Timer, UPDATE, UPDATE_DISABLE, UPDATE_REQUEST_SOURCE};
use crate::time::{periods_in, time_of};

/// CR2.CCDS: requests of compare channels come with updates.
const REQUESTS_AT_UPDATE: u32 = 1 << 3;

impl Timer {
    pub(super) const fn largest(&self) -> u32 {
        u32::MAX >> (32 - self.facts().bits)
    }

    /// Whether time moves it.
    pub(super) const fn runs(&self) -> bool {
        // RM0468, TIMx_ARR: the counter is blocked while the auto-reload value is null.
        self.control & ENABLE != 0
            && self.hz != 0
            && self.reload.in_force != 0
            && !self.is_encoder()
    }

    pub(super) const fn divider(&self) -> u64 {
        self.prescaler.in_force as u64 + 1
    }

    /// Clocks since the anchor, what the prescaler had already counted included.
    pub(super) fn clocks(&self, now: Nanos) -> u64 {
        periods_in(now.since(self.anchor), self.hz).saturating_add(self.phase)
    }

    /// Time of the counter's next tick, counted from the anchor.
    fn time_of(&self, tick: u64) -> Nanos {
        let clocks = u128::from(tick) * u128::from(self.divider());
        self.anchor + time_of(clocks.saturating_sub(u128::from(self.phase)), self.hz)
    }

    /// Counts from `now` on, with what the prescaler has counted so far.
    pub(super) fn rebase(&mut self, now: Nanos) {
        if self.runs() {
            self.phase = self.clocks(now).saturating_sub(self.ticks * self.divider());
        }
        self.anchor = now;
        self.ticks = 0;
    }

    /// Ticks to the next overflow. A counter beyond its reload value runs through all its bits.
    pub(super) fn to_overflow(&self) -> u64 {
        let last = if self.counter <= self.reload.in_force {
            self.reload.in_force
        } else {
            self.largest()
        };
        u64::from(last - self.counter) + 1
    }

    /// Ticks until the counter arrives at a value that it reaches.
    pub(super) fn ticks_to(&self, value: u32) -> u64 {
        if value > self.counter {
            u64::from(value - self.counter)
        } else {
            self.to_overflow() + u64::from(value)
        }
    }

    /// Channels that compare: those that exist and are not set up for capture.
    fn compares(&self) -> impl Iterator<Item = (usize, Preloaded)> + '_ {
        let channels = self.compare.into_iter().enumerate().take(self.facts().channels);
        channels.filter(|&(channel, _)| self.mode(channel) & 3 == 0)
    }

    pub(super) fn arrive(&mut self, at: impl Fn(u32) -> bool) {
        let hits = self.compares().filter(|(_, compare)| at(compare.in_force));
        let channels: u32 = hits.map(|(channel, _)| 1 << channel).sum();
        if channels != 0 {
            self.matched(channels);
            self.raise(channels << 1);
        }
    }

    /// Sets flags, and asks for the transfers that go with them.
    pub(super) const fn raise(&mut self, flags: u32) {
        self.flags |= flags;
        let now = if self.control_2 & REQUESTS_AT_UPDATE != 0 { flags & UPDATE } else { flags };
        self.requests |= now & self.interrupts >> 8;
    }

    pub(in super::super) fn advance(&mut self, now: Nanos) {
        self.capture_tones(now);
        while let Some(at) = self.next_pass().filter(|&at| at <= now) {
            self.count_to(at);
            self.pass_due(at);
        }
        self.count_to(now);
    }

    fn count_to(&mut self, now: Nanos) {
        self.count_clocks(|timer| timer.clocks(now));
    }

    /// Counts up to a number of clocks since the anchor, which may move meanwhile.
    pub(super) fn count_clocks(&mut self, clocks: impl Fn(&Self) -> u64) {
        while self.runs() {
            let total = clocks(self) / self.divider();
            let mut left = total - self.ticks.min(total);
            let anchor = self.anchor;
            while left > 0 && self.anchor == anchor && self.runs() {
                left -= self.count(left);
            }
            if left == 0 {
                return;
            }
        }
    }

    /// Counts up to `ticks` ticks, not beyond an overflow unless the next ones are all alike.
    fn count(&mut self, ticks: u64) -> u64 {
        let (before, to_overflow) = (self.counter, self.to_overflow());
        let steps = ticks.min(to_overflow - 1);
        // Fits: it does not reach the overflow.
        self.counter += u32::try_from(steps).unwrap_or(0);
        let after = self.counter;
        self.arrive(|value| value > before && value <= after);
        self.ticks += steps;
        if ticks == steps {
            return steps;
        }
        self.ticks += 1;
        self.counter = 0;
        self.overflow(self.time_of(self.ticks));
        self.arrive(|value| value == 0);
        let period = u64::from(self.reload.in_force) + 1;
        let whole = (ticks - to_overflow) / period * period;
        // As long as the anchor is the old one.
        let same = self.ticks != 0 && self.control & ONE_PULSE == 0 && !self.waits();
        if !same || whole == 0 {
            return to_overflow;
        }
        let last = self.reload.in_force;
        self.arrive(|value| value <= last);
        self.ticks += whole;
        self.overflow_again(whole / period);
        to_overflow + whole
    }

    /// An overflow: an update, unless it only counts as a repetition.
    pub(super) fn overflow(&mut self, at: Nanos) {
        if let Some(left) = self.repetitions_left.checked_sub(1) {
            self.repetitions_left = left;
            return;
        }
        self.repetitions_left = self.repetitions.written;
        self.update(true, at);
    }

    /// More overflows, while no value waits for an update.
    fn overflow_again(&mut self, overflows: u64) {
        let left = u64::from(self.repetitions_left);
        if overflows <= left {
            // Fits: it is not more than there were.
            self.repetitions_left -= u32::try_from(overflows).unwrap_or(0);
            return;
        }
        let every = u64::from(self.repetitions.written) + 1;
        let beyond = (overflows - left - 1) % every;
        self.repetitions_left = u32::try_from(every - 1 - beyond).unwrap_or(0);
        self.update(true, self.anchor);
    }

    fn waits(&self) -> bool {
        self.control & UPDATE_DISABLE == 0
            && (self.prescaler.waits()
                || self.reload.waits()
                || self.compare.iter().any(|compare| compare.waits()))
    }

    /// An update event: preloaded values come into force.
    pub(super) fn update(&mut self, overflow: bool, at: Nanos) {
        if self.control & UPDATE_DISABLE != 0 {
            return;
        }
        if overflow || self.control & UPDATE_REQUEST_SOURCE == 0 {
            self.raise(UPDATE);
            if self.control_2 & REQUESTS_AT_UPDATE != 0 {
                self.requests |= self.interrupts >> 8 & 0b1_1110;
            }
        }
        self.reload.in_force = self.reload.written;
        for compare in &mut self.compare {
            compare.in_force = compare.written;
        }
        let stops = overflow && self.control & ONE_PULSE != 0;
        if self.prescaler.waits() || stops {
            self.anchor = at;
            self.phase = 0;
            self.ticks = 0;
            self.prescaler.in_force = self.prescaler.written;
        }
        if stops {
            self.control &= !ENABLE;
        }
    }

    /// Time of the next wanted flag, waiting value, passed level, or change of an observed output.
    pub(in super::super) fn next_event(&self) -> Option<Nanos> {
        let passes = self.next_pass().into_iter().chain(self.next_tone()).min();
        if !self.runs() {
            return passes;
        }
        let to_overflow = self.to_overflow();
        // Who has asked already need not ask again.
        let mut wanted = self.interrupts & !self.flags;
        let transfers = self.interrupts >> 8 & !self.requests;
        if self.control_2 & REQUESTS_AT_UPDATE != 0 {
            wanted |= u32::from(transfers & 0b1_1111 != 0);
        } else {
            wanted |= transfers;
        }
        let updates = self.control & UPDATE_DISABLE == 0 && wanted & UPDATE != 0 || self.waits();
        let compares = self.compares().filter(|&(channel, compare)| {
            wanted & 2 << channel != 0 && compare.in_force <= self.reload.in_force
        });
        let ticks = compares.map(|(_, compare)| self.ticks_to(compare.in_force));
        // What waits may change the period.
        let period = u64::from(self.reload.in_force) + 1;
        let to_update = to_overflow + u64::from(self.repetitions_left) * period;
        let ticks = ticks.chain(updates.then_some(to_update)).chain(self.ticks_to_change());
        let counted = ticks.min().map(|ticks| self.time_of(self.ticks + ticks));
        counted.into_iter().chain(passes).min()
    }
}
