//! Where the shaft is, counted over many turns from a field that only tells it within ±12.5 rad.
//!
//! No source says what the field shows beyond its range: whether it stops at its end, as the
//! vendor's conversion would have it, or starts over from the other end. So this takes both:
//!
//! * A step by more than half the range is the field starting over.
//! * While the field stands at its end, the angle is estimated from the speed, so that a loop that
//!   turns the shaft out there sees it turn. [`turn_gaps`](crate::Feedback::turn_gaps) counts these
//!   times; back within the range the angle is exact again.

use rc10_app::Degrees;
use rc10_app::maths::round_to_i32;
use rc10_can::Micros;

use rc10_app::Direction;

const TURN: i32 = 360_000_000;
/// Degrees per rad.
const DEGREES: f32 = 180.0 / core::f32::consts::PI;
/// Steps of a field, and its last value.
const LAST: u16 = u16::MAX;
/// A part in 38 of a field of ±12.57 rad is 0.66 rad: what 50 rad/s make in 10 ms, and a third more.
const JUMP: u16 = LAST / 38;
/// Below this a speed is the field's own zero, rad/s: nothing is gathered from it.
const STANDS: f32 = 0.05;
/// The largest change that certainly fits an i32 with a turn on top.
const LARGE: i64 = 1_700_000_000;

/// Angles in millionths of a degree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Position {
    /// 1 or -1.
    sign: i64,
    /// Half a step of the field, in 2^-16.
    half_step: i64,
    /// As told last; `None` before.
    steps: Option<u16>,
    /// Where the middle of the field lies, in the device's direction.
    origin: i64,
    /// Whole ranges by which the field has started over.
    ranges: i64,
    /// How far beyond the field's end the shaft is thought to be.
    beyond: i64,
    /// In the device's direction: the sum of the above and the field.
    total: i64,
    /// What counts as zero, in our direction.
    zero: i64,
    /// Within the turn, in our direction, from the zero.
    phase: i32,
    gaps: u32,
}

impl Position {
    /// `range` in rad, above 0 and at most 15.
    pub(super) fn new(range: f32, direction: Direction) -> Self {
        let sign = direction.sign().into();
        // Of at most 15 rad: below 2^30.
        let half_step = round_to_i32(range * (DEGREES * 1e6 / f32::from(LAST) * 65_536.0));
        Self {
            sign,
            half_step: half_step.into(),
            steps: None,
            origin: 0,
            ranges: 0,
            beyond: 0,
            total: 0,
            zero: 0,
            phase: 0,
            gaps: 0,
        }
    }

    /// The field in millionths of a degree, from its middle.
    #[inline]
    fn angle(&self, steps: u16) -> i64 {
        ((2 * i64::from(steps) - i64::from(LAST)) * self.half_step) >> 16
    }

    /// From one end to the other.
    fn range(&self) -> i64 {
        2 * self.angle(LAST)
    }

    /// Whether the field shows more movement than any motor makes within its link timeout, and has
    /// not just started over: then the device was restarted in a blink.
    #[inline]
    pub(super) fn jumps_to(&self, steps: u16) -> bool {
        let moved = steps.abs_diff(self.steps.unwrap_or(steps));
        (JUMP..=LAST - JUMP).contains(&moved)
    }

    /// Whether the field shows a movement by about `expected` (± `tolerance`), rad.
    pub(super) fn has_moved_by(&self, steps: u16, expected: f32, tolerance: f32) -> bool {
        let moved = i32::from(steps) - i32::from(self.steps.unwrap_or(steps));
        let range = i32::from(LAST);
        #[expect(clippy::cast_precision_loss, reason = "finer than the field")]
        let per_step = self.half_step as f32 * (2.0 / 65_536.0 * 1e-6 / DEGREES);
        [moved, moved + range, moved - range].into_iter().any(|moved| {
            #[expect(clippy::cast_precision_loss, reason = "17 bits")]
            let moved = moved as f32 * per_step;
            (moved - expected).abs() <= tolerance
        })
    }

    /// Takes the field, and the speed (rad/s) since the one before, which came `since` earlier.
    #[inline]
    pub(super) fn follow(&mut self, steps: u16, speed: f32, since: Micros) {
        let Some(last) = self.steps.replace(steps) else {
            return self.place_at(self.angle(steps));
        };
        let moved = i32::from(steps) - i32::from(last);
        if moved.unsigned_abs() > u32::from(LAST / 2) {
            let range = self.range();
            self.ranges += if moved < 0 { range } else { -range };
        }
        if steps == 0 || steps == LAST {
            self.stay_at_end(last == steps, steps, speed, since);
        } else {
            self.beyond = 0;
        }
        self.place_at(self.origin + self.ranges + self.angle(steps) + self.beyond);
    }

    #[cold]
    fn stay_at_end(&mut self, stays: bool, steps: u16, speed: f32, since: Micros) {
        let outwards: i64 = if steps == 0 { -1 } else { 1 };
        let was_beyond = self.beyond != 0;
        if stays && speed.abs() > STANDS {
            let micros = u16::try_from(since.get()).unwrap_or(u16::MAX);
            let moved = i64::from(round_to_i32(speed * DEGREES * f32::from(micros)));
            self.beyond = outwards * (outwards * (self.beyond + moved)).max(0);
        }
        if !was_beyond && self.beyond != 0 {
            self.gaps = self.gaps.saturating_add(1);
        }
    }

    /// The device may have been off: its field means something else now, and the shaft is taken to
    /// be where it was.
    pub(super) fn restart(&mut self, steps: u16) {
        if self.steps.replace(steps).is_none() {
            return self.place_at(self.angle(steps));
        }
        (self.ranges, self.beyond) = (0, 0);
        self.origin = self.total - self.angle(steps);
        self.gaps = self.gaps.saturating_add(1);
    }

