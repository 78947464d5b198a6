//! The motor: when the device may move, and what it is told.

use rc10_app::{ConfigError, NewtonMetres};
use rc10_can::{CanFrame, IdPattern};
use rc10_time::Micros;

use super::config::{Config, MOTION, Model};
use super::wire::{self, Address, Mode, Parameter, ParameterValue, Reply};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Condition, Fault, Feedback};
use crate::mit::{RPM_PER_RADIAN_PER_SECOND, RangedShaft, Setpoint};
use crate::motor::{CanMotor, DriveMode, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::pending::{Pending, Retry, check_timeout};
use crate::request::{Request, RequestError, Response};
use crate::servo::Servo;
use crate::target::{Target, TargetError};

/// One CyberGear or RobStride.
///
/// Loops here send torques; [`Target::Impedance`] is the device's loop: run mode 0, checked.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct CyberGear {
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::cybergear"))]
    model: Model,
    address: Address,
    servo: Servo,
    ranged: RangedShaft,
    step: Step,
    pending: Pending<Question>,
    /// A parameter that was written in the last tick, to be read back in this one.
    read_back: Option<Parameter>,
    reported: Option<wire::Feedback>,
    /// The longest time-out that it may have, ms, zero for any; and whether it is known to have one.
    timeout: f32,
    has_timeout: bool,
    fault: Option<Fault>,
    drive: DriveMode,
    setpoint: Setpoint,
}

/// The step of enabling that a device has reached: its answers lead from one to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Step {
    /// Sends stops, which are answered.
    Stopped,
    /// The same, and asks for the run mode.
    Checking,
    /// The same, and sets the run mode.
    Setting,
    /// Sends enables until the device says that it runs.
    Enabling,
    Running,
}

/// A request that the device carries out itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
enum Question {
    /// Forget its faults: the frame for it takes the place of its stop.
    ClearFaults,
    Read(Parameter),
    /// Take a value, and say what it holds then: the answer to writing is plain feedback.
    Write(Parameter, [u8; 4]),
    /// Be at zero here.
    Zero,
    Save,
    /// Which time-out it has; no request of the robot's.
    Timeout,
}

impl Question {
    const fn retry(self) -> Retry {
        let retry = Retry::new(0.016, 6);
        match self {
            // Never twice: flash wears, and takes its time. Its answer is plain feedback, so two
            // ticks are silent before it: what comes afterwards has one cause only.
            Self::Save => Retry { delay: 0.0025, ..Retry::new(0.5, 1) }.only_while_off(),
            Self::Write(..) | Self::Zero => retry.only_while_off(),
            Self::Read(_) | Self::ClearFaults | Self::Timeout => retry,
        }
    }
}

/// The device's shaft is free while it is zeroed, and may move a little meanwhile; rad.
const AT_ZERO: f32 = 0.1;
const BAD_TIMEOUT: Fault =
    Fault::new(0x7028, "canTimeout (0x7028, ms) is 0, which is never, or too long");
const NO_TIMEOUT: Fault = Fault::new(0x17028, "its firmware does not tell canTimeout (0x7028)");
/// The answer of a device to a parameter that it does not have (RobStride manuals, type 17).
const UNKNOWN_PARAMETER: u32 = 1;

