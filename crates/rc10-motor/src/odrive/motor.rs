//! The motor: its shaft, its loops or the axis's, its frames.

use rc10_app::angle::shortest_way;
use rc10_app::{Amps, Celsius, ConfigError, NewtonMetres, Seconds, Volts};
use rc10_can::CanFrame;
use rc10_time::Micros;

use super::config::{Config, Control, Firmware, Limits, NODE_MASK, Rates, can_ids};
use super::wire::{
    AxisState, Command, ControlMode, Currents, Estimates, Heartbeat, InputMode, Message, Node,
    TEMPERATURES, Temperatures,
};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Condition, Fault, Feedback};
use crate::goal::{Goal, Goals, Moment};
use crate::motor::{CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::pending::{Pending, Retry};
use crate::request::{Request, RequestError, Response};
use crate::servo::Servo;
use crate::shaft::{Shaft, TURN};
use crate::side::Side;
use crate::target::{Motion, Target, TargetError, TargetKind, TargetSet, without_effort};

/// From here on an f32 does not tell one turn from the next.
const MAX_TURNS: f32 = 16_777_216.0;
/// No encoder turns so fast, turns a second.
const MAX_SPEED: f32 = 10_000.0;
/// No axis has this many volts or amperes.
const MAX_ELECTRICAL: f32 = 10_000.0;
/// Turns that an axis may be off its speed's way, twice after a silence, before it has restarted.
const MAX_ASIDE: f32 = 0.25;
/// Below this, estimates are too seldom for loops that run here.
const CONTROL_RATE: u16 = 200;
/// Once the axis is idle it is told so in every tenth tick only.
const REMIND_EVERY: u8 = 10;
/// The steps of switching on follow each other in ticks. Nothing tells whether modes and limits were heard, and in
/// another mode an axis takes no torque: they go out in this many rounds before the axis is switched on.
const START_STEPS: u8 = 4;
const START_ROUNDS: u8 = 3;
/// A multiple of both.
const BEATS: u8 = 20;
/// Largest velocity and torque beside a position: an i16 of thousandths of turns/s and N m.
const MAX_BESIDE: f32 = 32.767;
/// New limits are not answered, so they are sent three times.
const LIMIT_FRAMES: u8 = 3;
/// An axis with loops of its own gets its current in this many ticks, to come back softly.
const SOFT_TICKS: u8 = 20;
/// Tries to clear errors until the heartbeats have to say that they are gone.
const CLEAR_TRIES: u8 = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Step {
    Off,
    /// Idle; told how to understand its inputs, and to follow them.
    Starting,
    Running,
}

/// The input of the loops of an axis, and what they add to their own, of a motion that is known.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
struct Input {
    /// Velocity (turns a second) or position (turns).
    value: f32,
    /// Beside a position, turns a second.
    velocity: f32,
    /// N m at the motor.
    torque: f32,
}

/// One axis of an `ODrive`.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct ODrive {
    node: Node,
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::odrive"))]
    firmware: Firmware,
    rates: Rates,
    modes: (ControlMode, InputMode),
    limits: Option<Limits>,
    /// The current limit of the configuration: no request goes beyond.
    max_current: Amps,
    limits_due: u8,
    torque_constant: f32,
    /// Turns of the encoder's shaft per turn of the output, with the direction.
    ratio: f32,
    shaft: Shaft,
    /// Loops here give the axis torques.
    side: Side<Input>,
    estimates: Estimates,
    /// Amperes, volts and degrees Celsius; NaN until the axis has sent them.
    current: f32,
    supply: f32,
    controller_temperature: f32,
    temperature: f32,
    step: Step,
    /// Whether it may drive, as of the last tick.
    wanted: bool,
    state: AxisState,
    fault: Option<Fault>,
    /// Time since the last heartbeat, and how long it may be, s.
    heartbeat_age: f32,
    heartbeat_timeout: f32,
    /// Clearing errors, the only request that waits for the axis.
    pending: Pending<()>,
    /// Counts ticks, 0 ..< [`BEATS`].
    beat: u8,
}

