use rc10_app::{
    Amps, Celsius, ConfigError, Degrees, NewtonMetres, Rpm, Seconds, TotalAngle, Volts,
};
use rc10_can::{CanFrame, IdPattern, Micros};

use super::config::{Commands, Config};
use super::models::Model;
use super::shaft::{Sample, Shaft};
use super::wire::{
    CLEAR_ERRORS, CURRENT, Command, DriveId, Health, MOTION, MULTI_MOTOR_ID, Motion, Reply,
    ReplyError,
};
use crate::batch::{TxBatch, TxFull};
use crate::motor::{
    CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Loops, Motor, Request,
    RequestError, Response, Target, TargetError, TargetKind, TargetSet,
};
use crate::servo::{Measured, Servo};
use crate::wiring::{CanIds, Ownership, Rate, RxFrames, TxFrames};

/// How far a drive is on its way to obeying.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Kept off.
    Off,
    /// Being switched on, and echoed so many times.
    Starting(u8),
    /// Obeys currents.
    Running,
}

/// A drive may act one frame late (XDU librm), so the first echo is not yet the deed.
const ECHOES: u8 = 2;
/// In one tick of so many the drive is asked for its errors.
const HEALTH_EVERY: u8 = 100;
/// Nothing heard for longer than this, and it may be another drive that comes back.
const LINK_TIMEOUT: Micros = Micros::from_millis(10);
/// A drive that was restarted in a blink answers as before, and gives no current. This many steps of
/// current asked for, and not an eighth of it flowing, for so many ticks: it is switched on again,
/// by which no torque is lost.
const ASKED_STEPS: f32 = 16.0;
const NOTHING_FLOWS: f32 = 0.125;
const IDLE_TICKS: u8 = 20;
/// So long it may take to answer, s.
const PATIENCE: f32 = 0.1;

/// One LK drive, commanded by torque current: all loops run here.
#[derive(Clone, Debug)]
pub struct Lk {
    id: DriveId,
    model: Model,
    commands: Commands,
    lane: usize,
    sign: f32,
    /// Output rpm for a rotor's degree a second, with the sign.
    rpm_per_degree: f32,
    servo: Servo,
    /// The target, if it is a torque: the servo knows currents only.
    torque: Option<NewtonMetres>,
    shaft: Shaft,
    seen: Option<Seen>,
    /// Volts; NaN as long as nobody told.
    supply: f32,
    step: Step,
    fault: Option<Fault>,
    /// For how long the drive has been silent, s.
    silence: f32,
    /// For how long clearing a fault has been waited for, s.
    clearing: Option<f32>,
    answer: Option<Result<Response, RequestError>>,
    /// Ticks in which it gave no current, although it was asked for.
    idle: u8,
    /// Counts ticks, 0 ..< [`HEALTH_EVERY`].
    beat: u8,
}

/// The newest measurement.
#[derive(Clone, Copy, Debug)]
struct Seen {
    at: Micros,
    motion: Motion,
}

impl Seen {
    const fn sample(&self) -> Sample {
        Sample { at: self.at, encoder: self.motion.encoder, speed: self.motion.speed }
    }
}

impl Lk {
    /// The drive set to identifier `id`.
    ///
    /// # Errors
    /// [`ConfigError`], naming what cannot be: an identifier outside 1 ..= 32 (1 ..= 4 in the
    /// multi-motor frame), a model without a current loop, a gearbox that is faster than the rotor,
    /// or what [`Cascade::validate`](rc10_app::Cascade::validate) finds.
    pub fn new(id: u8, config: Config) -> Result<Self, ConfigError> {
        Self::build(id, config).map_err(|error| error.of_device(config.model.name, id.into()))
    }

    fn build(id: u8, config: Config) -> Result<Self, ConfigError> {
        let (id, lane) = config.checked(id)?;
        let Config { model, cascade, commands, direction } = config;
        let sign = direction.sign();
        Ok(Self {
            id,
            model,
            commands,
            lane,
            sign: sign.into(),
            rpm_per_degree: f32::from(sign) / (6.0 * model.gear.ratio()),
            servo: Servo::new(TargetKind::Current, cascade)?,
            torque: None,
            shaft: Shaft::new(model.encoder as u32, model.gear, sign.into()),
            seen: None,
            supply: f32::NAN,
            step: Step::Off,
            fault: None,
            silence: f32::INFINITY,
            clearing: None,
            answer: None,
            idle: 0,
            beat: 0,
        })
    }

    /// Its model.
    #[must_use]
    pub const fn model(&self) -> &Model {
        &self.model
    }

    fn measured(&self) -> Option<Measured> {
        let seen = self.seen.as_ref()?;
        let rpm = f32::from(seen.motion.speed) * self.rpm_per_degree;
        Some(Measured { rpm, microdegrees: self.shaft.total() })
    }

