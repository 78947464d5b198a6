//! Whether a motor's feed-forward is its load: while it stands or turns evenly as commanded, the
//! effort of its loops is the load itself.

use rc10_motor::rc10_app::{Degrees, FeedForward, Gravity, Rpm, RpmPerSecond};
use rc10_motor::{Feedback, TargetKind};
use rc10_time::Micros;

/// Length of a window.
pub const WINDOW: Micros = Micros::from_millis(200);
/// Speed in rpm below which a shaft stands, and change in a window below which it turns evenly.
const STILL: f64 = 2.0;
/// Largest distance of an axis at its target, degrees.
const AT_TARGET: f64 = 5.0;
/// Share of the limit below which a feed-forward or a difference is not judged.
pub const LEAST: f64 = 0.04;
/// Windows needed to judge it: 1 s.
pub const WINDOWS: u32 = 5;
/// Largest factor between a weight and its feed-forward, either way.
pub const SIZE: f64 = 1.6;
/// Factor between effort and a motion's feed-forward below which the two fight each other.
pub const AGAINST: f64 = -0.5;

/// An effort against its feed-forward, over some windows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fit {
    /// Number of windows.
    pub windows: u32,
    said: f64,
    took: f64,
    squares: f64,
    product: f64,
    apart: f64,
}

impl Fit {
    fn add(&mut self, said: f64, took: f64) {
        self.windows += 1;
        self.said += said.abs();
        self.took += took.abs();
        self.squares += said * said;
        self.product += said * took;
        self.apart += (took - said).abs();
    }

    /// Factor between effort and feed-forward; negative if they are opposed.
    pub fn factor(&self) -> f64 {
        self.product / self.squares
    }

    /// Mean sizes of the feed-forward, of the effort, and of their difference.
    pub fn means(&self) -> [f64; 3] {
        [self.said, self.took, self.apart].map(|sum| sum / f64::from(self.windows))
    }
}

/// The load of a motor beside its feed-forward.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadTrack {
    /// The weight, while the motor stands.
    pub weight: Fit,
    /// The motion, while the motor turns evenly: without the weight's feed-forward.
    pub motion: Fit,
}

/// A look at the load of a motor.
#[derive(Clone, Copy, Debug)]
pub struct Carrying<'a> {
    /// Kind of the target.
    pub kind: TargetKind,
    /// Target in the unit of the kind, while the motor follows one.
    pub target: Option<f64>,
    /// The measurement in the same unit.
    pub measured: f64,
    /// Newest measurements.
    pub feedback: &'a Feedback,
    /// Effort of the loops; `None` while they do not drive.
    pub effort: Option<f64>,
}

/// Watches the load of one motor.
#[derive(Clone, Debug, Default)]
pub(crate) struct LoadWatch {
    pub track: LoadTrack,
    begun: Option<Micros>,
    looks: f64,
    /// Sums of effort, and of the feed-forward of weight and motion; lowest and highest speed.
    sums: [f64; 3],
    rpm: [f64; 2],
}

