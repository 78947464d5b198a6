use core::fmt;

use heapless::Vec;
use rc10_app::{ConfigError, Seconds};
use rc10_can::{Micros, Timing};

use super::go::{GoM8010, quiet};
use super::wire::line::{COMMAND_LEN, Parser, Reply};
use super::wire::{Address, Status};
use crate::arm::ArmSwitch;
use crate::bus::{CommandError, MotorId};
use crate::motor::{
    DriveMode, FrameKind, Loops, Motor, Request, RequestError, Response, Target, TargetSet,
};
use crate::supervision::{LONGEST_PAUSE, MotorStatus, Safety, Supervision, sound_step};
use crate::wiring::MotorName;

/// The motors of one RS-485 line, and what keeps them safe: what a [`MotorBus`](crate::MotorBus) is
/// to motors on CAN.
///
/// Plain synchronous functions; bytes and time come in as arguments. [`tick`](Self::tick) it every
/// millisecond, after the newest targets ([`command`](Self::command)). In between do what
/// [`poll`](Self::poll) says, and hand in what is received ([`on_bytes`](Self::on_bytes)):
///
/// ```
/// use rc10_motor::rc10_app::{Rpm, Seconds};
/// use rc10_motor::rc10_can::Micros;
/// use rc10_motor::unitree::{GoM8010, Step, Rs485Bus};
/// use rc10_motor::{ArmSwitch, Safety, Target};
///
/// let switch = ArmSwitch::new();
/// let mut knee = GoM8010::new(0)?;
/// let mut line = Rs485Bus::new(&switch);
/// let knee = line.attach(&mut knee, Safety::COAST)?;
///
/// let now = Micros::from_millis(1);
/// line.command(knee, Target::Speed(Rpm::new(60.0)), now)?;
/// line.tick(now, Seconds::new(0.001));
/// let Step::Send(bytes) = line.poll(now) else { panic!() };
/// assert_eq!(bytes[..3], [0xFE, 0xEE, 0x00]); // not armed: status 0
/// assert_eq!(line.poll(now), Step::Wait(Micros::from_millis(2))); // for its answer
/// # let answer = [0_u8; 16];
/// line.on_bytes(&answer, Micros::new(1_100));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// **Who is asked when.** One motor at a time. Each is asked once a tick, in turn; where a tick is
/// too short for all of them, the turn goes on in the next. A motor that does not answer costs the
/// [reply time-out](Self::with_reply_timeout), so one that is lost, or was never heard, is asked
/// every 100 ms only, and after each time that was in vain all others have their turn before the
/// next such motor. When what it may do changes (it is lost, the robot is disarmed), it is asked three
/// times without that pause: perhaps it hears its safe word though it is not heard.
///
/// No motor can opt out of the rules of a bus: see [`MotorBus`](crate::MotorBus).
pub struct Rs485Bus<'m> {
    switch: &'m ArmSwitch,
    slots: Vec<Slot<'m>, CAPACITY>,
    reply_timeout: Micros,
    parser: Parser,
    asked: Option<Asked>,
    /// Whose turn it is among those that are heard.
    turn: usize,
    /// How many of those are to be asked before a motor that may not answer.
    owed: usize,
    /// All but what the parser counts.
    counters: Rs485Counters,
    last_tick: Option<Micros>,
}

struct Slot<'m> {
    motor: &'m mut GoM8010,
    watch: Supervision,
    /// Not asked since the last tick.
    is_due: bool,
    asked_at: Option<Micros>,
    drive: DriveMode,
    /// So many times it is asked without a pause even if it does not answer: it may do something
    /// else now, and may hear that.
    urgent: u8,
}

/// A command on its way whose answer has not come.
struct Asked {
    index: usize,
    at: Micros,
}

/// See [`Rs485Bus::CAPACITY`].
const CAPACITY: usize = 15;
/// What a motor may do has changed: it is told so often at least.
const URGENT: u8 = 3;
/// A motor that is not heard is asked so often.
const SELDOM: Micros = Micros::from_millis(100);
/// Without anything to send, somebody should look again after this time.
const IDLE: Micros = Micros::from_millis(1);

