//! Rate limiter: a value that moves towards its target no faster than allowed, and arrives exactly.

use crate::config::{ConfigError, positive};
use crate::units::Seconds;

/// Limits of the rate of a [`Ramp`], up and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RampConfig {
    /// Fastest increase (towards +∞), in units of the value per second; > 0.
    pub rising: f32,
    /// Fastest decrease (towards −∞), in units of the value per second; > 0.
    pub falling: f32,
}

impl RampConfig {
    /// The same rate up and down.
    pub const fn symmetric(rate: f32) -> Self {
        Self { rising: rate, falling: rate }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is not finite or not positive.
    pub fn validate(&self) -> Result<(), ConfigError> {
        positive("rising", self.rising)?;
        positive("falling", self.falling)
    }
}

/// State of a rate limiter.
///
/// ```
/// use rc10_app::ramp::{Ramp, RampConfig};
/// use rc10_app::Seconds;
/// let config = RampConfig { rising: 100.0, falling: 400.0 }; // rpm per second
/// let mut speed = Ramp::at(30.0); // what the motor turns at now
/// assert_eq!(speed.update(&config, 1000.0, Seconds::new(0.5)), 80.0);
/// assert_eq!(speed.update(&config, 0.0, Seconds::new(0.5)), 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp {
    value: f32,
}

impl Ramp {
    /// A ramp that starts at a measured value, in the unit of the target. [`Ramp::default`] starts
    /// at 0.
    pub const fn at(value: f32) -> Self {
        Self { value }
    }

    /// The present value of the ramp, in the unit of the target.
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Jumps to a measured value; one that is not finite is ignored.
    pub const fn reset(&mut self, measured: f32) {
        if measured.is_finite() {
            self.value = measured;
        }
    }

    /// Moves towards `target` for `dt` and returns the new value. The last step lands exactly on
    /// the target.
    ///
    /// A target that is not finite, or a `dt` that is not finite and positive, leaves the state
    /// unchanged and returns the last value.
    pub fn update(&mut self, config: &RampConfig, target: f32, dt: Seconds) -> f32 {
        let dt = dt.get();
        if !(target.is_finite() && dt.is_finite()) {
            return self.value;
        }
        // A step that is negative or not a number becomes 0: the ramp stands instead of jumping.
        let (rise, fall) = ((config.rising * dt).max(0.0), (config.falling * dt).max(0.0));
        let next = target.max(self.value - fall).min(self.value + rise);
        if next.is_finite() {
            self.value = next;
        }
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: RampConfig = RampConfig { rising: 10.0, falling: 30.0 };
    const DT: Seconds = Seconds::new(0.01);

    /// Steps until `target` is reached exactly.
    fn steps(ramp: &mut Ramp, target: f32) -> u32 {
        for step in 1..10_000 {
            if ramp.update(&CONFIG, target, DT).to_bits() == target.to_bits() {
                return step;
            }
        }
        panic!("never arrived at {target}, but {ramp:?}");
    }

    #[test]
    fn each_direction_has_its_rate_and_arrival_is_exact() {
        let mut ramp = Ramp::at(-1.05);
        assert_eq!(steps(&mut ramp, 1.0), 21);
        assert_eq!(steps(&mut ramp, -1.05), 7);
        assert_eq!(ramp.update(&CONFIG, -1.05, DT).to_bits(), (-1.05_f32).to_bits());
    }

    #[test]
    fn no_step_is_larger_than_allowed_for_its_time() {
        let mut ramp = Ramp::default();
        let mut target = 5.0;
        for step in 0..1000_u16 {
            if step % 97 == 0 {
                target = -target;
            }
            let dt = 0.001 * f32::from(step % 7 + 1);
            let before = ramp.value();
            let change = ramp.update(&CONFIG, target, Seconds::new(dt)) - before;
            assert!(change <= 10.0 * dt + 1e-6 && change >= -30.0 * dt - 1e-6, "{change} in {dt}");
        }
    }

    #[test]
    fn bad_targets_and_bad_times_change_nothing() {
        let mut ramp = Ramp::at(2.0);
        for (target, dt) in [
            (f32::NAN, 0.001),
            (f32::NEG_INFINITY, 0.001),
            (9.0, 0.0),
            (9.0, -0.001),
            (9.0, f32::NAN),
            (9.0, f32::INFINITY),
        ] {
            ramp.update(&CONFIG, target, Seconds::new(dt));
            assert_eq!(ramp, Ramp::at(2.0));
        }
        for broken in [RampConfig::symmetric(f32::NAN), RampConfig::symmetric(-1.0)] {
            ramp.update(&broken, 9.0, DT);
            ramp.update(&broken, -9.0, DT);
        }
        assert_eq!(ramp, Ramp::at(2.0));
        ramp.reset(f32::NAN);
        assert_eq!(ramp, Ramp::at(2.0));
        ramp.reset(-7.0);
        assert_eq!(ramp, Ramp::at(-7.0));
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CONFIG.validate(), Ok(()));
        assert_eq!(RampConfig::symmetric(2.0), RampConfig { rising: 2.0, falling: 2.0 });
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(RampConfig { rising: bad, falling: 1.0 }.validate().is_err());
            assert!(RampConfig { rising: 1.0, falling: bad }.validate().is_err());
        }
    }
}
