use rc10_app::{Cascade, ConfigError, Direction};

use crate::can_ids::{CanIds, MotorName};
use crate::{cybergear, damiao, dji, lk, odrive, unitree, vesc};

/// The device of a motor with its configuration, whatever its vendor: for checks and tools.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Device {
    /// A [`Dji`](dji::Dji).
    Dji(dji::Config),
    /// A [`Vesc`](vesc::Vesc).
    Vesc(vesc::Config),
    /// A [`Damiao`](damiao::Damiao).
    Damiao(damiao::Config),
    /// A [`CyberGear`](cybergear::CyberGear).
    CyberGear(cybergear::Config),
    /// An [`Lk`](lk::Lk).
    Lk(lk::Config),
    /// An [`ODrive`](odrive::ODrive).
    ODrive(odrive::Config),
    /// A [`GoModule`](unitree::GoModule).
    GoModule(unitree::ModuleConfig),
    /// A [`GoM8010`](unitree::GoM8010).
    GoM8010(unitree::LineConfig),
    /// A motor on CAN that this crate does not know.
    Other(OtherDevice),
}

/// A motor on CAN of which only its name and its identifiers are known.
#[derive(Clone, Copy, Debug)]
pub struct OtherDevice {
    /// Model and identifier.
    pub name: MotorName,
    /// The identifiers on its bus.
    pub ids: CanIds,
    /// Which way its output shaft counts.
    pub direction: Direction,
}

/// Identifiers or address of a device where it is plugged in.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "for constants")]
pub enum Wiring {
    /// Identifiers on a CAN bus.
    Can(CanIds),
    /// An address on an RS-485 line.
    Line(u8),
}

/// A value of the configuration, whatever its vendor.
macro_rules! each {
    ($device:expr, $config:ident => $value:expr, $other:pat => $of_other:expr) => {
        match $device {
            Device::Dji($config) => $value,
            Device::Vesc($config) => $value,
            Device::Damiao($config) => $value,
            Device::CyberGear($config) => $value,
            Device::Lk($config) => $value,
            Device::ODrive($config) => $value,
            Device::GoModule($config) => $value,
            Device::GoM8010($config) => $value,
            Device::Other($other) => $of_other,
        }
    };
}

impl Device {
    /// Model and identifier.
    pub const fn name(&self) -> MotorName {
        each!(self, config => config.name(), device => device.name)
    }

    /// Which way its output shaft counts.
    pub const fn direction(&self) -> Direction {
        each!(self, config => config.direction, device => device.direction)
    }

    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        each!(self, config => config.validate(), _ => Ok(()))
    }

    /// Identifiers or address where it is plugged in.
    pub const fn wiring(&self) -> Wiring {
        Wiring::Can(match self {
            Self::Dji(config) => config.can_ids(),
            Self::Vesc(config) => config.can_ids(),
            Self::Damiao(config) => config.can_ids(),
            Self::CyberGear(config) => config.can_ids(),
            Self::Lk(config) => config.can_ids(),
            Self::ODrive(config) => config.can_ids(),
            Self::GoModule(config) => config.can_ids(),
            Self::GoM8010(config) => return Wiring::Line(config.id),
            Self::Other(device) => device.ids,
        })
    }
}

/// The functions that the configurations of all vendors have in common.
macro_rules! devices {
    ($($device:ident: $config:ty, |$of:ident| $model:expr, $id:expr;)+) => {$(
        impl $config {
            /// Model and identifier.
            pub const fn name(&self) -> MotorName {
                let $of = self;
                MotorName { model: $model, id: $id as u16 }
            }

            /// The same, whose output shaft counts this way.
            pub const fn with_direction(self, direction: Direction) -> Self {
                Self { direction, ..self }
            }

            /// Checks every field; the error names the first that is wrong, and what it must be.
            pub const fn validate(&self) -> Result<(), ConfigError> {
                self.name().blamed(self.check())
            }

            /// The same, as one of many vendors.
            pub const fn device(self) -> Device {
                Device::$device(self)
            }
        }
    )+};
}

devices! {
    Dji: dji::Config, |of| of.model.name, of.id;
    Vesc: vesc::Config, |of| "VESC", of.id;
    Damiao: damiao::Config, |of| of.model.name, of.can_id;
    CyberGear: cybergear::Config, |of| of.model.name, of.address.motor;
    Lk: lk::Config, |of| of.model.name, of.id;
    ODrive: odrive::Config, |of| "ODrive", of.node;
    GoModule: unitree::ModuleConfig, |of| of.model(), of.motor;
    GoM8010: unitree::LineConfig, |of| "GO-M8010-6", of.id;
}

/// For the configurations that come with gains.
macro_rules! with_gains {
    ($($config:ty),+) => {$(
        impl $config {
            /// With gains of your own, in the unit of its efforts.
            pub const fn with_cascade(self, cascade: Cascade) -> Self {
                Self { cascade, ..self }
            }
        }
    )+};
}

with_gains!(dji::Config, cybergear::Config, unitree::ModuleConfig, unitree::LineConfig);

impl OtherDevice {
    /// The same, as one of many vendors.
    pub const fn device(self) -> Device {
        Device::Other(self)
    }
}