/// What is to be done next on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Send these bytes, all at once and now.
    Send([u8; COMMAND_LEN]),
    /// Nothing until then, or until bytes come in, or the next tick.
    Wait(Micros),
}

/// Why a motor was not attached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AttachError {
    /// The line has a motor of this id.
    Duplicate {
        /// The motor that was to be attached.
        motor: MotorName,
    },
    /// The line has as many motors as it can have.
    Full {
        /// The motor that was to be attached.
        motor: MotorName,
        /// How many motors a line holds.
        capacity: usize,
    },
    /// Its commands would hold for no time, or for too long.
    Expiry {
        /// The motor that was to be attached.
        motor: MotorName,
        /// What was asked for.
        asked: Micros,
    },
}

impl fmt::Display for AttachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Duplicate { motor } => {
                write!(f, "{motor} cannot share a line with another of its id")
            }
            Self::Full { motor, capacity } => {
                write!(f, "{motor} finds no room: the line holds {capacity} motors")
            }
            Self::Expiry { motor, asked } => write!(
                f,
                "{motor}: a command must expire after 0 to {}, not {asked}",
                Safety::LONGEST_EXPIRY
            ),
        }
    }
}

impl core::error::Error for AttachError {}

/// What the traffic of a line amounted to. Counters stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Rs485Counters {
    /// Commands that were answered.
    pub exchanges: u32,
    /// Commands that were not, or not in time, or not by a whole answer.
    pub timeouts: u32,
    /// Answers with a wrong CRC.
    pub crc_errors: u32,
    /// Bytes that were not part of an answer, those of answers with a wrong CRC included.
    pub garbage: u32,
    /// Good answers of somebody who was not asked, or not any more. They are not taken.
    pub unexpected: u32,
    /// Time from handing out a command to having its answer.
    pub exchange: Timing,
}

impl Rs485Counters {
    pub(crate) const NEW: Self = Self {
        exchanges: 0,
        timeouts: 0,
        crc_errors: 0,
        garbage: 0,
        unexpected: 0,
        exchange: Timing::new(),
    };
}

impl<'m> Rs485Bus<'m> {
    /// Motors that a line holds: as many as there are ids.
    pub const CAPACITY: usize = CAPACITY;
    /// The time-out of a line that is not told another one.
    pub const REPLY_TIMEOUT: Micros = Micros::from_millis(1);

    /// A line without motors, armed and stopped by `switch`.
    #[must_use]
    pub const fn new(switch: &'m ArmSwitch) -> Self {
        Self {
            switch,
            slots: Vec::new(),
            reply_timeout: Self::REPLY_TIMEOUT,
            parser: Parser::new(),
            asked: None,
            turn: 0,
            owed: 0,
            counters: Rs485Counters::NEW,
            last_tick: None,
        }
    }

    /// With another time-out, from when [`poll`](Self::poll) hands out a command to the end of its
    /// answer: 100 µs ..= 1 ms. At 4 Mbit/s the bytes take 82.5 µs; how long a motor thinks in
    /// between is not documented. [`Rs485Counters::exchange`] has what they take.
    ///
    /// # Errors
    /// [`ConfigError`] for another time.
    pub fn with_reply_timeout(mut self, timeout: Micros) -> Result<Self, ConfigError> {
        let allowed = Micros::new(100)..=Micros::from_millis(1);
        if !allowed.contains(&timeout) {
            let value = Seconds::from_micros(timeout.get()).get() * 1e6;
            let must_be = "100 to 1000 us";
            return Err(ConfigError::new("reply_timeout", value, must_be));
        }
        self.reply_timeout = timeout;
        Ok(self)
    }

    /// Adds a motor.
    ///
    /// # Errors
    /// [`AttachError`]; the line is as it was.
    pub fn attach(
        &mut self,
        motor: &'m mut GoM8010,
        safety: Safety,
    ) -> Result<MotorId, AttachError> {
        let name = name(motor);
        if !safety.is_valid() {
            return Err(AttachError::Expiry { motor: name, asked: safety.command_expiry });
        }
        if self.slots.iter().any(|slot| slot.motor.address() == motor.address()) {
            return Err(AttachError::Duplicate { motor: name });
        }
        let watch = Supervision::new(safety, GoM8010::LINK_TIMEOUT);
        let full = AttachError::Full { motor: name, capacity: CAPACITY };
        let index = u8::try_from(self.slots.len()).map_err(|_| full)?;
        let slot =
            Slot { motor, watch, is_due: false, asked_at: None, drive: DriveMode::Off, urgent: 0 };
        self.slots.push(slot).map_err(|_| full)?;
        Ok(MotorId::new(index))
    }

