//! Second-order tracking differentiator: follows a setpoint with limited acceleration and gives
//! its derivative, without ever dividing a difference by a short time.
//!
//! It is the time-optimal double integrator in discrete time (J. Han, "From PID to Active
//! Disturbance Rejection Control", IEEE Transactions on Industrial Electronics 56(3), 2009,
//! function `fhan`): full acceleration, then full braking, so a step is reached as fast as the
//! acceleration limit allows and without overshoot. Near the target it becomes a critically damped
//! filter of time constant `smoothing`, so noise does not make it chatter.

use crate::config::{ConfigError, positive};
use crate::maths;
use crate::units::Seconds;

/// Settings of a [`Differentiator`]: acceleration and smoothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentiatorConfig {
    /// Largest acceleration of the followed value (Han's `r`), in units of the value per second
    /// squared; > 0. A step of height `s` takes about `2 · sqrt(s / acceleration)`.
    pub acceleration: f32,
    /// Time constant of the smoothing near the target (Han's `h0`); > 0. Three to ten sampling
    /// times are usual. Never less than one sampling time is used, because less would oscillate.
    pub smoothing: Seconds,
}

impl DifferentiatorConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is not finite or not positive.
    pub fn validate(&self) -> Result<(), ConfigError> {
        positive("acceleration", self.acceleration)?;
        positive("smoothing", self.smoothing.get())
    }
}

/// State of a tracking differentiator.
///
/// It holds the value in `f32`, so it settles to a few units in the last place: feed it a
/// single-turn angle, a speed or a difference, not a position that grows without bound.
///
/// ```
/// use rc10_app::differentiator::{Differentiator, DifferentiatorConfig};
/// use rc10_app::Seconds;
/// let config = DifferentiatorConfig { acceleration: 1000.0, smoothing: Seconds::new(0.005) };
/// let mut setpoint = Differentiator::at(0.0);
/// for _ in 0..500 {
///     assert!(setpoint.update(&config, 10.0, Seconds::new(0.001)) <= 10.0001);
/// }
/// assert!((setpoint.value() - 10.0).abs() < 1e-3 && setpoint.rate().abs() < 1e-2);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Differentiator {
    value: f32,
    rate: f32,
}

impl Differentiator {
    /// At rest at a measured value, in the unit of the target. [`Differentiator::default`] rests
    /// at 0.
    pub const fn at(value: f32) -> Self {
        Self { value, rate: 0.0 }
    }

    /// The followed value, in the unit of the target.
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Its derivative, in units of the target per second.
    pub const fn rate(&self) -> f32 {
        self.rate
    }

    /// Jumps to rest at a measured value; one that is not finite is ignored.
    pub const fn reset(&mut self, measured: f32) {
        if measured.is_finite() {
            *self = Self::at(measured);
        }
    }

    /// Follows `target` for `dt` and returns the new value.
    ///
    /// A target that is not finite, or a `dt` that is not finite and positive, leaves the state
    /// unchanged and returns the last value.
    pub fn update(&mut self, config: &DifferentiatorConfig, target: f32, dt: Seconds) -> f32 {
        if !(target.is_finite() && dt.is_step()) {
            return self.value;
        }
        let h = dt.get();
        let smoothing = config.smoothing.get().max(h);
        let acceleration =
            time_optimal(self.value - target, self.rate, config.acceleration, smoothing);
        let next = Self { value: self.value + h * self.rate, rate: self.rate + h * acceleration };
        if next.value.is_finite() && next.rate.is_finite() {
            *self = next;
        }
        self.value
    }
}

