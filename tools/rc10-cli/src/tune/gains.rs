//! Gains of a cascade for an estimate: the fastest that keep their margins for every plant within its intervals.
//!
//! The speed loop is a PI on inertia and viscous friction, behind the estimated delay, half a tick of hold, and a tick in
//! which a speed is measured. The angle loop is a gain on an integrator around it, in every n-th tick. Dry friction
//! is left out, which only damps.

use std::f64::consts::{PI, TAU};

use rc10_motor::rc10_app::{Cascade, Degrees, FeedForward, Gravity};

use super::estimate::{Estimate, Unknown};
use crate::recording::margin::LEAST;

/// Phase margin that is kept, degrees.
pub const LEAST_PHASE: f64 = 45.0;
/// Sensitivity that is kept: the largest factor by which a loop amplifies what disturbs it.
pub const MOST_SENSITIVE: f64 = 2.0;

/// Half a tick in which the effort is held, and a tick in which the speed is measured, s.
const TICK: f64 = 1.5e-3;
/// Phase that the integral may take at the speed loop's bandwidth: one over this.
const INTEGRAL: f64 = 6.0;
/// Frequencies that are looked at, rad/s: the lowest, the ratio to the next, and how many.
const GRID: (f64, f64, i32) = (0.5, 1.02, 460);

/// A frequency response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Complex(pub f64, pub f64);

impl Complex {
    pub fn polar(size: f64, phase: f64) -> Self {
        Self(size * phase.cos(), size * phase.sin())
    }

    pub fn times(self, other: Self) -> Self {
        Self(self.0 * other.0 - self.1 * other.1, self.0 * other.1 + self.1 * other.0)
    }

    pub fn over(self, other: Self) -> Self {
        let square = other.0 * other.0 + other.1 * other.1;
        let Self(real, imaginary) = self.times(Self(other.0, -other.1));
        Self(real / square, imaginary / square)
    }

    pub fn plus(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }

    fn plus_one(self) -> Self {
        Self(self.0 + 1.0, self.1)
    }

    pub fn size(self) -> f64 {
        self.0.hypot(self.1)
    }

    /// Radians.
    pub fn phase(self) -> f64 {
        self.1.atan2(self.0)
    }
}

/// What the speed loop controls: effort per rpm/s, effort per rpm, and its delay, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Effort per rpm/s.
    pub inertia: f64,
    /// Effort per rpm, 0 or more.
    pub viscous: f64,
    /// From an effort to its motion in what is measured, s.
    pub delay: f64,
}

/// Margins of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Factor by which the gain may rise.
    pub gain: f64,
    /// Degrees of phase that may be lost.
    pub phase: f64,
    /// The largest factor by which it amplifies what disturbs it.
    pub sensitivity: f64,
    /// Frequency at which its gain is one, Hz.
    pub bandwidth: f64,
}

impl Margins {
    /// Within these frequencies, rad/s.
    pub(super) fn of([lowest, highest]: [f64; 2], response: impl Fn(f64) -> Complex) -> Self {
        let mut margins =
            Self { gain: f64::INFINITY, phase: 180.0, sensitivity: 1.0, bandwidth: 0.0 };
        let mut last: Option<Complex> = None;
        let all = (0..GRID.2).map(|step| GRID.0 * GRID.1.powi(step));
        for w in all.filter(|w| (lowest..=highest).contains(w)) {
            let now = response(w);
            margins.sensitivity = margins.sensitivity.max(1.0 / now.plus_one().size());
            let before = last.replace(now).unwrap_or(now);
            // It passes the negative axis.
            if before.1 < 0.0 && now.1 >= 0.0 && before.0 < 0.0 {
                let share = before.1 / (before.1 - now.1);
                let at = before.0 + share * (now.0 - before.0);
                margins.gain = margins.gain.min(-1.0 / at);
            }
            if before.size() >= 1.0 && now.size() < 1.0 {
                let phase = PI - before.phase().abs();
                let phase = if before.1 > 0.0 { -phase } else { phase };
                margins.phase = margins.phase.min(phase.to_degrees());
                margins.bandwidth = w / TAU;
            }
        }
        margins
    }

    /// Whether they are kept.
    pub fn are_kept(&self) -> bool {
        self.gain >= LEAST && self.phase >= LEAST_PHASE && self.sensitivity < MOST_SENSITIVE
    }

    /// The worse of each.
    fn worse(self, other: Self) -> Self {
        Self {
            gain: self.gain.min(other.gain),
            phase: self.phase.min(other.phase),
            sensitivity: self.sensitivity.max(other.sensitivity),
            bandwidth: self.bandwidth.min(other.bandwidth),
        }
    }
}

impl Plant {
    /// The values of an estimate. Fails with what gains need, and cannot be told.
    pub fn of(estimate: &Estimate) -> Result<Self, Unknown> {
        let viscous = estimate.viscous.map_or(0.0, |it| it.value.max(0.0));
        Ok(Self { inertia: estimate.inertia?.value, viscous, delay: estimate.delay?.value })
    }