    /// From amperes as the drive counts them to the output shaft's, and back.
    fn turned(&self, current: Amps) -> Amps {
        Amps::new(current.get() * self.sign)
    }

    fn heard_motion(&mut self, motion: Motion, at: Micros) -> Result<FrameKind, FrameError> {
        if motion.command != CURRENT && motion.command != MOTION {
            return Err(FrameError::Unasked);
        }
        if u32::from(motion.encoder) >= self.model.encoder.counts() {
            return Err(FrameError::Encoder);
        }
        let seen = Seen { at, motion };
        match self.seen.replace(seen) {
            Some(last) => {
                self.shaft.follow(last.sample(), seen.sample());
                if at.since(last.at) > LINK_TIMEOUT {
                    self.step = Step::Off;
                }
            }
            None => self.shaft.start(seen.sample()),
        }
        self.silence = 0.0;
        Ok(FrameKind::Feedback)
    }

    /// Whether it has given no current for too long, although it was asked for.
    fn is_idle(&mut self) -> bool {
        let asked = self.servo.effort().abs();
        let flows = self.seen.map_or(0, |seen| seen.motion.effort.unsigned_abs());
        let flows = f32::from(flows) * self.model.amps_per_count;
        let idle = asked > ASKED_STEPS * self.model.amps_per_count && flows < asked * NOTHING_FLOWS;
        self.idle = if idle { self.idle + 1 } else { 0 };
        self.idle >= IDLE_TICKS
    }

    #[cold]
    fn heard_health(&mut self, health: Health) -> FrameKind {
        self.supply = health.supply;
        let fault = health.errors.fault();
        if self.clearing.is_some() && health.command == CLEAR_ERRORS {
            self.clearing = None;
            self.answer = Some(match fault {
                None => Ok(Response::Done),
                Some(fault) => Err(RequestError::Refused(fault.code)),
            });
            self.fault = None;
        }
        if fault.is_none() {
            return FrameKind::Other;
        }
        self.fault = fault;
        FrameKind::Fault
    }

    #[cold]
    fn heard_other(&mut self, reply: &Reply) -> Result<FrameKind, FrameError> {
        if self.commands == Commands::MultiMotor {
            return Err(FrameError::Unasked);
        }
        match reply {
            Reply::Health(health) => Ok(self.heard_health(*health)),
            Reply::Run => {
                self.step = match self.step {
                    Step::Starting(echoes) if echoes + 1 < ECHOES => Step::Starting(echoes + 1),
                    Step::Starting(_) => Step::Running,
                    step => step,
                };
                Ok(FrameKind::Other)
            }
            Reply::Off => Ok(FrameKind::Other),
            _ => Err(FrameError::Unasked),
        }
    }

    /// Waits for an answer, but not for ever.
    #[cold]
    fn wait(&mut self, waited: f32, dt: Seconds) {
        let waited = waited + dt.get();
        if waited < PATIENCE {
            self.clearing = Some(waited);
        } else {
            (self.clearing, self.answer) = (None, Some(Err(RequestError::NoReply)));
        }
    }

    /// What is to be sent in this tick, in frames of its own.
    fn command(&self) -> Command {
        let second = self.beat % 2 == 1;
        match self.step {
            // In turns with a question whose answer keeps the link alive.
            Step::Off if self.clearing.is_some() && second => Command::ClearErrors,
            Step::Off if second => Command::Off,
            Step::Starting(_) if second => Command::Run,
            _ if self.beat == 0 => Command::ReadHealth,
            Step::Off | Step::Starting(_) => Command::ReadMotion,
            Step::Running => Command::Current(self.turned(Amps::new(self.servo.effort()))),
        }
    }

    fn clear_fault(&mut self) -> Result<Response, RequestError> {
        if self.commands == Commands::MultiMotor {
            return Err(RequestError::Unsupported);
        }
        if self.fault.is_none() {
            return Ok(Response::Done);
        }
        self.clearing = Some(0.0);
        Ok(Response::Pending)
    }
}

