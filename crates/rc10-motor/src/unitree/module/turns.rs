use rc10_app::Degrees;
use rc10_app::angle::nearest_movement;
use rc10_can::Micros;

/// Where the output shaft is, from the rotor's angle of many turns.
///
/// A step of the rotor is 5 859 375 / 3376 microdegrees of the output (360 degrees in
/// 32768 · 6.33 steps): counted with its remainder, so that it stays exact.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turns {
    /// Of the output, from its zero.
    microdegrees: i64,
    /// The same within the turn, 0 ..< [`TURN`].
    within: i32,
    /// What is left, in 1/3376 microdegrees, 0 ..< 3376.
    rest: i32,
    /// As [`Feedback::turn_gaps`](crate::Feedback::turn_gaps).
    gaps: u32,
}

/// Microdegrees per step: numerator, denominator, whole part, and the rest's numerator.
const NUMERATOR: i64 = 5_859_375;
const DENOMINATOR: i32 = 3376;
const WHOLE: i32 = 1735;
const REST: i32 = 2015;
const _: () = assert!((WHOLE * DENOMINATOR + REST) as i64 == NUMERATOR);

/// Microdegrees in a turn of the output.
const TURN: i32 = 360_000_000;
/// Steps in a turn of the rotor.
const ROTOR_TURN: i32 = 32768;

impl Turns {
    pub(super) const fn microdegrees(&self) -> i64 {
        self.microdegrees
    }

    pub(super) const fn gaps(&self) -> u32 {
        self.gaps
    }

    /// 0 ..< 360 degrees.
    #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
    pub(super) fn within_turn(&self) -> Degrees {
        Degrees::new((self.within as f32 * 1e-6).min(359.999_97))
    }

    /// The shaft's angle now is zero. Returns what it was.
    pub(super) const fn set_zero(&mut self) -> i64 {
        let zero = self.microdegrees;
        (self.microdegrees, self.within, self.rest) = (0, 0, 0);
        zero
    }

    /// The first angle of all, which also says where zero is.
    #[cold]
    pub(super) fn begin(&mut self, angle: i32, sign: i32) {
        self.jump(i64::from(angle) * i64::from(sign));
    }

    /// The rotor was at `last`, and is at `now` after `silence`, in which it had about the given
    /// mean speed (steps a second). Signs are the device's; `sign` makes them the output's.
    #[inline]
    pub(super) fn follow(&mut self, last: i32, now: i32, sign: i32, speed: i32, silence: Micros) {
        let step = now.wrapping_sub(last);
        if step.unsigned_abs() <= ROTOR_TURN.unsigned_abs() / 2 {
            self.step(step * sign);
        } else {
            let moved = self.likeliest(step, now, speed, silence);
            self.jump(moved.saturating_mul(i64::from(sign)));
        }
    }

    /// A step that no rotor makes in a tick: either it turned while nobody heard it, or it lost
    /// power, counts from its first turn again, and the speed says which turn is likeliest.
    #[cold]
    fn likeliest(&mut self, step: i32, now: i32, speed: i32, silence: Micros) -> i64 {
        let step = i64::from(step);
        if now.unsigned_abs() > ROTOR_TURN.unsigned_abs() {
            return step;
        }
        let micros = i64::try_from(silence.get()).unwrap_or(i64::MAX);
        let expected = i64::from(speed).saturating_mul(micros) / 1_000_000;
        let moved = nearest_movement(step % i64::from(ROTOR_TURN), expected, i64::from(ROTOR_TURN));
        if moved != step {
            self.gaps = self.gaps.saturating_add(1);
        }
        moved
    }

    /// At most half a turn of the rotor.
    #[inline]
    fn step(&mut self, steps: i32) {
        let fraction = steps * REST + self.rest;
        let moved = steps * WHOLE + fraction.div_euclid(DENOMINATOR);
        self.rest = fraction.rem_euclid(DENOMINATOR);
        self.microdegrees = self.microdegrees.saturating_add(moved.into());
        let within = self.within + moved;
        self.within = match within {
            _ if within < 0 => within + TURN,
            _ if within >= TURN => within - TURN,
            _ => within,
        };
    }

