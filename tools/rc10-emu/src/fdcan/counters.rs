//! Counters of the model, to judge a driver by: nothing that the chip could report itself.

use rc10_sim::Nanos;

/// A request after a pause longer than this begins a new tick.
const PAUSE_NS: u64 = 500_000;

/// Least, mean and largest of a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spread {
    /// Number of measurements.
    pub count: u64,
    /// The shortest; 0 without a measurement.
    pub min: Nanos,
    /// The longest.
    pub max: Nanos,
    /// All of them together.
    pub sum: Nanos,
}

impl Spread {
    /// The mean, rounded down; 0 without a measurement.
    pub fn mean(&self) -> Nanos {
        Nanos::new(self.sum.get().checked_div(self.count).unwrap_or(0))
    }

    fn add(&mut self, time: Nanos) {
        self.min = if self.count == 0 { time } else { self.min.min(time) };
        self.max = self.max.max(time);
        self.sum = self.sum + time;
        self.count += 1;
    }
}

/// Events of one controller since the model was made; a reset of the block clears nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames stored in FIFO 0 and in FIFO 1.
    pub received: [u64; 2],
    /// Frames that came while FIFO 0, FIFO 1 was full (or had no element at all) and are lost.
    pub lost: [u64; 2],
    /// Oldest frames that FIFO 0, FIFO 1 gave up for newer ones, in overwrite mode.
    pub overwritten: [u64; 2],
    /// Frames stored in dedicated receive buffers.
    pub received_in_buffers: u64,
    /// Frames that the filters stored nowhere.
    pub rejected: u64,
    /// Frames sent and acknowledged.
    pub sent: u64,
    /// The longest time from a request to the start of an acknowledged transmission.
    pub oldest_sent: Nanos,
    /// Transmissions that failed: not acknowledged, or destroyed.
    pub failed: u64,
    /// Requests that ended unsent: cancelled, failed without automatic retransmission, or dropped
    /// when configuration (CCE) or bus monitoring began.
    pub cancelled: u64,
    /// Transmit requests for a buffer that is pending or not configured, or during bus monitoring.
    pub requests_ignored: u64,
    /// Transmit requests for CAN FD frames, which are not modelled: cancelled.
    pub fd_refused: u64,
    /// Transmit events that found no room.
    pub events_lost: u64,
    /// Acknowledged elements that were not in their FIFO: ignored.
    pub bad_acknowledges: u64,
    /// Times it went to bus-off.
    pub bus_offs: u64,
    /// Writes that would have changed a protected bit while it was protected: ignored.
    pub protected_writes: u64,
    /// Time of the last transmit request.
    pub last_request: Option<Nanos>,
    /// The time from one tick's first transmit request to the next's.
    pub tick_period: Spread,
    last_tick: Option<Nanos>,
}

impl Counters {
    pub(super) fn requested(&mut self, now: Nanos) {
        let last = self.last_request.replace(now);
        if last.is_some_and(|last| now.since(last).get() <= PAUSE_NS) {
            return;
        }
        if let Some(tick) = self.last_tick.replace(now) {
            self.tick_period.add(now.since(tick));
        }
    }
}
