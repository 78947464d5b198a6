//! Profiles of a shaft that turns without end.

use super::double::Double;
use super::{Goal, Profile, ProfileLimits, Setpoint};
use crate::config::ConfigError;
use crate::maths;
use crate::{Rpm, RpmPerSecond, RpmPerSecondSquared, Seconds, TotalAngle};

/// Degrees that 1 rpm makes in a second: with this unit of the axis velocities are in rpm.
const MICRODEGREES_PER_UNIT: i64 = 6_000_000;

/// Angle, speed and acceleration that a shaft shall have now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AngleSetpoint {
    /// Angle of the output shaft.
    pub angle: TotalAngle,
    /// The speed.
    pub speed: Rpm,
    /// The acceleration: for feed-forward.
    pub acceleration: RpmPerSecond,
}

impl AngleSetpoint {
    /// At rest at an angle.
    #[must_use]
    pub const fn at(angle: TotalAngle) -> Self {
        Self { angle, speed: Rpm::ZERO, acceleration: RpmPerSecond::ZERO }
    }

    /// Whether every number in it is finite.
    #[must_use]
    pub const fn is_finite(&self) -> bool {
        self.speed.is_finite() && self.acceleration.is_finite()
    }
}

/// Limits of a shaft's motion, the same both ways.
///
/// In rpm, like those of the motor's loops, below which they stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleLimits {
    /// Largest speed.
    pub velocity: Rpm,
    /// Largest acceleration.
    pub acceleration: RpmPerSecond,
    /// Largest jerk; infinite: the acceleration may jump.
    pub jerk: RpmPerSecondSquared,
}

impl AngleLimits {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        self.of_axis().validate()
    }

    const fn of_axis(&self) -> ProfileLimits {
        let Self { velocity, acceleration, jerk } = *self;
        let (velocity, acceleration) = (velocity.get(), acceleration.get());
        ProfileLimits { velocity, acceleration, jerk: jerk.get() }
    }
}

/// A [`Profile`] whose position is a [`TotalAngle`].
///
/// It lands on the microdegree within 10⁸ degrees of where it began.
///
/// ```
/// use rc10_app::{
///     AngleLimits, AngleProfile, Rpm, RpmPerSecond, RpmPerSecondSquared, Seconds, TotalAngle,
/// };
/// let limits = AngleLimits {
///     velocity: Rpm::new(100.0),
///     acceleration: RpmPerSecond::new(1000.0),
///     jerk: RpmPerSecondSquared::new(20_000.0),
/// };
/// let here = TotalAngle::from_degrees(3_600_000); // 10,000 turns
/// let target = here.plus(TotalAngle::from_degrees(90));
/// let mut gimbal = AngleProfile::at(here);
/// gimbal.set_target(&limits, target, Rpm::ZERO)?;
/// while !gimbal.has_arrived() {
///     gimbal.update(Seconds::new(0.001));
/// }
/// assert_eq!(gimbal.setpoint().angle, target);
/// # Ok::<(), rc10_app::ConfigError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleProfile {
    /// Where it was made. The profile counts from here.
    zero: TotalAngle,
    profile: Profile,
}

impl AngleProfile {
    /// At rest at an angle.
    pub const fn at(angle: TotalAngle) -> Self {
        Self::from_setpoint(AngleSetpoint::at(angle))
    }

    /// A profile that begins at a setpoint: [`Profile::from_setpoint`].
    pub const fn from_setpoint(setpoint: AngleSetpoint) -> Self {
        let AngleSetpoint { angle, speed, acceleration } = setpoint;
        let (velocity, acceleration) = (speed.get(), acceleration.get());
        let setpoint = Setpoint { position: 0.0, velocity, acceleration };
        Self { zero: angle, profile: Profile::from_setpoint(setpoint) }
    }

    /// Goes to an angle, with the errors of [`Profile::set_target`].
    pub fn set_target(
        &mut self,
        limits: &AngleLimits,
        angle: TotalAngle,
        speed: Rpm,
    ) -> Result<(), ConfigError> {
        self.profile.set(&limits.of_axis(), Goal::Place(self.place(angle), speed.get()))
    }

    /// Follows a moving angle, with the errors of [`Profile::follow`].
    pub fn follow(
        &mut self,
        limits: &AngleLimits,
        angle: TotalAngle,
        speed: Rpm,
    ) -> Result<(), ConfigError> {
        self.profile.set(&limits.of_axis(), Goal::Moving(self.place(angle), speed.get()))
    }

    /// Keeps a speed, with the errors of [`Profile::set_velocity`].
    pub fn set_speed(&mut self, limits: &AngleLimits, speed: Rpm) -> Result<(), ConfigError> {
        self.profile.set_velocity(&limits.of_axis(), speed.get())
    }

    /// The setpoint a time `dt` later. A `dt` that is not finite and positive changes nothing.
    pub fn update(&mut self, dt: Seconds) -> AngleSetpoint {
        self.profile.update(dt);
        self.setpoint()
    }

    /// The newest setpoint.
    #[must_use]
    pub fn setpoint(&self) -> AngleSetpoint {
        let Profile { position, velocity, acceleration, .. } = self.profile;
        let (high, low) = position.parts();
        #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
        let whole = high as i32;
        #[expect(clippy::cast_precision_loss, reason = "it came from this f32: exact")]
        let fraction = high - whole as f32 + low;
        #[expect(clippy::cast_precision_loss, reason = "exact")]
        let fraction = maths::round_to_i32(fraction * MICRODEGREES_PER_UNIT as f32);
        let microdegrees = i64::from(whole) * MICRODEGREES_PER_UNIT + i64::from(fraction);
        AngleSetpoint {
            angle: self.zero.plus(TotalAngle::from_microdegrees(microdegrees)),
            speed: Rpm::new(velocity),
            acceleration: RpmPerSecond::new(acceleration),
        }
    }

    /// Whether it stands in its target: [`Profile::has_arrived`].
    #[must_use]
    pub const fn has_arrived(&self) -> bool {
        self.profile.has_arrived()
    }

    /// The time to the target: [`Profile::remaining`].
    #[must_use]
    pub const fn remaining(&self) -> Seconds {
        self.profile.remaining()
    }

    /// An angle in the unit of the profile.
    fn place(&self, angle: TotalAngle) -> Double {
        let way = angle.minus(self.zero).microdegrees();
        let (whole, rest) = (way / MICRODEGREES_PER_UNIT, way % MICRODEGREES_PER_UNIT);
        #[expect(clippy::cast_precision_loss, reason = "exact in the range that is documented")]
        let (whole, rest) = (whole as f32, rest as f32 / MICRODEGREES_PER_UNIT as f32);
        Double::new(whole).plus(rest)
    }
}

/// For [`synchronise`](super::synchronise).
impl AsMut<Profile> for AngleProfile {
    fn as_mut(&mut self) -> &mut Profile {
        &mut self.profile
    }
}
