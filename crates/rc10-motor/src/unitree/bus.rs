use core::ops::{Deref, DerefMut};

use heapless::Vec;
use rc10_app::{ConfigError, Seconds};
use rc10_time::{Micros, Timing};

use super::rs485::{GoM8010, idle};
use super::wire::line::{COMMAND_LEN, Parser, Reply, destination};
use super::wire::{Address, Status};
use crate::arm::{ArmSwitch, Seen};
use crate::can_ids::Clash;
use crate::motor::{DriveMode, Link, Motor, Tick};
use crate::motors::{AttachError, MotorId, Motors};
use crate::supervision::{Safety, count};

/// The motors of one RS-485 bus, and what keeps them safe, like a [`MotorBus`](crate::MotorBus).
///
/// Plain synchronous functions; bytes and time come in as arguments. [`tick`](Self::tick) it every
/// millisecond, after the newest targets ([`command`](Motors::command)). In between do what
/// [`poll`](Self::poll) says, and hand in what is received ([`on_bytes`](Self::on_bytes)):
///
/// ```
/// use rc10_motor::rc10_app::{Rpm, Seconds};
/// use rc10_motor::rc10_time::Micros;
/// use rc10_motor::unitree::{GoM8010, LineConfig, Rs485Bus, Step};
/// use rc10_motor::{ArmSwitch, Safety, Target};
///
/// let switch = ArmSwitch::new();
/// let mut knee = GoM8010::new(LineConfig::new(0))?;
/// let mut bus = Rs485Bus::new(&switch);
/// let knee = bus.attach(&mut knee, Safety::COAST)?;
///
/// let now = Micros::from_millis(1);
/// bus.command(knee, Target::Speed(Rpm::new(60.0)), now)?;
/// bus.tick(now, Seconds::new(0.001));
/// let Step::Send(bytes) = bus.poll(now) else { panic!() };
/// assert_eq!(bytes[..3], [0xFE, 0xEE, 0x00]); // not armed: status 0
/// assert_eq!(bus.poll(now), Step::Wait(Micros::from_millis(2))); // for its reply
/// # let reply = [0_u8; 16];
/// bus.on_bytes(&reply, Micros::new(1_100));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// **Order of polls.** One motor at a time. Each is polled once a tick, in turn; where a tick is
/// too short for all of them, the turn goes on in the next. One that does not reply is polled
/// seldom, and holds up the others by its time-out only: `docs/motors/unitree.md`, "Time".
pub struct Rs485Bus<'m> {
    motors: Motors<'m, GoM8010, CAPACITY>,
    pub(crate) line: Line,
}

/// What is on the line, and what is next.
#[derive(Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Line {
    /// One for each motor, in the same order.
    polls: Vec<Poll, CAPACITY>,
    reply_timeout: Micros,
    parser: Parser,
    polled: Option<Polled>,
    /// The next motor in turn among those that are heard.
    turn: usize,
    /// Number of those that are to be polled before a motor that may not reply.
    owed: usize,
    /// All but what the parser counts.
    counters: Rs485Counters,
}

#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
struct Poll {
    /// Not polled since the last tick.
    is_due: bool,
    /// Whether its link is online, as of the last tick or its last reply.
    is_heard: bool,
    polled_at: Option<Micros>,
    mode: DriveMode,
    /// Number of polls still to come without a pause, even if the motor does not reply.
    urgent: u8,
}

/// A command on its way whose reply has not come.
#[derive(Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
struct Polled {
    motor: MotorId,
    at: Micros,
}

const CAPACITY: usize = 15;
/// Least number of polls of a motor after a change of its drive mode.
const URGENT: u8 = 3;
/// Time between two polls of a motor that is not heard.
const SELDOM: Micros = Micros::from_millis(100);
/// Longest time without a poll: a motor that is not heard may be due.
const IDLE: Micros = Micros::from_millis(1);

/// The next step on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Send these bytes, all at once and now.
    Send([u8; COMMAND_LEN]),
    /// Nothing until then, or until bytes come in, or the next tick.
    Wait(Micros),
}

/// The exchanges and errors of a bus. Counters stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Rs485Counters {
    /// Commands with a reply.
    pub exchanges: u32,
    /// Commands without a whole reply in time.
    pub timeouts: u32,
    /// Replies with a wrong CRC.
    pub crc_errors: u32,
    /// Bytes that were not part of a reply, those of replies with a wrong CRC included.
    pub garbage: u32,
    /// Good replies of a motor that was not polled, or not any more. They are not taken.
    pub unexpected: u32,
    /// Time from handing out a command to having its reply.
    pub exchange: Timing,
    /// Time from one command to the next one to the same motor, of all motors that are heard.
    pub cycle: Timing,
}

