//! Signals of a robot's own: values of its tasks that a run records beside the motors.
//!
//! [`Robot::signal`](crate::world::robot::Robot::signal) names one. It is read every millisecond, and appears in the
//! table, the JSON and the report of `rc10 run`.

use rc10_can::Micros;

use crate::recording::sample::{Cell, LOOK_PERIOD, Sum};
use crate::robot::signal::Signal;

/// The track of one signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignalTrack {
    /// Label of the signal.
    pub label: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The names of its values, if it is a state.
    pub states: &'static str,
    /// Its values between two samples; `None` where it had none.
    pub samples: Vec<Option<Cell>>,
    /// The newest value; `None` if it has none at the end.
    pub last: Option<f64>,
    /// Lowest, mean and highest value of the run; `None` if it never had one.
    pub range: Option<[f64; 3]>,
    /// Time without a value.
    pub absent: Micros,
}

/// Records one signal.
#[derive(Clone, Default)]
pub(crate) struct SignalRecorder {
    track: SignalTrack,
    /// Since the last sample.
    newest: Sum,
    whole: Sum,
}

impl SignalRecorder {
    pub(crate) fn new(signal: &Signal<'_>) -> Self {
        let &Signal { label, unit, states, .. } = signal;
        Self {
            track: SignalTrack { label, unit, states, ..SignalTrack::default() },
            ..Self::default()
        }
    }

    /// Takes its value: every [`LOOK_PERIOD`]. One that is not finite is none.
    pub(crate) fn look(&mut self, value: Option<f64>) {
        self.track.last = value.filter(|value| value.is_finite());
        match self.track.last {
            Some(value) => {
                self.newest.add(value);
                self.whole.add(value);
            }
            None => self.track.absent += LOOK_PERIOD,
        }
    }

    /// Its label and unit, and its newest value.
    pub(crate) const fn newest(&self) -> (&'static str, &'static str, Option<f64>) {
        (self.track.label, self.track.unit, self.track.last)
    }

    pub(crate) fn sample(&mut self) {
        self.track.samples.push(std::mem::take(&mut self.newest).cell());
    }

    pub(crate) fn finish(self) -> SignalTrack {
        SignalTrack { range: self.whole.range(), ..self.track }
    }
}
