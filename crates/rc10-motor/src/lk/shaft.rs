//! From the rotor's encoder to the angle of the output shaft: exact, and without a division while
//! frames come as they should.

use rc10_app::Gear;
use rc10_app::angle::nearest_movement;
use rc10_can::Micros;

const TURN: i64 = 360_000_000;
const TURN_I32: i32 = 360_000_000;

/// Frames this close together (µs) are certain to be less than half a turn apart: a speed on the
/// wire is below 32,768 degrees/s.
const CERTAIN_MICROS: u64 = 4_000;
/// Speed (degrees/s) times time (µs) in which the rotor makes 0.45 turns: beyond it, the turns
/// between two frames are not certain any more.
const CERTAIN_DEGREE_MICROS: u64 = 162_000_000;
/// Nor are they after such a silence, whatever the speed was before and after.
const LONG_SILENCE: Micros = Micros::from_millis(100);
/// More turns than any rotor makes while nobody hears it.
const MOST_TURNS: i64 = 16_384;

/// Where the output shaft is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaft {
    /// Of the encoder.
    bits: u32,
    /// 1, or -1 if the shaft counts the other way.
    sign: i32,
    /// Of the output, in one turn of the rotor: whole microdegrees, and what is over, in shares of
    /// `rotor_turns`.
    microdegrees: i32,
    rest: i32,
    rotor_turns: i32,
    /// Of the output, at the beginning of the rotor's present turn.
    base: i64,
    carry: i32,
    /// What the encoder showed last.
    encoder: u16,
    /// What counts as zero, microdegrees.
    zero: i64,
    /// Since zero, within the turn: 0 ..< 360,000,000 microdegrees.
    phase: i32,
    gaps: u32,
}

/// What a frame says of the rotor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// When it arrived.
    pub at: Micros,
    /// Of the encoder, within its bits.
    pub encoder: u16,
    /// Degrees a second.
    pub speed: i16,
}

impl Shaft {
    /// Behind a gear that is not faster than the rotor.
    #[expect(clippy::cast_possible_truncation, reason = "at most one turn; below 2^16")]
    pub const fn new(bits: u32, gear: Gear, sign: i32) -> Self {
        let (rotor, output) = (gear.rotor_turns() as i64, gear.output_turns() as i64);
        let (microdegrees, rest) = ((TURN * output / rotor) as i32, (TURN * output % rotor) as i32);
        Self {
            bits,
            sign,
            microdegrees,
            rest,
            rotor_turns: rotor as i32,
            base: 0,
            carry: 0,
            encoder: 0,
            zero: 0,
            phase: 0,
            gaps: 0,
        }
    }

    /// Many turns, since zero.
    pub fn total(&self) -> i64 {
        let total = self.base.saturating_add(self.within_rotor_turn().into());
        (if self.sign < 0 { total.saturating_neg() } else { total }).saturating_sub(self.zero)
    }

    /// Within the turn, since zero: 0 ..< 360,000,000 microdegrees.
    pub const fn phase(&self) -> i32 {
        self.phase
    }

    /// How often turns had to be estimated.
    pub const fn gaps(&self) -> u32 {
        self.gaps
    }

    /// Here is zero.
    pub fn set_zero(&mut self) {
        self.zero = self.zero.saturating_add(self.total());
        self.phase = 0;
    }

    /// The first sample: an absolute angle within the rotor's turn.
    pub fn start(&mut self, sample: Sample) {
        self.encoder = sample.encoder;
        self.phase = (self.sign * self.within_rotor_turn()).rem_euclid(TURN_I32);
    }

    /// The next one.
    #[inline]
    pub fn follow(&mut self, last: Sample, sample: Sample) {
        let unused = 32 - self.bits;
        let way = i32::from(sample.encoder) - i32::from(last.encoder);
        let way = way << unused >> unused;
        let silence = sample.at.since(last.at).get();
        if silence <= CERTAIN_MICROS || is_certain(last.speed, sample.speed, silence) {
            let from = self.within_rotor_turn();
            // -1, 0 or 1 rotor turns.
            let turns = (i32::from(self.encoder) + way) >> self.bits;
            self.encoder = sample.encoder;
            let step = self.turn_rotor(turns) + self.within_rotor_turn() - from;
            self.wrap(self.phase + self.sign * step);
        } else {
            self.bridge(way, last, sample, silence);
        }
    }

    /// A sample after a silence in which the rotor may have gone round: the speed says which number
    /// of turns is likeliest.
    #[cold]
    #[inline(never)]
    fn bridge(&mut self, way: i32, last: Sample, sample: Sample, silence: u64) {
        self.gaps = self.gaps.saturating_add(1);
        let counts = 1_i64 << self.bits;
        let speed = (i64::from(last.speed) + i64::from(sample.speed)) / 2;
        let micros = i64::try_from(silence).unwrap_or(i64::MAX);
        let expected = speed.saturating_mul(micros).saturating_mul(counts) / TURN;
        let moved = nearest_movement(way.into(), expected, counts);
        let turns = (i64::from(self.encoder) + moved) >> self.bits;
        self.encoder = sample.encoder;
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        let _ = self.turn_rotor(turns.clamp(-MOST_TURNS, MOST_TURNS) as i32);
        #[expect(clippy::cast_possible_truncation, reason = "less than a turn")]
        let phase = self.total().rem_euclid(TURN) as i32;
        self.phase = phase;
    }