impl ODrive {
    /// The axis that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        use TargetKind::{Angle, Coast, Motion, Speed, SpeedMotion, TotalAngle};
        config.validate()?;
        let node = config.checked_node()?;
        let in_axis = |kinds| Side::Device(Goals::new(TargetSet::of(kinds)), Input::default());
        Ok(Self {
            node,
            firmware: config.firmware,
            rates: config.rates,
            modes: config.control.modes(),
            limits: config.limits,
            max_current: config.limits.map_or(Amps::ZERO, |limits| limits.current),
            limits_due: 0,
            torque_constant: config.torque_constant.unwrap_or(f32::NAN),
            ratio: config.gear.ratio() * f32::from(config.direction.sign()),
            // No finer steps: those of a total angle.
            shaft: Shaft::new(TURN.unsigned_abs(), config.gear, config.direction),
            side: match config.control {
                Control::Torque(cascade) => Side::Here(Servo::of(TargetKind::Torque, cascade)),
                Control::Velocity(_) => in_axis(&[Coast, Speed, SpeedMotion]),
                // The others make a motion of their own on the way.
                Control::Position(InputMode::Passthrough) => {
                    in_axis(&[Coast, Angle, TotalAngle, Motion])
                }
                Control::Position(_) => in_axis(&[Coast, Angle, TotalAngle]),
            },
            estimates: Estimates { position: 0.0, velocity: 0.0 },
            current: f32::NAN,
            supply: f32::NAN,
            controller_temperature: f32::NAN,
            temperature: f32::NAN,
            step: Step::Off,
            wanted: false,
            state: AxisState::default(),
            fault: None,
            heartbeat_age: f32::INFINITY,
            heartbeat_timeout: (3.0 / f32::from(config.rates.heartbeat)).max(0.01) * 1.2,
            pending: Pending::new(),
            beat: 0,
        })
    }

    /// The state that the axis reports.
    pub const fn state(&self) -> AxisState {
        self.state
    }

    fn heard_estimates(&mut self, estimates: Estimates, at: Micros, link: Link) -> Heard {
        let Estimates { position, velocity } = estimates;
        if position.abs() > MAX_TURNS || velocity.abs() > MAX_SPEED {
            return Err(FrameError::Encoder);
        }
        let before = core::mem::replace(&mut self.estimates, estimates);
        if self.shaft.is_known() {
            let silence = Seconds::from_micros(at.since(self.shaft.at()).get()).get();
            let turned = before.velocity.abs().max(velocity.abs()) * silence;
            let aside = (position - before.position).abs() - turned;
            if link != Link::Online || aside > MAX_ASIDE {
                self.returned(before.position, aside, link);
            } else {
                self.follow(before.position);
            }
        } else {
            self.shaft.start(microdegrees(position));
        }
        self.shaft.measure(velocity * 60.0, at);
        Ok(FrameKind::Feedback)
    }

    /// The encoder's shaft was there at the estimate before.
    fn follow(&mut self, before: f32) {
        let steps = microdegrees(self.estimates.position) - microdegrees(before);
        match i32::try_from(steps) {
            Ok(steps) => self.shaft.move_by(steps),
            Err(_) => self.shaft.jump_by(steps),
        }
    }

    /// After a silence, or restarted in a blink: maybe another axis. One that was restarted counts
    /// from anywhere, and its angle goes on from where it was.
    fn returned(&mut self, before: f32, aside: f32, link: Link) {
        self.shaft.count_gap();
        if link != Link::Online && aside <= 2.0 * MAX_ASIDE {
            self.follow(before);
        }
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
                if self.is_in_axis() {
                    self.limits_due = SOFT_TICKS + LIMIT_FRAMES;
                }
                Step::Running
            }
            Step::Running if !closed => Step::Off,
            step => step,
        };
        let errors = heartbeat.errors & !self.firmware.starting;
        if let Some(fault) = self.firmware.fault(errors) {
            self.fault = Some(fault);
            self.pending.fail_with(RequestError::Refused(errors));
            return FrameKind::Fault;
        }
        if self.pending.question().is_some() {
            self.fault = None;
            self.pending.end(Ok(Response::Done));
        }
        FrameKind::Other
    }

    /// Whether the axis closes any of its loops.
    const fn is_in_axis(&self) -> bool {
        matches!(self.side, Side::Device(..))
    }

    /// Takes what only firmware 0.6 sends; `error` is why it is no message of both.
    fn heard_other(&mut self, frame: &CanFrame, error: FrameError) -> Heard {
        let number = frame.key() & !u32::from(NODE_MASK);
        let mut sent = self.rates.all().into_iter().filter(|(_, rate)| *rate > 0);
        let is_declared = sent.any(|(message, _)| u32::from(message) == number);
        if !is_declared || error == FrameError::NotMine {
            return Err(FrameError::NotMine);
        }
        if self.firmware.has_temperatures && number == u32::from(TEMPERATURES) {
            let Temperatures { controller, motor } = Temperatures::from_frame(frame, self.node)?;
            (self.controller_temperature, self.temperature) = (controller.get(), motor.get());
            return Ok(FrameKind::Other);
        }
        Err(error)
    }

    fn limit_command(&self) -> Option<Command> {
        let Limits { speed, current } = self.limits?;
        let ticks_left = match self.step {
            _ if !self.is_in_axis() => 0,
            Step::Starting => SOFT_TICKS,
            Step::Off | Step::Running => self.limits_due.saturating_sub(LIMIT_FRAMES),
        };
        let share = 1.0 - f32::from(ticks_left) / f32::from(SOFT_TICKS);
        let velocity = speed.get() * self.ratio.abs() / 60.0;
        Some(Command::Limits { velocity, current: current * share })
    }

    fn command(&mut self) -> Option<Command> {
        let (control, input) = self.modes;
        match (self.step, self.beat % START_STEPS) {
            (Step::Off, _) if self.pending.take_due().is_some() => Some(Command::ClearErrors),
            (Step::Off, _) => {
                let is_idle = self.state == AxisState::IDLE && self.pending.question().is_none();
                let silent = is_idle && !self.beat.is_multiple_of(REMIND_EVERY);
                (!silent).then_some(Command::State(AxisState::IDLE))
            }
            // One a tick: within a tick the lowest message number would go first.
            (Step::Starting, 0) => {
                Some(self.limit_command().unwrap_or(Command::Modes(control, input)))
            }
            (Step::Starting, 3) if self.beat >= START_STEPS * (START_ROUNDS - 1) => {
                Some(Command::State(AxisState::CLOSED_LOOP))
            }
            (Step::Starting, 1 | 3) => Some(Command::Modes(control, input)),
            (Step::Starting | Step::Running, _) => Some(self.input()),
        }
    }

    /// The input that was decided in this tick.
    fn input(&self) -> Command {
        let Side::Device(_, Input { value, velocity, torque }) = self.side else {
            return Command::Torque(NewtonMetres::new(self.side.effort() / self.ratio));
        };
        let torque = NewtonMetres::new(torque);
        match self.modes.0 {
            ControlMode::Position => Command::Position { position: value, velocity, torque },
            _ => Command::Velocity { velocity: value, torque },
        }
    }

    fn push(&self, command: Command, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(command.pack(self.node).unwrap_or_else(|nan| nan.neutral))
    }

    fn limit_current(&mut self, limit: Amps) -> Result<Response, RequestError> {
        let Some(limits) = &mut self.limits else { return Err(RequestError::Unsupported) };
        let value = limit.get();
        let good = value.is_finite() && value >= 0.0;
        ConfigError::check(good, "current limit", value, "finite and zero or more")?;
        limits.current = Amps::new(value.min(self.max_current.get()));
        self.limits_due = self.limits_due.max(LIMIT_FRAMES);
        Ok(Response::Done)
    }

    /// Whether this is the way to coast: an axis that closes its own loops has to be idle for it.
    fn coasts_idle(&self, mode: DriveMode) -> bool {
        self.is_in_axis()
            && match mode {
                DriveMode::Off | DriveMode::Coast => true,
                DriveMode::Run => *self.side.goals().goal() == Goal::Rest,
                DriveMode::Brake | DriveMode::Hold => false,
            }
    }
}

