//! A reversed motor, seen so that the same numbers move the shaft the same way as a forward one's.

use rc10_app::{Degrees, TotalAngle};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{Feedback, Impedance, Motion, MotorStatus, Target};

/// Turns the numbers of a reversed motor round; those of a forward one stay.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mirror(pub(crate) Direction);

impl Mirror {
    const fn is_plain(self) -> bool {
        matches!(self.0, Direction::Forward)
    }

    /// The target that moves the motor's shaft as this one moves a forward motor's.
    pub(crate) fn target(self, target: Target) -> Target {
        if self.is_plain() {
            return target;
        }
        match target {
            Target::Current(current) => Target::Current(-current),
            Target::Duty(share) => Target::Duty(-share),
            Target::Speed(speed) => Target::Speed(-speed),
            Target::Angle(angle) => Target::Angle(-angle),
            Target::TotalAngle(angle) => Target::TotalAngle(negated(angle)),
            Target::Torque(torque) => Target::Torque(-torque),
            Target::Impedance(Impedance { angle, speed, torque, kp, kd }) => {
                Target::Impedance(Impedance {
                    angle: -angle,
                    speed: -speed,
                    torque: -torque,
                    kp,
                    kd,
                })
            }
            Target::Motion(Motion { angle, speed, acceleration, inertia, effort }) => {
                Target::Motion(Motion {
                    angle: angle.map(negated),
                    speed: -speed,
                    acceleration: -acceleration,
                    inertia: -inertia,
                    effort: -effort,
                })
            }
            // What brakes has no sign.
            other => other,
        }
    }

    pub(crate) fn status(self, status: MotorStatus) -> MotorStatus {
        if self.is_plain() {
            return status;
        }
        let mut mirrored = status;
        mirrored.target = self.target(status.target);
        mirrored.feedback = feedback(status.feedback);
        mirrored
    }
}

const fn negated(angle: TotalAngle) -> TotalAngle {
    TotalAngle::ZERO.minus(angle)
}

fn feedback(told: Feedback) -> Feedback {
    let mut mirrored = told;
    mirrored.speed = -told.speed;
    mirrored.total_angle = negated(told.total_angle);
    mirrored.angle = match told.angle.get() {
        // Just above zero the difference is 360 degrees to a float.
        degrees if degrees > 0.0 && degrees < 360.0 => Degrees::new((360.0 - degrees) % 360.0),
        // Zero; or what no angle may be, which a rule looks for.
        _ => told.angle,
    };
    if let Some(current) = told.current() {
        mirrored = mirrored.with_current(-current);
    }
    if let Some(torque) = told.torque() {
        mirrored = mirrored.with_torque(-torque);
    }
    mirrored
}
