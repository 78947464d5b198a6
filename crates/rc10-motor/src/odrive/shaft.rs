//! From the axis's count of turns, an f32 from wherever it started, to the angle of the output
//! shaft, and back.

use rc10_app::Gear;
use rc10_app::maths::round_to_i32;

const TURN: i64 = 360_000_000;
const TURN_I32: i32 = 360_000_000;

/// From here on an f32 does not tell one turn from the next.
pub(super) const MOST_TURNS: f32 = 16_777_216.0;

/// Where the output shaft is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaft {
    /// 1, or -1 if the shaft counts the other way.
    sign: i32,
    /// Microdegrees of the output, in one turn of the encoder's shaft: a millionth of a degree too
    /// many in a turn is less than an f32 of turns is off.
    microdegrees: i32,
    /// What the axis calls zero, microdegrees.
    offset: i64,
    total: i64,
    /// `total` within the turn: 0 ..< 360,000,000.
    phase: i32,
    gaps: u32,
}

impl Shaft {
    /// Behind a gear that is not faster than the encoder's shaft.
    #[expect(clippy::cast_possible_truncation, reason = "at most one turn")]
    pub const fn new(gear: Gear, sign: i32) -> Self {
        let (rotor, output) = (gear.rotor_turns() as i64, gear.output_turns() as i64);
        let microdegrees = ((TURN * output + rotor / 2) / rotor) as i32;
        Self { sign, microdegrees, offset: 0, total: 0, phase: 0, gaps: 0 }
    }

    /// Many turns, since zero.
    pub const fn total(&self) -> i64 {
        self.total
    }

    /// Within the turn, since zero: 0 ..< 360,000,000 microdegrees.
    pub const fn phase(&self) -> i32 {
        self.phase
    }

    /// What the axis calls zero.
    pub const fn offset(&self) -> i64 {
        self.offset
    }

    /// How often turns had to be estimated.
    pub const fn gaps(&self) -> u32 {
        self.gaps
    }

    /// Here is zero.
    pub const fn set_zero(&mut self) {
        self.offset = self.offset.saturating_sub(self.total);
        (self.total, self.phase) = (0, 0);
    }

    /// The axis stands at so many turns, ± [`MOST_TURNS`].
    #[inline]
    pub fn follow(&mut self, turns: f32) {
        let total = self.by_axis(turns).saturating_add(self.offset);
        let step = total.saturating_sub(self.total);
        self.total = total;
        match i32::try_from(step) {
            Ok(step) if (-TURN_I32..=TURN_I32).contains(&step) => self.wrap(self.phase + step),
            _ => self.phase = within_turn(total),
        }
    }

    /// The same, of an axis that may have been restarted in between: then it counts from anywhere,
    /// and the angle goes on from where it was. `most`: turns that it can have made.
    #[cold]
    pub fn follow_after_silence(&mut self, before: f32, turns: f32, most: f32) {
        self.gaps = self.gaps.saturating_add(1);
        if (turns - before).abs() > most {
            self.offset = self.total.saturating_sub(self.by_axis(turns));
        }
        self.follow(turns);
    }

    /// Turns of the axis at an angle of the output shaft since zero, as near as an f32 comes.
    pub fn turns_at(&self, total: i64) -> f32 {
        let way = total.saturating_sub(self.offset);
        let turn = i64::from(self.microdegrees);
        #[expect(clippy::cast_precision_loss, reason = "as near as an f32 comes")]
        let turns = (way / turn) as f32 + (way % turn) as f32 / turn as f32;
        if self.sign < 0 { -turns } else { turns }
    }

    /// Microdegrees of the output since the axis's own zero.
    #[inline]
    fn by_axis(&self, turns: f32) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates; towards zero")]
        let whole = turns as i32;
        #[expect(
            clippy::cast_precision_loss,
            reason = "exact up to 2^24; a part in 2^24 of a turn"
        )]
        let rest = round_to_i32((turns - whole as f32) * self.microdegrees as f32);
        let way = i64::from(whole) * i64::from(self.microdegrees) + i64::from(rest);
        if self.sign < 0 { -way } else { way }
    }

    #[inline]
    fn wrap(&mut self, phase: i32) {
        self.phase = if (0..TURN_I32).contains(&phase) { phase } else { within_turn(phase.into()) };
    }
}

/// Out of line: it happens once in a turn of the output.
#[cold]
const fn within_turn(microdegrees: i64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "less than a turn")]
    return microdegrees.rem_euclid(TURN) as i32;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_become_angles_and_back() {
        for (sign, rotor, output) in [(1, 8, 1), (-1, 8, 1), (1, 1, 1), (-1, 96, 5)] {
            let gear = Gear::new(rotor, output).unwrap();
            let mut shaft = Shaft::new(gear, sign);
            for turns in [0.0_f32, 0.25, -0.25, 7.75, 1000.5, -12_345.125] {
                shaft.follow(turns);
                let degrees = f64::from(turns) * 360.0 / f64::from(gear.ratio()) * f64::from(sign);
                let told = shaft.total() as f64 * 1e-6;
                assert!((told - degrees).abs() < 1e-7 * degrees.abs() + 1e-5, "{told} {degrees}");
                assert_eq!(i64::from(shaft.phase()), shaft.total().rem_euclid(TURN));
                let back = shaft.turns_at(shaft.total());
                assert!((back - turns).abs() <= 1e-6 * turns.abs().max(1.0), "{back} {turns}");
            }
        }
    }

    #[test]
    fn zero_is_where_it_stood() {
        let mut shaft = Shaft::new(Gear::DIRECT, -1);
        shaft.follow(2.25);
        shaft.set_zero();
        assert_eq!((shaft.total(), shaft.phase()), (0, 0));
        shaft.follow(2.5);
        assert_eq!((shaft.total(), shaft.phase()), (-TURN / 4, TURN_I32 / 4 * 3));
        assert!((shaft.turns_at(0) - 2.25).abs() < 1e-6);
    }

    #[test]
    fn an_axis_that_was_restarted_goes_on_from_where_it_was() {
        let mut shaft = Shaft::new(Gear::DIRECT, 1);
        shaft.follow(30.5);
        // Only silent: it says itself how far it went.
        shaft.follow_after_silence(30.5, 32.0, 2.0);
        assert_eq!((shaft.total(), shaft.gaps()), (32 * TURN, 1));
        // Restarted.
        shaft.follow_after_silence(32.0, 0.0, 2.0);
        assert_eq!((shaft.total(), shaft.gaps()), (32 * TURN, 2));
        shaft.follow(0.25);
        assert_eq!(shaft.total(), 32 * TURN + TURN / 4);
        assert!((shaft.turns_at(33 * TURN) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn nothing_overflows() {
        let mut shaft = Shaft::new(Gear::DIRECT, -1);
        for turns in [MOST_TURNS, -MOST_TURNS, f32::MAX, f32::MIN] {
            shaft.follow(turns);
            shaft.set_zero();
            shaft.follow_after_silence(turns, -turns, 0.5);
            assert!((0..TURN_I32).contains(&shaft.phase()));
            assert!(shaft.turns_at(i64::MAX).is_finite() && shaft.turns_at(i64::MIN).is_finite());
        }
    }
}
