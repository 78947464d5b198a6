//! Range-mapped setpoints: what Damiao's MIT mode and CyberGear's motion control have in common.
//!
//! A quantity within ±limit (or 0 ..= limit) is spread over all values of an unsigned field. The
//! vendors' code truncates, so that zero lies at 0x7FFF of 16 bits and 0x7FF of 12. It divides by
//! the width of the range; multiplying by a reciprocal instead would put round numbers such as a
//! gain of 100 one step lower than the vendor does.

use rc10_app::ConfigError;

/// What the drive's own loop shall do, at the output shaft:
/// torque = `kp` (`position` - measured) + `kd` (`velocity` - measured) + `torque`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setpoint {
    /// In rad, ±[`Limits::position`].
    pub position: f32,
    /// In rad/s, ±[`Limits::velocity`].
    pub velocity: f32,
    /// Stiffness in N m / rad, 0 ..= [`Limits::kp`].
    pub kp: f32,
    /// Damping in N m s / rad, 0 ..= [`Limits::kd`]. Keep it above zero where `kp` is: without it
    /// the shaft oscillates (Damiao's manuals).
    pub kd: f32,
    /// Torque added to that of the loop, in N m, ±[`Limits::torque`].
    pub torque: f32,
}

impl Setpoint {
    /// No torque: all zero.
    pub const COAST: Self = Self { position: 0.0, velocity: 0.0, kp: 0.0, kd: 0.0, torque: 0.0 };

    /// `Ok` if every number is finite. Packing takes any: it limits, and sends zero for NaN, which
    /// for an angle with stiffness is a place to go to. Check before.
    ///
    /// # Errors
    /// [`ConfigError`] with the first field that is not finite.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let Self { position, velocity, kp, kd, torque } = *self;
        let fields = [
            ("position", position),
            ("velocity", velocity),
            ("kp", kp),
            ("kd", kd),
            ("torque", torque),
        ];
        match fields.into_iter().find(|(_, value)| !value.is_finite()) {
            Some((field, value)) => Err(ConfigError::new(field, value, "finite")),
            None => Ok(()),
        }
    }
}

/// What the ends of each field stand for. They are settings of the device: wrong ones scale every
/// value, and nothing tells.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits {
    position: f32,
    velocity: f32,
    torque: f32,
    kp: f32,
    kd: f32,
}

/// Largest `kp` of Damiao, CyberGear and RobStride's small models, N m / rad.
const KP: f32 = 500.0;
/// Largest `kd` of the same, N m s / rad.
const KD: f32 = 5.0;
/// No motor has a range beyond it, in any unit; sums and products of two ranges stay finite.
const LARGEST: f32 = 1e6;

impl Limits {
    /// Ranges ±`position` (rad), ±`velocity` (rad/s), ±`torque` (N m); gains up to 500 N m / rad
    /// and 5 N m s / rad.
    ///
    /// # Errors
    /// [`ConfigError`] with the first that is not above zero, or above a million.
    pub fn new(position: f32, velocity: f32, torque: f32) -> Result<Self, ConfigError> {
        Self::of(position, velocity, torque).checked()
    }

    /// With other largest gains: N m / rad, N m s / rad.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_gains(self, kp: f32, kd: f32) -> Result<Self, ConfigError> {
        self.gains(kp, kd).checked()
    }

    /// With another range of position, ± rad.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_position(self, position: f32) -> Result<Self, ConfigError> {
        Self { position, ..self }.checked()
    }

    /// For tables: unchecked, so only with numbers that a test checks.
    pub(crate) const fn of(position: f32, velocity: f32, torque: f32) -> Self {
        Self { position, velocity, torque, kp: KP, kd: KD }
    }

    /// For tables, as [`of`](Self::of).
    pub(crate) const fn gains(self, kp: f32, kd: f32) -> Self {
        Self { kp, kd, ..self }
    }

    pub(crate) fn checked(self) -> Result<Self, ConfigError> {
        let Self { position, velocity, torque, kp, kd } = self;
        let fields = [
            ("position", position),
            ("velocity", velocity),
            ("torque", torque),
            ("kp", kp),
            ("kd", kd),
        ];
        match fields.into_iter().find(|&(_, value)| !(value > 0.0 && value <= LARGEST)) {
            Some((field, value)) => {
                Err(ConfigError::new(field, value, "above 0, and at most a million"))
            }
            None => Ok(self),
        }
    }

    /// Largest position, rad.
    #[must_use]
    pub const fn position(&self) -> f32 {
        self.position
    }

    /// Largest velocity, rad/s.
    #[must_use]
    pub const fn velocity(&self) -> f32 {
        self.velocity
    }

    /// Largest torque, N m.
    #[must_use]
    pub const fn torque(&self) -> f32 {
        self.torque
    }

    /// Largest `kp`, N m / rad.
    #[must_use]
    pub const fn kp(&self) -> f32 {
        self.kp
    }

    /// Largest `kd`, N m s / rad.
    #[must_use]
    pub const fn kd(&self) -> f32 {
        self.kd
    }
}

