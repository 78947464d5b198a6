//! The motor: when the device may move, and what it is told.

use embedded_can::StandardId;
use rc10_app::maths::within;
use rc10_app::{ConfigError, NewtonMetres};
use rc10_can::CanFrame;
use rc10_time::Micros;

use super::config::{Config, Model, Own, can_ids, side};
use super::registers::{Access, CHECKED, NO_ANSWER, Register, Reply, check, reply_to};
use super::wire::{self, DeviceId, Mode, Operation, State, TIMED_OUT, operate};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName, standard};
use crate::feedback::{Condition, Fault, Feedback};
use crate::goal::Goal;
use crate::mit::{Limits, RPM_PER_RADIAN_PER_SECOND, RangedShaft};
use crate::motor::{CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::pending::{Pending, Retry};
use crate::request::{Request, RequestError, Response};
use crate::side::Side;
use crate::target::{Target, TargetError, without_effort};

/// One Damiao motor. What it does is told in the [module's documentation](super).
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Damiao {
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::damiao"))]
    model: Model,
    id: DeviceId,
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::id"))]
    master: StandardId,
    mode: Mode,
    side: Side<Own>,
    ranged: RangedShaft,
    /// Whether the [`CHECKED`] registers are, and the next of them.
    verify: bool,
    /// The longest time-out that it may have, ms; zero for any.
    timeout: f32,
    next_check: usize,
    pending: Pending<Question>,
    reported: Option<wire::Feedback>,
    fault: Option<Fault>,
    /// It was not heard for a while, and not driven since.
    was_lost: bool,
    drive: DriveMode,
    command: Command,
    /// The operation goes to the bare identifier, not to the mode's.
    is_bare: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Command {
    Operate(Operation),
    Drive(CanFrame),
}

/// A request that the device carries out itself, or a check of its registers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Question {
    /// Whether the next of the [`CHECKED`] registers is as configured; no request of the robot's.
    Check,
    Access(Access),
    Operate(Operation),
}

impl Question {
    const fn retry(self) -> Retry {
        // Every 11th tick: at 10 ms other frames of that period could keep all replies waiting.
        let retry = Retry::new(0.0105, 10);
        match self {
            // Up to 30 ms deaf, and memory that lasts for ten thousand times.
            Self::Access(Access::Save) => Retry::new(0.060, 2).only_while_off(),
            Self::Access(Access::Write(..)) | Self::Operate(Operation::StoreZero) => {
                retry.only_while_off()
            }
            _ => retry,
        }
    }
}

/// Slower than this share of `VMAX` is standing still.
const STANDSTILL: f32 = 0.005;
/// Largest angle that counts as zero just after the zero was set, rad.
const ZERO: f32 = 2e-3;

impl Damiao {
    /// The motor that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.validate()?;
        let Config { model, can_id, master_id, control, direction, verify, timeout } = config;
        let id = DeviceId::new(can_id);
        Ok(Self {
            model,
            id: id.ok_or(ConfigError::new("CAN_ID", can_id.into(), "at most 0x4FE"))?,
            master: standard(master_id),
            mode: control.mode(),
            side: side(control, &model.limits),
            ranged: RangedShaft::new(&model.limits, direction),
            verify,
            timeout: timeout.get() as f32 / 1e3,
            next_check: 0,
            pending: Pending::new(),
            reported: None,
            fault: None,
            was_lost: false,
            drive: DriveMode::Off,
            command: Command::Operate(Operation::Disable),
            is_bare: false,
        })
    }

    /// Whether the device is enabled, or what is wrong; `None` before it was heard.
    fn state(&self) -> Option<State> {
        self.reported.map(|reported| reported.state)
    }

    /// Whether its time-out ran out while it was not heard: no fault, and cleared without being asked.
    fn was_cut_off(&self) -> bool {
        self.was_lost && self.state() == Some(TIMED_OUT)
    }

    /// Whether it has to be enabled for what the bus lets it do.
    fn is_driven(&self, drive: DriveMode) -> bool {
        match drive {
            DriveMode::Off | DriveMode::Coast => false,
            DriveMode::Brake | DriveMode::Hold => true,
            // Only in MIT mode can an enabled motor be told to give no torque.
            DriveMode::Run => self.mode == Mode::Mit || *self.side.goals().goal() != Goal::Rest,
        }
    }

    fn drive(&mut self, tick: &Tick) -> CanFrame {
        let Self { model: Model { limits, .. }, side, ranged, .. } = self;
        let (runs, shaft) = (tick.mode == DriveMode::Run, &ranged.shaft);
        match side {
            Side::Here(servo) => {
                let near = match *servo.goals().goal() {
                    Goal::Angle(phase) if runs => ranged.nearest(phase),
                    _ => None,
                };
                match near {
                    Some(angle) => servo.update_towards(tick, shaft, angle),
                    None => servo.update(tick, shaft),
                }
                wire::mit(self.id, &ranged.setpoint_of(servo), limits)
            }
            Side::Device(goals, _) if self.mode == Mode::Velocity => {
                let rpm = match *goals.goal() {
                    Goal::Speed(rpm) if runs => rpm,
                    Goal::Motion if runs => {
                        within(goals.advance(tick.dt).motion.speed.get(), limits.rpm())
                    }
                    _ => 0.0,
                };
                wire::velocity(self.id, shaft.sign() * rpm / RPM_PER_RADIAN_PER_SECOND)
            }
            Side::Device(goals, Own { velocity, torque_share }) => {
                let sought = match *goals.goal() {
                    // Since a restart it may lie where the device has no number for.
                    Goal::Total(angle) if runs && ranged.reaches(angle) => Some(angle),
                    Goal::Angle(phase) if runs => ranged.nearest(phase),
                    _ => None,
                };
                let angle = if let Some(angle) = sought {
                    goals.rest();
                    angle
                } else {
                    // Where it is now until it has slowed down, then there.
                    let slow = limits.rpm() * STANDSTILL;
                    let stands = shaft.speed().get().abs() <= slow;
                    match goals.update(DriveMode::Hold, || stands.then(|| shaft.angle())) {
                        Goal::Total(angle) => angle,
                        _ => shaft.angle(),
                    }
                };
                let angle = ranged.radians_of(angle);
                if self.mode == Mode::ForcePosition {
                    wire::force_position(self.id, angle, *velocity, *torque_share)
                } else {
                    wire::position_velocity(self.id, angle, *velocity)
                }
            }
        }
    }

    /// An operation to both identifiers in turn: old firmware takes its present mode's offset only.
    fn operate(&mut self, operation: Operation, link: Link) -> Command {
        let is_obeyed = operation == Operation::Disable
            && link == Link::Online
            && self.state() != Some(State::Enabled);
        let is_repeated = matches!(self.command, Command::Operate(_));
        self.is_bare = is_repeated && !is_obeyed && !self.is_bare;
        Command::Operate(operation)
    }

    /// Whether the device is known to be set up as configured.
    const fn is_checked(&self) -> bool {
        // The time-out is the last of them.
        let count = CHECKED.len() - (self.timeout == 0.0) as usize;
        !self.verify || self.next_check >= count
    }

    /// The value that a [`CHECKED`] register is to hold.
    const fn wanted(&self, register: Register) -> f32 {
        let Limits { position, velocity, torque, .. } = self.model.limits;
        match register {
            Register::MODE => self.mode as u32 as f32,
            Register::POSITION_LIMIT => position,
            Register::VELOCITY_LIMIT => velocity,
            Register::TORQUE_LIMIT => torque,
            _ => self.timeout,
        }
    }

    /// Nothing is known of the device any more.
    fn check_again(&mut self) {
        self.next_check = 0;
        self.pending.cancel_if(Question::Check);
    }

    /// One tick of the question in flight; without one, the next check.
    fn update_pending(&mut self, tick: &Tick) {
        let (check, is_wanted) = (Question::Check, self.fault.is_none() && !self.is_checked());
        if self.pending.update_with(tick, check, check.retry(), is_wanted) {
            self.fault = self.fault.or(Some(NO_ANSWER));
        }
    }

    fn access(&self) -> Option<Access> {
        match self.pending.question()? {
            Question::Check => {
                CHECKED.get(self.next_check).map(|&(register, _)| Access::Read(register))
            }
            Question::Access(access) => Some(access),
            Question::Operate(_) => None,
        }
    }

    /// Takes a feedback as the answer to a request, if it is; whether the device has a new zero.
    fn answer(&mut self, reported: &wire::Feedback) -> bool {
        let question = self.pending.sent();
        match (question, reported.state) {
            (Some(Question::Operate(Operation::ClearError)), State::Error(code)) => {
                self.pending.fail_with(RequestError::Refused(code.into()));
                return false;
            }
            (Some(Question::Operate(Operation::ClearError)), _) => self.forget_fault(),
            (Some(Question::Operate(Operation::StoreZero)), State::Disabled)
                if reported.position.abs() <= ZERO => {}
            _ => return false,
        }
        self.pending.end(Ok(Response::Done));
        question == Some(Question::Operate(Operation::StoreZero))
    }

    fn take_reply(&mut self, reply: &Reply) -> Heard {
        let access = self.access().filter(|access| reply.answers(self.id, access));
        let access = access.ok_or(FrameError::Unasked)?;
        let held = reply.held.map(|(_, value)| value);
        if let (Some(Question::Check), Some(checked), Some(held)) =
            (self.pending.question(), CHECKED.get(self.next_check), held)
        {
            let fault = check(checked, held, self.wanted(checked.0));
            self.pending.cancel();
            self.next_check += usize::from(fault.is_none());
            self.fault = self.fault.or(fault);
            return Ok(fault.map_or(FrameKind::Other, |_| FrameKind::Fault));
        }
        self.pending.end(match (access, held) {
            (Access::Write(_, wanted), Some(held)) if wanted.bits() != held.bits() => {
                Err(RequestError::Refused(held.bits()))
            }
            (Access::Read(_), Some(held)) => Ok(Response::Register(held.bits())),
            _ => Ok(Response::Done),
        });
        if matches!(access, Access::Write(..)) {
            self.check_again();
        }
        Ok(FrameKind::Other)
    }

    fn forget_fault(&mut self) {
        self.fault = None;
        self.check_again();
    }

    /// All angles count from here: those that are sought or held stay where they are.
    fn set_zero(&mut self) {
        self.side.set_zero(self.ranged.shaft.set_zero());
    }

    /// Whether it is to go where its own loops have no number for, as since a restart it may be.
    fn is_beyond_reach(&self) -> bool {
        match (&self.side, self.drive) {
            (Side::Device(goals, _), DriveMode::Run) => {
                matches!(*goals.goal(), Goal::Total(angle) if !self.ranged.reaches(angle))
            }
            _ => false,
        }
    }

    /// The frame that is sent in this tick to the motor's own identifier.
    fn command_frame(&self) -> CanFrame {
        match self.command {
            Command::Operate(operation) => {
                operate(self.id, if self.is_bare { Mode::Mit } else { self.mode }, operation)
            }
            Command::Drive(frame) => frame,
        }
    }

    /// The stream of its register frames: an identifier with its low byte that it never uses.
    fn register_stream(&self) -> u32 {
        let unused = match self.mode {
            Mode::ForcePosition => Mode::Velocity,
            Mode::Mit | Mode::PositionVelocity | Mode::Velocity => Mode::ForcePosition,
        };
        CanFrame::key_of(self.id.command_id(unused))
    }
}

