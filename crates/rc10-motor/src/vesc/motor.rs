//! A VESC as a motor: its commands, and what is made of its reports.

use rc10_app::angle::shortest_way;
use rc10_app::maths::{round_to_i32, within};
use rc10_app::{Amps, Celsius, ConfigError, Degrees, ElectricalRpm, Gear, Seconds, Volts};
use rc10_can::CanFrame;
use rc10_time::Micros;

use super::config::Config;
use super::hold::Hold;
use super::watch::Watch;
use super::wire::{Command, Packet, Reply, Setting, Status, VescId, coast, ping};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Condition, Fault, Feedback};
use crate::goal::{Goal, Goals};
use crate::motor::{CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::request::{Request, RequestError, Response};
use crate::servo::Servo;
use crate::shaft::{Shaft, TURN};
use crate::target::{Motion, Target, TargetError, TargetKind, TargetSet, without_effort};

/// After driving starts, a current rises to what was asked for within this time, s …
const SOFT_TIME: f32 = 0.020;
/// … and a duty from the motor's voltage by this much a second: 2 % a millisecond is a blow.
const SOFT_DUTY: f32 = 2.0;
/// Steps that the tachometer may be away from twice what its speed makes: two turns of the field.
const MOST_ASIDE: f32 = 12.0;
/// A tachometer value older than this, s, is nothing to seek an angle by.
const OLD: f32 = 0.025;
/// The period at which a changed current limit is sent again, s: no VESC says that it has taken it.
const LIMIT_PERIOD: f32 = 1.0;
/// Steps of the position in `STATUS_4` in a turn: 50 a degree.
const POSITION_STEPS: i32 = 18_000;

/// No torque, no braking.
const COAST: Command = Command::Current(Amps::ZERO);

/// A VESC. See the [module's documentation](super) for what each target becomes.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Vesc {
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::vesc"))]
    config: Config,
    id: VescId,
    /// The command frames' stream.
    stream: u32,
    /// Largest current now, A.
    limit: f32,
    goals: Goals,
    /// Angle loops on our side, if there are any.
    servo: Option<Servo>,
    /// Counted by the tachometer.
    shaft: Shaft,
    /// Counted by the position controller's encoder, where that sits on the shaft.
    encoder: Shaft,
    /// The newest value of the tachometer, in the VESC's own steps.
    tachometer: Option<i32>,
    /// Seconds since the tachometer was heard.
    tachometer_age: f32,
    /// The next tachometer value comes after a silence.
    after_silence: bool,
    reported: Reported,
    mode: DriveMode,
    hold: Hold,
    /// The progress of a soft start, 0 ..= 1.
    risen: f32,
    /// Duty from which it comes.
    from: f32,
    /// Seconds for which our angle loops have driven.
    sought: f32,
    command: Command,
    is_due: bool,
    /// Seconds until the command is repeated.
    until_next: f32,
    /// The VESC was told another limit than it is set to; seconds until it is told again.
    until_limit: Option<f32>,
    watch: Watch,
}

/// The newest measurement, as the VESC counts it; NaN where it was not told.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Reported {
    pub(super) speed: ElectricalRpm,
    /// Positive for positive torque, A.
    pub(super) current: f32,
    pub(super) duty: f32,
    motor: Celsius,
    transistors: Celsius,
    supply: Volts,
    /// The position controller's angle, in microdegrees.
    position: i32,
}

