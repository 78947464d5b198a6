//! Models, identifiers, and how a motor is controlled.

use embedded_can::StandardId;
use rc10_app::{Cascade, ConfigError, Rpm, TotalAngle};

use super::wire::{DeviceId, Mode, REGISTERS, standard};
use crate::goal::Goals;
use crate::mit::{Limits, RPM_PER_RADIAN_PER_SECOND};
use crate::servo::Servo;
use crate::target::{Target, TargetError, TargetKind, TargetSet};

/// A model and its factory limits. They are settings (registers 21 to 23), and what the vendor
/// ships has changed over the years: compare them with the registers before moving anything.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    /// As the vendor writes it.
    pub name: &'static str,
    /// PMAX, VMAX and TMAX.
    pub limits: Limits,
}

/// Limits that the models are sold with.
pub mod models {
    use super::{Limits, Model};

    macro_rules! models {
        ($($(#[$note:meta])* $model:ident, $name:literal: $p:literal, $v:literal, $t:literal;)*) => {
            $(
                #[doc = concat!(
                    $name, ": ±", stringify!($p), " rad, ±", stringify!($v), " rad/s, ±",
                    stringify!($t), " N m."
                )]
                $(#[$note])*
                pub const $model: Model = Model { name: $name, limits: Limits::new($p, $v, $t) };
            )*

            /// All of them.
            pub const ALL: &[Model] = &[$($model),*];
        };
    }

    // PMAX, VMAX, TMAX. Source: the vendor's dm-tools of 2025, with what its older DM_CAN says
    // where that differs; JH11: openarm and damiao-motor 1.0.6.
    models! {
        J3507, "DM-J3507": 12.566, 50.0, 5.0;
        J4310, "DM-J4310": 12.5, 30.0, 10.0;
        J4310_48V, "DM-J4310-48V": 12.5, 50.0, 10.0;
        /// Older: 8 rad/s.
        J4340, "DM-J4340": 12.5, 10.0, 28.0;
        /// Older: 10 rad/s.
        J4340_48V, "DM-J4340-48V": 12.5, 20.0, 28.0;
        /// Older: 20 N m.
        J6006, "DM-J6006": 12.5, 45.0, 12.0;
        J6248, "DM-J6248": 12.566, 20.0, 120.0;
        /// Older: 40 N m.
        J8006, "DM-J8006": 12.5, 45.0, 20.0;
        J8009, "DM-J8009": 12.5, 45.0, 54.0;
        J10010L, "DM-J10010L": 12.5, 25.0, 200.0;
        J10010, "DM-J10010": 12.5, 20.0, 200.0;
        H3510, "DM-H3510": 12.5, 280.0, 1.0;
        H6215, "DM-H6215": 12.5, 45.0, 10.0;
        G6220, "DM-G6220": 12.5, 45.0, 10.0;
        JH11, "DM-JH11": 12.5, 10.0, 12.0;
        S3519, "DM-S3519": 12.5, 2000.0, 2.0;
    }
}

/// The control mode of a motor, with its settings; its register 10 (`CTRL_MODE`) is to say the
/// same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Our loops, or an impedance of the device's: takes torques, speeds, angles and impedances.
    /// Efforts are N m at the output shaft; the speed loop's output limit is the largest torque.
    Mit(Cascade),
    /// The device's position loop: takes angles.
    PositionVelocity {
        /// Largest speed on the way.
        speed: Rpm,
    },
    /// The device's velocity loop: takes speeds. It changes speed as its registers 4 and 5 say.
    Velocity,
    /// The device's position loop with limited torque: takes angles. Not every model has it.
    ForcePosition {
        /// Largest speed on the way, at most 100 rad/s.
        speed: Rpm,
        /// Largest torque, as a share of the device's own: above 0 and at most 1.
        torque_share: f32,
    },
}

/// Largest velocity that a force-position frame carries, rad/s.
const FASTEST_FORCE_POSITION: f32 = 100.0;

