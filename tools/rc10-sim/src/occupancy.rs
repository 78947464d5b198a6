//! The share of time in which a wire was busy.

use std::iter;

use crate::Nanos;

/// Length of the windows of [`Bus::load_windows`](crate::Bus::load_windows), in nanoseconds.
const WINDOW: u64 = 100_000_000;

/// Busy nanoseconds since a time: in total, and in each window.
pub(crate) struct Occupancy {
    start: Nanos,
    total: u64,
    windows: Vec<u64>,
}

impl Occupancy {
    pub(crate) const fn since(start: Nanos) -> Self {
        Self { start, total: 0, windows: Vec::new() }
    }

    pub(crate) fn add(&mut self, since: Nanos, until: Nanos) {
        let [mut since, until] = [since, until].map(|time| time.since(self.start).get());
        self.total += until - since;
        while since < until {
            let window = since / WINDOW;
            let end = until.min((window + 1) * WINDOW);
            if let Ok(index) = usize::try_from(window) {
                if self.windows.len() <= index {
                    self.windows.resize(index + 1, 0);
                }
                self.windows[index] += end - since;
            }
            since = end;
        }
    }

    /// Per cent of the time.
    pub(crate) fn load(&self, now: Nanos) -> f64 {
        let all = now.since(self.start);
        if all == Nanos::ZERO {
            return 0.0;
        }
        self.total as f64 * 100.0 / all.get() as f64
    }

    /// Per cent of each window that is over.
    pub(crate) fn windows(&self, now: Nanos) -> Vec<f64> {
        let over = 0..now.since(self.start).get() / WINDOW;
        let busy = self.windows.iter().copied().chain(iter::repeat(0));
        over.zip(busy).map(|(_, busy)| busy as f64 * 100.0 / WINDOW as f64).collect()
    }
}
