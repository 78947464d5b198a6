//! The mechanisms on the base: an arm, a turret and a flywheel.

use rc10::app::mechanism::Stage;
use rc10::app::profile::synchronise;
use rc10::app::{AngleLimits, AngleProfile};
use rc10::motor::Motion;
use rc10::prelude::*;

use crate::Shared;
use crate::table::{
    ARM_ENCODER, ARM_LIMITS, ARM_RANGE, ARM_RATE, Name, REST, SHOOTING, TURRET_LIMITS, TURRET_RATE,
};

/// Mechanisms that are driven, while the robot is armed.
pub struct Mechanisms {
    arm: AngleProfile,
    /// Lowest and highest angle of the arm; `None` where its encoder says that it cannot be there, and it coasts.
    range: Option<[TotalAngle; 2]>,
    /// The arm's newest stick.
    raised: f32,
    turret: AngleProfile,
    /// The turret's newest dial.
    dialled: f32,
    /// The flywheel turns.
    shoots: bool,
}

impl Mechanisms {
    /// From where everything is; the arm goes to where it may be.
    #[must_use]
    pub fn new(shared: &Shared<'_>) -> Self {
        let angle = |name| shared.motor(name).status().feedback.total_angle;
        let here = angle(Name::Arm);
        let zero = ARM_ENCODER.zero(here);
        shared.own.arm.tell(zero.map_or_else(Stage::from, |_| Stage::Ready));
        let range = zero.ok().map(|zero| ARM_RANGE.map(|end| end.plus(zero)));
        let mut arm = AngleProfile::at(here);
        if let Some([lowest, highest]) = range {
            let _ = arm.set_target(&ARM_LIMITS, here.clamp(lowest, highest), Rpm::ZERO);
        }
        let turret = AngleProfile::at(angle(Name::Turret));
        Self { arm, range, raised: 0.0, turret, dialled: 0.0, shoots: false }
    }

    /// Drives them for the coming `dt`.
    pub fn step(&mut self, shared: &Shared<'_>, remote: &Remote, dt: Seconds) {
        // A limit is refused only if it is not above zero and finite: then the profile goes on as it was.
        self.raise(moved(remote.right.y));
        self.turn(moved(remote.dial));
        let shoots = remote.left_switch == Switch::Up;
        if core::mem::replace(&mut self.shoots, shoots) && !shoots {
            self.stow();
        }
        for (name, profile) in [(Name::Arm, &mut self.arm), (Name::Turret, &mut self.turret)] {
            let setpoint = profile.setpoint();
            profile.update(dt);
            let motion = Motion::from(setpoint);
            let is_lost = name == Name::Arm && self.range.is_none();
            shared.command(name, if is_lost { Target::Coast } else { Target::Motion(motion) });
        }
        let flywheel = if shoots { Target::Speed(SHOOTING) } else { Target::Coast };
        shared.command(Name::Flywheel, flywheel);
    }

    /// The arm to its bottom and the turret ahead, so that both arrive together.
    fn stow(&mut self) {
        let ahead = whole_turns(self.turret.setpoint().angle);
        if let Some([lowest, _]) = self.range {
            let _ = self.arm.set_target(&ARM_LIMITS, lowest, Rpm::ZERO);
        }
        let _ = self.turret.set_target(&TURRET_LIMITS, ahead, Rpm::ZERO);
        synchronise(&mut [self.arm.as_mut(), self.turret.as_mut()]);
    }

    /// Away, the stick raises the arm: to the top, as fast as it is moved.
    fn raise(&mut self, stick: f32) {
        if let Some(range) = self.range
            && (stick - self.raised).abs() > 0.0
        {
            self.raised = stick;
            let limits = AngleLimits { velocity: ARM_RATE * stick.abs(), ..ARM_LIMITS };
            let end = range[usize::from(stick > 0.0)];
            let _ = match stick.abs() > 0.0 {
                true => self.arm.set_target(&limits, end, Rpm::ZERO),
                false => self.arm.set_speed(&ARM_LIMITS, Rpm::ZERO),
            };
        }
    }

    /// Moved, the dial turns the turret.
    fn turn(&mut self, dial: f32) {
        if (dial - self.dialled).abs() > 0.0 {
            self.dialled = dial;
            let _ = self.turret.set_speed(&TURRET_LIMITS, TURRET_RATE * -dial);
        }
    }
}

/// A stick that is let go does not stand still at zero.
fn moved(stick: f32) -> f32 {
    if stick.abs() < REST { 0.0 } else { stick }
}

/// The nearest whole number of turns.
fn whole_turns(angle: TotalAngle) -> TotalAngle {
    let turn = TotalAngle::TURN.microdegrees();
    let turns = (angle.microdegrees() + turn / 2).div_euclid(turn);
    TotalAngle::from_microdegrees(turns * turn)
}