    /// The corners of an estimate's intervals. Fails with what gains need, and cannot be told.
    pub fn all(estimate: &Estimate) -> Result<Vec<Self>, Unknown> {
        let (inertia, delay) = (estimate.inertia?, estimate.delay?);
        let viscous =
            estimate.viscous.map_or([0.0; 2], |it| [it.value - it.half, it.value + it.half]);
        let ends = |value: f64, half: f64| [value - half, value + half];
        let corners = ends(inertia.value, inertia.half).into_iter().flat_map(|inertia| {
            viscous.into_iter().flat_map(move |viscous| {
                let of = move |delay: f64| Self {
                    inertia,
                    viscous: viscous.max(0.0),
                    delay: delay.max(0.0),
                };
                ends(delay.value, delay.half).map(of)
            })
        });
        Ok(corners.collect())
    }

    /// The speed, in rpm, that an effort of one gives at a frequency, rad/s.
    pub(super) fn response(&self, w: f64) -> Complex {
        let delay = Complex::polar(1.0, -w * (self.delay + TICK));
        delay.over(Complex(self.viscous, w * self.inertia))
    }

    /// Margins of the speed loop, and of the angle loop around it.
    pub fn margins(&self, cascade: &Cascade) -> [Margins; 2] {
        margins_of(cascade, [0.0, f64::INFINITY], |w| self.response(w))
    }
}

/// The loop of a speed controller around what it controls.
pub(super) fn speed_loop(cascade: &Cascade, plant: Complex, w: f64) -> Complex {
    Complex(cascade.speed.kp.into(), -f64::from(cascade.speed.ki) / w).times(plant)
}

/// Margins of the speed loop, and of the angle loop around it, within some frequencies, by the response of what they control.
pub(super) fn margins_of(
    cascade: &Cascade,
    span: [f64; 2],
    plant: impl Fn(f64) -> Complex,
) -> [Margins; 2] {
    let inner = |w: f64| speed_loop(cascade, plant(w), w);
    let hold = 0.5e-3 * f64::from(cascade.outer_divider.max(1));
    let angle = Margins::of(span, |w| {
        let (inner, gain) = (inner(w), 6.0 * f64::from(cascade.angle.kp) / w);
        inner.over(inner.plus_one()).times(Complex::polar(gain, -PI / 2.0 - w * hold))
    });
    [Margins::of(span, inner), angle]
}

/// The worst margins of all plants.
pub fn margins(plants: &[Plant], cascade: &Cascade) -> [Margins; 2] {
    let all = plants.iter().map(|plant| plant.margins(cascade));
    let worse = |[a, b]: [Margins; 2], [c, d]: [Margins; 2]| [a.worse(c), b.worse(d)];
    let none =
        Margins { gain: f64::INFINITY, phase: 180.0, sensitivity: 1.0, bandwidth: f64::INFINITY };
    all.fold([none; 2], worse)
}

/// The cascade with gains and feed-forward for an estimate: as fast as it keeps its margins for every plant of its intervals,
/// or at most of a bandwidth in Hz. Fails with what gains need, and cannot be told.
pub fn tuned(
    cascade: &Cascade,
    estimate: &Estimate,
    bandwidth: Option<f64>,
) -> Result<Cascade, Unknown> {
    let plants = Plant::all(estimate)?;
    let Plant { inertia, viscous, .. } = Plant::of(estimate)?;
    let mut tuned = *cascade;
    // What the loops do not have, they keep: a derivative would need a smoother speed.
    (tuned.speed.kd, tuned.angle.ki, tuned.angle.kd) = (0.0, 0.0, 0.0);
    let fastest = |most: f64, with: &dyn Fn(f64) -> Margins| {
        let (mut low, mut high) = (0.0, most);
        for _ in 0..30 {
            let middle = f64::midpoint(low, high);
            *(if with(middle).are_kept() { &mut low } else { &mut high }) = middle;
        }
        low
    };
    let speed_at = |w: f64| {
        let kp = viscous.hypot(w * inertia);
        let mut tuned = tuned;
        (tuned.speed.kp, tuned.speed.ki) = (kp as f32, (kp * w / INTEGRAL) as f32);
        tuned
    };
    let most = bandwidth.map_or(1000.0, |it| it * TAU);
    let w = fastest(most, &|w| margins(&plants, &speed_at(w))[0]);
    tuned = speed_at(w);
    if !margins(&plants, &tuned)[0].are_kept() {
        // Not even the slowest: the intervals are too wide for any.
        return Err(Unknown::TooVague);
    }
    let angle_at = |kp: f64| {
        let mut tuned = tuned;
        tuned.angle.kp = kp as f32;
        tuned
    };
    let kp = fastest(w / 6.0, &|kp| margins(&plants, &angle_at(kp))[1]);
    tuned = angle_at(kp);
    let before = cascade.feed_forward;
    let gravity = match (estimate.arm, estimate.weight) {
        (Some([effort, level]), _) => {
            let level = Degrees::new(level.value as f32);
            Gravity::Arm { effort: effort.value as f32, level }
        }
        (None, Ok(weight)) if weight.value.abs() > weight.half => {
            Gravity::Lift(weight.value as f32)
        }
        (None, Ok(_)) => Gravity::None,
        (None, Err(_)) => before.gravity,
    };
    tuned.feed_forward = FeedForward {
        friction: estimate.friction.map_or(before.friction, |it| it.value.max(0.0) as f32),
        per_rpm: estimate.viscous.map_or(before.per_rpm, |it| it.value as f32),
        per_rpm_s: inertia as f32,
        gravity,
    };
    Ok(tuned)
}
