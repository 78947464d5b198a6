//! First-order low-pass filter, exact for any sampling time.
//!
//! The filter is the solution of `τ · dy/dt = x − y` for an input that holds between two samples:
//! `y += (1 − exp(−dt/τ)) · (x − y)`. The usual approximation `dt/(τ + dt)` filters differently at
//! 1 kHz and at 500 Hz; with the exponential, two steps of `dt` are one step of `2 dt`, so a late
//! or missed cycle changes nothing but the number of samples.

use crate::config::{ConfigError, positive};
use crate::units::Seconds;

/// The setting of a [`LowPass`]: its time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPassConfig {
    /// Time after which 63 % of a step has come through; > 0.
    pub time_constant: Seconds,
}

impl LowPassConfig {
    /// A filter that halves the power of a sine of this frequency (its −3 dB point), in hertz, > 0.
    pub const fn from_cutoff(hertz: f32) -> Self {
        Self { time_constant: Seconds::new(1.0 / (core::f32::consts::TAU * hertz)) }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is not finite or not positive.
    pub fn validate(&self) -> Result<(), ConfigError> {
        positive("time_constant", self.time_constant.get())
    }
}

/// State of a first-order low-pass filter. The first sample sets it: it does not creep up from 0.
///
/// ```
/// use rc10_app::low_pass::{LowPass, LowPassConfig};
/// use rc10_app::Seconds;
/// let config = LowPassConfig { time_constant: Seconds::new(0.010) };
/// let mut current = LowPass::new();
/// assert_eq!(current.update(&config, 4.0, Seconds::new(0.001)), 4.0);
/// let next = current.update(&config, 5.0, Seconds::new(0.001));
/// assert!((next - 4.0952).abs() < 1e-4);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LowPass {
    value: Option<f32>,
}

impl LowPass {
    /// A filter that has seen no sample.
    pub const fn new() -> Self {
        Self { value: None }
    }

    /// The filtered value, in the unit of the samples; `None` before the first sample.
    pub const fn value(&self) -> Option<f32> {
        self.value
    }

    /// Forgets everything: the next sample sets the state again.
    pub const fn reset(&mut self) {
        *self = Self::new();
    }

    /// Takes a sample, `dt` after the one before, and returns the filtered value.
    ///
    /// A sample that is not finite, or a `dt` that is not finite and positive, leaves the state
    /// unchanged and returns the last value (0 if there is none). The first sample needs no `dt`.
    pub fn update(&mut self, config: &LowPassConfig, sample: f32, dt: Seconds) -> f32 {
        let next = match self.value {
            None => sample,
            Some(value) if dt.is_step() => {
                let share = -crate::maths::exp_m1(-dt.get() / config.time_constant.get());
                value + share * (sample - value)
            }
            Some(value) => value,
        };
        if next.is_finite() {
            self.value = Some(next);
        }
        self.value.unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: LowPassConfig = LowPassConfig { time_constant: Seconds::new(0.02) };

    fn run(steps: u16, dt: f32) -> f32 {
        let mut filter = LowPass::new();
        filter.update(&CONFIG, 0.0, Seconds::new(dt));
        for _ in 0..steps {
            filter.update(&CONFIG, 1.0, Seconds::new(dt));
        }
        filter.value().unwrap()
    }

    #[test]
    fn a_step_follows_the_exponential_whatever_the_sampling_time() {
        let expected = 1.0 - (-1.0_f32).exp();
        for (steps, dt) in [(1, 0.02), (4, 0.005), (20, 0.001), (200, 0.000_1)] {
            assert!((run(steps, dt) - expected).abs() < 2e-6, "{steps} steps of {dt} s");
        }
    }

    #[test]
    fn a_step_far_longer_than_the_time_constant_arrives_and_does_not_overshoot() {
        assert!((run(1, 10.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_cutoff_is_the_half_power_point() {
        let config = LowPassConfig::from_cutoff(10.0);
        let (mut filter, mut peak) = (LowPass::new(), 0.0_f32);
        for step in 0..100_000_u32 {
            let time = f64::from(step) * 1e-5;
            let sine = (core::f64::consts::TAU * 10.0 * time).sin();
            #[expect(clippy::cast_possible_truncation, reason = "a sine fits")]
            let value = filter.update(&config, sine as f32, Seconds::new(1e-5));
            if time > 0.5 {
                peak = peak.max(value);
            }
        }
        assert!((peak - core::f32::consts::FRAC_1_SQRT_2).abs() < 1e-3, "{peak}");
    }

    #[test]
    fn the_first_sample_sets_the_state_and_reset_forgets() {
        let dt = Seconds::new(0.001);
        let mut filter = LowPass::new();
        assert_eq!(filter.value(), None);
        assert_eq!(filter.update(&CONFIG, f32::NAN, dt).to_bits(), 0);
        assert_eq!(filter.value(), None);
        filter.update(&CONFIG, -3.0, Seconds::new(f32::NAN));
        assert_eq!(filter.value(), Some(-3.0));
        filter.reset();
        assert_eq!(filter.value(), None);
    }

    #[test]
    fn bad_samples_and_bad_times_change_nothing() {
        let mut filter = LowPass::new();
        filter.update(&CONFIG, 2.0, Seconds::new(0.001));
        let before = filter;
        for (sample, dt) in [
            (f32::NAN, 0.001),
            (f32::INFINITY, 0.001),
            (9.0, 0.0),
            (9.0, -0.001),
            (9.0, f32::NAN),
            (9.0, f32::INFINITY),
        ] {
            assert_eq!(
                filter.update(&CONFIG, sample, Seconds::new(dt)).to_bits(),
                2.0_f32.to_bits()
            );
            assert_eq!(filter, before);
        }
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CONFIG.validate(), Ok(()));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(LowPassConfig { time_constant: Seconds::new(bad) }.validate().is_err());
        }
    }
}
