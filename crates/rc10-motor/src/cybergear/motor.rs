//! A [`CyberGear`]: any model of [`models`](super::models), as a motor on a bus.

mod frames;

use core::f32::consts::PI;

use rc10_app::{Celsius, ConfigError, CountsPerTurn, NewtonMetres, Rpm, Seconds, TotalAngle};
use rc10_can::Micros;

use super::exchange::{Ask, Exchange, Outcome};
use super::models::Model;
use super::position::Position;
use super::wire::{Address, Parameter};
use crate::mit::{Limits, Setpoint};
use crate::motor::{
    Condition, DriveMode, Fault, Feedback, Impedance, Loops, Motor, Request, RequestError,
    Response, Target, TargetError, TargetKind, TargetSet,
};
use crate::servo::{Measured, Servo};
use rc10_app::Cascade;
use rc10_app::Direction;

/// One CyberGear or RobStride.
///
/// Speeds and angles are controlled here and sent as torques; [`Target::Impedance`] is the device's
/// own loop. Both are motion control, its run mode 0, which is checked before it is enabled.
#[derive(Clone, Debug)]
pub struct CyberGear {
    model: &'static Model,
    limits: Limits,
    address: Address,
    direction: Direction,
    servo: Servo,
    impedance: Option<Impedance>,
    /// How much of an impedance is given: from 0 to 1 after it begins.
    share: f32,
    setpoint: Setpoint,
    drive: DriveMode,
    step: Step,
    /// Seconds since its last feedback; meaningless before the first.
    silence: f32,
    position: Position,
    seen: Seen,
    fault: Option<Fault>,
    exchange: Option<Exchange>,
    answer: Option<Outcome>,
}

/// How far it is with enabling: the device's answers lead from one to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Sends stops, which are answered.
    Stopped,
    /// The same, and asks for the run mode.
    Checking,
    /// The same, and sets the run mode.
    Setting,
    /// Sends enables until the device says that it runs.
    Enabling,
    /// Sends setpoints.
    Running,
}

/// The newest feedback, in the device's direction.
#[derive(Clone, Copy, Debug)]
struct Seen {
    at: Micros,
    /// rad/s.
    speed: f32,
    /// N m.
    torque: f32,
    temperature: Celsius,
}

/// As the bus has it for feedback in every tick, in both units of time it is needed in.
const LINK_TIMEOUT: f32 = 0.010;
const LINK_TIMEOUT_MICROS: Micros = Micros::from_millis(10);
/// After a silence of so long the number of turns is an estimate.
const LONG_SILENCE: Micros = Micros::from_millis(100);
/// A shaft that after a silence is within so many rad of where its speed takes it, and half that
/// way, was counted all the time. A device that was off counts from somewhere else; one whose count
/// differs by less does little harm.
const NEAR: f32 = 0.5;
/// An impedance is given in full after so many seconds.
const SOFT_TIME: f32 = 0.1;
const RPM: f32 = 30.0 / PI;
/// What no host is called: the address for everybody.
const EVERYBODY: u8 = 0xFE;

impl CyberGear {
    /// The targets it takes.
    pub const TARGETS: TargetSet = TargetSet::of(&[
        TargetKind::Coast,
        TargetKind::Torque,
        TargetKind::Speed,
        TargetKind::Angle,
        TargetKind::TotalAngle,
        TargetKind::Impedance,
    ]);

