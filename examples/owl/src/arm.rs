//! The arm of two joints on absolute encoders: it knows where it is when it is armed, and carries its weight.

use rc10::app::AngleProfile;
use rc10::app::mechanism::{OutOfTravel, Stage};
use rc10::motor::Motion;
use rc10::prelude::*;

use crate::{ARM, JOINT_LIMITS, JOINT_TORQUE, JOINTS, Name, Own, Shared};

/// Its motors, in the order of [`JOINTS`].
const MOTORS: [Name; 2] = [Name::Shoulder, Name::Elbow];

/// Begin a new one whenever the robot was not armed: from where it is.
pub struct Arm {
    zeros: [TotalAngle; 2],
    joints: [AngleProfile; 2],
}

impl Arm {
    /// An arm that stays where it is.
    ///
    /// # Errors
    /// [`OutOfTravel`]: an encoder says that a joint is where it cannot be.
    pub fn new(shared: &Shared<'_>) -> Result<Self, OutOfTravel> {
        let [upper, fore] = MOTORS.map(|name| shared.motor(name).status().feedback.total_angle);
        let Own { shoulder_level, elbow_level, .. } = &shared.own;
        let [first, second] = [shoulder_level, elbow_level].map(|it| Degrees::new(it.get()));
        let zeros =
            [JOINTS[0].with_level(first).zero(upper)?, JOINTS[1].with_level(second).zero(fore)?];
        Ok(Self { zeros, joints: [upper, fore].map(AngleProfile::at) })
    }

    /// One step, each joint at this share of its speed.
    pub fn step(&mut self, shared: &Shared<'_>, shares: [f32; 2], dt: Seconds) {
        let mut angles = [Degrees::ZERO; 2];
        for at in 0..2 {
            let (joint, profile) = (&JOINTS[at], &mut self.joints[at]);
            let end = if shares[at] > 0.0 { joint.upper } else { joint.lower };
            let speed = JOINT_LIMITS.velocity * shares[at].abs();
            // The limits are checked, and a share of zero stops it.
            let _ = if shares[at] == 0.0 {
                profile.set_speed(&JOINT_LIMITS, Rpm::ZERO)
            } else {
                let limits = rc10::app::AngleLimits { velocity: speed, ..JOINT_LIMITS };
                profile.set_target(&limits, end.plus(self.zeros[at]), Rpm::ZERO)
            };
            angles[at] = profile.update(dt).angle.minus(self.zeros[at]).degrees();
        }
        let torques = ARM.torques(angles);
        for at in 0..2 {
            let effort = torques[at].get() / JOINT_TORQUE;
            let motion = Motion { effort, ..self.joints[at].setpoint().into() };
            shared.command(MOTORS[at], Target::Motion(motion));
        }
        shared.own.arm.tell(Stage::Ready);
        shared.own.shoulder.set(angles[0].get());
        shared.own.elbow.set(angles[1].get());
    }
}

#[cfg(test)]
mod tests {
    use rc10::tasks::live::Parameter;

    use super::*;
    use crate::Ports;

    /// The motors count from zero here.
    #[test]
    fn the_levels_are_parameters() {
        let ports = Ports::new();
        let mut shared = Shared::new(&ports);
        let level = |level| Parameter::new("level", "deg", level, [-360.0, 360.0]);
        for (shoulder, elbow, is_there) in
            [(0.0, 200.0, false), (0.0, 90.0, true), (10.0, 90.0, false), (-60.0, 90.0, true)]
        {
            shared.own.shoulder_level = level(shoulder);
            shared.own.elbow_level = level(elbow);
            assert_eq!(Arm::new(&shared).is_ok(), is_there, "{shoulder} {elbow}");
        }
    }
}
