use rc10_app::maths::round_to_i32;
use rc10_app::{Degrees, Rpm, RpmPerSecond, Seconds, TotalAngle};

use crate::motor::DriveMode;
use crate::pending::Outcome;
use crate::request::{Request, RequestError, Response};
use crate::shaft::{Shaft, TURN};
use crate::target::{Motion, Target, TargetError, TargetSet};

/// A target in numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Goal {
    Rest,
    /// In the unit of the motor's own effort.
    Effort(f32),
    /// rpm
    Speed(f32),
    /// Within the turn, 0 ..< 360,000,000 microdegrees.
    Angle(i32),
    Total(TotalAngle),
    /// Exactly there; the rest stands in the target.
    Impedance(TotalAngle),
    Motion,
}

impl Goal {
    pub(crate) fn of(target: Target) -> Result<Self, TargetError> {
        Ok(match target {
            Target::Current(amps) => Self::Effort(amps.get()),
            Target::Torque(torque) => Self::Effort(torque.get()),
            Target::Duty(duty) => Self::Effort(duty),
            Target::Speed(rpm) => Self::Speed(rpm.get()),
            Target::Angle(degrees) => Self::Angle(within_turn(degrees)),
            Target::TotalAngle(angle) => Self::Total(angle),
            Target::Impedance(impedance) => {
                let out_of_range = TargetError::OutOfRange(target.kind());
                let angle = TotalAngle::try_from_degrees(impedance.angle).ok_or(out_of_range)?;
                Self::Impedance(angle)
            }
            Target::Motion(_) => Self::Motion,
            // The others are the motor's own.
            _ => Self::Rest,
        })
    }
}

/// The target of a motor, and where it holds: with or without loops of ours.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Goals {
    supports: TargetSet,
    target: Target,
    goal: Goal,
    /// The angle to keep while the bus says hold.
    held: Option<TotalAngle>,
    /// Seconds since the newest motion was given, and what it has gained since: rpm and degrees.
    since: f32,
    gained: f32,
    gone: f32,
}

/// A motion goes on with its acceleration for this time, then at the speed that it has.
const LONGEST_ACCELERATION: f32 = 0.05;
/// No command is valid for longer, s.
const LONGEST_MOTION: f32 = 1.0;
/// 1 rpm in degrees a second.
const DEGREES_PER_SECOND: f32 = 6.0;

/// A motion in one tick, and the way that it has gone since it was given, in degrees.
pub(crate) struct Moment {
    pub(crate) motion: Motion,
    pub(crate) gone: f32,
}

impl Goals {
    pub(crate) const fn new(supports: TargetSet) -> Self {
        Self {
            supports,
            target: Target::Coast,
            goal: Goal::Rest,
            held: None,
            since: 0.0,
            gained: 0.0,
            gone: 0.0,
        }
    }

    pub(crate) const fn supports(&self) -> TargetSet {
        self.supports
    }

