//! Functions that `core` lacks: `libm` for the same bits on chip and PC, and cheap forms.

/// Sine and cosine of an angle in radians, each within 1.2e-7 for angles up to 1000 rad. (`libm`
/// computes them in f64, which a chip built for f32 does in software.) Beyond 8192 rad, and for what is not finite, it is `libm`'s.
pub fn sin_cos(radians: f32) -> (f32, f32) {
    if radians.is_nan() || radians.abs() > 8192.0 {
        return beyond(radians);
    }
    near_sin_cos(radians)
}

/// [`sin_cos`] of an angle that is known to be within ±8192 rad.
pub(crate) fn near_sin_cos(radians: f32) -> (f32, f32) {
    /// π/2 in two parts; a whole number of up to 13 bits times the first is exact.
    const PARTS: [f32; 2] = [1.570_312_5, 4.838_268e-4];
    let (quarters, whole) = nearest_whole(radians * core::f32::consts::FRAC_2_PI);
    let x = (radians - quarters * PARTS[0]) - quarters * PARTS[1];
    quarters_and(x, whole)
}

/// Radians in 2⁻³² turns.
pub(crate) const RADIANS_PER_PART: f32 = core::f32::consts::TAU / 4_294_967_296.0;

/// Sine and cosine of an angle in 2⁻³² turns, each within 1.2e-7.
pub(crate) fn sin_cos_of_parts(parts: i32) -> (f32, f32) {
    // An eighth of a turn more, and the upper bits are the nearest quarter.
    #[expect(clippy::cast_sign_loss, reason = "bits")]
    let whole = parts.wrapping_add(1 << 29) as u32 >> 30;
    #[expect(clippy::cast_precision_loss, reason = "within an eighth of a turn: seven digits")]
    let x = parts.wrapping_sub((whole << 30).cast_signed()) as f32 * RADIANS_PER_PART;
    quarters_and(x, whole)
}

/// Sine and cosine of `x`, within ±π/4, and as many quarters of a turn.
#[inline(always)]
fn quarters_and(x: f32, quarters: u32) -> (f32, f32) {
    // Polynomials of Cephes (S. Moshier, sinf.c), least error within ±π/4.
    let z = x * x;
    let sin = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x;
    let cos = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    let (sin, cos) = if quarters & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let negative = |x: f32, bit: u32| f32::from_bits(x.to_bits() ^ ((bit & 2) << 30));
    (negative(sin, quarters), negative(cos, quarters.wrapping_add(1)))
}

#[cold]
fn beyond(radians: f32) -> (f32, f32) {
    libm::sincosf(radians)
}

/// 1.5 times 2^23: the sum's last place is 1, and its low bits are the integer in two's complement.
const LAST_PLACE_IS_ONE: f32 = 12_582_912.0;

/// The nearest whole number to one within ±2^21 (halves to the even one), and its low bits.
const fn nearest_whole(x: f32) -> (f32, u32) {
    let sum = x + LAST_PLACE_IS_ONE;
    (sum - LAST_PLACE_IS_ONE, sum.to_bits())
}

/// The angle of (x, y) from the x axis, −π ..= π, within 3e-7; 0 for the zero vector.
pub fn atan2(y: f32, x: f32) -> f32 {
    let long = if x.abs() >= y.abs() { x.abs() } else { y.abs() };
    // Also false for NaN.
    if long > 0.0 && long < 1e38 { usual_atan2(y, x) } else { unusual(y, x) }
}

