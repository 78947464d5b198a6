use rc10_app::{
    Amps, Celsius, ConfigError, Degrees, NewtonMetres, Rpm, Seconds, TotalAngle, Volts,
};
use rc10_can::{CanFrame, IdPattern, Micros};

use super::config::{Config, Limits, Rates};
use super::firmware::Firmware;
use super::loops::Loops;
use super::shaft::{MOST_TURNS, Shaft};
use super::wire::{
    AxisState, CLEAR_ERRORS, CURRENTS, Command, ControlMode, Currents, ESTIMATES, Estimates,
    HEARTBEAT, Heartbeat, InputMode, Message, MessageError, Node, POSITION, SUPPLY, TEMPERATURES,
    TORQUE, Temperatures, VELOCITY,
};
use crate::batch::{TxBatch, TxFull};
use crate::motor::{
    self, CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Motor, Request,
    RequestError, Response, Target, TargetError, TargetSet,
};
use crate::servo::Measured;
use crate::wiring::{CanIds, Ownership, Rate, RxFrames, TxFrames};

/// What nobody else may send or be sent: the five bits of the message.
const NODE_MASK: u16 = 0x7E0;
/// No encoder turns so fast, turns a second.
const MOST_SPEED: f32 = 10_000.0;
/// No axis has so many volts or amperes.
const MOST_ELECTRICAL: f32 = 10_000.0;
/// Below this, estimates are too seldom for loops that run here.
const CONTROL_RATE: u16 = 200;
/// Once the axis is idle it is told so in every tenth tick only.
const REMIND_EVERY: u8 = 10;
/// The steps of switching on follow each other in ticks.
const START_STEPS: u8 = 4;
/// A multiple of both.
const BEATS: u8 = 20;
/// New limits are not answered, so they are sent so many times.
const LIMIT_FRAMES: u8 = 3;
/// An axis that closes its own loops gets its current in so many ticks: else it would come back
/// with all it has.
const SOFT_TICKS: u8 = 20;

/// Turns that an axis may be away from where its speed takes it, and twice that after a silence: one
/// further away was restarted.
const MOST_ASIDE: f32 = 0.25;

/// How far an axis is on its way to obeying.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Told to be idle.
    Off,
    /// Idle; told how to understand its inputs, and to follow them.
    Starting,
    /// Follows its inputs.
    Running,
}

/// One axis of an `ODrive`.
#[derive(Clone, Debug)]
pub struct ODrive {
    node: Node,
    firmware: Firmware,
    rates: Rates,
    modes: (ControlMode, InputMode),
    limits: Option<Limits>,
    /// What it came with: no request goes beyond.
    most_current: Amps,
    /// Ticks in which limits have to be sent yet.
    limits_due: u8,
    torque_constant: f32,
    /// Turns of the encoder's shaft per turn of the output, with the sign.
    ratio: f32,
    shaft: Shaft,
    loops: Loops,
    seen: Option<Seen>,
    told: Told,
    step: Step,
    /// Whether it may drive, as of the last tick.
    wanted: bool,
    state: AxisState,
    fault: Option<Fault>,
    /// Since the last estimate and the last heartbeat, s.
    silence: f32,
    heartbeat_age: f32,
    /// How long either may be, s.
    link_timeout: f32,
    heartbeat_timeout: f32,
    clearing: Option<Clearing>,
    answer: Option<Result<Response, RequestError>>,
    beat: u8,
}

/// The newest estimate.
#[derive(Clone, Copy, Debug)]
struct Seen {
    at: Micros,
    estimates: Estimates,
}

/// What comes beside the estimates; NaN as long as it did not.
#[derive(Clone, Copy, Debug)]
struct Told {
    current: f32,
    supply: f32,
    controller: f32,
    motor: f32,
}

/// Errors are being cleared.
#[derive(Clone, Copy, Debug)]
struct Clearing {
    waited: f32,
    /// What the heartbeats since then said.
    errors: Option<u32>,
}

