//! From the tachometer of `STATUS_5` to the angle of the output shaft.

use rc10_app::{Degrees, TotalAngle};

use super::Shaft;
use rc10_app::Direction;

/// Microdegrees in a turn.
const TURN: i32 = 360_000_000;

/// Counts the output shaft's angle in millionths of a degree, by the difference from one
/// tachometer value to the next. No division: it runs with every `STATUS_5`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tachometer {
    /// Microdegrees a step: whole ones, and 2⁻³² of one. What that rounds off adds up to less than
    /// two microdegrees in 2³² steps.
    whole: i64,
    fraction: u32,
    reversed: bool,
    /// As last received.
    steps: i32,
    heard: bool,
    /// Microdegrees from the zero, and 2⁻³² of one.
    turned: i64,
    rest: u32,
    /// Microdegrees from the zero within the turn, 0 ..< `TURN`.
    phase: i32,
    gaps: u32,
}

impl Tachometer {
    #[expect(clippy::cast_possible_truncation, reason = "a remainder is below its divisor")]
    pub(super) fn new(shaft: &Shaft, direction: Direction) -> Self {
        let scale = shaft.steps_per_turn();
        let steps = u64::from(scale.counts());
        // At most 65,535 turns: 45 bits. The remainder has 27, so 32 more fit.
        let microdegrees = u64::from(TURN.unsigned_abs()) * u64::from(scale.turns());
        Self {
            whole: (microdegrees / steps).cast_signed(),
            fraction: (((microdegrees % steps) << 32) / steps) as u32,
            reversed: direction == Direction::Reversed,
            steps: 0,
            heard: false,
            turned: 0,
            rest: 0,
            phase: 0,
            gaps: 0,
        }
    }

    /// Steps from the last value to this one, either way; 0 if there was none.
    #[expect(clippy::cast_precision_loss, reason = "many are many")]
    pub(super) const fn way_to(&self, steps: i32) -> f32 {
        if self.heard { steps.wrapping_sub(self.steps).unsigned_abs() as f32 } else { 0.0 }
    }

    /// Takes a new value, also where it went round after 2³² steps. After a silence the VESC may
    /// have been without power, and have begun again at zero: then the value is nearer to zero than
    /// to the one before.
    pub(super) fn update(&mut self, steps: i32, after_silence: bool) {
        let mut moved = steps.wrapping_sub(self.steps);
        if after_silence && self.heard {
            self.gaps = self.gaps.saturating_add(1);
            if steps.unsigned_abs() < moved.unsigned_abs() {
                moved = steps;
            }
        }
        (self.steps, self.heard) = (steps, true);
        self.turn(if self.reversed { moved.wrapping_neg() } else { moved });
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the low half is meant; a movement below a turn fits"
    )]
    fn turn(&mut self, steps: i32) {
        // 31 bits times 32, and 32 more: fits.
        let fraction = i64::from(steps) * i64::from(self.fraction) + i64::from(self.rest);
        self.rest = fraction as u32;
        let moved = i64::from(steps).saturating_mul(self.whole).saturating_add(fraction >> 32);
        self.turned = self.turned.saturating_add(moved);
        let turn = i64::from(TURN);
        let within = if moved.abs() < turn { moved } else { whole_turns_off(moved) };
        let phase = i64::from(self.phase) + within;
        let phase = if phase < 0 { phase + turn } else { phase };
        self.phase = if phase < turn { phase } else { phase - turn } as i32;
    }

    /// The angle now is zero from now on; what it was until now, in microdegrees.
    pub(super) fn set_zero(&mut self) -> i64 {
        (self.rest, self.phase) = (0, 0);
        core::mem::take(&mut self.turned)
    }

    /// Whether there is an angle yet.
    pub(super) const fn is_heard(&self) -> bool {
        self.heard
    }

    /// From the zero, in millionths of a degree.
    pub(super) const fn microdegrees(&self) -> i64 {
        self.turned
    }

    pub(super) const fn total_angle(&self) -> TotalAngle {
        TotalAngle::from_microdegrees(self.turned)
    }

    /// 0 ..< 360 degrees.
    pub(super) const fn angle(&self) -> Degrees {
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let degrees = self.phase as f32 * 1e-6;
        // The last few microdegrees round up to a full turn.
        Degrees::new(if degrees < 360.0 { degrees } else { 0.0 })
    }

    /// How often it may have lost count.
    pub(super) const fn gaps(&self) -> u32 {
        self.gaps
    }
}

/// Out of line: 64-bit division, for who moved more than a turn from one frame to the next.
#[cold]
fn whole_turns_off(moved: i64) -> i64 {
    moved % i64::from(TURN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::num::NonZeroU8;
    use rc10_app::Gear;

    fn tachometer(gear: Gear, direction: Direction) -> Tachometer {
        Tachometer::new(&Shaft::new(NonZeroU8::new(7).unwrap(), gear), direction)
    }

    fn near(counted: &Tachometer, degrees: f32, gaps: u32) {
        assert!((counted.total_angle().degrees().get() - degrees).abs() < 0.01);
        assert_eq!(counted.gaps(), gaps);
    }

    #[test]
    fn angles_are_exact_to_a_microdegree_after_many_turns() {
        let gear = Gear::new(3591, 187).unwrap();
        let shaft = Shaft::new(NonZeroU8::new(7).unwrap(), gear);
        let mut counted = tachometer(gear, Direction::Forward);
        let mut steps = 0_i32;
        for step in [1, -5, 1000, 77_777, -1_000_000, 2_000_000_000, 2_000_000_000, -3] {
            steps = steps.wrapping_add(step);
            counted.update(steps, false);
        }
        let all = 4_000_000_000_i64 - 1_000_000 + 77_777 + 1000 + 1 - 5 - 3;
        let wanted = shaft.total_angle(all).microdegrees();
        // Rounded down here, to the nearest there.
        let off = wanted - counted.microdegrees();
        assert!((0..=2).contains(&off), "{off}");
        let within = shaft.total_angle(all).within_turn().get();
        assert!((counted.angle().get() - within).abs() < 1e-3);
    }

    #[test]
    fn a_reversed_shaft_counts_the_other_way() {
        let mut counted = tachometer(Gear::DIRECT, Direction::Reversed);
        counted.update(21, false);
        assert!((counted.microdegrees() + 180_000_000).abs() <= 1);
        assert!((counted.angle().get() - 180.0).abs() < 1e-3);
        counted.update(i32::MIN, false);
        assert!((0.0..360.0).contains(&counted.angle().get()));
    }

    #[test]
    fn a_vesc_that_restarts_counts_on_from_where_it_was() {
        let mut counted = tachometer(Gear::DIRECT, Direction::Forward);
        counted.update(4200, false);
        counted.update(4242, true);
        near(&counted, 36_360.0, 1);
        counted.update(42, true);
        near(&counted, 36_720.0, 2);
        // Of the first value of all nothing is unsure.
        let mut fresh = tachometer(Gear::DIRECT, Direction::Forward);
        fresh.update(42, true);
        near(&fresh, 360.0, 0);
    }

    #[test]
    fn zero_is_where_it_stands() {
        let mut counted = tachometer(Gear::DIRECT, Direction::Forward);
        assert!(!counted.is_heard());
        counted.update(63, false);
        assert!((counted.set_zero() - 540_000_000).abs() <= 1);
        counted.update(42, false);
        assert!((counted.microdegrees() + 180_000_000).abs() <= 1);
        assert!((counted.angle().get() - 180.0).abs() < 1e-3);
    }
}
