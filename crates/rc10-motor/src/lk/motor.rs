//! The motor: its shaft, its loops, its frames.

use rc10_app::{Amps, ConfigError, NewtonMetres, Volts};
use rc10_can::CanFrame;
use rc10_time::Micros;

use super::config::{Commands, Config, Model, can_ids};
use super::wire::{
    CLEAR_ERRORS, CURRENT, Command, DriveId, Health, MOTION, MULTI_MOTOR_ID, Motion, Reply,
};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Condition, Fault, Feedback};
use crate::motor::{CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::pending::{Pending, Retry};
use crate::request::{Request, RequestError, Response};
use crate::servo::Servo;
use crate::shaft::Shaft;
use crate::target::{Target, TargetError, TargetKind, TargetSet};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Step {
    Off,
    /// Being switched on; this many echoes have come.
    Starting(u8),
    /// Obeys currents.
    Running,
}

/// A drive may act one frame late (XDU librm), so the first echo is not yet the deed.
const ECHOES: u8 = 2;
/// The drive is asked for its errors once in this many ticks.
const HEALTH_EVERY: u8 = 100;
/// A drive restarted in a blink answers, and gives no current. This many steps asked for without an
/// eighth of it for this many ticks: it is switched on again.
const ASKED_STEPS: f32 = 16.0;
const NOTHING_FLOWS: f32 = 0.125;
const IDLE_TICKS: u8 = 20;
/// Clearing errors is tried for 0.1 s.
const CLEARING: Retry = Retry::new(0.0095, 10);

/// One LK drive, commanded by torque current: all loops run here.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Lk {
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::drive"))]
    id: DriveId,
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::lk"))]
    model: Model,
    #[cfg_attr(feature = "record", serde(skip))]
    commands: Commands,
    lane: usize,
    servo: Servo,
    /// The target, if it is a torque: the servo knows currents only.
    torque: Option<NewtonMetres>,
    shaft: Shaft,
    motion: Motion,
    /// Volts; NaN until the drive tells.
    supply: f32,
    step: Step,
    fault: Option<Fault>,
    /// Clearing errors, the only request that waits for the drive.
    pending: Pending<()>,
    /// Ticks in which it gave no current, although it was asked for.
    idle: u8,
    /// Counts ticks, 0 ..< [`HEALTH_EVERY`].
    beat: u8,
}

impl Lk {
    /// The drive that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.validate()?;
        let (id, lane) = config.lane()?;
        let Config { model, cascade, commands, direction, .. } = config;
        Ok(Self {
            id,
            model,
            commands,
            lane,
            servo: Servo::of(TargetKind::Current, cascade),
            torque: None,
            shaft: Shaft::new(model.encoder.counts(), model.gear, direction),
            motion: Motion { command: MOTION, temperature: 0, effort: 0, speed: 0, encoder: 0 },
            supply: f32::NAN,
            step: Step::Off,
            fault: None,
            pending: Pending::new(),
            idle: 0,
            beat: 0,
        })
    }

    /// The current to send: the drive counts it in its own direction.
    fn current(&self) -> Amps {
        Amps::new(self.servo.effort() * self.shaft.sign())
    }

    fn heard_motion(&mut self, motion: Motion, at: Micros, link: Link) -> Heard {
        if motion.command != CURRENT && motion.command != MOTION {
            return Err(FrameError::Unasked);
        }
        self.model.angle(&motion)?;
        if link != Link::Online {
            // It may be another drive than the one that was switched on.
            self.step = Step::Off;
        }
        self.motion = motion;
        self.shaft.follow(motion.encoder.into(), motion.speed().get(), at);
        Ok(FrameKind::Feedback)
    }

    fn heard_other(&mut self, reply: &Reply) -> Heard {
        match reply {
            _ if self.commands == Commands::MultiMotor => return Err(FrameError::Unasked),
            Reply::Health(health) => return Ok(self.heard_health(health)),
            Reply::Run => {
                self.step = match self.step {
                    Step::Starting(echoes) if echoes + 1 < ECHOES => Step::Starting(echoes + 1),
                    Step::Starting(_) => Step::Running,
                    step => step,
                };
            }
            Reply::Off => (),
            _ => return Err(FrameError::Unasked),
        }
        Ok(FrameKind::Other)
    }

    fn heard_health(&mut self, health: &Health) -> FrameKind {
        self.supply = health.supply;
        let fault = health.errors.fault();
        if health.command == CLEAR_ERRORS && self.pending.question().is_some() {
            self.pending.end(match fault {
                None => Ok(Response::Done),
                Some(fault) => Err(RequestError::Refused(fault.code)),
            });
            self.fault = None;
        }
        self.fault = fault.or(self.fault);
        if fault.is_some() { FrameKind::Fault } else { FrameKind::Other }
    }

    /// Whether it has given no current for too long, although it was asked for.
    fn is_idle(&mut self) -> bool {
        let asked = self.servo.effort().abs();
        let flows = f32::from(self.motion.effort.unsigned_abs()) * self.model.amps_per_count;
        let idle = asked > ASKED_STEPS * self.model.amps_per_count && flows < asked * NOTHING_FLOWS;
        self.idle = if idle { self.idle + 1 } else { 0 };
        self.idle >= IDLE_TICKS
    }

    /// The command of this tick that goes out in a frame of its own.
    fn command(&mut self) -> Command {
        let second = self.beat % 2 == 1;
        match self.step {
            // In turns with a question whose answer keeps the link alive.
            Step::Off if second && self.pending.take_due().is_some() => Command::ClearErrors,
            Step::Off if second => Command::Off,
            Step::Starting(_) if second => Command::Run,
            _ if self.beat == 0 => Command::ReadHealth,
            Step::Off | Step::Starting(_) => Command::ReadMotion,
            Step::Running => Command::Current(self.current()),
        }
    }

    fn push(&self, command: Command, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(command.pack(self.id, &self.model).unwrap_or_else(|nan| nan.neutral))
    }
}

