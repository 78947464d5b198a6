//! Tracks of a robot's own signals: values of its tasks that a run records beside the motors.

use rc10_time::Micros;

use crate::recording::sample::{Cell, LOOK_PERIOD, Sum};
use crate::robot::signal::Signal;

/// The track of one signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignalTrack {
    /// Label of the signal.
    pub label: &'static str,
    /// Unit of the signal.
    pub unit: &'static str,
    /// The names of the values of a state.
    pub states: &'static str,
    /// Range of the values between two samples; `None` without a value.
    pub samples: Vec<Option<Cell>>,
    /// Newest value; `None` if there is no value at the end.
    pub last: Option<f64>,
    /// Lowest, mean and highest value of the run; `None` without any.
    pub range: Option<[f64; 3]>,
    /// Time without a value.
    pub absent: Micros,
}

#[derive(Clone, Default)]
pub(crate) struct SignalRecorder {
    pub(crate) track: SignalTrack,
    newest: Sum,
    whole: Sum,
}

impl SignalRecorder {
    pub(crate) fn new(signal: &Signal<'_>) -> Self {
        let &Signal { label, unit, states, .. } = signal;
        let track = SignalTrack { label, unit, states, ..SignalTrack::default() };
        Self { track, ..Self::default() }
    }

    /// Takes the value, every [`LOOK_PERIOD`]; one that is not finite counts as no value.
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

    pub(crate) fn sample(&mut self) {
        self.track.samples.push(std::mem::take(&mut self.newest).cell());
    }

    pub(crate) fn finish(self) -> SignalTrack {
        SignalTrack { range: self.whole.range(), ..self.track }
    }
}
