//! A VESC as a motor: what it is told when, and what is made of what it tells.

use rc10_app::maths::within;
use rc10_app::{Amps, Celsius, ConfigError, Degrees, Rpm, Seconds, Volts};
use rc10_can::{CanFrame, Micros};

use super::config::check;
use super::hold::Hold;
use super::tachometer::Tachometer;
use super::watch::Watch;
use super::{CONTROL_HZ, Command, Config, ElectricalRpm, Packet, Status, coast};
use crate::motor::{
    Condition, DriveMode, Fault, Feedback, FrameKind, Motor, Request, RequestError, Response,
    Target, TargetError, TargetKind, TargetSet,
};
use crate::servo::{Measured, Servo};
use rc10_app::Cascade;

/// After driving starts, a current rises to what was asked for within this time, s …
const SOFT_TIME: f32 = 0.020;
/// … and a duty from what the motor's own voltage is by so much a second. The VESC's ramp of 2 % in
/// a millisecond is a blow: its winding has no more than a few hundredths of an ohm.
const SOFT_DUTY: f32 = 2.0;
/// Steps that the tachometer may be away from twice what its speed makes: two turns of the field.
const MOST_ASIDE: f32 = 12.0;
/// A tachometer value older than this, s, is nothing to seek an angle by.
const OLD: f32 = 0.025;

/// A VESC. See the [module's documentation](super) for what each target becomes.
#[derive(Clone, Copy, Debug)]
pub struct Vesc {
    pub(super) config: Config,
    /// 1 or -1.
    sign: f32,
    /// The command frames' stream.
    pub(super) stream: u32,
    /// Largest current now, A.
    pub(super) limit: f32,
    target: Target,
    goal: Goal,
    servo: Option<Servo>,
    drive: DriveMode,
    hold: Hold,
    /// How far a soft start has come, 0 ..= 1.
    risen: f32,
    /// Duty from which it comes.
    from: f32,
    command: Command,
    pub(super) is_due: bool,
    /// Seconds until the command is repeated.
    until_next: f32,
    /// The VESC was told another limit than it is set to; seconds until it is told again.
    pub(super) told_limit: Option<f32>,
    seen: Seen,
    tachometer: Tachometer,
    /// Seconds since the tachometer was heard.
    tachometer_age: f32,
    /// The next tachometer value comes after a silence.
    after_silence: bool,
    pub(super) watch: Watch,
}

/// The target in the VESC's own terms.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    /// For the VESC to follow; whether it regulates that.
    Command(Command, bool),
    /// For our servo, which asks for a current.
    Servo,
}

/// What the newest frames told, as the VESC counts it.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    at: Micros,
    heard: bool,
    speed: ElectricalRpm,
    /// Positive for positive torque.
    current: f32,
    duty: f32,
    motor: Option<Celsius>,
    transistors: Option<Celsius>,
    /// Of the position controller, degrees; and where it counts from.
    position: Option<f32>,
    position_zero: f32,
    volts: Option<f32>,
}

fn named(config: &Config, error: ConfigError) -> ConfigError {
    error.of_device("VESC", config.id.get().into())
}