    /// Takes a new target, or keeps the old one.
    pub(crate) fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again.
        if target != self.target {
            self.supports.accepts(&target)?;
            self.goal = Goal::of(target)?;
            self.target = target;
        }
        (self.since, self.gained, self.gone) = (0.0, 0.0, 0.0);
        Ok(())
    }

    /// The target; of a motion, where it is now.
    pub(crate) fn target(&self) -> Target {
        if matches!(self.target, Target::Motion(_)) { self.moving_target() } else { self.target }
    }

    fn moving_target(&self) -> Target {
        let mut motion = self.motion();
        motion.speed = motion.speed + Rpm::new(self.gained);
        if let Some(angle) = &mut motion.angle {
            let gone = round_to_i32(self.gone * 1e6);
            *angle = angle.plus(TotalAngle::from_microdegrees(gone.into()));
        }
        Target::Motion(motion)
    }

    pub(crate) const fn goal(&self) -> &Goal {
        &self.goal
    }

    /// All angles count from `zero` (as measured until now) from now on. What is sought or held
    /// stays where it is, so it is another number: the same number commanded again lies elsewhere.
    pub(crate) fn set_zero(&mut self, zero: TotalAngle) {
        self.held = self.held.map(|held| held.minus(zero));
        match self.goal {
            Goal::Total(angle) => {
                let angle = angle.minus(zero);
                (self.goal, self.target) = (Goal::Total(angle), Target::TotalAngle(angle));
            }
            Goal::Angle(phase) => {
                let angle = TotalAngle::from_microdegrees(phase.into()).minus(zero).within_turn();
                (self.goal, self.target) = (Goal::Angle(within_turn(angle)), Target::Angle(angle));
            }
            Goal::Impedance(angle) => {
                let moved = angle.minus(zero);
                self.goal = Goal::Impedance(moved);
                if let Target::Impedance(impedance) = &mut self.target {
                    impedance.angle = moved.degrees();
                }
            }
            Goal::Motion => {
                if let Target::Motion(Motion { angle: Some(angle), .. }) = &mut self.target {
                    *angle = angle.minus(zero);
                }
            }
            Goal::Rest | Goal::Effort(_) | Goal::Speed(_) => (),
        }
    }

    /// Carries out what the loops of any side can: the zero of their shaft.
    pub(crate) fn request(&mut self, request: Request, shaft: &mut Shaft) -> Outcome {
        match request {
            Request::SetZero if !shaft.is_known() => Err(RequestError::NoFeedback),
            Request::SetZero => {
                self.set_zero(shaft.set_zero());
                Ok(Response::Done)
            }
            _ => Err(RequestError::Unsupported),
        }
    }

    /// The motion that was given; at rest for any other target.
    pub(crate) fn motion(&self) -> Motion {
        match self.target {
            Target::Motion(motion) => motion,
            _ => Motion::default(),
        }
    }

    /// Where a motion is after one more tick.
    pub(crate) fn advance(&mut self, dt: Seconds) -> Moment {
        // No comparison is true for NaN, and nothing goes back.
        let since = self.since + if dt.get() > 0.0 { dt.get() } else { 0.0 };
        self.since = if since < LONGEST_MOTION { since } else { LONGEST_MOTION };
        let Motion { angle, speed, acceleration, inertia, effort } = self.motion();
        // What slows down comes to a stand, and does not turn back.
        let left = -speed.get() / acceleration.get();
        let longest =
            if left > 0.0 && left < LONGEST_ACCELERATION { left } else { LONGEST_ACCELERATION };
        let is_over = self.since >= longest;
        let accelerated = if is_over { longest } else { self.since };
        self.gained = acceleration.get() * accelerated;
        let way = speed.get() * self.since + self.gained * (self.since - 0.5 * accelerated);
        self.gone = way * DEGREES_PER_SECOND;
        let motion = Motion {
            angle,
            speed: Rpm::new(speed.get() + self.gained),
            acceleration: if is_over { RpmPerSecond::ZERO } else { acceleration },
            inertia: if is_over { 0.0 } else { inertia },
            effort,
        };
        Moment { motion, gone: self.gone }
    }

    /// The goal of a tick; `stand` is where the shaft comes to a stand, if that is known.
    pub(crate) fn update(
        &mut self,
        mode: DriveMode,
        stand: impl FnOnce() -> Option<TotalAngle>,
    ) -> Goal {
        if mode != DriveMode::Hold {
            self.held = None;
        } else if self.held.is_none() {
            self.held = stand();
        }
        match (mode, self.held) {
            (DriveMode::Run, _) => self.goal,
            (DriveMode::Brake, _) => Goal::Speed(0.0),
            (DriveMode::Hold, Some(angle)) => Goal::Total(angle),
            (DriveMode::Off | DriveMode::Coast | DriveMode::Hold, _) => Goal::Rest,
        }
    }

    /// Nothing is held: what comes next starts from where the shaft is.
    pub(crate) const fn rest(&mut self) {
        self.held = None;
    }
}

/// 0 ..< 360 degrees in microdegrees, from any number of degrees.
fn within_turn(degrees: Degrees) -> i32 {
    let degrees = degrees.get() % 360.0;
    let degrees = if degrees < 0.0 { degrees + 360.0 } else { degrees };
    let phase = round_to_i32(degrees * 1e6);
    // The last steps before a full turn may round up to it.
    if phase < TURN { phase } else { 0 }
}
