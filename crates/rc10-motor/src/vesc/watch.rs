//! Signs of trouble with a VESC: whether it reports, often enough, and does what it is told.

use super::config::CONTROL_HZ;
use super::motor::Reported;
use super::wire::Command;
use crate::feedback::Condition;
use crate::motor::{DriveMode, Link, Tick};

/// A VESC that does not report is asked this often, s.
const ASK_PERIOD: f32 = 0.5;
/// The time for which its answer counts, s: two questions may go unanswered.
const ANSWER_HOLDS: f32 = 1.3;
/// Reports are counted over this time, s …
const WINDOW: f32 = 0.1;
/// … and are too few below three quarters of [`CONTROL_HZ`].
const FEWEST: u16 = CONTROL_HZ / 40 * 3;
/// The time for which a VESC may draw nothing though it should, s. Ramps of its own take less.
const IDLE_TIME: f32 = 0.5;
/// Half a step of the current in STATUS, A.
const NOTHING: f32 = 0.05;

/// The signs by which the [`Condition`] of a VESC is known.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Watch {
    is_slow_by_design: bool,
    is_online: bool,
    until_asking: f32,
    /// Seconds for which the last answer counts yet.
    answered: f32,
    window: f32,
    reports: u16,
    is_slow: bool,
    /// Seconds for which it has drawn nothing though it should.
    idle: f32,
}

impl Watch {
    /// The watch of a VESC that was never heard, whose STATUS comes this many times a second.
    pub(super) const fn new(status_hz: u16) -> Self {
        Self {
            is_slow_by_design: status_hz < CONTROL_HZ,
            is_online: false,
            until_asking: ASK_PERIOD,
            answered: 0.0,
            window: 0.0,
            reports: 0,
            is_slow: false,
            idle: 0.0,
        }
    }

    pub(super) const fn hear(&mut self) {
        self.answered = 0.0;
        self.reports = self.reports.saturating_add(1);
    }

    pub(super) const fn hear_answer(&mut self) {
        self.answered = ANSWER_HOLDS;
    }

    /// Whether to ask now if it is there.
    pub(super) fn asks(&self) -> bool {
        self.until_asking <= 0.0
    }

    pub(super) const fn asked(&mut self) {
        self.until_asking = ASK_PERIOD;
    }

    pub(super) fn update(&mut self, tick: &Tick, command: &Command, reported: &Reported) {
        let dt = tick.dt.get();
        self.is_online = tick.link == Link::Online;
        self.answered = (self.answered - dt).max(0.0);
        if !self.is_online {
            self.until_asking -= dt;
            self.idle = 0.0;
            return;
        }
        self.until_asking = ASK_PERIOD;
        self.window += dt;
        if self.window >= WINDOW {
            self.is_slow = self.reports < FEWEST;
            (self.window, self.reports) = (0.0, 0);
        }
        let idles = tick.mode == DriveMode::Run
            && reported.current.abs() < NOTHING
            && misses(command, reported);
        self.idle = if idles { self.idle + dt } else { 0.0 };
    }

    /// `is_regulated`: the speed asked for is regulated. `is_blind`: an angle without a tachometer.
    pub(super) fn condition(
        &self,
        mode: DriveMode,
        is_regulated: bool,
        is_blind: bool,
    ) -> Condition {
        let runs = mode == DriveMode::Run;
        if !self.is_online {
            if self.answered > 0.0 { Condition::NoReports } else { Condition::Ready }
        } else if runs && !is_regulated {
            Condition::Unregulated
        } else if runs && self.idle > IDLE_TIME {
            Condition::NotFollowing
        } else if self.is_slow || self.is_slow_by_design || runs && is_blind {
            Condition::SlowFeedback
        } else {
            Condition::Ready
        }
    }
}

/// Whether a VESC that draws no current cannot be doing this.
fn misses(command: &Command, reported: &Reported) -> bool {
    let Reported { speed, duty, .. } = *reported;
    match *command {
        // At full voltage there may be none left to drive a current.
        Command::Current(amps) => amps.get().abs() > 0.5 && duty.abs() < 0.8,
        Command::RelativeCurrent(share) => share.abs() > 0.05 && duty.abs() < 0.8,
        Command::Duty(wanted) => (wanted - duty).abs() > 0.05,
        Command::Speed(wanted) => (wanted.get() - speed.get()).abs() > 0.1 * wanted.get().abs(),
        Command::Handbrake(amps) => amps.get() > 0.5,
        Command::RelativeHandbrake(share) => share > 0.05,
        // These need no current where there is no movement, or no error.
        Command::Brake(_) | Command::RelativeBrake(_) | Command::Position(_) => false,
    }
}