    /// A motor of the model that is set to an identifier of 1 ..= 127, and a host, which is any
    /// number below 0xFE that no motor on the bus has (vendors' tools: 0xFD). Turning forward, with
    /// the gains that come with the model.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn new(model: &'static Model, address: Address) -> Result<Self, ConfigError> {
        Self::build(model, address)
            .map_err(|error| error.of_device(model.name, address.motor.into()))
    }

    fn build(model: &'static Model, address: Address) -> Result<Self, ConfigError> {
        let Address { motor, host } = address;
        if !(1..=127).contains(&motor) {
            return Err(ConfigError::new("motor", motor.into(), "1 to 127"));
        }
        if host == motor || host >= EVERYBODY {
            let must_be = "below 254, and not the motor's own identifier";
            return Err(ConfigError::new("host", host.into(), must_be));
        }
        let limits = model.limits.checked()?;
        Ok(Self {
            model,
            limits,
            address,
            direction: Direction::Forward,
            servo: Servo::new(TargetKind::Torque, model.cascade)?,
            impedance: None,
            share: 0.0,
            setpoint: Setpoint::COAST,
            drive: DriveMode::Off,
            step: Step::Stopped,
            silence: 0.0,
            position: Position::new(position_range(limits)?, Direction::Forward),
            seen: Seen { at: Micros::ZERO, speed: 0.0, torque: 0.0, temperature: Celsius::ZERO },
            fault: None,
            exchange: None,
            answer: None,
        })
    }

    /// Turning the given way.
    ///
    /// # Errors
    /// [`ConfigError`], if the model's range of position cannot be used.
    pub fn with_direction(mut self, direction: Direction) -> Result<Self, ConfigError> {
        self.direction = direction;
        self.position = Position::new(position_range(self.limits)?, direction);
        Ok(self)
    }

    /// With another range of position, rad, above 0 and at most 15: sources give a CyberGear 12.5 or
    /// 4π, an RS00 before firmware 0.0.2.6 has 12.5.
    ///
    /// # Errors
    /// [`ConfigError`], if it cannot be used.
    pub fn with_position_range(mut self, range: f32) -> Result<Self, ConfigError> {
        self.limits = self.limits.with_position(range)?;
        self.position = Position::new(position_range(self.limits)?, self.direction);
        Ok(self)
    }

    /// With gains of your own, efforts in N m.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn with_cascade(mut self, cascade: Cascade) -> Result<Self, ConfigError> {
        let id = self.address.motor.into();
        let named = |error: ConfigError| error.of_device(self.model.name, id);
        let (torque, most) = (cascade.speed.output_limit, self.limits.torque());
        if torque > most {
            let error = ConfigError::new("output_limit", torque, "at most the model's torque");
            return Err(named(error.in_part("speed")));
        }
        self.servo = Servo::new(TargetKind::Torque, cascade).map_err(named)?;
        Ok(self)
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> &'static Model {
        self.model
    }

    /// What the ends of its fields stand for.
    #[must_use]
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Who speaks to whom.
    #[must_use]
    pub const fn address(&self) -> Address {
        self.address
    }

    fn sign(&self) -> f32 {
        self.direction.sign().into()
    }

    fn measured(&self) -> Option<Measured> {
        let rpm = self.seen.speed * RPM * self.sign();
        self.position.is_known().then(|| Measured { rpm, microdegrees: self.position.counted() })
    }

    fn is_heard(&self) -> bool {
        self.position.is_known() && self.silence <= LINK_TIMEOUT
    }

    /// Where the device's own loop pulls to; `None` where it has no number for.
    fn place(&self, impedance: &Impedance) -> Option<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
        let counted = (impedance.angle.get() * 1e6) as i64;
        self.position.in_device(counted)
    }

    fn accepts_impedance(&self, impedance: &Impedance) -> Result<(), TargetError> {
        Self::TARGETS.accepts(&Target::Impedance(*impedance))?;
        let Impedance { kp, kd, .. } = *impedance;
        let good = (0.0..=self.limits.kp()).contains(&kp)
            && (0.0..=self.limits.kd()).contains(&kd)
            && !self.position.is_beyond()
            && self.place(impedance).is_some();
        if good { Ok(()) } else { Err(TargetError::OutOfRange(TargetKind::Impedance)) }
    }

    /// The device's own loop, with as much of it as the torque limit and the soft start allow.
    fn impede(&mut self, impedance: &Impedance, dt: Seconds) -> Setpoint {
        let Some(position) = self.place(impedance) else {
            return Setpoint::COAST;
        };
        let Some(now) = self.position.in_device(self.position.counted()) else {
            return Setpoint::COAST;
        };
        self.share = (self.share + dt.get() * (1.0 / SOFT_TIME)).min(1.0);
        let sign = self.sign();
        let velocity = impedance.speed.get() * (sign / RPM);
        let (kp, kd) = (impedance.kp, impedance.kd);
        let torque = impedance.torque.get() * sign;
        let whole = kp * (position - now) + kd * (velocity - self.seen.speed) + torque;
        let limit = self.servo.cascade().speed.output_limit;
        let share = if whole.abs() > limit { self.share * limit / whole.abs() } else { self.share };
        Setpoint { position, velocity, kp: kp * share, kd: kd * share, torque: torque * share }
    }

    /// One step of what leads to [`Step::Running`] or back.
    fn advance(&mut self, drive: DriveMode) {
        let may_run = self.is_heard() && self.fault.is_none();
        let wanted = match drive {
            DriveMode::Off => false,
            // Nothing needs to be enabled for that.
            DriveMode::Coast => self.step == Step::Running,
            DriveMode::Brake | DriveMode::Hold | DriveMode::Run => true,
        };
        if !(may_run && wanted) {
            self.step = Step::Stopped;
        } else if self.step == Step::Stopped {
            self.step = Step::Checking;
        }
    }
}