impl Vesc {
    /// A VESC that is set up like this.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.validate().map_err(|error| named(&config, error))?;
        Ok(Self {
            config,
            sign: config.direction.sign().into(),
            stream: CanFrame::key_of(Packet::SetDuty.id(config.id)),
            limit: config.currents.limit.get(),
            target: Target::Coast,
            goal: Goal::Command(COAST, true),
            servo: None,
            drive: DriveMode::Off,
            hold: Hold::default(),
            risen: 0.0,
            from: 0.0,
            command: COAST,
            is_due: true,
            until_next: 0.0,
            told_limit: None,
            seen: Seen::default(),
            tachometer: Tachometer::new(&config.shaft, config.direction),
            tachometer_age: f32::INFINITY,
            after_silence: false,
            watch: Watch::new(config.status.status_1),
        })
    }

    /// With angle loops on our side, which ask the VESC for a current: it then takes
    /// [`Target::TotalAngle`], and [`Target::Angle`] also without an encoder on its shaft. Efforts
    /// of the cascade are amperes. The motor needs hall sensors or an encoder: sensorless it has no
    /// torque at rest. It stands as still as the tachometer is fine: a step is 60 degrees of the
    /// field.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used: of the cascade, or `status_5`, which
    /// has to come at [`CONTROL_HZ`] or more.
    pub fn with_servo(mut self, cascade: Cascade) -> Result<Self, ConfigError> {
        let rate = self.config.status.status_5;
        let servo = || {
            let must_be = "200 Hz or more, to seek angles by";
            check("status_5", rate.into(), rate >= CONTROL_HZ, must_be)?;
            let mut servo = Servo::new(TargetKind::Current, cascade)?;
            servo.set_limit("limit", self.limit)?;
            Ok(servo)
        };
        self.servo = Some(servo().map_err(|error| named(&self.config, error))?);
        Ok(self)
    }

    /// What it was made from.
    #[must_use]
    pub const fn config(&self) -> &Config {
        &self.config
    }

    /// How it comes to follow a target that it takes.
    fn goal_of(&self, target: Target) -> Result<Goal, TargetError> {
        let sign = self.sign;
        // What only has a size goes from zero on.
        let size = |value: f32| match value {
            value if value < 0.0 => Err(TargetError::OutOfRange(target.kind())),
            value => Ok(value),
        };
        let command = match target {
            Target::Current(amps) => Command::Current(Amps::new(sign * amps.get())),
            Target::CurrentShare(share) => Command::RelativeCurrent(sign * within(share, 1.0)),
            Target::Duty(duty) => Command::Duty(sign * within(duty, 1.0)),
            Target::Speed(rpm) => {
                let electrical = self.config.shaft.to_electrical(rpm).get();
                let command = Command::Speed(ElectricalRpm::new(sign * electrical));
                return Ok(Goal::Command(command, self.config.shaft.regulates(rpm)));
            }
            Target::Brake(amps) => Command::Brake(Amps::new(size(amps.get())?)),
            Target::BrakeShare(share) => Command::RelativeBrake(within(size(share)?, 1.0)),
            Target::Handbrake(amps) => Command::Handbrake(Amps::new(size(amps.get())?)),
            Target::HandbrakeShare(share) => Command::RelativeHandbrake(within(size(share)?, 1.0)),
            Target::Angle(angle) if self.config.encoder_on_shaft => {
                let angle = sign * (angle.get() % 360.0) + self.seen.position_zero;
                Command::Position(Degrees::new(within_turn(angle)))
            }
            Target::Angle(_) | Target::TotalAngle(_) => return Ok(Goal::Servo),
            // What is not supported was refused before.
            _ => COAST,
        };
        Ok(Goal::Command(command, true))
    }

    /// What to tell the VESC now.
    fn decide(&mut self, dt: Seconds, drive: DriveMode) -> Command {
        let currents = self.config.currents;
        // Nothing is done to a shaft that was never seen.
        let drive = if self.seen.heard { drive } else { DriveMode::Off };
        let seeks = match drive {
            DriveMode::Run => self.goal == Goal::Servo,
            // Angle loops hold better than a still field, as long as they see the shaft.
            DriveMode::Hold => self.servo.is_some() && !self.is_blind(),
            DriveMode::Off | DriveMode::Coast | DriveMode::Brake => false,
        };
        if drive != DriveMode::Hold || seeks {
            self.hold.start_over();
        }
        if seeks {
            return self.seek(dt, drive);
        }
        if let Some(servo) = &mut self.servo {
            servo.rest();
        }
        let command = match drive {
            DriveMode::Off | DriveMode::Coast => COAST,
            DriveMode::Hold if self.hold.update(dt, self.seen.speed) => {
                Command::Handbrake(currents.handbrake)
            }
            DriveMode::Brake | DriveMode::Hold => Command::Brake(currents.brake),
            DriveMode::Run => match self.goal {
                Goal::Command(command, _) => command,
                Goal::Servo => COAST,
            },
        };
        // Whoever begins to push begins softly.
        let way = |command| match command {
            Command::Duty(_) => 1,
            Command::Handbrake(_) | Command::RelativeHandbrake(_) => 2,
            _ => 0,
        };
        if way(command) != way(self.command) {
            (self.risen, self.from) = (0.0, self.seen.duty);
        }
        let begins = drive == DriveMode::Run && self.target != Target::Coast;
        let rise = match command {
            Command::Current(_) | Command::RelativeCurrent(_) if begins => dt.get() / SOFT_TIME,
            // A field that locks pulls the rotor up to half its turn.
            Command::Handbrake(_) | Command::RelativeHandbrake(_) => dt.get() / SOFT_TIME,
            Command::Duty(duty) if begins => {
                dt.get() * SOFT_DUTY / (duty - self.from).abs().max(f32::EPSILON)
            }
            _ => -1.0,
        };
        self.risen = (self.risen + rise).clamp(0.0, 1.0);
        let limited = |amps: Amps| Amps::new(within(amps.get(), self.limit));
        match command {
            Command::Current(amps) => Command::Current(Amps::new(limited(amps).get() * self.risen)),
            Command::RelativeCurrent(share) => Command::RelativeCurrent(share * self.risen),
            Command::Duty(duty) if self.risen < 1.0 => {
                Command::Duty(self.from + (duty - self.from) * self.risen)
            }
            Command::Brake(amps) => Command::Brake(limited(amps)),
            Command::Handbrake(amps) => {
                Command::Handbrake(Amps::new(limited(amps).get() * self.risen))
            }
            Command::RelativeHandbrake(share) => Command::RelativeHandbrake(share * self.risen),
            other => other,
        }
    }

    /// One step of our own angle loops, which start softly and keep to the limit by themselves.
    fn seek(&mut self, dt: Seconds, drive: DriveMode) -> Command {
        self.risen = 0.0;
        let measured = (!self.is_blind()).then(|| self.measured());
        let amps = match &mut self.servo {
            Some(servo) => servo.update(dt, drive, measured),
            None => 0.0,
        };
        Command::Current(Amps::new(self.sign * amps))
    }

    /// Whether nothing is known of where the shaft is now.
    fn is_blind(&self) -> bool {
        !self.seen.heard || self.tachometer_age >= OLD
    }

    /// Takes a status frame; whether it is the one that tells how the motor moves.
    pub(super) fn take(&mut self, status: Status, at: Micros) -> FrameKind {
        let seen = &mut self.seen;
        match status {
            Status::Motion { speed, current, duty } => {
                let gap = at.since(seen.at);
                if !seen.heard || gap > self.watch.link_timeout() {
                    self.after_silence = true;
                    // It may have started anew, with the limits that are set in it.
                    self.told_limit = self.told_limit.map(|_| 0.0);
                }
                let torque = torque_current(current.get(), duty, speed);
                (seen.at, seen.heard) = (at, true);
                (seen.speed, seen.current, seen.duty) = (speed, torque, duty);
                self.watch.hear(current.get(), duty);
                return FrameKind::Feedback;
            }
            Status::Temperatures { transistors, motor, position, .. } => {
                (seen.transistors, seen.motor) = (Some(transistors), Some(motor));
                seen.position = Some(position.get());
            }
            Status::Tachometer { steps, volts } => {
                seen.volts = Some(volts);
                // So many steps it may have made: one a sixth of the field's turn. Who has made more
                // was restarted in a blink.
                let most = MOST_ASIDE + 0.2 * seen.speed.get().abs() * self.tachometer_age;
                let jumps = self.tachometer.way_to(steps) > most;
                let after_silence = core::mem::take(&mut self.after_silence) || jumps;
                self.tachometer.update(steps, after_silence);
                self.tachometer_age = 0.0;
            }
            // Whole-match figures, and inputs of its own: for who reads the bus.
            Status::AmpHours { .. } | Status::WattHours { .. } | Status::Inputs { .. } => (),
        }
        FrameKind::Other
    }

    fn set_zero(&mut self) -> Result<Response, RequestError> {
        let counts = self.config.status.status_5 > 0;
        let sees = self.config.encoder_on_shaft;
        if !counts && !sees {
            return Err(RequestError::Unsupported);
        }
        let position = match (sees, self.seen.position) {
            (true, None) => return Err(RequestError::NoFeedback),
            (true, Some(position)) => position,
            (false, _) => 0.0,
        };
        if counts && !self.tachometer.is_heard() {
            return Err(RequestError::NoFeedback);
        }
        self.seen.position_zero = position;
        let zero = self.tachometer.set_zero();
        if let Some(servo) = &mut self.servo {
            servo.set_zero(zero);
        }
        if matches!(self.target, Target::Angle(_) | Target::TotalAngle(_)) {
            // What is sought stays where it is; the same number commanded again lies elsewhere.
            self.target = Target::Coast;
        }
        Ok(Response::Done)
    }

    fn set_limit(&mut self, limit: Amps) -> Result<Response, RequestError> {
        let asked = limit.get();
        check("current limit", asked, asked >= 0.0, "zero or more")?;
        self.limit = asked.min(self.config.currents.limit.get());
        if let Some(servo) = &mut self.servo {
            servo.set_limit("current limit", self.limit)?;
        }
        self.told_limit = Some(0.0);
        Ok(Response::Done)
    }

    /// Of the output shaft.
    fn speed(&self) -> Rpm {
        Rpm::new(self.sign * self.config.shaft.to_output(self.seen.speed).get())
    }

    fn measured(&self) -> Measured {
        Measured { rpm: self.speed().get(), microdegrees: self.tachometer.microdegrees() }
    }

    /// The frame of the command. A number that is none is never sent: then it goes free.
    pub(super) fn frame(&self) -> CanFrame {
        self.command.pack(self.config.id).unwrap_or_else(|_| coast(self.config.id))
    }
}

