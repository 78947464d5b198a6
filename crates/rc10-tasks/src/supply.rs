//! The supply of a robot, by its voltage.

use core::fmt;

use rc10_time::Micros;

/// Up to which a supply is known: it is measured ten times a second.
pub const OLDEST_SUPPLY: Micros = Micros::from_millis(500);

/// A lithium cell is nearly empty at this voltage, loaded: mV.
const EMPTY: u16 = 3_500;
/// Packs of cells in series: from these voltages on, mV, a supply is one of as many cells. A lower
/// voltage is no pack: USB, or a bench supply that is off.
const PACKS: [(u16, u16); 3] = [(17_200, 6), (12_900, 4), (6_000, 3)];

/// The supply of a robot: a battery of 3, 4 or 6 lithium cells in series, or what stands in for one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supply {
    /// Voltage, mV.
    pub millivolts: u16,
}

impl Supply {
    /// Whether the battery is nearly empty: below 3.5 V a cell. Which pack it is, its voltage says: one that is emptier
    /// than that (6 cells below 17.2 V) looks like the next smaller one.
    #[must_use]
    pub fn is_low(self) -> bool {
        let pack = PACKS.into_iter().find(|(from, _)| self.millivolts >= *from);
        pack.is_some_and(|(_, cells)| self.millivolts < cells * EMPTY)
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
        let lows = |millivolts: &[u16]| {
            let supplies = millivolts.iter().map(|&millivolts| Supply { millivolts });
            supplies.map(Supply::is_low).collect::<std::vec::Vec<_>>()
        };
        // Six cells: full, while it brakes, at its limit, below, at power-on too.
        assert_eq!(
            lows(&[25_200, 26_500, 21_000, 20_999, 17_200]),
            [false, false, false, true, true]
        );
        assert_eq!(lows(&[16_800, 14_000, 13_999, 12_900]), [false, false, true, true]);
        assert_eq!(lows(&[12_600, 10_500, 10_499, 6_000]), [false, false, true, true]);
        // USB alone leaves some millivolts.
        assert_eq!(lows(&[0, 5, 40, 5_100, 5_999]), [false; 5]);
        assert_eq!(lows(&[u16::MAX]), [false]);
    }

    #[test]
    fn it_is_told_in_volts() {
        for (millivolts, text) in [(25_200, "25.2 V"), (20_950, "21.0 V"), (49, "0.0 V")] {
            assert_eq!(Supply { millivolts }.to_string(), text);
        }
    }
}
