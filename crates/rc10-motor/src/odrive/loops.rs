//! Who closes the loops, and what the axis is told then.

use rc10_app::angle::shortest_way;
use rc10_app::maths::round_to_i32;
use rc10_app::{ConfigError, CountsPerTurn, NewtonMetres, Seconds};

use super::config::Control;
use super::shaft::Shaft;
use super::wire::{Command, Estimates};
use crate::motor::{self, DriveMode, Target, TargetError, TargetKind, TargetSet};
use crate::servo::{Measured, Servo};

/// Who closes the loops.
#[derive(Clone, Copy, Debug)]
pub(super) enum Loops {
    /// Ours: the axis gets torques.
    Here(Servo),
    /// The axis's, up to its velocity.
    Velocity(Speeds),
    /// The axis's, up to its position.
    Position(Places),
}

/// What an axis with a velocity loop is to do.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Speeds {
    target: Target,
    /// Turns a second, as on the wire.
    input: f32,
}

/// What an axis with a position loop is to do.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Places {
    target: Target,
    /// Turns, as on the wire.
    input: f32,
    /// What `input` stands for: an angle, and the zero it counts from, microdegrees.
    from: Option<(i64, i64)>,
    /// Where what is sought lies over many turns; `None` until it is known where the shaft is.
    sought: Option<i64>,
    /// Where to stay.
    held: Option<i64>,
}

impl Places {
    /// Where the angle that is sought lies over many turns: the shorter way from here.
    fn seek(&mut self, shaft: &Shaft) -> i64 {
        if let Some(sought) = self.sought {
            return sought;
        }
        let sought = match self.target {
            Target::TotalAngle(angle) => angle.counts_at(CountsPerTurn::MICRODEGREES),
            Target::Angle(degrees) => {
                let wanted = round_to_i32(degrees.get() % 360.0 * 1e6);
                let way = shortest_way(shaft.phase(), wanted, 360_000_000);
                shaft.total().saturating_add(way.into())
            }
            // Other targets are no angles, and nothing is sought.
            _ => shaft.total(),
        };
        self.sought = Some(sought);
        sought
    }

    fn update(&mut self, drive: DriveMode, shaft: &Shaft) {
        let total = if drive == DriveMode::Run {
            self.held = None;
            self.seek(shaft)
        } else {
            *self.held.get_or_insert(shaft.total())
        };
        let from = Some((total, shaft.offset()));
        // A division of 64 bits, when something has changed.
        if self.from != from {
            self.from = from;
            self.input = shaft.turns_at(total);
        }
    }

    fn set_target(&mut self, target: Target) {
        // The usual case is the same target again; but coasting is also what a target becomes whose
        // number lies elsewhere since a new zero.
        let is_same = target == self.target && (target != Target::Coast || self.coasts());
        if !is_same {
            (self.target, self.sought) = (target, None);
        }
    }

    fn set_zero(&mut self, zero: i64) {
        self.held = self.held.map(|held| held.saturating_sub(zero));
        match self.target {
            Target::TotalAngle(angle) => {
                let sought = angle.counts_at(CountsPerTurn::MICRODEGREES);
                self.sought = Some(sought.saturating_sub(zero));
                // The same number commanded again lies elsewhere now.
                self.target = Target::Coast;
            }
            Target::Angle(_) => self.sought = None,
            _ => self.sought = self.sought.map(|sought| sought.saturating_sub(zero)),
        }
    }

    /// Whether it shall coast; not if it still seeks an angle from before a new zero.
    const fn coasts(&self) -> bool {
        matches!(self.target, Target::Coast) && self.sought.is_none()
    }
}

impl Loops {
    pub fn new(control: Control) -> Result<Self, ConfigError> {
        Ok(match control {
            Control::Torque(cascade) => Self::Here(Servo::new(TargetKind::Torque, cascade)?),
            Control::Velocity(_) => Self::Velocity(Speeds::default()),
            Control::Position(_) => Self::Position(Places::default()),
        })
    }

