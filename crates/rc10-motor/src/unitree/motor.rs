use rc10_app::{Cascade, Celsius, Degrees, Direction, NewtonMetres, Rpm};
use rc10_time::Micros;

use super::config::servo;
use super::wire::{ANGLE_STEPS, GEAR, RawMotion, RotorScale, SPEED_STEPS};
use crate::feedback::{Fault, Feedback};
use crate::motor::Link;
use crate::servo::{Servo, Spring};
use crate::shaft::Shaft;

/// A motor with gearbox and controller on any link: reports to feedback, targets to motions.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Actuator {
    pub(super) shaft: Shaft,
    pub(super) servo: Servo,
    /// The newest motion of the rotor, as it stood on the wire.
    reported: RawMotion,
    temperature: Celsius,
    pub(super) fault: Option<Fault>,
}

const HALF_TURN: u32 = ANGLE_STEPS / 2;
/// Speed of the rotor in rpm per step.
#[expect(clippy::cast_possible_truncation, reason = "exact")]
const RPM_PER_STEP: f32 = (60.0 / SPEED_STEPS) as f32;

const OUTPUT: RotorScale = RotorScale::OUTPUT;

impl Actuator {
    pub(super) const fn new(direction: Direction, cascade: Cascade) -> Self {
        Self {
            shaft: Shaft::new(ANGLE_STEPS, GEAR, direction),
            servo: servo(cascade),
            reported: RawMotion { torque: 0, speed: 0, angle: 0 },
            temperature: Celsius::ZERO,
            fault: None,
        }
    }

    pub(super) fn report(
        &mut self,
        motion: RawMotion,
        temperature: Celsius,
        at: Micros,
        link: Link,
    ) {
        let rpm = f32::from(motion.speed) * RPM_PER_STEP;
        let last = self.reported.angle;
        // Further than half a turn in a moment moves nothing but a motor that has restarted.
        if link == Link::Online && motion.angle.abs_diff(last) <= HALF_TURN {
            self.shaft.move_by(motion.angle.wrapping_sub(last));
            self.shaft.measure(rpm, at);
        } else {
            self.resume(motion.angle, rpm, at);
        }
        (self.reported, self.temperature) = (motion, temperature);
    }

    /// The first report, or one after a silence: a motor without power counts from its angle again.
    fn resume(&mut self, angle: i32, rpm: f32, at: Micros) {
        let step = i64::from(angle) - i64::from(self.reported.angle);
        let (was_known, before) = (self.shaft.is_known(), self.shaft.before());
        self.servo.rest();
        self.shaft.measure(rpm, at);
        if !was_known {
            self.shaft.start(angle.into());
        } else if angle.unsigned_abs() > ANGLE_STEPS {
            // Just switched on it is within its first turn: this one has counted on.
            self.shaft.jump_by(step);
        } else {
            self.shaft.bridge(step, before);
        }
    }

    pub(super) fn feedback(&self) -> Feedback {
        let feedback = self.shaft.feedback();
        if !self.shaft.is_known() {
            return feedback;
        }
        let torque = OUTPUT.torque(self.reported.torque).get() * self.shaft.sign();
        feedback
            .with_torque(NewtonMetres::new(torque))
            .with_temperature(self.temperature)
            .with_effort(self.servo.effort())
    }

    /// The motion for a torque (N m), with angle and speed reported last: gains add nothing.
    pub(super) fn push(&self, torque: f32) -> RawMotion {
        let torque = NewtonMetres::new(torque * self.shaft.sign());
        RawMotion { torque: OUTPUT.raw_torque(torque), ..self.reported }
    }

    /// The motion for a spring, to go with its stiffness and its damping.
    pub(super) fn pull(&self, spring: &Spring) -> RawMotion {
        let sign = self.shaft.sign();
        let way = Degrees::new(spring.way.get() * sign);
        RawMotion {
            angle: OUTPUT.raw_angle_from(self.reported.angle, way),
            speed: OUTPUT.raw_speed(Rpm::new(spring.speed.get() * sign)),
            ..self.push(spring.torque)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::CASCADE;
    use super::*;

    const STEPS: i32 = ANGLE_STEPS.cast_signed();

    fn report(actuator: &mut Actuator, angle: i32, speed: i16, millis: u64, link: Link) {
        let motion = RawMotion { torque: 0, speed, angle };
        actuator.report(motion, Celsius::ZERO, Micros::from_millis(millis), link);
    }

    /// Where it is, in steps of the rotor, and how often that was estimated.
    fn place(actuator: &Actuator) -> (i64, u32) {
        let feedback = actuator.feedback();
        (feedback.total_angle.counts_at(OUTPUT.counts_per_turn()), feedback.turn_gaps)
    }

    #[test]
    fn turns_go_on_after_a_silence() {
        for (direction, sign) in [(Direction::Forward, 1), (Direction::Reversed, -1)] {
            let mut motor = Actuator::new(direction, CASCADE);
            report(&mut motor, 100 * STEPS + 100, 0, 1, Link::NeverSeen);
            assert_eq!(place(&motor), (sign * (100 * 32_768 + 100), 0));
            // The cable was out; it has counted on.
            report(&mut motor, 150 * STEPS, 0, 500, Link::Lost);
            assert_eq!(place(&motor), (sign * 150 * 32_768, 0));
            // The power was off: it knows where its rotor is, no more.
            report(&mut motor, 32_000, 0, 900, Link::Lost);
            assert_eq!(place(&motor), (sign * (150 * 32_768 - 768), 1));
            // It turns at two turns a second throughout.
            report(&mut motor, 32_100, 512, 901, Link::Online);
            report(&mut motor, 31_700, 512, 1401, Link::Lost);
            assert_eq!(place(&motor), (sign * (151 * 32_768 - 1068), 2));
        }
    }

    #[test]
    fn a_motor_that_restarts_in_a_blink_counts_on() {
        let mut motor = Actuator::new(Direction::Forward, CASCADE);
        report(&mut motor, 20 * STEPS, 0, 1, Link::NeverSeen);
        report(&mut motor, 100, 0, 4, Link::Online);
        assert_eq!(place(&motor), (20 * 32_768 + 100, 1));
    }

    #[test]
    fn a_spring_pulls_from_where_the_motor_counts_itself() {
        for (direction, sign) in [(Direction::Forward, 1), (Direction::Reversed, -1)] {
            let mut motor = Actuator::new(direction, CASCADE);
            report(&mut motor, 5000, 0, 1, Link::NeverSeen);
            let spring = Spring {
                way: Degrees::new(90.0),
                speed: Rpm::new(60.0),
                torque: 6.33,
                kp: 1.0,
                kd: 1.0,
            };
            let pull = motor.pull(&spring);
            assert_eq!(pull.angle, 5000 + sign * 51_855);
            assert_eq!((i32::from(pull.speed), i32::from(pull.torque)), (sign * 1620, sign * 256));
            assert_eq!(motor.push(0.0), motor.reported);
        }
    }
}
