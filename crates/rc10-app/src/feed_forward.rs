//! Feed-forward: the effort that a known motion takes, before any error is seen.
//!
//! effort = `friction` · sign(speed) + `per_rpm` · speed + `per_rpm_s` · acceleration + gravity
//!
//! These are the ks, kv, ka and kg of other libraries. The loops then only correct what the model does
//! not know: an error of 30 % in `per_rpm_s` leaves them 30 % of the effort, not all of it.
//!
//! ```
//! use rc10_app::{Degrees, FeedForward, Gravity, Rpm, RpmPerSecond};
//! // An arm that weighs 0.8 A when it is level, which is at 30 degrees.
//! let arm = FeedForward {
//!     friction: 0.3,
//!     per_rpm_s: 0.01,
//!     gravity: Gravity::Arm { effort: 0.8, level: Degrees::new(30.0) },
//!     ..FeedForward::NONE
//! };
//! let effort = arm.effort(Rpm::new(60.0), RpmPerSecond::new(100.0), Degrees::new(90.0));
//! assert!((effort - (0.3 + 1.0 + 0.4)).abs() < 1e-5);
//! ```

use crate::config::{ConfigError, finite, not_negative};
use crate::maths;
use crate::ok;
use crate::units::{Degrees, NewtonMetres, Rpm, RpmPerSecond};

/// The effort of a motion, in the actuator's unit: A, N m or a share of the full voltage.
///
/// Measure it: `friction` and `per_rpm` at two slow, steady speeds; `gravity` while holding;
/// `per_rpm_s` is inertia over torque constant, or what makes a ramp fit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FeedForward {
    /// Effort against dry friction, whichever way it moves; ks, 0 or more. All of it from 1 rpm on.
    pub friction: f32,
    /// Effort per rpm: viscous friction, or the back-EMF where the effort is a voltage; kv.
    pub per_rpm: f32,
    /// Effort per rpm/s: the inertia; ka, 0 or more.
    pub per_rpm_s: f32,
    /// Effort against the weight.
    pub gravity: Gravity,
}

/// The effort that holds a mechanism against its weight; kg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Gravity {
    /// Nothing hangs on it, or it turns upright.
    #[default]
    None,
    /// The same everywhere: a lift on a rope or a screw.
    Lift(f32),
    /// An arm: `effort` where it is level, and less with the cosine of the angle from there.
    Arm {
        /// The effort that holds it level.
        effort: f32,
        /// The angle of the shaft at which it is level.
        level: Degrees,
    },
}

impl Gravity {
    /// The effort at an angle of the shaft.
    #[must_use]
    pub fn at(&self, angle: Degrees) -> f32 {
        match *self {
            Self::None => 0.0,
            Self::Lift(effort) => effort,
            Self::Arm { effort, level } => {
                let (_, cos) = maths::sin_cos((angle - level).get().to_radians());
                effort * cos
            }
        }
    }

    const fn validate(&self) -> Result<(), ConfigError> {
        match self {
            Self::None => Ok(()),
            Self::Lift(effort) => finite("gravity", *effort),
            Self::Arm { effort, level } => {
                ok!(finite("gravity.effort", *effort));
                finite("gravity.level", level.get())
            }
        }
    }
}

