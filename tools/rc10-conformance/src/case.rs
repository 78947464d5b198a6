use std::cell::OnceCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use rc10_motor::{ArmSwitch, CanIds, CanMotor, DriveMode, Request, SafeState, Safety, Target};
use rc10_sim::EscFault;
use rc10_time::Micros;

use crate::declaration::Declaration;
use crate::harness::{Connection, Harness, Subject};
use crate::mirror::Mirror;
use crate::outcome::Halt;
use crate::recorder::{Call, Log, recorded};
use crate::rig::Rig;

/// Chance is the same in every run.
const SEED: u64 = 10;

/// A motor to be tried.
pub(crate) struct Case<'a> {
    pub(crate) declared: &'a Declaration,
    connection: Connection<'a>,
    life: OnceCell<Life>,
}

/// All that happened to a motor that lived through everything.
pub(crate) struct Life {
    /// Empty of a motor without frames.
    pub(crate) log: Log,
    /// When it took other targets than a fresh one, and in which drive.
    pub(crate) other_targets: Option<(Micros, DriveMode)>,
    /// The number of calls after which it was turning under load.
    going: usize,
}

impl Life {
    /// The calls that made the motor turn, and those after them.
    pub(crate) fn calls(&self) -> (&[Call], &[Call]) {
        self.log.calls.split_at(self.going)
    }
}

impl<'a> Case<'a> {
    pub(crate) const fn new(declared: &'a Declaration, connection: Connection<'a>) -> Self {
        Self { declared, connection, life: OnceCell::new() }
    }

    /// A fresh motor, set to the first identifier.
    pub(crate) fn motor(&self) -> Subject {
        self.connection.motor(self.declared.ids[0])
    }

    /// A fresh motor, if it has frames.
    pub(crate) fn can_motor(&self) -> Option<Box<dyn CanMotor>> {
        match self.motor() {
            Subject::OnBus(motor) => Some(motor),
            Subject::OnLine(_) => None,
        }
    }

    /// The identifiers of a fresh motor, if it has frames.
    pub(crate) fn can_ids(&self) -> Option<CanIds> {
        self.can_motor().map(|motor| motor.can_ids())
    }

    /// One set to the other.
    pub(crate) fn other_motor(&self) -> Subject {
        self.connection.motor(self.declared.ids[1])
    }

    /// One that was turning under load a moment ago, if it could.
    pub(crate) fn used_motor(&self) -> Subject {
        let mut motor = self.motor();
        // That it gets going is another rule.
        let _ = self.with(&mut motor, Safety::COAST, |rig| rig.get_going());
        motor
    }

    /// An empty wire.
    pub(crate) fn bench<'m>(&'m self, switch: &'m ArmSwitch) -> Harness<'m> {
        self.connection.bench(SEED, Mirror(self.declared.direction), switch)
    }

    /// A motor and its device on a wire of their own.
    pub(crate) fn alone<T>(
        &self,
        state: SafeState,
        scenario: impl FnOnce(&mut Rig<'_>) -> Result<T, Halt>,
    ) -> Result<T, Halt> {
        self.with(&mut self.motor(), Safety::new(state), scenario)
    }

    /// Runs a scenario with one motor alone that has got going, and goes to this state when it must
    /// stop.
    pub(crate) fn going<T>(
        &self,
        state: SafeState,
        scenario: impl FnOnce(&mut Rig<'_>) -> Result<T, Halt>,
    ) -> Result<T, Halt> {
        self.alone(state, |rig| {
            rig.get_going()?;
            scenario(rig)
        })
    }

    pub(crate) fn with<T>(
        &self,
        motor: &mut Subject,
        safety: Safety,
        scenario: impl FnOnce(&mut Rig<'_>) -> Result<T, Halt>,
    ) -> Result<T, Halt> {
        let switch = ArmSwitch::new();
        let mut bench = self.bench(&switch);
        let esc = bench.device(self.declared.ids[0]);
        match bench.attach(motor, safety) {
            Ok(id) => scenario(&mut Rig::new(self.declared, bench, esc, id, &switch)),
            Err(_) => Err(Halt::Stuck),
        }
    }

    /// A motor that lived through everything; as far as it got.
    pub(crate) fn life(&self) -> &Life {
        self.life.get_or_init(|| {
            let (mut motor, shared) = recorded(self.motor());
            let (mut going, mut other_targets) = (0, None);
            let lived = catch_unwind(AssertUnwindSafe(|| {
                self.with(&mut motor, Safety::HOLD, |rig| {
                    rig.get_going()?;
                    going = shared.log().calls.len();
                    live(rig);
                    other_targets = rig.other_targets;
                    Ok(())
                })
            }));
            if !matches!(lived, Ok(Ok(()))) {
                going = shared.log().calls.len();
            }
            drop(motor);
            let log = std::mem::take(&mut *shared.log());
            Life { log, going, other_targets }
        })
    }
}

/// Every event that a motor can meet, one after the other.
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
    let _ = rig.ask(Request::SetZeroOfDriven);
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
