use rc10::app::mechanism::{Homing, HomingStatus, Measured, MotorCommand, Phase, Stage};
use rc10::prelude::*;

use crate::table::{HOIST_HOMING, HOIST_RANGE, HOIST_RISE, HOIST_SPEED};

/// A hoist on one motor, with a switch at its bottom.
///
/// [`begin`](Self::begin) it whenever the motor was not driven. It homes then, unless it still knows its
/// bottom: unless the motor's turns had to be estimated in between.
#[derive(Default)]
pub struct Hoist(State);

#[derive(Default)]
enum State {
    #[default]
    Idle,
    /// It began there.
    Homing(Homing, TotalAngle),
    /// The motor's angle at the bottom, and the number of gaps in its turns when that was found.
    Ready(TotalAngle, u32),
    /// Why.
    Failed(Stage),
}

impl Hoist {
    /// After a pause.
    pub fn begin(&mut self, motor: &Measured) {
        if self.height(motor).is_none() {
            self.0 = State::Homing(Homing::new(), motor.angle);
        }
    }

    /// One step: the command of its motor, up or down at this share of its speed. `closed`: its switch is
    /// pressed.
    pub fn step(
        &mut self,
        share: f32,
        motor: &Measured,
        closed: bool,
        dt: Seconds,
    ) -> MotorCommand {
        if let Some(height) = self.height(motor) {
            return HOIST_RANGE
                .limit(MotorCommand::Speed(HOIST_SPEED * share), Some(height))
                .command;
        }
        let (homing, began) = match &mut self.0 {
            State::Homing(homing, began) => (homing, *began),
            State::Ready(..) => {
                self.begin(motor);
                return MotorCommand::Coast;
            }
            State::Idle | State::Failed(_) => return MotorCommand::STOP,
        };
        let command = homing.update(&HOIST_HOMING, motor, closed, dt);
        match homing.status() {
            HomingStatus::Done { zero } => self.0 = State::Ready(zero, motor.gaps),
            // A switch that looks as if it were pressed, as with a torn wire, must not drive it to its top.
            HomingStatus::Running(Phase::BackOff) if motor.angle.minus(began) > HOIST_RISE => {
                self.0 = State::Failed(Stage::NeverOpened);
                return MotorCommand::Coast;
            }
            HomingStatus::Running(_) | HomingStatus::Failed(_) => {}
        }
        command
    }

    /// Its height as the angle of its shaft above the bottom, once that is known.
    #[must_use]
    pub fn height(&self, motor: &Measured) -> Option<TotalAngle> {
        match self.0 {
            State::Ready(zero, gaps) if gaps == motor.gaps => Some(motor.angle.minus(zero)),
            _ => None,
        }
    }

    /// What it does. One that gave up stands until it is begun again.
    pub fn stage(&self) -> Stage {
        match &self.0 {
            State::Idle => Stage::NotBegun,
            State::Homing(homing, _) => homing.stage(),
            State::Ready(..) => Stage::Ready,
            State::Failed(why) => *why,
        }
    }
}
