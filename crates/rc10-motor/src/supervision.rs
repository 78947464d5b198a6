//! Supervision of one motor on any kind of bus: link, expiry, fault, and drive mode.

use core::fmt;

use rc10_app::mechanism::{Health, Measured};
use rc10_app::{Amps, NewtonMetres, Rpm};
use rc10_time::Micros;

use crate::arm::ArmState;
use crate::feedback::{Condition, Fault, Feedback};
use crate::motor::{DriveMode, FrameError, FrameKind, Heard, Link, Motor, SafeState};
use crate::pending::Outcome;
use crate::request::{Request, RequestError, Response};
use crate::target::{Target, TargetError, TargetKind};

/// The command timeout of a motor, and its safe state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Safety {
    /// The state of a motor that may not follow its target.
    pub state: SafeState,
    /// Time for which a command holds: 1 µs ..= [`LONGEST_EXPIRY`](Self::LONGEST_EXPIRY).
    pub command_expiry: Micros,
}

impl Safety {
    /// Longest allowed command timeout.
    pub const LONGEST_EXPIRY: Micros = Micros::from_millis(1000);
    /// Coast when no command came for 50 ms.
    pub const COAST: Self = Self::new(SafeState::Coast);
    /// Brake when no command came for 50 ms.
    pub const BRAKE: Self = Self::new(SafeState::Brake);
    /// Hold the angle when no command came for 50 ms.
    pub const HOLD: Self = Self::new(SafeState::Hold);

    /// A safe state, taken when no command came for 50 ms.
    pub const fn new(state: SafeState) -> Self {
        Self { state, command_expiry: Micros::from_millis(50) }
    }

    /// Whether a command holds for some time, and not for too long.
    pub(crate) const fn is_valid(&self) -> bool {
        let expiry = self.command_expiry.get();
        expiry > 0 && expiry <= Self::LONGEST_EXPIRY.get()
    }
}

/// A motor's counters. `received` is modulo 2³² (49 days at 1 kHz); others stay at the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct MotorCounters {
    /// Good feedback frames.
    pub received: u32,
    /// Frames with its identifier that were no feedback.
    pub malformed: u32,
    /// Answers to requests that were not made here: another program's, or late ones.
    pub unasked: u32,
    /// Times it went from online to lost.
    pub lost: u32,
    /// Times its command expired while it was armed and online.
    pub expired: u32,
    /// Targets that were refused: those that its port did not take included.
    pub refused: Refusals,
}

/// Counters of the refused targets of a motor, by reason: see [`TargetError`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Refusals {
    /// Targets of a kind that the motor does not take. Also those that came before its bus ran.
    pub unsupported: u32,
    /// Targets with a number that is infinite or NaN.
    pub not_finite: u32,
    /// Targets with a number that lies where the motor cannot go.
    pub out_of_range: u32,
}

impl Refusals {
    pub(crate) const NONE: Self = Self { unsupported: 0, not_finite: 0, out_of_range: 0 };

    /// The sum of all.
    pub const fn total(&self) -> u32 {
        self.unsupported.saturating_add(self.not_finite).saturating_add(self.out_of_range)
    }

    #[cfg(feature = "embassy")]
    pub(crate) const fn plus(self, other: Self) -> Self {
        Self {
            unsupported: self.unsupported.saturating_add(other.unsupported),
            not_finite: self.not_finite.saturating_add(other.not_finite),
            out_of_range: self.out_of_range.saturating_add(other.out_of_range),
        }
    }

    pub(crate) const fn add(&mut self, error: TargetError) {
        count(match error {
            TargetError::Unsupported(_) => &mut self.unsupported,
            TargetError::NotFinite(_) => &mut self.not_finite,
            TargetError::OutOfRange(_) => &mut self.out_of_range,
        });
    }
}

/// `9800 not finite, 1 out of range`; `none`.
impl fmt::Display for Refusals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { unsupported, not_finite, out_of_range } = *self;
        let counts = [
            (unsupported, "of a kind it does not take"),
            (not_finite, "not finite"),
            (out_of_range, "out of range"),
        ];
        if self.total() == 0 {
            return f.write_str("none");
        }
        let mut separator = "";
        for (count, reason) in counts.into_iter().filter(|(count, _)| *count > 0) {
            write!(f, "{separator}{count} {reason}")?;
            separator = ", ";
        }
        Ok(())
    }
}