impl Motor for Lk {
    fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Current, Speed, Torque, TotalAngle};
        if self.model.torque_constant.is_some() {
            TargetSet::of(&[Coast, Current, Torque, Speed, Angle, TotalAngle])
        } else {
            TargetSet::of(&[Coast, Current, Speed, Angle, TotalAngle])
        }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        if let (Target::Torque(torque), Some(constant)) = (target, self.model.torque_constant) {
            self.supports().accepts(&target)?;
            // Beyond what an f32 holds is beyond every limit, and is limited.
            let amps = (torque.get() / constant).clamp(f32::MIN, f32::MAX);
            self.servo.set_target(Target::Current(Amps::new(amps)))?;
            self.torque = Some(torque);
        } else {
            self.servo.set_target(target)?;
            self.torque = None;
        }
        Ok(())
    }

    fn target(&self) -> Target {
        self.torque.map_or_else(|| self.servo.target(), Target::Torque)
    }

    fn feedback(&self) -> Feedback {
        let Some(Seen { at, motion }) = &self.seen else { return Feedback::NEW };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let angle = self.shaft.phase() as f32 * 1e-6;
        let mut feedback = Feedback::new(
            *at,
            Rpm::new(f32::from(motion.speed) * self.rpm_per_degree),
            // The last steps before a full turn may round up to it.
            Degrees::new(if angle < 360.0 { angle } else { 0.0 }),
            TotalAngle::from_microdegrees(self.shaft.total()),
        );
        feedback.turn_gaps = self.shaft.gaps();
        let amps = f32::from(motion.effort) * self.model.amps_per_count * self.sign;
        let torque = amps * self.model.torque_constant.unwrap_or(f32::NAN);
        feedback
            .with_current(Amps::new(amps))
            .with_torque(NewtonMetres::new(torque))
            .with_temperature(Celsius::new(motion.temperature.into()))
            .with_supply(Volts::new(self.supply))
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.silence += dt.get();
        if let Some(waited) = self.clearing {
            self.wait(waited, dt);
        }
        let heard = self.silence <= Seconds::from_micros(LINK_TIMEOUT.get()).get();
        let may = drive != DriveMode::Off && heard && self.fault.is_none();
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
            let measured = self.measured();
            self.servo.update(dt, drive, measured);
        } else {
            self.servo.rest();
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if self.clearing.is_some() || self.answer.is_some() {
            return Err(RequestError::Busy);
        }
        match (request, self.model.torque_constant) {
            (Request::ClearFault, _) => self.clear_fault(),
            (Request::SetZero, _) => {
                if self.seen.is_none() {
                    return Err(RequestError::NoFeedback);
                }
                self.servo.set_zero(self.shaft.total());
                self.shaft.set_zero();
                Ok(Response::Done)
            }
            (Request::TorqueLimit(limit), Some(constant)) => {
                let amps = limit.get() / constant;
                let told = |error| ConfigError { value: limit.get(), ..error };
                self.servo.set_limit("torque limit", amps).map_err(told)?;
                Ok(Response::Done)
            }
            _ => self.servo.request(request, self.measured()),
        }
    }

    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        self.answer.take()
    }

    fn loops(&self) -> Option<Loops> {
        Some(self.servo.loops())
    }

    fn condition(&self) -> Condition {
        match self.step {
            Step::Starting(_) => Condition::Starting,
            Step::Off | Step::Running => Condition::Ready,
        }
    }
}

impl CanMotor for Lk {
    fn wiring(&self) -> CanIds {
        let replies = RxFrames {
            pattern: IdPattern::exact(self.id.can_id()),
            len: 8,
            rate: Rate::EveryTick,
            guard: None,
        };
        let (id, share) = match self.commands {
            Commands::Single => (self.id.can_id(), Ownership::Whole),
            Commands::MultiMotor => (MULTI_MOTOR_ID, Ownership::Lane(0b11 << self.lane)),
        };
        let pattern = IdPattern::exact(id);
        let orders = TxFrames { pattern, len: 8, rate: Rate::EveryTick, share };
        let bare = || CanIds::new(self.model.name, self.id.number().into());
        // One of each always fits.
        let wiring = bare().receives(replies).and_then(|wiring| wiring.transmits(orders));
        wiring.unwrap_or_else(|_| bare())
    }

    #[inline]
    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        match Reply::from_frame(frame, self.id) {
            Ok(Reply::Motion(motion)) => self.heard_motion(motion, at),
            Ok(reply) => self.heard_other(&reply),
            Err(ReplyError::NotMine) => Err(FrameError::NotMine),
            Err(ReplyError::Length) => Err(FrameError::Length),
            Err(ReplyError::Command(_)) => Err(FrameError::Unexpected),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        if self.commands == Commands::MultiMotor {
            let raw = self.model.raw_current(self.turned(Amps::new(self.servo.effort())));
            return tx.lane(MULTI_MOTOR_ID, self.lane, raw.to_le_bytes());
        }
        let command = self.command();
        self.beat = if self.beat + 1 < HEALTH_EVERY { self.beat + 1 } else { 0 };
        tx.push(command.pack(self.id, &self.model).unwrap_or_else(|nan| nan.neutral))
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        match self.commands {
            Commands::Single => {
                let off = Command::Off.pack(self.id, &self.model);
                tx.push(off.unwrap_or_else(|nan| nan.neutral))
            }
            Commands::MultiMotor => tx.lane(MULTI_MOTOR_ID, self.lane, [0; 2]),
        }
    }
}