impl Motor for Damiao {
    handed_on!(supports, target, loops of [side]);
    handed_on!(fault of [fault]);
    handed_on!(response of [pending]);
    handed_on!(state but [model, master]);

    fn name(&self) -> MotorName {
        MotorName { model: self.model.name, id: self.id.raw() }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again.
        if target == self.target() {
            return self.side.set_target(target);
        }
        self.supports().accepts(&target)?;
        let is_in_range = match Goal::of(target)? {
            // The device cannot tell of a higher speed either.
            Goal::Speed(rpm) => rpm.abs() <= self.model.limits.rpm(),
            Goal::Angle(phase) => self.ranged.nearest(phase).is_some(),
            _ => {
                let rpm = match target {
                    Target::Motion(motion) => motion.speed.get(),
                    _ => 0.0,
                };
                rpm.abs() <= self.model.limits.rpm() && self.ranged.check(&target).is_ok()
            }
        };
        if !is_in_range {
            return Err(TargetError::OutOfRange(target.kind()));
        }
        if let Side::Device(goals, _) = &self.side {
            without_effort(goals.supports(), &target)?;
        }
        self.side.set_target(target)
    }

    fn feedback(&self) -> Feedback {
        let shaft = &self.ranged.shaft;
        let feedback = shaft.feedback();
        let Some(reported) = &self.reported else { return feedback };
        feedback
            .with_torque(NewtonMetres::new(reported.torque * shaft.sign()))
            .with_temperature(reported.motor_temperature)
            .with_controller_temperature(reported.driver_temperature)
            .with_effort(self.side.effort())
    }

