//! Gain schedule: gains that depend on something measured, such as a speed or a load.
//!
//! ```
//! use rc10_app::{GainSchedule, Gains};
//! // Gentle while the base stands, so that it does not hunt on its wheels; firm at 1 m/s and above.
//! const HEADING: GainSchedule<2> = GainSchedule::checked([
//!     (0.0, Gains { kp: 2.0, ki: 0.0, kd: 0.0 }),
//!     (1.0, Gains { kp: 6.0, ki: 0.0, kd: 0.1 }),
//! ]);
//! assert_eq!(HEADING.at(0.5), Gains { kp: 4.0, ki: 0.0, kd: 0.05 });
//! assert_eq!(HEADING.at(3.0).kp, 6.0);
//! ```

use crate::config::{ConfigError, finite};
use crate::ok;
use crate::pid::PidConfig;

/// The gains of one loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gains {
    /// Proportional, 0 or more.
    pub kp: f32,
    /// Integral, per second, 0 or more.
    pub ki: f32,
    /// Derivative, times seconds, 0 or more.
    pub kd: f32,
}

/// Gains at N values, with straight lines between them and constant beyond the ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainSchedule<const N: usize> {
    points: [(f32, Gains); N],
}

impl<const N: usize> GainSchedule<N> {
    /// One point at least; their values rise.
    ///
    /// # Errors
    /// The first value or gain that cannot be used.
    pub const fn new(points: [(f32, Gains); N]) -> Result<Self, ConfigError> {
        ok!(ConfigError::check(N > 0, "points", 0.0, "at least one"));
        let mut index = 0;
        while index < N {
            let (value, gains) = points[index];
            ok!(finite("points", value));
            let rises = index == 0 || points[index - 1].0 < value;
            ok!(ConfigError::check(rises, "points", value, "above the value before it"));
            ok!(PidConfig::within(1.0).with_gains(gains).validate());
            index += 1;
        }
        Ok(Self { points })
    }

    /// Like [`new`](Self::new), but panics: in a constant, what cannot be used does not compile.
    #[must_use]
    pub const fn checked(points: [(f32, Gains); N]) -> Self {
        match Self::new(points) {
            Ok(schedule) => schedule,
            Err(error) => panic!("{}", error.text().as_str()),
        }
    }

    /// The gains at a value; those of the first point for NaN.
    #[must_use]
    pub const fn at(&self, value: f32) -> Gains {
        let mut before = self.points[0];
        let mut index = 1;
        while index < N {
            let after = self.points[index];
            index += 1;
            if value < after.0 {
                let share =
                    if value > before.0 { (value - before.0) / (after.0 - before.0) } else { 0.0 };
                let (from, to) = (before.1, after.1);
                return Gains {
                    kp: from.kp + share * (to.kp - from.kp),
                    ki: from.ki + share * (to.ki - from.ki),
                    kd: from.kd + share * (to.kd - from.kd),
                };
            }
            if value >= after.0 {
                before = after;
            }
        }
        before.1
    }
}

impl PidConfig {
    /// The same with other gains.
    pub const fn with_gains(self, gains: Gains) -> Self {
        let Gains { kp, ki, kd } = gains;
        Self { kp, ki, kd, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn kp(kp: f32) -> Gains {
        Gains { kp, ki: 0.0, kd: 0.0 }
    }

    #[test]
    fn it_goes_straight_from_point_to_point() {
        let schedule = GainSchedule::checked([(-1.0, kp(4.0)), (1.0, kp(2.0)), (2.0, kp(10.0))]);
        for (value, gain) in [
            (-5.0, 4.0),
            (-1.0, 4.0),
            (0.0, 3.0),
            (1.0, 2.0),
            (1.5, 6.0),
            (2.0, 10.0),
            (1e30, 10.0),
            (f32::NAN, 4.0),
            (f32::NEG_INFINITY, 4.0),
            (f32::INFINITY, 10.0),
        ] {
            assert!((schedule.at(value).kp - gain).abs() < 1e-6, "{value}");
        }
        assert_eq!(GainSchedule::checked([(0.0, kp(1.0))]).at(7.0), kp(1.0));
        // Each gain by itself.
        let gains = |kp, ki, kd| Gains { kp, ki, kd };
        let schedule =
            GainSchedule::checked([(0.0, gains(1.0, 8.0, 16.0)), (4.0, gains(5.0, 2.0, 32.0))]);
        assert_eq!(schedule.at(1.0), gains(2.0, 6.5, 20.0));
        assert_eq!(schedule.at(-1.0), gains(1.0, 8.0, 16.0));
        assert_eq!(schedule.at(4.0), gains(5.0, 2.0, 32.0));
        let config = PidConfig::within(7.0).kp(9.0).ki(9.0).kd(9.0).with_gains(schedule.at(1.0));
        assert_eq!(config, PidConfig::within(7.0).kp(2.0).ki(6.5).kd(20.0));
    }

    #[test]
    fn what_cannot_be_is_named() {
        let error = |points: [(f32, Gains); 2]| GainSchedule::new(points).unwrap_err();
        assert_eq!(error([(1.0, kp(1.0)), (1.0, kp(1.0))]).must_be, "above the value before it");
        assert_eq!(error([(f32::NAN, kp(1.0)), (1.0, kp(1.0))]).field, "points");
        assert_eq!(error([(0.0, kp(1.0)), (1.0, kp(-1.0))]).field, "kp");
        assert!(GainSchedule::<0>::new([]).is_err());
    }
}