    #[cold]
    fn jump(&mut self, steps: i64) {
        let fraction = steps.saturating_mul(NUMERATOR).saturating_add(self.rest.into());
        let moved = fraction.div_euclid(DENOMINATOR.into());
        #[expect(clippy::cast_possible_truncation, reason = "below the divisors, both i32")]
        {
            self.rest = fraction.rem_euclid(DENOMINATOR.into()) as i32;
            let within = i64::from(self.within) + moved % i64::from(TURN);
            self.within = within.rem_euclid(TURN.into()) as i32;
        }
        self.microdegrees = self.microdegrees.saturating_add(moved);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Micros = Micros::from_millis(1);

    #[test]
    fn many_turns_are_exact_in_either_direction() {
        // 633 turns of the rotor are 100 of the output; 16384 steps are half a turn.
        for (sign, steps) in [(1, 16_384), (-1, 16_384), (1, -1_024), (-1, 37 * 256)] {
            let mut turns = Turns::default();
            let mut at = 0_i32;
            for _ in 0..633 * 1024 {
                let next = at.wrapping_add(steps);
                turns.follow(at, next, sign, 0, MS);
                at = next;
            }
            // 633 · 1024 steps of the rotor are 3.125 turns of the output.
            let exact = i64::from(steps) * i64::from(sign) * 1_125_000_000;
            assert_eq!(turns.microdegrees(), exact, "{steps} {sign}");
            assert_eq!(i64::from(turns.within), exact.rem_euclid(360_000_000));
            assert_eq!((turns.rest, turns.gaps()), (0, 0));
        }
    }

    #[test]
    fn a_jump_and_steps_come_to_the_same() {
        let (mut stepped, mut jumped) = (Turns::default(), Turns::default());
        for at in 0..100 {
            stepped.follow(at * 331, (at + 1) * 331, -1, 0, MS);
        }
        jumped.begin(33_100, -1);
        assert_eq!(stepped.microdegrees(), jumped.microdegrees());
        assert_eq!((stepped.within, stepped.rest), (jumped.within, jumped.rest));
    }

    #[test]
    fn a_motor_that_counted_on_unheard_is_believed() {
        let mut turns = Turns::default();
        turns.begin(0, 1);
        turns.follow(0, 32768 * 4, 1, 0, Micros::from_millis(1000));
        assert_eq!((turns.microdegrees(), turns.gaps()), (turns_of_rotor(4), 0));
    }

    #[test]
    fn a_motor_that_counts_from_its_first_turn_again_has_not_moved_far() {
        let mut turns = Turns::default();
        turns.begin(32768 * 40 + 100, 1);
        // At 20 turns a second for 100 ms: two turns, and a quarter by the angle.
        turns.follow(32768 * 40 + 100, 8292, 1, 32768 * 20, Micros::from_millis(100));
        let (moved, exact) = (turns.microdegrees() - turns_of_rotor(42), 8292 * 5_859_375 / 3376);
        assert!((moved - exact).abs() <= 1, "{moved} {exact}");
        assert_eq!(turns.gaps(), 1);
    }

    fn turns_of_rotor(turns: i64) -> i64 {
        turns * 32768 * 5_859_375 / 3376
    }

    #[test]
    fn no_angle_makes_it_panic() {
        let mut turns = Turns::default();
        for (last, now) in [(i32::MIN, i32::MAX), (0, i32::MIN), (i32::MAX, 0), (1 << 30, -5)] {
            for sign in [1, -1] {
                turns.follow(last, now, sign, i32::MAX, Micros::new(u64::MAX));
                turns.begin(now, sign);
                assert!((0..TURN).contains(&turns.within) && turns.rest >= 0);
            }
        }
        assert!(turns.within_turn().get() < 360.0);
    }
}
