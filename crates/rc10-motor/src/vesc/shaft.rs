//! From the VESC's electrical turns to the output shaft, and back.

use core::fmt;
use core::num::NonZeroU8;

use rc10_app::{CountsPerTurn, Gear, Rpm, TotalAngle};

/// Electrical revolutions per minute: rotor rpm times pole pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ElectricalRpm(f32);

impl ElectricalRpm {
    /// A number of electrical rpm.
    #[inline]
    #[must_use]
    pub const fn new(value: f32) -> Self {
        Self(value)
    }

    /// The number of electrical rpm.
    #[inline]
    #[must_use]
    pub const fn get(self) -> f32 {
        self.0
    }
}

impl fmt::Display for ElectricalRpm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)?;
        f.write_str(" erpm")
    }
}

/// Below this a VESC does not regulate speed, unless it is set otherwise: `s_pid_min_erpm` in
/// bldc's `mcconf_default.h`.
pub const DEFAULT_MINIMUM: ElectricalRpm = ElectricalRpm::new(900.0);

/// Tachometer steps per electrical turn: one per commutation step (`comm_can.md`, `STATUS_5`).
const STEPS_PER_ELECTRICAL_TURN: u32 = 6;

/// What stands between electrical turns and the output shaft, and how slow it can be regulated.
///
/// ```
/// use core::num::NonZeroU8;
/// use rc10_app::{Gear, Rpm};
/// use rc10_motor::vesc::{ElectricalRpm, Shaft};
/// let shaft = Shaft::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT);
/// assert_eq!(shaft.to_electrical(Rpm::new(3000.0)), ElectricalRpm::new(21_000.0));
/// assert!(!shaft.regulates(Rpm::new(128.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shaft {
    minimum: ElectricalRpm,
    electrical_per_output: f32,
    output_per_electrical: f32,
    steps: CountsPerTurn,
}

impl Shaft {
    /// Of a motor with so many pole pairs (half its magnet poles) behind a gearbox, with the
    /// firmware's own minimum speed.
    #[must_use]
    pub const fn new(pole_pairs: NonZeroU8, gear: Gear) -> Self {
        let pairs = pole_pairs.get();
        let electrical_per_output = gear.ratio() * pairs as f32;
        // At most 6 · 255 · 65,535: fits.
        let steps = STEPS_PER_ELECTRICAL_TURN * pairs as u32 * gear.rotor_turns();
        Self {
            minimum: DEFAULT_MINIMUM,
            electrical_per_output,
            output_per_electrical: 1.0 / electrical_per_output,
            steps: CountsPerTurn::new(steps, gear.output_turns()),
        }
    }

    /// With the minimum that is set in the VESC ("Minimum ERPM" of its speed controller).
    #[must_use]
    pub const fn with_minimum(mut self, minimum: ElectricalRpm) -> Self {
        self.minimum = minimum;
        self
    }

    /// The minimum that is set in the VESC.
    #[must_use]
    pub const fn minimum(&self) -> ElectricalRpm {
        self.minimum
    }

    /// The electrical speed at a speed of the output shaft.
    #[inline]
    #[must_use]
    pub fn to_electrical(&self, output: Rpm) -> ElectricalRpm {
        ElectricalRpm::new(output.get() * self.electrical_per_output)
    }

    /// The output shaft's speed at an electrical speed.
    #[inline]
    #[must_use]
    pub fn to_output(&self, electrical: ElectricalRpm) -> Rpm {
        Rpm::new(electrical.get() * self.output_per_electrical)
    }

    /// Whether the VESC regulates this speed of the output shaft. Slower ones it does not, standing
    /// still among them: the motor is left free or drags, and holds nothing.
    #[inline]
    #[must_use]
    pub fn regulates(&self, output: Rpm) -> bool {
        // False for NaN.
        self.to_electrical(output).get().abs() >= self.minimum.get()
    }

    /// The slowest speed of the output shaft that is regulated.
    #[must_use]
    pub fn slowest(&self) -> Rpm {
        self.to_output(self.minimum)
    }

    /// Tachometer steps per turn of the output shaft.
    #[must_use]
    pub const fn steps_per_turn(&self) -> CountsPerTurn {
        self.steps
    }

    /// The output shaft's angle after so many tachometer steps. The tachometer itself goes round
    /// after 2³² of them.
    #[must_use]
    pub const fn total_angle(&self, steps: i64) -> TotalAngle {
        TotalAngle::new(steps, self.steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shaft(pole_pairs: u8, gear: Gear) -> Shaft {
        Shaft::new(NonZeroU8::new(pole_pairs).unwrap(), gear)
    }

    #[test]
    fn electrical_speed_is_speed_times_pole_pairs_times_gear() {
        let planetary = Gear::new(3591, 187).unwrap();
        for (pole_pairs, gear, output, electrical) in [
            (7, Gear::DIRECT, 3000.0, 21_000.0),
            (14, Gear::DIRECT, -1500.0, -21_000.0),
            (4, Gear::DIRECT, 12_345.0, 49_380.0),
            (7, planetary, 187.0, 25_137.0),
        ] {
            let shaft = shaft(pole_pairs, gear);
            let there = shaft.to_electrical(Rpm::new(output)).get();
            assert!((there - electrical).abs() <= 1e-6 * electrical.abs(), "{there}");
            let back = shaft.to_output(ElectricalRpm::new(electrical)).get();
            assert!((back - output).abs() <= 1e-6 * output.abs(), "{back}");
        }
    }

    #[test]
    fn slow_speeds_are_known_to_be_unregulated() {
        let wheel = shaft(7, Gear::DIRECT);
        for (rpm, regulated) in
            [(0.0, false), (128.5, false), (-128.5, false), (129.0, true), (-129.0, true)]
        {
            assert_eq!(wheel.regulates(Rpm::new(rpm)), regulated, "{rpm}");
        }
        assert!(!wheel.regulates(Rpm::new(f32::NAN)));
        assert!((wheel.slowest().get() - 128.571_4).abs() < 1e-3);
        let set = wheel.with_minimum(ElectricalRpm::new(70.0));
        assert!(set.regulates(Rpm::new(10.0)) && !set.regulates(Rpm::new(9.9)));
    }

    #[test]
    fn six_steps_of_the_tachometer_are_an_electrical_turn() {
        let turn = TotalAngle::from_degrees(360).microdegrees();
        assert_eq!(shaft(7, Gear::DIRECT).total_angle(42).microdegrees(), turn);
        let geared = shaft(7, Gear::new(3591, 187).unwrap());
        assert_eq!(geared.total_angle(-42 * 3591).microdegrees(), -187 * turn);
    }
}
