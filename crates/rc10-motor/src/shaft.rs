//! The angle of the output shaft: [`Shaft`] counts its turns exactly, for every motor.
//!
//! From a sensor's steps or readings to millionths of a degree of the output, by its gearbox.
//!
//! ```
//! use rc10_app::{Direction, Gear};
//! use rc10_time::Micros;
//! use rc10_motor::shaft::Shaft;
//!
//! // An encoder of 8192 steps in front of a gearbox of 36 : 1, mounted mirrored.
//! let gear = Gear::new(36, 1).unwrap();
//! let mut shaft = Shaft::new(8192, gear, Direction::Reversed);
//! shaft.follow(0, 60.0, Micros::from_millis(1));
//! shaft.follow(8, 60.0, Micros::from_millis(2));
//! let angle = shaft.feedback().total_angle;
//! assert_eq!(angle.microdegrees(), -8 * 360_000_000 / (8192 * 36));
//! ```

use rc10_app::angle::{degrees_within_turn, nearest_movement};
use rc10_app::{Direction, Gear, Rpm, TotalAngle};
use rc10_time::Micros;

use crate::feedback::Feedback;

/// Microdegrees in a turn.
pub(crate) const TURN: i32 = 360_000_000;

/// Readings this close together (µs) are less than half a turn apart: no rotor makes 20,700 rpm.
const CERTAIN_MICROS: u64 = 1_300;
/// Speed (rpm) times time (µs) of 0.45 rotor turns: beyond it turns between readings are uncertain.
const CERTAIN_RPM_MICROS: f32 = 27e6;
/// Nor are they after such a silence, whatever the speed was before and after.
const LONG_SILENCE: Micros = Micros::from_millis(100);

/// The time of measurement of a shaft that was never measured.
const NEVER: Micros = Micros::new(1 << 63);

/// Counts the turns of an output shaft.
///
/// The count stays exact: the part of a microdegree that a step leaves over is carried on.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Shaft {
    /// Microdegrees of the output per step, with the direction: whole ones, and `part / divisor`.
    whole: i32,
    part: i32,
    divisor: i32,
    /// The most steps at once that 32 bits hold, and that move the output by less than a turn.
    most: u32,
    most_twice: u32,
    /// Steps in a turn of the sensor, and in half of one.
    steps_per_turn: i32,
    half_turn: i32,
    /// Turns of the output per turn of the sensor, with the direction.
    ratio: f32,
    /// The last reading of the encoder, where it starts over every turn.
    reading: i32,
    /// The remainder of the last steps, in shares of `divisor`.
    rest: i32,
    speed: Rpm,
    /// The angle from the zero: whole turns, and 0 ..< 360,000,000 microdegrees.
    turns: i32,
    phase: i32,
    /// The time of the last measurement; far away before the first time.
    at: Micros,
    gaps: u32,
}

impl Shaft {
    /// A sensor of `steps_per_turn` (1 ..= 2³¹ - 1) steps in front of a gearbox, and the direction
    /// in which the output counts. A sensor at the output shaft has [`Gear::DIRECT`].
    pub const fn new(steps_per_turn: u32, gear: Gear, direction: Direction) -> Self {
        let steps = match steps_per_turn {
            0 => 1,
            most if most > i32::MAX as u32 => i32::MAX,
            steps => steps.cast_signed(),
        };
        let mut microdegrees = TURN as i64 * gear.output_turns() as i64;
        let mut divisor = steps as i64 * gear.rotor_turns() as i64;
        let common = greatest_common_divisor(microdegrees, divisor);
        (microdegrees, divisor) = (microdegrees / common, divisor / common);
        // No sensor that is built comes near.
        while divisor > i32::MAX as i64 {
            (microdegrees, divisor) = (microdegrees >> 1, divisor >> 1);
        }
        let sign = direction.sign();
        // Nor has any a step of five turns.
        let whole = if microdegrees / divisor > i32::MAX as i64 {
            i32::MAX as i64
        } else {
            microdegrees / divisor
        };
        let part = microdegrees % divisor;
        // Of one step, rounded up.
        let in_turn = TURN as i64 / (whole + 1);
        let in_32_bits = (i32::MAX as i64 - divisor) / (part + 1);
        let most = if in_turn < in_32_bits { in_turn } else { in_32_bits };
        #[expect(clippy::cast_possible_truncation, reason = "checked")]
        Self {
            whole: whole as i32 * sign as i32,
            part: part as i32 * sign as i32,
            divisor: divisor as i32,
            most: most as u32,
            most_twice: 2 * most as u32,
            steps_per_turn: steps,
            half_turn: steps / 2,
            ratio: sign as f32 / gear.ratio(),
            reading: 0,
            rest: 0,
            speed: Rpm::ZERO,
            turns: 0,
            phase: 0,
            at: NEVER,
            gaps: 0,
        }
    }

