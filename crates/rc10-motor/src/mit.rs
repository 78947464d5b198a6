//! Range-mapped fields: what Damiao's MIT mode and CyberGear's motion control have in common.
//!
//! A quantity within ±limit (or 0 ..= limit) is spread over all values of an unsigned field, and
//! truncated as the vendors do: zero is 0x7FFF of 16 bits and 0x7FF of 12. It divides by the
//! range's width: a reciprocal would put round numbers one step lower.

use rc10_app::angle::shortest_way;
use rc10_app::{Cascade, ConfigError, Direction, Gear, Rpm, TotalAngle, ok};
use rc10_time::Micros;

use crate::motor::Link;
use crate::servo::{Servo, Spring, SpringRange};
use crate::shaft::{Shaft, TURN};
use crate::signals::Signal;
use crate::target::{Motion, Target, TargetError, TargetKind};

/// A drive's own loop: `kp` (`position` - measured) + `kd` (`velocity` - measured) + `torque`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Setpoint {
    /// In rad, ±[`Limits::position`].
    pub position: f32,
    /// In rad/s, ±[`Limits::velocity`].
    pub velocity: f32,
    /// Stiffness in N m / rad, 0 ..= [`Limits::kp`].
    pub kp: f32,
    /// Damping in N m s / rad, 0 ..= [`Limits::kd`]. Keep it above zero where `kp` is: without it
    /// the shaft oscillates (Damiao's manuals).
    pub kd: f32,
    /// Torque added to that of the loop, in N m, ±[`Limits::torque`].
    pub torque: f32,
}

impl Setpoint {
    /// No torque: all zero.
    pub const COAST: Self = Self { position: 0.0, velocity: 0.0, kp: 0.0, kd: 0.0, torque: 0.0 };
}

/// Physical values at the ends of number fields: settings of the device, which wrong scale all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest position, rad.
    pub position: f32,
    /// Largest velocity, rad/s.
    pub velocity: f32,
    /// Largest torque, N m.
    pub torque: f32,
    /// Largest `kp`, N m / rad.
    pub kp: f32,
    /// Largest `kd`, N m s / rad.
    pub kd: f32,
}

/// No motor has a range beyond it, in any unit; sums and products of two ranges stay finite.
const LARGEST: f32 = 1e6;

impl Limits {
    /// Ranges ±`position` (rad), ±`velocity` (rad/s), ±`torque` (N m); usual gains up to 500 and 5.
    pub const fn new(position: f32, velocity: f32, torque: f32) -> Self {
        Self { position, velocity, torque, kp: 500.0, kd: 5.0 }
    }

    /// With other largest gains: N m / rad, N m s / rad.
    #[must_use]
    pub const fn with_gains(self, kp: f32, kd: f32) -> Self {
        Self { kp, kd, ..self }
    }

    /// `Ok` if they can be used. A motor checks its own.
    ///
    /// # Errors
    /// [`ConfigError`] with the first that is not above zero, or above a million.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        const FIELDS: [&str; 5] = ["position", "velocity", "torque", "kp", "kd"];
        let Self { position, velocity, torque, kp, kd } = *self;
        let (mut at, values) = (0, [position, velocity, torque, kp, kd]);
        while at < FIELDS.len() {
            let is_good = values[at] >= f32::MIN_POSITIVE && values[at] <= LARGEST;
            let must_be = "above 0, and at most a million";
            ok!(ConfigError::check(is_good, FIELDS[at], values[at], must_be));
            at += 1;
        }
        Ok(())
    }

    /// Largest speed, rpm.
    pub(crate) const fn rpm(&self) -> f32 {
        self.velocity * RPM_PER_RADIAN_PER_SECOND
    }

    /// Whether loops of ours stay within them.
    pub(crate) const fn check(&self, cascade: &Cascade) -> Result<(), ConfigError> {
        let (torque, rpm) = (cascade.speed.output_limit, cascade.angle.output_limit);
        let must_be = "at most the model's largest torque, in N m";
        let error = ConfigError::check(torque <= self.torque, "output_limit", torque, must_be);
        ok!(error, in "speed");
        let must_be = "at most the model's largest speed, in rpm";
        let error = ConfigError::check(rpm <= self.rpm(), "output_limit", rpm, must_be);
        ok!(error, in "angle");
        cascade.validate()
    }

    /// Our loops, with efforts in N m, and the device's spring.
    pub(crate) const fn servo(&self, cascade: Cascade) -> Servo {
        let springs = SpringRange { kp: self.kp, kd: self.kd, speed: Rpm::new(self.rpm()) };
        Servo::of(TargetKind::Torque, cascade).with_springs(springs)
    }
}

