//! The few functions that `core` lacks: `libm` behind one door, so that the chip and a PC compute
//! the same bits, and cheap forms for the control tick.

/// Sine and cosine of an angle in radians.
pub fn sin_cos(radians: f32) -> (f32, f32) {
    libm::sincosf(radians)
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

/// Square root to within two units in the last place for normal positive numbers, 0 otherwise: about
/// 30 instructions on a Cortex-M7.
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

/// The nearest integer (halves to the even one), saturating at i16's ends; 0 for NaN. This is how a
/// scaled value goes onto a wire: it never wraps.
pub fn round_to_i16(x: f32) -> i16 {
    /// 1.5 times 2^23: the sum's last place is 1, and its low bits are the integer in two's
    /// complement.
    const LAST_PLACE_IS_ONE: f32 = 12_582_912.0;
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

/// A ratio of whole numbers, by which others are multiplied without a division: for codecs, where
/// the chip has none of 64 bits.
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
