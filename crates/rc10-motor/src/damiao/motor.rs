//! The motor: what a target becomes, and when the device may move.

use embedded_can::StandardId;
use rc10_app::{ConfigError, Seconds, TotalAngle};
use rc10_can::{CanFrame, Micros};

use super::control::{Control, Steering};
use super::dialogue::{Dialogue, News, Situation};
use super::goal::Goal;
use super::models::Model;
use super::shaft::{LONGEST_SILENCE, RPM_PER_RADIAN_PER_SECOND, Shaft};
use super::wire::{self, DeviceId, Mode, Operation, REGISTERS, State, operate, standard};
use crate::mit::Setpoint;
use crate::motor::{
    Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Loops, Motor, Request,
    RequestError, Response, Target, TargetError, TargetSet,
};
use rc10_app::Direction;

/// One Damiao motor. What it does is told in the [module's documentation](super).
#[derive(Clone, Debug)]
pub struct Damiao {
    model: Model,
    id: DeviceId,
    master: StandardId,
    direction: Direction,
    steering: Steering,
    dialogue: Dialogue,
    shaft: Shaft,
    target: Target,
    goal: Goal,
    /// What the servo was last told to seek for [`Goal::Angle`].
    sought: Option<i64>,
    /// Where to stay while the bus says hold.
    held: Option<i64>,
    /// 0 ..= 1: how much of the largest torque an impedance may ask for, while it begins.
    softness: f32,
    fault: Option<Fault>,
    drive: DriveMode,
    /// Seconds since the last feedback.
    silence: f32,
    command: Command,
    /// The operation goes to the bare identifier, not to the mode's.
    is_bare: bool,
}

/// What goes out in this tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Command {
    Operate(Operation),
    Mit(Setpoint),
    /// rad
    Position(f32),
    /// rad/s
    Velocity(f32),
}

/// Ownership of the largest torque by which that of an impedance may grow in a second: all of it in
/// 20 ms.
const SOFT_SLOPE: f32 = 50.0;
/// Slower than this share of `VMAX` is standing still.
const STANDSTILL: f32 = 0.005;

impl Damiao {
    /// The motor that listens to `can_id` and answers with `master_id`, controlled as `control`
    /// says, turning forward. The limits of the `model` are to be those in the device.
    ///
    /// # Errors
    /// [`ConfigError`], naming what cannot be: `CAN_ID` above 0x4FE, or ending in 0xFF as register
    /// frames do; `MST_ID` above 0x7FE, or with the low byte of `CAN_ID` (the motor would answer
    /// itself); limits, gains or speeds that are not above zero, or beyond the model's.
    pub fn new(
        model: Model,
        can_id: u16,
        master_id: u16,
        control: Control,
    ) -> Result<Self, ConfigError> {
        Self::build(model, can_id, master_id, control)
            .map_err(|error| error.of_device(model.name, can_id))
    }

    fn build(
        model: Model,
        can_id: u16,
        master_id: u16,
        control: Control,
    ) -> Result<Self, ConfigError> {
        let error = |field, value: u16, must_be| ConfigError::new(field, value.into(), must_be);
        let id = DeviceId::new(can_id)
            .filter(|id| id.raw() & 0xFF != REGISTERS & 0xFF)
            .ok_or(error("CAN_ID", can_id, "at most 0x4FE, its low byte not 0xFF"))?;
        if master_id >= REGISTERS || (master_id ^ can_id) & 0xFF == 0 {
            let must_be = "at most 0x7FE, its low byte not that of CAN_ID";
            return Err(error("MST_ID", master_id, must_be));
        }
        let limits = model.limits.checked()?;
        let steering = Steering::new(control, &limits)?;
        Ok(Self {
            model,
            id,
            master: standard(master_id),
            direction: Direction::Forward,
            dialogue: Dialogue::new(id, steering.mode(), limits),
            steering,
            shaft: Shaft::new(&limits, Direction::Forward),
            target: Target::Coast,
            goal: Goal::Rest,
            sought: None,
            held: None,
            softness: 0.0,
            fault: None,
            drive: DriveMode::Off,
            silence: f32::MAX,
            command: Command::Operate(Operation::Disable),
            is_bare: false,
        })
    }

    /// Turning the given way.
    #[must_use]
    pub fn with_direction(mut self, direction: Direction) -> Self {
        self.direction = direction;
        self.shaft = Shaft::new(&self.model.limits, direction);
        self
    }

    /// Whether registers 10 and 21 to 23 are read, and compared with the mode and the limits given
    /// here, before the motor is ever enabled, and again when it comes back: so it is unless told
    /// otherwise. Without, wrong limits scale every value and nothing tells: only for firmware that
    /// knows no registers.
    #[must_use]
    pub const fn verify_limits(mut self, verify: bool) -> Self {
        self.dialogue.set_verify(verify);
        self
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> &Model {
        &self.model
    }

    /// What it listens to.
    #[must_use]
    pub const fn can_id(&self) -> DeviceId {
        self.id
    }

    /// What it answers with.
    #[must_use]
    pub const fn master_id(&self) -> StandardId {
        self.master
    }

    /// How it is controlled.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.steering.mode()
    }

