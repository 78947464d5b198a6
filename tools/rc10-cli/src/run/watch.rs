//! Watches a robot that loses its remote, by wires and motors, not by its own word.

use rc10_module::Counters;
use rc10_motor::ArmState;
use rc10_sim::remote::Sent;
use rc10_sim::{Esc, Nanos};
use rc10_time::Micros;

use crate::recording::look::RemoteLook;
use crate::recording::remote::Loss;
use crate::recording::sample::RemoteSample;
use crate::robot::motor::Motor;
use crate::robot::remote::{Lost, RemoteControl};

/// Time after which a remote that is back has no more effects.
const LONG: Micros = Micros::from_millis(500);

/// Period of looks while something may happen: a step of the simulator's physics.
const STEP: Micros = Micros::new(100);

/// Watches a robot whose remote is lost now and then.
pub struct Watch {
    due: Vec<Lost>,
    /// The losses so far; the last one may be going on.
    pub losses: Vec<Loss>,
    /// Whether no fine look is needed for the moment.
    is_idle: bool,
}

/// A look at a robot from outside.
#[derive(Clone, Copy)]
pub struct Sight<'a> {
    /// Counters of the frames that the receiver has sent.
    pub sent: Sent,
    /// Motors, as described.
    pub motors: &'a [Motor],
    /// Twins of the motors.
    pub twins: &'a [Esc],
    /// Whether the robot is armed, if it says so.
    pub arm: Option<ArmState>,
}

impl Sight<'_> {
    /// The remote from outside; `heard` are the robot's own counters.
    pub fn remote(&self, heard: Option<Counters>) -> RemoteLook {
        RemoteLook {
            sample: RemoteSample { is_live: self.sent.back_since.is_some(), arm: self.arm },
            sent: self.sent,
            is_told: heard.is_some(),
            heard: heard.unwrap_or_default(),
        }
    }

    /// Whether a motor is commanded to do more than coast, of those that may hold or of the others.
    fn is_driven(&self, holding: bool) -> bool {
        let motors = self.motors.iter().zip(self.twins);
        motors
            .filter(|(motor, _)| motor.holds == holding)
            .any(|(motor, twin)| motor.has_torque(twin))
    }

    fn is_armed(&self) -> bool {
        self.arm.map_or_else(|| self.is_driven(false), |arm| arm == ArmState::Armed)
    }

    fn is_off(&self) -> bool {
        let has_none = || !self.is_driven(false) && !self.is_driven(true);
        match self.arm {
            Some(arm) => matches!(arm, ArmState::Disarmed | ArmState::EStopped),
            None => self.motors.iter().any(|motor| motor.holds) && has_none(),
        }
    }
}

impl Watch {
    /// Creates a watch for the losses of a robot's remote.
    pub fn new(control: Option<&RemoteControl>) -> Self {
        let mut due = control.map_or_else(Vec::new, |control| control.lost.clone());
        due.reverse();
        Self { due, losses: Vec::new(), is_idle: true }
    }

    /// The time of the next look.
    pub fn next(&self, now: Micros) -> Option<Micros> {
        let due = self.due.last().map(|lost| lost.from);
        let soon = (!self.is_idle).then(|| now + STEP);
        due.into_iter().chain(soon).min()
    }

    /// Looks at the robot; more often than needed does no harm.
    pub fn look(&mut self, now: Micros, sight: Sight<'_>) {
        if let Some(lost) = self.due.pop_if(|lost| lost.from <= now) {
            let last_frame = sight.sent.last_live.map(Nanos::micros);
            self.losses.push(Loss { last_frame, ..Loss::new(lost) });
            self.is_idle = false;
        }
        let Some(loss) = self.losses.last_mut() else { return };
        let is_back = loss.lost.until.is_some_and(|until| until <= now);
        if is_back && loss.back.is_none() {
            loss.back = sight.sent.back_since.map(Nanos::micros);
        }
        if self.is_idle {
            return;
        }
        let is_heard = loss.back.is_some_and(|back| back <= now);
        if loss.coasting.is_some() && is_heard && sight.is_armed() {
            loss.resumed = Some(now);
        } else if sight.is_driven(false) {
            loss.coasting = None;
        } else if loss.coasting.is_none() {
            loss.coasting = Some(now);
        }
        if !loss.is_settled() && sight.is_off() {
            loss.disarmed = Some(now);
        }
        // Too short to be noticed.
        let is_over = is_heard && loss.back.is_some_and(|back| now.since(back) > LONG);
        self.is_idle = loss.is_settled() || is_over;
    }
}