/// The weights of an arm of two joints: each motor holds its own link and what hangs on it.
///
/// The first joint counts upwards from the horizontal. The second is **relative**, as a motor at the elbow
/// counts: 0 where the arm is stretched. (A belt from the base keeps the second link's angle to the ground:
/// then each joint has a [`Gravity::Arm`] of its own, the first with the whole second mass at `upper_length_m`.)
///
/// [`torques`](Self::torques) over the motor's torque constant go beside the feed-forward of its loops, which
/// then has no gravity: as the `effort` of a motion.
///
/// ```
/// use rc10_app::{Degrees, TwoJointArm};
/// const ARM: TwoJointArm = TwoJointArm {
///     upper_mass_kg: 1.0,
///     upper_centre_m: 0.15,
///     upper_length_m: 0.3,
///     fore_mass_kg: 0.5,
///     fore_centre_m: 0.1,
/// };
/// const _: () = assert!(ARM.validate().is_ok());
/// // Upper arm level, forearm hanging down: it pulls at the elbow's place, and does not turn it.
/// let [shoulder, elbow] = ARM.torques([Degrees::ZERO, Degrees::new(-90.0)]);
/// assert!((shoulder.get() - 9.80665 * (0.15 + 0.15)).abs() < 1e-4 && elbow.get().abs() < 1e-4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoJointArm {
    /// Mass of the first link, with the elbow's motor on it, kg; 0 or more.
    pub upper_mass_kg: f32,
    /// From the first joint to the first link's centre of mass, m.
    pub upper_centre_m: f32,
    /// From the first joint to the second, m; 0 or more.
    pub upper_length_m: f32,
    /// Mass of the second link, with what it carries, kg; 0 or more.
    pub fore_mass_kg: f32,
    /// From the second joint to the second link's centre of mass, m.
    pub fore_centre_m: f32,
}

/// Standard gravity, m/s².
const GRAVITY: f32 = 9.806_65;

impl TwoJointArm {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(not_negative("upper_mass_kg", self.upper_mass_kg));
        ok!(finite("upper_centre_m", self.upper_centre_m));
        ok!(not_negative("upper_length_m", self.upper_length_m));
        ok!(not_negative("fore_mass_kg", self.fore_mass_kg));
        finite("fore_centre_m", self.fore_centre_m)
    }

    /// The torques that hold it at these angles of its joints.
    #[must_use]
    pub fn torques(&self, [shoulder, elbow]: [Degrees; 2]) -> [NewtonMetres; 2] {
        let cos = |angle: Degrees| maths::sin_cos(angle.get().to_radians()).1;
        let fore = self.fore_mass_kg * self.fore_centre_m * cos(shoulder + elbow);
        let upper =
            self.upper_mass_kg * self.upper_centre_m + self.fore_mass_kg * self.upper_length_m;
        [upper * cos(shoulder) + fore, fore].map(|moment| NewtonMetres::new(GRAVITY * moment))
    }
}

impl FeedForward {
    /// No effort.
    pub const NONE: Self =
        Self { friction: 0.0, per_rpm: 0.0, per_rpm_s: 0.0, gravity: Gravity::None };

    /// The effort of the speed alone, per rpm.
    pub const fn of_speed(per_rpm: f32) -> Self {
        Self { per_rpm, ..Self::NONE }
    }

    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(not_negative("friction", self.friction));
        ok!(finite("per_rpm", self.per_rpm));
        ok!(not_negative("per_rpm_s", self.per_rpm_s));
        self.gravity.validate()
    }

    /// The effort of a motion.
    #[must_use]
    pub fn effort(&self, speed: Rpm, acceleration: RpmPerSecond, angle: Degrees) -> f32 {
        let of_speed = self.at_speed(speed.get());
        of_speed + self.per_rpm_s * acceleration.get() + self.gravity.at(angle)
    }

    /// The effort at a constant speed in rpm, without gravity.
    pub(crate) fn at_speed(&self, speed: f32) -> f32 {
        // All of it from 1 rpm on: a reference that trembles about zero is no motion.
        let moves = speed.abs() > 1.0;
        let friction = if moves { self.friction.copysign(speed) } else { self.friction * speed };
        friction + self.per_rpm * speed
    }

    /// The same behind another gearbox, of which the output shaft turns `factor` times slower: the
    /// rotor is driven as before, and the weight at the output shaft stays.
    pub const fn geared(mut self, factor: f32) -> Self {
        self.per_rpm *= factor;
        self.per_rpm_s *= factor;
        self.gravity = match self.gravity {
            Gravity::None => Gravity::None,
            Gravity::Lift(effort) => Gravity::Lift(effort / factor),
            Gravity::Arm { effort, level } => Gravity::Arm { effort: effort / factor, level },
        };
        self
    }
}