/// [`atan2`] of a vector that is known to be neither zero nor longer than 1e38.
pub(crate) fn usual_atan2(y: f32, x: f32) -> f32 {
    use core::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    /// tan(π/8).
    const EIGHTH: f32 = 0.414_213_57;
    let (along, across) = (x.abs(), y.abs());
    let (long, short) = if along >= across { (along, across) } else { (across, along) };
    // tan(a − π/4) = (tan a − 1) / (tan a + 1): a division for both cases.
    let (numerator, denominator, start) = if short > EIGHTH * long {
        (short - long, short + long, FRAC_PI_4)
    } else {
        (short, long, 0.0)
    };
    let t = numerator / denominator;
    // Polynomial of Cephes (S. Moshier, atanf.c), least error within ±tan(π/8).
    let z = t * t;
    let series = ((8.053_744_5e-2 * z - 1.387_768_6e-1) * z + 1.997_771e-1) * z - 3.333_295e-1;
    let octant = start + (series * z * t + t);
    let quadrant = if along >= across { octant } else { FRAC_PI_2 - octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    half.copysign(y)
}

/// Zero, as good as infinite, or not a number.
#[cold]
fn unusual(y: f32, x: f32) -> f32 {
    if x == 0.0 && y == 0.0 { 0.0 } else { libm::atan2f(y, x) }
}

/// Square root, correctly rounded; NaN below zero.
pub fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Length of the vector (x, y) within two units in the last place, without overflow on the way.
/// (`libm` computes it in f64, which a chip built for f32 does in software.)
pub fn hypot(x: f32, y: f32) -> f32 {
    let (x, y) = (x.abs(), y.abs());
    let (long, short) = if x >= y { (x, y) } else { (y, x) };
    if long > 0.0 && long < f32::INFINITY {
        let ratio = short / long;
        long * sqrt(1.0 + ratio * ratio)
    } else {
        // Zero, infinite, or not a number at all.
        long + short
    }
}

/// e to the power of x, less one: exact also where x is nearly zero.
pub fn exp_m1(x: f32) -> f32 {
    libm::expm1f(x)
}

/// The nearest whole number; halves away from zero.
pub fn round(x: f32) -> f32 {
    libm::roundf(x)
}

/// Square root to within 0.0005 % for normal positive numbers, 0 otherwise: about 15 instructions
/// on a Cortex-M7, where a correctly rounded one without the hardware instruction takes 200.
pub fn fast_sqrt(x: f32) -> f32 {
    // Not the other way round: a test for NaN beside it costs 20 instructions.
    if x >= f32::MIN_POSITIVE { x * inverse_sqrt(x) } else { 0.0 }
}

/// 1/√x to within 0.0005 % for normal positive numbers.
fn inverse_sqrt(x: f32) -> f32 {
    // Halving the exponent gives a first guess of 1/√x within 3.5 %; two Newton steps follow.
    let mut inverse = f32::from_bits(0x5F37_59DF - (x.to_bits() >> 1));
    inverse *= 1.5 - 0.5 * x * inverse * inverse;
    inverse * (1.5 - 0.5 * x * inverse * inverse)
}

/// Square root within two last places for normal positive numbers, else 0: 30 instructions.
pub fn near_sqrt(x: f32) -> f32 {
    let guess = fast_sqrt(x);
    // A step of Heron's squares the relative error of the guess.
    if guess > 0.0 { 0.5 * (guess + x / guess) } else { 0.0 }
}

/// Cube root to within 4 % for normal positive numbers: a first guess.
pub(crate) fn rough_cbrt(x: f32) -> f32 {
    // A third of the exponent; the constant makes the largest errors above and below equal.
    f32::from_bits(x.to_bits() / 3 + 0x2A51_19F2)
}

/// `x` held within ±`limit`. NaN stays NaN; unlike [`f32::clamp`] it never panics.
pub fn within(x: f32, limit: f32) -> f32 {
    if x.abs() <= limit { x } else { limited(x, limit) }
}

/// Out of line, so that the usual case is a comparison and nothing else.
#[cold]
fn limited(x: f32, limit: f32) -> f32 {
    if x.is_nan() { x } else { limit.copysign(x) }
}

/// The nearest integer (halves to even), saturating, 0 for NaN: as values go onto a wire.
pub fn round_to_i16(x: f32) -> i16 {
    if x.abs() <= 32767.0 {
        #[expect(clippy::cast_possible_truncation, reason = "the low bits are the integer")]
        return (x + LAST_PLACE_IS_ONE).to_bits() as i16;
    }
    saturated(x)
}

#[cold]
#[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
fn saturated(x: f32) -> i16 {
    // `as` from float to integer saturates and takes NaN to zero.
    x as i16
}

/// The nearest integer (halves away from zero), saturating at i32's ends; 0 for NaN.
pub fn round_to_i32(x: f32) -> i32 {
    // From 2^23 on every f32 is a whole number, and adding a half could round up.
    let half = if x.abs() < 8_388_608.0 { 0.5_f32.copysign(x) } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
    return (x + half) as i32;
}

/// A ratio of whole numbers to multiply by without a 64-bit division, which the chip lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ratio {
    multiplier: i64,
    shift: u32,
}