    /// The time and the speed of the last measurement: for [`bridge`](Self::bridge).
    pub const fn before(&self) -> (Micros, Rpm) {
        (self.at, self.speed)
    }

    /// Whether anything was measured.
    pub const fn is_known(&self) -> bool {
        self.at.get() < NEVER.get()
    }

    /// Takes the reading of an encoder of one turn (0 ..< `steps_per_turn`), and the rotor's speed.
    ///
    /// After a silence the speeds before and after say the likeliest turns, and the gap is counted.
    pub fn follow(&mut self, reading: i32, sensor_rpm: f32, at: Micros) {
        let step = self.shorter_way(reading.wrapping_sub(self.reading));
        self.reading = reading;
        let before = (self.at, self.speed);
        self.measure(sensor_rpm, at);
        // Also for the first reading.
        if at.get().wrapping_sub(before.0.get()) < CERTAIN_MICROS {
            self.move_by(step);
        } else {
            self.follow_after_silence(step, before);
        }
    }

    /// A step from one reading to the next, the shorter way round.
    const fn shorter_way(&self, step: i32) -> i32 {
        let Self { steps_per_turn, half_turn, .. } = *self;
        if step.wrapping_add(half_turn).cast_unsigned() < steps_per_turn.cast_unsigned() {
            step
        } else if step < 0 {
            step.wrapping_add(steps_per_turn)
        } else {
            step.wrapping_sub(steps_per_turn)
        }
    }

    /// The same after a silence; `before` is when and how fast it was measured before.
    #[inline(never)] // A division of 64 bits that the usual reading does not need.
    fn follow_after_silence(&mut self, step: i32, before: (Micros, Rpm)) {
        let (last, speed) = before;
        let silence = self.at.since(last);
        let is_short = last != NEVER && silence <= LONG_SILENCE;
        let fastest = self.speed.get().abs().max(speed.get().abs());
        #[expect(clippy::cast_possible_truncation, reason = "asked for short ones only")]
        let turned = fastest * silence.get() as u32 as f32;
        if is_short && turned <= CERTAIN_RPM_MICROS * self.ratio.abs() {
            self.move_by(step);
        } else if last == NEVER {
            self.start(self.reading.into());
        } else {
            self.bridge(step.into(), before);
        }
    }

    /// The sensor moved by `step` and unknown whole turns since `before` (time, speed); the mean
    /// speed of `before` and the newest [measurement](Self::measure) says how many. Counts a gap.
    pub fn bridge(&mut self, step: i64, before: (Micros, Rpm)) {
        let (last, speed) = before;
        let mean = 0.5 * (speed.get() + self.speed.get()) / self.ratio;
        let turns = mean * (self.at.since(last).get() as f32 * (1.0 / 60e6));
        #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
        let expected = (turns * self.steps_per_turn as f32) as i64;
        let turn = self.steps_per_turn.into();
        self.count_gap();
        self.jump_by(nearest_movement(step % turn, expected, turn));
    }

    /// The first position of a sensor that knows where it is: `steps` from its own zero.
    pub fn start(&mut self, steps: i64) {
        self.rest = 0;
        self.place(TotalAngle::ZERO);
        self.jump_by(steps);
    }

    /// The sensor moved by `steps`.
    pub fn move_by(&mut self, steps: i32) {
        let Self { whole, part, divisor, most, most_twice, .. } = *self;
        if steps.cast_unsigned().wrapping_add(most) > most_twice || divisor <= 0 {
            return self.jump_by(steps.into());
        }
        let over = steps.wrapping_mul(part).wrapping_add(self.rest);
        let carry = over / divisor;
        self.rest = over.wrapping_sub(carry.wrapping_mul(divisor));
        let moved = steps.wrapping_mul(whole).wrapping_add(carry);
        self.phase = self.phase.wrapping_add(moved);
        if self.phase.cast_unsigned() >= TURN.cast_unsigned() {
            self.wrap();
        }
    }

