//! Positional PID controller.
//!
//! The derivative is that of the measurement, through a first-order filter; the proportional part may
//! weight the setpoint. Anti-windup is conditional integration: while the output is limited, the
//! integral takes no step that would push it further into the limit. It needs no tuning, and when the
//! error turns round the output follows at once. With [`PidConfig::tracking`] it is back-calculation
//! instead: the integral is drawn to where the output is just at its limit, which keeps what the
//! integral knows of a load (K. Åström, T. Hägglund, *Advanced PID Control*, 2006, section 3.5).
//!
//! ```
//! use rc10_app::{PidConfig, PidState, Seconds};
//! let config = PidConfig::within(20.0).kp(0.5).ki(2.0);
//! let mut state = PidState::new();
//! let amps = state.update(&config, 100.0, 90.0, 0.0, Seconds::new(0.001));
//! assert!(amps > 5.0 && amps <= 20.0);
//! ```

use crate::config::{ConfigError, not_negative, positive, positive_or_unlimited};
use crate::maths::within;
use crate::ok;
use crate::units::Seconds;

/// Gains and limits. Units: those of the output per those of the measurement.
///
/// Start with [`PidConfig::within`], which switches every refinement off, and set the fields you need.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PidConfig {
    /// Output per error.
    pub kp: f32,
    /// Output per error and second.
    pub ki: f32,
    /// Output per measured change per second: a step of the setpoint gives no kick.
    pub kd: f32,
    /// The output stays within ± this.
    pub output_limit: f32,
    /// The integral's part of the output stays within ± this.
    pub integral_limit: f32,
    /// The integral rests while the error is larger (integral separation); infinite: never.
    pub integral_separation: f32,
    /// Smaller errors count as zero.
    pub deadband: f32,
    /// Time constant of the filter of the derivative; 0: none. A tenth of kd / kp is usual.
    pub derivative_filter: Seconds,
    /// The share of the setpoint for `kp`, 0 ..= 1: below 1 a step of it overshoots less.
    pub setpoint_weight: f32,
    /// Rate of back-calculation, 1/s, usually 1 to 10 times ki / kp; 0: conditional integration.
    pub tracking: f32,
}

impl PidConfig {
    /// No gains, and an output within ± this, of which the integral may use all.
    pub const fn within(output_limit: f32) -> Self {
        Self {
            kp: 0.0,
            ki: 0.0,
            kd: 0.0,
            derivative_filter: Seconds::ZERO,
            setpoint_weight: 1.0,
            tracking: 0.0,
            output_limit,
            integral_limit: output_limit,
            integral_separation: f32::INFINITY,
            deadband: 0.0,
        }
    }

    /// The same with this output per error.
    pub const fn kp(self, kp: f32) -> Self {
        Self { kp, ..self }
    }

    /// The same with this output per error and second.
    pub const fn ki(self, ki: f32) -> Self {
        Self { ki, ..self }
    }

    /// The same with this output per measured change per second.
    pub const fn kd(self, kd: f32) -> Self {
        Self { kd, ..self }
    }

    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        // A negative gain runs away.
        ok!(not_negative("kp", self.kp));
        ok!(not_negative("ki", self.ki));
        ok!(not_negative("kd", self.kd));
        ok!(not_negative("derivative_filter", self.derivative_filter.get()));
        let weight = self.setpoint_weight;
        let is_share = weight >= 0.0 && weight <= 1.0;
        ok!(ConfigError::check(is_share, "setpoint_weight", weight, "0 to 1"));
        ok!(not_negative("tracking", self.tracking));
        ok!(positive("output_limit", self.output_limit));
        ok!(not_negative("integral_limit", self.integral_limit));
        ok!(positive_or_unlimited("integral_separation", self.integral_separation));
        not_negative("deadband", self.deadband)
    }
}

/// The backward difference of `time_constant` · rate' + rate = change / dt.
fn filtered(time_constant: f32, rate: f32, change: f32, dt: f32) -> f32 {
    (time_constant * rate + change) / (time_constant + dt)
}