impl ODrive {
    /// The axis with this number.
    ///
    /// # Errors
    /// [`ConfigError`], naming what cannot be: a node that is not 0 ..= 62, a gearbox that is faster
    /// than the encoder, an input mode that is none of its control mode's, rates, limits, and what
    /// [`Cascade::validate`](rc10_app::Cascade::validate) finds.
    pub fn new(node: u8, config: Config) -> Result<Self, ConfigError> {
        Self::build(node, config).map_err(|error| error.of_device("ODrive", node.into()))
    }

    fn build(node: u8, config: Config) -> Result<Self, ConfigError> {
        let node = config.checked(node)?;
        let sign = config.direction.sign();
        let Rates { estimates, heartbeat, .. } = config.rates;
        Ok(Self {
            node,
            firmware: config.firmware,
            rates: config.rates,
            modes: config.control.modes(),
            limits: config.limits,
            most_current: config.limits.map_or(Amps::ZERO, |limits| limits.current),
            limits_due: 0,
            torque_constant: config.torque_constant.unwrap_or(f32::NAN),
            ratio: config.gear.ratio() * f32::from(sign),
            shaft: Shaft::new(config.gear, sign.into()),
            loops: Loops::new(config.control)?,
            seen: None,
            told: Told {
                current: f32::NAN,
                supply: f32::NAN,
                controller: f32::NAN,
                motor: f32::NAN,
            },
            step: Step::Off,
            wanted: false,
            state: AxisState::default(),
            fault: None,
            silence: f32::INFINITY,
            heartbeat_age: f32::INFINITY,
            link_timeout: (3.0 / f32::from(estimates)).max(0.01),
            heartbeat_timeout: (3.0 / f32::from(heartbeat)).max(0.01) * 1.2,
            clearing: None,
            answer: None,
            beat: 0,
        })
    }

    /// What the axis says it does.
    #[must_use]
    pub const fn state(&self) -> AxisState {
        self.state
    }

    fn speed(&self, estimates: &Estimates) -> f32 {
        estimates.velocity * 60.0 / self.ratio
    }

    fn measured(&self) -> Option<Measured> {
        let seen = self.seen.as_ref()?;
        Some(Measured { rpm: self.speed(&seen.estimates), microdegrees: self.shaft.total() })
    }

    #[inline]
    fn heard_estimates(
        &mut self,
        estimates: Estimates,
        at: Micros,
    ) -> Result<FrameKind, FrameError> {
        let Estimates { position, velocity } = estimates;
        if position.abs() > MOST_TURNS || velocity.abs() > MOST_SPEED {
            return Err(FrameError::Encoder);
        }
        match self.seen.replace(Seen { at, estimates }) {
            Some(last) => {
                let silence = Seconds::from_micros(at.since(last.at).get());
                self.follow(&last, estimates, silence);
            }
            None => self.shaft.follow(position),
        }
        self.silence = 0.0;
        Ok(FrameKind::Feedback)
    }

    #[inline]
    fn follow(&mut self, last: &Seen, now: Estimates, silence: Seconds) {
        let before = last.estimates;
        let fastest = before.velocity.abs().max(now.velocity.abs());
        let mut most = MOST_ASIDE + fastest * silence.get();
        if silence.get() <= self.link_timeout {
            // What was restarted in a blink counts from elsewhere, too.
            if (now.position - before.position).abs() <= most {
                return self.shaft.follow(now.position);
            }
        } else {
            most += MOST_ASIDE;
        }
        self.shaft.follow_after_silence(before.position, now.position, most);
        // It may be another axis than the one that was switched on.
        self.leave();
    }

    /// Back to the beginning: what was known of the axis's state holds no more.
    fn leave(&mut self) {
        (self.step, self.state) = (Step::Off, AxisState::default());
    }