    /// Whether it has to be enabled for what the bus lets it do.
    fn is_driven(&self, drive: DriveMode) -> bool {
        match drive {
            DriveMode::Off | DriveMode::Coast => false,
            DriveMode::Brake | DriveMode::Hold => true,
            // Only in MIT mode can an enabled motor be told to give no torque.
            DriveMode::Run => self.steering.mode() == Mode::Mit || self.goal != Goal::Rest,
        }
    }

    fn situation(&self) -> Situation {
        Situation {
            alive: self.silence <= longest_silence(),
            off: self.drive == DriveMode::Off,
            faulted: self.fault.is_some(),
            state: self.shaft.state(),
        }
    }

    /// Whatever drives next starts softly.
    fn rest(&mut self) {
        if let Steering::Mit(servo) = &mut self.steering {
            servo.rest();
        }
        (self.softness, self.held) = (0.0, None);
    }

    /// One step of an enabled motor.
    fn steer(&mut self, dt: Seconds, drive: DriveMode) -> Command {
        let runs = drive == DriveMode::Run;
        match &mut self.steering {
            Steering::Mit(servo) => {
                let most = servo.cascade().speed.output_limit;
                if let (true, Goal::Impedance(wanted)) = (runs, self.goal) {
                    servo.rest();
                    self.softness = (self.softness + SOFT_SLOPE * dt.get()).min(1.0);
                    // All of it is taken back by one factor: the equilibrium stays.
                    let torque = wanted.torque.clamp(-most, most);
                    let law = self.shaft.torque_of(&Setpoint { torque, ..wanted }).abs();
                    let limit = most * self.softness;
                    let share = if law > limit { limit / law } else { 1.0 };
                    return Command::Mit(Setpoint {
                        kp: wanted.kp * share,
                        kd: wanted.kd * share,
                        torque: torque * share,
                        ..wanted
                    });
                }
                self.softness = 0.0;
                if let (true, Goal::Angle(phase)) = (runs, self.goal) {
                    let near = self.shaft.nearest(phase);
                    if let (Some(total), true) = (near, near != self.sought) {
                        let angle = TotalAngle::from_microdegrees(total);
                        self.sought = servo.set_target(Target::TotalAngle(angle)).ok().and(near);
                    }
                }
                let torque = servo.update(dt, drive, self.shaft.measured()) * self.shaft.sign();
                Command::Mit(Setpoint { torque, ..Setpoint::COAST })
            }
            Steering::Velocity => Command::Velocity(match self.goal {
                Goal::Velocity(velocity) if runs => velocity,
                _ => 0.0,
            }),
            Steering::PositionVelocity { .. } | Steering::ForcePosition { .. } => {
                let total = match self.goal {
                    // Since a restart it may lie where the device has no number for.
                    Goal::Total(total) if runs && self.shaft.reaches(total) => Some(total),
                    Goal::Angle(phase) if runs => self.shaft.nearest(phase),
                    _ => None,
                };
                let total = if let Some(total) = total {
                    self.held = None;
                    total
                } else {
                    self.standstill()
                };
                Command::Position(self.shaft.device_radians(total))
            }
        }
    }

    /// Where to stay: where it is now until it has slowed down, then there.
    fn standstill(&mut self) -> i64 {
        let now = self.shaft.total();
        let slow = self.model.limits.velocity() * RPM_PER_RADIAN_PER_SECOND * STANDSTILL;
        let stands = self.shaft.measured().is_some_and(|measured| measured.rpm.abs() <= slow);
        if self.held.is_none() && stands {
            self.held = Some(now);
        }
        self.held.unwrap_or(now)
    }

    /// An operation, alternating between both identifiers until the device does it: old firmware
    /// takes it only with the offset of the mode it is in, and that may be another than ours.
    fn operate(&mut self, operation: Operation) -> Command {
        let state = self.shaft.state();
        let obeyed = match operation {
            Operation::Disable => self.situation().alive && state != Some(State::Enabled),
            Operation::Enable | Operation::ClearError | Operation::StoreZero => false,
        };
        let repeated = matches!(self.command, Command::Operate(_));
        self.is_bare = repeated && !obeyed && !self.is_bare;
        Command::Operate(operation)
    }

    /// Where a change of the zero by `zero` leaves what is sought: the same number commanded again
    /// lies elsewhere.
    fn shift(&mut self, zero: i64) {
        if let Steering::Mit(servo) = &mut self.steering {
            servo.set_zero(zero);
        }
        self.held = self.held.map(|held| held.saturating_sub(zero));
        if let Goal::Total(total) = self.goal {
            self.goal = Goal::Total(total.saturating_sub(zero));
        }
        if matches!(self.target, Target::TotalAngle(_) | Target::Impedance(_)) {
            self.target = Target::Coast;
        }
        self.sought = None;
    }

