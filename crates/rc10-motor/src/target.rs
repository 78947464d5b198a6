use rc10_app::mechanism::MotorCommand;
use rc10_app::{Amps, AngleSetpoint, Degrees, NewtonMetres, Rpm, RpmPerSecond, TotalAngle};

/// A setpoint for one motor. All values are at the output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Target {
    /// Turn freely: no torque.
    #[default]
    Coast,
    /// A torque-producing current. More than the motor takes is limited.
    Current(Amps),
    /// A share of the full voltage, -1 ..= 1; more is limited.
    Duty(f32),
    /// A speed.
    Speed(Rpm),
    /// An angle within the turn (any number of degrees, modulo 360), reached the shorter way round.
    Angle(Degrees),
    /// An angle of many turns.
    TotalAngle(TotalAngle),
    /// A torque.
    Torque(NewtonMetres),
    /// A spring and a damper to a moving point, and a torque on top ("MIT mode").
    Impedance(Impedance),
    /// A motion that is known in advance: angle, speed, acceleration and effort at once.
    Motion(Motion),
    /// A current that brakes whichever way the shaft turns, 0 or more; none at standstill.
    Brake(Amps),
    /// A current that holds the rotor where it stands, 0 or more: it locks a field, and heats.
    Handbrake(Amps),
}

/// A [`Target::Impedance`]: `kp` · (`angle` - measured) + `kd` · (`speed` - measured) + `torque`.
///
/// A single step of `angle` is a blow: a spring pulls with all it has. Move it, or keep `kp` low.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Impedance {
    /// The angle to which the spring pulls, of many turns, from the feedback's zero.
    pub angle: Degrees,
    /// The speed at which the damper does nothing.
    pub speed: Rpm,
    /// Torque on top.
    pub torque: NewtonMetres,
    /// Stiffness, N m/rad, 0 or more.
    pub kp: f32,
    /// Damping, N m s/rad, 0 or more.
    pub kd: f32,
}

impl Impedance {
    /// Whether every number in it is finite.
    pub const fn is_finite(&self) -> bool {
        let Self { angle, speed, torque, kp, kd } = self;
        angle.is_finite()
            && speed.is_finite()
            && torque.is_finite()
            && kp.is_finite()
            && kd.is_finite()
    }
}

/// A [`Target::Motion`]: where the shaft shall be when it is given, and how it moves on.
///
/// The motion goes on until the next: accelerated for 50 ms at most, then at its speed.
///
/// The motor adds its feed-forward ([`Cascade`](rc10_app::Cascade)); an `effort` is for the rest.
///
/// ```
/// use rc10_motor::rc10_app::{Rpm, RpmPerSecond, TotalAngle};
/// use rc10_motor::{Motion, Target};
/// // A wheel that speeds up; where it is does not matter.
/// let wheel = Target::Motion(Motion {
///     speed: Rpm::new(120.0),
///     acceleration: RpmPerSecond::new(300.0),
///     ..Motion::default()
/// });
/// let gimbal = Motion { angle: Some(TotalAngle::from_degrees(90)), ..Motion::default() };
/// assert_ne!(wheel.kind(), Target::Motion(gimbal).kind());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion {
    /// The angle, over many turns; `None`: only the speed counts.
    pub angle: Option<TotalAngle>,
    /// The speed.
    pub speed: Rpm,
    /// The rate of change of the speed. Loops here limit it to their own; a device's do not.
    pub acceleration: RpmPerSecond,
    /// Effort of the acceleration besides what the motor knows, as of the robot on a wheel, in the
    /// unit of [`Loops::effort`](crate::Loops::effort). It ends with the acceleration, and is
    /// scaled as the load is learned. A device's own loop may do without.
    pub inertia: f32,
    /// Effort on top that the motor cannot know, in the same unit: a piece that it carries.
    pub effort: f32,
}

impl Motion {
    /// Whether every number in it is finite.
    pub const fn is_finite(&self) -> bool {
        let Self { angle: _, speed, acceleration, inertia, effort } = self;
        speed.is_finite() && acceleration.is_finite() && inertia.is_finite() && effort.is_finite()
    }
}

/// The setpoint of a profile.
impl From<AngleSetpoint> for Motion {
    fn from(AngleSetpoint { angle, speed, acceleration }: AngleSetpoint) -> Self {
        Self { angle: Some(angle), speed, acceleration, ..Self::default() }
    }
}

/// The command of a mechanism: an angle is a motion.
///
/// ```
/// use rc10_motor::rc10_app::mechanism::MotorCommand;
/// use rc10_motor::rc10_app::{AngleSetpoint, Rpm, RpmPerSecond, TotalAngle};
/// use rc10_motor::{Motion, Target};
/// let (speed, acceleration) = (Rpm::new(60.0), RpmPerSecond::new(300.0));
/// let angle = TotalAngle::from_degrees(90);
/// let command = MotorCommand::Angle(AngleSetpoint { angle, speed, acceleration });
/// let motion = Motion { angle: Some(angle), speed, acceleration, ..Motion::default() };
/// assert_eq!(Target::from(command), Target::Motion(motion));
/// ```
impl From<MotorCommand> for Target {
    fn from(command: MotorCommand) -> Self {
        match command {
            MotorCommand::Coast => Self::Coast,
            MotorCommand::Speed(speed) => Self::Speed(speed),
            MotorCommand::Angle(setpoint) => Self::Motion(setpoint.into()),
        }
    }
}