    fn heard_heartbeat(&mut self, heartbeat: Heartbeat) -> FrameKind {
        self.heartbeat_age = 0.0;
        self.state = heartbeat.state;
        let closed = heartbeat.state == AxisState::CLOSED_LOOP;
        self.step = match self.step {
            Step::Starting if closed => {
                if self.loops.are_in_axis() {
                    self.limits_due = SOFT_TICKS + LIMIT_FRAMES;
                }
                Step::Running
            }
            Step::Running if !closed => Step::Off,
            step => step,
        };
        let errors = heartbeat.errors & !self.firmware.starting;
        if let Some(clearing) = &mut self.clearing {
            clearing.errors = Some(errors);
        }
        if let Some(fault) = self.firmware.fault(errors) {
            self.fault = Some(fault);
            return FrameKind::Fault;
        }
        if self.clearing.take().is_some() {
            (self.fault, self.answer) = (None, Some(Ok(Response::Done)));
        }
        FrameKind::Other
    }

    /// Whether it is a message that the axis is set to send.
    fn hears(&self, frame: &CanFrame) -> bool {
        let number = frame.key() & !u32::from(NODE_MASK);
        self.messages().any(|(message, rate)| u32::from(message) == number && rate > 0)
    }

    /// What an axis may send, and how often.
    fn messages(&self) -> impl Iterator<Item = (u8, u16)> {
        let Rates { estimates, heartbeat, currents, temperatures, supply } = self.rates;
        [
            (ESTIMATES, estimates),
            (HEARTBEAT, heartbeat),
            (CURRENTS, currents),
            (TEMPERATURES, temperatures),
            (SUPPLY, supply),
        ]
        .into_iter()
    }

    #[cold]
    fn heard_other(
        &mut self,
        frame: &CanFrame,
        error: MessageError,
    ) -> Result<FrameKind, FrameError> {
        match error {
            MessageError::NotMine => Err(FrameError::NotMine),
            _ if !self.hears(frame) => Err(FrameError::NotMine),
            MessageError::Length => Err(FrameError::Length),
            MessageError::Message(TEMPERATURES) if self.firmware.has_temperatures => {
                let told = Temperatures::from_frame(frame, self.node)
                    .map_err(|_| FrameError::Unexpected)?;
                (self.told.controller, self.told.motor) = (told.controller.get(), told.motor.get());
                Ok(FrameKind::Other)
            }
            MessageError::Message(_) | MessageError::NotFinite => Err(FrameError::Unexpected),
        }
    }

    /// Waits until the heartbeat says that the errors are gone, but not for ever.
    fn wait(&mut self, dt: Seconds) {
        let Some(clearing) = &mut self.clearing else { return };
        clearing.waited += dt.get();
        if clearing.waited >= self.heartbeat_timeout {
            let error = clearing.errors.map_or(RequestError::NoReply, RequestError::Refused);
            (self.clearing, self.answer) = (None, Some(Err(error)));
        }
    }

    fn limit_command(&self) -> Option<Command> {
        let Limits { speed, current } = self.limits?;
        let ticks_left = match self.step {
            _ if !self.loops.are_in_axis() => 0,
            Step::Starting => SOFT_TICKS,
            Step::Off | Step::Running => self.limits_due.saturating_sub(LIMIT_FRAMES),
        };
        let share = 1.0 - f32::from(ticks_left) / f32::from(SOFT_TICKS);
        let velocity = speed.get() * self.ratio.abs() / 60.0;
        Some(Command::Limits { velocity, current: current * share })
    }

