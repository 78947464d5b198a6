//! Frequency response of what a speed loop controls: from the effort of its ticks to the speed that it measures.
//!
//! Nothing of it is a model: delays, hold, current loop and the device's own measuring of speed are in it. What disturbs a
//! shaft also moves it, so the speed that was asked for is the instrument, as for the estimates; and only windows
//! count in which the shaft turns one way, and a sine of the frequency is asked for.

use std::f64::consts::TAU;

use rc10_motor::rc10_app::Cascade;

use super::estimate::Sample;
use super::gains::{Complex, Margins, margins_of};

/// Frequencies, Hz: the lowest, the ratio to the next, and how many.
const FREQUENCIES: (f64, f64, i32) = (1.5, 1.3, 15);
/// A window: periods of the frequency, and at least so long, s.
const WINDOW: (f64, f64) = (4.0, 0.2);
/// Share that the frequency has in all that a window asks for, squared, from which on it counts.
const PURE: f64 = 0.7;
/// Share of what is measured at a frequency that follows what is asked, from which on it counts.
const FOLLOWS: f64 = 0.7;

/// The frequencies that are looked at, Hz.
pub fn frequencies() -> impl Iterator<Item = f64> {
    (0..FREQUENCIES.2).map(|at| FREQUENCIES.0 * FREQUENCIES.1.powi(at))
}

/// What was measured at a frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Hz.
    pub hz: f64,
    /// Speed, rpm, of an effort of one.
    pub(super) plant: Complex,
}

/// The response at each frequency at which the samples tell it, in order.
pub fn response(samples: &[Sample]) -> Vec<Point> {
    let Some(length) = samples.len().checked_sub(1).filter(|it| *it > 0) else { return Vec::new() };
    let mut steps: Vec<f64> = samples.windows(2).map(|pair| pair[1].at - pair[0].at).collect();
    steps.sort_by(f64::total_cmp);
    let period = steps[length / 2];
    // A speed above a quarter of the sampling frequency is not seen as it is.
    let seen = frequencies().filter(|hz| period > 0.0 && 4.0 * hz * period < 1.0);
    seen.filter_map(|hz| Some(Point { hz, plant: at(samples, period, hz)? })).collect()
}

/// Weighted sums of a window at a frequency: of what is asked, of the effort, and of the speed. `None` if it turns both ways, has a
/// gap, or asks for something else.
fn sums(window: &[Sample], period: f64, hz: f64) -> Option<[Complex; 3]> {
    let (first, last) = (window.first()?, window.last()?);
    let is_whole = last.at - first.at < 1.05 * period * window.len() as f64;
    let signals = |pair: &[Sample]| [pair[1].asked_since(&pair[0]), pair[1].effort, pair[1].speed];
    let turns = window.iter().all(|it| it.speed * first.speed > 0.0 && it.effort.is_finite());
    if !is_whole || !turns {
        return None;
    }
    let weight = |at: f64| 1.0 - (TAU * (at - first.at) / (last.at - first.at)).cos();
    let (mut means, mut whole) = ([0.0; 3], 0.0);
    for pair in window.windows(2) {
        let by = weight(pair[1].at);
        means.iter_mut().zip(signals(pair)).for_each(|(sum, it)| *sum += by * it);
        whole += by;
    }
    let (mut sums, mut square) = ([Complex(0.0, 0.0); 3], 0.0);
    for pair in window.windows(2) {
        let at = pair[1].at;
        let (sin, cos) = (TAU * hz * (at - first.at)).sin_cos();
        square += weight(at) * (signals(pair)[0] - means[0] / whole).powi(2);
        for ((sum, it), mean) in sums.iter_mut().zip(signals(pair)).zip(means) {
            let it = weight(at) * (it - mean / whole);
            *sum = Complex(sum.0 + it * cos, sum.1 - it * sin);
        }
    }
    (2.0 * sums[0].size().powi(2) > PURE * whole * square).then_some(sums)
}

fn at(samples: &[Sample], period: f64, hz: f64) -> Option<Complex> {
    let length = ((WINDOW.0 / hz).max(WINDOW.1) / period) as usize;
    let hop = (length / 4).max(1);
    let windows = samples.windows(length.max(3)).step_by(hop);
    let square = |it: Complex| it.0 * it.0 + it.1 * it.1;
    let (mut speed, mut effort) = (Complex(0.0, 0.0), Complex(0.0, 0.0));
    let (mut asked, mut measured) = (0.0, 0.0);
    for [r, u, y] in windows.filter_map(|it| sums(it, period, hz)) {
        let along = |it: Complex| it.times(Complex(r.0, -r.1));
        (speed, effort) = (speed.plus(along(y)), effort.plus(along(u)));
        (asked, measured) = (asked + square(r), measured + square(y));
    }
    (square(speed) > FOLLOWS * asked * measured).then(|| speed.over(effort))
}

/// Margins of the loops with some gains, by a response that was measured: of the speed loop, and of the angle loop around
/// it. A gain margin is infinite if the highest frequency is below it. `None` for fewer than two points.
pub fn margins_measured(points: &[Point], cascade: &Cascade) -> Option<[Margins; 2]> {
    let [first, .., last] = points else { return None };
    let mut turned = 0.0;
    let all: Vec<[f64; 3]> = points
        .iter()
        .map(|it| {
            // Nearest to the one before: it does not jump by a turn.
            turned = it.plant.phase() - TAU * ((it.plant.phase() - turned) / TAU).round();
            [(TAU * it.hz).ln(), it.plant.size().ln(), turned]
        })
        .collect();
    let between = |w: f64| {
        let place = all.partition_point(|it| it[0] < w.ln()).clamp(1, all.len() - 1);
        let (low, high) = (all[place - 1], all[place]);
        let share = (w.ln() - low[0]) / (high[0] - low[0]);
        let [_, size, phase] = std::array::from_fn(|at| low[at] + share * (high[at] - low[at]));
        Complex::polar(size.exp(), phase)
    };
    Some(margins_of(cascade, [TAU * first.hz, TAU * last.hz], between))
}
