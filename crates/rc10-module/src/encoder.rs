//! Incremental encoders: a timer counts the edges of two tracks, and starts over after 2¹⁶ or 2³².
//!
//! A [`Counter`] unwraps the count in integers, exact for ever. What it cannot tell is said:
//!
//! * it moved further than the shaft can: [`Fault::Jump`], by a write or noise. The angle stays.
//! * it was not read before it may have gone half-way round: the turns are those that the
//!   speed tells, and [`gaps`](IncrementalEncoder::gaps) says how often.
//! * it lost edges: nothing shows that but the index pulse, [`IncrementalEncoder::index`].

use rc10_app::angle::nearest_movement;
use rc10_app::maths::within;
use rc10_app::{ConfigError, CountsPerTurn, Rpm, Seconds, TotalAngle};
use rc10_time::Micros;

/// Unwraps a counter of 0 ..< modulus into an exact total: no drift or overflow before 9 · 10¹⁸.
///
/// The first sample is the total; then the counter moves less than half-way between samples.
///
/// ```
/// use rc10_module::encoder::Counter;
/// let mut counter = Counter::new(8192);
/// for raw in [8000, 8190, 100] {
///     counter.update(raw)?;
/// }
/// assert_eq!(counter.total() - 8000, 292);
/// # Ok::<(), rc10_module::encoder::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter {
    modulus: u64,
    last: Option<u32>,
    total: i64,
}

/// A reading that the counter cannot have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("a counter of {modulus} counts showed {raw}")]
pub struct OutOfRange {
    /// The reading.
    pub raw: u32,
    /// The modulus, which it must be below.
    pub modulus: u64,
}

impl Counter {
    /// A counter of `modulus` counts, 2 ..= 2³² (else brought there); 2³² for a timer of 32 bits.
    pub const fn new(modulus: u64) -> Self {
        let modulus = match modulus {
            0 | 1 => 2,
            too_large if too_large > 1 << 32 => 1 << 32,
            fine => fine,
        };
        Self { modulus, last: None, total: 0 }
    }

    /// Takes a sample; returns the shorter way since the last one. The first moves it from 0.
    ///
    /// # Errors
    /// [`OutOfRange`] if `raw` is not below the modulus; the sample is ignored.
    pub fn update(&mut self, raw: u32) -> Result<i64, OutOfRange> {
        if u64::from(raw) >= self.modulus {
            return Err(OutOfRange { raw, modulus: self.modulus });
        }
        let turn = self.modulus.cast_signed();
        let moved = match self.last.replace(raw) {
            None => raw.into(),
            Some(last) => {
                let moved = i64::from(raw) - i64::from(last);
                (moved + turn / 2).rem_euclid(turn) - turn / 2
            }
        };
        self.total = self.total.saturating_add(moved);
        Ok(moved)
    }

    /// All counts, from the counter's own zero at the first sample.
    pub const fn total(&self) -> i64 {
        self.total
    }
}

/// Properties of an encoder and its counter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Counts after which the counter starts over: 2 ..= 2³², `1 << 16` for a timer of 16 bits.
    pub modulus: u64,
    /// Counts of the output shaft: four per line of the disc when both edges of both tracks count.
    pub scale: CountsPerTurn,
    /// The counter counts down when the shaft turns counter-clockwise.
    pub is_reversed: bool,
    /// The shaft never turns faster; finite, > 0.
    pub max_speed: Rpm,
}

/// The counter said what the shaft cannot have done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// The counter moved further than the shaft can have turned; the angle stays.
    #[error("the counter jumped by {moved} where {possible} were possible: noise, or reset")]
    Jump {
        /// Counts that it moved.
        moved: i64,
        /// Counts that were possible at most.
        possible: i64,
    },
    /// The counter showed a value beyond its modulus; the sample is ignored.
    #[error(transparent)]
    OutOfRange(OutOfRange),
}

/// Shortest time of a speed, µs: at 1 kHz and 4096 counts a turn a step is 0.7 rpm, not 15.
const WINDOW: u64 = 20_000;
/// Time without a count after which the shaft stands still, µs.
const STANDS: u64 = 500_000;

