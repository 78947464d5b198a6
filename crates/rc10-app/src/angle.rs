//! Angles of any number of turns that stay exact, and the shortest way round.

use core::fmt;

use crate::Degrees;

/// The counts of a sensor in some turns of the output shaft: `counts` counts make `turns` turns.
///
/// Two numbers: an M3508's 8192 counts behind 3591 : 187 make 29,417,472 counts in 187 turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CountsPerTurn {
    counts: u32,
    turns: u32,
}

impl CountsPerTurn {
    /// `counts` counts in `turns` turns; zero counts as one.
    pub const fn new(counts: u32, turns: u32) -> Self {
        Self {
            counts: if counts == 0 { 1 } else { counts },
            turns: if turns == 0 { 1 } else { turns },
        }
    }

    /// Counts that make [`turns`](Self::turns) turns.
    #[must_use]
    pub const fn counts(self) -> u32 {
        self.counts
    }

    /// The turns of these [`counts`](Self::counts).
    #[must_use]
    pub const fn turns(self) -> u32 {
        self.turns
    }
}

/// An angle of any number of turns, in whole millionths of a degree: sums stay exact. An f32 is
/// only made for people and for differences.
///
/// ```
/// use rc10_app::{CountsPerTurn, TotalAngle};
/// let target = TotalAngle::from_degrees(720);
/// let encoder = CountsPerTurn::new(8192 * 36, 1); // an M2006: 36 : 1
/// assert_eq!(target.counts_at(encoder), 2 * 8192 * 36);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TotalAngle(i64);

impl TotalAngle {
    /// No turn at all.
    pub const ZERO: Self = Self(0);
    /// One turn.
    pub const TURN: Self = Self(360_000_000);

    /// Whole degrees.
    pub const fn from_degrees(degrees: i32) -> Self {
        Self(degrees as i64 * 1_000_000)
    }

    /// Millionths of a degree.
    pub const fn from_microdegrees(microdegrees: i64) -> Self {
        Self(microdegrees)
    }

    /// The nearest angle to an f32 of degrees, within ± 9 · 10¹² degrees; `None` if it is not
    /// finite or out of that range.
    pub fn try_from_degrees(degrees: Degrees) -> Option<Self> {
        let degrees = degrees.get();
        if degrees.is_nan() || degrees.abs() > 9e12 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "the range was checked")]
        let whole = degrees as i64;
        #[expect(clippy::cast_precision_loss, reason = "whole came from this f32: exact")]
        let fraction = degrees - whole as f32;
        let fraction = crate::maths::round_to_i32(fraction * 1e6);
        Some(Self(whole * 1_000_000 + i64::from(fraction)))
    }

    /// The nearest angle to a count; saturates at the ends of the range.
    pub fn from_counts(counts: i64, scale: CountsPerTurn) -> Self {
        Self(nearest(counts, Self::TURN.0 * i64::from(scale.turns), scale.counts.into()))
    }

    /// The nearest count; saturates at the ends of i64.
    #[must_use]
    pub fn counts_at(self, scale: CountsPerTurn) -> i64 {
        nearest(self.0, scale.counts.into(), Self::TURN.0 * i64::from(scale.turns))
    }

    /// Millionths of a degree.
    #[must_use]
    pub const fn microdegrees(self) -> i64 {
        self.0
    }

    /// In degrees, as near as an f32 comes: seven digits.
    #[must_use]
    pub const fn degrees(self) -> Degrees {
        #[expect(clippy::cast_precision_loss, reason = "seven digits, as documented")]
        Degrees::new(self.0 as f32 * 1e-6)
    }

    /// The angle within its turn, 0 ..< 360 degrees.
    #[must_use]
    pub const fn within_turn(self) -> Degrees {
        degrees_within_turn(self.microdegrees_within_turn())
    }

    /// The same as whole microdegrees: turns are guessed in f32, without a division of 64 bits.
    const fn microdegrees_within_turn(self) -> i32 {
        const TURN: i32 = 360_000_000;
        // To 4 million turns the guess is within one.
        if self.0.unsigned_abs() >> 50 != 0 {
            #[expect(clippy::cast_possible_truncation, reason = "less than a turn")]
            return self.0.rem_euclid(Self::TURN.0) as i32;
        }
        #[expect(clippy::cast_possible_truncation, reason = "the halves of 64 bits, a few million")]
        #[expect(clippy::cast_precision_loss, clippy::cast_sign_loss, reason = "a guess")]
        let turns = {
            let (high, low) = ((self.0 >> 32) as i32, self.0 as u32);
            ((high as f32 * 4_294_967_296.0 + low as f32) * (1.0 / TURN as f32)) as i32
        };
        #[expect(clippy::cast_possible_truncation, reason = "less than three turns")]
        let rest = (self.0 - turns as i64 * Self::TURN.0) as i32;
        if rest < 0 {
            let rest = rest + TURN;
            if rest < 0 { rest + TURN } else { rest }
        } else if rest >= TURN {
            rest - TURN
        } else {
            rest
        }
    }

    /// This angle and another added; saturating.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// This angle less another; saturating.
    #[must_use]
    pub const fn minus(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// The same angle the other way round; saturating.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

/// 0 ..< 360 degrees, from microdegrees within a turn.
pub const fn degrees_within_turn(microdegrees: i32) -> Degrees {
    #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
    let degrees = microdegrees as f32 * 1e-6;
    // The last few microdegrees round up to a full turn.
    Degrees::new(if degrees < 360.0 { degrees } else { 0.0 })
}

/// `value * factor / divisor` to the nearest, halves away from zero, saturating; both above zero.
fn nearest(value: i64, factor: i64, divisor: i64) -> i64 {
    // In 64 bits where that fits: a tenth of the instructions.
    let half = if value < 0 { -(divisor / 2) } else { divisor / 2 };
    let scaled = value.checked_mul(factor).and_then(|scaled| scaled.checked_add(half));
    if let Some(scaled) = scaled {
        return scaled / divisor;
    }
    let scaled = i128::from(value) * i128::from(factor) + i128::from(half);
    let nearest = scaled / i128::from(divisor);
    i64::try_from(nearest).unwrap_or(if nearest < 0 { i64::MIN } else { i64::MAX })
}

impl fmt::Display for TotalAngle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.degrees(), f)
    }
}

