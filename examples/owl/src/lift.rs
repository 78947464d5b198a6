//! The lift on one motor: it finds its bottom by a switch, and then goes to heights.

use rc10::app::AngleProfile;
use rc10::app::mechanism::{Homing, HomingStatus, Measured, Stage};
use rc10::prelude::*;

use crate::{HEIGHTS, HOMING, LIFT_LIMITS};

/// Begin a new one whenever the robot was not armed.
pub struct Lift {
    homing: Homing,
    /// The motor's angle at the bottom, and the way from there.
    known: Option<(TotalAngle, AngleProfile)>,
}

impl Lift {
    /// One that does not know its bottom.
    pub const fn new() -> Self {
        Self { homing: Homing::new(), known: None }
    }

    /// One step to a height, 0 to 1: the motor's target.
    pub fn step(&mut self, height: f32, motor: &Measured, closed: bool, dt: Seconds) -> Target {
        if let Some((zero, profile)) = &mut self.known {
            let travel = HEIGHTS.upper.minus(HEIGHTS.lower).degrees();
            let above = TotalAngle::try_from_degrees(travel * height.clamp(0.0, 1.0));
            let goal = HEIGHTS.lower.plus(above.unwrap_or_default()).plus(*zero);
            // The limits are checked, and the goal is finite.
            let _ = profile.set_target(&LIFT_LIMITS, goal, Rpm::ZERO);
            return Target::Motion(profile.update(dt).into());
        }
        let command = self.homing.update(&HOMING, motor, closed, dt);
        if let HomingStatus::Done { zero } = self.homing.status() {
            self.known = Some((zero, AngleProfile::at(motor.angle)));
        }
        command.into()
    }

    /// What it does.
    pub fn stage(&self) -> Stage {
        self.homing.stage()
    }

    /// Its height as the angle of its shaft above the switch, if that is known.
    pub fn height(&self, motor: &Measured) -> Option<TotalAngle> {
        self.known.as_ref().map(|(zero, _)| motor.angle.minus(*zero))
    }
}
