use std::cell::OnceCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use rc10_can::Micros;
use rc10_motor::{ArmSwitch, CanMotor, Request, SafeState, Safety, Target};
use rc10_sim::{Bus, Esc, EscFault};

use crate::Bench;
use crate::declaration::Declaration;
use crate::recorder::{Call, Log, Moment, Recorded};
use crate::report::{Breach, Report};
use crate::rig::Rig;
use crate::rules::RULES;

/// Chance is the same in every run.
const SEED: u64 = 10;

/// Runs every [rule](crate::RULES) on a motor: `motor` makes a fresh one, set to an identifier, and
/// `device` puts its simulated device, set to that identifier, on a wire. Both turn the same way.
///
/// # Errors
/// All rules that are broken, and what could not be tried.
pub fn check<M: CanMotor + 'static>(
    declared: &Declaration,
    motor: impl Fn(u8) -> M,
    device: impl Fn(&Bus, u8) -> Esc,
) -> Result<(), Report> {
    let make = |id| Box::new(motor(id)) as Box<dyn CanMotor>;
    let case = Case { declared, make: &make, device: &device, life: OnceCell::new() };
    let name = make(declared.ids[0]).wiring().name();
    let mut report = Report { motor: name, breaches: Vec::new(), unchecked: Vec::new() };
    for rule in RULES {
        let mut found = Findings::default();
        let tried = catch_unwind(AssertUnwindSafe(|| (rule.check)(&case, &mut found)));
        if let Err(panic) = tried {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("…");
            found.add(None, format!("it panicked: {text}"));
        }
        let breach = |(at, what)| Breach { rule: rule.name, what, at };
        report.breaches.extend(found.found.into_iter().map(breach));
        if found.is_stuck {
            report.unchecked.push(rule.name);
        }
    }
    if report.breaches.is_empty() && report.unchecked.is_empty() { Ok(()) } else { Err(report) }
}

/// Why a scenario ended early.
pub(crate) enum Halt {
    /// The rule is broken.
    Broken(Option<Micros>, String),
    /// The motor does not do what the scenario starts from: another rule says so.
    Stuck,
}

pub(crate) type Outcome = Result<(), Halt>;

pub(crate) fn broken<T>(at: impl Into<Option<Micros>>, what: impl Into<String>) -> Result<T, Halt> {
    Err(Halt::Broken(at.into(), what.into()))
}

/// What one rule found. A fault that shows in every tick is told a few times only.
#[derive(Default)]
pub(crate) struct Findings {
    found: Vec<(Option<Micros>, String)>,
    is_stuck: bool,
}

const MOST_FINDINGS: usize = 4;

impl Findings {
    pub(crate) fn add(&mut self, at: Option<Micros>, what: String) {
        if self.found.len() < MOST_FINDINGS {
            self.found.push((at, what));
        }
    }

    pub(crate) fn note(&mut self, outcome: Outcome) {
        match outcome {
            Ok(()) => (),
            Err(Halt::Broken(at, what)) => self.add(at, what),
            Err(Halt::Stuck) => self.is_stuck = true,
        }
    }
}

/// A motor to be tried.
pub(crate) struct Case<'a> {
    pub(crate) declared: &'a Declaration,
    make: &'a dyn Fn(u8) -> Box<dyn CanMotor>,
    device: &'a dyn Fn(&Bus, u8) -> Esc,
    life: OnceCell<Life>,
}

/// All that happened to a motor that lived through everything.
pub(crate) struct Life {
    pub(crate) log: Log,
    /// So many calls in it was turning under load.
    going: usize,
}

impl Life {
    /// What made the motor turn, and what came then.
    pub(crate) fn calls(&self) -> (&[Call], &[Call]) {
        self.log.calls.split_at(self.going)
    }

    pub(crate) fn moments(&self) -> &[Moment] {
        &self.log.moments
    }
}

impl Case<'_> {
    /// A fresh motor, set to the first identifier.
    pub(crate) fn motor(&self) -> Box<dyn CanMotor> {
        (self.make)(self.declared.ids[0])
    }

    /// One set to the other.
    pub(crate) fn other_motor(&self) -> Box<dyn CanMotor> {
        (self.make)(self.declared.ids[1])
    }

    pub(crate) fn device(&self, wire: &Bus, id: u8) -> Esc {
        (self.device)(wire, id)
    }

    /// A motor and its device on a wire of their own.
    pub(crate) fn alone(
        &self,
        state: SafeState,
        scenario: impl FnOnce(&mut Rig<'_>) -> Outcome,
    ) -> Outcome {
        self.with(&mut *self.motor(), Safety::new(state), scenario)
    }

    pub(crate) fn with(
        &self,
        motor: &mut dyn CanMotor,
        safety: Safety,
        scenario: impl FnOnce(&mut Rig<'_>) -> Outcome,
    ) -> Outcome {
        let switch = ArmSwitch::new();
        let mut bench = Bench::new(SEED, &switch);
        let esc = self.device(&bench.wire, self.declared.ids[0]);
        match bench.attach(motor, safety) {
            Ok(id) => scenario(&mut Rig::new(self.declared, bench, esc, id, &switch)),
            Err(_) => Err(Halt::Stuck),
        }
    }

    /// A motor that lived through everything; as far as it got.
    pub(crate) fn life(&self) -> &Life {
        self.life.get_or_init(|| {
            let mut motor = Recorded::new(self.motor());
            let shared = motor.shared.clone();
            let mut going = 0;
            let lived = catch_unwind(AssertUnwindSafe(|| {
                self.with(&mut motor, Safety::HOLD, |rig| {
                    rig.get_going()?;
                    going = shared.log().calls.len();
                    live(rig);
                    Ok(())
                })
            }));
            if !matches!(lived, Ok(Ok(()))) {
                going = shared.log().calls.len();
            }
            drop(motor);
            let log = std::mem::take(&mut *shared.log());
            Life { log, going }
        })
    }
}

/// Everything that can happen to a motor, one after the other.
fn live(rig: &mut Rig<'_>) {
    let cruise = Some(rig.cruise());
    let coast = Some(Target::Coast);
    rig.wait(cruise, 100);
    rig.wait(None, 200);
    for trial in &rig.declared.trials {
        rig.wait(Some(trial.target), 100);
    }
    rig.switch.emergency_stop();
    rig.wait(cruise, 50);
    rig.switch.reset();
    let _ = rig.switch.arm();
    rig.wait(coast, 50);
    let _ = rig.ask(Request::SetZero);
    rig.wait(cruise, 100);
    rig.esc.set_feedback(false);
    rig.wait(cruise, 100);
    rig.esc.set_feedback(true);
    rig.wait(cruise, 200);
    rig.esc.set_power(false);
    rig.wait(cruise, 100);
    rig.esc.set_power(true);
    rig.wait(cruise, 200);
    rig.esc.inject(EscFault::OverTemperature);
    rig.wait(cruise, 100);
    let _ = rig.ask(Request::ClearFault);
    rig.wait(cruise, 200);
    rig.switch.disarm();
    rig.wait(None, 50);
    for request in [Request::StoreZero, Request::ReadRegister(0), Request::ClearFault] {
        let _ = rig.ask(request);
    }
}