/// Out of line: a moving thing is seldom within its deadband, or so far off that its integral rests.
#[cold]
fn unusual(config: &PidConfig, error: f32, integrate: bool) -> (f32, bool) {
    let quiet = if error.abs() < config.deadband { 0.0 } else { error };
    (quiet, integrate && error.abs() <= config.integral_separation)
}

/// The measurement as a step has seen it.
#[derive(Clone, Copy)]
enum Seen {
    Nothing,
    Measured(f32),
    /// With its filtered rate of change.
    Moved(f32, f32),
}

/// The input of one step of a PID controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidInput {
    /// Setpoint less measurement.
    pub error: f32,
    /// Added to the output before it is limited.
    pub feed_forward: f32,
    /// Whether the integral may move in this step.
    pub integrate: bool,
}

/// State of a PID controller.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PidState {
    integral: f32,
    last_error: f32,
    output: f32,
    /// NaN before the first step.
    last_measured: f32,
    rate: f32,
}

impl Default for PidState {
    fn default() -> Self {
        Self::new()
    }
}

impl PartialEq for PidState {
    /// To the bit: the same answers to the same inputs.
    fn eq(&self, other: &Self) -> bool {
        let bits = |state: &Self| {
            let Self { integral, last_error, output, last_measured, rate } = *state;
            [integral, last_error, output, last_measured, rate].map(f32::to_bits)
        };
        bits(self) == bits(other)
    }
}

impl PidState {
    /// Nothing integrated, nothing measured.
    pub const fn new() -> Self {
        Self { integral: 0.0, last_error: 0.0, last_measured: f32::NAN, rate: 0.0, output: 0.0 }
    }

    /// Starts over with the output `output` at error zero: no kick from another controller.
    pub const fn preset(&mut self, output: f32) {
        *self = Self::new();
        if output.is_finite() {
            self.integral = output;
            self.output = output;
        }
    }

    /// Starts the integral at zero again.
    pub const fn drop_integral(&mut self) {
        self.integral = 0.0;
    }

    /// Makes `output` the newest output, because something after this controller limited it.
    pub const fn override_output(&mut self, output: f32) {
        if output.is_finite() {
            self.output = output;
        }
    }

    /// The newest output.
    pub const fn output(&self) -> f32 {
        self.output
    }

    /// The integral's part of the output.
    pub const fn integral(&self) -> f32 {
        self.integral
    }

    /// One step. `feed_forward` is added before the limit. An input that is not finite changes
    /// nothing, and the last output is returned again.
    #[inline(always)]
    pub fn update(
        &mut self,
        config: &PidConfig,
        setpoint: f32,
        measured: f32,
        feed_forward: f32,
        dt: Seconds,
    ) -> f32 {
        // Positive and finite, in one comparison.
        let is_step = dt.get().to_bits().wrapping_sub(1) < f32::INFINITY.to_bits() - 1;
        if is_step {
            self.step(config, setpoint, measured, feed_forward, dt.get())
        } else {
            self.stay()
        }
    }

    #[cold]
    const fn stay(&self) -> f32 {
        self.output
    }

    #[inline(always)]
    fn step(
        &mut self,
        config: &PidConfig,
        setpoint: f32,
        measured: f32,
        feed_forward: f32,
        dt: f32,
    ) -> f32 {
        let error = setpoint - measured;
        let left_out = (1.0 - config.setpoint_weight) * setpoint;
        if config.kd == 0.0 {
            let seen = Seen::Measured(measured);
            return self.integrate_and_limit(config, error, left_out, feed_forward, true, dt, seen);
        }
        if self.last_measured.is_nan() {
            return self.first_step(config, setpoint, measured, feed_forward, dt);
        }
        let change = measured - self.last_measured;
        let rate = filtered(config.derivative_filter.get(), self.rate, change, dt);
        let beside = feed_forward - config.kd * rate;
        let seen = Seen::Moved(measured, rate);
        self.integrate_and_limit(config, error, left_out, beside, true, dt, seen)
    }