/// The status of one motor: all there is to know about it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct MotorStatus {
    /// Whether it is heard.
    pub link: Link,
    /// The drive mode in the last tick.
    pub drive: DriveMode,
    /// The target it has.
    pub target: Target,
    /// The newest measurements.
    pub feedback: Feedback,
    /// The fault that it reports.
    pub fault: Option<Fault>,
    /// Whether it does what its target says, given that it may run.
    pub condition: Condition,
    /// The counters.
    pub counters: MotorCounters,
}

impl MotorStatus {
    /// Whether its loops decide what it does: they drive it, and follow no effort that was asked for.
    #[must_use]
    pub const fn is_looped(&self) -> bool {
        use TargetKind::{Current, Duty, Impedance, Torque};
        let is_driven = !matches!(self.drive, DriveMode::Off | DriveMode::Coast);
        let is_asked = matches!(self.target.kind(), Current | Torque | Duty | Impedance);
        is_driven && matches!(self.link, Link::Online) && !is_asked
    }

    /// The effort that its loops commanded last, in their unit; `None` while none here decide.
    #[must_use]
    pub fn effort(&self) -> Option<f32> {
        self.feedback.effort().filter(|_| self.is_looped())
    }

    /// Measurements for a mechanism; the effort is the current in A, else N m, else 0.
    pub fn measured(&self) -> Measured {
        let Feedback { total_angle: angle, speed, turn_gaps: gaps, .. } = self.feedback;
        let torque = || self.feedback.torque().map(NewtonMetres::get);
        let effort = self.feedback.current().map(Amps::get).or_else(torque).unwrap_or_default();
        let health = match (self.link, self.fault) {
            (Link::Online, None) => Health::Ready,
            (Link::Online, Some(_)) => Health::Faulty,
            (Link::NeverSeen | Link::Lost, _) => Health::Offline,
        };
        Measured { angle, speed, effort, gaps, health }
    }

    /// The status of a motor that was never heard.
    pub const NEW: Self = Self {
        link: Link::NeverSeen,
        drive: DriveMode::Off,
        target: Target::Coast,
        feedback: Feedback::NEW,
        fault: None,
        condition: Condition::Ready,
        counters: MotorCounters {
            received: 0,
            malformed: 0,
            unasked: 0,
            lost: 0,
            expired: 0,
            refused: Refusals::NONE,
        },
    };
}

/// A frame may come this long after its tick began; one further ahead has another clock.
const SKEW: Micros = Micros::from_millis(2);

/// Decides in every tick what a motor may do, from when it was heard and commanded last.
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug)]
pub(crate) struct Supervision {
    heard_at: Micros,
    commanded_at: Micros,
    /// With [`SKEW`].
    link_timeout: Micros,
    command_expiry: Micros,
    safety: Safety,
    drive: DriveMode,
    link: Link,
    fresh: bool,
    /// The motor has told of a fault that has not been cleared.
    faulted: bool,
    /// Clearing it has been asked for, and the device has not answered yet.
    clearing: bool,
    /// The time of the last [`Request::Jog`] by which it turns while the robot is disarmed.
    jogged: bool,
    jogged_at: Micros,
    /// The last jog was too fast: until zero is asked for, or nothing for a while.
    ran_away: bool,
    counters: MotorCounters,
}

const JOG: Micros = Micros::from_millis(80);
/// How long none is asked for before one that was too fast is forgotten.
const FORGET: Micros = Micros::from_millis(200);
/// A speed that is this much above the one asked for is no runaway, rpm: small ones are noisy.
const NOISE: f32 = 5.0;

impl Supervision {
    /// The supervision of a motor that was never heard; `safety` is valid.
    pub(crate) fn new(safety: Safety, link_timeout: Micros) -> Self {
        Self {
            heard_at: Micros::ZERO,
            commanded_at: Micros::ZERO,
            link_timeout: link_timeout + SKEW,
            command_expiry: safety.command_expiry + SKEW,
            safety,
            drive: DriveMode::Off,
            link: Link::NeverSeen,
            fresh: false,
            faulted: false,
            clearing: false,
            jogged: false,
            jogged_at: Micros::ZERO,
            ran_away: false,
            counters: MotorCounters::default(),
        }
    }

