//! Signals of a robot's own: values of its tasks that a run records beside the motors.
//!
//! [`Robot::signal`](crate::Robot::signal) names one. It is read every millisecond, and appears in the
//! table, the JSON and the report of `rc10 run`.

use std::rc::Rc;

use rc10_can::Micros;
use serde_json::{Value, json};

use crate::figures::{Entry, Table, number, words};
use crate::recording::{Cell, LOOK_PERIOD, Recording, Sum};

/// A signal: its label, its unit, and a function that reads it.
#[derive(Clone)]
pub struct Signal<'r> {
    /// Label of the signal. Signals of one unit whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// Its unit, such as "mm"; empty if it has none.
    pub unit: &'static str,
    /// If it is a state: the names of its values from 0 on, with commas between.
    pub states: &'static str,
    /// Its value at a time; `None` while it has none.
    pub read: Rc<dyn Fn(Micros) -> Option<f64> + 'r>,
}

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

/// A line per signal; `None` for a robot without any.
#[must_use]
pub fn signal_table(recording: &Recording) -> Option<Table> {
    let row = |track: &SignalTrack| {
        let unit = if track.unit.is_empty() { String::new() } else { format!(" {}", track.unit) };
        let state = |value: f64| track.states.split(',').nth(value as usize).unwrap_or_default();
        let value = |value: Option<f64>| match value {
            Some(value) if !track.states.is_empty() => words(state(value)),
            value => number(value, 2, &unit),
        };
        let [lowest, mean, highest] = match track.range {
            Some(range) => range.map(Some),
            None => [None; 3],
        };
        let absent = (track.absent > Micros::ZERO).then(|| crate::problems::seconds(track.absent));
        vec![
            words(track.label),
            value(track.last),
            value(lowest),
            value(mean.filter(|_| track.states.is_empty())),
            value(highest),
            number(absent, 3, " s"),
        ]
    };
    let rows: Vec<Vec<Entry>> = recording.signals.iter().map(row).collect();
    let head = vec!["signal", "at the end", "lowest", "mean", "highest", "without a value"];
    (!rows.is_empty()).then_some(Table { head, words: 1, rows })
}

/// The signals as JSON.
#[must_use]
pub fn signals_json(recording: &Recording) -> Value {
    let signal = |track: &SignalTrack| {
        let of = |index: usize| track.range.map(|range| range[index]);
        json!({
            "signal": track.label,
            "unit": track.unit,
            "last": track.last,
            "lowest": of(0),
            "mean": of(1),
            "highest": of(2),
            "absent_us": track.absent.get(),
        })
    };
    recording.signals.iter().map(signal).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_has_its_range_and_the_time_without_a_value() {
        let signal = Signal { label: "wall", unit: "mm", states: "", read: Rc::new(|_| None) };
        let mut recorder = SignalRecorder::new(&signal);
        let values = [Some(1.0), Some(4.0), None, Some(-2.0), Some(f64::NAN), Some(f64::INFINITY)];
        for pair in values.chunks(2) {
            pair.iter().for_each(|value| recorder.look(*value));
            recorder.sample();
        }
        let track = recorder.finish();
        let cell = |min, mean, max| Some(Cell { min, mean, max });
        assert_eq!(track.samples, [cell(1.0, 2.5, 4.0), cell(-2.0, -2.0, -2.0), None]);
        assert_eq!((track.last, track.range), (None, Some([-2.0, 1.0, 4.0])));
        assert_eq!(track.absent, Micros::from_millis(3));
        let recording = Recording { signals: vec![track], ..Recording::default() };
        let text = signal_table(&recording).unwrap().text();
        let line: Vec<&str> = text.lines().nth(1).unwrap().split_whitespace().collect();
        assert_eq!(line.join(" "), "wall – -2.00 mm 1.00 mm 4.00 mm 0.003 s");
        let json = signals_json(&recording);
        assert_eq!((&json[0]["lowest"], &json[0]["last"]), (&json!(-2.0), &Value::Null));
        assert_eq!(json[0]["absent_us"], 3000);
    }

    #[test]
    fn a_robot_without_signals_has_no_table() {
        assert!(signal_table(&Recording::default()).is_none());
        assert_eq!(signals_json(&Recording::default()), json!([]));
    }
}