    /// What is to be sent in this tick, if anything is to be said.
    fn command(&self) -> Option<Command> {
        let (control, input) = self.modes;
        let here = self.seen.map_or(Estimates::NONE, |seen| seen.estimates);
        match (self.step, self.beat % START_STEPS) {
            (Step::Off, 3) if self.clearing.is_some() => Some(Command::ClearErrors),
            (Step::Off, _) => {
                let is_idle = self.state == AxisState::IDLE && self.clearing.is_none();
                let silent = is_idle && !self.beat.is_multiple_of(REMIND_EVERY);
                (!silent).then_some(Command::State(AxisState::IDLE))
            }
            // One a tick: within a tick the lowest message number would go first.
            (Step::Starting, 0) => {
                Some(self.limit_command().unwrap_or(Command::Modes(control, input)))
            }
            (Step::Starting, 1) => Some(Command::Modes(control, input)),
            (Step::Starting, 2) => Some(self.loops.input_at_rest(&here)),
            (Step::Starting, _) => Some(Command::State(AxisState::CLOSED_LOOP)),
            (Step::Running, _) => Some(self.loops.input(self.ratio)),
        }
    }

    fn push(&self, command: Command, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(command.pack(self.node).unwrap_or_else(|nan| nan.neutral))
    }

    fn set_zero(&mut self) -> Result<Response, RequestError> {
        if self.seen.is_none() {
            return Err(RequestError::NoFeedback);
        }
        let zero = self.shaft.total();
        self.shaft.set_zero();
        self.loops.set_zero(zero);
        Ok(Response::Done)
    }

    fn limit_current(&mut self, limit: Amps) -> Result<Response, RequestError> {
        let Some(limits) = &mut self.limits else { return Err(RequestError::Unsupported) };
        let value = limit.get();
        if !value.is_finite() || value < 0.0 {
            let must_be = "finite and zero or more";
            return Err(ConfigError::new("current limit", value, must_be).into());
        }
        limits.current = Amps::new(value.min(self.most_current.get()));
        self.limits_due = self.limits_due.max(LIMIT_FRAMES);
        Ok(Response::Done)
    }
}

impl Motor for ODrive {
    fn supports(&self) -> TargetSet {
        self.loops.supports()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.loops.set_target(target)
    }

    fn target(&self) -> Target {
        self.loops.target()
    }

    fn feedback(&self) -> Feedback {
        let Some(Seen { at, estimates }) = &self.seen else { return Feedback::NEW };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of a turn")]
        let angle = self.shaft.phase() as f32 * 1e-6;
        let mut feedback = Feedback::new(
            *at,
            Rpm::new(self.speed(estimates)),
            // The last steps before a full turn may round up to it.
            Degrees::new(if angle < 360.0 { angle } else { 0.0 }),
            TotalAngle::from_microdegrees(self.shaft.total()),
        );
        feedback.turn_gaps = self.shaft.gaps();
        let Told { current, supply, controller, motor } = self.told;
        feedback
            .with_current(Amps::new(current.copysign(current * self.ratio)))
            .with_torque(NewtonMetres::new(current * self.torque_constant * self.ratio))
            .with_temperature(Celsius::new(motor))
            .with_controller_temperature(Celsius::new(controller))
            .with_supply(Volts::new(supply))
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.silence += dt.get();
        self.heartbeat_age += dt.get();
        self.wait(dt);
        let heard = self.silence <= self.link_timeout;
        if self.heartbeat_age > self.heartbeat_timeout {
            self.leave();
        }
        let may = drive != DriveMode::Off && self.fault.is_none() && self.clearing.is_none();
        self.wanted = may && heard && !self.loops.coasts_idle(drive);
        match (self.wanted, self.step) {
            (false, Step::Starting | Step::Running) => self.leave(),
            // With its first step first: modes come before the state they are for.
            (true, Step::Off) if self.state == AxisState::IDLE => {
                (self.step, self.beat) = (Step::Starting, 0);
            }
            _ => (),
        }
        if self.step == Step::Running {
            let measured = self.measured();
            self.loops.update(dt, drive, measured, &self.shaft, self.ratio);
        } else {
            self.loops.rest();
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if self.clearing.is_some() || self.answer.is_some() {
            return Err(RequestError::Busy);
        }
        match request {
            Request::ClearFault if self.fault.is_none() => Ok(Response::Done),
            Request::ClearFault => {
                self.clearing = Some(Clearing { waited: 0.0, errors: None });
                Ok(Response::Pending)
            }
            Request::SetZero => self.set_zero(),
            Request::CurrentLimit(limit) => self.limit_current(limit),
            _ => {
                let measured = self.measured();
                match &mut self.loops {
                    Loops::Here(servo) => servo.request(request, measured),
                    Loops::Velocity(_) | Loops::Position(_) => Err(RequestError::Unsupported),
                }
            }
        }
    }

    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        self.answer.take()
    }