    /// Once in a turn of the output.
    #[cold] // In one of many ticks.
    const fn wrap(&mut self) {
        let turn = if self.phase < 0 { -1 } else { 1 };
        self.turns = self.turns.wrapping_add(turn);
        self.phase = self.phase.wrapping_sub(turn * TURN);
    }

    /// The same for any number of steps.
    #[cold] // Arithmetic of 128 bits that only jumps need.
    pub fn jump_by(&mut self, steps: i64) {
        let over = i128::from(steps) * i128::from(self.part) + i128::from(self.rest);
        let carry = over / i128::from(self.divisor);
        #[expect(clippy::cast_possible_truncation, reason = "below the divisor; up to 2^64")]
        let (rest, carry) = ((over - carry * i128::from(self.divisor)) as i32, carry as i64);
        self.rest = rest;
        let moved = steps.saturating_mul(self.whole.into()).saturating_add(carry);
        self.place(self.angle().plus(TotalAngle::from_microdegrees(moved)));
    }

    /// The shaft is there, however it came there.
    pub fn place(&mut self, angle: TotalAngle) {
        let (microdegrees, turn) = (angle.microdegrees(), i64::from(TURN));
        let turns = microdegrees.div_euclid(turn).clamp(i32::MIN.into(), i32::MAX.into());
        #[expect(clippy::cast_possible_truncation, reason = "clamped; less than a turn")]
        let (turns, phase) = (turns as i32, microdegrees.rem_euclid(turn) as i32);
        (self.turns, self.phase) = (turns, phase);
    }

    /// The speed at `at`, from that of the sensor.
    pub fn measure(&mut self, sensor_rpm: f32, at: Micros) {
        self.speed = Rpm::new(sensor_rpm * self.ratio);
        self.at = at;
    }

    /// The number of turns is an estimate from now on.
    pub const fn count_gap(&mut self) {
        self.gaps = self.gaps.saturating_add(1);
    }

    /// The angle now is zero from now on; what it was until now.
    pub const fn set_zero(&mut self) -> TotalAngle {
        let zero = self.angle();
        (self.rest, self.turns, self.phase) = (0, 0, 0);
        zero
    }

    /// The angle of many turns from the zero.
    pub const fn angle(&self) -> TotalAngle {
        let turns = self.turns as i64 * TURN as i64;
        TotalAngle::from_microdegrees(turns + self.phase as i64)
    }

    /// The angle within the turn: 0 ..< 360,000,000 microdegrees.
    pub const fn phase(&self) -> i32 {
        self.phase
    }

    /// The speed of the output.
    pub const fn speed(&self) -> Rpm {
        self.speed
    }

    /// The time of the last measurement.
    pub const fn at(&self) -> Micros {
        self.at
    }

    /// 1, or -1 if the output counts the other way than the sensor.
    pub const fn sign(&self) -> f32 {
        if self.ratio < 0.0 { -1.0 } else { 1.0 }
    }

    /// The sensor's speed (rpm) at a speed of the output, and its angle at one of the output.
    pub const fn to_sensor(&self, output: f32) -> f32 {
        output / self.ratio
    }

    /// Time, speed, angles and gaps; nothing before anything was measured.
    pub const fn feedback(&self) -> Feedback {
        if !self.is_known() {
            return Feedback::NEW;
        }
        let angle = degrees_within_turn(self.phase);
        let mut feedback = Feedback::new(self.at, self.speed, angle, self.angle());
        feedback.turn_gaps = self.gaps;
        feedback
    }
}

/// A gearbox that turns its rotor so often for so many turns of the output; none for zero turns.
pub(crate) const fn gear(rotor: u32, output: u32) -> Gear {
    match Gear::new(rotor, output) {
        Some(gear) => gear,
        None => Gear::DIRECT,
    }
}

const fn greatest_common_divisor(mut a: i64, mut b: i64) -> i64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests;
