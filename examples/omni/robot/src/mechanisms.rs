//! What is on the base: an arm, a turret and a flywheel.

use rc10_app::{AngleProfile, ProfileLimits, Rpm, Seconds, TotalAngle};
use rc10_module::remote::{Remote, Switch};
use rc10_motor::{Motion, Target};

use crate::Shared;
use crate::table::{ARM_LIMITS, ARM_RANGE, ARM_RATE, Name, SHOOTING, TURRET_LIMITS, TURRET_RATE};

/// Mechanisms that are driven, while the robot is armed.
pub struct Mechanisms {
    arm: AngleProfile,
    /// Its bottom and its top.
    range: [TotalAngle; 2],
    /// The arm's newest stick.
    raised: f32,
    turret: AngleProfile,
}

impl Mechanisms {
    /// From where everything is; the arm goes to where it may be.
    #[must_use]
    pub fn new(shared: &Shared<'_>) -> Self {
        let angle = |name| shared.motor(name).status().feedback.total_angle;
        let here = angle(Name::Arm);
        // The turns that are counted with it: an arm below the level has nearly turned once.
        let turn = TotalAngle::TURN.microdegrees();
        let turns = (here.microdegrees() + turn / 2).div_euclid(turn);
        let level = TotalAngle::from_microdegrees(turns * turn);
        let range = ARM_RANGE.map(|end| level.plus(TotalAngle::from_degrees(end)));
        let mut arm = AngleProfile::at(here);
        let _ = arm.set_target(&ARM_LIMITS, here.clamp(range[0], range[1]), Rpm::ZERO);
        let turret = AngleProfile::at(angle(Name::Turret));
        Self { arm, range, raised: 0.0, turret }
    }

    /// Drives them for the coming `dt`.
    pub fn step(&mut self, shared: &Shared<'_>, remote: &Remote, dt: Seconds) {
        // A limit is refused only if it is not above zero and finite: then the profile goes on as it was.
        self.raise(remote.right.y);
        let _ = self.turret.set_speed(&TURRET_LIMITS, Rpm::new(-remote.dial * TURRET_RATE.get()));
        for (name, profile) in [(Name::Arm, &mut self.arm), (Name::Turret, &mut self.turret)] {
            let setpoint = profile.setpoint();
            profile.update(dt);
            let motion = Motion::from(setpoint);
            shared.command(name, Target::Motion(motion));
        }
        let flywheel = match remote.left_switch {
            Switch::Up => Target::Speed(SHOOTING),
            _ => Target::Coast,
        };
        shared.command(Name::Flywheel, flywheel);
    }

    /// Away, the stick raises the arm: to the top, as fast as it is moved.
    fn raise(&mut self, stick: f32) {
        if (stick - self.raised).abs() > 0.0 {
            self.raised = stick;
            let limits = ProfileLimits { velocity: stick.abs() * ARM_RATE.get(), ..ARM_LIMITS };
            let end = self.range[usize::from(stick > 0.0)];
            let _ = match stick.abs() > 0.0 {
                true => self.arm.set_target(&limits, end, Rpm::ZERO),
                false => self.arm.set_speed(&ARM_LIMITS, Rpm::ZERO),
            };
        }
    }
}