impl Motor for Lk {
    handed_on!(loops of [servo]);
    handed_on!(fault of [fault]);
    handed_on!(response of [pending]);
    handed_on!(state but [id, model, commands]);

    fn name(&self) -> MotorName {
        MotorName { model: self.model.name, id: self.id.number().into() }
    }

    fn supports(&self) -> TargetSet {
        let supports = self.servo.supports();
        match self.model.torque_constant {
            Some(_) => supports.with(TargetKind::Torque),
            None => supports,
        }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        let (target, torque) = match (target, self.model.torque_constant) {
            (Target::Torque(torque), Some(constant)) if torque.is_finite() => {
                // Beyond what an f32 holds is beyond every limit, and is limited.
                let amps = (torque.get() / constant).clamp(f32::MIN, f32::MAX);
                (Target::Current(Amps::new(amps)), Some(torque))
            }
            (Target::Torque(_), Some(_)) => {
                return Err(TargetError::NotFinite(TargetKind::Torque));
            }
            (target, _) => (target, None),
        };
        self.servo.set_target(target)?;
        self.torque = torque;
        Ok(())
    }

    fn target(&self) -> Target {
        self.torque.map_or_else(|| self.servo.target(), Target::Torque)
    }

    fn feedback(&self) -> Feedback {
        let feedback = self.shaft.feedback();
        if !self.shaft.is_known() {
            return feedback;
        }
        let amps = f32::from(self.motion.effort) * self.model.amps_per_count * self.shaft.sign();
        let torque = amps * self.model.torque_constant.unwrap_or(f32::NAN);
        feedback
            .with_current(Amps::new(amps))
            .with_torque(NewtonMetres::new(torque))
            .with_temperature(self.motion.temperature())
            .with_supply(Volts::new(self.supply))
            .with_effort(self.servo.effort())
    }

    fn update(&mut self, tick: &Tick) {
        self.pending.update(tick);
        let may = tick.mode != DriveMode::Off && tick.link == Link::Online && self.fault.is_none();
        if !may && self.step == Step::Running {
            // It is switched off at once: the question's turn is later.
            self.beat |= 1;
        }
        self.step = match (may, self.commands, self.step) {
            (false, ..) => Step::Off,
            (true, Commands::Single, Step::Off) => Step::Starting(0),
            (true, Commands::MultiMotor, _) => Step::Running,
            (true, Commands::Single, Step::Running) if self.is_idle() => {
                self.idle = 0;
                Step::Starting(0)
            }
            (true, Commands::Single, step) => step,
        };
        if self.step == Step::Running {
            self.servo.update(tick, &self.shaft);
        } else {
            self.servo.rest();
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.pending.check_free()?;
        match (request, self.model.torque_constant) {
            (Request::ClearFault, _) if self.commands == Commands::MultiMotor => {
                Err(RequestError::Unsupported)
            }
            (Request::ClearFault, _) if self.fault.is_none() => Ok(Response::Done),
            (Request::ClearFault, _) => self.pending.ask((), CLEARING),
            (Request::TorqueLimit(limit), Some(constant)) => {
                let amps = limit.get() / constant;
                let asked = |error| ConfigError { value: limit.get(), ..error };
                self.servo.set_limit("torque limit", amps).map_err(asked)?;
                Ok(Response::Done)
            }
            _ => self.servo.request(request, &mut self.shaft),
        }
    }

    fn condition(&self) -> Condition {
        match self.step {
            Step::Starting(_) => Condition::Starting,
            Step::Off | Step::Running => Condition::Ready,
        }
    }
}

impl CanMotor for Lk {
    fn can_ids(&self) -> CanIds {
        can_ids(self.id, self.commands, self.lane)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        match Reply::from_frame(frame, self.id)? {
            Reply::Motion(motion) => self.heard_motion(motion, at, link),
            reply => self.heard_other(&reply),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        if self.commands == Commands::MultiMotor {
            let raw = self.model.raw_current(self.current());
            return tx.lane(MULTI_MOTOR_ID, self.lane, raw.to_le_bytes());
        }
        let command = self.command();
        self.beat = if self.beat + 1 < HEALTH_EVERY { self.beat + 1 } else { 0 };
        self.push(command, tx)
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        match self.commands {
            Commands::Single => self.push(Command::Off, tx),
            Commands::MultiMotor => tx.lane(MULTI_MOTOR_ID, self.lane, [0; 2]),
        }
    }
}