pub(crate) const RPM_PER_RADIAN_PER_SECOND: f32 = 30.0 / core::f32::consts::PI;
/// Microdegrees per rad.
const PER_RADIAN: f32 = 180e6 / core::f32::consts::PI;
/// Microdegrees per rpm and microsecond.
const PER_RPM_MICRO: f32 = 6.0;

/// A [`Shaft`] by a position of 16 bits within ±[`Limits::position`].
///
/// No source says what such a device tells beyond its range. So this takes both possibilities:
///
/// * A reading that moves by more than half the range has started over from the other end.
/// * At the end of the range the position beyond it is estimated from the speed, so that a loop
///   sees the shaft turn there. Back within the range it is exact again.
///
/// Without power the turns are forgotten: a jump, or an odd reading after a silence, tells.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct RangedShaft {
    /// In microdegrees of the device, from its own zero at first.
    pub(crate) shaft: Shaft,
    /// Microdegrees in half a step of the field, times 2^16.
    half_step: i64,
    /// The end of the range, in microdegrees.
    end: i64,
    /// The largest movement between two readings of a device that was not restarted.
    fastest: i64,
    /// Slower is standing still, rpm: a step of a field of 12 bits.
    standstill: f32,
    /// The newest reading; `None` before the first.
    reading: Option<i64>,
    /// Whole ranges by which the field has started over.
    ranges: i64,
    /// The estimated way from the end of the range.
    beyond: i64,
}

/// Seconds of [`RangedShaft::fastest`]: twice a usual link timeout, for a load that turns it.
const LONGEST_STEP: f32 = 0.020;
/// A device whose reading after a silence is this near to what its speed makes has counted on. A
/// restarted one that differs by less does little harm.
#[expect(clippy::cast_possible_truncation, reason = "half a radian")]
const NEAR: i64 = (0.5 * PER_RADIAN) as i64;

impl RangedShaft {
    pub(crate) const fn new(limits: &Limits, direction: Direction) -> Self {
        let fastest = limits.velocity * PER_RADIAN * LONGEST_STEP;
        #[expect(clippy::cast_possible_truncation, reason = "up to a million rad and rad/s")]
        let mut ranged = Self {
            shaft: Shaft::new(TURN.unsigned_abs(), Gear::DIRECT, direction),
            half_step: (limits.position * (PER_RADIAN * 65_536.0 / full(16) as f32)) as i64,
            end: 0,
            fastest: fastest as i64,
            standstill: limits.velocity * (RPM_PER_RADIAN_PER_SECOND * 0.0005),
            reading: None,
            ranges: 0,
            beyond: 0,
        };
        ranged.end = ranged.microdegrees(u16::MAX);
        ranged
    }

    /// A reading, from the middle of the range.
    const fn microdegrees(&self, field: u16) -> i64 {
        (2 * field as i64 - full(16) as i64) * self.half_step / 65_536
    }

    /// Takes a reading that came at `at`, and the speed: `rpm`, in the direction of the device. If the
    /// device counts from elsewhere, the shaft stays, and what the reading moved by is returned.
    pub(crate) fn follow(&mut self, field: u16, rpm: f32, at: Micros, link: Link) -> Option<i64> {
        let jump = self.move_to(self.microdegrees(field), rpm, at, link);
        self.shaft.measure(rpm, at);
        jump
    }

    fn move_to(&mut self, reading: i64, rpm: f32, at: Micros, link: Link) -> Option<i64> {
        let Some(last) = self.reading.replace(reading) else {
            self.shaft.start(reading);
            return None;
        };
        let moved = reading - last;
        let ranges = if link == Link::Online && moved.abs() <= self.fastest.min(self.end) {
            Some(0)
        } else {
            self.ranges_passed(moved, rpm, at, link)
        };
        let Some(ranges) = ranges else {
            let jump = moved - self.ranges - self.beyond;
            (self.ranges, self.beyond) = (0, 0);
            return Some(jump);
        };
        self.ranges += ranges;
        let mut moved = moved + ranges;
        if reading.abs() == self.end || self.beyond != 0 {
            moved += self.estimate(reading, reading == last, rpm, at);
        }
        match i32::try_from(moved) {
            Ok(moved) => self.shaft.move_by(moved),
            Err(_) => self.shaft.jump_by(moved),
        }
        None
    }

