//! Absolute encoders: where a joint counts from, without homing.

use crate::angle::{CountsPerTurn, TotalAngle};
use crate::config::{ConfigError, not_negative};
use crate::ok;
use crate::units::{Degrees, Gear};

/// A joint on an absolute encoder: what that says where the joint is level, and the joint's travel.
///
/// An encoder knows its angle within a turn, not the turn: an arm that rests 5 degrees below level may be
/// told as 355. Of all angles that a reading may mean, one at most is in a travel of less than a turn.
///
/// ```
/// use rc10_app::mechanism::AbsoluteEncoder;
/// use rc10_app::{Degrees, Gear, TotalAngle};
/// let degrees = TotalAngle::from_degrees;
/// const ARM: AbsoluteEncoder = AbsoluteEncoder {
///     level: TotalAngle::from_degrees(30), // read on the robot, with the arm held level
///     gear: Gear::DIRECT,
///     lower: TotalAngle::from_degrees(-5),
///     upper: TotalAngle::from_degrees(130),
///     tolerance: Degrees::new(2.0),
/// };
/// const _: () = assert!(ARM.validate().is_ok());
/// assert_eq!(ARM.zero(degrees(25)), Ok(degrees(30))); // 5 degrees below level
/// let mounted_anew = ARM.with_level(Degrees::new(20.5));
/// assert_eq!(mounted_anew.zero(degrees(25)), Ok(TotalAngle::from_microdegrees(20_500_000)));
/// assert_eq!(ARM.zero(degrees(385)), Ok(degrees(390))); // the same, counted a turn on
/// let error = ARM.zero(degrees(200)).unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "the motor counts 200 deg: that is 170 deg from level, but the joint's travel is -5 deg to 130 deg"
/// );
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AbsoluteEncoder {
    /// What the motor counts while the joint is level, in any turn of the encoder.
    pub level: TotalAngle,
    /// Turns of the encoder (rotor) that make turns of the shaft that the motor counts (output):
    /// [`Gear::DIRECT`] where it sits on that shaft, 36 : 1 where it sits on the rotor of an M2006.
    pub gear: Gear,
    /// The lower end of the travel, from level.
    pub lower: TotalAngle,
    /// The upper end of the travel, from level; > `lower`. With `tolerance` at both ends the travel is less
    /// than a turn of the encoder.
    pub upper: TotalAngle,
    /// A reading may be beyond an end by this, as noise and a soft stop make it; 0 or more.
    pub tolerance: Degrees,
}

impl AbsoluteEncoder {
    /// The same with another [`level`](Self::level), if it is a finite number: a parameter that a team sets, and keeps
    /// over a power-off, when the encoder was mounted anew.
    #[must_use]
    pub fn with_level(self, level: Degrees) -> Self {
        Self { level: TotalAngle::try_from_degrees(level).unwrap_or(self.level), ..self }
    }

    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        let (travel, tolerance) =
            (self.upper.minus(self.lower).degrees().get(), self.tolerance.get());
        ok!(ConfigError::check(travel > 0.0, "upper", self.upper.degrees().get(), "above `lower`"));
        ok!(not_negative("tolerance", tolerance));
        let is_one_turn = (travel + 2.0 * tolerance) * self.gear.ratio() < 360.0;
        let must_be =
            "less than a turn of the encoder above `lower`, with `tolerance` at both ends";
        ConfigError::check(is_one_turn, "upper", self.upper.degrees().get(), must_be)
    }

    /// The angle of the motor at which the joint is level, by what it counts now: for
    /// [`Measured::counted_from`](super::Measured::counted_from) and [`MotorCommand::shifted`](super::MotorCommand::shifted).
    ///
    /// Ask anew whenever the motor was not driven: then it does not matter where its turns are counted from,
    /// nor whether they had to be estimated.
    ///
    /// # Errors
    /// [`OutOfTravel`] if the joint cannot be there: the motor was mounted anew, or a belt has slipped.
    pub fn zero(&self, counted: TotalAngle) -> Result<TotalAngle, OutOfTravel> {
        let Self { level, gear, lower, upper, .. } = *self;
        let turns = CountsPerTurn::new(gear.rotor_turns(), gear.output_turns());
        let half = TotalAngle::from_microdegrees(upper.minus(lower).microdegrees() / 2);
        let middle = lower.plus(half);
        // The turn in which it is nearest to the middle of the travel.
        let to_middle = middle.minus(counted.minus(level));
        let zero = level.minus(TotalAngle::from_counts(to_middle.counts_at(turns), turns));
        let joint = counted.minus(zero);
        let beyond = joint.minus(middle).degrees().abs() - half.degrees();
        if beyond.get() <= self.tolerance.get() {
            Ok(zero)
        } else {
            Err(OutOfTravel { counted, joint, lower, upper })
        }
    }
}

/// A reading of an absolute encoder that no angle in the joint's travel has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error(
    "the motor counts {counted}: that is {joint} from level, but the joint's travel is {lower} to {upper}"
)]
pub struct OutOfTravel {
    /// What the motor counted.
    pub counted: TotalAngle,
    /// The angle from level that is nearest to the travel.
    pub joint: TotalAngle,
    /// The lower end of the travel, from level.
    pub lower: TotalAngle,
    /// The upper end.
    pub upper: TotalAngle,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::tests::Random;
    use crate::units::Direction;

