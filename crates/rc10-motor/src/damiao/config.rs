//! How a motor is controlled: chosen when it is made, and checked.

use rc10_app::{ConfigError, Rpm};

use super::shaft::RPM_PER_RADIAN_PER_SECOND;
use super::wire::Mode;
use crate::mit::Limits;
use crate::motor::{Loops, TargetKind, TargetSet};
use crate::servo::Servo;
use rc10_app::Cascade;

/// How a motor is controlled; its register 10 (`CTRL_MODE`) is to say the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Our loops, or an impedance of the device's: takes torques, speeds, angles and impedances.
    /// Efforts are N m at the output shaft; the speed loop's output limit is the largest torque.
    Mit(Cascade),
    /// The device's position loop: takes angles.
    PositionVelocity {
        /// It turns no faster than this on its way.
        speed: Rpm,
    },
    /// The device's velocity loop: takes speeds. It changes speed as its registers 4 and 5 say.
    Velocity,
    /// The device's position loop with limited torque: takes angles. Not every model has it.
    ForcePosition {
        /// It turns no faster than this on its way, at most 100 rad/s.
        speed: Rpm,
        /// It pushes no harder than this share of the device's largest torque, above 0 and at most
        /// 1.
        torque_share: f32,
    },
}

/// Largest velocity that a force-position frame carries, rad/s.
const FASTEST_FORCE_POSITION: f32 = 100.0;

/// A [`Control`] that has been checked, in rad/s.
#[derive(Clone, Debug)]
pub(super) enum Steering {
    Mit(Servo),
    PositionVelocity { velocity: f32 },
    Velocity,
    ForcePosition { velocity: f32, share: f32 },
}

impl Steering {
    pub(super) fn new(control: Control, limits: &Limits) -> Result<Self, ConfigError> {
        let fastest = limits.velocity() * RPM_PER_RADIAN_PER_SECOND;
        let speed_within = |rpm: f32, most: f32, must_be| {
            if rpm > 0.0 && rpm <= most {
                Ok(rpm / RPM_PER_RADIAN_PER_SECOND)
            } else {
                Err(ConfigError::new("speed", rpm, must_be))
            }
        };
        let up_to_vmax = "above zero, and at most VMAX";
        Ok(match control {
            Control::Mit(cascade) => {
                let (torque, speed) = (cascade.speed.output_limit, cascade.angle.output_limit);
                let servo = Servo::new(TargetKind::Torque, cascade)?;
                if torque > limits.torque() {
                    let (field, value) = ("speed.output_limit", torque);
                    return Err(ConfigError::new(field, value, "at most TMAX, in N m"));
                }
                if speed > fastest {
                    let (field, value) = ("angle.output_limit", speed);
                    return Err(ConfigError::new(field, value, "at most VMAX, in rpm"));
                }
                Self::Mit(servo)
            }
            Control::PositionVelocity { speed } => {
                Self::PositionVelocity { velocity: speed_within(speed.get(), fastest, up_to_vmax)? }
            }
            Control::Velocity => Self::Velocity,
            Control::ForcePosition { speed, torque_share: share } => {
                let velocity = speed_within(speed.get(), fastest, up_to_vmax)?;
                let most = FASTEST_FORCE_POSITION * RPM_PER_RADIAN_PER_SECOND;
                let _ = speed_within(speed.get(), most, "at most 100 rad/s")?;
                if !(share > 0.0 && share <= 1.0) {
                    let (field, must_be) = ("torque_share", "above 0, and at most 1");
                    return Err(ConfigError::new(field, share, must_be));
                }
                Self::ForcePosition { velocity, share }
            }
        })
    }

    pub(super) const fn mode(&self) -> Mode {
        match self {
            Self::Mit(_) => Mode::Mit,
            Self::PositionVelocity { .. } => Mode::PositionVelocity,
            Self::Velocity => Mode::Velocity,
            Self::ForcePosition { .. } => Mode::ForcePosition,
        }
    }

    /// The largest velocity on the way to a position, rad/s; 0 in the other modes.
    pub(super) const fn velocity(&self) -> f32 {
        match *self {
            Self::PositionVelocity { velocity } | Self::ForcePosition { velocity, .. } => velocity,
            Self::Mit(_) | Self::Velocity => 0.0,
        }
    }

    pub(super) const fn loops(&self) -> Option<Loops> {
        match self {
            Self::Mit(servo) => Some(servo.loops()),
            Self::Velocity | Self::PositionVelocity { .. } | Self::ForcePosition { .. } => None,
        }
    }

    pub(super) const fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Impedance, Speed, Torque, TotalAngle};
        match self {
            Self::Mit(_) => TargetSet::of(&[Coast, Torque, Speed, Angle, TotalAngle, Impedance]),
            Self::Velocity => TargetSet::of(&[Coast, Speed]),
            Self::PositionVelocity { .. } | Self::ForcePosition { .. } => {
                TargetSet::of(&[Coast, Angle, TotalAngle])
            }
        }
    }
}
