//! The Finch F10, a motor that does not exist: all of it that the robot needs, in one file.

use rc10_app::maths::round_to_i16;
use rc10_app::{
    Amps, Cascade, ConfigError, Direction, FeedForward, Gear, NewtonMetres, PidConfig, RpmPerSecond,
};
use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, IdPattern};
use rc10_motor::pending::{Outcome, Pending, Retry};
use rc10_motor::servo::Servo;
use rc10_motor::shaft::Shaft;
use rc10_motor::{
    CanIds, CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Frames, Link,
    Motor, MotorName, Rate, Request, RequestError, Response, Target, TargetError, TargetKind,
    TargetSet, Tick, TxBatch, TxFull,
};
use rc10_time::Micros;

/// A command to the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Bridge open.
    Disable,
    /// Bridge closed, no torque yet.
    Enable,
    /// A torque at the shaft, N m.
    Torque(f32),
    /// Forget the error; it stays disabled.
    ClearError,
}

impl Command {
    /// The three bytes of its frame. Torques that do not fit saturate, NaN is no torque.
    #[must_use]
    pub fn pack(self) -> [u8; 3] {
        let (what, torque) = match self {
            Self::Disable => (0, 0),
            Self::Enable => (1, 0),
            Self::Torque(newton_metres) => (2, round_to_i16(newton_metres * 1000.0)),
            Self::ClearError => (3, 0),
        };
        let [high, low] = torque.to_be_bytes();
        [what, high, low]
    }
}

/// A report of the motor, 1000 times a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Angle of the shaft, 65536 to a turn.
    pub angle: u16,
    /// Speed of the shaft, rpm.
    pub rpm: f32,
    /// Current, A.
    pub amps: f32,
    /// Whether the bridge is closed.
    pub enabled: bool,
    /// The error; 0 if all is well.
    pub error: u8,
}

impl Report {
    /// From the eight bytes of its frame; `None` if no motor sends that.
    #[must_use]
    pub fn unpack(bytes: &[u8; 8]) -> Option<Self> {
        let [a, b, c, d, e, f, state, error] = *bytes;
        let enabled = match state {
            0 => false,
            1 => true,
            _ => return None,
        };
        Some(Self {
            angle: u16::from_be_bytes([a, b]),
            rpm: f32::from(i16::from_be_bytes([c, d])) * 0.1,
            amps: f32::from(i16::from_be_bytes([e, f])) * 0.01,
            enabled,
            error,
        })
    }
}

/// Error codes, from the manual's table.
fn error_text(code: u8) -> &'static str {
    match code {
        1 => "motor too hot",
        2 => "supply too low",
        _ => "unknown error",
    }
}

/// The largest torque of an F10 at its shaft, N m.
const FULL_TORQUE: f32 = 5.0;
/// N m at the shaft for an ampere.
const TORQUE_CONSTANT: f32 = 0.5;
/// Identifiers go from 1 to this.
const LAST_ID: u8 = 63;
/// An error is cleared in every tick; one that is not gone after 0.1 s will not go.
const CLEARING: Retry = Retry::new(0.1, 1);

/// Efforts are torques at the shaft, N m.
const CASCADE: Cascade = Cascade {
    speed: PidConfig::within(FULL_TORQUE).kp(0.05).ki(0.5),
    angle: PidConfig::within(300.0).kp(3.0),
    outer_divider: 5,
    acceleration: RpmPerSecond::new(1000.0),
    feed_forward: FeedForward::NONE,
};

/// One Finch F10.
#[derive(Clone, Debug)]
pub struct Finch {
    id: u8,
    command_id: StandardId,
    report_id: StandardId,
    servo: Servo,
    shaft: Shaft,
    /// The newest one.
    report: Option<Report>,
    mode: DriveMode,
    /// Kept until it is cleared.
    fault: Option<Fault>,
    clearing: Pending<()>,
}