impl Vesc {
    /// A VESC that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        use TargetKind::{Angle, Brake, Coast, Current, Duty, Handbrake, Speed, SpeedMotion};
        config.validate()?;
        let id = config.vesc_id()?;
        let kinds = [Coast, Current, Duty, Speed, SpeedMotion, Brake, Handbrake];
        let mut supports = TargetSet::of(&kinds);
        if config.encoder_on_shaft || config.angle_loops.is_some() {
            supports = supports.with(Angle);
        }
        let limit = config.currents.limit.get();
        let mut servo = None;
        if let Some(cascade) = config.angle_loops {
            supports = supports.with(TargetKind::TotalAngle).with(TargetKind::Motion);
            servo.insert(Servo::of(Current, cascade)).set_limit("limit", limit)?;
        }
        let Config { scale, direction, .. } = config;
        Ok(Self {
            config,
            id,
            stream: CanFrame::key_of(Packet::SetDuty.id(id)),
            limit,
            goals: Goals::new(supports),
            servo,
            shaft: scale.shaft(direction),
            encoder: Shaft::new(POSITION_STEPS.unsigned_abs(), Gear::DIRECT, direction),
            tachometer: None,
            tachometer_age: 0.0,
            after_silence: false,
            reported: Reported {
                speed: ElectricalRpm::new(0.0),
                current: 0.0,
                duty: 0.0,
                motor: Celsius::new(f32::NAN),
                transistors: Celsius::new(f32::NAN),
                supply: Volts::new(f32::NAN),
                position: 0,
            },
            mode: DriveMode::Off,
            hold: Hold::default(),
            risen: 0.0,
            from: 0.0,
            sought: 0.0,
            command: COAST,
            is_due: true,
            until_next: 0.0,
            until_limit: None,
            watch: Watch::new(config.status.status_1),
        })
    }

    /// The configuration that it was made from.
    pub const fn config(&self) -> &Config {
        &self.config
    }

    fn decide(&mut self, tick: &Tick) -> Command {
        // Nothing is done to a shaft that was never seen.
        let mode = if self.shaft.is_known() { tick.mode } else { DriveMode::Off };
        let runs = mode == DriveMode::Run;
        // Angle loops hold better than a still field, as long as they see the shaft.
        let holds = mode == DriveMode::Hold && self.servo.is_some() && !self.is_blind();
        let seeks = runs && self.is_servos() || holds;
        if mode != DriveMode::Hold || seeks {
            self.hold = Hold::default();
        }
        if seeks {
            return self.seek(tick);
        }
        self.sought = 0.0;
        if let Some(servo) = &mut self.servo {
            servo.rest();
        }
        let currents = self.config.currents;
        let command = match mode {
            DriveMode::Off | DriveMode::Coast => COAST,
            DriveMode::Hold if self.hold.update(tick.dt, self.reported.speed) => {
                Command::Handbrake(currents.handbrake)
            }
            DriveMode::Brake | DriveMode::Hold => Command::Brake(currents.brake),
            DriveMode::Run => self.followed(tick.dt),
        };
        let drives = runs && self.goals.target() != Target::Coast;
        let command = self.soften(command, drives, tick.dt.get());
        if drives { self.relative(command) } else { command }
    }

    /// One step of our own angle loops, which start softly and keep to the limit by themselves.
    fn seek(&mut self, tick: &Tick) -> Command {
        self.risen = 0.0;
        let is_blind = self.is_blind();
        let Some(servo) = &mut self.servo else { return COAST };
        if is_blind {
            self.sought = 0.0;
            servo.rest();
        } else {
            self.sought += tick.dt.get();
            servo.update(tick, &self.shaft);
        }
        Command::Current(Amps::new(self.shaft.sign() * servo.effort()))
    }

    /// The command by which the VESC follows the target.
    fn followed(&mut self, dt: Seconds) -> Command {
        let sign = self.shaft.sign();
        match self.goals.target() {
            Target::Current(amps) => Command::Current(amps * sign),
            Target::Duty(duty) => Command::Duty(sign * within(duty, 1.0)),
            Target::Speed(rpm) => Command::Speed(self.config.scale.to_electrical(rpm * sign)),
            Target::Motion(_) => {
                let rpm = self.goals.advance(dt).motion.speed;
                Command::Speed(self.config.scale.to_electrical(rpm * sign))
            }
            Target::Brake(amps) => Command::Brake(amps),
            Target::Handbrake(amps) => Command::Handbrake(amps),
            Target::Angle(_) => Command::Position(self.position()),
            // What is not supported was refused before.
            _ => COAST,
        }
    }

    /// The angle sought, for the position controller: its newest reading and the way left.
    fn position(&self) -> Degrees {
        let way = match *self.goals.goal() {
            Goal::Angle(phase) => shortest_way(self.encoder.phase(), phase, TURN),
            _ => 0,
        };
        let way = if self.shaft.sign() < 0.0 { -way } else { way };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let degrees = (self.reported.position + way).rem_euclid(TURN) as f32 * 1e-6;
        Degrees::new(degrees)
    }

    /// A command as far as the largest current and a soft start let it come.
    fn soften(&mut self, command: Command, drives: bool, dt: f32) -> Command {
        let kind = |command: &Command| match command {
            Command::Duty(_) => 1,
            Command::Handbrake(_) | Command::RelativeHandbrake(_) => 2,
            _ => 0,
        };
        if kind(&command) != kind(&self.command) {
            (self.risen, self.from) = (0.0, self.reported.duty);
        }
        let rise = match command {
            Command::Current(_) if drives => dt / SOFT_TIME,
            // A field that locks pulls the rotor up to half its turn.
            Command::Handbrake(_) => dt / SOFT_TIME,
            Command::Duty(duty) => dt * SOFT_DUTY / (duty - self.from).abs().max(f32::EPSILON),
            _ => -1.0,
        };
        self.risen = (self.risen + rise).clamp(0.0, 1.0);
        let limited = |amps: Amps, share| Amps::new(within(amps.get(), self.limit) * share);
        match command {
            Command::Current(amps) => Command::Current(limited(amps, self.risen)),
            Command::Handbrake(amps) => Command::Handbrake(limited(amps, self.risen)),
            Command::Brake(amps) => Command::Brake(limited(amps, 1.0)),
            Command::Duty(duty) if self.risen < 1.0 => {
                Command::Duty(self.from + (duty - self.from) * self.risen)
            }
            other => other,
        }
    }

    /// A current as a share of what the VESC allows, if that is how it is to be sent.
    fn relative(&self, command: Command) -> Command {
        let Some(full) = self.config.relative_to else { return command };
        match command {
            Command::Current(amps) => Command::RelativeCurrent(amps.get() / full.get()),
            Command::Brake(amps) => Command::RelativeBrake(amps.get() / full.get()),
            Command::Handbrake(amps) => Command::RelativeHandbrake(amps.get() / full.get()),
            other => other,
        }
    }

    /// Whether the target is for our own angle loops.
    fn is_servos(&self) -> bool {
        match self.goals.target().kind() {
            TargetKind::TotalAngle | TargetKind::Motion => true,
            TargetKind::Angle => !self.config.encoder_on_shaft,
            _ => false,
        }
    }

    /// Whether nothing is known of where the shaft is now.
    fn is_blind(&self) -> bool {
        !self.shaft.is_known() || self.tachometer.is_none() || self.tachometer_age >= OLD
    }

    /// Takes a status frame; whether it is the one that tells how the motor moves.
    fn take(&mut self, status: &Status, at: Micros, link: Link) -> FrameKind {
        let reported = &mut self.reported;
        match *status {
            Status::Motion { speed, current, duty } => {
                if link != Link::Online {
                    self.after_silence = link == Link::Lost;
                    // It may have started anew, with the limits that are set in it.
                    self.until_limit = self.until_limit.map(|_| 0.0);
                }
                (reported.speed, reported.duty) = (speed, duty);
                reported.current = torque_current(current.get(), duty, speed);
                self.shaft.measure(speed.get() / self.config.scale.pole_pairs(), at);
                self.watch.hear();
                return FrameKind::Feedback;
            }
            Status::Temperatures { transistors, motor, position, .. } => {
                (reported.transistors, reported.motor) = (transistors, motor);
                if self.config.encoder_on_shaft {
                    let steps = round_to_i32(position.get() * 50.0).rem_euclid(POSITION_STEPS);
                    reported.position = steps * (TURN / POSITION_STEPS);
                    self.encoder.follow(steps, 0.0, at);
                }
            }
            Status::Tachometer { steps, volts } => {
                reported.supply = Volts::new(volts);
                self.count(steps);
            }
            // Whole-match figures, and inputs of its own: for other readers of the bus.
            Status::AmpHours { .. } | Status::WattHours { .. } | Status::Inputs { .. } => (),
        }
        FrameKind::Other
    }

    /// Takes a value of the tachometer, which goes round after 2³² steps.
    fn count(&mut self, steps: i32) {
        // A step is a sixth of the field's turn. A VESC that made more has restarted in a blink.
        let most = MOST_ASIDE + 0.2 * self.reported.speed.get().abs() * self.tachometer_age;
        self.tachometer_age = 0.0;
        let after_silence = core::mem::take(&mut self.after_silence);
        let Some(last) = self.tachometer.replace(steps) else {
            return self.shaft.start(steps.into());
        };
        let moved = steps.wrapping_sub(last);
        let jumps = moved.unsigned_abs() as f32 > most;
        if !(after_silence || jumps) {
            return self.shaft.move_by(moved);
        }
        self.shaft.count_gap();
        // One that was without power has begun again at zero.
        let restarted = steps.unsigned_abs() < moved.unsigned_abs();
        self.shaft.jump_by(if restarted { steps } else { moved }.into());
    }

    fn set_zero(&mut self) -> Result<Response, RequestError> {
        let Config { encoder_on_shaft, status, .. } = self.config;
        let counts = status.status_5 > 0;
        if !counts && !encoder_on_shaft {
            return Err(RequestError::Unsupported);
        }
        if counts && self.tachometer.is_none() || encoder_on_shaft && !self.encoder.is_known() {
            return Err(RequestError::NoFeedback);
        }
        let (zero, encoder_zero) = (self.shaft.set_zero(), self.encoder.set_zero());
        self.goals.set_zero(if self.is_servos() { zero } else { encoder_zero });
        if let Some(servo) = &mut self.servo {
            servo.set_zero(zero);
        }
        Ok(Response::Done)
    }

    fn set_limit(&mut self, limit: Amps) -> Result<Response, RequestError> {
        let asked = limit.get();
        ConfigError::check(asked >= 0.0, "current limit", asked, "zero or more")?;
        self.limit = asked.min(self.config.currents.limit.get());
        if let Some(servo) = &mut self.servo {
            servo.set_limit("current limit", self.limit)?;
        }
        self.until_limit = Some(0.0);
        Ok(Response::Done)
    }

    /// Whether a frame has an identifier, and a payload that its guard lets pass, of its own.
    fn receives(&self, frame: &CanFrame) -> bool {
        self.can_ids().received().iter().any(|frames| frames.contains(frame))
    }
}