    /// The steps to add to a movement where the field started over; `None` after a restart.
    fn ranges_passed(&mut self, moved: i64, rpm: f32, at: Micros, link: Link) -> Option<i64> {
        let range = 2 * self.end;
        if link == Link::Online {
            return match moved.abs() {
                moved if moved > self.fastest && moved < range - self.fastest => None,
                moved if moved <= self.end => Some(0),
                _ => Some(-moved.signum() * range),
            };
        }
        let before = self.shaft.to_sensor(self.shaft.speed().get());
        let expected = self.travelled(0.5 * (before + rpm), at);
        let near = NEAR + expected.saturating_abs() / 2;
        let is_near =
            |ranges: &i64| expected.saturating_sub(moved + ranges).saturating_abs() <= near;
        let ranges = [0, range, -range].into_iter().find(is_near)?;
        self.shaft.count_gap();
        Some(ranges)
    }

    /// The change of the estimated part of the position. Each time that it begins is a gap.
    fn estimate(&mut self, reading: i64, stands: bool, rpm: f32, at: Micros) -> i64 {
        let last = self.beyond;
        if reading.abs() != self.end {
            self.beyond = 0;
        } else if stands && rpm.abs() > self.standstill {
            let outwards = reading.signum();
            let beyond = last.saturating_add(self.travelled(rpm, at));
            self.beyond = outwards * outwards.saturating_mul(beyond).max(0);
        }
        if last == 0 && self.beyond != 0 {
            self.shaft.count_gap();
        }
        self.beyond.saturating_sub(last)
    }

    /// Microdegrees at a speed since the shaft was measured last.
    fn travelled(&self, rpm: f32, at: Micros) -> i64 {
        let micros = at.since(self.shaft.at()).get();
        #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
        return (rpm * PER_RPM_MICRO * micros as f32) as i64;
    }

    /// The next reading is the first: the device counts from a new zero.
    pub(crate) const fn start_over(&mut self) {
        (self.reading, self.ranges, self.beyond) = (None, 0, 0);
    }

    /// Whether the shaft is where the field has no number for.
    const fn is_beyond(&self) -> bool {
        self.ranges != 0 || self.beyond != 0
    }

    /// An angle of the shaft as the device counts it, in microdegrees.
    pub(crate) fn of_angle(&self, angle: TotalAngle) -> i64 {
        let way = angle.minus(self.shaft.angle()).microdegrees();
        let way = if self.shaft.sign() < 0.0 { way.saturating_neg() } else { way };
        (self.reading.unwrap_or(0) + self.ranges + self.beyond).saturating_add(way)
    }

    pub(crate) fn reaches(&self, angle: TotalAngle) -> bool {
        self.of_angle(angle).unsigned_abs() <= self.end.unsigned_abs()
    }

    /// The nearest angle at a phase within the turn to which the device can be told to go.
    pub(crate) fn nearest(&self, phase: i32) -> Option<TotalAngle> {
        let way = shortest_way(self.shaft.phase(), phase, TURN);
        let angle = self.shaft.angle().plus(TotalAngle::from_microdegrees(way.into()));
        let position = self.of_angle(angle);
        let out = position.saturating_sub(position.clamp(-self.end, self.end));
        if out == 0 {
            return Some(angle);
        }
        let turn = TotalAngle::TURN.microdegrees();
        let turns = (out.saturating_abs() / turn).saturating_add(i64::from(out % turn != 0));
        let is_backwards = (out < 0) == (self.shaft.sign() < 0.0);
        let way = turns.saturating_mul(if is_backwards { -turn } else { turn });
        let angle = angle.plus(TotalAngle::from_microdegrees(way));
        self.reaches(angle).then_some(angle)
    }

    /// The value for an angle of the shaft, in rad: at most the end of its range.
    pub(crate) fn radians_of(&self, angle: TotalAngle) -> f32 {
        radians(self.of_angle(angle).clamp(-self.end, self.end))
    }

    /// `Ok` unless a target's angle of many turns lies out of the device's range.
    pub(crate) fn check(&self, target: &Target) -> Result<(), TargetError> {
        let angle = match target {
            Target::TotalAngle(angle) | Target::Motion(Motion { angle: Some(angle), .. }) => {
                Some(*angle)
            }
            Target::Impedance(_) if self.is_beyond() => None,
            Target::Impedance(impedance) => TotalAngle::try_from_degrees(impedance.angle),
            _ => return Ok(()),
        };
        let is_good = angle.is_some_and(|angle| self.reaches(angle));
        if is_good { Ok(()) } else { Err(TargetError::OutOfRange(target.kind())) }
    }