/// The angle and speed of a shaft with an incremental encoder.
///
/// ```
/// use rc10_app::{CountsPerTurn, Rpm};
/// use rc10_time::Micros;
/// use rc10_module::encoder::{Config, IncrementalEncoder};
///
/// let config = Config {
///     modulus: 1 << 16,
///     scale: CountsPerTurn::new(4096, 1),
///     is_reversed: false,
///     max_speed: Rpm::new(6000.0),
/// };
/// let mut encoder = IncrementalEncoder::new(config)?;
/// for (millis, counter) in [(0, 65_500), (1, 65_530), (2, 24)] {
///     encoder.update(counter, Micros::from_millis(millis))?;
/// }
/// assert_eq!(encoder.counts(), 60);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct IncrementalEncoder {
    config: Config,
    counter: Counter,
    /// The counter's total where the angle is zero.
    zero: i64,
    /// The counter's total at the first index pulse.
    index: Option<i64>,
    read: Micros,
    /// Total and time where the speed's window begins.
    window: (i64, Micros),
    speed: Rpm,
    gaps: u32,
    jumps: u32,
}

impl IncrementalEncoder {
    /// An encoder that was not read yet, unless a field of its configuration cannot be. Its angle
    /// is zero where it is read first.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        let speed = config.max_speed.get();
        let is_good = (2..=1 << 32).contains(&config.modulus);
        ConfigError::check(is_good, "modulus", config.modulus as f32, "2 to 2^32")?;
        let is_good = speed.is_finite() && speed > 0.0;
        ConfigError::check(is_good, "max_speed", speed, "finite and positive")?;
        Ok(Self {
            config,
            counter: Counter::new(config.modulus),
            zero: 0,
            index: None,
            read: Micros::ZERO,
            window: (0, Micros::ZERO),
            speed: Rpm::ZERO,
            gaps: 0,
            jumps: 0,
        })
    }

    /// The counter showed this at `now`.
    ///
    /// # Errors
    /// [`Fault`]; the next good sample goes on.
    pub fn update(&mut self, raw: u32, now: Micros) -> Result<(), Fault> {
        let is_first = self.counter.last.is_none();
        let since = now.since(self.read);
        let possible = self.counts_within(since);
        let mut moved = self.counter.update(raw).map_err(Fault::OutOfRange)?;
        let turn = self.config.modulus.cast_signed();
        if !is_first && possible >= turn / 2 {
            // Of all ways that fit the sample, the one nearest to what the speed tells.
            let nearest = nearest_movement(moved, self.expected(since), turn);
            self.counter.total = self.counter.total.saturating_add(nearest - moved);
            self.gaps = self.gaps.saturating_add(1);
            moved = nearest;
        }
        self.read = now;
        if is_first {
            self.zero = self.counter.total();
            self.window = (self.zero, now);
        } else if moved.saturating_abs() > possible {
            self.jumps = self.jumps.saturating_add(1);
            self.zero = self.zero.saturating_add(moved);
            self.window = (self.counter.total(), now);
            self.index = None;
            return Err(Fault::Jump { moved, possible });
        } else {
            self.measure_speed(now);
        }
        Ok(())
    }

    /// The index pulse came at `raw`, which a timer captures near the newest sample. The first sets
    /// the mark; every later one tells by how many counts the angle is off, -turn/2 ..= turn/2, and
    /// corrects it (a few are the pulse's width). `None` before the first sample, for the first
    /// pulse, also after a jump, and if a turn is no whole number of counts.
    ///
    /// # Errors
    /// [`Fault::OutOfRange`]
    pub fn index(&mut self, raw: u32) -> Result<Option<i64>, Fault> {
        if self.counter.last.is_none() || self.config.scale.turns() != 1 {
            return Ok(None);
        }
        let mut captured = self.counter;
        captured.update(raw).map_err(Fault::OutOfRange)?;
        let here = captured.total();
        let Some(mark) = self.index.replace(here) else { return Ok(None) };
        let turn = i64::from(self.config.scale.counts());
        let off = here.saturating_sub(mark).saturating_add(turn / 2).rem_euclid(turn) - turn / 2;
        self.zero = self.zero.saturating_add(off);
        Ok(Some(if self.config.is_reversed { -off } else { off }))
    }

    /// The angle is zero here.
    pub fn set_zero(&mut self) {
        self.zero = self.counter.total();
    }

    /// The angle is zero where the index pulse came; `false` if none came yet, or none since a jump.
    pub fn set_zero_at_index(&mut self) -> bool {
        self.zero = self.index.unwrap_or(self.zero);
        self.index.is_some()
    }

    /// Counts from zero; counter-clockwise positive.
    #[must_use]
    pub const fn counts(&self) -> i64 {
        let counts = self.counter.total().saturating_sub(self.zero);
        if self.config.is_reversed { counts.saturating_neg() } else { counts }
    }

    /// The angle from zero, of any number of turns, exact.
    #[must_use]
    pub fn angle(&self) -> TotalAngle {
        TotalAngle::from_counts(self.counts(), self.config.scale)
    }

    /// The mean speed over 20 ms, or since the count before; 0 half a second after the last.
    #[must_use]
    pub fn speed(&self) -> Rpm {
        if self.config.is_reversed { -self.speed } else { self.speed }
    }

    /// Number of times that it was not read for too long: above zero the turns are an estimate.
    #[must_use]
    pub const fn gaps(&self) -> u32 {
        self.gaps
    }

    /// Number of jumps of the counter: above zero, the angle may be off by what was lost with them.
    #[must_use]
    pub const fn jumps(&self) -> u32 {
        self.jumps
    }

    /// Counts in a time at a constant speed.
    fn counts_at(&self, speed: Rpm, time: Micros) -> f32 {
        let (counts, turns) = (self.config.scale.counts(), self.config.scale.turns());
        let per_turn = counts as f32 / turns as f32;
        speed.get() / 60.0 * per_turn * Seconds::from_micros(time.get()).get()
    }

    /// The most counts possible in a time: two for the edges at both ends, and 1 % for clocks.
    fn counts_within(&self, time: Micros) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let counts = (self.counts_at(self.config.max_speed, time) * 1.01) as i64;
        counts.saturating_add(2)
    }

    /// Counts in a time if the speed stays the same.
    fn expected(&self, time: Micros) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let counts = self.counts_at(self.speed, time) as i64;
        counts
    }

    fn measure_speed(&mut self, now: Micros) {
        let (from, began) = self.window;
        let total = self.counter.total();
        let took = now.since(began);
        if took.get() < WINDOW {
            return;
        }
        // One count in this time: the highest speed possible while none comes.
        let one = 1.0 / self.counts_at(Rpm::new(1.0), took);
        if total == from {
            let speed = self.speed.get();
            let slower = if took.get() < STANDS { within(speed, one) } else { 0.0 };
            self.speed = Rpm::new(slower);
            return;
        }
        let moved = total.saturating_sub(from) as f32;
        self.speed = Rpm::new(moved * one);
        self.window = (total, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `RC10_LIB` overflowed after 262,144 rotor turns, 28 minutes at full speed.
    #[test]
    fn a_day_at_full_speed_is_exact() {
        let mut counter = Counter::new(8192);
        counter.update(0).unwrap();
        let step = 2731; // 20,000 rpm at 1 kHz
        let samples = 3_000_000_i64;
        let mut raw = 0;
        for _ in 0..samples {
            raw = (raw + step) & 8191;
            counter.update(raw).unwrap();
        }
        assert_eq!(counter.total(), samples * i64::from(step));
        assert!(counter.total() > i64::from(i32::MAX));
    }

    #[test]
    fn a_timer_of_32_bits_goes_round_too() {
        let mut timer = Counter::new(1 << 32);
        timer.update(u32::MAX - 5).unwrap();
        assert_eq!(timer.update(10), Ok(16));
        assert_eq!(timer.update(u32::MAX), Ok(-11));
    }

    #[test]
    fn half_the_way_round_is_backward_also_where_the_modulus_is_odd() {
        for (modulus, from, to, moved) in
            [(10, 0, 5, -5), (10, 5, 0, -5), (11, 0, 5, 5), (11, 0, 6, -5), (2, 0, 1, -1)]
        {
            let mut counter = Counter::new(modulus);
            counter.update(from).unwrap();
            assert_eq!(counter.update(to), Ok(moved), "{modulus}");
        }
    }

    fn config(modulus: u64) -> Config {
        Config {
            modulus,
            scale: CountsPerTurn::new(4096, 1),
            is_reversed: false,
            max_speed: Rpm::new(6000.0),
        }
    }

    fn millis(millis: u64) -> Micros {
        Micros::from_millis(millis)
    }

    /// Turns a shaft at a rate in counts per ms for a time in ms, read each ms from `start` on.
    fn turn(encoder: &mut IncrementalEncoder, start: i64, rate: i64, ms: i64) -> i64 {
        let modulus = encoder.config.modulus.cast_signed();
        for at in 0..ms {
            let raw = (start + rate * at).rem_euclid(modulus);
            let now = millis(u64::try_from(at).unwrap() + 1);
            encoder.update(u32::try_from(raw).unwrap(), now).unwrap();
        }
        rate * (ms - 1)
    }

    #[test]
    fn counters_of_any_width_are_exact_for_an_hour() {
        for modulus in [1 << 16, 1 << 32, 4096, 50_000] {
            for rate in [409, -409, 1, -1] {
                let mut encoder = IncrementalEncoder::new(config(modulus)).unwrap();
                let moved = turn(&mut encoder, 65_500, rate, 3_600_000);
                assert_eq!(encoder.counts(), moved, "{modulus} {rate}");
                assert_eq!((encoder.gaps(), encoder.jumps()), (0, 0));
            }
        }
    }

    #[test]
    fn speed_is_right_at_every_speed_and_zero_at_rest() {
        for (rate, rpm) in [(409, 5991.2), (-41, -600.59), (1, 14.648), (0, 0.0)] {
            let mut encoder = IncrementalEncoder::new(config(1 << 16)).unwrap();
            turn(&mut encoder, 0, rate, 200);
            let speed = encoder.speed().get();
            assert!((speed - rpm).abs() < 0.01 * rpm.abs() + 0.01, "{rate}: {speed}");
        }
        // A count each 100 ms: 0.146 rpm, and no spikes of 15 rpm in between.
        let mut encoder = IncrementalEncoder::new(config(1 << 16)).unwrap();
        for at in 0..2000 {
            encoder.update(u32::try_from(at / 100).unwrap(), millis(at)).unwrap();
            assert!(at < 300 || (encoder.speed().get() - 0.1465).abs() < 0.002, "{at}");
        }
        // It stops: less and less, then nothing.
        let mut last = encoder.speed().get();
        for at in 2000..2600 {
            encoder.update(19, millis(at)).unwrap();
            assert!(encoder.speed().get() <= last);
            last = encoder.speed().get();
        }
        assert!(last.abs() < 1e-9, "{last}");
    }

    #[test]
    fn a_reversed_encoder_counts_the_other_way() {
        let reversed = Config { is_reversed: true, ..config(1 << 16) };
        let mut encoder = IncrementalEncoder::new(reversed).unwrap();
        let moved = turn(&mut encoder, 0, 100, 100);
        assert_eq!(encoder.counts(), -moved);
        assert!(encoder.speed().get() < -1000.0);
        assert_eq!(encoder.angle().counts_at(encoder.config.scale), -moved);
    }

    #[test]
    fn what_the_shaft_cannot_have_done_is_said_and_not_believed() {
        let mut encoder = IncrementalEncoder::new(config(1 << 16)).unwrap();
        let moved = turn(&mut encoder, 1000, 10, 100);
        let speed = encoder.speed();
        // 6000 rpm make 410 counts a ms: not 30,000.
        let jump = encoder.update(31_990, millis(101));
        assert_eq!(jump, Err(Fault::Jump { moved: 30_000, possible: 415 }));
        assert_eq!((encoder.counts(), encoder.jumps()), (moved, 1));
        // It goes on from there, and no speed comes of it.
        for at in 1..100 {
            encoder.update(31_990 + at * 10, millis(101 + u64::from(at))).unwrap();
            assert!((encoder.speed().get() - speed.get()).abs() < 0.02 * speed.get());
        }
        assert_eq!(encoder.counts(), moved + 990);
    }

    #[test]
    fn a_counter_beyond_its_modulus_is_refused() {
        let mut encoder = IncrementalEncoder::new(config(1000)).unwrap();
        encoder.update(999, millis(0)).unwrap();
        let beyond = OutOfRange { raw: 1000, modulus: 1000 };
        assert_eq!(encoder.update(1000, millis(1)), Err(Fault::OutOfRange(beyond)));
        assert_eq!(encoder.index(1000), Err(Fault::OutOfRange(beyond)));
        assert_eq!(encoder.counts(), 0);
    }

    #[test]
    fn a_gap_goes_on_with_the_speed_and_is_counted() {
        let mut encoder = IncrementalEncoder::new(config(1 << 16)).unwrap();
        let moved = turn(&mut encoder, 0, 300, 100);
        // Half a second of silence: 150,000 counts, more than two rounds of the counter.
        let raw = (moved + 150_000 + 40) % 65_536;
        encoder.update(u32::try_from(raw).unwrap(), millis(600)).unwrap();
        assert_eq!(encoder.counts(), moved + 150_040);
        assert_eq!((encoder.gaps(), encoder.jumps()), (1, 0));
    }

    #[test]
    fn the_index_pulse_shows_lost_edges_and_mends_the_angle() {
        let mut encoder = IncrementalEncoder::new(config(1 << 16)).unwrap();
        assert_eq!(encoder.index(5), Ok(None));
        assert!(!encoder.set_zero_at_index());
        encoder.update(1000, millis(0)).unwrap();
        assert_eq!(encoder.index(900), Ok(None));
        assert!(encoder.set_zero_at_index());
        assert_eq!(encoder.counts(), 100);
        // A turn and three backwards; seven edges get lost on the way.
        for at in 0..20 {
            encoder.update(1000 + at * 215, millis(10 * u64::from(at))).unwrap();
        }
        assert_eq!(encoder.index(900 + 4096 - 7), Ok(Some(-7)));
        assert_eq!(encoder.counts(), 19 * 215 + 100 + 7);
        assert_eq!(encoder.index(900 + 4096 - 7), Ok(Some(0)));
        for at in 0..4 {
            let counter = 5085 - i64::try_from(at).unwrap() * 4096;
            let raw = u32::try_from(counter.rem_euclid(65_536)).unwrap();
            encoder.update(raw, millis(1000 + 100 * at)).unwrap();
        }
        let mark = (900 - 7 + 4096_i64 - 3 * 4096).rem_euclid(65_536);
        assert_eq!(encoder.index(u32::try_from(mark).unwrap()), Ok(Some(0)));
    }

    #[test]
    fn a_jump_drops_the_index_mark() {
        let mut encoder = IncrementalEncoder::new(config(1 << 16)).unwrap();
        encoder.update(1000, millis(0)).unwrap();
        assert_eq!(encoder.index(900), Ok(None));
        assert!(encoder.update(31_000, millis(1)).is_err());
        // The old mark is on the count before the jump: it must not correct the angle.
        assert!(!encoder.set_zero_at_index());
        assert_eq!(encoder.index(31_000), Ok(None));
        assert_eq!(encoder.counts(), 0);
        // The pulse after the jump is the new mark.
        assert_eq!(encoder.index(31_007), Ok(Some(7)));
        assert_eq!(encoder.counts(), -7);
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let speeds = [0.0, -1.0, f32::NAN, f32::INFINITY];
        for bad in speeds.map(|speed| Config { max_speed: Rpm::new(speed), ..config(1 << 16) }) {
            assert_eq!(IncrementalEncoder::new(bad).map(drop).unwrap_err().field, "max_speed");
        }
        for modulus in [0, 1, (1 << 32) + 1] {
            let error = IncrementalEncoder::new(config(modulus)).map(drop).unwrap_err();
            assert_eq!((error.field, error.must_be), ("modulus", "2 to 2^32"));
        }
    }

    #[test]
    fn no_samples_at_any_time_panic_or_make_a_speed_that_is_no_number() {
        let mut random = 1_u64;
        let mut next = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random
        };
        for modulus in [2, 3, 1 << 16, 1 << 32] {
            let mut encoder = IncrementalEncoder::new(config(modulus)).unwrap();
            for _ in 0..10_000 {
                let raw = u32::try_from(next() >> 32).unwrap();
                let now = next() >> (next() % 64);
                let _ = encoder.update(raw, Micros::new(now));
                let _ = encoder.index(raw);
                assert!(encoder.speed().is_finite());
                let _ = encoder.angle().degrees();
            }
        }
    }
}
