//! Sentences made in a `const`: errors have the same words when compiled and when run.
//!
//! ```
//! use rc10_app::Text;
//! const SENTENCE: Text = Text::new().push("bus ").push_number(3).push(" at ").push_float(0.25);
//! assert_eq!(SENTENCE.as_str(), "bus 3 at 0.25");
//! ```

/// A sentence of up to [`CAPACITY`](Self::CAPACITY) bytes.
#[derive(Clone, Copy)]
#[must_use]
pub struct Text {
    bytes: [u8; Self::CAPACITY],
    len: usize,
}

/// Decimals tried until a number reads back: nine digits, so twelve for the smallest.
const DECIMALS: u32 = 12;
/// Below this and from [`LARGE`] on numbers are written with an exponent.
const SMALL: f64 = 1e-3;
/// The other bound, like [`SMALL`].
const LARGE: f64 = 1e9;
/// Where a number with an exponent is as good as the next power of ten: an `f32` says it no better.
const ROUNDED: f64 = 1.0 - 3e-8;

impl Text {
    /// The longest text; what goes beyond is cut off.
    pub const CAPACITY: usize = 512;

    /// An empty text.
    pub const fn new() -> Self {
        Self { bytes: [0; Self::CAPACITY], len: 0 }
    }

    /// With this at its end.
    pub const fn push(mut self, text: &str) -> Self {
        let bytes = text.as_bytes();
        let mut fits = bytes.len();
        while self.len + fits > Self::CAPACITY || !text.is_char_boundary(fits) {
            fits -= 1;
        }
        let mut at = 0;
        while at < fits {
            self.bytes[self.len] = bytes[at];
            (self.len, at) = (self.len + 1, at + 1);
        }
        self
    }

    /// With a whole number at its end.
    pub const fn push_number(self, number: u64) -> Self {
        self.push_digits(number, 10, 1)
    }

    /// With `0x` and at least this many digits at its end.
    pub const fn push_hex(self, number: u32, digits: u32) -> Self {
        self.push("0x").push_digits(number as u64, 16, digits)
    }

    /// With a number at its end, in as few digits as read back as the same.
    pub const fn push_float(mut self, number: f32) -> Self {
        if number.is_nan() {
            return self.push("NaN");
        }
        if number.is_sign_negative() {
            self = self.push("-");
        }
        if number.is_infinite() {
            return self.push("inf");
        }
        let mut rest = number.abs() as f64;
        let mut exponent = 0;
        if rest >= LARGE {
            while rest >= 10.0 * ROUNDED {
                (rest, exponent) = (rest / 10.0, exponent + 1);
            }
            return self.push_decimals(rest, None).push("e").push_number(exponent);
        }
        if rest == 0.0 || rest >= SMALL {
            return self.push_decimals(rest, Some(number.abs()));
        }
        while rest < ROUNDED {
            (rest, exponent) = (rest * 10.0, exponent + 1);
        }
        self.push_decimals(rest, None).push("e-").push_number(exponent)
    }

    /// With as few decimals as read back as `exactly`, or as nearly as an `f32` says it.
    const fn push_decimals(mut self, number: f64, exactly: Option<f32>) -> Self {
        let (mut decimals, mut scale) = (0, 1);
        loop {
            #[expect(clippy::cast_possible_truncation, reason = "nine digits, rarely more")]
            let scaled = (number * scale as f64 + 0.5) as u64;
            #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
            let read = (scaled as f64 / scale as f64) as f32;
            let is_same = match exactly {
                #[expect(clippy::float_cmp, reason = "the very same number")]
                Some(exactly) => read == exactly,
                None => (scaled as f64 / scale as f64 / number - 1.0).abs() < 1.0 - ROUNDED,
            };
            if is_same || decimals == DECIMALS {
                self = self.push_number(scaled / scale);
                if decimals == 0 {
                    return self;
                }
                return self.push(".").push_digits(scaled % scale, 10, decimals);
            }
            (decimals, scale) = (decimals + 1, scale * 10);
        }
    }

    const fn push_digits(self, number: u64, base: u64, at_least: u32) -> Self {
        const DIGITS: &str = "0123456789ABCDEF";
        let (mut scale, mut digits) = (1, 1);
        while digits < at_least || number / scale >= base {
            (scale, digits) = (scale * base, digits + 1);
        }
        let mut text = self;
        while digits > 0 {
            #[expect(clippy::cast_possible_truncation, reason = "below 16")]
            let digit = (number / scale % base) as usize;
            text = text.push(DIGITS.split_at(digit).1.split_at(1).0);
            (scale, digits) = (scale / base, digits - 1);
        }
        text
    }

    /// The text.
    #[must_use]
    pub const fn as_str(&self) -> &str {
        match core::str::from_utf8(self.bytes.split_at(self.len).0) {
            Ok(text) => text,
            // Only whole characters are pushed.
            Err(_) => "",
        }
    }
}

impl Default for Text {
    fn default() -> Self {
        Self::new()
    }
}

impl core::fmt::Display for Text {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "the very same number")]
    fn numbers_read_back_as_the_same_in_few_digits() {
        for (number, text) in [
            (0.0, "0"),
            (-0.063, "-0.063"),
            (1.0, "1"),
            (400.0, "400"),
            (23.7, "23.7"),
            (0.1, "0.1"),
            (16_777_216.0, "16777216"),
            (0.0015, "0.0015"),
            (1e-6, "1e-6"),
            (2.5e-7, "2.5e-7"),
            (1e12, "1e12"),
            (f32::NAN, "NaN"),
            (f32::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(Text::new().push_float(number).as_str(), text);
        }
        let mut number = 1.1e-12_f32;
        while number < 1e12 {
            let text = Text::new().push_float(number).to_string();
            let read: f32 = text.parse().unwrap();
            assert!((read / number - 1.0).abs() <= f32::EPSILON, "{number} is not {text}");
            assert!(read == number || !(1e-3..1e9).contains(&number), "{number} is not {text}");
            number *= 1.37;
        }
    }

    #[test]
    fn digits_are_filled_up_and_what_is_too_long_is_cut_between_characters() {
        let text = Text::new().push_hex(0x1F, 3).push(" ").push_hex(0x1D55_1023, 8).push(" ");
        assert_eq!(text.push_number(u64::MAX).as_str(), "0x01F 0x1D551023 18446744073709551615");
        let mut text = Text::new().push("x");
        for _ in 0..Text::CAPACITY {
            text = text.push("°");
        }
        assert_eq!(text.as_str().len(), Text::CAPACITY - 1);
        assert!(text.as_str().ends_with('°'));
    }
}