/// The current as torque: the firmware gives one that takes power from the supply a positive sign,
/// and one that feeds it back a negative one, whichever way the motor turns (`mcpwm_foc.c`,
/// `mcpwm_foc_get_tot_current`: the sign of voltage times current).
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

/// No torque, no braking.
const COAST: Command = Command::Current(Amps::ZERO);

/// 0 ..= 360, of what is within two turns of it.
fn within_turn(degrees: f32) -> f32 {
    let degrees = degrees % 360.0;
    if degrees < 0.0 { degrees + 360.0 } else { degrees }
}

impl Motor for Vesc {
    fn supports(&self) -> TargetSet {
        use TargetKind::{
            Angle, Brake, BrakeShare, Coast, Current, CurrentShare, Duty, Handbrake,
            HandbrakeShare, Speed, TotalAngle,
        };
        #[rustfmt::skip]
        const ALL: [TargetKind; 11] = [
            Coast, Current, Duty, Speed, Brake, Handbrake, CurrentShare, BrakeShare, HandbrakeShare,
            Angle, TotalAngle,
        ];
        let without = match (&self.servo, self.config.encoder_on_shaft) {
            (Some(_), _) => 0,
            (None, true) => 1,
            (None, false) => 2,
        };
        TargetSet::of(&ALL[..ALL.len() - without])
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again. But coasting is also what an angle becomes whose
        // number lies elsewhere since a new zero.
        if target != self.target || target == Target::Coast {
            self.supports().accepts(&target)?;
            let goal = self.goal_of(target)?;
            if let (Goal::Servo, Some(servo)) = (goal, &mut self.servo) {
                servo.set_target(target)?;
            }
            (self.goal, self.target) = (goal, target);
        }
        Ok(())
    }

