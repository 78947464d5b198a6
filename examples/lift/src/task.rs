//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed: lift, hoist and feeder home, and then obey |
//! | left switch | to up: feeds one piece; down: emergency stop |
//! | left stick | away and back: raises and lowers the lift |
//! | dial | raises and lowers the hoist |
//! | right stick | back, to the right, away: the lift goes to its lowest, middle, highest height |
//!
//! Pieces that are asked for while the feeder homes are fed afterwards. Armed again, what was not fed is forgotten.
//!
//! [`rc10::tasks::arming`] says how it is armed, and what happens when the remote is lost.

use rc10::app::mechanism::Measured;
use rc10::prelude::*;

use crate::hoist::Hoist;
use crate::indexed::IndexedFeeder;
use crate::lift::{Goal, Lift};
use crate::table::{HEIGHTS, LIFT, Name};
use crate::{Own, Robot, Shared};

/// A stick that is out by less is let go.
const REST: f32 = 0.1;
/// A stick that is out by more chooses a height.
const CHOICE: f32 = 0.7;

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(5));
        let mut machine = Machine::default();
        loop {
            let tick = every.next().await;
            let before = shared.switch.state();
            let obeyed = shared.obey(&mut arming);
            let motors = LIFT.map(|name| shared.motor(name).status().measured());
            let [feeder, hoist] =
                [Name::Feeder, Name::Hoist].map(|name| shared.motor(name).status().measured());
            // Without a remote no motor is commanded: 50 ms later each is safe.
            if let Some(remote) = obeyed {
                if before != ArmState::Armed {
                    machine.begin(&motors, &feeder, &hoist, &remote);
                }
                machine.follow(&remote, &motors, shared, tick.dt);
                let command = machine.feeder.step(&feeder, shared.own.index.is_closed(), tick.dt);
                shared.command(Name::Feeder, Target::from(command));
                let dial = if remote.dial.abs() > REST { remote.dial } else { 0.0 };
                let is_down = shared.own.bottom.is_closed();
                let command = machine.hoist.step(dial, &hoist, is_down, tick.dt);
                shared.command(Name::Hoist, Target::from(command));
            }
            machine.tell(&motors, &hoist, &shared.own);
        }
    }
}

/// The lift, the hoist, the feeder, and what the remote has told them.
#[derive(Default)]
struct Machine {
    lift: Lift,
    goal: Goal,
    hoist: Hoist,
    feeder: IndexedFeeder,
    /// The left switch was up already.
    feeds: bool,
}

impl Machine {
    /// After a pause: the lift stays where it is.
    fn begin(
        &mut self,
        motors: &[Measured; 2],
        feeder: &Measured,
        hoist: &Measured,
        remote: &Remote,
    ) {
        self.lift.begin(motors);
        self.hoist.begin(hoist);
        self.goal = Goal::Stand;
        self.feeder.begin(feeder);
        self.feeds = remote.left_switch == Switch::Up;
    }

    fn follow(
        &mut self,
        remote: &Remote,
        motors: &[Measured; 2],
        shared: &Shared<'_>,
        dt: Seconds,
    ) {
        self.goal = chosen(remote, self.goal);
        let commands = self.lift.step(self.goal, motors, dt);
        for (name, command) in LIFT.into_iter().zip(commands) {
            shared.command(name, command.into());
        }
        let feeds = remote.left_switch == Switch::Up;
        if feeds && !core::mem::replace(&mut self.feeds, feeds) {
            self.feeder.feeder.feed(1);
        }
        self.feeds = feeds;
    }

    fn tell(&self, motors: &[Measured; 2], hoist: &Measured, own: &Own) {
        own.lift.tell(self.lift.stage());
        // Counted from 1, as in the table.
        own.blamed.set(self.lift.blamed().map_or(0.0, |motor| motor as f32 + 1.0));
        let [height, tilt] = self.lift.place(motors).unwrap_or([f32::NAN; 2]);
        own.height.set(height);
        own.tilt.set(tilt);
        own.hoist.tell(self.hoist.stage());
        own.hoisted.set(self.hoist.height(hoist).map_or(f32::NAN, |height| height.degrees().get()));
        own.feeder.tell(self.feeder.stage());
        own.fed.set(self.feeder.feeder.fed() as f32);
        own.jams.set(self.feeder.feeder.jam().count() as f32);
    }
}

/// Where the lift is to go; `so_far` if nothing else is chosen.
fn chosen(remote: &Remote, so_far: Goal) -> Goal {
    let [lowest, middle, highest] = HEIGHTS;
    match (remote.left.y, remote.right.x, remote.right.y) {
        (up, _, _) if up.abs() > REST => Goal::Move(up),
        (_, _, away) if away > CHOICE => Goal::Height(highest),
        (_, _, away) if away < -CHOICE => Goal::Height(lowest),
        (_, side, _) if side > CHOICE => Goal::Height(middle),
        _ if matches!(so_far, Goal::Move(_)) => Goal::Stand,
        _ => so_far,
    }
}