fn position_range(limits: Limits) -> Result<f32, ConfigError> {
    let value = limits.position();
    if value <= 15.0 {
        Ok(value)
    } else {
        Err(ConfigError::new("position", value, "at most 15 rad"))
    }
}

impl Motor for CyberGear {
    fn loops(&self) -> Option<Loops> {
        Some(self.servo.loops())
    }

    fn supports(&self) -> TargetSet {
        Self::TARGETS
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        match target {
            Target::Impedance(impedance) => {
                self.accepts_impedance(&impedance)?;
                self.impedance = Some(impedance);
                return Ok(());
            }
            Target::TotalAngle(angle) => {
                let counted = angle.counts_at(CountsPerTurn::MICRODEGREES);
                let place = self.position.in_device(counted);
                place.ok_or(TargetError::OutOfRange(TargetKind::TotalAngle))?;
            }
            _ => (),
        }
        self.servo.set_target(target)?;
        if self.impedance.take().is_some() {
            self.share = 0.0;
        }
        Ok(())
    }

    fn target(&self) -> Target {
        self.impedance.map_or_else(|| self.servo.target(), Target::Impedance)
    }

    fn feedback(&self) -> Feedback {
        if !self.position.is_known() {
            return Feedback::NEW;
        }
        let Seen { at, speed, torque, temperature, .. } = self.seen;
        let total = TotalAngle::from_microdegrees(self.position.counted());
        let rpm = Rpm::new(speed * RPM * self.sign());
        let mut feedback = Feedback::new(at, rpm, self.position.within_turn(), total)
            .with_torque(NewtonMetres::new(torque * self.sign()))
            .with_temperature(temperature);
        feedback.turn_gaps = self.position.gaps();
        feedback
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.silence += dt.get();
        self.drive = drive;
        self.advance(drive);
        let runs = self.step == Step::Running;
        self.setpoint = match self.impedance {
            Some(impedance) if runs && drive == DriveMode::Run => {
                self.servo.rest();
                self.impede(&impedance, dt)
            }
            _ => {
                self.share = 0.0;
                // Without a measurement the servo rests.
                let measured = if runs { self.measured() } else { None };
                let torque = self.servo.update(dt, drive, measured);
                Setpoint { torque: torque * self.sign(), ..Setpoint::COAST }
            }
        };
        if let Some(exchange) = &mut self.exchange {
            let late = exchange.tick(dt);
            let outcome = if exchange.needs_disarmed() && drive != DriveMode::Off {
                Some(Err(RequestError::NoReply))
            } else {
                late
            };
            if let Some(outcome) = outcome {
                self.finish(outcome);
            }
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if self.exchange.is_some() || self.answer.is_some() {
            return Err(RequestError::Busy);
        }
        let ask = match request {
            Request::SetZero => {
                let _ = self.measured().ok_or(RequestError::NoFeedback)?;
                let here = self.position.set_zero();
                self.servo.set_zero(here);
                if let Some(impedance) = &mut self.impedance {
                    #[expect(clippy::cast_precision_loss, reason = "finer than the field")]
                    let degrees = here as f32 * 1e-6;
                    impedance.angle = impedance.angle - rc10_app::Degrees::new(degrees);
                }
                return Ok(Response::Done);
            }
            Request::ClearFault if self.fault.is_none() => return Ok(Response::Done),
            Request::ClearFault => Ask::Clear,
            Request::ReadRegister(index) => Ask::Read(Parameter(index)),
            Request::WriteRegister(index, value) => {
                Ask::Write(Parameter(index), value.to_le_bytes())
            }
            // A CyberGear forgets its zero and knows no saving: its type 22 is another command.
            Request::StoreZero if self.model.saves => Ask::Zero,
            Request::SaveRegisters if self.model.saves => Ask::Save,
            request => return self.servo.request(request, self.measured()),
        };
        let exchange = Exchange::new(ask);
        if exchange.needs_disarmed() && self.drive != DriveMode::Off {
            return Err(RequestError::NotWhileArmed);
        }
        self.exchange = Some(exchange);
        Ok(Response::Pending)
    }

    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        self.answer.take()
    }

    fn condition(&self) -> Condition {
        let wanted = matches!(self.drive, DriveMode::Brake | DriveMode::Hold | DriveMode::Run);
        if wanted && self.step != Step::Running { Condition::Starting } else { Condition::Ready }
    }
}
