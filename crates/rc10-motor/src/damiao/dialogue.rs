//! What is asked of the device beside driving, one question at a time: whether it is set up as we
//! were told, and what the robot requests. Each is repeated until it is answered, or given up.

use rc10_app::{ConfigError, Seconds};
use rc10_can::CanFrame;

use super::registers::{Access, Content, Register, Reply, Value};
use super::wire::{DeviceId, Feedback, Mode, Operation, State};
use crate::mit::Limits;
use crate::motor::{Fault, FrameError, FrameKind, Request, RequestError, Response};

/// What must hold before a motor is enabled, and what is wrong if it does not. Codes are the
/// register's number and this.
const NOT_AS_CONFIGURED: u32 = 0x100;
const CHECKS: [(Register, &str); 4] = [
    (Register::MODE, "register 10 (CTRL_MODE) is not the control mode configured"),
    (Register::POSITION_LIMIT, "register 21 (PMAX) is not the limit configured"),
    (Register::VELOCITY_LIMIT, "register 22 (VMAX) is not the limit configured"),
    (Register::TORQUE_LIMIT, "register 23 (TMAX) is not the limit configured"),
];
const NO_ANSWER: Fault = Fault::new(0x1FF, "it answers, but not when asked for its registers");
/// Two limits this close are one: 12.566 and 4π.
const SAME: f32 = 1e-3;
/// The highest register there is.
const LAST_REGISTER: u8 = 81;
/// How near to zero an angle is that has just been made zero, rad.
const ZERO: f32 = 2e-3;

/// One thing asked.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Question {
    /// Whether the next of the [`CHECKS`] holds.
    Check,
    Access(Access),
    StoreZero,
    ClearFault,
}

impl Question {
    /// Seconds from one try to the next, and how many.
    const fn patience(self) -> (f32, u8) {
        match self {
            // Up to 30 ms deaf, and memory that lasts for ten thousand times.
            Self::Access(Access::Save) => (0.060, 2),
            _ => (0.010, 10),
        }
    }

    /// Whether the device must not be enabled meanwhile.
    const fn only_while_off(self) -> bool {
        matches!(self, Self::StoreZero | Self::Access(Access::Save | Access::Write(..)))
    }
}

/// How things stand in a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    /// Feedback comes.
    pub alive: bool,
    /// The bus says [`DriveMode::Off`](crate::DriveMode::Off).
    pub off: bool,
    /// It has a fault.
    pub faulted: bool,
    /// What the device said last.
    pub state: Option<State>,
}

/// What a feedback said about what was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum News {
    Nothing,
    Cleared,
    Zeroed,
}

#[derive(Clone, Debug)]
pub(super) struct Dialogue {
    id: DeviceId,
    mode: Mode,
    limits: Limits,
    verify: bool,
    /// The next of the [`CHECKS`].
    check: usize,
    asked: Option<Question>,
    /// What comes when that is answered.
    next: Option<Question>,
    /// It goes out in this tick.
    due: bool,
    tries: u8,
    /// Seconds since the last try.
    waited: f32,
    answer: Option<Result<Response, RequestError>>,
}

impl Dialogue {
    pub(super) const fn new(id: DeviceId, mode: Mode, limits: Limits) -> Self {
        Self {
            id,
            mode,
            limits,
            verify: true,
            check: 0,
            asked: None,
            next: None,
            due: false,
            tries: 0,
            waited: 0.0,
            answer: None,
        }
    }

    pub(super) const fn set_verify(&mut self, verify: bool) {
        self.verify = verify;
    }

    /// Whether the device is known to be set up as we were told.
    pub(super) const fn is_verified(&self) -> bool {
        !self.verify || self.check >= CHECKS.len()
    }

    /// Nothing is known of the device any more.
    pub(super) fn start_over(&mut self) {
        self.check = 0;
        if self.asked == Some(Question::Check) {
            self.asked = None;
        }
    }