/// The shortest way on a circle of `turn` counts: -turn/2 ..< turn/2; half a turn goes back.
///
/// ```
/// use rc10_app::angle::shortest_way;
/// assert_eq!(shortest_way(350, 10, 360), 20);
/// assert_eq!(shortest_way(10, 350, 360), -20);
/// ```
pub const fn shortest_way(from: i32, to: i32, turn: i32) -> i32 {
    let way = to.wrapping_sub(from);
    if way >= turn - turn / 2 {
        way.wrapping_sub(turn)
    } else if way < -(turn / 2) {
        way.wrapping_add(turn)
    } else {
        way
    }
}

/// Of movements that end at `step` modulo `turn`, the one nearest to `expected`. Saturating.
pub fn nearest_movement(step: i64, expected: i64, turn: i64) -> i64 {
    let turn = turn.max(1);
    let excess = expected.saturating_sub(step);
    // The nearest whole number of turns: halves up.
    let turns = excess.saturating_add(turn / 2).div_euclid(turn);
    step.saturating_add(turns.saturating_mul(turn))
}

/// The shortest way between two angles, any finite degrees: -180 ..= 180 degrees.
pub fn shortest_way_degrees(from: Degrees, to: Degrees) -> Degrees {
    Degrees::new(shortest_way_f32(from.get(), to.get(), 360.0))
}