    fn update(&mut self, tick: &Tick) {
        self.drive = tick.mode;
        self.update_pending(tick);
        let is_driven = self.is_driven(tick.mode) && self.fault.is_none() && self.is_checked();
        if is_driven && self.state() == Some(State::Enabled) {
            (self.is_bare, self.was_lost) = (false, false);
            self.command = Command::Drive(self.drive(tick));
            return;
        }
        self.side.rest();
        let usual = match (self.was_cut_off(), is_driven) {
            (true, _) => Operation::ClearError,
            (_, true) => Operation::Enable,
            (_, false) => Operation::Disable,
        };
        let operation = match self.pending.question() {
            Some(Question::Operate(asked)) => self.pending.take_due().map_or(usual, |_| asked),
            _ => usual,
        };
        self.command = self.operate(operation, tick.link);
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.pending.cancel_if(Question::Check);
        self.pending.check_free()?;
        let register = |number: u16| {
            let error = ConfigError::new("register", number.into(), "255 or less");
            u8::try_from(number).map(Register).map_err(|_| error)
        };
        let question = match request {
            Request::ClearFault if !self.ranged.shaft.is_known() => {
                return Err(RequestError::NoFeedback);
            }
            Request::ClearFault if matches!(self.state(), Some(State::Error(_))) => {
                Question::Operate(Operation::ClearError)
            }
            Request::ClearFault => {
                self.forget_fault();
                return Ok(Response::Done);
            }
            Request::StoreZero => Question::Operate(Operation::StoreZero),
            Request::ReadRegister(number) => Question::Access(Access::Read(register(number)?)),
            Request::WriteRegister(number, bits) => {
                let register = register(number)?;
                let access = Access::Write(register, register.value_of(bits));
                access.pack(self.id)?;
                Question::Access(access)
            }
            Request::SaveRegisters => Question::Access(Access::Save),
            _ => return self.side.request(request, &mut self.ranged.shaft),
        };
        let retry = question.retry();
        if retry.only_while_off && self.state() == Some(State::Enabled) {
            return Err(RequestError::NotWhileArmed);
        }
        self.pending.ask(question, retry)
    }