    /// What to do now. After [`Step::Send`] ask again at once: it says how long to wait for the
    /// answer.
    pub fn poll(&mut self, now: Micros) -> Step {
        if let Some(Asked { at, .. }) = self.asked {
            let until = at + self.reply_timeout;
            if now < until {
                return Step::Wait(until);
            }
            self.asked = None;
            count(&mut self.counters.timeouts);
            self.owed = self.slots.len();
        }
        let Some(index) = self.next(now) else {
            return Step::Wait(now + IDLE);
        };
        let Some(slot) = self.slots.get_mut(index) else {
            return Step::Wait(now + IDLE);
        };
        (slot.is_due, slot.asked_at) = (false, Some(now));
        slot.urgent = slot.urgent.saturating_sub(1);
        self.asked = Some(Asked { index, at: now });
        // What came before it was asked is no part of its answer.
        self.parser.clear();
        Step::Send(slot.motor.pack_command())
    }

    /// Whom to ask now.
    fn next(&mut self, now: Micros) -> Option<usize> {
        let online = self.slots.iter().filter(|slot| slot.watch.is_online(now)).count();
        self.owed = self.owed.min(online);
        if self.owed == 0 {
            let absent = self.slots.iter().enumerate().filter(|(_, slot)| {
                let is_time =
                    slot.urgent > 0 || slot.asked_at.is_none_or(|at| now.since(at) >= SELDOM);
                is_time && !slot.watch.is_online(now)
            });
            if let Some((index, _)) =
                absent.min_by_key(|(_, slot)| (slot.urgent == 0, slot.asked_at))
            {
                return Some(index);
            }
        }
        let (before, from_turn) = self.slots.split_at_checked(self.turn)?;
        let in_turn = (self.turn..).zip(from_turn).chain((0..).zip(before));
        let is_next = |slot: &Slot<'_>| slot.is_due && slot.watch.is_online(now);
        let (index, _) = in_turn.into_iter().find(|(_, slot)| is_next(slot))?;
        self.turn = if index + 1 < self.slots.len() { index + 1 } else { 0 };
        self.owed = self.owed.saturating_sub(1);
        Some(index)
    }

    /// Takes bytes that have arrived by `now`, in any portions.
    pub fn on_bytes(&mut self, bytes: &[u8], now: Micros) {
        for &byte in bytes {
            if let Some(reply) = self.parser.push(byte) {
                self.hear(&reply, now);
            }
        }
    }

    fn hear(&mut self, reply: &Reply, now: Micros) {
        let Self { asked, slots, counters, .. } = self;
        let slot = asked.as_ref().and_then(|asked| slots.get_mut(asked.index));
        let Some(slot) = slot.filter(|slot| slot.motor.address() == reply.address) else {
            return count(&mut counters.unexpected);
        };
        if let Some(asked) = asked.take() {
            counters.exchange.add(now.since(asked.at));
        }
        count(&mut counters.exchanges);
        let heard = slot.motor.unpack_reply(reply, now);
        if heard == Ok(FrameKind::Feedback) {
            slot.watch.heard_feedback(now);
        } else {
            // Its error, if it is one, is counted there.
            let _ = slot.watch.heard(heard, now);
        }
    }

    /// Gives a motor a new target, which holds from `now` until it expires.
    ///
    /// # Errors
    /// [`CommandError`]; the old target stays, and stays as old as it was.
    pub fn command(
        &mut self,
        motor: MotorId,
        target: Target,
        now: Micros,
    ) -> Result<(), CommandError> {
        let slot = self.slots.get_mut(motor.index()).ok_or(CommandError::NoSuchMotor)?;
        slot.watch.command(&mut *slot.motor, target, now).map_err(CommandError::Target)
    }

