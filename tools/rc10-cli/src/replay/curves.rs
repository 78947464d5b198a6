//! What the loops command, as it was and as it is here: a table and a page of curves.

use std::fmt::Write as _;

use rc10_time::Micros;
use serde_json::{Value, json};

use super::engine::Engine;
use super::inputs::Inputs;
use crate::lang;
use crate::recording::sample::{rounded, seconds};
use crate::robot::description::Description;

/// The effort of each motor over time; NaN while no loop decides.
#[derive(Default)]
pub(super) struct Efforts(Vec<Vec<(f64, f32)>>);

/// Values of a curve.
const MOST: usize = 3000;

impl Efforts {
    /// Those of a record.
    pub(super) fn recorded(inputs: &Inputs, robot: &Description) -> Self {
        Self(robot.motors.iter().map(|motor| inputs.efforts(motor.label).to_vec()).collect())
    }

    /// Takes the efforts, if a millisecond has gone by since the last time.
    pub(super) fn look(&mut self, engine: &Engine<'_>, now: Micros) {
        let now = seconds(now);
        self.0.resize(engine.description.motors.len(), Vec::new());
        for (entry, all) in self.0.iter_mut().enumerate() {
            if all.last().is_none_or(|last| now >= last.0 + 0.001) {
                all.push((now, engine.effort(entry).unwrap_or(f32::NAN)));
            }
        }
    }

    /// Only what is within so many seconds of a time.
    pub(super) fn around(mut self, at: Micros, span: f64) -> Self {
        self.0.iter_mut().for_each(|all| all.retain(|it| (it.0 - seconds(at)).abs() <= span));
        self
    }
}

/// The largest differences, a line for each motor; those of which nothing differs are left out.
pub(super) fn table(was: &Efforts, is: &Efforts, robot: &Description) -> String {
    let mut text = String::new();
    let width = robot.motors.iter().map(|it| it.label.len()).max().unwrap_or(0);
    for (motor, (was, is)) in robot.motors.iter().zip(was.0.iter().zip(&is.0)) {
        let pairs = was.iter().zip(is).map(|(was, is)| (was.0, f64::from(is.1 - was.1)));
        let known: Vec<_> = pairs.filter(|(_, by)| by.is_finite()).collect();
        let largest = known.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((at, by)) = largest.filter(|(_, by)| *by != 0.0) {
            let squares: f64 = known.iter().map(|(_, by)| by * by).sum();
            let [by, rms] =
                [by.abs(), (squares / known.len() as f64).sqrt()].map(|it| rounded(it, 4));
            let _ =
                writeln!(text, "{:<width$}  {by} at {} s, RMS {rms}", motor.label, rounded(at, 3));
        }
    }
    text
}

/// The page with the curves.
pub(super) fn page(head: &str, was: &Efforts, is: &Efforts, robot: &Description) -> String {
    let curve = |of: Option<&Vec<(f64, f32)>>| -> Value {
        let all = of.map_or(&[][..], Vec::as_slice);
        all.iter().step_by(all.len().div_ceil(MOST).max(1)).map(|it| json!([it.0, it.1])).collect()
    };
    let motors = robot.motors.iter().enumerate().map(|(line, motor)| {
        json!({ "label": motor.label, "was": curve(was.0.get(line)), "is": curve(is.0.get(line)) })
    });
    let data = json!({ "head": head, "motors": motors.collect::<Vec<_>>() });
    const STYLE: &str =
        concat!(include_str!("../show/colours.css"), include_str!("../show/report.css"));
    include_str!("replay.html")
        .replace("/*STYLE*/", STYLE)
        .replace("/*SCRIPT*/", &(lang::script() + include_str!("../show/plot.js")))
        // Within an element of HTML.
        .replace("/*DATA*/", &data.to_string().replace('<', "\\u003c"))
}
