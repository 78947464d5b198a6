use rc10_app::Seconds;
use rc10_app::mechanism::{Command, Feeder, Homing, HomingStatus, Measured};

use crate::Stage;
use crate::table::{FEEDER, INDEXING};

/// A feeder whose pockets stand where its index says.
///
/// [`begin`](Self::begin) it whenever the motor was not driven. It homes then, unless it still knows its
/// zero: unless the motor's turns had to be estimated in between. So does it if that happens while it
/// feeds. Pieces that are asked for meanwhile are fed afterwards.
#[derive(Default)]
pub struct IndexedFeeder {
    /// What it counts, and is asked for.
    pub feeder: Feeder,
    state: State,
}

#[derive(Default)]
enum State {
    #[default]
    Idle,
    Homing(Homing),
    /// With so many gaps in its turns.
    Ready(u32),
}

impl IndexedFeeder {
    /// After a pause. A piece that was begun is finished, and no other is fed that was asked for before.
    pub fn begin(&mut self, motor: &Measured) {
        self.feeder.reset();
        self.feeder.stop();
        if !self.is_ready(motor) {
            self.state = State::Homing(Homing::new());
        }
    }

    fn is_ready(&self, motor: &Measured) -> bool {
        matches!(self.state, State::Ready(gaps) if gaps == motor.gaps)
    }

    /// One step: the command of its motor. `closed`: the index is at the marker.
    pub fn step(&mut self, motor: &Measured, closed: bool, dt: Seconds) -> Command {
        if self.is_ready(motor) {
            return self.feeder.update(&FEEDER, motor, dt);
        }
        if let State::Ready(_) = self.state {
            self.state = State::Homing(Homing::new());
        }
        let State::Homing(homing) = &mut self.state else { return Command::Coast };
        let command = homing.update(&INDEXING, motor, closed, dt);
        match homing.status() {
            HomingStatus::Running(_) => command,
            HomingStatus::Failed(_) => Command::Coast,
            HomingStatus::Done { zero } => {
                self.feeder.align(&FEEDER, zero);
                self.state = State::Ready(motor.gaps);
                command
            }
        }
    }

    /// What it does.
    pub const fn stage(&self) -> Stage {
        match &self.state {
            State::Idle => Stage::Idle,
            State::Homing(homing) if matches!(homing.status(), HomingStatus::Failed(_)) => {
                Stage::Failed
            }
            State::Homing(_) => Stage::Homing,
            State::Ready(_) => Stage::Ready,
        }
    }
}