/// A [`Control`] that has been checked: what follows the targets.
#[derive(Clone, Debug)]
pub(super) enum Controller {
    /// Our loops, and the device's spring.
    Mit(Servo),
    /// The device's own loops.
    Own {
        mode: Mode,
        goals: Goals,
        /// Largest velocity on the way to a position, rad/s.
        velocity: f32,
        torque_share: f32,
    },
}

impl Controller {
    pub(super) fn new(control: Control, limits: &Limits) -> Result<Self, ConfigError> {
        use TargetKind::{Angle, Coast, Speed, TotalAngle};
        let to_angles = |mode, speed: Rpm, torque_share| {
            let rpm = speed.get();
            let is_good = rpm > 0.0 && rpm <= limits.rpm();
            ConfigError::check(is_good, "speed", rpm, "above zero, and at most VMAX")?;
            let velocity = rpm / RPM_PER_RADIAN_PER_SECOND;
            let is_sent = mode != Mode::ForcePosition || velocity <= FASTEST_FORCE_POSITION;
            ConfigError::check(is_sent, "speed", rpm, "at most 100 rad/s")?;
            let goals = Goals::new(TargetSet::of(&[Coast, Angle, TotalAngle]));
            Ok(Self::Own { mode, goals, velocity, torque_share })
        };
        match control {
            Control::Mit(cascade) => limits.servo(cascade).map(Self::Mit),
            Control::PositionVelocity { speed } => to_angles(Mode::PositionVelocity, speed, 1.0),
            Control::Velocity => {
                let goals = Goals::new(TargetSet::of(&[Coast, Speed]));
                Ok(Self::Own { mode: Mode::Velocity, goals, velocity: 0.0, torque_share: 1.0 })
            }
            Control::ForcePosition { speed, torque_share } => {
                let is_good = torque_share > 0.0 && torque_share <= 1.0;
                let must_be = "above 0, and at most 1";
                ConfigError::check(is_good, "torque_share", torque_share, must_be)?;
                to_angles(Mode::ForcePosition, speed, torque_share)
            }
        }
    }

    pub(super) const fn mode(&self) -> Mode {
        match self {
            Self::Mit(_) => Mode::Mit,
            Self::Own { mode, .. } => *mode,
        }
    }

    pub(super) const fn goals(&self) -> &Goals {
        match self {
            Self::Mit(servo) => servo.goals(),
            Self::Own { goals, .. } => goals,
        }
    }

    pub(super) fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        match self {
            Self::Mit(servo) => servo.set_target(target),
            Self::Own { goals, .. } => goals.set_target(target),
        }
    }

    pub(super) fn set_zero(&mut self, zero: TotalAngle) {
        match self {
            Self::Mit(servo) => servo.set_zero(zero),
            Self::Own { goals, .. } => goals.set_zero(zero),
        }
    }

    /// Nothing drives; what comes next starts softly.
    pub(super) fn rest(&mut self) {
        match self {
            Self::Mit(servo) => servo.rest(),
            Self::Own { goals, .. } => goals.rest(),
        }
    }
}

/// `CAN_ID` and `MST_ID`, if they can be used.
pub(super) fn ids(can_id: u16, master_id: u16) -> Result<(DeviceId, StandardId), ConfigError> {
    let id = DeviceId::new(can_id).filter(|id| id.raw() & 0xFF != REGISTERS & 0xFF);
    let must_be = "at most 0x4FE, its low byte not 0xFF";
    let id = id.ok_or(ConfigError::new("CAN_ID", can_id.into(), must_be))?;
    let is_good = master_id < REGISTERS && (master_id ^ can_id) & 0xFF != 0;
    let must_be = "at most 0x7FE, its low byte not that of CAN_ID";
    ConfigError::check(is_good, "MST_ID", master_id.into(), must_be)?;
    Ok((id, standard(master_id)))
}

#[cfg(test)]
mod tests {
    #[test]
    fn all_limits_can_be_used() {
        for model in super::models::ALL {
            assert_eq!(model.limits.validate(), Ok(()), "{}", model.name);
        }
    }
}