impl Rs485Counters {
    pub(crate) const NEW: Self = Self {
        exchanges: 0,
        timeouts: 0,
        crc_errors: 0,
        garbage: 0,
        unexpected: 0,
        exchange: Timing::new(),
        cycle: Timing::new(),
    };
}

impl<'m> Deref for Rs485Bus<'m> {
    type Target = Motors<'m, GoM8010, CAPACITY>;

    fn deref(&self) -> &Self::Target {
        &self.motors
    }
}

impl DerefMut for Rs485Bus<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.motors
    }
}

impl<'m> Rs485Bus<'m> {
    /// Motors that a bus holds: as many as there are ids.
    pub const CAPACITY: usize = CAPACITY;
    /// A motor is lost after this time without a reply: all of fifteen have been polled by then.
    pub const LINK_TIMEOUT: Micros = Micros::from_millis(20);
    /// The reply time-out without [`with_reply_timeout`](Self::with_reply_timeout).
    pub const REPLY_TIMEOUT: Micros = Micros::from_millis(1);

    /// A bus without motors, armed and stopped by `switch`.
    pub const fn new(switch: &'m ArmSwitch) -> Self {
        Self {
            motors: Motors::new(switch),
            line: Line {
                polls: Vec::new(),
                reply_timeout: Self::REPLY_TIMEOUT,
                parser: Parser::new(),
                polled: None,
                turn: 0,
                owed: 0,
                counters: Rs485Counters::NEW,
            },
        }
    }

    /// With another time-out, from a command to the end of its reply: 100 µs ..= 1 ms. At 4 Mbit/s
    /// the bytes take 82.5 µs; [`Rs485Counters::exchange`] measures the rest.
    ///
    /// # Errors
    /// [`ConfigError`] for another time.
    pub fn with_reply_timeout(mut self, timeout: Micros) -> Result<Self, ConfigError> {
        let allowed = Micros::new(100)..=Micros::from_millis(1);
        let value = Seconds::from_micros(timeout.get()).get() * 1e6;
        let good = allowed.contains(&timeout);
        ConfigError::check(good, "reply_timeout", value, "100 to 1000 us")?;
        self.line.reply_timeout = timeout;
        Ok(self)
    }

    /// With the reply time-out of a PC behind a USB adapter, which hands bytes over late: 5 ms. A motor that does not
    /// reply holds up the others as long.
    #[must_use]
    pub const fn behind_usb(mut self) -> Self {
        self.line.reply_timeout = Micros::from_millis(5);
        self
    }

    /// Adds a motor.
    ///
    /// # Errors
    /// [`AttachError`], naming both motors if they have the same address; the bus is as it was.
    pub fn attach(
        &mut self,
        motor: &'m mut GoM8010,
        safety: Safety,
    ) -> Result<MotorId, AttachError> {
        let address = motor.address();
        for (other, slot) in self.motors.iter().zip(self.motors.ids()) {
            if other.address() == address {
                let (motor, with) = (motor.name(), other.name());
                let clash = Clash::Address(address.get());
                return Err(AttachError::Clash { motor, with, slot, clash });
            }
        }
        let motor = self.motors.attach(motor, safety, Self::LINK_TIMEOUT)?;
        // As much room as for motors.
        let _ = self.line.polls.push(Poll::default());
        Ok(motor)
    }

    /// The next step on the bus. After [`Step::Send`] ask again at once for how long to wait.
    pub fn poll(&mut self, now: Micros) -> Step {
        if let Some(Polled { at, .. }) = self.line.polled {
            let until = at + self.line.reply_timeout;
            if now < until {
                return Step::Wait(until);
            }
            self.line.polled = None;
            count(&mut self.line.counters.timeouts);
            self.line.owed = self.line.polls.len();
        }
        let next = self.next(now);
        let command = next.and_then(|motor| self.motors.get(motor)).map(GoM8010::pack_command);
        let poll = next.and_then(|motor| self.line.polls.get_mut(motor.index()));
        let (Some(motor), Some(command), Some(poll)) = (next, command, poll) else {
            return Step::Wait(now + IDLE);
        };
        poll.is_due = false;
        poll.urgent = poll.urgent.saturating_sub(1);
        self.begin(motor, now);
        Step::Send(command)
    }

