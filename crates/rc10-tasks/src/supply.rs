//! The supply of a robot, by its voltage.

use core::fmt;

use rc10_can::Micros;

/// Up to which a supply is known: it is measured ten times a second.
pub(crate) const OLDEST_SUPPLY: Micros = Micros::from_millis(500);

/// A lithium cell is full at this voltage and, loaded, nearly empty at that one: millivolts.
const FULL: u16 = 4_300;
const EMPTY: u16 = 3_500;

/// The supply of a robot: a battery of lithium cells, or what stands in for one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supply {
    /// Its voltage, mV.
    pub millivolts: u16,
    /// Cells in series, as many as it had at least at the highest voltage so far.
    pub cells: u8,
}

impl Supply {
    /// The supply that has this voltage now, in mV, and was this before.
    #[must_use]
    pub fn now(millivolts: u16, before: Option<Self>) -> Self {
        let cells = u8::try_from(millivolts.div_ceil(FULL)).unwrap_or(u8::MAX);
        Self { millivolts, cells: before.map_or(cells, |before| before.cells.max(cells)) }
    }

    /// Whether the battery is nearly empty: below 3.5 V a cell.
    #[must_use]
    pub fn is_low(&self) -> bool {
        self.millivolts < u16::from(self.cells).saturating_mul(EMPTY)
    }
}

/// In volts.
impl fmt::Display for Supply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tenths = (u32::from(self.millivolts) + 50) / 100;
        write!(f, "{}.{} V", tenths / 10, tenths % 10)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;

    #[test]
    fn a_battery_is_low_at_three_and_a_half_volts_a_cell() {
        let full = Supply::now(25_200, None);
        assert_eq!((full.cells, full.is_low(), full.to_string()), (6, false, "25.2 V".into()));
        // Its cells stay what they were while the voltage falls.
        let used = Supply::now(21_000, Some(full));
        assert_eq!((used.cells, used.is_low()), (6, false));
        let empty = Supply::now(20_950, Some(used));
        assert_eq!((empty.is_low(), empty.to_string()), (true, "21.0 V".into()));
        // One that was read while it came up.
        let first = Supply::now(3_000, None);
        assert_eq!(Supply::now(24_000, Some(first)).cells, 6);
        // No battery: all zero, on USB alone.
        assert!(!Supply::now(0, None).is_low());
        assert_eq!(Supply::now(u16::MAX, None).cells, 16);
    }
}