    const ARM: AbsoluteEncoder = AbsoluteEncoder {
        level: TotalAngle::from_degrees(77),
        gear: Gear::DIRECT,
        lower: TotalAngle::from_degrees(-5),
        upper: TotalAngle::from_degrees(130),
        tolerance: Degrees::new(2.0),
    };

    fn micro(degrees: f64) -> TotalAngle {
        #[expect(clippy::cast_possible_truncation, reason = "a few turns")]
        TotalAngle::from_microdegrees((degrees * 1e6) as i64)
    }

    /// What a motor counts first after power-on: the angle of its encoder within a turn, in the robot's
    /// direction. The encoder is at `level` where the joint is.
    fn first(arm: &AbsoluteEncoder, joint: TotalAngle, direction: Direction) -> TotalAngle {
        let turn =
            360_000_000 * i64::from(arm.gear.output_turns()) / i64::from(arm.gear.rotor_turns());
        let sign = i64::from(direction.sign());
        let own = sign * joint.plus(arm.level).microdegrees();
        TotalAngle::from_microdegrees(sign * own.rem_euclid(turn))
    }

    #[test]
    fn from_every_angle_of_its_travel_the_joint_is_where_it_is() {
        let degrees = TotalAngle::from_degrees;
        let rotor = Gear::new(36, 1).unwrap();
        let short = AbsoluteEncoder {
            gear: rotor,
            lower: degrees(1),
            upper: degrees(9),
            tolerance: Degrees::new(0.5),
            ..ARM
        };
        let nearly_all = AbsoluteEncoder { lower: degrees(-300), upper: degrees(55), ..ARM };
        let mut random = Random(51);
        for arm in [ARM, short, nearly_all] {
            assert_eq!(arm.validate(), Ok(()));
            for direction in [Direction::Forward, Direction::Reversed] {
                let (mut at, mut tried) = (arm.lower, 0);
                while at <= arm.upper {
                    let counted = first(&arm, at, direction);
                    let noise = micro(f64::from(random.within(arm.tolerance.get() * 0.99)));
                    // Whichever turns are counted with it.
                    for turns in [-3, 0, 1000] {
                        let turns = TotalAngle::from_counts(
                            turns,
                            CountsPerTurn::new(arm.gear.rotor_turns(), 1),
                        );
                        let counted = counted.plus(turns).plus(noise);
                        let joint = counted.minus(arm.zero(counted).unwrap());
                        assert_eq!(joint, at.plus(noise), "{at}");
                    }
                    (at, tried) = (at.plus(micro(0.01)), tried + 1);
                }
                assert!(tried > 700, "{tried}");
            }
        }
    }

    #[test]
    fn at_its_ends_noise_is_allowed_and_beyond_them_nothing() {
        for direction in [Direction::Forward, Direction::Reversed] {
            for (end, outward) in [(ARM.lower, -1.0), (ARM.upper, 1.0)] {
                for beyond in [0.0, 0.5, 1.99] {
                    let at = end.plus(micro(outward * beyond));
                    let counted = first(&ARM, at, direction);
                    assert_eq!(counted.minus(ARM.zero(counted).unwrap()), at);
                }
                for beyond in [2.01, 10.0, 80.0, 110.0] {
                    let at = end.plus(micro(outward * beyond));
                    let counted = first(&ARM, at, direction);
                    let error = ARM.zero(counted).unwrap_err();
                    assert_eq!((error.counted, error.joint), (counted, at), "{error}");
                    assert_eq!((error.lower, error.upper), (ARM.lower, ARM.upper));
                }
            }
        }
    }

    #[test]
    fn turns_of_an_odd_gear_do_not_add_up() {
        // 18.7 degrees of the shaft: no whole number of anything.
        let gear = Gear::new(3591, 187).unwrap();
        let turns = CountsPerTurn::new(3591, 187);
        let upper = TotalAngle::from_degrees(10);
        let arm = AbsoluteEncoder { gear, lower: TotalAngle::ZERO, upper, ..ARM };
        assert_eq!(arm.validate(), Ok(()));
        for turn in (-1_000_000..1_000_000).step_by(997) {
            let counted = TotalAngle::from_counts(turn, turns).plus(arm.level).plus(micro(3.0));
            let joint = counted.minus(arm.zero(counted).unwrap());
            assert!((joint.microdegrees() - 3_000_000).abs() <= 1, "{turn}: {joint:?}");
        }
    }

    #[test]
    fn the_configuration_is_checked() {
        let degrees = TotalAngle::from_degrees;
        for (bad, field, value) in [
            (AbsoluteEncoder { upper: degrees(-5), ..ARM }, "upper", -5.0),
            // With the tolerance it is a turn.
            (AbsoluteEncoder { upper: degrees(351), ..ARM }, "upper", 351.0),
            (AbsoluteEncoder { gear: Gear::new(3, 1).unwrap(), ..ARM }, "upper", 130.0),
            (AbsoluteEncoder { tolerance: Degrees::new(-1.0), ..ARM }, "tolerance", -1.0),
        ] {
            let error = bad.validate().unwrap_err();
            assert_eq!(error.field, field);
            assert!((error.value - value).abs() < 1e-3, "{error}");
        }
        assert_eq!(AbsoluteEncoder { upper: degrees(350), ..ARM }.validate(), Ok(()));
    }
}