/// The current as torque: the firmware's sign is positive for power from the supply, whichever way
/// the motor turns (`mcpwm_foc_get_tot_current`: the sign of voltage times current).
fn torque_current(current: f32, duty: f32, speed: ElectricalRpm) -> f32 {
    let speed = speed.get();
    if duty < 0.0 {
        -current
    } else if duty > 0.0 || speed.abs() < 0.5 {
        current
    } else {
        // At no voltage the winding is shorted: that brakes.
        -current.abs().copysign(speed)
    }
}

impl Motor for Vesc {
    handed_on!(supports, target of [goals]);
    handed_on!(state but [config]);

    fn name(&self) -> MotorName {
        self.config.name()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        if let Target::Brake(amps) | Target::Handbrake(amps) = target {
            // What only has a size goes from zero on.
            if amps.get() < 0.0 && amps.is_finite() {
                return Err(TargetError::OutOfRange(target.kind()));
            }
        }
        if target.kind() == TargetKind::SpeedMotion {
            // Its speed loop takes none.
            without_effort(self.goals.supports(), &target)?;
        }
        self.goals.set_target(target)?;
        let is_servos = self.is_servos();
        match &mut self.servo {
            Some(servo) if is_servos => servo.set_target(target),
            _ => Ok(()),
        }
    }