    /// Takes a frame that came with its `MST_ID`.
    pub(super) fn hear(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        if let Some(reply) = self.dialogue.hear(frame) {
            let (heard, fault) = reply?;
            self.fault = self.fault.or(fault);
            return Ok(heard);
        }
        let told = wire::Feedback::unpack(frame, &self.model.limits)?;
        if !self.id.answers_as(told.id) {
            return Err(FrameError::NotMine);
        }
        self.silence = 0.0;
        let before = self.shaft.state();
        let is_new = self.shaft.hear(told, at);
        // Nobody disabled it: it has started anew.
        let has_restarted = before == Some(State::Enabled)
            && told.state == State::Disabled
            && !matches!(self.command, Command::Operate(_));
        if is_new || has_restarted {
            self.dialogue.start_over();
            self.rest();
        }
        match self.dialogue.feedback(&told) {
            News::Cleared => self.forget_fault(),
            News::Zeroed => self.shaft.device_zeroed(),
            News::Nothing => (),
        }
        self.fault = told.state.fault().or(self.fault);
        Ok(if self.fault.is_some() { FrameKind::Fault } else { FrameKind::Feedback })
    }

    fn forget_fault(&mut self) {
        self.fault = None;
        self.dialogue.start_over();
    }

    /// What it sends in this tick to its own identifier.
    pub(super) fn command_frame(&self) -> CanFrame {
        match (self.command, &self.steering) {
            (Command::Operate(operation), steering) => {
                let mode = if self.is_bare { Mode::Mit } else { steering.mode() };
                operate(self.id, mode, operation)
            }
            (Command::Mit(setpoint), _) => wire::mit(self.id, &setpoint, &self.model.limits),
            (Command::Velocity(velocity), _) => wire::velocity(self.id, velocity),
            (Command::Position(position), &Steering::ForcePosition { velocity, share }) => {
                wire::force_position(self.id, position, velocity, share)
            }
            (Command::Position(position), steering) => {
                wire::position_velocity(self.id, position, steering.velocity())
            }
        }
    }

    /// What it sends in this tick about registers.
    pub(super) fn register_frame(&mut self) -> Option<CanFrame> {
        self.dialogue.frame()
    }
}

impl Motor for Damiao {
    fn supports(&self) -> TargetSet {
        self.steering.supports()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again; but coasting is also what a target becomes
        // whose numbers lie elsewhere since a new zero.
        let is_same = target == self.target && (target != Target::Coast || self.goal == Goal::Rest);
        if is_same {
            return Ok(());
        }
        self.supports().accepts(&target)?;
        let goal = Goal::of(target, &self.steering, &self.shaft, &self.model.limits)?;
        if let (Steering::Mit(servo), Goal::Servo | Goal::Rest) = (&mut self.steering, goal) {
            servo.set_target(target)?;
        }
        (self.goal, self.target, self.sought) = (goal, target, None);
        Ok(())
    }

    fn target(&self) -> Target {
        self.target
    }

    fn feedback(&self) -> Feedback {
        self.shaft.feedback()
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.silence += dt.get();
        self.drive = drive;
        let situation = self.situation();
        if let Some(fault) = self.dialogue.update(dt, situation) {
            self.fault = Some(fault);
        }
        let is_driven =
            self.is_driven(drive) && self.fault.is_none() && self.dialogue.is_verified();
        if is_driven && situation.state == Some(State::Enabled) {
            self.is_bare = false;
            self.command = self.steer(dt, drive);
            return;
        }
        self.rest();
        let usual = if is_driven { Operation::Enable } else { Operation::Disable };
        let operation = self.dialogue.operation().unwrap_or(usual);
        self.command = self.operate(operation);
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if self.dialogue.is_busy() {
            return Err(RequestError::Busy);
        }
        let measured = self.shaft.measured();
        match request {
            Request::SetZero => {
                measured.ok_or(RequestError::NoFeedback)?;
                let zero = self.shaft.set_zero();
                self.shift(zero);
                Ok(Response::Done)
            }
            Request::SpeedGains(_) | Request::AngleGains(_) | Request::TorqueLimit(_) => {
                match &mut self.steering {
                    Steering::Mit(servo) => servo.request(request, measured),
                    _ => Err(RequestError::Unsupported),
                }
            }
            Request::ClearFault => {
                measured.ok_or(RequestError::NoFeedback)?;
                if matches!(self.shaft.state(), Some(State::Error(_))) {
                    return self.dialogue.request(request, self.situation());
                }
                self.forget_fault();
                Ok(Response::Done)
            }
            _ => self.dialogue.request(request, self.situation()),
        }
    }

    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        self.dialogue.take_answer()
    }

    fn loops(&self) -> Option<Loops> {
        self.steering.loops()
    }

    fn condition(&self) -> Condition {
        let is_enabled = self.shaft.state() == Some(State::Enabled);
        let is_starting =
            !self.dialogue.is_verified() || (self.is_driven(self.drive) && !is_enabled);
        if is_starting { Condition::Starting } else { Condition::Ready }
    }
}

const fn longest_silence() -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "ten milliseconds")]
    return LONGEST_SILENCE.get() as f32 * 1e-6;
}
