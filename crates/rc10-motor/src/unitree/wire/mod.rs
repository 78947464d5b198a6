//! The bytes of both links, and their numbers. Pure functions but for [`line::Parser`]'s buffer.
//!
//! To wire: clamped, nearest step, no wrapping, no panic. NaN becomes zero.

pub mod line;
pub mod module;
mod scale;

pub(super) use scale::{ANGLE_STEPS, GAIN_LIMIT, SPEED_LIMIT, SPEED_STEPS};
pub use scale::{GEAR, Impedance, Motion, RawImpedance, RawMotion, RotorScale};

use crate::feedback::Fault;

/// A motor on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Address(u8);

impl Address {
    /// Every motor; none replies.
    pub const BROADCAST: Self = Self(15);

    /// One motor, 0 ..= 14, else `None`.
    pub const fn new(id: u8) -> Option<Self> {
        if id < Self::BROADCAST.0 { Some(Self(id)) } else { None }
    }

    /// The number, 0 ..= 15.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

/// The state a motor is commanded into, or reports: three bits.
///
/// Motors may report one of the five values that have no name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Status(u8);

impl Status {
    /// Locked: the vendor's word for the state after power-up, without control.
    pub const LOCK: Self = Self(0);
    /// Field-oriented control: follows the command.
    pub const FOC: Self = Self(1);
    /// Calibrates its encoder. **The motor turns for about five seconds**; send nothing meanwhile.
    pub const CALIBRATE: Self = Self(2);

    /// The number, 0 ..= 7.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

/// Status in bits 6 to 4, address in bits 3 to 0: "mode" on the line, "low2" at the module.
const fn mode(address: Address, status: Status) -> u8 {
    status.0 << 4 | address.0
}

/// The two halves of a [`mode`]; bit 7 is reserved.
const fn split_mode(mode: u8) -> (Address, Status) {
    (Address(mode & 0xF), Status(mode >> 4 & 7))
}

/// Texts of the vendor's `MError` (data manual, table of the reply).
pub(super) const ERRORS: [&str; 5] =
    ["none", "over-temperature", "over-current", "over-voltage", "encoder"];

/// The fault of an `MError`; `None` for 0, no error.
pub fn fault(error: u8) -> Option<Fault> {
    let text = ERRORS.get(usize::from(error)).copied();
    let text = text.unwrap_or("an error the vendor does not name");
    (error > 0).then_some(Fault::new(error.into(), text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_one_motor_or_all() {
        assert_eq!(Address::new(14).map(Address::get), Some(14));
        assert_eq!(Address::new(15), None);
        assert_eq!(mode(Address(14), Status::FOC), 0x1E);
        assert_eq!(split_mode(0xAF), (Address::BROADCAST, Status::CALIBRATE));
    }

    #[test]
    fn every_error_has_a_text_and_none_has_none() {
        assert_eq!(fault(0), None);
        assert_eq!(fault(1), Some(Fault::new(1, "over-temperature")));
        assert_eq!(fault(4), Some(Fault::new(4, "encoder")));
        for reserved in 5..=u8::MAX {
            let fault = fault(reserved).unwrap();
            assert_eq!(fault.code, reserved.into());
            assert_eq!(fault.text, "an error the vendor does not name");
        }
    }
}