    /// So many whole turns of the rotor; how far the output moves with the last of them, if there
    /// is one.
    #[inline]
    fn turn_rotor(&mut self, turns: i32) -> i32 {
        if turns == 0 {
            return 0;
        }
        // Below 2^14 times 2^16.
        let carry = self.carry + turns * self.rest;
        let whole = carry.div_euclid(self.rotor_turns);
        self.carry = carry.rem_euclid(self.rotor_turns);
        let moved = i64::from(turns) * i64::from(self.microdegrees) + i64::from(whole);
        self.base = self.base.saturating_add(moved);
        turns.signum() * self.microdegrees + whole
    }

    /// Of the output, since the rotor's turn began.
    #[inline]
    fn within_rotor_turn(&self) -> i32 {
        #[expect(clippy::cast_possible_truncation, reason = "at most one turn of the output")]
        return ((i64::from(self.encoder) * i64::from(self.microdegrees)) >> self.bits) as i32;
    }

    #[inline]
    fn wrap(&mut self, phase: i32) {
        self.phase = if (0..TURN_I32).contains(&phase) { phase } else { wrapped(phase) };
    }
}

/// Out of line: it happens once in a turn of the output.
#[cold]
const fn wrapped(phase: i32) -> i32 {
    phase.rem_euclid(TURN_I32)
}

/// Whether a rotor with these speeds before and after a silence (µs) cannot have gone round in it.
fn is_certain(before: i16, after: i16, silence: u64) -> bool {
    let fastest = u64::from(before.unsigned_abs().max(after.unsigned_abs()));
    silence <= LONG_SILENCE.get() && fastest * silence <= CERTAIN_DEGREE_MICROS
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(at: u64, encoder: u16, speed: i16) -> Sample {
        Sample { at: Micros::new(at), encoder, speed }
    }

    /// Turns the rotor by `counts` a millisecond.
    fn run(shaft: &mut Shaft, counts: i32, samples: u32) {
        let mask = (1 << shaft.bits) - 1;
        let mut last = sample(0, shaft.encoder, 0);
        for tick in 1..=u64::from(samples) {
            let encoder = u16::try_from((i32::from(last.encoder) + counts) & mask).unwrap();
            let next = sample(tick * 1000, encoder, 0);
            shaft.follow(last, next);
            last = next;
        }
    }

    #[test]
    fn a_million_rotor_turns_behind_any_gear_leave_nothing_behind() {
        for (rotor, output) in [(1, 1), (10, 1), (3591, 187), (7, 3)] {
            for sign in [1, -1] {
                let gear = Gear::new(rotor, output).unwrap();
                let mut shaft = Shaft::new(14, gear, sign);
                shaft.start(sample(0, 1000, 0));
                let (total, phase) = (shaft.total(), shaft.phase());
                // A whole number of output turns.
                let turns = i64::from(rotor) * 27;
                let samples = u32::try_from(turns * 4).unwrap();
                run(&mut shaft, 4096, samples);
                assert_eq!(shaft.total() - total, i64::from(sign) * 27 * i64::from(output) * TURN);
                let off = (shaft.phase() - phase).rem_euclid(TURN_I32);
                assert!(off.min(TURN_I32 - off) <= 1, "{rotor}:{output} {off}");
                run(&mut shaft, -4096, samples);
                assert_eq!(shaft.total(), total);
            }
        }
    }

    #[test]
    fn an_angle_within_the_turn_and_over_many_turns_agree() {
        let mut shaft = Shaft::new(16, Gear::new(10, 1).unwrap(), -1);
        shaft.start(sample(0, 60_000, 0));
        for counts in [31_000, -9_000, 17, -32_768] {
            run(&mut shaft, counts, 500);
            let within = shaft.total().rem_euclid(TURN);
            assert!((within - i64::from(shaft.phase())).abs() <= 1);
        }
    }

    #[test]
    fn zero_is_where_it_stood() {
        let mut shaft = Shaft::new(16, Gear::DIRECT, 1);
        shaft.start(sample(0, 16_384, 0));
        assert_eq!((shaft.total(), shaft.phase()), (TURN / 4, TURN_I32 / 4));
        shaft.set_zero();
        assert_eq!((shaft.total(), shaft.phase()), (0, 0));
        run(&mut shaft, -16_384, 1);
        assert_eq!((shaft.total(), shaft.phase()), (-TURN / 4, TURN_I32 / 4 * 3));
    }

    #[test]
    fn turns_in_a_silence_are_estimated_and_counted() {
        let mut shaft = Shaft::new(16, Gear::new(10, 1).unwrap(), 1);
        shaft.start(sample(0, 0, 3600));
        // 10 turns a second for 0.32 s, and 0.05 of a turn more than that.
        shaft.follow(sample(0, 0, 3600), sample(320_000, 16_384, 3600));
        assert_eq!(shaft.gaps(), 1);
        assert_eq!(shaft.total(), TURN / 10 * 3 + TURN / 40);
        assert_eq!(i64::from(shaft.phase()), shaft.total());
        // Slow enough to be sure.
        shaft.follow(sample(320_000, 16_384, 100), sample(350_000, 20_000, 100));
        assert_eq!(shaft.gaps(), 1);
        // However wrong the clock and the speed are.
        shaft.follow(sample(0, 20_000, i16::MAX), sample(u64::MAX, 0, i16::MAX));
        shaft.follow(sample(0, 0, i16::MIN), sample(u64::MAX, 9, i16::MIN));
        assert_eq!(shaft.gaps(), 3);
        assert_eq!(i64::from(shaft.phase()), shaft.total().rem_euclid(TURN));
    }
}