/// Han's `fhan`: the acceleration, within ± `limit`, that brings a double integrator `error` away
/// from its target and moving at `rate` to rest there soonest, in steps of `step` seconds.
fn time_optimal(error: f32, rate: f32, limit: f32, step: f32) -> f32 {
    // Distances: what one step at full acceleration, and at the present rate, makes.
    let full = limit * step * step;
    let drift = rate * step;
    let ahead = error + drift;
    // How far the state is from the curve on which braking has to start.
    let from_curve = if ahead.abs() <= full {
        ahead + drift
    } else {
        let brake = maths::sqrt(full * (full + 8.0 * ahead.abs()));
        drift + (0.5 * (brake - full)).copysign(ahead)
    };
    if from_curve.abs() <= full {
        -limit * (from_curve / full)
    } else {
        -limit.copysign(from_curve)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: DifferentiatorConfig =
        DifferentiatorConfig { acceleration: 200.0, smoothing: Seconds::new(0.005) };
    const MILLISECOND: Seconds = Seconds::new(0.001);

    #[test]
    fn a_step_is_reached_in_nearly_the_shortest_time_without_overshoot() {
        for height in [0.01, 1.0, 50.0, -50.0] {
            let mut follower = Differentiator::at(0.0);
            let mut arrived = None;
            for step in 1..3000_u16 {
                let before = follower;
                let value = follower.update(&CONFIG, height, MILLISECOND);
                assert!(value / height < 1.0 + 1e-5, "{value} of {height}");
                assert!(value / height > -1e-6, "{value} of {height}");
                let acceleration = (follower.rate() - before.rate()) / 0.001;
                assert!(acceleration.abs() <= 200.0 * 1.001, "{acceleration}");
                if arrived.is_none() && (value / height - 1.0).abs() < 0.01 {
                    arrived = Some(f32::from(step) * 0.001);
                }
            }
            let shortest = 2.0 * (height.abs() / 200.0).sqrt();
            let arrived = arrived.unwrap();
            assert!(arrived < shortest * 1.05 + 0.035, "{arrived} s, at best {shortest} s");
            assert!((follower.value() / height - 1.0).abs() < 1e-5, "{follower:?}");
            assert!((follower.rate() / height).abs() < 1e-4, "{follower:?}");
        }
    }

    #[test]
    fn the_path_does_not_depend_on_the_sampling_time() {
        let run = |dt: f32, steps: u16| {
            let mut follower = Differentiator::at(0.0);
            for _ in 0..steps {
                follower.update(&CONFIG, 2.0, Seconds::new(dt));
            }
            follower
        };
        for tenths in [1, 2] {
            let (coarse, fine) = (run(0.001, tenths * 50), run(0.000_1, tenths * 500));
            assert!((coarse.value() - fine.value()).abs() < 0.02, "{coarse:?} {fine:?}");
            assert!((coarse.rate() - fine.rate()).abs() < 0.4, "{coarse:?} {fine:?}");
        }
    }

    #[test]
    fn irregular_sampling_times_do_not_make_it_overshoot() {
        let mut follower = Differentiator::at(0.0);
        for step in 0..4000_u32 {
            let dt = 0.000_5 + 0.000_25 * f32::from(u8::try_from(step * 7919 % 7).unwrap());
            assert!(follower.update(&CONFIG, 3.0, Seconds::new(dt)) < 3.0 + 1e-4, "{follower:?}");
        }
        assert!((follower.value() - 3.0).abs() < 1e-5);
    }

    #[test]
    fn a_sampling_time_longer_than_the_smoothing_does_not_oscillate() {
        let mut follower = Differentiator::at(0.0);
        for _ in 0..200 {
            follower.update(&CONFIG, 3.0, Seconds::new(0.02));
        }
        assert!((follower.value() - 3.0).abs() < 1e-4, "{follower:?}");
    }

    #[test]
    fn the_rate_of_a_moving_target_is_its_derivative() {
        let mut follower = Differentiator::at(0.0);
        for step in 0..2000_u16 {
            follower.update(&CONFIG, 4.0 * f32::from(step) * 0.001, MILLISECOND);
        }
        assert!((follower.rate() - 4.0).abs() < 1e-2, "{follower:?}");
    }

    #[test]
    fn bad_input_changes_nothing_and_no_finite_input_poisons_the_state() {
        let mut follower = Differentiator { value: 2.0, rate: 1.0 };
        let before = follower;
        for (target, dt) in [
            (f32::NAN, 0.001),
            (f32::INFINITY, 0.001),
            (9.0, 0.0),
            (9.0, -0.001),
            (9.0, f32::NAN),
            (9.0, f32::INFINITY),
        ] {
            follower.update(&CONFIG, target, Seconds::new(dt));
            assert_eq!(follower, before);
        }
        follower.update(
            &DifferentiatorConfig { acceleration: f32::NAN, smoothing: MILLISECOND },
            9.0,
            MILLISECOND,
        );
        assert_eq!(follower, before);
        for target in [f32::MAX, f32::MIN, f32::MIN_POSITIVE, 1e30, -1e-30] {
            for dt in [1e-30, 1e-3, 1e6, 1e38] {
                follower.update(&CONFIG, target, Seconds::new(dt));
                assert!(follower.value().is_finite() && follower.rate().is_finite());
            }
        }
        follower.reset(f32::NAN);
        assert!(follower.value().is_finite());
        follower.reset(1.5);
        assert_eq!(follower, Differentiator::at(1.5));
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CONFIG.validate(), Ok(()));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(
                DifferentiatorConfig { acceleration: bad, smoothing: MILLISECOND }
                    .validate()
                    .is_err()
            );
            assert!(
                DifferentiatorConfig { acceleration: 1.0, smoothing: Seconds::new(bad) }
                    .validate()
                    .is_err()
            );
        }
    }
}
