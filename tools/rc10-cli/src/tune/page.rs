//! The page of a tuned motor: its Bode plot, and steps before and after. It loads nothing from anywhere.

use std::f64::consts::{PI, TAU};

use rc10_motor::rc10_app::Cascade;
use serde_json::{Value, json};

use super::estimate::Sample;
use super::gains::{Complex, Plant, speed_loop};
use super::response::Point;
use crate::lang;

/// What is known of a motor's loops in the end: what the page shows.
pub(super) struct Tuning {
    /// What is printed: the numbers, and lines of Rust.
    pub text: String,
    pub code: String,
    /// The loops as they are, and with the new gains if there are some.
    pub now: Cascade,
    pub new: Option<Cascade>,
    /// The plant of the estimate, and what was measured.
    pub plant: Option<Plant>,
    pub points: Vec<Point>,
    /// Steps before, and with the new gains.
    pub steps: [Vec<Sample>; 2],
}

/// Frequencies of a computed curve, Hz: from, ratio, and how many.
const CURVE: (f64, f64, i32) = (1.0, 1.04, 118);

fn curve(name: &str, is_measured: bool, points: impl Iterator<Item = (f64, Complex)>) -> Value {
    let (mut hz, mut db, mut deg) = (Vec::new(), Vec::new(), Vec::new());
    for (at, it) in points {
        hz.push(at);
        db.push(20.0 * it.size().log10());
        // A loop lags by a quarter of a turn to one and a quarter.
        let phase = it.phase();
        deg.push((if phase > PI / 4.0 { phase - TAU } else { phase }).to_degrees());
    }
    json!({ "name": name, "measured": is_measured, "hz": hz, "db": db, "deg": deg })
}

/// The open speed loop with some gains, as it is computed and as it was measured.
fn curves(name: &str, cascade: &Cascade, plant: Option<&Plant>, points: &[Point]) -> [Value; 2] {
    let at = |hz: f64, plant: Complex| (hz, speed_loop(cascade, plant, TAU * hz));
    let computed = plant.into_iter().flat_map(|plant| {
        let grid = (0..CURVE.2).map(|step| CURVE.0 * CURVE.1.powi(step));
        grid.map(move |hz| (hz, plant.response(TAU * hz)))
    });
    let computed = computed.map(|(hz, plant)| at(hz, plant));
    let measured = points.iter().map(|it| at(it.hz, it.plant));
    [curve(name, false, computed), curve(&format!("{name}, measured"), true, measured)]
}

fn steps(name: &str, samples: &[Sample]) -> Option<Value> {
    let begin = samples.first()?.at;
    let pairs = || samples.windows(2);
    let asked = |pair: &[Sample]| {
        // A thousandth of an rpm: it is the difference of two angles.
        (1000.0 * pair[1].asked_since(&pair[0])).round() / 1000.0
    };
    let times: Vec<_> = pairs().map(|pair| pair[1].at - begin).collect();
    let target: Vec<_> = pairs().map(asked).map(|it| it.is_finite().then_some(it)).collect();
    let values: Vec<_> = pairs().map(|pair| pair[1].speed).collect();
    Some(json!({ "gains": name, "times": times, "target": target, "values": values }))
}

/// The page.
pub(super) fn page_of(label: &str, found: &Tuning) -> String {
    let loops = [("now", Some(&found.now)), ("tuned", found.new.as_ref())].into_iter();
    let curves = loops.filter_map(|(name, cascade)| {
        Some(curves(name, cascade?, found.plant.as_ref(), &found.points))
    });
    let stepped = ["now", "tuned"].into_iter().zip(&found.steps);
    let data = json!({
        "label": label,
        "text": found.text,
        "code": found.code,
        "curves": curves.flatten().collect::<Vec<_>>(),
        "steps": stepped.filter_map(|(name, samples)| steps(name, samples)).collect::<Vec<_>>(),
    });
    const SCRIPT: &str = concat!(
        include_str!("../show/plot.js"),
        include_str!("../show/step.js"),
        include_str!("../show/bode.js"),
    );
    const STYLE: &str =
        concat!(include_str!("../show/colours.css"), include_str!("../show/report.css"));
    include_str!("tune.html")
        .replace("/*STYLE*/", STYLE)
        .replace("/*SCRIPT*/", &(lang::script() + SCRIPT))
        // Within an element of HTML.
        .replace("/*DATA*/", &data.to_string().replace('<', "\\u003c"))
}
