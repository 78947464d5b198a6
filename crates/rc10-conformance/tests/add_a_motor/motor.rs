//! The Finch F10, a motor that does not exist: all of it that the robot needs, in one file.

use rc10_app::maths::round_to_i16;
use rc10_app::{
    Amps, ConfigError, CountsPerTurn, Encoder, NewtonMetres, PidConfig, Rpm, RpmPerSecond, Seconds,
    TotalAngle,
};
use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, IdPattern, Micros};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::servo::{Measured, Servo};
use rc10_motor::{
    CanIds, CanMotor, Condition, DriveMode, Fault, Feedback, FrameError, FrameKind, Motor,
    Ownership, Rate, Request, RequestError, Response, RxFrames, Target, TargetError, TargetKind,
    TargetSet, TxBatch, TxFrames, TxFull,
};

/// What the motor is told.
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

/// What the motor tells, 1000 times a second.
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
    /// What is wrong; 0 for nothing.
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
/// A motor heard again after a longer silence may have been restarted.
const SILENCE: Micros = Micros::from_millis(10);
/// An error that is not gone by then will not go, s.
const PATIENCE: f32 = 0.1;

/// Efforts are torques at the shaft, N m.
const CASCADE: Cascade = Cascade {
    speed: PidConfig::new(0.05, 0.5, 0.0, FULL_TORQUE),
    angle: PidConfig::new(3.0, 0.0, 0.0, 300.0),
    outer_divider: 5,
    acceleration: RpmPerSecond::new(1000.0),
    feed_forward: 0.0,
};

/// One Finch F10.
#[derive(Clone, Debug)]
pub struct Finch {
    id: u8,
    command_id: StandardId,
    report_id: StandardId,
    servo: Servo,
    encoder: Encoder,
    /// Where the encoder stood when the angle was set to zero.
    zero: i64,
    heard: Option<(Report, Micros)>,
    drive: DriveMode,
    /// Kept until somebody clears it.
    fault: Option<Fault>,
    /// An error is being cleared: how long it may take yet, s.
    clearing: Option<f32>,
    answer: Option<Result<Response, RequestError>>,
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
            encoder: Encoder::new(1 << 16),
            zero: 0,
            heard: None,
            drive: DriveMode::Off,
            fault: None,
            clearing: None,
            answer: None,
        })
    }

    /// What the shaft does; `None` before the first report.
    fn measured(&self) -> Option<Measured> {
        let (report, _) = self.heard?;
        let counts = self.encoder.total().saturating_sub(self.zero);
        // 360,000,000 millionths of a degree are 65536 counts.
        Some(Measured { rpm: report.rpm, microdegrees: counts.saturating_mul(703_125) / 128 })
    }

    /// Whether it can be driven, by its own account.
    fn is_enabled(&self) -> bool {
        self.fault.is_none() && self.heard.is_some_and(|(report, _)| report.enabled)
    }

    /// What to tell it in this tick.
    fn command(&self) -> Command {
        match self.drive {
            _ if self.clearing.is_some() => Command::ClearError,
            _ if self.fault.is_some() || self.heard.is_none() => Command::Disable,
            DriveMode::Off => Command::Disable,
            _ if self.is_enabled() => Command::Torque(self.servo.effort()),
            DriveMode::Coast => Command::Disable,
            DriveMode::Brake | DriveMode::Hold | DriveMode::Run => Command::Enable,
        }
    }

    /// Follows the angle of a report. After a silence the shaft may have gone round.
    fn count(&mut self, report: &Report, at: Micros) {
        let angle = u32::from(report.angle);
        // Every 16-bit number is an angle, so neither can fail.
        let _ = match self.heard {
            Some((last, then)) if at.since(then) > SILENCE => {
                self.servo.rest();
                #[expect(clippy::cast_precision_loss, reason = "an estimate")]
                let turns = (last.rpm + report.rpm) * 0.5 * at.since(then).get() as f32 / 60e6;
                let expected = rc10_app::maths::round_to_i32(turns * 65536.0);
                self.encoder.update_after_gap(angle, expected.into())
            }
            _ => self.encoder.update(angle),
        };
    }
}

impl Motor for Finch {
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
        let (Some((report, at)), Some(measured)) = (self.heard, self.measured()) else {
            return Feedback::NEW;
        };
        let total = TotalAngle::new(measured.microdegrees, CountsPerTurn::MICRODEGREES);
        let mut told = Feedback::new(at, Rpm::new(report.rpm), total.within_turn(), total);
        told.turn_gaps = self.encoder.gaps();
        told.with_current(Amps::new(report.amps))
            .with_torque(NewtonMetres::new(report.amps * TORQUE_CONSTANT))
    }

    fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn update(&mut self, dt: Seconds, drive: DriveMode) {
        self.drive = drive;
        let measured = if self.is_enabled() { self.measured() } else { None };
        self.servo.update(dt, drive, measured);
        if let Some(left) = self.clearing {
            self.clearing = Some(left - dt.get().max(0.0)).filter(|left| *left > 0.0);
            if self.clearing.is_none() {
                self.answer = Some(Err(RequestError::Timeout));
            }
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        if self.clearing.is_some() || self.answer.is_some() {
            return Err(RequestError::Busy);
        }
        match request {
            Request::SetZero => {
                let measured = self.measured().ok_or(RequestError::NoFeedback)?;
                self.zero = self.encoder.total();
                let sought = self.servo.target();
                self.servo.set_zero(measured.microdegrees);
                if let Target::TotalAngle(angle) = sought {
                    // The same place, told on the new scale.
                    let zero = TotalAngle::from_microdegrees(measured.microdegrees);
                    let _ = self.servo.set_target(Target::TotalAngle(angle.minus(zero)));
                }
                Ok(Response::Done)
            }
            Request::ClearFault if self.fault.is_none() => Ok(Response::Done),
            Request::ClearFault => {
                self.clearing = Some(PATIENCE);
                Ok(Response::Pending)
            }
            _ => self.servo.request(request, self.measured()),
        }
    }

    fn answer(&mut self) -> Option<Result<Response, RequestError>> {
        self.answer.take()
    }

    fn condition(&self) -> Condition {
        let wanted = matches!(self.drive, DriveMode::Brake | DriveMode::Hold | DriveMode::Run);
        if wanted && !self.is_enabled() { Condition::Starting } else { Condition::Ready }
    }
}

impl CanMotor for Finch {
    fn can_ids(&self) -> CanIds {
        let report = RxFrames {
            pattern: IdPattern::exact(self.report_id),
            len: 8,
            rate: Rate::Hz(1000),
            guard: None,
        };
        let command = TxFrames {
            pattern: IdPattern::exact(self.command_id),
            len: 3,
            rate: Rate::EveryTick,
            share: Ownership::Whole,
        };
        let empty = CanIds::new("Finch F10", self.id.into());
        let wired = empty.clone().receives(report).and_then(|wiring| wiring.transmits(command));
        wired.unwrap_or(empty)
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros) -> Result<FrameKind, FrameError> {
        if frame.key() != CanFrame::key_of(self.report_id) {
            return Err(FrameError::NotMine);
        }
        let bytes = frame.all_eight().ok_or(FrameError::Length)?;
        let report = Report::unpack(bytes).ok_or(FrameError::Unexpected)?;
        self.count(&report, at);
        self.heard = Some((report, at));
        if report.error != 0 {
            self.fault = Some(Fault::new(report.error.into(), error_text(report.error)));
        } else if self.clearing.take().is_some() {
            self.fault = None;
            self.answer = Some(Ok(Response::Done));
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
