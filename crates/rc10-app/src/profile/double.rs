//! Numbers of two f32, for sums that are used for hours.

/// The sum of two f32, of which the second is below the last place of the first: 48 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Double {
    high: f32,
    low: f32,
}

impl Double {
    pub(super) const ZERO: Self = Self::new(0.0);

    pub(super) const fn new(high: f32) -> Self {
        Self { high, low: 0.0 }
    }

    /// Both parts: the nearest f32, and what it lacks.
    pub(super) const fn parts(self) -> (f32, f32) {
        (self.high, self.low)
    }

    pub(super) const fn rounded(self) -> f32 {
        self.high
    }

    /// With `other` added: Knuth's `TwoSum` (The Art of Computer Programming 2, section 4.2.2).
    pub(super) const fn plus(self, other: f32) -> Self {
        let sum = self.high + other;
        let added = sum - self.high;
        let lost = (self.high - (sum - added)) + (other - added);
        let low = self.low + lost;
        let high = sum + low;
        Self { high, low: low - (high - sum) }
    }

    /// The difference of two, as an f32.
    pub(super) const fn minus(self, other: Self) -> f32 {
        (self.high - other.high) + (self.low - other.low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_hours_of_milliseconds_are_ten_hours() {
        let mut time = Double::ZERO;
        for _ in 0..36_000_000 {
            time = time.plus(0.001);
        }
        // 0.001 is rounded to an f32, and that 36 million times: 1.7 ms.
        let exact = 36e6 * f64::from(0.001_f32);
        let (high, low) = time.parts();
        let off = f64::from(high) + f64::from(low) - exact;
        assert!(off.abs() < 1e-3, "{off} s");
        // An f32 would not notice an eighth of a millisecond here.
        let step = time.plus(0.000_125).minus(time);
        assert!((step - 0.000_125).abs() < 1e-9, "{step}");
    }
}