    /// The setpoint that does what a servo has decided.
    pub(crate) fn setpoint_of(&self, servo: &Servo) -> Setpoint {
        let sign = self.shaft.sign();
        match servo.spring() {
            Some(spring) => self.setpoint(spring),
            None => Setpoint { torque: servo.effort() * sign, ..Setpoint::COAST },
        }
    }

    /// The setpoint of a spring; coasting where its place has no number.
    fn setpoint(&self, spring: &Spring) -> Setpoint {
        let sign = self.shaft.sign();
        let now = radians(self.reading.unwrap_or(0));
        let position = now + (sign * spring.way.get()).to_radians();
        if self.is_beyond() || position.abs() > radians(self.end) {
            return Setpoint::COAST;
        }
        Setpoint {
            position,
            velocity: sign * spring.speed.get() / RPM_PER_RADIAN_PER_SECOND,
            kp: spring.kp,
            kd: spring.kd,
            torque: sign * spring.torque,
        }
    }
}

/// Microdegrees in rad.
const fn radians(microdegrees: i64) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "finer than the field")]
    return microdegrees as f32 / PER_RADIAN;
}

/// The signal of a field for -`limit` ..= `limit`.
pub(crate) const fn spread(signal: Signal, limit: f32, unit: &'static str) -> Signal {
    let limit = limit as f64;
    signal.scaled(2.0 * limit / full(signal.bits as u32) as f64, unit).offset(-limit)
}

/// The largest value of a field.
pub(crate) const fn full(bits: u32) -> u32 {
    (1 << bits) - 1
}

/// A field for -`limit` ..= `limit`; the middle for NaN.
pub(crate) fn pack_signed<const BITS: u32>(x: f32, limit: f32) -> u32 {
    if x.abs() < limit {
        #[expect(clippy::cast_possible_truncation, reason = "below the field's largest value")]
        return ((x + limit) * full(BITS) as f32 / (limit + limit)) as u32;
    }
    beyond(x, full(BITS), full(BITS) / 2)
}

/// A field for 0 ..= `limit`; zero for NaN.
pub(crate) fn pack_positive<const BITS: u32>(x: f32, limit: f32) -> u32 {
    if x >= 0.0 && x < limit {
        #[expect(clippy::cast_possible_truncation, reason = "below the field's largest value")]
        return (x * full(BITS) as f32 / limit) as u32;
    }
    beyond(x, full(BITS), 0)
}

/// Out of line: the usual case stays short. Limits come here too: rounding could shift them.
fn beyond(x: f32, full: u32, neutral: u32) -> u32 {
    if x.is_nan() {
        neutral
    } else if x < 0.0 {
        0
    } else {
        full
    }
}

/// The field of -`limit` ..= `limit`: symmetric, never beyond, as exact around zero as elsewhere.
pub(crate) const fn unpack_signed<const BITS: u32>(raw: u32, limit: f32) -> f32 {
    let from_middle = (2 * raw).cast_signed() - full(BITS).cast_signed();
    from_middle as f32 / full(BITS) as f32 * limit
}

