//! From a counter that starts over every turn to an angle of any number of turns.

use core::fmt;

use crate::angle::nearest_movement;

/// Unwraps a counter of 0 ..< modulus into an exact total. Integers only: no drift, and no overflow
/// before 9 · 10¹⁸ counts.
///
/// The first sample sets the total to itself, so an absolute encoder keeps its absolute angle.
/// Between two samples the counter must move less than half a turn; when it may have moved
/// further (a gap in the samples at speed), use [`update_after_gap`](Self::update_after_gap),
/// which counts the gap and marks the total as doubtful.
///
/// ```
/// use rc10_app::Encoder;
/// let mut encoder = Encoder::new(8192);
/// for raw in [8000, 8190, 100] {
///     encoder.update(raw)?;
/// }
/// assert_eq!(encoder.total() - 8000, 292);
/// # Ok::<(), rc10_app::encoder::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoder {
    modulus: u64,
    last: Option<u32>,
    total: i64,
    gaps: u32,
}

/// A reading that the counter cannot have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OutOfRange {
    /// The reading.
    pub raw: u32,
    /// It must be below this.
    pub modulus: u64,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an encoder of {} counts showed {}", self.modulus, self.raw)
    }
}

impl core::error::Error for OutOfRange {}

impl Encoder {
    /// A counter of `modulus` counts, 2 ..= 2³² (anything else is brought into that range). A timer
    /// of 32 bits has 2³².
    pub const fn new(modulus: u64) -> Self {
        let modulus = match modulus {
            0 | 1 => 2,
            too_large if too_large > 1 << 32 => 1 << 32,
            fine => fine,
        };
        Self { modulus, last: None, total: 0, gaps: 0 }
    }

    /// Takes a sample; returns how far the counter moved since the last one, the shorter way
    /// round: -modulus/2 ..< modulus/2. The first sample moves it from 0 to itself.
    ///
    /// # Errors
    /// [`OutOfRange`] if `raw` is not below the modulus; the sample is ignored.
    pub fn update(&mut self, raw: u32) -> Result<i64, OutOfRange> {
        let step = self.step(raw)?;
        self.total = self.total.saturating_add(step);
        Ok(step)
    }

    /// Takes the first sample after a gap in which the counter may have gone round. Of all totals
    /// that fit the sample it takes the one nearest to `expected` counts of movement (speed times
    /// time), and counts the gap. Returns the movement it decided on.
    ///
    /// # Errors
    /// [`OutOfRange`] as for [`update`](Self::update).
    pub fn update_after_gap(&mut self, raw: u32, expected: i64) -> Result<i64, OutOfRange> {
        let first = self.last.is_none();
        let step = self.step(raw)?;
        if first {
            self.total = step;
            return Ok(0);
        }
        self.gaps = self.gaps.saturating_add(1);
        let moved = nearest_movement(step, expected, self.turn());
        self.total = self.total.saturating_add(moved);
        Ok(moved)
    }

    /// Movement since the last sample; the first sample is the movement from zero.
    fn step(&mut self, raw: u32) -> Result<i64, OutOfRange> {
        if u64::from(raw) >= self.modulus {
            return Err(OutOfRange { raw, modulus: self.modulus });
        }
        let Some(last) = self.last.replace(raw) else { return Ok(raw.into()) };
        let (way, turn) = (i64::from(raw) - i64::from(last), self.turn());
        Ok(if way >= turn - turn / 2 {
            way - turn
        } else if way < -(turn / 2) {
            way + turn
        } else {
            way
        })
    }

    const fn turn(&self) -> i64 {
        self.modulus.cast_signed()
    }

    /// All counts, from the encoder's own zero at the first sample.
    pub const fn total(&self) -> i64 {
        self.total
    }

    /// The newest sample; `None` before the first.
    pub const fn last(&self) -> Option<u32> {
        self.last
    }

    /// How many gaps were bridged: above zero, the number of turns is an estimate.
    pub const fn gaps(&self) -> u32 {
        self.gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::{shortest_way, shortest_way_in_bits};

    #[test]
    fn every_pair_of_8192_is_exact() {
        for from in 0..8192 {
            for to in 0..8192 {
                let way = shortest_way(from, to, 8192);
                assert_eq!(way, shortest_way_in_bits::<13>(from, to));
                assert!((-4096..4096).contains(&way));
                assert_eq!((from + way) & 8191, to);
            }
        }
    }

    /// `RC10_LIB` overflowed after 262,144 rotor turns, 28 minutes at full speed.
    #[test]
    fn a_day_at_full_speed_is_exact() {
        let mut encoder = Encoder::new(8192);
        encoder.update(0).unwrap();
        let step = 2731; // 20,000 rpm at 1 kHz
        let samples = 3_000_000_i64;
        let mut raw = 0;
        for _ in 0..samples {
            raw = (raw + step) & 8191;
            encoder.update(raw).unwrap();
        }
        assert_eq!(encoder.total(), samples * i64::from(step));
        assert!(encoder.total() > i64::from(i32::MAX));
    }

    #[test]
    fn a_timer_of_32_bits_goes_round_too() {
        let mut timer = Encoder::new(1 << 32);
        timer.update(u32::MAX - 5).unwrap();
        assert_eq!(timer.update(10), Ok(16));
        assert_eq!(timer.update(u32::MAX), Ok(-11));
    }

    #[test]
    fn a_gap_takes_the_turns_the_speed_tells_and_is_flagged() {
        let mut encoder = Encoder::new(8192);
        encoder.update(100).unwrap();
        // Twelve turns and 50 counts later; the speed says 11.8 turns.
        assert_eq!(encoder.update_after_gap(150, 96_600), Ok(12 * 8192 + 50));
        assert_eq!(encoder.update_after_gap(150, -8000), Ok(-8192));
        assert_eq!((encoder.gaps(), encoder.total()), (2, 11 * 8192 + 150));
    }

    #[test]
    fn a_gap_before_the_first_sample_is_none() {
        let mut encoder = Encoder::new(8192);
        assert_eq!(encoder.update_after_gap(5000, 1_000_000), Ok(0));
        assert_eq!((encoder.gaps(), encoder.total()), (0, 5000));
    }

    #[test]
    fn impossible_samples_are_refused_and_change_nothing() {
        let mut encoder = Encoder::new(8192);
        encoder.update(8000).unwrap();
        let before = encoder;
        assert_eq!(encoder.update(8192), Err(OutOfRange { raw: 8192, modulus: 8192 }));
        assert_eq!(encoder, before);
        assert_eq!(encoder.update_after_gap(0, i64::MIN).map(|_| ()), Ok(()));
    }
}