    /// The device counts from here: so do we.
    pub(super) fn restart_at_zero(&mut self, steps: u16) {
        *self = Self { steps: None, zero: 0, origin: 0, ranges: 0, beyond: 0, ..*self };
        self.steps = Some(steps);
        self.total = self.angle(steps);
        self.recount();
    }

    /// Turns were not watched for a while.
    pub(super) const fn count_gap(&mut self) {
        self.gaps = self.gaps.saturating_add(1);
    }

    #[inline]
    fn place_at(&mut self, total: i64) {
        let change = (total - self.total) * self.sign;
        self.total = total;
        match i32::try_from(change) {
            Ok(change) if i64::from(change).abs() < LARGE => {
                self.phase = (self.phase + change).rem_euclid(TURN);
            }
            _ => self.recount(),
        }
    }

    #[cold]
    fn recount(&mut self) {
        let phase = self.counted().rem_euclid(TURN.into());
        // Below a turn.
        self.phase = i32::try_from(phase).unwrap_or(0);
    }

    /// All turns, from our zero, in our direction.
    #[inline]
    pub(super) const fn counted(&self) -> i64 {
        self.sign * self.total - self.zero
    }

    /// Within the turn.
    #[inline]
    pub(super) fn within_turn(&self) -> Degrees {
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let degrees = self.phase as f32 * 1e-6;
        // The last steps before a full turn round up to it.
        Degrees::new(if degrees < 360.0 { degrees } else { 0.0 })
    }

    /// How often the number of turns had to be estimated.
    pub(super) const fn gaps(&self) -> u32 {
        self.gaps
    }

    /// Whether anything was heard.
    pub(super) const fn is_known(&self) -> bool {
        self.steps.is_some()
    }

    /// Zero is here from now on; says where that was until now.
    pub(super) fn set_zero(&mut self) -> i64 {
        let here = self.counted();
        self.zero += here;
        self.phase = 0;
        here
    }

    /// What the device calls an angle of ours, rad; `None` beyond its range.
    #[inline]
    pub(super) fn in_device(&self, counted: i64) -> Option<f32> {
        let angle = counted.saturating_add(self.zero).saturating_mul(self.sign);
        let angle = angle.saturating_sub(self.origin);
        let end = self.angle(LAST);
        if angle > end || angle < -end {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "finer than the field")]
        return Some(angle as f32 * (1e-6 / DEGREES));
    }

    /// Whether the shaft is where the field has no number for.
    #[inline]
    pub(super) const fn is_beyond(&self) -> bool {
        self.ranges != 0 || self.beyond != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Micros = Micros::from_millis(1);

    fn position(direction: Direction) -> Position {
        Position::new(12.5, direction)
    }

    fn near(position: &Position, degrees: f64) -> bool {
        (position.counted() as f64 * 1e-6 - degrees).abs() < 0.03
    }

    /// As a field shows rad: stopping at its end, or starting over.
    fn field(rad: f64, starts_over: bool) -> u16 {
        let rad = if starts_over { (rad + 12.5).rem_euclid(25.0) - 12.5 } else { rad };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        return ((rad + 12.5) * (65_535.0 / 25.0)) as u16;
    }

    #[test]
    fn many_turns_are_counted_whatever_the_field_does_at_its_end() {
        for starts_over in [true, false] {
            for sign in [1.0, -1.0] {
                let mut position = position(Direction::Forward);
                let mut rad = 0.0;
                position.follow(field(rad, starts_over), 0.0, MS);
                for tick in 0..8000 {
                    // Out to 80 rad, and back.
                    let speed: f32 = if tick < 4000 { 20.0 } else { -20.0 } * sign;
                    rad += f64::from(speed) * 1e-3;
                    position.follow(field(rad, starts_over), speed, MS);
                    let off = position.counted() as f64 * 1e-6 - rad.to_degrees();
                    assert!(off.abs() < 2.0, "{starts_over} {rad}: off by {off}");
                    let turn = f64::from(position.within_turn().get());
                    let wanted = (position.counted() as f64 * 1e-6).rem_euclid(360.0);
                    assert!((turn - wanted).abs() < 1e-3, "{turn} {wanted}");
                }
                assert!(near(&position, 0.0), "{starts_over}: {}", position.counted());
                assert_eq!(position.gaps() > 0, !starts_over);
            }
        }
    }

    #[test]
    fn a_restart_moves_nothing_and_zero_is_ours() {
        for direction in [Direction::Forward, Direction::Reversed] {
            let sign = if direction == Direction::Forward { 1.0 } else { -1.0 };
            let mut position = position(direction);
            position.follow(field(3.0, false), 0.0, MS);
            assert!(near(&position, sign * 171.887));
            position.restart(field(-1.0, false));
            assert!(near(&position, sign * 171.887));
            assert_eq!(position.gaps(), 1);
            position.follow(field(-0.9, false), 0.0, MS);
            assert!(near(&position, sign * 177.617));
            position.set_zero();
            assert!(near(&position, 0.0));
            assert!(position.within_turn().get() < 1e-3);
            let device = position.in_device(0).unwrap();
            assert!((device + 0.9).abs() < 1e-3, "{device}");
            position.restart_at_zero(field(0.1, false));
            assert!(near(&position, sign * 5.7296));
        }
    }

    #[test]
    fn angles_beyond_the_range_have_no_number() {
        let mut position = position(Direction::Forward);
        position.follow(field(0.0, false), 0.0, MS);
        assert!(position.in_device(716_000_000).is_some());
        assert!(position.in_device(-716_300_000).is_none());
        assert_eq!(position.in_device(i64::MIN), None);
        assert_eq!(position.in_device(i64::MAX), None);
    }
}
