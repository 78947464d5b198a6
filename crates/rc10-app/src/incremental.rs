//! Incremental (velocity-form) PID: each step adds to the output instead of computing it anew.
//!
//! `Δu = kp · (e − e₁) + ki · e · dt + kd · ((e − e₁)/dt − (e₁ − e₂)/dt₁)`, where `e₁`, `e₂` are the
//! errors one and two steps ago and `dt₁` the time step before. Every term uses the true time, so
//! gains mean the same at any rate and with a jittering one: the increments add up to the
//! positional PID.
//!
//! The limits act on the sum, which is the integrator: there is nothing that could wind up. Gains
//! can be swapped while it runs, without a bump: only later increments know the new ones. The price
//! is that an increment that a limit cuts off is gone. A setpoint that jumps should therefore pass
//! a [`Differentiator`] first, see [`IncrementalPidConfig::setpoint`].

use crate::config::{ConfigError, finite, positive};
use crate::differentiator::{Differentiator, DifferentiatorConfig};
use crate::units::Seconds;

/// Gains and limits of an [`IncrementalPidState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IncrementalPidConfig {
    /// Proportional gain, output per unit of error.
    pub kp: f32,
    /// Integral gain, output per unit of error and second.
    pub ki: f32,
    /// Derivative gain, output per unit of error per second.
    pub kd: f32,
    /// Lowest output.
    pub output_min: f32,
    /// Highest output; more than `output_min`.
    pub output_max: f32,
    /// Smoothing of the setpoint, if any; the path starts at the measured value.
    pub setpoint: Option<DifferentiatorConfig>,
}

impl IncrementalPidConfig {
    /// Gains, an output within ± `limit`, and a setpoint taken as it comes.
    pub const fn new(kp: f32, ki: f32, kd: f32, limit: f32) -> Self {
        Self { kp, ki, kd, output_min: -limit, output_max: limit, setpoint: None }
    }

    /// The same with a smoothed setpoint.
    #[must_use]
    pub const fn with_setpoint(self, setpoint: DifferentiatorConfig) -> Self {
        Self { setpoint: Some(setpoint), ..self }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is not finite or out of range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        finite("kp", self.kp)?;
        finite("ki", self.ki)?;
        finite("kd", self.kd)?;
        finite("output_min", self.output_min)?;
        finite("output_max", self.output_max)?;
        positive("output_max - output_min", self.output_max - self.output_min)?;
        self.setpoint.map_or(Ok(()), |setpoint| setpoint.validate())
    }
}

/// The starting point of the next increment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Past {
    /// Fresh: the output is 0, as it would be with no error.
    #[default]
    Rest,
    /// The output was given: the error of the first step belongs to it.
    Preset,
    /// The last step's error and its rate of change per second.
    Step { error: f32, rate: f32 },
}

/// State of an incremental PID.
///
/// ```
/// use rc10_app::incremental::{IncrementalPidConfig, IncrementalPidState};
/// use rc10_app::Seconds;
/// let config = IncrementalPidConfig::new(0.5, 10.0, 0.0, 20.0);
/// let mut pid = IncrementalPidState::new();
/// let dt = Seconds::new(0.001);
/// assert!((pid.update(&config, 2.0, 0.0, dt) - 1.02).abs() < 1e-6); // 0.5 · 2 + 10 · 2 · 0.001
/// assert!((pid.update(&config, 2.0, 0.0, dt) - 1.04).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IncrementalPidState {
    output: f32,
    past: Past,
    setpoint: Differentiator,
}

impl IncrementalPidState {
    /// At rest, output 0. The first step has no derivative, because there is nothing before it.
    pub const fn new() -> Self {
        Self { output: 0.0, past: Past::Rest, setpoint: Differentiator::at(0.0) }
    }

    /// Takes over from another controller at `output`: the next step starts there, and of its error
    /// only the integral counts (no bump). An output that is not finite is ignored.
    pub const fn preset(&mut self, output: f32) {
        if output.is_finite() {
            *self = Self { output, past: Past::Preset, setpoint: Differentiator::at(0.0) };
        }
    }

    /// Back to rest, output 0.
    pub const fn reset(&mut self) {
        *self = Self::new();
    }

    /// The last output.
    pub const fn output(&self) -> f32 {
        self.output
    }

    /// The setpoint that the last step used, after smoothing if that is configured.
    pub const fn setpoint(&self) -> f32 {
        self.setpoint.value()
    }