    fn feedback(&self) -> Feedback {
        let mut feedback = self.shaft.feedback();
        if !self.shaft.is_known() {
            return feedback;
        }
        if self.encoder.is_known() {
            feedback.angle = self.encoder.feedback().angle;
        }
        let Reported { current, motor, transistors, supply, .. } = self.reported;
        feedback
            .with_current(Amps::new(self.shaft.sign() * current))
            .with_temperature(motor)
            .with_controller_temperature(transistors)
            .with_supply(supply)
    }

    /// `None`: no frame of a VESC tells faults; [`Condition::NotFollowing`] shows them.
    fn fault(&self) -> Option<Fault> {
        None
    }

    fn update(&mut self, tick: &Tick) {
        let dt = tick.dt.get();
        self.tachometer_age += dt;
        let command = self.decide(tick);
        self.watch.update(tick, &command, &self.reported);
        self.until_limit = self.until_limit.map(|left| left - dt);
        self.until_next -= dt;
        let period = 1.0 / f32::from(self.config.command_hz);
        if tick.mode != self.mode || command.packet() != self.command.packet() {
            // Another way to drive does not wait for its turn.
            self.is_due = true;
            self.until_next = period;
        } else if self.until_next < 0.5 * dt {
            self.is_due = true;
            self.until_next = (self.until_next + period).max(0.0);
        }
        // The steps of a soft start are those of a tick, not of a command's period.
        self.is_due |= self.sought > 0.0 && self.sought <= SOFT_TIME;
        (self.mode, self.command) = (tick.mode, command);
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        match request {
            Request::SetZero => self.set_zero(),
            Request::CurrentLimit(limit) => self.set_limit(limit),
            // A VESC forgets its faults by itself, and never tells them: there is nothing to clear.
            Request::ClearFault => Ok(Response::Done),
            Request::SpeedGains(_) | Request::AngleGains(_) => {
                let servo = self.servo.as_mut().ok_or(RequestError::Unsupported)?;
                servo.request(request, &mut self.shaft)
            }
            _ => Err(RequestError::Unsupported),
        }
    }

