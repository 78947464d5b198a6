//! What the bits of an axis's error word mean, which firmware families disagree on.

use crate::motor::Fault;

/// A family of firmware, by what its error word means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Firmware {
    /// As the vendor counts.
    pub version: &'static str,
    /// Bits of the error word and their texts, the gravest first.
    pub errors: &'static [(u8, &'static str)],
    /// Bits that are set while an axis starts: no fault.
    pub starting: u32,
    /// Whether message `15` is temperatures.
    pub has_temperatures: bool,
}

impl Firmware {
    /// `ODrive` v3 (`odrive-interface.yaml`, `ODrive.Axis.error`; bits 1 to 5, 10, 15 and 16 only
    /// in older ones).
    pub const V0_5: Self = Self {
        version: "0.5",
        errors: &[
            (14, "emergency stop requested"),
            (6, "motor failed"),
            (8, "encoder failed"),
            (9, "controller failed"),
            (7, "sensorless estimator failed"),
            (18, "too hot"),
            (2, "supply voltage too high"),
            (1, "supply voltage too low"),
            (16, "supply current too high"),
            (15, "too much current fed back"),
            (3, "current measurement timed out"),
            (4, "brake resistor disarmed"),
            (5, "motor disarmed"),
            (11, "watchdog expired"),
            (12, "lower end stop pressed"),
            (13, "upper end stop pressed"),
            (17, "homing without end stop"),
            (19, "position unknown"),
            (10, "position control while sensorless"),
            (0, "state not possible now"),
        ],
        starting: 0,
        has_temperatures: false,
    };

    /// `ODrive` Pro, S1 and Micro (`odrive` 0.6.7, `ODriveError`).
    pub const V0_6: Self = Self {
        version: "0.6",
        errors: &[
            (25, "emergency stop requested"),
            (5, "gate driver failed"),
            (1, "system failed"),
            (2, "timing failed"),
            (12, "current limit violated"),
            (13, "motor too hot"),
            (14, "controller too hot"),
            (8, "supply voltage too high"),
            (9, "supply voltage too low"),
            (10, "supply current too high"),
            (11, "too much current fed back"),
            (15, "velocity limit violated"),
            (16, "position limit violated"),
            (26, "motor does not follow its field"),
            (27, "brake resistor disarmed"),
            (28, "thermistor disconnected"),
            (24, "watchdog expired"),
            (3, "encoder estimate missing"),
            (6, "input missing"),
            (4, "configuration invalid"),
            (30, "calibration failed"),
            (0, "still starting"),
        ],
        starting: 1,
        has_temperatures: true,
    };

    /// The whole error word, with the text of its gravest error; `None` without an error.
    #[must_use]
    pub fn fault(&self, errors: u32) -> Option<Fault> {
        if errors == 0 {
            return None;
        }
        let gravest = self.errors.iter().find(|(bit, _)| errors >> bit & 1 == 1);
        Some(Fault::new(errors, gravest.map_or("an undocumented error", |(_, text)| text)))
    }
}