/// Like [`shortest_way`], for f32 on a circle of any size.
pub(crate) fn shortest_way_f32(from: f32, to: f32, turn: f32) -> f32 {
    let way = to - from;
    if way.abs() <= turn * 0.5 { way } else { way - turn * crate::maths::round(way / turn) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_within_a_turn_is_exact() {
        // Next to whole turns, where a guess may be one off.
        for turns in 1..3_100_000_i64 {
            for off in [-1, 1] {
                let angle = TotalAngle::from_microdegrees(turns * off * TotalAngle::TURN.0 + off);
                let exact = angle.0.rem_euclid(TotalAngle::TURN.0);
                assert_eq!(i64::from(angle.microdegrees_within_turn()), exact, "{angle:?}");
            }
        }
        let mut angle = 1_i64;
        while angle < i64::MAX / 3 {
            for angle in [angle, -angle, angle / 360 * 360, angle / 360_000_000 * 360_000_000] {
                for off in [-1, 0, 1] {
                    let angle = TotalAngle::from_microdegrees(angle + off);
                    let exact = angle.0.rem_euclid(TotalAngle::TURN.0);
                    assert_eq!(i64::from(angle.microdegrees_within_turn()), exact, "{angle:?}");
                }
            }
            angle += angle / 97 + 1;
        }
    }

    #[test]
    fn counts_are_the_nearest_however_long_they_are() {
        let scales = [
            CountsPerTurn::new(36_000, 1),
            CountsPerTurn::new(8192 * 3591, 187),
            CountsPerTurn::new(8192 * 36, 1),
            CountsPerTurn::new(1, 3),
            CountsPerTurn::new(u32::MAX, u32::MAX - 1),
        ];
        let long = [1, 7, 49, 50, 187, 1_000_003, 312_345_678_901, i64::MAX / 3, i64::MAX];
        for value in long.into_iter().chain([0]).chain(long.map(|value| -value)) {
            for scale in scales {
                let turn = 360_000_000 * i128::from(scale.turns);
                let counts = i128::from(scale.counts);
                let is_nearest = |got: i64, top: i128, bottom: i128| {
                    // Nearest, halves away from zero: twice the error is at most the divisor.
                    let off = 2 * (top - i128::from(got) * bottom);
                    let is_nearest = off.abs() < bottom || off.abs() == bottom && off * top <= 0;
                    assert!(is_nearest || got == i64::MAX || got == i64::MIN, "{value} {scale:?}");
                };
                let value_ = i128::from(value);
                let angle = TotalAngle::from_counts(value, scale);
                is_nearest(angle.microdegrees(), value_ * turn, counts);
                let counted = TotalAngle::from_microdegrees(value).counts_at(scale);
                is_nearest(counted, value_ * counts, turn);
            }
        }
    }

    /// `RC10_LIB`: 350 to 10 gave an error of -340.
    #[test]
    fn from_350_to_10_degrees_is_20_forward() {
        let way = |from, to| shortest_way_degrees(Degrees::new(from), Degrees::new(to)).get();
        assert!((way(350.0, 10.0) - 20.0).abs() < 1e-4);
        assert!((way(10.0, 350.0) + 20.0).abs() < 1e-4);
        assert!((way(-170.0, 170.0) + 20.0).abs() < 1e-4);
        assert!((way(0.0, 3600.0)).abs() < 1e-3);
    }

    #[test]
    fn the_way_is_never_longer_than_half_the_circle_and_half_of_it_is_backward() {
        for turn in [7, 8, 360, 1024] {
            for (from, to) in (0..turn).flat_map(|from| (0..turn).map(move |to| (from, to))) {
                let way = shortest_way(from, to, turn);
                assert!((-(turn / 2)..=(turn - 1) / 2).contains(&way));
                assert_eq!((from + way).rem_euclid(turn), to);
            }
        }
    }

    #[test]
    fn a_geared_angle_converts_exactly_both_ways() {
        let m3508 = CountsPerTurn::new(8192 * 3591, 187);
        // 1,000,000 turns of the output and a quarter.
        let angle = TotalAngle::from_microdegrees(360_000_000_000_000 + 90_000_000);
        let counts = angle.counts_at(m3508);
        let back = TotalAngle::from_counts(counts, m3508).microdegrees();
        // One count is 2288 microdegrees.
        assert!((back - angle.microdegrees()).abs() <= 1145);
        assert_eq!(TotalAngle::from_degrees(360 * 187).counts_at(m3508), 8192 * 3591);
    }

    #[test]
    fn within_a_turn_never_reaches_360() {
        assert!((TotalAngle::from_degrees(-90).within_turn().get() - 270.0).abs() < 1e-3);
        for microdegrees in [359_999_999, -1, 719_999_999] {
            let angle = TotalAngle::from_microdegrees(microdegrees).within_turn().get();
            assert!((0.0..360.0).contains(&angle), "{microdegrees}: {angle}");
        }
    }

    #[test]
    fn saturates_instead_of_wrapping() {
        let huge = TotalAngle::from_counts(i64::MAX, CountsPerTurn::new(1, u32::MAX));
        assert_eq!(huge.microdegrees(), i64::MAX);
        assert_eq!(huge.plus(huge), huge);
        let negative = TotalAngle::from_counts(i64::MIN, CountsPerTurn::new(1, u32::MAX));
        assert_eq!(negative.microdegrees(), i64::MIN);
        assert_eq!(negative.minus(huge), negative);
        assert_eq!(negative.reversed(), huge);
    }

    #[test]
    fn non_finite_degrees_are_no_angle() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e13] {
            assert_eq!(TotalAngle::try_from_degrees(Degrees::new(bad)), None);
        }
        let angle = TotalAngle::try_from_degrees(Degrees::new(-12.5)).unwrap();
        assert_eq!(angle.microdegrees(), -12_500_000);
    }
}
