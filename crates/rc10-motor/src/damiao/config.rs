//! Models, identifiers, and how a motor is controlled.

use rc10_app::{Cascade, ConfigError, Direction, Rpm, ok};
use rc10_can::IdPattern;
use rc10_time::Micros;

use super::wire::{DeviceId, Mode, REGISTERS};
use crate::can_ids::{CanIds, Frames, Guard, Ownership, Rate};
use crate::goal::Goals;
use crate::mit::{Limits, RPM_PER_RADIAN_PER_SECOND};
use crate::pending::is_timeout;
use crate::side::Side;
use crate::target::{TargetKind, TargetSet};

/// A model and its factory limits, which are settings and have changed: compare registers 21 to 23.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The name, as the vendor writes it.
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

    // PMAX, VMAX, TMAX: dm-tools of 2025, older DM_CAN; JH11: openarm, damiao-motor 1.0.6.
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

/// The control mode, with its settings; register 10 (`CTRL_MODE`) is to say the same.
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

impl Control {
    /// The control mode of the device.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        match self {
            Self::Mit(_) => Mode::Mit,
            Self::PositionVelocity { .. } => Mode::PositionVelocity,
            Self::Velocity => Mode::Velocity,
            Self::ForcePosition { .. } => Mode::ForcePosition,
        }
    }

    const fn validate(&self, limits: &Limits) -> Result<(), ConfigError> {
        let (speed, fastest, must_be) = match self {
            Self::Mit(cascade) => return limits.check(cascade),
            Self::Velocity => return Ok(()),
            Self::PositionVelocity { speed } => (speed, f32::INFINITY, ""),
            Self::ForcePosition { speed, torque_share } => {
                let (share, must_be) = (*torque_share, "above 0, and at most 1");
                let is_good = share > 0.0 && share <= 1.0;
                ok!(ConfigError::check(is_good, "torque_share", share, must_be));
                (speed, FASTEST_FORCE_POSITION * RPM_PER_RADIAN_PER_SECOND, "at most 100 rad/s")
            }
        };
        let rpm = speed.get();
        let is_good = rpm > 0.0 && rpm <= limits.rpm();
        ok!(ConfigError::check(is_good, "speed", rpm, "above zero, and at most VMAX"));
        ConfigError::check(rpm <= fastest, "speed", rpm, must_be)
    }
}

/// A Damiao motor as it is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Config {
    /// The model, with the limits that are in the device.
    pub model: Model,
    /// `CAN_ID`, of frames that it takes: at most 0x4FE, its low byte not 0xFF (register frames).
    pub can_id: u16,
    /// `MST_ID`, of frames that it sends: at most 0x7FE, its low byte not `CAN_ID`'s.
    pub master_id: u16,
    /// How it is controlled.
    pub control: Control,
    /// Which way its output shaft counts.
    pub direction: Direction,
    /// Whether registers 9, 10 and 21 to 23 are read, and compared with time-out, mode and limits, before
    /// the motor is ever enabled, and again when it comes back. Without, wrong limits scale every value
    /// and nothing tells: only for firmware that knows no registers.
    pub verify: bool,
    /// Silence after which it stops by itself, register 9: at most this long. Zero: it is not looked at.
    /// Without a time-out, as it is sold, a motor whose cable is cut keeps its last torque.
    pub timeout: Micros,
}

impl Config {
    /// The motor with these identifiers and this control, turning forward, its registers verified, with
    /// a time-out of at most 100 ms.
    pub const fn new(model: Model, can_id: u16, master_id: u16, control: Control) -> Self {
        let (direction, verify, timeout) = (Direction::Forward, true, Micros::from_millis(100));
        Self { model, can_id, master_id, control, direction, verify, timeout }
    }

    /// The longest [time-out](Self::timeout) that it may have: 10 ms and more, or zero for any and none.
    pub const fn with_timeout(self, timeout: Micros) -> Self {
        Self { timeout, ..self }
    }

    /// Whether its [registers are verified](Self::verify).
    pub const fn verify_limits(self, verify: bool) -> Self {
        Self { verify, ..self }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        let Self { can_id, master_id, ref model, ref control, .. } = *self;
        let is_good = DeviceId::new(can_id).is_some() && can_id & 0xFF != REGISTERS & 0xFF;
        let must_be = "at most 0x4FE, its low byte not 0xFF";
        ok!(ConfigError::check(is_good, "CAN_ID", can_id as f32, must_be));
        let is_good = master_id < REGISTERS && (master_id ^ can_id) & 0xFF != 0;
        let must_be = "at most 0x7FE, its low byte not that of CAN_ID";
        ok!(ConfigError::check(is_good, "MST_ID", master_id as f32, must_be));
        ok!(is_timeout(self.timeout));
        ok!(model.limits.validate());
        control.validate(&model.limits)
    }