/// `Ok` for these kinds, but no motion with an effort: for a device with loops of its own.
pub(crate) fn without_effort(kinds: TargetSet, target: &Target) -> Result<(), TargetError> {
    kinds.accepts(target)?;
    match target {
        Target::Motion(motion) if motion.effort != 0.0 => {
            Err(TargetError::OutOfRange(target.kind()))
        }
        _ => Ok(()),
    }
}

/// The kinds of [`Target`], without their values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[repr(u8)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum TargetKind {
    /// [`Target::Coast`].
    Coast,
    /// [`Target::Current`].
    Current,
    /// [`Target::Duty`].
    Duty,
    /// [`Target::Speed`].
    Speed,
    /// [`Target::Angle`].
    Angle,
    /// [`Target::TotalAngle`].
    TotalAngle,
    /// [`Target::Torque`].
    Torque,
    /// [`Target::Impedance`].
    Impedance,
    /// [`Target::Brake`].
    Brake,
    /// [`Target::Handbrake`].
    Handbrake,
    /// [`Target::Motion`] with an angle.
    Motion,
    /// [`Target::Motion`] of a speed alone.
    SpeedMotion,
}

rc10_app::states!(
    TargetKind: Coast, Current, Duty, Speed, Angle, TotalAngle, Torque, Impedance, Brake, Handbrake,
    Motion, SpeedMotion
);

impl Target {
    /// The kind of target.
    pub const fn kind(&self) -> TargetKind {
        match self {
            Self::Coast => TargetKind::Coast,
            Self::Current(_) => TargetKind::Current,
            Self::Duty(_) => TargetKind::Duty,
            Self::Speed(_) => TargetKind::Speed,
            Self::Angle(_) => TargetKind::Angle,
            Self::TotalAngle(_) => TargetKind::TotalAngle,
            Self::Torque(_) => TargetKind::Torque,
            Self::Impedance(_) => TargetKind::Impedance,
            Self::Motion(Motion { angle: Some(_), .. }) => TargetKind::Motion,
            Self::Motion(Motion { angle: None, .. }) => TargetKind::SpeedMotion,
            Self::Brake(_) => TargetKind::Brake,
            Self::Handbrake(_) => TargetKind::Handbrake,
        }
    }

    /// Whether every number in it is finite.
    pub const fn is_finite(&self) -> bool {
        match self {
            Self::Coast | Self::TotalAngle(_) => true,
            Self::Current(amps) | Self::Brake(amps) | Self::Handbrake(amps) => amps.is_finite(),
            Self::Duty(share) => share.is_finite(),
            Self::Torque(torque) => torque.is_finite(),
            Self::Impedance(impedance) => impedance.is_finite(),
            Self::Motion(motion) => motion.is_finite(),
            Self::Speed(rpm) => rpm.is_finite(),
            Self::Angle(degrees) => degrees.is_finite(),
        }
    }
}

/// The kinds of target that a motor takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct TargetSet(u16);

impl TargetSet {
    /// None: not even coasting. What a port offers before its motor is attached.
    pub const NONE: Self = Self(0);

    /// The kinds listed.
    pub const fn of(kinds: &[TargetKind]) -> Self {
        let mut bits = 0;
        let mut index = 0;
        while index < kinds.len() {
            bits |= 1 << kinds[index] as u16;
            index += 1;
        }
        Self(bits)
    }

    /// These and one more.
    #[must_use]
    pub const fn with(self, kind: TargetKind) -> Self {
        Self(self.0 | 1 << kind as u16)
    }

    /// Whether a kind is among them.
    #[must_use]
    pub const fn contains(self, kind: TargetKind) -> bool {
        self.0 & (1 << kind as u16) != 0
    }

    /// `Ok` if the target's kind is among these and its numbers are finite.
    pub const fn accepts(self, target: &Target) -> Result<(), TargetError> {
        if !self.contains(target.kind()) {
            Err(TargetError::Unsupported(target.kind()))
        } else if target.is_finite() {
            Ok(())
        } else {
            Err(TargetError::NotFinite(target.kind()))
        }
    }
}

/// Why a target was refused. The motor keeps the one it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TargetError {
    /// This motor cannot do that.
    #[error("this motor takes no {0:?} target")]
    Unsupported(TargetKind),
    /// A number in it is infinite or NaN.
    #[error("the {0:?} target is infinite or NaN")]
    NotFinite(TargetKind),
    /// A number in it lies where the motor cannot go.
    #[error("the {0:?} target lies where the motor cannot go")]
    OutOfRange(TargetKind),
}