    /// Takes a request that only the device can carry out.
    pub(super) fn request(
        &mut self,
        request: Request,
        now: Situation,
    ) -> Result<Response, RequestError> {
        let question = match request {
            Request::StoreZero => Question::StoreZero,
            Request::ClearFault => Question::ClearFault,
            Request::ReadRegister(number) => Question::Access(Access::Read(register(number)?)),
            Request::WriteRegister(number, bits) => {
                let register = register(number)?;
                let value = if register.is_whole() {
                    Value::Whole(bits)
                } else {
                    Value::Real(f32::from_bits(bits))
                };
                let access = Access::Write(register, value);
                if access.pack(self.id).is_err() {
                    let (field, value) = ("register value", f32::from_bits(bits));
                    return Err(ConfigError::new(field, value, "finite").into());
                }
                Question::Access(access)
            }
            Request::SaveRegisters => Question::Access(Access::Save),
            _ => return Err(RequestError::Unsupported),
        };
        if self.is_busy() {
            return Err(RequestError::Busy);
        }
        let is_still = now.off && now.state != Some(State::Enabled);
        if question.only_while_off() && !is_still {
            return Err(RequestError::NotWhileArmed);
        }
        self.next = Some(question);
        Ok(Response::Pending)
    }

    /// Whether a request has not been answered, or its answer not been heard.
    pub(super) fn is_busy(&self) -> bool {
        let asked = self.asked.is_some_and(|question| question != Question::Check);
        asked || self.next.is_some() || self.answer.is_some()
    }

    pub(super) const fn take_answer(&mut self) -> Option<Result<Response, RequestError>> {
        self.answer.take()
    }

    /// Time passes; what has been found wrong.
    pub(super) fn update(&mut self, dt: Seconds, now: Situation) -> Option<Fault> {
        let Some(question) = self.asked else {
            let check = !self.is_verified() && now.alive && !now.faulted;
            self.asked = self.next.take().or(if check { Some(Question::Check) } else { None });
            (self.due, self.tries, self.waited) = (self.asked.is_some(), 1, 0.0);
            self.stop_if_driven(now);
            return None;
        };
        self.waited += dt.get();
        let (interval, most) = question.patience();
        if self.waited >= interval {
            if self.tries >= most {
                return self.give_up(question, now);
            }
            (self.due, self.tries, self.waited) = (true, self.tries + 1, 0.0);
        }
        self.stop_if_driven(now);
        None
    }

    /// Nothing that must not be done to an enabled motor is repeated once it may be.
    fn stop_if_driven(&mut self, now: Situation) {
        if self.asked.is_some_and(Question::only_while_off) && !now.off {
            let was_asked = !self.due || self.tries > 1;
            let error = if was_asked { RequestError::NoReply } else { RequestError::NotWhileArmed };
            self.end(Err(error));
        }
    }

    fn give_up(&mut self, question: Question, now: Situation) -> Option<Fault> {
        if question == Question::Check {
            self.asked = None;
            return now.alive.then_some(NO_ANSWER);
        }
        self.end(Err(match now.state {
            Some(State::Error(code)) if question == Question::ClearFault && now.alive => {
                RequestError::Refused(code.into())
            }
            _ => RequestError::NoReply,
        }));
        None
    }

    const fn end(&mut self, answer: Result<Response, RequestError>) {
        (self.asked, self.due, self.answer) = (None, false, Some(answer));
    }

    /// The operation that goes out instead of what else would.
    pub(super) fn operation(&mut self) -> Option<Operation> {
        let operation = match self.asked? {
            Question::StoreZero => Operation::StoreZero,
            Question::ClearFault => Operation::ClearError,
            Question::Check | Question::Access(_) => return None,
        };
        core::mem::take(&mut self.due).then_some(operation)
    }

    /// The register frame that goes out.
    pub(super) fn frame(&mut self) -> Option<CanFrame> {
        let access = self.access()?;
        if core::mem::take(&mut self.due) { access.pack(self.id).ok() } else { None }
    }