impl Finch {
    /// The motor set to identifier `id`, 1 ..= 63.
    ///
    /// # Errors
    /// [`ConfigError`] for any other identifier.
    pub fn new(id: u8) -> Result<Self, ConfigError> {
        let raw = u16::from(id);
        let ids = (StandardId::new(0x300 + raw), StandardId::new(0x380 + raw));
        let (Some(command_id), Some(report_id), 1..=LAST_ID) = (ids.0, ids.1, id) else {
            return Err(ConfigError::new("id", id.into(), "1 to 63"));
        };
        Ok(Self {
            id,
            command_id,
            report_id,
            servo: Servo::new(TargetKind::Torque, CASCADE)?,
            shaft: Shaft::new(1 << 16, Gear::DIRECT, Direction::Forward),
            report: None,
            mode: DriveMode::Off,
            fault: None,
            clearing: Pending::new(),
        })
    }

    /// Whether it can be driven, by its own account.
    fn is_enabled(&self) -> bool {
        self.fault.is_none() && self.report.is_some_and(|report| report.enabled)
    }

    /// The command of this tick.
    fn command(&self) -> Command {
        match self.mode {
            _ if self.clearing.question().is_some() => Command::ClearError,
            _ if self.fault.is_some() || self.report.is_none() => Command::Disable,
            DriveMode::Off => Command::Disable,
            _ if self.is_enabled() => Command::Torque(self.servo.effort()),
            DriveMode::Coast => Command::Disable,
            DriveMode::Brake | DriveMode::Hold | DriveMode::Run => Command::Enable,
        }
    }
}

impl Motor for Finch {
    fn name(&self) -> MotorName {
        MotorName { model: "Finch F10", id: self.id.into() }
    }

    fn supports(&self) -> TargetSet {
        self.servo.supports()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.servo.set_target(target)
    }

    fn target(&self) -> Target {
        self.servo.target()
    }

    fn feedback(&self) -> Feedback {
        let Some(Report { amps, .. }) = self.report else { return Feedback::NEW };
        let torque = NewtonMetres::new(amps * TORQUE_CONSTANT);
        self.shaft.feedback().with_current(Amps::new(amps)).with_torque(torque)
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, tick: &Tick) {
        self.mode = tick.mode;
        self.clearing.update(tick);
        if self.is_enabled() {
            self.servo.update(tick, &self.shaft);
        } else {
            self.servo.rest();
        }
    }

    fn request(&mut self, request: Request) -> Outcome {
        match request {
            _ if self.clearing.is_busy() => Err(RequestError::Busy),
            Request::ClearFault if self.fault.is_none() => Ok(Response::Done),
            Request::ClearFault => self.clearing.ask((), CLEARING),
            _ => self.servo.request(request, &mut self.shaft),
        }
    }

    fn response(&mut self) -> Option<Outcome> {
        self.clearing.take_outcome()
    }

    fn condition(&self) -> Condition {
        let wanted = matches!(self.mode, DriveMode::Brake | DriveMode::Hold | DriveMode::Run);
        if wanted && !self.is_enabled() { Condition::Starting } else { Condition::Ready }
    }
}

impl CanMotor for Finch {
    fn can_ids(&self) -> CanIds {
        let report = Frames::new(IdPattern::exact(self.report_id), 8, Rate::Hz(1000));
        let command = Frames::new(IdPattern::exact(self.command_id), 3, Rate::EveryTick);
        CanIds::new().receives(report).transmits(command)
    }

    fn unpack_feedback(
        &mut self,
        frame: &CanFrame,
        at: Micros,
        _: Link,
    ) -> Result<FrameKind, FrameError> {
        if frame.key() != CanFrame::key_of(self.report_id) {
            return Err(FrameError::NotMine);
        }
        let bytes = frame.all_eight().ok_or(FrameError::Length)?;
        let report = Report::unpack(bytes).ok_or(FrameError::Unexpected)?;
        self.shaft.follow(report.angle.into(), report.rpm, at);
        self.report = Some(report);
        if report.error != 0 {
            self.fault = Some(Fault::new(report.error.into(), error_text(report.error)));
        } else if self.clearing.question().is_some() {
            self.fault = None;
            self.clearing.end(Ok(Response::Done));
        }
        Ok(if self.fault.is_some() { FrameKind::Fault } else { FrameKind::Feedback })
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(CanFrame::exact(self.command_id, self.command().pack()))
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(CanFrame::exact(self.command_id, Command::Disable.pack()))
    }
}
