//! Joining the traffic on the wire by counting recessive bits.

use rc10_sim::{Activity, Nanos};

use crate::time::Period;

/// Recessive bits in a row that mean an idle bus (ISO 11898-1), or a step of bus-off recovery.
const SEQUENCE_BITS: u64 = 11;

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum State {
    /// CCCR.INIT is set.
    #[default]
    Stopped,
    Waiting {
        sequences: u64,
        /// Recessive bits from here on are not part of a counted sequence.
        counted_to: Nanos,
    },
    Joined,
}

/// A controller's view of the wire, and whether it takes part.
#[derive(Default)]
pub(super) struct Link {
    state: State,
    pub busy: bool,
    busy_since: Nanos,
}

impl Link {
    pub const fn start(&mut self, sequences: u64, now: Nanos) {
        self.state = State::Waiting { sequences, counted_to: now };
    }

    pub const fn stop(&mut self) {
        self.state = State::Stopped;
    }

    pub fn is_joined(&self) -> bool {
        self.state == State::Joined
    }

    /// The wire has changed; settled up to `at`.
    pub fn wire_is(&mut self, activity: Activity, at: Nanos, bit: Option<Period>) {
        match activity {
            Activity::Busy => {
                self.busy = true;
                self.busy_since = at;
            }
            Activity::Idle => {
                self.busy = false;
                let Some(bit) = bit else { return };
                // A frame ends in ACK delimiter, end-of-frame and interframe space, an error in
                // its delimiter and the interframe space: one sequence each.
                let recessive = Nanos::new(at.get().saturating_sub(bit.many(SEQUENCE_BITS).get()));
                let recessive = recessive.max(self.busy_since);
                if let State::Waiting { counted_to, .. } = &mut self.state {
                    *counted_to = (*counted_to).max(recessive);
                }
            }
        }
    }

    /// Counts up to now; how many sequences have ended since the last time.
    pub fn settle(&mut self, now: Nanos, bit: Period) -> u64 {
        let State::Waiting { sequences, counted_to } = &mut self.state else { return 0 };
        if self.busy {
            return 0;
        }
        let seen = (bit.count_in(now.since(*counted_to)) / SEQUENCE_BITS).min(*sequences);
        *counted_to = *counted_to + bit.many(seen * SEQUENCE_BITS);
        *sequences -= seen;
        if *sequences == 0 {
            self.state = State::Joined;
        }
        seen
    }

    /// Time at which it joins if the wire stays recessive.
    pub fn next_event(&self, bit: Period) -> Option<Nanos> {
        match self.state {
            State::Waiting { sequences, counted_to } if !self.busy => {
                Some(counted_to + bit.many(sequences * SEQUENCE_BITS))
            }
            _ => None,
        }
    }
}