/// Microdegrees from the axis's own zero, cut off towards it: of turns within ± [`MAX_TURNS`].
fn microdegrees(turns: f32) -> i64 {
    const PARTS: i64 = 1 << 31;
    // Both are exact, and so is the difference.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^24; less than a turn")]
    #[expect(clippy::cast_precision_loss, reason = "at most 2^24; a power of two")]
    let (whole, part) = (turns as i32, ((turns - turns as i32 as f32) * PARTS as f32) as i32);
    i64::from(whole) * i64::from(TURN) + i64::from(part) * i64::from(TURN) / PARTS
}

impl Motor for ODrive {
    handed_on!(supports, target, loops of [side]);
    handed_on!(fault of [fault]);
    handed_on!(response of [pending]);
    handed_on!(state but [firmware]);

    fn name(&self) -> MotorName {
        MotorName { model: "ODrive", id: self.node.number().into() }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // A ramp of the axis's own leaves an effort out.
        if self.is_in_axis() && self.modes.1 != InputMode::Passthrough {
            without_effort(self.supports(), &target)?;
        }
        if let (ControlMode::Position, Target::Motion(motion)) = (self.modes.0, target) {
            self.supports().accepts(&target)?;
            let velocity = motion.speed.get() * self.ratio / 60.0;
            let torque = (motion.effort + motion.inertia) / self.ratio;
            if velocity.abs().max(torque.abs()) > MAX_BESIDE {
                return Err(TargetError::OutOfRange(target.kind()));
            }
        }
        self.side.set_target(target)
    }

    fn feedback(&self) -> Feedback {
        let feedback = self.shaft.feedback();
        if !self.shaft.is_known() {
            return feedback;
        }
        feedback
            .with_current(Amps::new(self.current * self.shaft.sign()))
            .with_torque(NewtonMetres::new(self.current * self.torque_constant * self.ratio))
            .with_temperature(Celsius::new(self.temperature))
            .with_controller_temperature(Celsius::new(self.controller_temperature))
            .with_supply(Volts::new(self.supply))
            .with_effort(self.side.effort())
    }