    fn loops(&self) -> Option<motor::Loops> {
        self.loops.here()
    }

    fn condition(&self) -> Condition {
        let slow = self.rates.estimates < CONTROL_RATE && matches!(self.loops, Loops::Here(_));
        match self.step {
            Step::Off | Step::Starting if self.wanted => Condition::Starting,
            _ if slow => Condition::SlowFeedback,
            _ => Condition::Ready,
        }
    }
}

/// Takes over what an axis said of itself.
fn tell(place: &mut f32, value: f32) -> Result<FrameKind, FrameError> {
    if value.abs() > MOST_ELECTRICAL {
        return Err(FrameError::Unexpected);
    }
    *place = value;
    Ok(FrameKind::Other)
}

impl CanMotor for ODrive {
    fn wiring(&self) -> CanIds {
        let all = IdPattern::masked(self.node.can_id(0), NODE_MASK.into());
        let input = match self.modes.0 {
            ControlMode::Velocity => VELOCITY,
            ControlMode::Position => POSITION,
            ControlMode::Torque | ControlMode::Voltage => TORQUE,
        };
        let bare = || CanIds::new("ODrive", self.node.number().into());
        let whole = |pattern, len, rate| TxFrames { pattern, len, rate, share: Ownership::Whole };
        let exact = |message| IdPattern::exact(self.node.can_id(message));
        let build = || {
            let mut wiring = bare()
                .transmits(whole(exact(input), 8, Rate::EveryTick))?
                .transmits(whole(all, 8, Rate::Rare))?
                .transmits(whole(exact(CLEAR_ERRORS), 0, Rate::Rare))?;
            for (message, rate) in self.messages() {
                if rate > 0 {
                    let (pattern, rate) = (exact(message), Rate::Hz(rate));
                    wiring = wiring.receives(RxFrames { pattern, len: 8, rate, guard: None })?;
                }
            }
            Ok::<_, crate::wiring::CanIdsFull>(wiring)
        };
        // Five and three always fit.
        build().unwrap_or_else(|_| bare())
    }

    #[inline]
    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        match Message::from_frame(frame, self.node) {
            Ok(Message::Estimates(estimates)) => self.heard_estimates(estimates, at),
            Ok(Message::Heartbeat(heartbeat)) => Ok(self.heard_heartbeat(heartbeat)),
            Ok(Message::Currents(_)) if self.rates.currents == 0 => Err(FrameError::NotMine),
            Ok(Message::Supply(_)) if self.rates.supply == 0 => Err(FrameError::NotMine),
            Ok(Message::Currents(Currents { measured, .. })) => {
                tell(&mut self.told.current, measured.get())
            }
            Ok(Message::Supply(supply)) => tell(&mut self.told.supply, supply.voltage),
            Err(error) => self.heard_other(frame, error),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        let command = self.command();
        self.beat = if self.beat + 1 < BEATS { self.beat + 1 } else { 0 };
        if self.limits_due > 0 && self.step != Step::Starting {
            self.limits_due -= 1;
            if let Some(limits) = self.limit_command() {
                self.push(limits, tx)?;
            }
        }
        command.map_or(Ok(()), |command| self.push(command, tx))
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.push(Command::State(AxisState::IDLE), tx)
    }
}