impl CyberGear {
    /// The motor that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.validate()?;
        let Config { model, address, direction, cascade, timeout } = config;
        Ok(Self {
            model,
            address,
            servo: model.limits.servo(cascade),
            ranged: RangedShaft::new(&model.limits, direction),
            step: Step::Stopped,
            pending: Pending::new(),
            read_back: None,
            reported: None,
            timeout: timeout.get() as f32 / 1e3,
            has_timeout: false,
            fault: None,
            drive: DriveMode::Off,
            setpoint: Setpoint::COAST,
        })
    }

    /// The low two bytes of the identifier of what it hears.
    fn replies(&self) -> u32 {
        u32::from(self.address.motor) << 8 | u32::from(self.address.host)
    }

    /// Whether the device is known to be set up as configured.
    const fn is_checked(&self) -> bool {
        self.has_timeout || self.timeout == 0.0
    }

    /// One step of what leads to [`Step::Running`] or back.
    fn advance(&mut self, tick: &Tick) {
        let may_run = tick.link == Link::Online && self.fault.is_none() && self.is_checked();
        let is_wanted = match tick.mode {
            DriveMode::Off => false,
            // Nothing needs to be enabled for that.
            DriveMode::Coast => self.step == Step::Running,
            DriveMode::Brake | DriveMode::Hold | DriveMode::Run => true,
        };
        if !(may_run && is_wanted) {
            self.step = Step::Stopped;
        } else if self.step == Step::Stopped {
            self.step = Step::Checking;
        }
    }

    /// Takes a feedback as the answer to the pending request, where it is one.
    fn answer(&mut self, reported: &wire::Feedback) {
        let is_at_zero = reported.position.abs() < AT_ZERO && reported.mode != Mode::Run;
        match self.pending.sent() {
            Some(Question::Zero) if is_at_zero => {
                self.servo.set_zero(self.ranged.shaft.set_zero());
                self.ranged.start_over();
                // A zero that is not saved is gone with the power.
                self.pending.replace(Question::Save, Question::Save.retry());
            }
            Some(Question::Save) => self.pending.end(Ok(Response::Done)),
            Some(Question::ClearFaults) => match reported.faults {
                0 => {
                    (self.fault, self.has_timeout) = (None, false);
                    self.pending.end(Ok(Response::Done));
                }
                bits => self.pending.fail_with(RequestError::Refused(bits.into())),
            },
            _ => {}
        }
    }

    fn hear(&mut self, reported: &wire::Feedback, at: Micros, link: Link) -> FrameKind {
        if self.pending.is_busy() {
            self.answer(reported);
        }
        let rpm = reported.velocity * RPM_PER_RADIAN_PER_SECOND;
        let jump = self.ranged.follow(reported.steps, rpm, at, link);
        if jump.is_some() {
            // Of its turns and of its angle in them it knows nothing more: the shaft stays.
            self.ranged.shaft.count_gap();
        }
        if jump.is_some() || link != Link::Online {
            self.has_timeout = false;
            self.pending.cancel_if(Question::Timeout);
        }
        let runs = reported.mode == Mode::Run;
        self.step = match self.step {
            _ if jump.is_some() || link != Link::Online => Step::Stopped,
            // It has stopped itself.
            Step::Running if !runs => Step::Stopped,
            Step::Setting => Step::Checking,
            Step::Enabling if runs => Step::Running,
            step => step,
        };
        self.reported = Some(*reported);
        let fault = self.model.fault(reported.faults);
        self.fault = self.fault.or(fault);
        fault.map_or(FrameKind::Feedback, |_| FrameKind::Fault)
    }

    fn hear_parameter(&mut self, value: &ParameterValue) -> Heard {
        let held = u32::from_le_bytes(value.bytes);
        let is_run_mode = value.parameter == Parameter::RUN_MODE;
        match self.pending.question() {
            _ if self.step == Step::Checking && is_run_mode && !value.refused => {
                self.step = if value.byte() == 0 { Step::Enabling } else { Step::Setting };
            }
            Some(Question::Read(asked) | Question::Write(asked, _))
                if asked == value.parameter && value.refused =>
            {
                self.pending.end(Err(RequestError::Refused(UNKNOWN_PARAMETER)));
            }
            Some(Question::Read(asked)) if asked == value.parameter => {
                self.pending.end(Ok(Response::Register(held)));
            }
            Some(Question::Timeout) if value.parameter == Parameter::TIMEOUT => {
                self.pending.cancel();
                return self.hear_timeout(held, value.refused);
            }
            Some(Question::Write(asked, bytes)) if asked == value.parameter => {
                self.has_timeout = false;
                if value.bytes == bytes {
                    self.pending.end(Ok(Response::Done));
                } else {
                    self.pending.fail_with(RequestError::Refused(held));
                }
            }
            // On a busy bus it is asked for once more before the answer is there.
            _ if is_run_mode || value.parameter == Parameter::TIMEOUT => {}
            _ => return Err(FrameError::Unasked),
        }
        Ok(FrameKind::Other)
    }

    fn hear_timeout(&mut self, held: u32, is_unknown: bool) -> Heard {
        let bad = if is_unknown {
            Some(NO_TIMEOUT)
        } else {
            check_timeout(held, self.timeout, BAD_TIMEOUT)
        };
        self.has_timeout = bad.is_none();
        self.fault = self.fault.or(bad);
        Ok(bad.map_or(FrameKind::Other, |_| FrameKind::Fault))
    }

    /// The question of this tick: one of a request, or about the run mode.
    fn question_frame(&mut self) -> Option<CanFrame> {
        let to = self.address;
        let is_writing = matches!(self.pending.question(), Some(Question::Write(..)));
        if let Some(parameter) = self.read_back.take().filter(|_| is_writing) {
            return Some(wire::read(to, parameter));
        }
        match self.pending.take_due() {
            Some(Question::Read(parameter)) => return Some(wire::read(to, parameter)),
            Some(Question::Write(parameter, bytes)) => {
                self.read_back = Some(parameter);
                return Some(wire::write(to, parameter, bytes));
            }
            Some(Question::Zero) => return Some(wire::set_zero(to)),
            Some(Question::Save) => return Some(wire::save(to)),
            Some(Question::Timeout) => return Some(wire::read(to, Parameter::TIMEOUT)),
            Some(Question::ClearFaults) | None => {}
        }
        match self.step {
            Step::Checking => Some(wire::read(to, Parameter::RUN_MODE)),
            Step::Setting => Some(wire::write_byte(to, Parameter::RUN_MODE, 0)),
            Step::Stopped | Step::Enabling | Step::Running => None,
        }
    }
}