/// The largest value of a field.
pub(crate) const fn full(bits: u32) -> u32 {
    (1 << bits) - 1
}

/// A field for -`limit` ..= `limit`; the middle for NaN.
#[inline]
pub(crate) fn pack_signed<const BITS: u32>(x: f32, limit: f32) -> u32 {
    if x.abs() < limit {
        #[expect(clippy::cast_possible_truncation, reason = "below the field's largest value")]
        return ((x + limit) * full(BITS) as f32 / (limit + limit)) as u32;
    }
    beyond(x, full(BITS), full(BITS) / 2)
}

/// A field for 0 ..= `limit`; zero for NaN.
#[inline]
pub(crate) fn pack_positive<const BITS: u32>(x: f32, limit: f32) -> u32 {
    if x >= 0.0 && x < limit {
        #[expect(clippy::cast_possible_truncation, reason = "below the field's largest value")]
        return (x * full(BITS) as f32 / limit) as u32;
    }
    beyond(x, full(BITS), 0)
}

/// Out of line: the usual case stays short. The limits themselves come here too, because rounding
/// could put them one step inside.
#[cold]
fn beyond(x: f32, full: u32, neutral: u32) -> u32 {
    if x.is_nan() {
        neutral
    } else if x < 0.0 {
        0
    } else {
        full
    }
}

/// The value of a field for -`limit` ..= `limit`: symmetric, never beyond, and as exact around zero
/// as elsewhere.
#[inline]
pub(crate) const fn unpack_signed<const BITS: u32>(raw: u32, limit: f32) -> f32 {
    let from_middle = (2 * raw).cast_signed() - full(BITS).cast_signed();
    from_middle as f32 / full(BITS) as f32 * limit
}

/// `x` as it may go onto a wire as f32: infinities become the largest number, NaN zero.
#[inline]
pub(crate) fn sendable(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(f32::MIN, f32::MAX) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_end_where_their_ranges_end() {
        let wide = |x| pack_signed::<16>(x, 12.5);
        let narrow = |x| pack_positive::<12>(x, 500.0);
        for (x, signed) in [
            (0.0, 0x7FFF),
            (-0.0, 0x7FFF),
            (f32::NAN, 0x7FFF),
            (12.5, 0xFFFF),
            (-12.5, 0),
            (f32::INFINITY, 0xFFFF),
            (f32::NEG_INFINITY, 0),
            (f32::MAX, 0xFFFF),
            (12.4999, 0xFFFE),
            (-12.4999, 0),
        ] {
            assert_eq!(wide(x), signed, "{x}");
        }
        for (x, positive) in
            [(0.0, 0), (-1.0, 0), (f32::NAN, 0), (100.0, 819), (500.0, 4095), (1e9, 4095)]
        {
            assert_eq!(narrow(x), positive, "{x}");
        }
        // Where rounding alone would fall one step short, or go one too far.
        let mut limit = 1e-3_f32;
        while limit < LARGEST {
            assert_eq!(pack_signed::<16>(limit, limit), 0xFFFF, "{limit}");
            assert!(pack_signed::<16>(limit.next_down(), limit) <= 0xFFFF, "{limit}");
            assert!(pack_positive::<12>(limit.next_down(), limit) <= 0xFFF, "{limit}");
            limit *= 1.01;
        }
    }

    #[test]
    fn values_are_symmetric_around_the_middle() {
        assert_eq!(unpack_signed::<12>(0xFFF, 30.0).to_bits(), 30.0_f32.to_bits());
        assert_eq!(unpack_signed::<12>(0, 30.0).to_bits(), (-30.0_f32).to_bits());
        let sum = unpack_signed::<16>(0x7FFF, 12.5) + unpack_signed::<16>(0x8000, 12.5);
        assert_eq!(sum.to_bits(), 0);
    }

    #[test]
    fn what_is_no_range_and_no_number_is_named() {
        assert!(Limits::new(12.5, 30.0, 10.0).is_ok());
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e7] {
            let error = Limits::new(12.5, bad, 10.0).unwrap_err();
            assert_eq!((error.field, error.value.to_bits()), ("velocity", bad.to_bits()));
        }
        assert_eq!(Limits::of(1.0, 1.0, 1.0).with_gains(0.0, 1.0).unwrap_err().field, "kp");
        assert!(Limits::of(1.0, 1.0, 1.0).with_position(f32::NAN).is_err());
        assert_eq!(Setpoint::COAST.validate(), Ok(()));
        let bad = Setpoint { kd: f32::NAN, ..Setpoint::COAST };
        assert_eq!(bad.validate().unwrap_err().field, "kd");
    }
}