impl Ratio {
    /// `numerator / denominator`: above 0, below 2³¹, and accurate to 62 bits.
    pub const fn new(numerator: u64, denominator: u64) -> Self {
        let (numerator, denominator) = (numerator as i128, denominator as i128);
        let mut shift = 1;
        while shift < 92 && (numerator << (shift + 1)) < denominator << 62 {
            shift += 1;
        }
        #[expect(clippy::cast_possible_truncation, reason = "below 2^62")]
        let multiplier = (((numerator << shift) + denominator / 2) / denominator) as i64;
        Self { multiplier, shift }
    }

    /// The nearest whole number to `value` times the ratio; saturates at the ends of i64.
    #[must_use]
    pub fn times(self, value: i64) -> i64 {
        let product = i128::from(value) * i128::from(self.multiplier);
        let nearest = (product + (1 << (self.shift - 1))) >> self.shift;
        i64::try_from(nearest).unwrap_or(if nearest < 0 { i64::MIN } else { i64::MAX })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_square_root_is_as_good_as_it_says() {
        let mut x = f32::MIN_POSITIVE;
        while x < 1e38 {
            let exact = sqrt(x);
            assert!((fast_sqrt(x) - exact).abs() <= 5e-6 * exact, "{x}");
            assert!((near_sqrt(x) - exact).abs() <= 2.4e-7 * exact, "{x}");
            let cube = rough_cbrt(x) * rough_cbrt(x) * rough_cbrt(x);
            assert!((cube / x - 1.0).abs() <= 0.12, "{x}");
            x *= 1.037;
        }
        for bad in [f32::NAN, -1.0, 0.0, -0.0, f32::NEG_INFINITY] {
            assert_eq!(fast_sqrt(bad).to_bits(), 0, "{bad}");
            assert_eq!(near_sqrt(bad).to_bits(), 0, "{bad}");
        }
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
    fn sine_and_cosine_are_those_of_f64() {
        extern crate std;
        let mut worst = 0.0_f64;
        for step in -4_000_000..=4_000_000_i32 {
            // To 1000 rad, in steps that fall on no multiple of anything.
            let x = (f64::from(step) * 2.5e-4 * 1.000_037) as f32;
            let ((s, c), (sin, cos)) = (sin_cos(x), f64::from(x).sin_cos());
            worst = worst.max((f64::from(s) - sin).abs()).max((f64::from(c) - cos).abs());
        }
        assert!(worst < 1.2e-7, "{worst}");
        for x in [8000.0_f32, -8191.5, 8193.0, 1e9, -3e20] {
            let ((s, c), (sin, cos)) = (sin_cos(x), f64::from(x).sin_cos());
            assert!((f64::from(s) - sin).abs() < 1e-6 && (f64::from(c) - cos).abs() < 1e-6, "{x}");
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        let mut worst = 0.0_f64;
        for step in 0..1_000_000_i32 {
            let parts = step.wrapping_mul(4294).wrapping_add(step);
            let exact = (f64::from(parts) * core::f64::consts::TAU / 4_294_967_296.0).sin_cos();
            let (s, c) = sin_cos_of_parts(parts);
            worst = worst.max((f64::from(s) - exact.0).abs()).max((f64::from(c) - exact.1).abs());
        }
        assert!(worst < 1.2e-7, "{worst}");
        assert!(sin_cos(f32::NAN).0.is_nan() && sin_cos(f32::INFINITY).1.is_nan());
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
    fn the_angle_of_a_vector_is_that_of_f64() {
        extern crate std;
        let mut worst = 0.0_f64;
        for step in 0..2_000_000_u32 {
            let (sin, cos) = (f64::from(step) * core::f64::consts::PI * 1e-6).sin_cos();
            for size in [1e-20, 1e-3, 1.0, 7e7] {
                let (y, x) = ((sin * size) as f32, (cos * size) as f32);
                let exact = f64::from(y).atan2(f64::from(x));
                worst = worst.max((f64::from(atan2(y, x)) - exact).abs());
            }
        }
        assert!(worst < 3e-7, "{worst}");
        for (y, x) in [(0.0, 0.0), (-0.0, 0.0), (0.0, -0.0), (0.0, 5.0)] {
            assert!(atan2(y, x).abs() < f32::EPSILON, "{y} {x}");
        }
        assert!((atan2(f32::INFINITY, 1.0) - core::f32::consts::FRAC_PI_2).abs() < 1e-6);
        assert!(atan2(f32::NAN, 1.0).is_nan() && atan2(1.0, f32::NAN).is_nan());
    }

    #[test]
    fn the_length_of_a_vector_is_that_of_libm() {
        let numbers = [0.0, 1e-30, 3.0, 4.0, 0.1, -7.5, 1e30, f32::INFINITY];
        for x in numbers {
            for y in numbers {
                let (ours, theirs) = (hypot(x, y), libm::hypotf(x, y));
                let near = (ours - theirs).abs() <= 2.5e-7 * theirs;
                assert!(near || ours.to_bits() == theirs.to_bits(), "{x} {y}: {ours} {theirs}");
            }
        }
        assert!(hypot(f32::NAN, 1.0).is_nan());
    }

    #[test]
    fn rounding_saturates_and_never_wraps() {
        for (x, rounded) in [
            (245.76, 246),
            (-245.76, -246),
            (0.51, 1),
            (-0.51, -1),
            (0.49, 0),
            (-0.49, 0),
            (32767.4, i16::MAX),
            (-32768.0, i16::MIN),
            (12345.4, 12345),
            (40_000.0, i16::MAX),
            (-40_000.0, i16::MIN),
            (f32::INFINITY, i16::MAX),
            (f32::NAN, 0),
        ] {
            assert_eq!(round_to_i16(x), rounded, "{x}");
            if x.abs() < 30_000.0 {
                assert_eq!(round_to_i32(x), i32::from(rounded), "{x}");
            }
        }
        assert_eq!(round_to_i32(16_777_215.0), 16_777_215);
        assert_eq!(round_to_i32(1e20), i32::MAX);
    }

    #[test]
    fn ratios_give_the_nearest_whole_number() {
        for (numerator, denominator) in
            [(1, 10_000), (3376, 5_859_375), (5_859_375, 3376), (1 << 30, 1), (1, u64::MAX >> 1)]
        {
            let ratio = Ratio::new(numerator, denominator);
            for value in (0..60).flat_map(|bits| [(1_i64 << bits) - 1, 1 << bits, 3 << bits >> 1]) {
                for value in [value, -value] {
                    let exact = i128::from(value) * i128::from(numerator);
                    let got = i128::from(ratio.times(value));
                    // A part in 2^60 beside the half that rounding takes.
                    let off = 2 * (exact - got * i128::from(denominator)).abs();
                    let allowed = i128::from(denominator) + (exact.abs() >> 58);
                    let saturates = got == i64::MAX.into() || got == i64::MIN.into();
                    assert!(off <= allowed || saturates, "{value} * {numerator} / {denominator}");
                }
            }
        }
    }
}