    #[inline]
    pub(crate) fn command(
        &mut self,
        motor: &mut (impl Motor + ?Sized),
        target: Target,
        now: Micros,
    ) -> Result<(), TargetError> {
        if let Err(error) = motor.set_target(target) {
            self.counters.refused.add(error);
            return Err(error);
        }
        self.commanded_at = now;
        self.fresh = true;
        Ok(())
    }

    /// Turns the motor slowly though the robot is disarmed.
    pub(crate) fn jog(
        &mut self,
        motor: &mut (impl Motor + ?Sized),
        speed: Rpm,
        arm: ArmState,
        now: Micros,
    ) -> Result<Response, RequestError> {
        // Whatever comes of it, what was asked for before is over.
        self.jogged = false;
        if arm != ArmState::Disarmed {
            return Err(RequestError::NotWhileArmed);
        }
        let ran_away = core::mem::replace(&mut self.ran_away, false);
        if speed.get() == 0.0 {
            return Ok(Response::Done);
        }
        let is_recent = now.since(self.jogged_at) < FORGET;
        if is_too_fast(motor, speed) || (ran_away && is_recent) {
            (self.ran_away, self.jogged_at) = (true, now);
            return Err(RequestError::TooFast);
        }
        if self.link(now) != Link::Online {
            return Err(RequestError::NoFeedback);
        }
        if self.is_commanded(now) || self.faulted {
            return Err(RequestError::Busy);
        }
        motor.set_target(Target::Speed(speed)).map_err(|_| RequestError::Unsupported)?;
        (self.jogged, self.jogged_at) = (true, now);
        Ok(Response::Done)
    }

    /// Ends a jog when the robot stops, or the motor runs away: gains of a PC may be wrong.
    pub(crate) fn watch_jog(&mut self, motor: &(impl Motor + ?Sized), arm: ArmState) {
        self.ran_away = matches!(motor.target(), Target::Speed(asked) if is_too_fast(motor, asked));
        if self.ran_away || arm != ArmState::Disarmed {
            // That is no command that has expired.
            (self.jogged, self.drive) = (false, DriveMode::Off);
        }
    }

    /// Whether it turns by a jog.
    #[inline]
    pub(crate) const fn jogs(&self) -> bool {
        self.jogged
    }

    /// Whether it is driven, or would be in the next tick; `arm` as motors see it.
    pub(crate) fn is_driven(&self, arm: ArmState, now: Micros) -> bool {
        let drives = matches!(self.drive, DriveMode::Run | DriveMode::Hold | DriveMode::Brake);
        self.jogged || (arm != ArmState::Disarmed && (drives || self.is_commanded(now)))
    }

    #[inline]
    fn is_commanded(&self, now: Micros) -> bool {
        self.fresh && since(self.commanded_at, now) < self.command_expiry
    }

    fn is_jogged(&self, arm: ArmState, now: Micros) -> bool {
        self.jogged && arm == ArmState::Disarmed && !self.faulted && now.since(self.jogged_at) < JOG
    }

    pub(crate) fn request(
        &mut self,
        motor: &mut (impl Motor + ?Sized),
        request: Request,
    ) -> Result<Response, RequestError> {
        let response = motor.request(request)?;
        if request == Request::ClearFault {
            // If the fault is still there, the motor's next frame says so.
            self.clearing = response == Response::Pending;
            self.faulted &= self.clearing;
        }
        Ok(response)
    }

    pub(crate) fn response(&mut self, motor: &mut (impl Motor + ?Sized)) -> Option<Outcome> {
        let response = motor.response()?;
        if core::mem::take(&mut self.clearing) && response.is_ok() {
            self.faulted = false;
        }
        Some(response)
    }

    /// The motor told how it is.
    #[inline]
    pub(crate) fn heard_feedback(&mut self, at: Micros) {
        self.counters.received = self.counters.received.wrapping_add(1);
        self.heard_at = at;
        self.link = Link::Online;
    }

