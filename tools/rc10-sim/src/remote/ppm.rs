//! Eight channels as pulses one after another on one wire.

use super::Remote;
use super::channels::{AIR_JOY, channels};
use crate::Nanos;
use crate::pulses::PulseDevice;

const PERIOD: Nanos = Nanos::new(22_000_000);
const PULSE: Nanos = Nanos::new(300_000);
const CHANNELS: usize = 8;

/// A PPM receiver: nine pulses every 22 ms while it hears its remote. From the rising edge of one to
/// that of the next is a channel: 1000 us for -1, 2000 us for 1.
#[derive(Debug)]
pub struct Ppm {
    remote: Remote,
    phase: Nanos,
    /// The time at which the frame began, and the number of its edges so far: odd is high.
    began: Nanos,
    edges: usize,
    next: Nanos,
    channels: [Nanos; CHANNELS],
}

impl Ppm {
    /// A receiver that sends its first frame at `phase` after power-on.
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self {
            remote: remote.clone(),
            phase,
            began: Nanos::ZERO,
            edges: 0,
            next: Nanos::ZERO,
            channels: [Nanos::ZERO; CHANNELS],
        }
    }

    fn begin(&mut self, now: Nanos) -> bool {
        let Some(controls) = self.remote.heard() else {
            self.remote.pauses();
            self.next = now + PERIOD;
            return false;
        };
        self.channels = channels(&self.remote.mixer(AIR_JOY), &controls).map(length);
        (self.began, self.edges) = (now, 0);
        let last = self.channels.iter().fold(now, |at, length| at + *length);
        self.remote.sends(true, last);
        true
    }
}

impl PulseDevice for Ppm {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + self.phase;
        self.edges = 0;
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos) -> bool {
        if self.edges == 0 && !self.begin(now) {
            return false;
        }
        self.edges += 1;
        let is_high = !self.edges.is_multiple_of(2);
        self.next = if is_high {
            now + PULSE
        } else if let Some(length) = self.channels.get(self.edges / 2 - 1) {
            now + length.since(PULSE)
        } else {
            self.edges = 0;
            self.began + PERIOD
        };
        is_high
    }
}

/// To the microsecond, as a receiver's timer counts.
#[expect(clippy::cast_possible_truncation, reason = "1000 ..= 2000")]
fn length(deflection: f64) -> Nanos {
    Nanos::new(1000 * (1500.0 + 500.0 * deflection.clamp(-1.0, 1.0)).round() as u64)
}
