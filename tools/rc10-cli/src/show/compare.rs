//! Two runs beside each other: which figures of the motors are better, and which are worse.

use serde_json::{Value, json};

use crate::recording::sample::{SAMPLE_PERIOD, seconds};
use crate::recording::{MotorTrack, Recording};
use crate::show::figures::{Entry, Figures, MotorFigures, Table, number, unit, words};

/// Longest delay that is looked for, in samples: 0.5 s.
const LATEST: usize = 50;
/// Share of the larger of two figures up to which they are alike.
const ALIKE: f64 = 0.05;

/// A run beside an earlier one.
pub struct Comparison {
    /// Name of the earlier run's file.
    pub name: String,
    /// The earlier run.
    pub before: Recording,
    /// Figures that differ, the largest difference first.
    pub differences: Vec<Difference>,
    /// Number of figures that are alike.
    pub alike: usize,
    /// Labels of motors that only one of the runs has.
    pub alone: Vec<&'static str>,
}

/// A figure of a motor that differs.
pub struct Difference {
    /// Label of the motor.
    pub label: &'static str,
    /// The figure.
    pub what: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The figure in the earlier run, and in this one.
    pub values: [f64; 2],
    /// Whether it is better in this one.
    pub is_better: bool,
}

/// A figure: its name, its unit, its value, the difference that does not count, and whether more of it is better.
type Figure = (&'static str, &'static str, Option<f64>, f64, bool);

fn figures_of(track: &MotorTrack, figures: &MotorFigures) -> [Figure; 5] {
    let longest = figures.tracking.first();
    let counters = track.last.counters;
    let lost = u64::from(counters.lost) + u64::from(counters.malformed) + track.overwritten;
    let margins = track.effort.as_ref().and_then(|effort| effort.margins);
    [
        (
            "RMS error",
            longest.map_or("", |it| unit(it.kind)),
            longest.map(|it| it.rms()),
            0.02,
            false,
        ),
        ("peak current", "A", figures.peak_current, 0.05, false),
        ("gain margin", "", margins.map(|it| it.speed.min(it.angle)), 0.1, true),
        ("late by", "ms", late(track), 15.0, false),
        ("lost frames", "", Some(lost as f64), 0.5, false),
    ]
}

/// The delay in ms with which the measurement fits its target best; `None` if none fits clearly better.
fn late(track: &MotorTrack) -> Option<f64> {
    let cost = |delay: usize| {
        let pairs = track.samples.iter().zip(track.samples.get(delay..)?);
        let errors = pairs.filter_map(|(then, now)| {
            let is_same = then.kind == now.kind && now.target.is_some();
            Some(then.target.filter(|_| is_same)? - now.measured)
        });
        let (count, sum) = errors.fold((0, 0.0), |(count, sum), it| (count + 1, sum + it * it));
        (count > LATEST).then(|| sum / f64::from(count as u32))
    };
    let costs = (0..=LATEST).filter_map(|delay| Some((delay, cost(delay)?)));
    let (delay, least) = costs.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let millis = delay as f64 * seconds(SAMPLE_PERIOD) * 1e3;
    Some(millis).filter(|_| cost(0).is_some_and(|at_once| delay == 0 || at_once > 1.2 * least))
}

impl Comparison {
    /// Compares a run with an earlier one, of the same robot or another.
    pub fn new(now: (&Recording, &Figures), name: String, before: Recording) -> Self {
        let earlier = Figures::of(&before);
        let is_heard = |track: &&MotorTrack| track.last.counters.received > 0;
        let (mut differences, mut alone, mut alike) = (Vec::new(), Vec::new(), 0);
        for (track, figures) in now.0.motors.iter().zip(&now.1.motors) {
            let label = track.motor.label;
            let mut others = before.motors.iter().zip(&earlier.motors);
            let other = others.find(|(other, _)| other.motor.label == label);
            let Some((other, others)) =
                other.filter(|(other, _)| is_heard(other) && is_heard(&track))
            else {
                alone.push(label);
                continue;
            };
            let pairs = figures_of(other, others).into_iter().zip(figures_of(track, figures));
            for ((_, unit_before, then, ..), (what, unit, value, least, more)) in pairs {
                let (Some(then), Some(value)) = (then, value) else { continue };
                if unit != unit_before {
                    continue;
                }
                let apart = (value - then).abs();
                if apart <= least || apart <= ALIKE * value.abs().max(then.abs()) {
                    alike += 1;
                    continue;
                }
                let is_better = (value > then) == more;
                differences.push(Difference {
                    label,
                    what,
                    unit,
                    values: [then, value],
                    is_better,
                });
            }
        }
        differences.sort_by(|a, b| b.size().total_cmp(&a.size()));
        Self { name, before, differences, alike, alone }
    }

    /// The comparison in a sentence.
    pub fn sentence(&self) -> String {
        let better = self.differences.iter().filter(|it| it.is_better).count();
        let (worse, alike) = (self.differences.len() - better, self.alike);
        let most = self.differences.first().map_or(String::new(), |it| {
            let [before, now] = it.values;
            let unit = if it.unit.is_empty() { "" } else { &format!(" {}", it.unit) };
            let of = if it.is_better { "better" } else { "worse" };
            format!("; most: {} {} {before:.2} → {now:.2}{unit}, {of}", it.label, it.what)
        });
        let alone = match self.alone.as_slice() {
            [] => String::new(),
            labels => format!("; not compared, heard in one run only: {}", labels.join(", ")),
        };
        format!(
            "Against {}: {better} figures better, {worse} worse, {alike} alike{most}{alone}",
            self.name
        )
    }

    /// The comparison as JSON.
    pub fn to_json(&self) -> Value {
        let one = |it: &Difference| {
            let Difference { label, what, unit, values: [before, now], is_better } = it;
            json!({ "motor": label, "figure": what, "unit": unit, "before": before, "now": now, "is_better": is_better })
        };
        let differences: Vec<_> = self.differences.iter().map(one).collect();
        json!({ "name": self.name, "alike": self.alike, "alone": self.alone, "differences": differences })
    }

    /// The table of the figures that differ; `None` if all are alike.
    pub fn table(&self) -> Option<Table> {
        let row = |it: &Difference| {
            let [before, now] = it.values.map(|value| number(Some(value), 2, ""));
            let word = if it.is_better { "better" } else { "worse" };
            let word = Entry { bad: !it.is_better, good: it.is_better, ..words(word) };
            vec![words(it.label), words(it.what), words(it.unit), word, before, now]
        };
        let head = vec!["motor", "figure", "unit", "is", "before", "now"];
        let rows: Vec<_> = self.differences.iter().map(row).collect();
        (!rows.is_empty()).then_some(Table { head, words: 4, rows })
    }
}

impl Difference {
    /// The factor between the two.
    fn size(&self) -> f64 {
        let [a, b] = self.values.map(|it| it.abs().max(1e-3));
        a.max(b) / a.min(b)
    }
}
