//! Soft limits: commands that stay within a range.

use super::{Braking, MotorCommand};
use crate::TotalAngle;
use crate::config::{ConfigError, not_negative};
use crate::maths::within;
use crate::ok;
use crate::profile::AngleSetpoint;
use crate::units::Rpm;

/// The range of an axis.
///
/// ```
/// use rc10_app::mechanism::{Braking, MotorCommand, Limit, SoftLimits};
/// use rc10_app::{Rpm, RpmPerSecond, Seconds, TotalAngle};
/// let degrees = TotalAngle::from_degrees;
/// let range = SoftLimits {
///     lower: degrees(0),
///     upper: degrees(1080),
///     braking: Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.02) },
///     not_homed: Rpm::new(10.0),
/// };
/// assert_eq!(range.validate(), Ok(()));
/// let up = MotorCommand::Speed(Rpm::new(100.0));
/// assert_eq!(range.limit(up, Some(degrees(500))).command, up);
/// let near_the_top = range.limit(up, Some(degrees(1051)));
/// assert_eq!(near_the_top.by, Some(Limit::Upper)); // 60 rpm: it brakes within 29 degrees
/// let beyond = range.limit(MotorCommand::hold(degrees(2000)), Some(degrees(500)));
/// assert_eq!(beyond.command, MotorCommand::hold(degrees(1080)));
/// // Before homing: slowly, and to no angle.
/// assert_eq!(range.limit(up, None).command, MotorCommand::Speed(Rpm::new(10.0)));
/// assert_eq!(range.limit(MotorCommand::hold(degrees(500)), None).command, MotorCommand::STOP);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftLimits {
    /// The least angle, from the axis' zero.
    pub lower: TotalAngle,
    /// The greatest angle, from the axis' zero; > `lower`.
    pub upper: TotalAngle,
    /// How the motor brakes before a limit.
    pub braking: Braking,
    /// Largest speed before the axis is homed; 0 or more. 0: it stands.
    pub not_homed: Rpm,
}

/// Which limit a command met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Limit {
    /// [`SoftLimits::lower`].
    Lower,
    /// [`SoftLimits::upper`].
    Upper,
    /// The axis has no zero yet.
    NotHomed,
    /// The speed asked for is infinite or NaN, or its change is.
    NotFinite,
}

/// A command within limits.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limited {
    /// The command.
    pub command: MotorCommand,
    /// Why it is not the one asked for; `None` if it is.
    pub by: Option<Limit>,
}