/// `x` as it may go onto a wire as f32: infinities become the largest number, NaN zero.
pub(crate) fn sendable(x: f32) -> f32 {
    if x.is_finite() {
        x
    } else if x.is_nan() {
        0.0
    } else {
        f32::MAX.copysign(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_app::Degrees;

    #[test]
    fn fields_end_where_their_ranges_end() {
        let wide = |x| pack_signed::<16>(x, 12.5);
        let narrow = |x| pack_positive::<12>(x, 500.0);
        for (x, signed) in [
            (0.0, 0x7FFF),
            (-0.0, 0x7FFF),
            (f32::NAN, 0x7FFF),
            (12.5, 0xFFFF),
            (-12.5, 0),
            (f32::INFINITY, 0xFFFF),
            (f32::NEG_INFINITY, 0),
            (f32::MAX, 0xFFFF),
            (12.4999, 0xFFFE),
            (-12.4999, 0),
        ] {
            assert_eq!(wide(x), signed, "{x}");
        }
        for (x, positive) in
            [(0.0, 0), (-1.0, 0), (f32::NAN, 0), (100.0, 819), (500.0, 4095), (1e9, 4095)]
        {
            assert_eq!(narrow(x), positive, "{x}");
        }
        // Where rounding alone would fall one step short, or go one too far.
        let mut limit = 1e-3_f32;
        while limit < LARGEST {
            assert_eq!(pack_signed::<16>(limit, limit), 0xFFFF, "{limit}");
            assert!(pack_signed::<16>(limit.next_down(), limit) <= 0xFFFF, "{limit}");
            assert!(pack_positive::<12>(limit.next_down(), limit) <= 0xFFF, "{limit}");
            limit *= 1.01;
        }
    }

    #[test]
    fn values_are_symmetric_around_the_middle() {
        assert_eq!(unpack_signed::<12>(0xFFF, 30.0).to_bits(), 30.0_f32.to_bits());
        assert_eq!(unpack_signed::<12>(0, 30.0).to_bits(), (-30.0_f32).to_bits());
        let sum = unpack_signed::<16>(0x7FFF, 12.5) + unpack_signed::<16>(0x8000, 12.5);
        assert_eq!(sum.to_bits(), 0);
    }

    #[test]
    fn what_is_no_range_and_no_number_is_named() {
        assert_eq!(Limits::new(12.5, 30.0, 10.0).validate(), Ok(()));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e7] {
            let error = Limits::new(12.5, bad, 10.0).validate().unwrap_err();
            assert_eq!((error.field, error.value.to_bits()), ("velocity", bad.to_bits()));
        }
        let gains = Limits::new(1.0, 1.0, 1.0).with_gains(0.0, 1.0);
        assert_eq!(gains.validate().unwrap_err().field, "kp");
        let position = Limits { position: f32::NAN, ..Limits::new(1.0, 1.0, 1.0) };
        assert_eq!(position.validate().unwrap_err().field, "position");
    }

    /// An angle as a field shows it, in rad: stopping at its end, or starting over.
    fn field(rad: f64, starts_over: bool) -> u16 {
        let rad = if starts_over { (rad + 12.5).rem_euclid(25.0) - 12.5 } else { rad };
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        return ((rad + 12.5) * (65_535.0 / 25.0)).round() as u16;
    }

    struct Bench {
        ranged: RangedShaft,
        now: u64,
    }

    impl Bench {
        fn new(direction: Direction) -> Self {
            let ranged = RangedShaft::new(&Limits::new(12.5, 30.0, 10.0), direction);
            Self { ranged, now: 1 }
        }

        fn hear(&mut self, field: u16, rad_s: f32, pause: u64) -> Option<i64> {
            self.now += pause;
            let (at, rpm) = (Micros::from_millis(self.now), rad_s * RPM_PER_RADIAN_PER_SECOND);
            let link = if pause > 10 { Link::Lost } else { Link::Online };
            self.ranged.follow(field, rpm, at, link)
        }

        fn degrees(&self) -> f64 {
            self.ranged.shaft.angle().microdegrees() as f64 * 1e-6
        }

        fn gaps(&self) -> u32 {
            self.ranged.shaft.feedback().turn_gaps
        }
    }

    #[test]
    fn turns_are_counted_whatever_the_field_does_at_its_end() {
        for (direction, mirrored) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
            for (starts_over, sign) in [(true, 1.0), (true, -1.0), (false, 1.0), (false, -1.0)] {
                let mut bench = Bench::new(direction);
                let mut rad = 0.0;
                bench.hear(field(rad, starts_over), 0.0, 1);
                for tick in 0..8000 {
                    // Out to 80 rad, and back.
                    let speed: f32 = if tick < 4000 { 20.0 } else { -20.0 } * sign;
                    rad += f64::from(speed) * 1e-3;
                    assert_eq!(bench.hear(field(rad, starts_over), speed, 1), None);
                    let off = mirrored * bench.degrees() - rad.to_degrees();
                    assert!(off.abs() < 2.0, "{starts_over} {rad}: off by {off}");
                }
                assert!(bench.degrees().abs() < 0.03, "{starts_over}: {}", bench.degrees());
                assert_eq!(bench.gaps(), u32::from(!starts_over));
            }
        }
    }

    #[test]
    fn back_within_the_range_the_position_is_exact_again() {
        for sign in [1.0, -1.0] {
            let mut bench = Bench::new(Direction::Forward);
            let inside = field(f64::from(12.4 * sign), false);
            let end = field(f64::from(12.5 * sign), false);
            bench.hear(inside, 0.0, 1);
            for _ in 0..100 {
                bench.hear(end, 20.0 * sign, 1);
            }
            let out = f64::from(sign) * bench.degrees();
            assert!((out - 716.2 - 113.4).abs() < 1.0, "{out}");
            // It turns back more slowly than it turned out, by what is told.
            for _ in 0..300 {
                bench.hear(end, -10.0 * sign, 1);
                assert!(f64::from(sign) * bench.degrees() > 716.1, "it is not within the range");
            }
            bench.hear(inside, -10.0 * sign, 1);
            assert!((f64::from(sign) * bench.degrees() - 710.47).abs() < 0.03);
            assert_eq!(bench.gaps(), 1);
        }
    }

    #[test]
    fn a_restart_is_told_and_moves_nothing() {
        for (pause, gaps) in [(1, 0), (300, 0)] {
            let mut bench = Bench::new(Direction::Forward);
            bench.hear(field(9.0, false), 0.0, 1);
            let jump = bench.hear(field(9.0 - core::f64::consts::TAU, false), 0.0, pause);
            assert!(jump.is_some_and(|jump| (jump + 360_000_000).abs() < 30_000), "{jump:?}");
            assert!((bench.degrees() - 515.66).abs() < 0.03, "{}", bench.degrees());
            assert_eq!(bench.gaps(), gaps, "the motor's to count");
            assert_eq!(bench.hear(field(2.8, false), 0.0, 1), None);
            assert!((bench.degrees() - 520.43).abs() < 0.03, "{}", bench.degrees());
        }
    }

    #[test]
    fn after_a_silence_a_reading_that_fits_the_speed_is_believed() {
        let mut bench = Bench::new(Direction::Reversed);
        bench.hear(field(11.0, true), 10.0, 1);
        // 3 rad, round the end of the field.
        assert_eq!(bench.hear(field(14.1, true), 10.0, 300), None);
        assert!((bench.degrees() + 807.87).abs() < 0.03, "{}", bench.degrees());
        assert_eq!(bench.gaps(), 1);
        assert!(bench.hear(field(9.0, true), 0.0, 300).is_some());
    }

    #[test]
    fn the_device_is_told_where_to_go_from_its_own_reading() {
        let spring = Spring { way: Degrees::new(10.0), speed: Rpm::new(9.55), ..Spring::default() };
        for (direction, sign) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
            let mut bench = Bench::new(direction);
            bench.hear(field(1.0, false), 0.0, 1);
            bench.ranged.shaft.set_zero();
            let setpoint = bench.ranged.setpoint(&spring);
            assert!((setpoint.position - (1.0 + sign * 0.174_533)).abs() < 3e-4);
            assert!((setpoint.velocity - sign).abs() < 1e-3);
            let angle = |degrees: i32| {
                TotalAngle::from_degrees(if sign > 0.0 { degrees } else { -degrees })
            };
            let quarter = bench.ranged.radians_of(angle(90));
            assert!((quarter - (1.0 + core::f32::consts::FRAC_PI_2)).abs() < 3e-4);
            // 1 rad is 57 degrees, the end at 716.
            let is_reached =
                [658, 660, -773, -774].map(|degrees| bench.ranged.reaches(angle(degrees)));
            assert_eq!(is_reached, [true, false, true, false], "{direction:?}");
            let furthest = bench.ranged.radians_of(angle(2000));
            assert!((furthest - 12.5).abs() < 1e-5, "{furthest}");
            bench.hear(field(12.45, false), 0.0, 100);
            let far = Spring { way: Degrees::new(sign * 3.0), ..spring };
            assert_eq!(bench.ranged.setpoint(&far), Setpoint::COAST);
        }
    }

    #[test]
    fn nothing_overflows() {
        for limits in [Limits::new(1e6, 1e6, 1.0), Limits::new(1e-6, 1e-6, 1.0)] {
            let mut ranged = RangedShaft::new(&limits, Direction::Reversed);
            for at in [0, 1, u64::MAX / 2, u64::MAX, 7] {
                for field in [0, u16::MAX, u16::MAX, 0, 0, 1, 0x8000] {
                    for (rpm, link) in [(f32::MAX, Link::Online), (f32::MIN, Link::Lost)] {
                        let at = Micros::new(at);
                        ranged.follow(field, rpm, at, link);
                        let far = TotalAngle::from_microdegrees(i64::MIN);
                        assert!(ranged.radians_of(far).is_finite());
                    }
                }
            }
        }
    }
}