impl LoadWatch {
    pub(crate) fn look(&mut self, now: Micros, seen: &Carrying<'_>, feed_forward: &FeedForward) {
        let Carrying { kind, target, measured, feedback, effort } = *seen;
        let is_angle = !matches!(kind, TargetKind::Speed | TargetKind::SpeedMotion);
        let follows = |target: f64| {
            let error = (target - measured).abs();
            error < if is_angle { AT_TARGET } else { STILL + 0.1 * target.abs() }
        };
        let (Some(effort), true) = (effort, target.is_some_and(follows)) else {
            self.begun = None;
            return;
        };
        let rpm = f64::from(feedback.speed.get());
        let begun = *self.begun.get_or_insert_with(|| {
            (self.looks, self.sums, self.rpm) = (0.0, [0.0; 3], [rpm; 2]);
            now
        });
        let degrees = (feedback.total_angle.microdegrees() as f64 * 1e-6).rem_euclid(360.0);
        let weight = feed_forward.gravity.at(Degrees::new(degrees as f32));
        let motion = FeedForward { gravity: Gravity::None, ..*feed_forward };
        let motion = motion.effort(Rpm::new(rpm as f32), RpmPerSecond::ZERO, Degrees::ZERO);
        for (sum, value) in self.sums.iter_mut().zip([effort, weight.into(), motion.into()]) {
            *sum += value;
        }
        self.looks += 1.0;
        self.rpm = [self.rpm[0].min(rpm), self.rpm[1].max(rpm)];
        let [low, high] = self.rpm;
        if high - low > STILL + 0.02 * high.abs() {
            self.begun = None;
        } else if now.since(begun) >= WINDOW {
            self.begun = None;
            let [effort, weight, motion] = self.sums.map(|sum| sum / self.looks);
            if high.abs().max(low.abs()) < STILL {
                self.track.weight.add(weight, effort);
            } else {
                self.track.motion.add(motion, effort - weight);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::rc10_app::TotalAngle;

    use super::*;

    impl Fit {
        /// A fit of windows with this factor between effort and feed-forward.
        pub(crate) fn even(windows: u32, said: f64, factor: f64) -> Self {
            let mut fit = Self::default();
            (0..windows).for_each(|_| fit.add(said, factor * said));
            fit
        }
    }

    /// Of a motor that stands, turns at 30 rpm, and stands at another angle, 1 s each.
    fn watched(gravity: Gravity, speed: f32, effort: impl Fn(f64, f64) -> f64) -> LoadTrack {
        let feed_forward = FeedForward { gravity, per_rpm: speed, ..FeedForward::NONE };
        let mut watch = LoadWatch::default();
        for millis in 0..4000_u64 {
            let (degrees, rpm) = match millis {
                ..1500 => (20.0, 0.0),
                1500..2500 => (20.0 + 0.18 * (millis - 1500) as f64, 30.0),
                _ => (200.0, 0.0),
            };
            let mut feedback = Feedback::NEW;
            feedback.speed = Rpm::new(rpm as f32);
            feedback.total_angle = TotalAngle::from_microdegrees((degrees * 1e6) as i64);
            let seen = Carrying {
                kind: TargetKind::TotalAngle,
                target: Some(degrees + 1.0),
                measured: degrees,
                feedback: &feedback,
                effort: Some(effort(degrees, rpm)),
            };
            watch.look(Micros::from_millis(millis), &seen, &feed_forward);
        }
        watch.track
    }

    #[test]
    fn a_weight_is_found_with_its_factor() {
        let arm = Gravity::Arm { effort: 2.0, level: Degrees::ZERO };
        for factor in [1.0, -1.0, 0.4, 2.5] {
            let track = watched(arm, 0.0, |degrees, _| factor * 2.0 * degrees.to_radians().cos());
            assert!((track.weight.factor() - factor).abs() < 1e-3, "{factor}: {track:?}");
            assert!(track.weight.windows >= WINDOWS);
            let lift = watched(Gravity::Lift(-3.0), 0.0, |_, _| factor * -3.0);
            assert!((lift.weight.factor() - factor).abs() < 1e-6, "{factor}");
            assert!((lift.weight.means()[2] - 3.0 * (factor - 1.0).abs()).abs() < 1e-6);
        }
    }

    /// Whole windows of a motor that turns by this at each millisecond of a window, as it is told to.
    fn windows(rpm: impl Fn(u64) -> f64) -> [u32; 2] {
        let mut watch = LoadWatch::default();
        for millis in 0..2000 {
            let rpm = rpm(millis % (WINDOW.get() / 1000));
            let mut feedback = Feedback::NEW;
            feedback.speed = Rpm::new(rpm as f32);
            let (target, measured, effort) = (Some(rpm), rpm, Some(0.0));
            let seen =
                Carrying { kind: TargetKind::Speed, target, measured, feedback: &feedback, effort };
            watch.look(Micros::from_millis(millis), &seen, &FeedForward::NONE);
        }
        [watch.track.weight.windows, watch.track.motion.windows]
    }

    #[test]
    fn standing_and_turning_evenly_are_distinguished() {
        for sign in [1.0, -1.0] {
            let of = |rpm: &dyn Fn(u64) -> f64| windows(|at| sign * rpm(at));
            assert_eq!(of(&|_| 1.9), [9, 0]);
            assert_eq!(of(&|_| 2.1), [0, 9]);
            // Above and below what stands.
            assert_eq!(of(&|at| if at % 2 == 0 { 1.5 } else { 2.5 }), [0, 9]);
            // By little less, and by little more, than an even motion changes.
            assert_eq!(of(&|at| 100.0 + 0.019 * at as f64), [0, 9]);
            assert_eq!(of(&|at| 100.0 + 0.03 * at as f64), [0, 0]);
            assert_eq!(of(&|at| 106.0 - 0.03 * at as f64), [0, 0]);
        }
    }

    #[test]
    fn a_motion_is_judged_less_the_weight() {
        let track = watched(Gravity::Lift(1.0), 0.1, |_, rpm| 1.0 - 0.1 * rpm);
        assert!((track.motion.factor() + 1.0).abs() < 1e-6, "{track:?}");
        assert!((track.weight.factor() - 1.0).abs() < 1e-6, "{track:?}");
    }
}