impl SoftLimits {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        let upper = self.upper.degrees().get();
        let in_order = self.lower.microdegrees() < self.upper.microdegrees();
        ok!(ConfigError::check(in_order, "upper", upper, "above `lower`"));
        ok!(self.braking.validate(), in "braking");
        not_negative("not_homed", self.not_homed.get())
    }

    /// The part of `wanted` within the limits; `position` from the zero, `None` before it.
    ///
    /// A speed is such that the axis can brake before the limit; an angle is held in the range.
    #[must_use]
    pub fn limit(&self, wanted: MotorCommand, position: Option<TotalAngle>) -> Limited {
        let (command, by) = match (wanted, position) {
            (MotorCommand::Coast, _) => (wanted, None),
            (MotorCommand::Speed(speed), _) if !speed.is_finite() => {
                (MotorCommand::STOP, Some(Limit::NotFinite))
            }
            (MotorCommand::Angle(setpoint), _) if !setpoint.is_finite() => {
                (MotorCommand::STOP, Some(Limit::NotFinite))
            }
            (MotorCommand::Angle(_), None) => (MotorCommand::STOP, Some(Limit::NotHomed)),
            (MotorCommand::Speed(speed), None) => {
                let slow = Rpm::new(within(speed.get(), self.not_homed.get().max(0.0)));
                (MotorCommand::Speed(slow), Some(Limit::NotHomed))
            }
            (MotorCommand::Angle(AngleSetpoint { angle, .. }), Some(_)) if angle < self.lower => {
                (MotorCommand::hold(self.lower), Some(Limit::Lower))
            }
            (MotorCommand::Angle(AngleSetpoint { angle, .. }), Some(_)) if angle > self.upper => {
                (MotorCommand::hold(self.upper), Some(Limit::Upper))
            }
            (MotorCommand::Angle(_), Some(_)) => (wanted, None),
            (MotorCommand::Speed(speed), Some(position)) => {
                let up = self.braking.speed(self.upper.minus(position).degrees()).get();
                let down = -self.braking.speed(position.minus(self.lower).degrees()).get();
                let held = speed.get().min(up).max(down);
                let by = if speed.get() > up { Limit::Upper } else { Limit::Lower };
                (MotorCommand::Speed(Rpm::new(held)), Some(by))
            }
        };
        Limited { command, by: by.filter(|_| command != wanted) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{RpmPerSecond, Seconds};

    const RANGE: SoftLimits = SoftLimits {
        lower: TotalAngle::from_degrees(-90),
        upper: TotalAngle::from_degrees(90),
        braking: Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.02) },
        not_homed: Rpm::ZERO,
    };

    fn limit(rpm: f32, degrees: i32) -> (f32, Option<Limit>) {
        let position = Some(TotalAngle::from_degrees(degrees));
        let Limited { command: MotorCommand::Speed(speed), by } =
            RANGE.limit(MotorCommand::Speed(Rpm::new(rpm)), position)
        else {
            panic!("a speed stays a speed");
        };
        (speed.get(), by)
    }

    #[test]
    fn outside_it_may_only_come_back() {
        assert_eq!(limit(50.0, 95), (0.0, Some(Limit::Upper)));
        assert_eq!(limit(-50.0, 95), (-50.0, None));
        assert_eq!(limit(-50.0, -90), (0.0, Some(Limit::Lower)));
        assert_eq!(limit(50.0, -200), (50.0, None));
        assert_eq!(limit(0.0, 95), (0.0, None));
    }

    #[test]
    fn the_speed_is_that_from_which_it_just_brakes() {
        for degrees in -89..90 {
            let (up, down) = (limit(1e6, degrees), limit(-1e6, degrees));
            assert_eq!((up.1, down.1), (Some(Limit::Upper), Some(Limit::Lower)));
            let way = |speed| RANGE.braking.way(Rpm::new(speed)).get();
            let left = 90 - i16::try_from(degrees).unwrap();
            assert!((way(up.0) - f32::from(left)).abs() < 0.01, "{degrees}: {up:?}");
            assert!((way(down.0) - f32::from(180 - left)).abs() < 0.01, "{degrees}: {down:?}");
        }
    }

    #[test]
    fn what_is_not_finite_or_not_homed_stands() {
        let at = Some(TotalAngle::ZERO);
        for bad in [f32::NAN, f32::INFINITY] {
            let still = AngleSetpoint::at(TotalAngle::ZERO);
            let speed = MotorCommand::Angle(AngleSetpoint { speed: Rpm::new(bad), ..still });
            let acceleration = RpmPerSecond::new(bad);
            let acceleration = MotorCommand::Angle(AngleSetpoint { acceleration, ..still });
            for wanted in [MotorCommand::Speed(Rpm::new(bad)), speed, acceleration] {
                let limited = RANGE.limit(wanted, at);
                assert_eq!(limited.by, Some(Limit::NotFinite));
                assert_eq!(limited.command, MotorCommand::STOP);
            }
        }
        let limited = RANGE.limit(MotorCommand::Speed(Rpm::new(5.0)), None);
        assert_eq!(limited, Limited { command: MotorCommand::STOP, by: Some(Limit::NotHomed) });
        assert_eq!(RANGE.limit(MotorCommand::STOP, None).by, None);
        assert_eq!(RANGE.limit(MotorCommand::Coast, None).by, None);
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(RANGE.validate(), Ok(()));
        let bad = SoftLimits { upper: RANGE.lower, ..RANGE };
        assert_eq!(bad.validate().unwrap_err().field, "upper");
        let bad = SoftLimits { not_homed: Rpm::new(-1.0), ..RANGE };
        assert_eq!(bad.validate().unwrap_err().field, "not_homed");
        let braking = Braking { acceleration: RpmPerSecond::ZERO, ..RANGE.braking };
        let bad = SoftLimits { braking, ..RANGE };
        assert_eq!(bad.validate().unwrap_err().part, "braking");
    }
}