    /// Nothing was measured before the first step, so nothing has moved.
    #[cold]
    #[inline(never)]
    fn first_step(
        &mut self,
        config: &PidConfig,
        setpoint: f32,
        measured: f32,
        feed_forward: f32,
        dt: f32,
    ) -> f32 {
        if !(setpoint - measured + feed_forward).is_finite() {
            return self.output;
        }
        self.last_measured = measured;
        self.step(config, setpoint, measured, feed_forward, dt)
    }

    /// One step for callers that know the error and the change of the measurement exactly, such as
    /// an integer encoder. `change` tells how far the measurement moved since the last step, and is
    /// asked only if there is a derivative. As [`update`](Self::update) otherwise, but
    /// [`PidConfig::setpoint_weight`] is not used, and the caller checks that `dt` is positive and finite.
    #[inline(always)]
    pub fn update_error(
        &mut self,
        config: &PidConfig,
        input: PidInput,
        change: impl FnOnce() -> f32,
        dt: Seconds,
    ) -> f32 {
        let PidInput { error, mut feed_forward, integrate } = input;
        if config.kd != 0.0 {
            feed_forward -=
                config.kd * self.derivative(config.derivative_filter.get(), change(), dt);
        }
        let seen = Seen::Nothing;
        self.integrate_and_limit(config, error, 0.0, feed_forward, integrate, dt.get(), seen)
    }

    /// Out of line: a division takes as long as all the rest, and most loops have no derivative.
    #[cold]
    fn derivative(&mut self, time_constant: f32, change: f32, dt: Seconds) -> f32 {
        let rate = filtered(time_constant, self.rate, change, dt.get());
        if rate.is_finite() {
            self.rate = rate;
        }
        rate
    }

    /// Integral, proportional part and limit. `left_out`: the setpoint that `kp` does not see.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "in registers: the usual step needs no stack")]
    fn integrate_and_limit(
        &mut self,
        config: &PidConfig,
        error: f32,
        left_out: f32,
        beside: f32,
        integrate: bool,
        dt: f32,
        seen: Seen,
    ) -> f32 {
        // Sizes are ordered as their bits are.
        let size = error.abs().to_bits();
        let is_usual =
            size >= config.deadband.to_bits() && size <= config.integral_separation.to_bits();
        let (error, integrate) =
            if is_usual { (error, integrate) } else { unusual(config, error, integrate) };
        let mut step = 0.0;
        if integrate {
            // Trapezoidal rule: exact for an error that changes linearly between two steps.
            step = config.ki * (0.5 * dt) * (error + self.last_error);
        }
        let integral = within(self.integral + step, config.integral_limit);
        let wanted = beside + config.kp * (error - left_out) + integral;
        // The usual case costs one comparison, which is false for NaN too.
        if wanted.abs() <= config.output_limit {
            self.integral = integral;
            self.output = wanted;
            self.last_error = error;
            match seen {
                Seen::Nothing => (),
                Seen::Measured(measured) => self.last_measured = measured,
                Seen::Moved(measured, rate) => (self.last_measured, self.rate) = (measured, rate),
            }
            wanted
        } else {
            let (measured, rate) = match seen {
                Seen::Nothing => (self.last_measured, self.rate),
                Seen::Measured(measured) => (measured, self.rate),
                Seen::Moved(measured, rate) => (measured, rate),
            };
            self.saturate(config, wanted, integral, step, error, dt, measured, rate)
        }
    }