    fn condition(&self) -> Condition {
        let is_regulated = match self.goals.target() {
            Target::Speed(rpm) | Target::Motion(Motion { angle: None, speed: rpm, .. }) => {
                self.config.scale.regulates(rpm)
            }
            _ => true,
        };
        self.watch.condition(self.mode, is_regulated, self.is_servos() && self.is_blind())
    }
}

impl CanMotor for Vesc {
    fn can_ids(&self) -> CanIds {
        self.config.can_ids()
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        let Config { asker, status: rates, .. } = &self.config;
        let id = &self.id;
        match Reply::unpack(frame) {
            Ok(Reply::Status { from, status }) if from == *id && rates.of(&status) > 0 => {
                Ok(self.take(&status, at, link))
            }
            Ok(Reply::Pong { from, to, hardware }) if from == *id && to == *asker => {
                // Other hardware than a VESC answers with another number.
                if hardware != 0 {
                    return Err(FrameError::Unexpected);
                }
                self.watch.hear_answer();
                Ok(FrameKind::Other)
            }
            Err(FrameError::Length) if self.receives(frame) => Err(FrameError::Length),
            Ok(_) | Err(_) => Err(FrameError::NotMine),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        let id = self.id;
        if self.is_due {
            // NaN is never sent: then it goes free.
            tx.push_as(self.command.pack(id).unwrap_or_else(|error| error.neutral), self.stream)?;
            self.is_due = false;
        }
        if self.until_limit.is_some_and(|left| left <= 0.0) {
            let (min, max) = (Amps::new(-self.limit), Amps::new(self.limit));
            // A limit that is not a number was refused.
            if let Ok(frame) = (Setting::MotorCurrent { min, max }).pack(id) {
                tx.push(frame)?;
            }
            self.until_limit = Some(LIMIT_PERIOD);
        }
        if self.watch.asks() {
            tx.push(ping(id, self.config.asker))?;
            self.watch.asked();
        }
        Ok(())
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push_as(coast(self.id), self.stream)
    }
}