    /// A frame of the motor was something else than its plain feedback.
    #[cold] // The usual feedback does not come here.
    pub(crate) fn heard(&mut self, heard: Heard, at: Micros) -> Result<(), FrameError> {
        let heard = heard.inspect_err(|error| {
            let counters = &mut self.counters;
            let is_unasked = *error == FrameError::Unasked;
            count(if is_unasked { &mut counters.unasked } else { &mut counters.malformed });
        })?;
        self.counters.received = self.counters.received.wrapping_add(1);
        if heard != FrameKind::Other {
            (self.heard_at, self.link) = (at, Link::Online);
        }
        if heard == FrameKind::Fault {
            self.faulted = true;
            // The next tick decides afresh.
            self.drive = DriveMode::Off;
        }
        Ok(())
    }

    /// Nothing from before a long pause holds any more.
    pub(crate) fn forget(&mut self) {
        (self.fresh, self.jogged) = (false, false);
        self.drive = DriveMode::Off;
        if self.link == Link::Online {
            self.link = Link::Lost;
            count(&mut self.counters.lost);
        }
    }

    #[inline]
    pub(crate) fn write_status(
        &self,
        motor: &(impl Motor + ?Sized),
        now: Micros,
        status: &mut MotorStatus,
    ) {
        status.link = self.link(now);
        status.drive = self.drive;
        status.target = motor.target();
        status.feedback = motor.feedback();
        status.fault = motor.fault();
        status.condition = motor.condition();
        status.counters = self.counters;
    }

    /// Whether the motor was heard within its time-out: the one place that knows.
    #[inline]
    pub(crate) fn link(&self, now: Micros) -> Link {
        match self.link {
            Link::Online if since(self.heard_at, now) > self.link_timeout => Link::Lost,
            link => link,
        }
    }

    /// The same in the tick that was [decided](Self::decide).
    #[inline]
    pub(crate) const fn link_in_tick(&self) -> Link {
        self.link
    }

    /// Decides the drive mode: this and [`change`](Self::change) are where motors are stopped.
    #[inline]
    pub(crate) fn decide(&mut self, arm: ArmState, now: Micros) -> DriveMode {
        if arm == ArmState::Armed
            && self.drive == DriveMode::Run
            && since(self.heard_at, now) <= self.link_timeout
            && since(self.commanded_at, now) < self.command_expiry
        {
            return DriveMode::Run;
        }
        self.change(arm, now)
    }

    /// Decides the drive mode of a motor that does not simply go on running.
    #[cold] // A motor that simply goes on running does not come here.
    fn change(&mut self, arm: ArmState, now: Micros) -> DriveMode {
        let online = self.link(now) == Link::Online;
        let fresh = self.is_commanded(now);
        // A command ends it for good: the target is another one.
        let jogs = !fresh && self.is_jogged(arm, now);
        let jogged = core::mem::replace(&mut self.jogged, jogs);
        let drive = match arm {
            ArmState::Disarmed if self.jogged && online => DriveMode::Run,
            ArmState::Disarmed => DriveMode::Off,
            _ if !online => DriveMode::Coast,
            ArmState::Armed if fresh && !self.faulted => DriveMode::Run,
            ArmState::Armed | ArmState::Suspended | ArmState::EStopped => self.safety.state.mode(),
        };
        if self.link == Link::Online && !online {
            self.link = Link::Lost;
            count(&mut self.counters.lost);
        } else if self.drive == DriveMode::Run && arm == ArmState::Armed && !fresh && !jogged {
            count(&mut self.counters.expired);
        }
        (self.drive, self.fresh) = (drive, fresh);
        drive
    }
}

/// Whether it turns twice as fast as asked for.
fn is_too_fast(motor: &(impl Motor + ?Sized), asked: Rpm) -> bool {
    let asked = asked.get().abs();
    motor.feedback().speed.get().abs() > (2.0 * asked).max(asked + NOISE)
}

/// The time until `now`, plus [`SKEW`]: what lies further ahead than that is old.
#[inline]
fn since(earlier: Micros, now: Micros) -> Micros {
    Micros::new((now + SKEW).get().wrapping_sub(earlier.get()))
}

/// One more; stays at the largest value.
#[inline]
pub(crate) const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
