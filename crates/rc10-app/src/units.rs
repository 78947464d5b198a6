//! Units are types: a speed is not taken for an angle, nor a rotor's for the output's. At no cost.

use core::fmt;
use core::ops::{Add, Div, Mul, Neg, Sub};

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident: $symbol:literal;)*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
            #[cfg_attr(feature = "defmt", derive(defmt::Format))]
            #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
            pub struct $name(f32);

            impl $name {
                /// Zero.
                pub const ZERO: Self = Self(0.0);

                #[doc = concat!("A number of ", $symbol, ".")]
                pub const fn new(value: f32) -> Self {
                    Self(value)
                }

                #[doc = concat!("The number of ", $symbol, ".")]
                #[must_use]
                pub const fn get(self) -> f32 {
                    self.0
                }

                /// Without its sign.
                #[must_use]
                pub const fn abs(self) -> Self {
                    Self(self.0.abs())
                }

                /// Neither infinite nor NaN.
                #[must_use]
                pub const fn is_finite(self) -> bool {
                    self.0.is_finite()
                }
            }

            impl Add for $name {
                type Output = Self;
                fn add(self, other: Self) -> Self {
                    Self(self.0 + other.0)
                }
            }

            impl Sub for $name {
                type Output = Self;
                fn sub(self, other: Self) -> Self {
                    Self(self.0 - other.0)
                }
            }

            impl Neg for $name {
                type Output = Self;
                fn neg(self) -> Self {
                    Self(-self.0)
                }
            }

            impl Mul<f32> for $name {
                type Output = Self;
                fn mul(self, factor: f32) -> Self {
                    Self(self.0 * factor)
                }
            }

            impl Div<f32> for $name {
                type Output = Self;
                fn div(self, divisor: f32) -> Self {
                    Self(self.0 / divisor)
                }
            }

            impl fmt::Display for $name {
                fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    fmt::Display::fmt(&self.0, f)?;
                    f.write_str(concat!(" ", $symbol))
                }
            }
        )*
    };
}

units! {
    /// Speed of an output shaft in rpm; counter-clockwise positive, looking at the shaft's end.
    Rpm: "rpm";
    /// Speed of a rotor, in front of the gearbox, in revolutions per minute.
    RotorRpm: "rotor rpm";
    /// Speed of a magnetic field in electrical rpm: rotor rpm times pole pairs.
    ElectricalRpm: "erpm";
    /// Acceleration of an output shaft in revolutions per minute per second.
    RpmPerSecond: "rpm/s";
    /// Jerk of an output shaft in revolutions per minute per second².
    RpmPerSecondSquared: "rpm/s2";
    /// An angle in degrees; [`TotalAngle`](crate::TotalAngle) stays exact over many turns.
    Degrees: "deg";
    /// An angle in radians.
    Radians: "rad";
    /// Torque-producing current in amperes.
    Amps: "A";
    /// A voltage in volts.
    Volts: "V";
    /// Torque at an output shaft in newton metres.
    NewtonMetres: "N m";
    /// A power in watts.
    Watts: "W";
    /// An energy in joules.
    Joules: "J";
    /// A length of time in seconds: a step of a control loop, never a time of day.
    Seconds: "s";
    /// A temperature in degrees Celsius.
    Celsius: "degC";
}

impl Seconds {
    /// Whether it is a step of a control loop: finite and above zero.
    pub(crate) const fn is_step(self) -> bool {
        self.0 > 0.0 && self.0.is_finite()
    }

    /// From whole microseconds; more than 71 minutes are 71 minutes.
    pub const fn from_micros(micros: u64) -> Self {
        // Through 32 bits: a Cortex-M7 converts those in one instruction.
        #[expect(clippy::cast_possible_truncation, reason = "checked")]
        let micros = if micros < u32::MAX as u64 { micros as u32 } else { u32::MAX };
        #[expect(clippy::cast_precision_loss, reason = "exact up to 16 s")]
        Self::new(micros as f32 * 1e-6)
    }
}

impl From<Degrees> for Radians {
    fn from(angle: Degrees) -> Self {
        Self::new(angle.get().to_radians())
    }
}

impl From<Radians> for Degrees {
    fn from(angle: Radians) -> Self {
        Self::new(angle.get().to_degrees())
    }
}

/// A gearbox: the rotor turns `rotor / output` times while the output shaft turns once.
///
/// Kept as two whole numbers, so that angles through it stay exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gear {
    rotor: u32,
    output: u32,
}

impl Gear {
    /// No gearbox.
    pub const DIRECT: Self = Self { rotor: 1, output: 1 };

    /// `rotor` turns make `output` turns; `None` if one is zero or above 65,535.
    ///
    /// ```
    /// use rc10_app::{Gear, RotorRpm};
    /// let m3508 = Gear::new(3591, 187).unwrap();
    /// assert!((m3508.to_output(RotorRpm::new(9000.0)).get() - 468.67).abs() < 0.01);
    /// ```
    pub const fn new(rotor: u32, output: u32) -> Option<Self> {
        if rotor == 0 || output == 0 || rotor > 0xFFFF || output > 0xFFFF {
            None
        } else {
            Some(Self { rotor, output })
        }
    }

    /// Turns of the rotor that make [`output_turns`](Self::output_turns) turns of the output.
    #[must_use]
    pub const fn rotor_turns(self) -> u32 {
        self.rotor
    }

    /// Turns of the output; [`rotor_turns`](Self::rotor_turns) go with them.
    #[must_use]
    pub const fn output_turns(self) -> u32 {
        self.output
    }

    /// Rotor turns per output turn.
    #[must_use]
    pub const fn ratio(self) -> f32 {
        #[expect(clippy::cast_precision_loss, reason = "both are below 2^16")]
        return self.rotor as f32 / self.output as f32;
    }

    /// The output's speed for a rotor's.
    #[must_use]
    pub fn to_output(self, rotor: RotorRpm) -> Rpm {
        Rpm::new(rotor.get() / self.ratio())
    }
}

/// The direction in which the output shaft counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// The motor's own way.
    #[default]
    Forward,
    /// The other way: a motor that is mounted mirrored.
    Reversed,
}

impl Direction {
    /// 1 for forward, -1 for reversed.
    #[must_use]
    pub const fn sign(self) -> i8 {
        match self {
            Self::Forward => 1,
            Self::Reversed => -1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    #[test]
    fn a_gear_without_teeth_does_not_exist() {
        assert_eq!(Gear::new(0, 1), None);
        assert_eq!(Gear::new(1, 0), None);
        assert_eq!(Gear::new(70_000, 1), None);
    }

    #[test]
    fn units_print_with_their_symbol() {
        assert_eq!(Rpm::new(12.5).to_string(), "12.5 rpm");
        assert_eq!(std::format!("{:.1}", Amps::new(0.25)), "0.2 A");
    }
}
