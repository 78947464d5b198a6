//! Capture of the chip's own clocks, in exact numbers: no edge is an event of its own. The filter's
//! delay is left out; the input counts only in capture of channel 1 (CC1S = 1).

use rc10_sim::Nanos;

use super::super::clocks::{Tone, Tones};
use super::Timer;
use crate::time::time_of;

const NANOS_PER_SECOND: u128 = 1_000_000_000;

/// Channel 1 listening to a clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Listener {
    tone: Tone,
    /// Edges that make one capture (`IC1PSC`), and half periods that make one edge.
    every: u64,
    halves: u64,
    /// From when on edges are counted; the first comes a period later.
    since: Nanos,
    captures: u64,
}

impl Listener {
    /// Time of a capture since `since`, in 1 / (2 hz) of a second.
    const fn half_periods(&self, capture: u64) -> u128 {
        capture as u128 * self.every as u128 * self.halves as u128 * self.tone.divider as u128
    }

    fn captures_at(&self, now: Nanos) -> u64 {
        let halves = u128::from(now.since(self.since).get()) * 2 * u128::from(self.tone.hz);
        let captures = halves / NANOS_PER_SECOND / self.half_periods(1);
        u64::try_from(captures).unwrap_or(u64::MAX)
    }

    /// First nanosecond at which a capture is over.
    fn time_of(&self, capture: u64) -> Nanos {
        self.since + time_of(self.half_periods(capture), 2 * self.tone.hz)
    }
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
        let every = 1 << (self.mode(0) >> 2 & 3);
        let halves = if self.outputs & 0b1010 == 0b1010 { 1 } else { 2 };
        let wanted = tone.filter(|_| listens).map(|tone| (tone, every, halves));
        if self.listener.map(|old| (old.tone, old.every, old.halves)) != wanted {
            self.listener = wanted.map(|(tone, every, halves)| Listener {
                tone,
                every,
                halves,
                since: now,
                captures: 0,
            });
        }
    }

    /// Captures that are due: all at once, as only the last one's value is left.
    pub(super) fn capture_tones(&mut self, now: Nanos) {
        let Some(listener) = self.listener else { return };
        let captures = listener.captures_at(now);
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
        // In 1 / (2 hz of the tone) of a nanosecond.
        let scale = 2 * u128::from(listener.tone.hz);
        let at = u128::from(listener.since.get()) * scale
            + listener.half_periods(capture) * NANOS_PER_SECOND;
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
        is_wanted.then(|| listener.time_of(listener.captures + 1))
    }
}