    /// The output is limited, or something was not finite: then everything stays as it was.
    #[cold]
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "in registers: the usual step needs no stack")]
    fn saturate(
        &mut self,
        config: &PidConfig,
        wanted: f32,
        integral: f32,
        step: f32,
        error: f32,
        dt: f32,
        measured: f32,
        rate: f32,
    ) -> f32 {
        let limit = config.output_limit;
        if wanted.is_finite() {
            self.output = within(wanted, limit);
            if config.tracking > 0.0 && step != 0.0 {
                // A share of the way in a step, and never beyond.
                let share = (config.tracking * dt).min(1.0);
                let drawn = integral + share * (self.output - wanted);
                self.integral = within(drawn, config.integral_limit);
            } else if wanted * step <= 0.0 {
                // Away from the limit the integral may move, further into it not.
                self.integral = integral;
            }
            self.last_error = error;
            (self.last_measured, self.rate) = (measured, rate);
        }
        // Even an output that stays as it was obeys a limit that has been lowered.
        self.output = within(self.output, limit);
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Seconds = Seconds::new(0.001);

    #[test]
    fn the_integral_is_trapezoidal() {
        let config = PidConfig::within(1e6).ki(1.0);
        let mut state = PidState::new();
        // The integral of t over 1 s is 1/2; a rectangle rule would give 0.5005.
        for step in 1..=1000_u16 {
            state.update(&config, f32::from(step) * 1e-3, 0.0, 0.0, MS);
        }
        assert!((state.integral() - 0.5).abs() < 1e-5, "{}", state.integral());
    }

    #[test]
    fn a_setpoint_step_gives_no_derivative_kick_but_a_moving_measurement_does() {
        let config = PidConfig::within(1e6).kd(1.0);
        let mut state = PidState::new();
        assert!(state.update(&config, 0.0, 5.0, 0.0, MS).abs() < f32::EPSILON);
        assert!(state.update(&config, 100.0, 5.0, 0.0, MS).abs() < f32::EPSILON);
        assert!((state.update(&config, 100.0, 5.1, 0.0, MS) + 100.0).abs() < 0.1);
    }

    #[test]
    fn the_derivative_is_filtered() {
        let config =
            PidConfig { derivative_filter: Seconds::new(0.009), ..PidConfig::within(1e6).kd(1.0) };
        let mut state = PidState::new();
        state.update(&config, 0.0, 0.0, 0.0, MS);
        // A step of 1 in 1 ms is a rate of 1000; a tenth of it comes through, and decays by 0.9.
        let first = state.update(&config, 0.0, 1.0, 0.0, MS);
        let second = state.update(&config, 0.0, 1.0, 0.0, MS);
        assert!((first + 100.0).abs() < 1e-3 && (second + 90.0).abs() < 1e-3, "{first} {second}");
    }

    #[test]
    fn a_weighted_setpoint_pushes_less_and_settles_the_same() {
        let config = PidConfig { setpoint_weight: 0.25, ..PidConfig::within(1e3).kp(2.0).ki(10.0) };
        let mut state = PidState::new();
        let first = state.update(&config, 100.0, 0.0, 0.0, MS);
        assert!((first - 50.5).abs() < 1e-3, "{first}");
        // A first-order plant settles without an error all the same.
        let (mut state, mut measured) = (PidState::new(), 0.0_f32);
        for _ in 0..20_000 {
            let effort = state.update(&config, 100.0, measured, 0.0, MS);
            measured += 0.01 * (effort - measured);
        }
        assert!((measured - 100.0).abs() < 0.05, "{measured}");
    }

    #[test]
    fn back_calculation_holds_the_output_near_its_limit() {
        let config = PidConfig { tracking: 50.0, ..PidConfig::within(50.0).kp(1.0).ki(20.0) };
        let mut state = PidState::new();
        for _ in 0..2000 {
            state.update(&config, 100.0, 0.0, 0.0, MS);
        }
        // Where it settles: ki · error = tracking · (wanted - limit), so 40 beyond the limit; the
        // integral of a step is 2.
        let beyond = 100.0 + (state.integral() + 2.0) - 50.0;
        assert!((beyond - 40.0).abs() < 0.5, "{beyond}");
        // Rates beyond a step each are a whole step.
        let config = PidConfig { tracking: 1e9, ..config };
        for _ in 0..100 {
            state.update(&config, 100.0, 0.0, 0.0, MS);
        }
        assert!((state.integral() + 50.0).abs() < 0.1, "{}", state.integral());
    }

    /// `RC10_LIB`: the threshold 0 that its own demo passes kept the integral at 0 for ever.
    #[test]
    fn r5_the_integral_works_unless_separation_is_asked_for() {
        let mut state = PidState::new();
        let mut config = PidConfig::within(100.0).ki(10.0);
        for _ in 0..100 {
            state.update(&config, 1.0, 0.0, 0.0, MS);
        }
        assert!((state.integral() - 0.995).abs() < 1e-3);
        config.integral_separation = 0.5;
        let before = state.integral();
        state.update(&config, 1.0, 0.0, 0.0, MS);
        assert!((state.integral() - before).abs() < f32::EPSILON);
        config.integral_separation = 0.0;
        assert_eq!(config.validate().unwrap_err().field, "integral_separation");
    }

    #[test]
    fn after_saturation_the_integral_does_not_hold_the_output_back() {
        // A plant that cannot follow for 2 s: it stays at 0 while 100 is wanted.
        let config = PidConfig::within(50.0).kp(1.0).ki(20.0);
        let mut state = PidState::new();
        for _ in 0..2000 {
            state.update(&config, 100.0, 0.0, 0.0, MS);
        }
        // Then it overshoots. A mere clamp would hold an integral of 50 against it for 50 ms.
        let first = state.update(&config, 100.0, 120.0, 0.0, MS);
        assert!(first < 0.0, "{first}");
    }

    #[test]
    fn the_integral_still_reaches_what_a_load_takes() {
        // A load of 40 of the 50 the output may be: the integral has to carry all of it.
        let config = PidConfig::within(50.0).kp(1.0).ki(20.0);
        let (mut state, mut speed) = (PidState::new(), 0.0_f32);
        for _ in 0..5000 {
            speed += (state.update(&config, 100.0, speed, 0.0, MS) - 40.0) * 0.01;
        }
        assert!((speed - 100.0).abs() < 0.1 && (state.integral() - 40.0).abs() < 0.1);
    }

    #[test]
    fn feed_forward_passes_through_and_is_limited_with_the_rest() {
        let config = PidConfig::within(10.0).kp(1.0);
        let mut state = PidState::new();
        assert!((state.update(&config, 1.0, 0.0, 5.0, MS) - 6.0).abs() < 1e-6);
        assert!((state.update(&config, 1.0, 0.0, 50.0, MS) - 10.0).abs() < 1e-6);
    }

    #[test]
    fn nothing_that_is_not_finite_gets_in() {
        let config = PidConfig::within(10.0).kp(1.0).ki(10.0).kd(0.1);
        let mut state = PidState::new();
        state.update(&config, 5.0, 1.0, 0.0, MS);
        let before = state;
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            state.update(&config, bad, 1.0, 0.0, MS);
            state.update(&config, 5.0, bad, 0.0, MS);
            state.update(&config, 5.0, 1.0, bad, MS);
            state.update(&config, 5.0, 1.0, 0.0, Seconds::new(bad));
        }
        state.update(&config, 5.0, 1.0, 0.0, Seconds::ZERO);
        state.update(&config, 5.0, 1.0, 0.0, Seconds::new(-1.0));
        assert_eq!(state, before);
    }

    #[test]
    fn an_output_that_stays_as_it_was_obeys_a_lowered_limit() {
        let config = PidConfig::within(10.0).kp(1.0);
        let mut state = PidState::new();
        state.update(&config, 8.0, 0.0, 0.0, MS);
        let lowered = PidConfig::within(2.0).kp(1.0);
        assert!((state.update(&lowered, f32::NAN, 0.0, 0.0, MS) - 2.0).abs() < 1e-6);
        assert!((state.output() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_deadband_keeps_small_errors_quiet() {
        let config = PidConfig { deadband: 0.5, ..PidConfig::within(10.0).kp(1.0).ki(10.0) };
        let mut state = PidState::new();
        for _ in 0..100 {
            assert!(state.update(&config, 0.4, 0.0, 0.0, MS).abs() < f32::EPSILON);
        }
    }

    #[test]
    fn preset_takes_over_without_a_kick() {
        let config = PidConfig::within(10.0).kp(1.0).ki(1.0);
        let mut state = PidState::new();
        state.preset(4.0);
        assert!((state.update(&config, 100.0, 100.0, 0.0, MS) - 4.0).abs() < 1e-6);
    }
}