impl Default for FeedForward {
    fn default() -> Self {
        Self::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_against_the_motion_and_nothing_at_rest() {
        let friction = FeedForward { friction: 0.5, ..FeedForward::NONE };
        for (rpm, effort) in [(3.0, 0.5), (-0.1, -0.05), (0.0, 0.0), (-0.0, 0.0)] {
            assert!((friction.at_speed(rpm) - effort).abs() < 1e-6, "{rpm}");
        }
    }

    #[test]
    fn an_arm_weighs_most_where_it_is_level() {
        let arm = Gravity::Arm { effort: 2.0, level: Degrees::new(90.0) };
        for (degrees, effort) in [(90.0, 2.0), (0.0, 0.0), (150.0, 1.0), (270.0, -2.0)] {
            assert!((arm.at(Degrees::new(degrees)) - effort).abs() < 1e-5, "{degrees}");
        }
    }

    #[test]
    fn an_arm_of_two_joints_is_checked() {
        let arm = TwoJointArm {
            upper_mass_kg: 1.0,
            upper_centre_m: -0.1,
            upper_length_m: 0.3,
            fore_mass_kg: 0.0,
            fore_centre_m: 0.1,
        };
        assert_eq!(arm.validate(), Ok(()));
        let field = |arm: TwoJointArm| arm.validate().unwrap_err().field;
        assert_eq!(field(TwoJointArm { upper_mass_kg: -1.0, ..arm }), "upper_mass_kg");
        assert_eq!(field(TwoJointArm { upper_centre_m: f32::NAN, ..arm }), "upper_centre_m");
        assert_eq!(field(TwoJointArm { upper_length_m: -0.1, ..arm }), "upper_length_m");
        assert_eq!(field(TwoJointArm { fore_mass_kg: f32::INFINITY, ..arm }), "fore_mass_kg");
        assert_eq!(field(TwoJointArm { fore_centre_m: f32::NAN, ..arm }), "fore_centre_m");
    }

    #[test]
    fn behind_a_gearbox_the_rotor_takes_as_much_and_the_weight_by_so_much_less() {
        for (sign, factor) in [(1.0, 2.0), (-1.0, 2.0), (1.0, 0.25), (-1.0, 0.25)] {
            let own =
                FeedForward { friction: 0.5, per_rpm: 0.1, per_rpm_s: 0.02, ..FeedForward::NONE };
            let lift = FeedForward { gravity: Gravity::Lift(sign * 3.0), ..own }.geared(factor);
            let (per_rpm, per_rpm_s) = (0.1 * factor, 0.02 * factor);
            let gravity = Gravity::Lift(sign * 3.0 / factor);
            assert_eq!(lift, FeedForward { per_rpm, per_rpm_s, gravity, ..own });
            let level = Degrees::new(30.0);
            let arm = Gravity::Arm { effort: sign * 3.0, level };
            let arm = FeedForward { gravity: arm, ..own }.geared(factor);
            let gravity = Gravity::Arm { effort: sign * 3.0 / factor, level };
            assert_eq!(arm, FeedForward { per_rpm, per_rpm_s, gravity, ..own });
            let nothing = own.geared(factor);
            assert_eq!(nothing, FeedForward { per_rpm, per_rpm_s, ..own });
        }
    }

    #[test]
    fn what_cannot_be_is_named() {
        let field = |feed_forward: FeedForward| feed_forward.validate().unwrap_err().field;
        let none = FeedForward::NONE;
        assert_eq!(none.validate(), Ok(()));
        assert_eq!(field(FeedForward { friction: -1.0, ..none }), "friction");
        assert_eq!(field(FeedForward { per_rpm: f32::NAN, ..none }), "per_rpm");
        assert_eq!(field(FeedForward { per_rpm_s: f32::INFINITY, ..none }), "per_rpm_s");
        let gravity = Gravity::Lift(f32::NAN);
        assert_eq!(field(FeedForward { gravity, ..none }), "gravity");
        let gravity = Gravity::Arm { effort: 1.0, level: Degrees::new(f32::NAN) };
        assert_eq!(field(FeedForward { gravity, ..none }), "gravity.level");
    }
}