    fn access(&self) -> Option<Access> {
        match self.asked? {
            Question::Check => CHECKS.get(self.check).map(|&(register, _)| Access::Read(register)),
            Question::Access(access) => Some(access),
            Question::StoreZero | Question::ClearFault => None,
        }
    }

    /// Takes a frame if it is a register's: what it was, and what it shows to be wrong.
    pub(super) fn hear(
        &mut self,
        frame: &CanFrame,
    ) -> Option<Result<(FrameKind, Option<Fault>), FrameError>> {
        if !is_like_reply(frame, self.id) {
            return None;
        }
        let Ok(reply) = Reply::unpack(frame) else {
            return Some(Err(FrameError::Unexpected));
        };
        let Some(access) = self.access().filter(|access| reply.answers(self.id, access)) else {
            return Some(Err(FrameError::Unasked));
        };
        let held = match reply.content {
            Content::Holds(_, value) | Content::Written(_, value) => Some(value),
            Content::Saved => None,
        };
        if self.asked == Some(Question::Check) {
            return Some(Ok(match self.check_against(held) {
                Some(fault) => (FrameKind::Fault, Some(fault)),
                None => (FrameKind::Other, None),
            }));
        }
        self.end(match (access, held) {
            (Access::Write(_, wanted), Some(held)) if bits(wanted) != bits(held) => {
                Err(RequestError::Refused(bits(held)))
            }
            (Access::Read(_), Some(held)) => Ok(Response::Register(bits(held))),
            _ => Ok(Response::Done),
        });
        if matches!(access, Access::Write(..)) {
            self.start_over();
        }
        Some(Ok((FrameKind::Other, None)))
    }

    fn check_against(&mut self, held: Option<Value>) -> Option<Fault> {
        let &(register, text) = CHECKS.get(self.check)?;
        let same = |held: f32, wanted: f32| (held - wanted).abs() <= wanted * SAME;
        let holds = match (register, held?) {
            (Register::MODE, Value::Whole(mode)) => mode == self.mode.register_value(),
            (Register::POSITION_LIMIT, Value::Real(held)) => same(held, self.limits.position()),
            (Register::VELOCITY_LIMIT, Value::Real(held)) => same(held, self.limits.velocity()),
            (Register::TORQUE_LIMIT, Value::Real(held)) => same(held, self.limits.torque()),
            _ => false,
        };
        self.asked = None;
        if holds {
            self.check += 1;
            return None;
        }
        Some(Fault::new(NOT_AS_CONFIGURED + u32::from(register.0), text))
    }

    /// What a feedback says about what was asked.
    pub(super) fn feedback(&mut self, told: &Feedback) -> News {
        let news = match self.asked {
            Some(Question::ClearFault) if told.state.fault().is_none() => News::Cleared,
            Some(Question::StoreZero)
                if !self.due && told.state == State::Disabled && told.position.abs() <= ZERO =>
            {
                News::Zeroed
            }
            _ => return News::Nothing,
        };
        self.end(Ok(Response::Done));
        news
    }
}

fn register(number: u16) -> Result<Register, ConfigError> {
    u8::try_from(number)
        .map(Register)
        .map_err(|_| ConfigError::new("register", number.into(), "255 or less"))
}

const fn bits(value: Value) -> u32 {
    match value {
        Value::Real(real) => real.to_bits(),
        Value::Whole(whole) => whole,
    }
}

/// Whether this can only be a register's: as a feedback, it would be of a shaft at the very end of
/// its range that turns out of it at more than a third of its largest speed.
fn is_like_reply(frame: &CanFrame, id: DeviceId) -> bool {
    let &[low, high, operation, register, ..] = frame.bytes() else { return false };
    u16::from_le_bytes([low, high]) == id.raw()
        && match operation {
            0x33 | 0x55 => register <= LAST_REGISTER,
            0xAA => register == 1,
            _ => false,
        }
}