    /// A command to a motor begins.
    fn begin(&mut self, motor: MotorId, now: Micros) {
        let Some(poll) = self.line.polls.get_mut(motor.index()) else { return };
        let last = poll.polled_at.replace(now);
        if let Some(last) = last.filter(|_| poll.is_heard) {
            self.line.counters.cycle.add(now.since(last));
        }
        self.line.polled = Some(Polled { motor, at: now });
        // What came before the command is no part of its reply.
        self.line.parser.clear();
    }

    /// Takes a command of another host at `now`: for a program that only listens. A command before
    /// it without a reply counts as a [time-out](Rs485Counters::timeouts).
    pub fn overhear(&mut self, command: &[u8; COMMAND_LEN], now: Micros) {
        let Some(address) = destination(command) else { return };
        if self.line.polled.take().is_some() {
            count(&mut self.line.counters.timeouts);
        }
        let addressed = self.motors.iter().position(|motor| motor.address() == address);
        if let Some(motor) = addressed.and_then(|index| self.motors.ids().nth(index)) {
            // No tick has looked.
            let is_heard = self.motors.is_online(motor, now);
            if let Some(poll) = self.line.polls.get_mut(motor.index()) {
                poll.is_heard = is_heard;
            }
            self.begin(motor, now);
        }
    }

    /// The motor to poll now. One walk past all: it stands between a reply and the next command.
    fn next(&mut self, now: Micros) -> Option<MotorId> {
        let (mut heard, mut due, mut first_due, mut absent) = (0, None, None, None);
        for (motor, poll) in self.motors.ids().zip(&self.line.polls) {
            if poll.is_heard {
                heard += 1;
                if poll.is_due {
                    first_due = first_due.or(Some(motor));
                    if motor.index() >= self.line.turn {
                        due = due.or(Some(motor));
                    }
                }
                continue;
            }
            let is_time =
                poll.urgent > 0 || poll.polled_at.is_none_or(|at| now.since(at) >= SELDOM);
            let key = (poll.urgent == 0, poll.polled_at);
            if is_time && absent.is_none_or(|(_, least)| key < least) {
                absent = Some((motor, key));
            }
        }
        self.line.owed = self.line.owed.min(heard);
        if let Some((motor, _)) = absent.filter(|_| self.line.owed == 0) {
            return Some(motor);
        }
        let motor = due.or(first_due)?;
        self.line.turn = motor.index() + 1;
        self.line.owed = self.line.owed.saturating_sub(1);
        Some(motor)
    }

    /// Takes bytes that have arrived by `now`, in any portions.
    pub fn on_bytes(&mut self, bytes: &[u8], now: Micros) {
        for &byte in bytes {
            if let Some(reply) = self.line.parser.push(byte) {
                self.hear(&reply, now);
            }
        }
    }

    fn hear(&mut self, reply: &Reply, now: Micros) {
        let Self { motors, line: Line { polled, polls, counters, .. } } = self;
        let expected = polled.as_ref().and_then(|polled| motors.get(polled.motor));
        if expected.is_none_or(|motor| motor.address() != reply.address) {
            return count(&mut counters.unexpected);
        }
        if let Some(Polled { motor, at }) = polled.take() {
            count(&mut counters.exchanges);
            counters.exchange.add(now.since(at));
            // Nothing can be wrong with a reply of this motor.
            let _ = motors.hear(motor, now, |motor, link| motor.unpack_reply(reply, now, link));
            if let Some(poll) = polls.get_mut(motor.index()) {
                poll.is_heard = true;
            }
        }
    }

    /// One tick: decides, computes, and gives turns. `dt`: 10 ms at most; 1 ms if not above zero.
    pub fn tick(&mut self, now: Micros, dt: Seconds) {
        self.tick_as(self.switch().seen(), now, dt);
    }

    pub(crate) fn tick_as(&mut self, seen: Seen, now: Micros, dt: Seconds) {
        let Self { motors, line: Line { polls, .. } } = self;
        motors.tick(seen, now, dt, |index, _, &Tick { mode, link, .. }| {
            if let Some(poll) = polls.get_mut(index) {
                poll.is_due = true;
                poll.is_heard = link == Link::Online;
                if core::mem::replace(&mut poll.mode, mode) != mode {
                    poll.urgent = URGENT;
                }
            }
        });
    }

    /// Leaves every motor without torque, for a panic handler: repeat it, no motor replies.
    pub fn coast_image() -> [u8; COMMAND_LEN] {
        idle(Address::BROADCAST, Status::FOC).pack()
    }

    /// The exchanges and errors of this bus.
    pub const fn counters(&self) -> Rs485Counters {
        let (crc_errors, garbage) = (self.line.parser.crc_errors(), self.line.parser.skipped());
        Rs485Counters { crc_errors, garbage, ..self.line.counters }
    }
}