    pub const fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Speed, TotalAngle};
        match self {
            Self::Here(servo) => servo.supports(),
            Self::Velocity(_) => TargetSet::of(&[Coast, Speed]),
            Self::Position(_) => TargetSet::of(&[Coast, Angle, TotalAngle]),
        }
    }

    pub const fn here(&self) -> Option<motor::Loops> {
        match self {
            Self::Here(servo) => Some(servo.loops()),
            Self::Velocity(_) | Self::Position(_) => None,
        }
    }

    pub fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        let supports = self.supports();
        match self {
            Self::Here(servo) => servo.set_target(target)?,
            Self::Velocity(speeds) => {
                supports.accepts(&target)?;
                speeds.target = target;
            }
            Self::Position(places) => {
                supports.accepts(&target)?;
                places.set_target(target);
            }
        }
        Ok(())
    }

    pub const fn target(&self) -> Target {
        match self {
            Self::Here(servo) => servo.target(),
            Self::Velocity(speeds) => speeds.target,
            Self::Position(places) => places.target,
        }
    }

    /// Whether this is the way to coast: an axis that closes its own loops cannot but be idle.
    pub const fn coasts_idle(&self, drive: DriveMode) -> bool {
        let coasts = match self {
            Self::Here(_) => return false,
            Self::Velocity(speeds) => matches!(speeds.target, Target::Coast),
            Self::Position(places) => places.coasts(),
        };
        match drive {
            DriveMode::Off | DriveMode::Coast => true,
            DriveMode::Run => coasts,
            DriveMode::Brake | DriveMode::Hold => false,
        }
    }

    /// One step. `ratio`: turns of the axis per turn of the output, with the sign.
    pub fn update(
        &mut self,
        dt: Seconds,
        drive: DriveMode,
        measured: Option<Measured>,
        shaft: &Shaft,
        ratio: f32,
    ) {
        match self {
            Self::Here(servo) => {
                servo.update(dt, drive, measured);
            }
            Self::Velocity(speeds) => {
                speeds.input = match (drive, speeds.target) {
                    (DriveMode::Run, Target::Speed(rpm)) => rpm.get() * ratio / 60.0,
                    _ => 0.0,
                };
            }
            Self::Position(places) => places.update(drive, shaft),
        }
    }

    /// Nothing is pursued: what comes next starts from here.
    pub fn rest(&mut self) {
        match self {
            Self::Here(servo) => servo.rest(),
            Self::Velocity(speeds) => speeds.input = 0.0,
            Self::Position(places) => places.held = None,
        }
    }

    pub fn set_zero(&mut self, zero: i64) {
        match self {
            Self::Here(servo) => servo.set_zero(zero),
            Self::Velocity(_) => (),
            Self::Position(places) => places.set_zero(zero),
        }
    }

    /// What was decided last.
    pub fn input(&self, ratio: f32) -> Command {
        match self {
            Self::Here(servo) => Command::Torque(NewtonMetres::new(servo.effort() / ratio)),
            Self::Velocity(speeds) => {
                Command::Velocity { velocity: speeds.input, torque: NewtonMetres::ZERO }
            }
            Self::Position(places) => position(places.input),
        }
    }

    /// Whether the axis closes any of them.
    pub const fn are_in_axis(&self) -> bool {
        !matches!(self, Self::Here(_))
    }

    /// What changes nothing in how the shaft moves now.
    pub const fn input_at_rest(&self, now: &Estimates) -> Command {
        match self {
            Self::Here(_) => Command::Torque(NewtonMetres::ZERO),
            Self::Velocity(_) => {
                Command::Velocity { velocity: now.velocity, torque: NewtonMetres::ZERO }
            }
            Self::Position(_) => position(now.position),
        }
    }
}

const fn position(position: f32) -> Command {
    Command::Position { position, velocity: 0.0, torque: NewtonMetres::ZERO }
}