    /// Asks something of a motor beside a target. After [`Response::Pending`] its
    /// [`answer`](Self::answer) is to be asked for after each tick.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    pub fn request(&mut self, motor: MotorId, request: Request) -> Result<Response, RequestError> {
        let slot = self.slots.get_mut(motor.index()).ok_or(RequestError::NoSuchMotor)?;
        slot.watch.request(&mut *slot.motor, request)
    }

    /// How a request went that was [`Pending`](Response::Pending), once that is known; told once.
    pub fn answer(&mut self, motor: MotorId) -> Option<Result<Response, RequestError>> {
        let slot = self.slots.get_mut(motor.index())?;
        slot.watch.answer(&mut *slot.motor)
    }

    /// One tick: decides what each motor may do, lets it compute, and makes its turn come. `dt` is
    /// the time since the last tick: more than 10 ms counts as 10 ms; what is not above zero counts
    /// as 1 ms.
    pub fn tick(&mut self, now: Micros, dt: Seconds) {
        let dt = sound_step(dt);
        let last = self.last_tick.replace(now);
        let paused = last.is_some_and(|last| now.since(last) > LONGEST_PAUSE);
        let arm = self.switch.for_motors();
        for slot in &mut self.slots {
            if paused {
                slot.watch.forget();
            }
            let drive = slot.watch.decide(arm, now);
            slot.motor.update(dt, drive);
            slot.is_due = true;
            if core::mem::replace(&mut slot.drive, drive) != drive {
                slot.urgent = URGENT;
            }
        }
    }

    /// What leaves every motor without torque, whatever state it is in: for a panic handler. It is
    /// one command to all, which none answers, so it can be repeated without a pause. Send it twice:
    /// the first may meet an answer that is on the line.
    #[must_use]
    pub fn coast_image() -> [u8; COMMAND_LEN] {
        quiet(Address::BROADCAST, Status::FOC).pack()
    }

    /// The motors attached, in order.
    pub fn motors(&self) -> impl Iterator<Item = (MotorId, MotorName)> {
        self.ids().zip(self.slots.iter().map(|slot| name(slot.motor)))
    }

    /// The attached motors' numbers, in order.
    pub fn ids(&self) -> impl Iterator<Item = MotorId> + use<> {
        (0..).take(self.slots.len()).map(MotorId::new)
    }

    /// What targets a motor takes; none for a motor that does not exist.
    #[must_use]
    pub fn supports(&self, motor: MotorId) -> TargetSet {
        self.slots.get(motor.index()).map_or(TargetSet::NONE, |slot| slot.motor.supports())
    }

    /// The control loops of a motor; `None` for a motor that does not exist.
    #[must_use]
    pub fn loops(&self, motor: MotorId) -> Option<Loops> {
        self.slots.get(motor.index()).and_then(|slot| slot.motor.loops())
    }

    /// All there is to know about a motor.
    #[must_use]
    pub fn status(&self, motor: MotorId, now: Micros) -> Option<MotorStatus> {
        let slot = self.slots.get(motor.index())?;
        let mut status = MotorStatus::NEW;
        slot.watch.write_status(&*slot.motor, now, &mut status);
        Some(status)
    }

    /// The same, written where it is wanted. Nothing for a motor that does not exist.
    #[cfg(feature = "embassy")]
    pub(crate) fn write_status(&self, motor: MotorId, now: Micros, status: &mut MotorStatus) {
        if let Some(slot) = self.slots.get(motor.index()) {
            slot.watch.write_status(&*slot.motor, now, status);
        }
    }

    /// What the traffic of this line amounted to.
    #[must_use]
    pub const fn counters(&self) -> Rs485Counters {
        let (crc_errors, garbage) = (self.parser.crc_errors(), self.parser.skipped());
        Rs485Counters { crc_errors, garbage, ..self.counters }
    }

    /// The switch that arms this line.
    #[must_use]
    pub const fn switch(&self) -> &'m ArmSwitch {
        self.switch
    }
}

fn name(motor: &GoM8010) -> MotorName {
    MotorName { model: "GO-M8010-6", id: motor.address().get().into() }
}

const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
