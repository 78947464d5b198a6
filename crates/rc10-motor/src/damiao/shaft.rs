//! Where the output shaft is: what the device tells, unwrapped and counted from our zero. Angles in
//! microdegrees, in the direction that the robot counts.

use rc10_app::angle::{nearest_movement, shortest_way};
use rc10_app::{Degrees, NewtonMetres, Rpm, Seconds, TotalAngle};
use rc10_can::Micros;

use super::wire::{Feedback, State};
use crate::mit::{Limits, Setpoint};
use crate::motor;
use crate::servo::Measured;
use rc10_app::Direction;

/// Of the output shaft.
const TURN: i64 = 360_000_000;
pub(super) const PHASE_TURN: i32 = 360_000_000;
const PER_RADIAN: f32 = 57_295_780.0;
pub(super) const RPM_PER_RADIAN_PER_SECOND: f32 = 9.549_297;
/// A device that was silent for longer is a new one: the link timeout of one that answers in every
/// tick.
pub(super) const LONGEST_SILENCE: Micros = Micros::from_millis(10);
/// Twice that, s: a load may turn it faster than it can turn itself.
const SILENCE_AND_MORE: f32 = 0.020;

#[derive(Clone, Debug)]
pub(super) struct Shaft {
    /// 1 or -1.
    sign: i8,
    /// `PMAX`.
    range: i64,
    /// Further it does not turn within [`LONGEST_SILENCE`]: who does was restarted in a blink, and
    /// counts from elsewhere.
    most: i64,
    /// What it told last, and when; `None` before.
    told: Option<(Feedback, Micros)>,
    /// Position as told last, within ±`range`.
    raw: i64,
    /// Angle of many turns from our zero.
    total: i64,
    /// The same within its turn.
    phase: i32,
    /// Where our zero lies, seen from the device's.
    zero: i64,
    gaps: u32,
}

