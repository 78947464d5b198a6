//! Capture of the chip's own clocks, in exact numbers: no edge is an event of its own. The filter's
//! delay is left out; the input counts only in capture of channel 1 (CC1S = 1).

use rc10_sim::Nanos;

use super::super::clocks::Tones;
use super::Timer;
use crate::time::{NANOS_PER_SECOND, Period};

/// Channel 1 listening to a clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Listener {
    /// From capture to capture.
    period: Period,
    /// From when on edges are counted; the first capture comes a period later.
    since: Nanos,
    captures: u64,
}

impl Timer {
    pub(in super::super) fn set_tones(&mut self, tones: Tones, now: Nanos) {
        if tones != self.tones && !self.facts().tones.is_empty() {
            self.advance(now);
            self.tones = tones;
            self.listen(now);
        }
    }

    /// The clock that TISEL selects; `None`: the pin, or nothing.
    pub(super) fn source(&self) -> Option<usize> {
        let index = (self.input_select as usize).checked_sub(1)?;
        self.facts().tones.get(index).copied()
    }

    /// Begins to listen, goes on, or stops, as the registers say now.
    pub(super) fn listen(&mut self, now: Nanos) {
        let tone = self.source().and_then(|source| self.tones[source]);
        // CC1S = 1; CC1NP, CC1P both: both edges.
        let listens = self.mode(0) & 3 == 1 && self.captures(0);
        // IC1PSC: edges that make one capture.
        let every = 1 << (self.mode(0) >> 2 & 3);
        let halves = if self.outputs & 0b1010 == 0b1010 { 1 } else { 2 };
        let of_halves = |tone: Period| Period { hz: 2 * tone.hz, ..tone }.times(every * halves);
        let wanted = tone.filter(|_| listens).map(of_halves);
        if self.listener.map(|old| old.period) != wanted {
            self.listener = wanted.map(|period| Listener { period, since: now, captures: 0 });
        }
    }

    /// Captures that are due: all at once, as only the last one's value is left.
    pub(super) fn capture_tones(&mut self, now: Nanos) {
        let Some(listener) = self.listener else { return };
        let captures = listener.period.count_in(now.since(listener.since));
        if captures == listener.captures {
            return;
        }
        if captures > listener.captures + 1 {
            // No time to read the one before.
            self.capture(0);
        }
        self.count_clocks(|timer| timer.clocks_at(&listener, captures));
        self.capture(0);
        self.listener = Some(Listener { captures, ..listener });
    }

    /// Clocks since the anchor at a capture, what the prescaler had counted included.
    fn clocks_at(&self, listener: &Listener, capture: u64) -> u64 {
        // In 1 / hz of a nanosecond.
        let Period { cycles, hz } = listener.period;
        let scale = u128::from(hz);
        let at = u128::from(listener.since.get()) * scale
            + u128::from(capture) * u128::from(cycles) * NANOS_PER_SECOND;
        let since = at.saturating_sub(u128::from(self.anchor.get()) * scale);
        let clocks = since * u128::from(self.hz) / (NANOS_PER_SECOND * scale);
        u64::try_from(clocks).unwrap_or(u64::MAX).saturating_add(self.phase)
    }

    /// Time of the next capture that an interrupt or a DMA waits for.
    pub(super) fn next_tone(&self) -> Option<Nanos> {
        let listener = self.listener?;
        // CC1IE, CC1DE.
        let is_wanted = self.interrupts & !self.flags & 2 != 0
            || self.interrupts >> 8 & !self.requests & 2 != 0;
        is_wanted.then(|| listener.since + listener.period.many(listener.captures + 1))
    }
}
