use crate::declaration::{Claim, Declaration};
use crate::harness::Harness;
use crate::outcome::{Halt, Outcome, broken, must};
use rc10_app::Seconds;
use rc10_motor::{
    ArmSwitch, DriveMode, Link, MotorId, MotorStatus, Request, RequestError, Response, Target,
    TargetSet,
};
use rc10_sim::Esc;
use rc10_time::Micros;

/// A motor on a bus and its device on the wire, and what can be seen of both.
pub(crate) struct Rig<'m> {
    pub(crate) declared: &'m Declaration,
    pub(crate) bench: Harness<'m>,
    pub(crate) esc: Esc,
    pub(crate) motor: MotorId,
    pub(crate) switch: &'m ArmSwitch,
    last_torque: f64,
    /// For how many milliseconds the torque has gone with the movement.
    with_movement: u32,
    /// The fastest the torque has grown since [`watch`](Self::watch), N m a millisecond, and when.
    steepest: (f64, Micros),
    /// Which targets it took at first.
    supports: TargetSet,
    /// When it took other targets than at first, and in which drive.
    pub(crate) other_targets: Option<(Micros, DriveMode)>,
}

/// Times that everything must be over in, ms.
const SPIN_UP: u32 = 2_000;
const LONGEST_SILENCE: u32 = 500;
const LONGEST_ANSWER: u32 = 3_000;

impl<'m> Rig<'m> {
    pub(crate) fn new(
        declared: &'m Declaration,
        bench: Harness<'m>,
        esc: Esc,
        motor: MotorId,
        switch: &'m ArmSwitch,
    ) -> Self {
        let supports = bench.supports(motor);
        Self {
            declared,
            bench,
            esc,
            motor,
            switch,
            last_torque: 0.0,
            with_movement: 0,
            steepest: (0.0, Micros::ZERO),
            supports,
            other_targets: None,
        }
    }

    pub(crate) fn now(&self) -> Micros {
        self.bench.now()
    }

    /// The rule is broken, now, if it is not so.
    pub(crate) fn must(&self, is_so: bool, what: impl FnOnce() -> String) -> Outcome {
        must(self.now(), is_so, what)
    }

    pub(crate) fn status(&self) -> MotorStatus {
        self.bench.status(self.motor)
    }

    /// The target that makes it turn.
    pub(crate) fn cruise(&self) -> Target {
        self.declared.onward()
    }

    pub(crate) fn cruise_rpm(&self) -> f64 {
        self.declared.cruise.get().into()
    }

    pub(crate) fn load(&self) -> f64 {
        self.declared.load.get().into()
    }

    pub(crate) fn no_torque(&self) -> f64 {
        self.declared.no_torque.get().into()
    }

    pub(crate) fn full_torque(&self) -> f64 {
        self.declared.full_torque.get().into()
    }

    /// A millisecond, commanded or not.
    pub(crate) fn tick(&mut self, target: Option<Target>) {
        if let Some(target) = target {
            // Refusals have a rule of their own.
            let _ = self.bench.command(self.motor, target);
        }
        self.bench.tick(Seconds::new(0.001));
        self.look();
    }

    /// Notes what has changed in the last millisecond.
    pub(crate) fn look(&mut self) {
        if self.other_targets.is_none() && self.bench.supports(self.motor) != self.supports {
            self.other_targets = Some((self.now(), self.status().drive));
        }
        let state = self.esc.state();
        let torque = state.torque;
        let last = std::mem::replace(&mut self.last_torque, torque);
        let goes_with = torque * state.output_rpm > 0.0;
        self.with_movement = if goes_with { self.with_movement + 1 } else { 0 };
        if !goes_with && self.declared.drags(&state) {
            // That comes as suddenly as it likes.
            return;
        }
        // Falling to nothing is no kick, whatever it falls from.
        let grown = if torque * last > 0.0 { torque.abs() - last.abs() } else { torque.abs() };
        if grown > self.steepest.0 {
            self.steepest = (grown, self.now());
        }
    }

    pub(crate) fn wait(&mut self, target: Option<Target>, millis: u32) {
        (0..millis).for_each(|_| self.tick(target));
    }

    /// Waits until it is so, for so many milliseconds at most; whether it is.
    pub(crate) fn until(
        &mut self,
        target: Option<Target>,
        millis: u32,
        is_so: impl Fn(&Self) -> bool,
    ) -> bool {
        (0..millis).any(|_| {
            self.tick(target);
            is_so(self)
        })
    }

    /// Takes the device's power away for so long.
    pub(crate) fn restart(&mut self, target: Target, millis: u32) {
        self.esc.set_power(false);
        self.wait(Some(target), millis);
        self.esc.set_power(true);
    }

    /// Forgets how steep the torque was.
    pub(crate) const fn watch(&mut self) {
        self.steepest = (0.0, Micros::ZERO);
    }

    /// The torque has not grown faster since than it is declared to.
    pub(crate) fn was_soft(&self, when: &str) -> Outcome {
        let most = self.declared.softness * self.full_torque();
        let (steepest, at) = self.steepest;
        must(at, steepest <= most, || {
            format!("{when} its torque grew by {steepest:.3} N m in 1 ms, at most {most:.3}")
        })
    }