impl Shaft {
    pub(super) fn new(limits: &Limits, direction: Direction) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "a million rad are below 2^63")]
        let range = (limits.position() * PER_RADIAN) as i64;
        let sign = if direction == Direction::Reversed { -1 } else { 1 };
        #[expect(clippy::cast_possible_truncation, reason = "a million rad/s are below 2^63")]
        let most = (limits.velocity() * PER_RADIAN * SILENCE_AND_MORE) as i64;
        Self { sign, range, most, told: None, raw: 0, total: 0, phase: 0, zero: 0, gaps: 0 }
    }

    /// Takes what the device tells. Whether it is a new device: never heard before, or silent for
    /// so long that nothing of it is certain.
    pub(super) fn hear(&mut self, told: Feedback, at: Micros) -> bool {
        #[expect(clippy::cast_possible_truncation, reason = "a million rad are below 2^63")]
        let raw = i64::from(self.sign) * (told.position * PER_RADIAN) as i64;
        let last = self.told.replace((told, at));
        // A jump from one end of its range to the other is a turn that was counted.
        let way = (raw - self.raw).abs();
        let jumps = way > self.most && way < 2 * self.range - self.most;
        let is_new = jumps || last.is_none_or(|(_, heard)| at.since(heard) > LONGEST_SILENCE);
        if is_new {
            if let Some((before, heard)) = last {
                self.gaps = self.gaps.saturating_add(1);
                self.bridge(raw, before.velocity + told.velocity, at.since(heard));
            }
            self.place(raw.saturating_sub(self.zero));
        } else {
            // Whether it stays at the end of its range or goes on at the other: right for both.
            let moved = match raw - self.raw {
                moved if moved > self.range => moved - 2 * self.range,
                moved if moved < -self.range => moved + 2 * self.range,
                moved => moved,
            };
            self.move_by(moved);
            // Beyond its range it may tell the end of it, and how far it goes is not seen.
            let ends = raw.abs() >= self.range;
            if ends && self.raw.abs() < self.range {
                self.gaps = self.gaps.saturating_add(1);
            }
        }
        self.raw = raw;
        is_new
    }

    /// After a silence: either the device counted on, or it was restarted and knows its turn no
    /// more. Then the shaft is taken to be where its speed (rad/s, twice the mean) took it, so that
    /// no angle that is sought moves by whole turns.
    #[cold]
    fn bridge(&mut self, raw: i64, speeds: f32, silence: Micros) {
        let speed = f32::from(self.sign) * 0.5 * speeds;
        let seconds = Seconds::from_micros(silence.get()).get();
        #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
        let expected = (speed * seconds * PER_RADIAN) as i64;
        let moved = raw - self.raw;
        let aside = moved.saturating_sub(expected).unsigned_abs();
        if aside > TURN.unsigned_abs() / 2 + expected.unsigned_abs() / 2 {
            let likeliest = nearest_movement(moved % TURN, expected, TURN);
            self.zero = self.zero.saturating_add(moved - likeliest);
        }
    }

    fn move_by(&mut self, moved: i64) {
        match i32::try_from(moved) {
            Ok(step) if step.abs() <= PHASE_TURN / 2 => {
                self.total = self.total.saturating_add(moved);
                self.phase += step;
                if self.phase < 0 {
                    self.phase += PHASE_TURN;
                } else if self.phase >= PHASE_TURN {
                    self.phase -= PHASE_TURN;
                }
            }
            _ => self.place(self.total.saturating_add(moved)),
        }
    }

    /// It is there now, however it came there.
    #[cold]
    fn place(&mut self, total: i64) {
        self.total = total;
        #[expect(clippy::cast_possible_truncation, reason = "below a turn")]
        {
            self.phase = total.rem_euclid(TURN) as i32;
        }
    }

    /// Its angle now is zero from now on; where that zero lay until now.
    pub(super) fn set_zero(&mut self) -> i64 {
        let zero = self.total;
        self.zero = self.zero.saturating_add(zero);
        self.place(0);
        zero
    }

    /// The device has made its own angle zero: ours is the same.
    pub(super) fn device_zeroed(&mut self) {
        self.zero = 0;
        self.place(self.raw);
    }

    /// Whether the device is enabled, or what is wrong; `None` before it was heard.
    pub(super) fn state(&self) -> Option<State> {
        self.told.map(|(told, _)| told.state)
    }

    pub(super) const fn sign(&self) -> f32 {
        if self.sign < 0 { -1.0 } else { 1.0 }
    }

    /// Angle of many turns.
    pub(super) const fn total(&self) -> i64 {
        self.total
    }

    pub(super) fn measured(&self) -> Option<Measured> {
        let rpm = self.told?.0.velocity * RPM_PER_RADIAN_PER_SECOND * self.sign();
        Some(Measured { rpm, microdegrees: self.total })
    }

    /// The torque that this asks of the device where it is now, N m; more where it is not known.
    pub(super) fn torque_of(&self, setpoint: &Setpoint) -> f32 {
        let Some((told, _)) = self.told else { return f32::MAX };
        let Setpoint { position, velocity, kp, kd, torque } = *setpoint;
        kp * (position - told.position) + kd * (velocity - told.velocity) + torque
    }

    /// Whether the device can be told to go there.
    pub(super) const fn reaches(&self, total: i64) -> bool {
        total.saturating_add(self.zero).unsigned_abs() <= self.range.unsigned_abs()
    }

    /// The nearest way to an angle within the turn that does not leave the device's range.
    pub(super) fn nearest(&self, phase: i32) -> Option<i64> {
        let near = self.total.saturating_add(shortest_way(self.phase, phase, PHASE_TURN).into());
        if self.reaches(near) { Some(near) } else { self.other_way_round(near) }
    }

    #[cold]
    fn other_way_round(&self, near: i64) -> Option<i64> {
        // The longer way; and, of a shaft that is itself out of the range, to about its middle.
        let middle = near.saturating_add(self.zero).rem_euclid(TURN) - self.zero;
        let others = [near.saturating_sub(TURN), near.saturating_add(TURN), middle, middle - TURN];
        let within = others.into_iter().filter(|&total| self.reaches(total));
        within.min_by_key(|total| total.abs_diff(self.total))
    }

    /// An angle as the device counts it, in rad.
    pub(super) fn device_radians(&self, total: i64) -> f32 {
        let within = total.saturating_add(self.zero).clamp(-self.range, self.range);
        #[expect(clippy::cast_precision_loss, reason = "finer than the device's own steps")]
        return within as f32 / PER_RADIAN * self.sign();
    }

    pub(super) fn feedback(&self) -> motor::Feedback {
        let Some((told, at)) = self.told else { return motor::Feedback::NEW };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let angle = self.phase as f32 * 1e-6;
        let mut feedback = motor::Feedback::new(
            at,
            Rpm::new(told.velocity * RPM_PER_RADIAN_PER_SECOND * self.sign()),
            // The last steps before a full turn may round up to it.
            Degrees::new(if angle < 360.0 { angle } else { 0.0 }),
            TotalAngle::from_microdegrees(self.total),
        );
        feedback.turn_gaps = self.gaps;
        feedback
            .with_torque(NewtonMetres::new(told.torque * self.sign()))
            .with_temperature(told.motor_temperature)
            .with_controller_temperature(told.driver_temperature)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_app::Celsius;

    fn told(position: f32) -> Feedback {
        Feedback {
            id: 1,
            state: State::Enabled,
            position,
            velocity: 0.0,
            torque: 0.0,
            driver_temperature: Celsius::ZERO,
            motor_temperature: Celsius::ZERO,
        }
    }

    fn shaft(position: f32, limit: f32) -> Shaft {
        let mut shaft = Shaft::new(&Limits::of(limit, 30.0, 10.0), Direction::Forward);
        assert!(shaft.hear(told(position), Micros::from_millis(1)));
        shaft
    }

    #[test]
    fn turns_are_counted_across_the_end_of_the_range() {
        let mut shaft = shaft(3.0, 3.0);
        assert!(!shaft.hear(told(-2.9), Micros::from_millis(2)));
        assert!((shaft.total() - 177_616_918).abs() < 200, "{}", shaft.total());
        // Silent for too long: the device is believed, and the count may be wrong.
        assert!(shaft.hear(told(-2.9), Micros::from_millis(13)));
        assert!((shaft.total() + 166_157_760).abs() < 200, "{}", shaft.total());
        assert_eq!(shaft.feedback().turn_gaps, 1);
    }

    #[test]
    fn a_restart_moves_nothing_by_whole_turns() {
        for millis in [3, 50] {
            let mut shaft = shaft(9.0, 12.5);
            let before = shaft.total();
            // Switched off and on: it knows where it is in its turn, and no more.
            let told_now = 9.0 - core::f32::consts::TAU;
            assert!(shaft.hear(told(told_now), Micros::from_millis(1 + millis)));
            assert!((shaft.total() - before).abs() < 200, "{} {before}", shaft.total());
            assert!((shaft.device_radians(before) - told_now).abs() < 1e-5);
            assert_eq!(shaft.feedback().turn_gaps, 1);
        }
    }

    #[test]
    fn the_end_of_the_range_counts_as_a_gap() {
        let mut shaft = shaft(12.4, 12.5);
        for millis in 2..5 {
            let _ = shaft.hear(told(12.5), Micros::from_millis(millis));
        }
        assert_eq!(shaft.feedback().turn_gaps, 1);
    }

    #[test]
    fn an_angle_is_sought_the_shorter_way_within_the_range() {
        let degrees = |shaft: &Shaft, phase: i32| {
            shaft.nearest(phase * 1_000_000).map(|total| total / 1_000_000)
        };
        // ±716 degrees, at 688.
        let far = shaft(12.0, 12.5);
        assert_eq!(degrees(&far, 350), Some(710));
        assert_eq!(degrees(&far, 10), Some(370));
        // ±172 degrees: only one way, and not to everywhere.
        let narrow = shaft(2.9, 3.0);
        assert_eq!(degrees(&narrow, 200), Some(-160));
        assert_eq!(degrees(&narrow, 180), None);
        assert!(narrow.reaches(171_000_000) && !narrow.reaches(-173_000_000));
        assert!(!narrow.reaches(i64::MAX) && !narrow.reaches(i64::MIN));
    }

    #[test]
    fn zero_is_ours_until_the_device_stores_its_own() {
        let mut shaft = shaft(1.0, 12.5);
        let before = shaft.total();
        assert_eq!(shaft.set_zero(), before);
        assert_eq!(shaft.total(), 0);
        assert!((shaft.device_radians(0) - 1.0).abs() < 1e-6);
        let _ = shaft.hear(told(0.0), Micros::from_millis(2));
        shaft.device_zeroed();
        assert_eq!(shaft.total(), 0);
        assert!(shaft.device_radians(0).abs() < 1e-6);
    }
}