    /// One step, `dt` after the one before. Returns the output, within the configured limits.
    ///
    /// Leaves the state unchanged and returns the last output if an input is not finite, if `dt`
    /// is not positive, or if the limits are not in order.
    pub fn update(
        &mut self,
        config: &IncrementalPidConfig,
        setpoint: f32,
        measured: f32,
        dt: Seconds,
    ) -> f32 {
        let in_order = config.output_min <= config.output_max;
        if !(setpoint.is_finite() && measured.is_finite() && dt.is_step() && in_order) {
            return self.output;
        }
        let seconds = dt.get();
        let mut follower = self.setpoint;
        if let Some(smoothing) = &config.setpoint {
            if !matches!(self.past, Past::Step { .. }) {
                follower.reset(measured);
            }
            follower.update(smoothing, setpoint, dt);
        } else {
            // Kept up to date, so that smoothing can be switched on without a jump.
            follower.reset(setpoint);
        }

        let error = follower.value() - measured;
        let (last_error, last_rate, rate) = match self.past {
            Past::Rest => (0.0, 0.0, 0.0),
            Past::Preset => (error, 0.0, 0.0),
            Past::Step { error: last, rate } => (last, rate, (error - last) / seconds),
        };
        let increment = config.kp * (error - last_error)
            + config.ki * error * seconds
            + config.kd * (rate - last_rate);
        let output = (self.output + increment).max(config.output_min).min(config.output_max);

        // An overflow on the way, also of `rate`, is as unusable as an input that is not finite.
        if increment.is_finite() && output.is_finite() {
            *self = Self { output, past: Past::Step { error, rate }, setpoint: follower };
        }
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: Seconds = Seconds::new(0.001);

    fn near(actual: f32, expected: f32) {
        assert!((actual - expected).abs() < 1e-4, "{actual} is not {expected}");
    }

    #[test]
    fn the_increments_add_up_to_the_positional_pid_under_jitter() {
        let config = IncrementalPidConfig::new(3.0, 20.0, 0.01, 1e6);
        let mut pid = IncrementalPidState::new();
        let (mut integral, mut last) = (0.0_f64, None);
        for step in 0..500_u32 {
            let dt = 0.000_5 + 0.000_25 * f32::from(u8::try_from(step * 7919 % 7).unwrap());
            let error = (0.1 * f32::from(u16::try_from(step).unwrap())).sin();
            let output = pid.update(&config, error, 0.0, Seconds::new(dt));
            integral += f64::from(error) * f64::from(dt);
            let rate = last.map_or(0.0, |last| f64::from(error - last) / f64::from(dt));
            last = Some(error);
            let expected = 3.0 * f64::from(error) + 20.0 * integral + 0.01 * rate;
            assert!((f64::from(output) - expected).abs() < 1e-3, "{output} {expected}");
        }
    }

    #[test]
    fn r15_integral_and_derivative_use_the_true_time() {
        for dt in [0.000_25, 0.001, 0.004] {
            let steps = (0.2_f32 / dt).round();
            let dt = Seconds::new(dt);
            let mut integral = IncrementalPidState::new();
            let mut derivative = IncrementalPidState::new();
            let mut step = 0.0;
            while step < steps {
                integral.update(&IncrementalPidConfig::new(0.0, 5.0, 0.0, 100.0), 2.0, 0.0, dt);
                let ramp = 3.0 * step * dt.get();
                derivative.update(&IncrementalPidConfig::new(0.0, 0.0, 0.5, 100.0), ramp, 0.0, dt);
                step += 1.0;
            }
            near(integral.output(), 2.0); // 5 · 2 · 0.2 s
            assert!((derivative.output() - 1.5).abs() < 5e-3, "{derivative:?}"); // 0.5 · 3 per s
        }
    }

    #[test]
    fn the_first_step_has_no_derivative_kick() {
        let config = IncrementalPidConfig::new(2.0, 0.0, 1.0, 1e6);
        near(IncrementalPidState::new().update(&config, 10.0, 0.0, DT), 20.0);
        let mut taken_over = IncrementalPidState::new();
        taken_over.preset(5.0);
        near(taken_over.update(&config, 10.0, 0.0, DT), 5.0);
        near(taken_over.update(&config, 10.0, 0.0, DT), 5.0);
    }

    #[test]
    fn a_preset_takes_over_without_a_bump() {
        let config = IncrementalPidConfig::new(2.0, 10.0, 0.1, 100.0);
        let mut pid = IncrementalPidState::new();
        pid.preset(7.0);
        near(pid.update(&config, 3.0, 1.0, DT), 7.02);
        pid.preset(f32::NAN);
        near(pid.output(), 7.02);
        pid.reset();
        assert_eq!(pid, IncrementalPidState::default());
    }

    #[test]
    fn gains_swap_without_a_bump() {
        let mut pid = IncrementalPidState::new();
        let before = IncrementalPidConfig::new(2.0, 10.0, 0.0, 100.0);
        for _ in 0..100 {
            pid.update(&before, 3.0, 1.0, DT);
        }
        let output = pid.output();
        let after = IncrementalPidConfig::new(40.0, 0.0, 5.0, 100.0);
        near(pid.update(&after, 3.0, 1.0, DT), output);
    }

    #[test]
    fn the_limits_hold_and_nothing_winds_up() {
        let config = IncrementalPidConfig {
            output_min: -1.0,
            ..IncrementalPidConfig::new(0.1, 50.0, 0.0, 4.0)
        };
        let mut pid = IncrementalPidState::new();
        for _ in 0..10_000 {
            assert!(pid.update(&config, 10.0, 0.0, DT) <= 4.0);
        }
        near(pid.output(), 4.0);
        // The very first step of the other sign leaves the limit.
        assert!(pid.update(&config, -1.0, 0.0, DT) < 3.0);
        for _ in 0..10_000 {
            assert!(pid.update(&config, -10.0, 0.0, DT) >= -1.0);
        }
        near(pid.output(), -1.0);
    }

    #[test]
    fn a_smoothed_setpoint_starts_at_the_measurement_and_arrives() {
        let smoothing =
            DifferentiatorConfig { acceleration: 500.0, smoothing: Seconds::new(0.005) };
        let config = IncrementalPidConfig::new(1.0, 0.0, 0.02, 100.0).with_setpoint(smoothing);
        let mut pid = IncrementalPidState::new();
        let mut last = pid.update(&config, 110.0, 100.0, DT);
        near(last, 0.0);
        for _ in 0..1000 {
            let output = pid.update(&config, 110.0, 100.0, DT);
            // At most kp · speed · dt + kd · acceleration · dt, far below the step of 10.
            assert!((output - last).abs() < 0.1, "{last} then {output}");
            last = output;
        }
        near(pid.setpoint(), 110.0);
        near(last, 10.0);
    }

    #[test]
    fn smoothing_can_be_switched_on_while_running() {
        let config = IncrementalPidConfig::new(1.0, 0.0, 0.0, 100.0);
        let smoothing =
            DifferentiatorConfig { acceleration: 500.0, smoothing: Seconds::new(0.005) };
        let mut pid = IncrementalPidState::new();
        pid.update(&config, 30.0, 20.0, DT);
        near(pid.update(&config.with_setpoint(smoothing), 30.0, 20.0, DT), 10.0);
    }

    #[test]
    fn bad_input_changes_nothing() {
        let config = IncrementalPidConfig::new(2.0, 10.0, 0.1, 100.0);
        let mut pid = IncrementalPidState::new();
        pid.update(&config, 3.0, 1.0, DT);
        let before = pid;
        for (setpoint, measured, dt) in [
            (f32::NAN, 1.0, 0.001),
            (3.0, f32::NAN, 0.001),
            (f32::INFINITY, 1.0, 0.001),
            (3.0, f32::NEG_INFINITY, 0.001),
            (f32::MAX, f32::MIN, 0.001),
            (3.0, 9.0, 0.0),
            (3.0, 9.0, -0.001),
            (3.0, 9.0, f32::NAN),
            (3.0, 9.0, f32::INFINITY),
        ] {
            let output = pid.update(&config, setpoint, measured, Seconds::new(dt));
            assert_eq!(output.to_bits(), before.output().to_bits());
            assert_eq!(pid, before);
        }
        for broken in [
            IncrementalPidConfig::new(f32::NAN, 0.0, 0.0, 1.0),
            IncrementalPidConfig::new(1.0, 0.0, 0.0, f32::NAN),
            IncrementalPidConfig::new(1.0, 0.0, 0.0, -1.0),
        ] {
            pid.update(&broken, 9.0, 0.0, DT);
            assert_eq!(pid, before);
        }
    }

    #[test]
    fn the_configuration_is_checked() {
        let good = IncrementalPidConfig::new(1.0, 0.0, 0.0, 20.0);
        assert_eq!(good.validate(), Ok(()));
        let bad_setpoint = DifferentiatorConfig { acceleration: 0.0, smoothing: DT };
        for bad in [
            IncrementalPidConfig { kp: f32::NAN, ..good },
            IncrementalPidConfig { ki: f32::NEG_INFINITY, ..good },
            IncrementalPidConfig { kd: f32::INFINITY, ..good },
            IncrementalPidConfig { output_min: 20.0, ..good },
            IncrementalPidConfig { output_max: f32::NAN, ..good },
            good.with_setpoint(bad_setpoint),
        ] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
    }
}
