//! The controller behind [`SimPort`](crate::SimPort).

use std::collections::VecDeque;

use rc10_can::{BusError, CanFrame, ErrorState, Health, Mailboxes, Queued, Submitted};
use rc10_time::Micros;

use crate::wire::urgency;
use crate::{Activity, Controller, Nanos, Outcome};

/// Transmit buffers (STM32H7 FDCAN: 32 dedicated ones).
const MAILBOXES: usize = 32;
/// Fault confinement, ISO 11898-1: what a failed transmission adds to the transmit error counter,
/// and the bounds of the error states.
const FAILED_TRANSMISSION: u16 = 8;
const ERROR_WARNING: u16 = 96;
const ERROR_PASSIVE: u16 = 128;
const BUS_OFF: u16 = 256;
/// ISO 11898-1: back on the bus after this many sequences of this many recessive bits.
const RECOVERY_SEQUENCES: u64 = 128;
const RECESSIVE_BITS: u64 = 11;

/// Mailboxes, a receive queue, and fault confinement.
#[derive(Default)]
pub(crate) struct Host {
    mailboxes: Mailboxes<MAILBOXES>,
    /// A frame whose last attempt failed. It keeps its transmit buffer, as in the real controller:
    /// no room has to be found for it.
    retry: Option<Queued>,
    /// The frame on the wire, while one is.
    sending: Option<Queued>,
    /// The frame on the wire is not to be repeated: it was cancelled, or a newer one waits.
    stale: bool,
    pub(crate) received: VecDeque<(CanFrame, Micros)>,
    capacity: usize,
    /// Its error counters and state follow from the two below.
    pub(crate) health: Health,
    transmit_errors: u16,
    receive_errors: u16,
    /// Length of [`RECESSIVE_BITS`] in nanoseconds.
    sequence_ns: u64,
    idle_since: Option<Nanos>,
    /// Sequences of recessive bits that are missing, while it recovers from bus-off.
    missing: Option<u64>,
}

impl Host {
    pub(crate) fn new(capacity: usize, bit_time_ns: u64) -> Self {
        Self { capacity, sequence_ns: RECESSIVE_BITS * bit_time_ns, ..Self::default() }
    }

    pub(crate) fn submit(&mut self, queued: Queued) -> Submitted {
        if !self.is_on_bus() && self.missing.is_none() {
            return Submitted::Refused;
        }
        let of_stream = |other: &Queued| other.stream == queued.stream;
        let replaces_retry = self.retry.as_ref().is_some_and(of_stream);
        let submitted = self.mailboxes.put(queued);
        if submitted == Submitted::Refused {
            if !replaces_retry {
                return Submitted::Refused;
            }
            // The failed frame's own buffer takes the newer one.
            self.retry = Some(queued);
            return Submitted::Replaced;
        }
        if self.sending.as_ref().is_some_and(of_stream) {
            self.stale = true;
        }
        if replaces_retry {
            self.retry = None;
            return Submitted::Replaced;
        }
        submitted
    }

    pub(crate) fn cancel_pending(&mut self) -> u8 {
        self.stale = true;
        self.mailboxes.clear() + u8::from(self.retry.take().is_some())
    }

    /// Starts the way back from bus-off; nothing otherwise, or if it is on the way already.
    pub(crate) fn recover(&mut self, now: Nanos) {
        if self.is_on_bus() || self.missing.is_some() {
            return;
        }
        self.cancel_pending();
        self.missing = Some(RECOVERY_SEQUENCES);
        self.idle_since = self.idle_since.map(|_| now);
    }

    fn peek(&self) -> Option<&Queued> {
        self.retry.iter().chain(self.mailboxes.peek()).min_by_key(|queued| urgency(&queued.frame))
    }

    fn count(&mut self, transmit_errors: u16, receive_errors: u16) {
        self.transmit_errors = transmit_errors;
        self.receive_errors = receive_errors.min(ERROR_PASSIVE);
        let before = self.health.state;
        self.health.state = match transmit_errors.max(self.receive_errors) {
            BUS_OFF.. => ErrorState::BusOff,
            ERROR_PASSIVE.. => ErrorState::Passive,
            ERROR_WARNING.. => ErrorState::Warning,
            _ => ErrorState::Active,
        };
        if self.health.state == ErrorState::BusOff && before != ErrorState::BusOff {
            self.health.bus_offs = self.health.bus_offs.saturating_add(1);
            let unsent = self.cancel_pending();
            self.health.transmit_lost = self.health.transmit_lost.saturating_add(unsent.into());
        }
        self.health.transmit_errors = u8::try_from(transmit_errors).unwrap_or(u8::MAX);
        self.health.receive_errors =
            u8::try_from(self.receive_errors.min(ERROR_PASSIVE - 1)).unwrap_or(u8::MAX);
    }

    /// The transmission ended without success: it is repeated, unless it is stale.
    fn failed(&mut self, error: BusError) {
        let frame = self.sending.take();
        if !self.stale {
            self.retry = frame;
        }
        self.health.last_error = Some(error);
        // An error-passive sender that only misses its acknowledge counts no further.
        if error != BusError::Acknowledge || self.health.state < ErrorState::Passive {
            self.count(self.transmit_errors + FAILED_TRANSMISSION, self.receive_errors);
        }
    }
}

impl Controller for Host {
    fn is_on_bus(&self) -> bool {
        self.health.state != ErrorState::BusOff
    }

    fn offer(&mut self, _now: Nanos) -> Option<CanFrame> {
        self.peek().map(|queued| queued.frame)
    }

    fn sending(&mut self, _start: Nanos) {
        self.sending = self.peek().copied();
        if self.retry == self.sending {
            self.retry = None;
        } else {
            self.mailboxes.pop();
        }
        self.stale = false;
    }

    fn sent(&mut self, outcome: Outcome, _end: Nanos) {
        match outcome {
            Outcome::Acknowledged => {
                self.sending = None;
                self.count(self.transmit_errors.saturating_sub(1), self.receive_errors);
            }
            Outcome::Unacknowledged => self.failed(BusError::Acknowledge),
            Outcome::Destroyed(error) => self.failed(error),
        }
    }

    fn received(&mut self, frame: &CanFrame, start: Nanos, _end: Nanos) {
        // ISO 11898-1: an error-passive receiver comes back to 119 ..= 127; here to 127.
        self.count(self.transmit_errors, self.receive_errors.saturating_sub(1));
        if self.received.len() < self.capacity {
            self.received.push_back((*frame, start.micros()));
        } else {
            self.health.receive_lost = self.health.receive_lost.saturating_add(1);
        }
    }

    fn disturbed(&mut self, error: BusError, _at: Nanos) {
        self.health.last_error = Some(error);
        self.count(self.transmit_errors, self.receive_errors + 1);
    }

    fn wire_is(&mut self, activity: Activity, at: Nanos) {
        let counted = match (activity, self.idle_since) {
            // The end of a frame is one sequence.
            (Activity::Idle, _) => 1,
            (Activity::Busy, Some(since)) => at.since(since).get() / self.sequence_ns,
            (Activity::Busy, None) => 0,
        };
        self.missing = self.missing.map(|missing| missing.saturating_sub(counted));
        self.idle_since = (activity == Activity::Idle).then_some(at);
        self.advance(at);
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.idle_since? + Nanos::new(self.missing? * self.sequence_ns))
    }

    fn advance(&mut self, now: Nanos) {
        if self.next_event().is_some_and(|recovered| recovered <= now) {
            self.missing = None;
            self.count(0, 0);
        }
    }
}