    fn update(&mut self, tick: &Tick) {
        self.heartbeat_age += tick.dt.get();
        self.pending.update(tick);
        if self.heartbeat_age > self.heartbeat_timeout {
            self.leave();
        }
        let may = tick.mode != DriveMode::Off && tick.link == Link::Online && self.fault.is_none();
        self.wanted = may && !self.coasts_idle(tick.mode);
        match (self.wanted, self.step) {
            (false, Step::Starting | Step::Running) => self.leave(),
            // With its first step first: modes come before the state they are for.
            (true, Step::Off) if self.state == AxisState::IDLE => {
                (self.step, self.beat) = (Step::Starting, 0);
            }
            _ => (),
        }
        let runs = self.step == Step::Running;
        let Estimates { position, velocity } = self.estimates;
        let shaft = &self.shaft;
        match (&mut self.side, self.modes.0) {
            (Side::Here(servo), _) if runs => servo.update(tick, shaft),
            (Side::Here(servo), _) => servo.rest(),
            (Side::Device(goals, input), ControlMode::Position) if runs => {
                // To stand still is to hold.
                let mode = if tick.mode == DriveMode::Run { tick.mode } else { DriveMode::Hold };
                let error = match goals.update(mode, || Some(shaft.angle())) {
                    Goal::Total(angle) => angle.minus(shaft.angle()).microdegrees(),
                    Goal::Angle(phase) => shortest_way(shaft.phase(), phase, TURN).into(),
                    Goal::Motion => match goals.motion().angle {
                        Some(angle) => angle.minus(shaft.angle()).microdegrees(),
                        None => 0,
                    },
                    _ => 0,
                };
                #[expect(clippy::cast_precision_loss, reason = "exact once it is short")]
                let turns = error as f32 * (self.ratio / TURN as f32);
                *input = Input { value: position + turns, ..Input::default() };
                if let (DriveMode::Run, Goal::Motion) = (tick.mode, goals.goal()) {
                    let Moment { motion, gone } = goals.advance(tick.dt);
                    input.value += gone * (self.ratio / 360.0);
                    input.velocity = motion.speed.get() * (self.ratio / 60.0);
                    input.torque = (motion.effort + motion.inertia) / self.ratio;
                }
            }
            (Side::Device(goals, input), _) if runs => {
                *input = Input::default();
                // A velocity loop holds no angle.
                let rpm = match goals.update(tick.mode, || None) {
                    Goal::Speed(rpm) => rpm,
                    Goal::Motion => {
                        let Motion { speed, inertia, effort, .. } = goals.advance(tick.dt).motion;
                        input.torque = (effort + inertia) / self.ratio;
                        speed.get()
                    }
                    _ => 0.0,
                };
                input.value = rpm * self.ratio / 60.0;
            }
            // While it starts: what changes nothing in how the shaft moves now.
            (Side::Device(goals, input), control) => {
                goals.rest();
                let value = if control == ControlMode::Position { position } else { velocity };
                *input = Input { value, ..Input::default() };
            }
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.pending.check_free()?;
        match request {
            Request::ClearFault if self.fault.is_none() => Ok(Response::Done),
            Request::ClearFault => {
                let every = self.heartbeat_timeout / f32::from(CLEAR_TRIES);
                self.pending.ask((), Retry::new(every, CLEAR_TRIES))
            }
            Request::CurrentLimit(limit) => self.limit_current(limit),
            _ => self.side.request(request, &mut self.shaft),
        }
    }

    fn condition(&self) -> Condition {
        match self.step {
            Step::Off | Step::Starting if self.wanted => Condition::Starting,
            _ if self.rates.estimates < CONTROL_RATE && !self.is_in_axis() => {
                Condition::SlowFeedback
            }
            _ => Condition::Ready,
        }
    }
}

/// Takes over what an axis measured beside its estimates.
fn store(field: &mut f32, value: f32) -> Heard {
    if value.abs() > MAX_ELECTRICAL {
        return Err(FrameError::Unexpected);
    }
    *field = value;
    Ok(FrameKind::Other)
}

impl CanMotor for ODrive {
    fn can_ids(&self) -> CanIds {
        can_ids(self.node.number(), self.modes.0, &self.rates)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        match Message::from_frame(frame, self.node) {
            Ok(Message::Estimates(estimates)) => self.heard_estimates(estimates, at, link),
            Ok(Message::Heartbeat(heartbeat)) => Ok(self.heard_heartbeat(heartbeat)),
            Ok(Message::Currents(_)) if self.rates.currents == 0 => Err(FrameError::NotMine),
            Ok(Message::Supply(_)) if self.rates.supply == 0 => Err(FrameError::NotMine),
            Ok(Message::Currents(Currents { measured, .. })) => {
                store(&mut self.current, measured.get())
            }
            Ok(Message::Supply(supply)) => store(&mut self.supply, supply.voltage),
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