impl Motor for CyberGear {
    handed_on!(supports, target, loops of [servo]);
    handed_on!(fault of [fault]);
    handed_on!(response of [pending]);
    handed_on!(state but [model]);

    fn name(&self) -> MotorName {
        MotorName { model: self.model.name, id: self.address.motor.into() }
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again.
        if target == self.servo.target() {
            return self.servo.set_target(target);
        }
        self.supports().accepts(&target)?;
        self.ranged.check(&target)?;
        self.servo.set_target(target)
    }

    fn feedback(&self) -> Feedback {
        let shaft = &self.ranged.shaft;
        let feedback = shaft.feedback();
        let Some(reported) = &self.reported else { return feedback };
        feedback
            .with_torque(NewtonMetres::new(reported.torque * shaft.sign()))
            .with_temperature(reported.temperature)
            .with_effort(self.servo.effort())
    }

    fn update(&mut self, tick: &Tick) {
        self.drive = tick.mode;
        self.advance(tick);
        if self.step == Step::Running {
            self.servo.update(tick, &self.ranged.shaft);
        } else {
            self.servo.rest();
        }
        self.setpoint = self.ranged.setpoint_of(&self.servo);
        let (check, is_wanted) = (Question::Timeout, self.fault.is_none() && !self.is_checked());
        if self.pending.update_with(tick, check, check.retry(), is_wanted) {
            self.fault = self.fault.or(Some(NO_TIMEOUT));
        }
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.pending.cancel_if(Question::Timeout);
        self.pending.check_free()?;
        let question = match request {
            Request::ClearFault if self.fault.is_none() => return Ok(Response::Done),
            Request::ClearFault => Question::ClearFaults,
            Request::ReadRegister(index) => Question::Read(Parameter(index)),
            Request::WriteRegister(index, value) => {
                Question::Write(Parameter(index), value.to_le_bytes())
            }
            // A CyberGear forgets its zero and knows no saving: its type 22 is another command.
            Request::StoreZero if self.model.saves => Question::Zero,
            Request::SaveRegisters if self.model.saves => Question::Save,
            request => return self.servo.request(request, &mut self.ranged.shaft),
        };
        self.pending.ask(question, question.retry())
    }

    fn condition(&self) -> Condition {
        let is_wanted = matches!(self.drive, DriveMode::Brake | DriveMode::Hold | DriveMode::Run);
        let is_starting = !self.is_checked() || (is_wanted && self.step != Step::Running);
        if is_starting { Condition::Starting } else { Condition::Ready }
    }
}

impl CanMotor for CyberGear {
    fn can_ids(&self) -> CanIds {
        Config::new(&self.model, self.address).can_ids()
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        // First of all: the length of another's frames says nothing here.
        if frame.raw_id() & 0xFFFF != self.replies() {
            return Err(FrameError::NotMine);
        }
        match Reply::unpack(frame, &self.model.limits)? {
            Reply::Feedback(reported) => Ok(self.hear(&reported, at, link)),
            Reply::Parameter(value) => self.hear_parameter(&value),
            Reply::Faults(report) => {
                let detail = self.model.detail(report.faults);
                self.fault = detail.or(self.fault);
                Ok(detail.map_or(FrameKind::Other, |_| FrameKind::Fault))
            }
            Reply::Identity { .. } => Err(FrameError::NotMine),
        }
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        if let Some(frame) = self.question_frame() {
            tx.push(frame)?;
        }
        let question = self.pending.question();
        if question == Some(Question::Save) {
            return Ok(());
        }
        let to = self.address;
        let frame = match self.step {
            Step::Running => wire::motion(to.motor, &self.setpoint, &self.model.limits),
            Step::Enabling => wire::enable(to),
            _ if question == Some(Question::ClearFaults) => wire::clear_faults(to),
            _ => wire::stop(to),
        };
        // The torque is part of the identifier: of all of them only the newest counts.
        let stream = IdPattern::extended(MOTION | u32::from(to.motor)).id();
        tx.push_as(frame, CanFrame::key_of(stream))
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.push(wire::stop(self.address))
    }
}