    fn condition(&self) -> Condition {
        let is_enabled = self.state() == Some(State::Enabled);
        let is_starting = !self.is_checked() || (self.is_driven(self.drive) && !is_enabled);
        match is_starting {
            true => Condition::Starting,
            false if self.is_beyond_reach() => Condition::NotFollowing,
            false => Condition::Ready,
        }
    }
}

impl CanMotor for Damiao {
    fn can_ids(&self) -> CanIds {
        can_ids(self.id.raw(), self.master.as_raw(), self.mode)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        if frame.key() != CanFrame::key_of(self.master) {
            return Err(FrameError::NotMine);
        }
        if let Some(reply) = reply_to(self.id, frame) {
            return self.take_reply(&reply?);
        }
        let reported = wire::Feedback::unpack(frame, &self.model.limits)?;
        if !self.id.answers_as(reported.id) {
            return Err(FrameError::NotMine);
        }
        // Disabled, but not by us: it has started anew.
        let has_restarted = self.state() == Some(State::Enabled)
            && reported.state == State::Disabled
            && !matches!(self.command, Command::Operate(_));
        if self.pending.is_busy() && self.answer(&reported) {
            self.set_zero();
            self.ranged.start_over();
        }
        let before = self.ranged.shaft.before();
        let rpm = reported.velocity * RPM_PER_RADIAN_PER_SECOND;
        let jump = self.ranged.follow(reported.steps, rpm, at, link);
        if let Some(jump) = jump {
            // It still knows its angle within the turn.
            self.ranged.shaft.bridge(jump, before);
        }
        if has_restarted || jump.is_some() || link != Link::Online {
            self.check_again();
            self.side.rest();
        }
        self.reported = Some(reported);
        self.was_lost |= link != Link::Online;
        let fault = reported.state.fault().filter(|_| !self.was_cut_off());
        self.fault = fault.or(self.fault);
        Ok(if self.fault.is_some() { FrameKind::Fault } else { FrameKind::Feedback })
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        // All commands, to each identifier, take each other's place.
        let stream = CanFrame::key_of(self.id.command_id(self.mode));
        tx.push_as(self.command_frame(), stream)?;
        let access = self.access().filter(|_| self.pending.take_due().is_some());
        match access.and_then(|access| access.pack(self.id).ok()) {
            Some(frame) => tx.push_as(frame, self.register_stream()),
            None => Ok(()),
        }
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(operate(self.id, self.mode, Operation::Disable))?;
        if self.mode == Mode::Mit {
            return Ok(());
        }
        tx.push(operate(self.id, Mode::Mit, Operation::Disable))
    }
}
