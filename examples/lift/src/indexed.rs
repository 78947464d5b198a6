use rc10::app::mechanism::{Feeder, Homing, HomingStatus, Measured, MotorCommand, Phase, Stage};
use rc10::prelude::*;

use crate::table::{FEEDER, INDEXING, INDEXING_FORWARD};

/// A feeder whose pockets stand where its index says.
///
/// [`begin`](Self::begin) it whenever the motor was not driven. It homes then, unless it still knows its
/// zero: unless the motor's turns had to be estimated in between. So does it if that happens while it
/// feeds. Pieces that are asked for meanwhile are fed afterwards.
#[derive(Default)]
pub struct IndexedFeeder {
    /// The feeder, which counts and gets requests.
    pub feeder: Feeder,
    state: State,
}

#[derive(Default)]
enum State {
    #[default]
    Idle,
    /// The motor was there before it backed off.
    Homing(Homing, TotalAngle),
    /// The number of gaps in the motor's turns when its zero was found.
    Ready(u32),
    /// Why.
    Failed(Stage),
}

impl IndexedFeeder {
    /// After a pause. A piece that was begun is finished, and no other is fed that was asked for before.
    pub fn begin(&mut self, motor: &Measured) {
        self.feeder.reset();
        self.feeder.stop();
        if !self.is_ready(motor) {
            self.state = State::Homing(Homing::new(), motor.angle);
        }
    }

    fn is_ready(&self, motor: &Measured) -> bool {
        matches!(self.state, State::Ready(gaps) if gaps == motor.gaps)
    }

    /// One step: the command of its motor. `closed`: the index is at the marker.
    pub fn step(&mut self, motor: &Measured, closed: bool, dt: Seconds) -> MotorCommand {
        if self.is_ready(motor) {
            return self.feeder.update(&FEEDER, motor, dt);
        }
        if let State::Ready(_) = self.state {
            self.state = State::Homing(Homing::new(), motor.angle);
        }
        let State::Homing(homing, from) = &mut self.state else { return MotorCommand::Coast };
        let command = homing.update(&INDEXING, motor, closed, dt);
        // A contact that stays closed, as that of a pinched wire, must not feed a turn of pieces.
        let feeds = motor.angle.minus(*from) > INDEXING_FORWARD;
        match homing.status() {
            HomingStatus::Running(Phase::First) => {
                *from = motor.angle;
                command
            }
            HomingStatus::Running(_) if !feeds => command,
            HomingStatus::Done { zero } => {
                self.feeder.align(&FEEDER, zero);
                self.state = State::Ready(motor.gaps);
                command
            }
            HomingStatus::Running(_) | HomingStatus::Failed(_) => {
                let stage = homing.stage();
                let why = if stage.gave_up() { stage } else { Stage::NeverOpened };
                self.state = State::Failed(why);
                MotorCommand::Coast
            }
        }
    }

    /// What it does. One that gave up coasts until it is begun again.
    pub fn stage(&self) -> Stage {
        match &self.state {
            State::Idle => Stage::NotBegun,
            State::Homing(homing, _) => homing.stage(),
            State::Ready(_) => self.feeder.stage(),
            State::Failed(why) => *why,
        }
    }
}