    /// The identifiers it occupies on its bus. Of a configuration that is [valid](Self::validate).
    pub const fn can_ids(&self) -> CanIds {
        can_ids(self.can_id, self.master_id, self.control.mode())
    }
}

/// The mask of what it reacts to: every standard identifier with its own low byte.
const LOW_BYTE: u32 = 0xFF;

pub(super) const fn can_ids(can_id: u16, master_id: u16, mode: Mode) -> CanIds {
    let low = (can_id & 0xFF) as u8;
    // Register replies have the whole identifier there, so the same four bits.
    let feedback = Frames::new(IdPattern::standard(master_id), 8, Rate::EveryTick)
        .owned(Ownership::Guard(Guard { byte: 0, mask: 0x0F, value: low & 0x0F }));
    let mut ids = CanIds::new()
        .receives(feedback)
        .transmits(command(can_id, mode, 8, Rate::EveryTick))
        .transmits(register(low, 4))
        .transmits(register(low, 8))
        .listens_to(IdPattern::standard(can_id).under(LOW_BYTE));
    if !matches!(mode, Mode::Mit) {
        ids = ids.transmits(command(can_id, Mode::Mit, 8, Rate::Rare));
    }
    if matches!(mode, Mode::Velocity) {
        // Shorter than the operations, which the load counts on.
        ids = ids.transmits(command(can_id, Mode::Velocity, 4, Rate::Rare));
    }
    ids
}

const fn command(can_id: u16, mode: Mode, len: u8, rate: Rate) -> Frames {
    Frames::new(IdPattern::standard(can_id + mode.offset()), len, rate)
}

const fn register(low: u8, len: u8) -> Frames {
    let guard = Guard { byte: 0, mask: 0xFF, value: low };
    Frames::new(IdPattern::standard(REGISTERS), len, Rate::Rare).owned(Ownership::Guard(guard))
}

/// Largest velocity that a force-position frame carries, rad/s.
const FASTEST_FORCE_POSITION: f32 = 100.0;

/// The settings of the device's own position loop.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Own {
    /// Largest velocity on the way to a position, rad/s.
    pub(super) velocity: f32,
    pub(super) torque_share: f32,
}

pub(super) fn side(control: Control, limits: &Limits) -> Side<Own> {
    use TargetKind::{Angle, Coast, Speed, SpeedMotion, TotalAngle};
    let own = |kinds: &[TargetKind], speed: Rpm, torque_share| {
        let velocity = speed.get() / RPM_PER_RADIAN_PER_SECOND;
        Side::Device(Goals::new(TargetSet::of(kinds)), Own { velocity, torque_share })
    };
    match control {
        Control::Mit(cascade) => Side::Here(limits.servo(cascade)),
        Control::Velocity => own(&[Coast, Speed, SpeedMotion], Rpm::ZERO, 1.0),
        Control::PositionVelocity { speed } => own(&[Coast, Angle, TotalAngle], speed, 1.0),
        Control::ForcePosition { speed, torque_share } => {
            own(&[Coast, Angle, TotalAngle], speed, torque_share)
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;
    use crate::damiao::Damiao;
    use crate::motor::{CanMotor, Motor};

    #[test]
    fn all_limits_can_be_used() {
        for model in models::ALL {
            assert_eq!(model.limits.validate(), Ok(()), "{}", model.name);
        }
    }

    #[test]
    fn a_configuration_is_checked_in_a_constant_and_its_motor_occupies_what_it_says() {
        const ARM: Config = Config::new(models::J4310, 0x11, 0x31, Control::Velocity);
        const _: () = assert!(ARM.validate().is_ok());
        const IDS: CanIds = ARM.can_ids();
        let motor = Damiao::new(ARM).unwrap();
        assert_eq!(motor.name(), ARM.name());
        assert_eq!(motor.can_ids().received(), IDS.received());
        assert_eq!(motor.can_ids().transmitted(), IDS.transmitted());
        assert_eq!(motor.can_ids().listened_to(), IDS.listened_to());
        let refused = |config: Config| config.validate().unwrap_err().to_string();
        let speed = Rpm::new(1e4);
        for (config, sentence) in [
            (
                Config { can_id: 0x4FF, ..ARM },
                "DM-J4310 id 1279: `CAN_ID` is 1279, but must be at most 0x4FE, its low byte not \
                 0xFF",
            ),
            (
                Config { master_id: 0x111, ..ARM },
                "DM-J4310 id 17: `MST_ID` is 273, but must be at most 0x7FE, its low byte not that \
                 of CAN_ID",
            ),
            (
                Config { control: Control::PositionVelocity { speed }, ..ARM },
                "DM-J4310 id 17: `speed` is 10000, but must be above zero, and at most VMAX",
            ),
        ] {
            assert_eq!(refused(config), sentence);
        }
    }
}