    fn target(&self) -> Target {
        self.target
    }

    fn feedback(&self) -> Feedback {
        let seen = &self.seen;
        if !seen.heard {
            return Feedback::NEW;
        }
        let angle = match seen.position {
            Some(position) if self.config.encoder_on_shaft => {
                let degrees = within_turn(self.sign * (position - seen.position_zero));
                Degrees::new(if degrees < 360.0 { degrees } else { 0.0 })
            }
            _ => self.tachometer.angle(),
        };
        let total = self.tachometer.total_angle();
        let mut told = Feedback::new(seen.at, self.speed(), angle, total)
            .with_current(Amps::new(self.sign * seen.current));
        told.turn_gaps = self.tachometer.gaps();
        if let Some(motor) = seen.motor {
            told = told.with_temperature(motor);
        }
        if let Some(transistors) = seen.transistors {
            told = told.with_controller_temperature(transistors);
        }
        match seen.volts {
            Some(volts) => told.with_supply(Volts::new(volts)),
            None => told,
        }
    }

    /// Never one: no frame of a VESC tells its faults. [`Condition::NotFollowing`] is what is seen
    /// of them.
    fn fault(&self) -> Option<Fault> {
        None
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.tachometer_age += dt.get();
        let command = self.decide(dt, drive);
        self.watch.tick(dt, drive, &command, self.seen.speed);
        self.told_limit = self.told_limit.map(|left| left - dt.get());
        self.until_next -= dt.get();
        let period = 1.0 / f32::from(self.config.command_hz);
        if drive != self.drive || command.packet() != self.command.packet() {
            // Another way to drive does not wait for its turn.
            self.is_due = true;
            self.until_next = period;
        } else if self.until_next < 0.5 * dt.get() {
            self.is_due = true;
            self.until_next = (self.until_next + period).max(0.0);
        }
        (self.drive, self.command) = (drive, command);
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        match request {
            Request::SetZero => self.set_zero(),
            Request::CurrentLimit(limit) => self.set_limit(limit),
            // A VESC forgets its faults by itself, and never tells them: there is nothing to clear.
            Request::ClearFault => Ok(Response::Done),
            Request::SpeedGains(_) | Request::AngleGains(_) => {
                let measured = self.seen.heard.then(|| self.measured());
                let servo = self.servo.as_mut().ok_or(RequestError::Unsupported)?;
                servo.request(request, measured)
            }
            _ => Err(RequestError::Unsupported),
        }
    }

    fn condition(&self) -> Condition {
        let regulated = !matches!(self.goal, Goal::Command(_, false));
        let blind = self.goal == Goal::Servo && self.is_blind();
        self.watch.condition(self.drive, regulated, blind)
    }
}