    /// The torque at the shaft, if there is any that should not be.
    fn push(&self) -> Option<f64> {
        let state = self.esc.state();
        // Drag ends a little later than the movement that it comes from.
        let pushes =
            !self.declared.drags(&state) || self.with_movement > self.declared.stops_within;
        (pushes && state.torque.abs() > self.no_torque()).then_some(state.torque)
    }

    /// From `grace` ms on there is no torque, until `millis` are over.
    pub(crate) fn rests(
        &mut self,
        target: Option<Target>,
        (grace, millis): (u32, u32),
        when: &str,
    ) -> Outcome {
        for past in 1..=millis {
            self.tick(target);
            if past > grace {
                self.is_at_rest(&format!("{past} ms {when}"))?;
            }
        }
        Ok(())
    }

    pub(crate) fn is_at_rest(&self, when: &str) -> Outcome {
        match self.push() {
            Some(torque) => broken(self.now(), format!("{torque:.3} N m at the shaft {when}")),
            None => Ok(()),
        }
    }

    /// Its bridge is open, if it has a way to open it; or shorts the winding, if that is its way.
    pub(crate) fn is_disabled(&self, when: &str) -> Outcome {
        let state = self.esc.state();
        self.must(
            state.open || self.declared.drags(&state) || self.declared.disables != Claim::Does,
            || format!("its device is enabled {when}"),
        )
    }

    /// The usual case of it: it had to stop just now.
    pub(crate) fn stops(&mut self, target: Option<Target>, when: &str) -> Outcome {
        let grace = self.declared.stops_within;
        self.rests(target, (grace, grace + 60), when)?;
        self.esc.set_load(0.0);
        self.rests(target, (0, 200), when)
    }

    /// Whether it turns onward or backward as it should, at half the speed at least.
    pub(crate) fn goes(&self, target: Target) -> bool {
        let rpm = self.esc.state().output_rpm;
        let rpm = if target == self.declared.onward() { rpm } else { -rpm };
        rpm >= 0.5 * self.cruise_rpm()
    }

    /// Waits until it turns.
    pub(crate) fn goes_again(&mut self, target: Target, when: &str) -> Outcome {
        let most = self.declared.enables_within + SPIN_UP;
        let goes = self.until(Some(target), most, |rig| rig.goes(target));
        let rpm = self.esc.state().output_rpm;
        self.must(goes, || format!("{when} it makes {rpm:.1} rpm, not {}", self.cruise_rpm()))
    }

    /// Whether its link is lost.
    pub(crate) fn is_lost(&self, when: &str) -> Outcome {
        self.must(self.status().link == Link::Lost, || {
            format!("{when} its link is {:?}", self.status().link)
        })
    }

    /// Waits until its device was heard: for some, that is a matter of tenths of a second.
    pub(crate) fn is_heard(&mut self) -> Outcome {
        self.wait(None, 20);
        let is_heard = self.status().link == Link::Online
            || self.until(None, LONGEST_SILENCE, |rig| rig.status().link == Link::Online);
        self.must(is_heard, || format!("disarmed, its link is {:?}", self.status().link))
    }

    /// Armed and heard, or another rule says why not.
    pub(crate) fn wake(&mut self) -> Outcome {
        self.is_heard().map_err(|_| Halt::Stuck)?;
        self.switch.arm().map_err(|_| Halt::Stuck)
    }

    /// Armed, heard, and turning against the load.
    pub(crate) fn get_going(&mut self) -> Outcome {
        self.wake()?;
        let cruise = self.cruise();
        self.goes_again(cruise, "").map_err(|_| Halt::Stuck)?;
        self.esc.set_load(-self.load());
        self.wait(Some(cruise), 100);
        // What is stopped later must be there to be stopped.
        let torque = self.esc.state().torque;
        if self.goes(cruise) && torque > 0.5 * self.load() { Ok(()) } else { Err(Halt::Stuck) }
    }

    /// Turns its shaft while it is disarmed, onward and about as fast as it cruises; then lets go.
    pub(crate) fn turn_by_hand(&mut self) -> Outcome {
        self.esc.set_load(self.load());
        let is_fast = |rig: &Self| rig.esc.state().output_rpm >= rig.cruise_rpm();
        let turns = self.until(None, SPIN_UP, is_fast);
        self.esc.set_load(0.0);
        if turns { Ok(()) } else { Err(Halt::Stuck) }
    }

    /// Asks for something, and waits for the answer without commanding.
    pub(crate) fn ask(&mut self, request: Request) -> Result<Response, RequestError> {
        let answer = self.bench.request(self.motor, request)?;
        if answer != Response::Pending {
            return Ok(answer);
        }
        self.response().unwrap_or(Err(RequestError::Timeout))
    }

    /// The answer that is pending, if it comes.
    pub(crate) fn response(&mut self) -> Option<Result<Response, RequestError>> {
        (0..LONGEST_ANSWER).find_map(|_| {
            self.tick(None);
            self.bench.response(self.motor)
        })
    }
}
