use rc10_app::{ConfigError, Direction};

use crate::can_ids::{CanIds, MotorName};
use crate::dji;

/// The device of a motor with its configuration, whatever its vendor: for checks and tools.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Device {
    /// A [`Dji`](dji::Dji).
    Dji(dji::Config),
    /// A motor on CAN that this crate does not know.
    Other(OtherDevice),
}

/// A motor on CAN of which only its name and its identifiers are known.
#[derive(Clone, Copy, Debug)]
pub struct OtherDevice {
    /// Model and identifier.
    pub name: MotorName,
    /// What it occupies on its bus.
    pub ids: CanIds,
    /// Which way its output shaft counts.
    pub direction: Direction,
}

/// What a device occupies where it is plugged in.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "for constants")]
pub enum Wiring {
    /// Identifiers on a CAN bus.
    Can(CanIds),
    /// An address on an RS-485 line.
    Line(u8),
}

impl Device {
    /// Model and identifier.
    pub const fn name(&self) -> MotorName {
        match self {
            Self::Dji(config) => config.name(),
            Self::Other(device) => device.name,
        }
    }

    /// Which way its output shaft counts.
    pub const fn direction(&self) -> Direction {
        match self {
            Self::Dji(config) => config.direction,
            Self::Other(device) => device.direction,
        }
    }

    /// Whether every field of its configuration can be used.
    ///
    /// # Errors
    /// The first field that cannot, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        match self {
            Self::Dji(config) => config.validate(),
            Self::Other(_) => Ok(()),
        }
    }

    /// What it occupies where it is plugged in.
    pub const fn wiring(&self) -> Wiring {
        Wiring::Can(match self {
            Self::Dji(config) => config.can_ids(),
            Self::Other(device) => device.ids,
        })
    }
}

impl dji::Config {
    /// The same, as one of many vendors.
    pub const fn device(self) -> Device {
        Device::Dji(self)
    }
}

impl OtherDevice {
    /// The same, as one of many vendors.
    pub const fn device(self) -> Device {
        Device::Other(self)
    }
}
