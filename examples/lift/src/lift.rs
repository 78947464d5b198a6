use core::array::from_fn;
use rc10::prelude::*;

use rc10::app::mechanism::{
    Axes, AxesFailure, AxesHoming, AxesHomingFailure, AxesHomingStatus, Measured, MotorCommand,
    Stage,
};
use rc10::app::{AngleLimits, AngleProfile, AngleSetpoint, ConfigError};

use crate::table::{HOMING, LIFT_LIMITS, RANGE, TOGETHER};

/// Where the lift is to go.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Goal {
    /// To a stand.
    #[default]
    Stand,
    /// Up or down, at this share of its speed, -1 ..= 1, not further than its range.
    Move(f32),
    /// To a height, as the angle of the shafts above the bottom.
    Height(TotalAngle),
}

/// Two motors that lift one platform.
///
/// [`begin`](Self::begin) it whenever the motors were not driven. It homes then, unless it still knows
/// its bottom: unless a motor was lost in between, so that its turns had to be estimated; the lift is
/// too far from level; or something went wrong.
#[derive(Clone, Debug, Default)]
pub struct Lift(State);

#[derive(Clone, Debug, Default)]
enum State {
    #[default]
    Idle,
    Homing(AxesHoming<2>),
    Moving(Bottom, Axes<2>, AngleProfile),
}

/// Where the motors are when the lift stands on its bottom, while their turns are counted without
/// a gap.
#[derive(Clone, Copy, Debug)]
struct Bottom {
    zeros: [TotalAngle; 2],
    gaps: [u32; 2],
}

impl Bottom {
    fn is_known(&self, motors: &[Measured; 2]) -> bool {
        motors.map(|motor| motor.gaps) == self.gaps
    }

    fn above(&self, motors: &[Measured; 2]) -> [Measured; 2] {
        from_fn(|motor| motors[motor].counted_from(self.zeros[motor]))
    }
}

impl Lift {
    /// One that has not begun.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Starts from where the motors are, at the speed that they have.
    pub fn begin(&mut self, motors: &[Measured; 2]) {
        let is_level = |[_, tilt]: [f32; 2]| tilt.abs() < TOGETHER.wait.get();
        self.0 = match self.0 {
            State::Moving(bottom, axes, _)
                if axes.failure().is_none() && self.place(motors).is_some_and(is_level) =>
            {
                moving(bottom, motors)
            }
            _ => State::Homing(AxesHoming::new()),
        };
    }

    /// One step: the commands of both motors.
    pub fn step(&mut self, goal: Goal, motors: &[Measured; 2], dt: Seconds) -> [MotorCommand; 2] {
        match &mut self.0 {
            State::Idle => [MotorCommand::Coast; 2],
            State::Homing(homing) => {
                let commands = homing.update(&HOMING, motors, &[false; 2], dt);
                if let AxesHomingStatus::Done { zeros } = homing.status() {
                    let bottom = Bottom { zeros, gaps: motors.map(|motor| motor.gaps) };
                    self.0 = moving(bottom, motors);
                }
                commands
            }
            State::Moving(bottom, axes, profile) => {
                // A goal that cannot be used changes nothing: the profile goes on.
                let _ = aim(profile, goal);
                // It waits for a motor that is behind.
                let setpoint = profile.update(dt * axes.pace());
                let above = bottom.above(motors);
                let commands = axes.update(&TOGETHER, &setpoint, &above, dt);
                from_fn(|motor| {
                    let limited = RANGE.limit(commands[motor], Some(above[motor].angle));
                    limited.command.shifted(bottom.zeros[motor])
                })
            }
        }
    }

    /// What it does. One that gave up stands until it is begun again ([`Lift::blamed`]).
    pub fn stage(&self) -> Stage {
        match &self.0 {
            State::Idle => Stage::NotBegun,
            State::Homing(homing) => homing.stage(),
            State::Moving(_, axes, _) => axes.stage(),
        }
    }

    /// The motor because of which it has failed, if it has: 0 or 1.
    #[must_use]
    pub const fn blamed(&self) -> Option<usize> {
        match &self.0 {
            State::Idle => None,
            State::Homing(homing) => match homing.status() {
                AxesHomingStatus::Failed(
                    AxesHomingFailure::Motor { motor, .. }
                    | AxesHomingFailure::Spread { behind: motor, .. },
                ) => Some(motor),
                _ => None,
            },
            State::Moving(_, axes, _) => match axes.failure() {
                Some(AxesFailure::Motor { motor, .. } | AxesFailure::Lags { motor, .. }) => {
                    Some(motor)
                }
                None => None,
            },
        }
    }

    /// Height as the mean angle of the shafts above the bottom, and by how much the first of them is
    /// higher, in degrees; `None` while the bottom is not known.
    #[must_use]
    pub fn place(&self, motors: &[Measured; 2]) -> Option<[f32; 2]> {
        match &self.0 {
            State::Moving(bottom, ..) if bottom.is_known(motors) => {
                let above = bottom.above(motors);
                let tilt = above[0].angle.minus(above[1].angle).degrees();
                Some([mean(&above).angle.degrees().get(), tilt.get()])
            }
            _ => None,
        }
    }
}

/// From where the motors are, at the speed that they have.
fn moving(bottom: Bottom, motors: &[Measured; 2]) -> State {
    let profile = AngleProfile::from_setpoint(mean(&bottom.above(motors)));
    State::Moving(bottom, Axes::new(), profile)
}

fn mean(above: &[Measured; 2]) -> AngleSetpoint {
    let [left, right] = above.map(|motor| motor.angle.microdegrees());
    AngleSetpoint {
        angle: TotalAngle::from_microdegrees((left + right) / 2),
        speed: (above[0].speed + above[1].speed) * 0.5,
        acceleration: RpmPerSecond::ZERO,
    }
}

fn aim(profile: &mut AngleProfile, goal: Goal) -> Result<(), ConfigError> {
    match goal {
        Goal::Stand => profile.set_speed(&LIFT_LIMITS, Rpm::ZERO),
        Goal::Height(height) => profile.set_target(&LIFT_LIMITS, height, Rpm::ZERO),
        Goal::Move(share) => {
            let end = if share > 0.0 { RANGE.upper } else { RANGE.lower };
            let velocity = LIFT_LIMITS.velocity * share.abs();
            profile.set_target(&AngleLimits { velocity, ..LIFT_LIMITS }, end, Rpm::ZERO)
        }
    }
}
