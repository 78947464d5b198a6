//! What is seen of a VESC beside its numbers: whether it reports at all, often enough, and does
//! what it is told.

use rc10_app::Seconds;
use rc10_can::Micros;

use super::{CONTROL_HZ, Command, ElectricalRpm};
use crate::motor::{Condition, DriveMode};

/// A VESC that does not report is asked this often, s.
const ASK_PERIOD: f32 = 0.5;
/// Its answer counts for so long, s: two questions may go unanswered.
const ANSWER_HOLDS: f32 = 1.3;
/// Reports are counted over this time, s …
const WINDOW: f32 = 0.1;
/// … and are too few below three quarters of [`CONTROL_HZ`].
const FEWEST: u16 = CONTROL_HZ / 40 * 3;
/// So long a VESC may draw nothing though it should, s. Ramps of its own take less.
const IDLE_TIME: f32 = 0.5;
/// Half a step of the current in STATUS, A.
const NOTHING: f32 = 0.05;

#[derive(Clone, Copy, Debug)]
pub(super) struct Watch {
    link_timeout: Micros,
    is_slow_by_design: bool,
    /// Seconds since the last STATUS.
    quiet: f32,
    until_asking: f32,
    /// Seconds for which the last answer counts yet.
    answered: f32,
    window: f32,
    reports: u16,
    is_slow: bool,
    /// As in the last STATUS.
    current: f32,
    duty: f32,
    /// Seconds for which it has drawn nothing though it should.
    idle: f32,
}

impl Watch {
    /// Of a VESC that was never heard, whose STATUS comes so many times a second.
    pub(super) fn new(status_hz: u16) -> Self {
        // As the wiring has it.
        let periods = 3_000_000_u32.div_ceil(u32::from(status_hz).max(1));
        Self {
            link_timeout: Micros::new(u64::from(periods.max(10_000))),
            is_slow_by_design: status_hz < CONTROL_HZ,
            quiet: f32::INFINITY,
            until_asking: ASK_PERIOD,
            answered: 0.0,
            window: 0.0,
            reports: 0,
            is_slow: false,
            current: 0.0,
            duty: 0.0,
            idle: 0.0,
        }
    }

    pub(super) const fn link_timeout(&self) -> Micros {
        self.link_timeout
    }

    fn is_quiet(&self) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "three seconds at most")]
        let timeout = self.link_timeout.get() as f32 * 1e-6;
        self.quiet > timeout
    }

    /// A STATUS came.
    pub(super) fn hear(&mut self, current: f32, duty: f32) {
        if self.is_quiet() {
            // Counts afresh.
            (self.window, self.reports, self.idle) = (0.0, 0, 0.0);
        }
        (self.quiet, self.answered) = (0.0, 0.0);
        (self.current, self.duty) = (current, duty);
        self.reports = self.reports.saturating_add(1);
    }

    /// A PONG came.
    pub(super) const fn hear_answer(&mut self) {
        self.answered = ANSWER_HOLDS;
    }

    /// Whether to ask it now if it is there.
    pub(super) fn asks(&self) -> bool {
        self.until_asking <= 0.0
    }

    /// It was asked.
    pub(super) const fn asked(&mut self) {
        self.until_asking = ASK_PERIOD;
    }

    pub(super) fn tick(
        &mut self,
        dt: Seconds,
        drive: DriveMode,
        command: &Command,
        speed: ElectricalRpm,
    ) {
        let dt = dt.get();
        self.quiet += dt;
        self.answered = (self.answered - dt).max(0.0);
        if self.is_quiet() {
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
        let idles =
            drive == DriveMode::Run && self.current.abs() < NOTHING && self.misses(command, speed);
        self.idle = if idles { self.idle + dt } else { 0.0 };
    }

    /// Whether a VESC that draws no current cannot be doing this.
    fn misses(&self, command: &Command, speed: ElectricalRpm) -> bool {
        match *command {
            // At full voltage there may be none left to drive a current.
            Command::Current(amps) => amps.get().abs() > 0.5 && self.duty.abs() < 0.8,
            Command::RelativeCurrent(share) => share.abs() > 0.05 && self.duty.abs() < 0.8,
            Command::Duty(duty) => (duty - self.duty).abs() > 0.05,
            Command::Speed(wanted) => (wanted.get() - speed.get()).abs() > 0.1 * wanted.get().abs(),
            Command::Handbrake(amps) => amps.get() > 0.5,
            Command::RelativeHandbrake(share) => share > 0.05,
            // These need no current where there is no movement, or no error.
            Command::Brake(_) | Command::RelativeBrake(_) | Command::Position(_) => false,
        }
    }

    /// `regulated`: whether the VESC regulates the speed asked for. `blind`: whether an angle is
    /// sought by a tachometer that does not come.
    pub(super) fn condition(&self, drive: DriveMode, regulated: bool, blind: bool) -> Condition {
        if self.is_quiet() {
            return if self.answered > 0.0 { Condition::NoReports } else { Condition::Ready };
        }
        let runs = drive == DriveMode::Run;
        if runs && !regulated {
            Condition::Unregulated
        } else if runs && self.idle > IDLE_TIME {
            Condition::NotFollowing
        } else if self.is_slow || self.is_slow_by_design || runs && blind {
            Condition::SlowFeedback
        } else {
            Condition::Ready
        }
    }
}
