//! The robot in its world, with hands on its remote and on its motors.

use lift::simulation::TRAVEL;
use lift::table::{LIFT, WEIGHT};
use lift::{Motors, Name, Ports, Robot, Shared};
use rc10::motor::{Motion, Names, Target};
use rc10::sim::simulator::Tasks;
use rc10::sim::simulator::remote::{Controls, Stick, Switch};
use rc10::sim::world::environment::Environment;
use rc10::tasks::live::{Mechanism, Signal};
use rc10::time::Micros;

/// A robot that runs.
pub struct Bench<'r> {
    pub shared: &'r Shared<'r>,
    pub around: Environment,
    tasks: Tasks<'r>,
    now: u64,
    /// True angles of the lift's shafts above their bottoms, a millisecond ago.
    before: [f64; 2],
    bottoms: [f64; 2],
    /// The largest true difference of them since [`Bench::forget`].
    pub tilt: f64,
    /// Squares of the way from each shaft to the profile.
    squares: f64,
    looks: f64,
    told: [Option<Target>; 2],
}

pub const ARMED: Controls = Controls::REST;
pub const DISARMED: Controls = Controls { right_switch: Switch::Down, ..ARMED };
pub const STOPPED: Controls = Controls { left_switch: Switch::Down, ..ARMED };
pub const FEED: Controls = Controls { left_switch: Switch::Up, ..ARMED };
pub const LOWEST: Controls = Controls { right: Stick { x: 0.0, y: -1.0 }, ..ARMED };
pub const MIDDLE: Controls = Controls { right: Stick { x: 1.0, y: 0.0 }, ..ARMED };
pub const HIGHEST: Controls = Controls { right: Stick { x: 0.0, y: 1.0 }, ..ARMED };

pub const fn moved(share: f64) -> Controls {
    Controls { left: Stick { x: 0.0, y: share }, ..ARMED }
}

/// The sign by which a motor of the lift counts upwards.
const UP: [f64; 2] = [1.0, -1.0];

/// Runs a scenario with a robot that has just got its power. Its lift is held by hand this many degrees
/// above the bottom.
pub fn bench<R>(seed: u64, heights: [f64; 2], scenario: impl FnOnce(&mut Bench<'_>) -> R) -> R {
    changed(seed, heights, |_| {}, scenario)
}

/// The same with its feeder's marker elsewhere.
pub fn indexed<R>(
    seed: u64,
    heights: [f64; 2],
    index: [f64; 2],
    scenario: impl FnOnce(&mut Bench<'_>) -> R,
) -> R {
    changed(seed, heights, |world| world.contacts[0].closed = index.into(), scenario)
}

/// The same in another world.
pub fn changed<R>(
    seed: u64,
    heights: [f64; 2],
    change: impl FnOnce(&mut rc10::sim::Description),
    scenario: impl FnOnce(&mut Bench<'_>) -> R,
) -> R {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10::sim::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let mut description = robot.description().clone();
    change(&mut description);
    let mut around = Environment::new(&description, seed).unwrap();
    around.operator = None;
    let tasks = robot.tasks(&around).unwrap();
    let mut bench = Bench {
        shared: &shared,
        around,
        tasks,
        now: 0,
        before: heights,
        bottoms: heights.map(|height| -height),
        tilt: 0.0,
        squares: 0.0,
        looks: 0.0,
        told: [None; 2],
    };
    for motor in 0..2 {
        bench.set_travel(motor, Some([0.0, TRAVEL]));
        bench.set_weight(motor, 0.0);
    }
    scenario(&mut bench)
}

/// The same, armed: then the hands let go.
pub fn armed<R>(seed: u64, heights: [f64; 2], scenario: impl FnOnce(&mut Bench<'_>) -> R) -> R {
    bench(seed, heights, |bench| {
        bench.arm();
        scenario(bench)
    })
}

impl Bench<'_> {
    pub fn motor(&self, name: Name) -> &rc10::sim::simulator::Esc {
        &self.around.motors[name.index()]
    }

    /// Then the hands let go.
    pub fn arm(&mut self) {
        self.hands(DISARMED, 100);
        self.hands(ARMED, 90);
        (0..2).for_each(|motor| self.set_weight(motor, 1.0));
    }

    /// Sets the controls for a time, in ms.
    pub fn hands(&mut self, controls: Controls, millis: u64) {
        self.around.remote.as_ref().unwrap().remote.set(controls);
        self.run(millis);
    }

    pub fn run(&mut self, millis: u64) {
        for _ in 0..millis {
            self.now += 1;
            let Self { around, tasks, .. } = self;
            around.run(tasks, Micros::from_millis(self.now));
            around.wires.iter().for_each(|wire| drop(wire.take_trace()));
            self.look();
        }
    }

    /// Runs until a condition is true, with a limit in seconds; returns the time in ms.
    pub fn until(&mut self, seconds: u64, is_so: impl Fn(&Self) -> bool) -> u64 {
        let began = self.now;
        while !is_so(self) {
            assert!(self.now - began < seconds * 1000, "not in {seconds} s: {:?}", self.heights());
            self.run(1);
        }
        self.now - began
    }

    pub fn home(&mut self) {
        self.until(20, |bench| bench.stage() == Stage::Ready);
        self.run(200);
    }

    /// Until the feeder knows its index and stands there; how many ms that took.
    pub fn index(&mut self) -> u64 {
        let took = self.until(8, |bench| bench.feeder() == Stage::Ready);
        self.run(200);
        took
    }

    /// True angle of the feeder's shaft since power-on.
    pub fn turned(&self) -> f64 {
        self.motor(Name::Feeder).state().load_degrees
    }

    /// True angles of the shafts above their bottoms.
    pub fn heights(&self) -> [f64; 2] {
        [0, 1].map(|motor| {
            UP[motor] * self.motor(LIFT[motor]).state().load_degrees - self.bottoms[motor]
        })
    }

    /// Height and tilt by the robot's own signals.
    pub fn believed(&self) -> [f64; 2] {
        let live = &self.shared.own;
        let (height, tilt) = (f64::from(live.height.get()), f64::from(live.tilt.get()));
        [height + tilt / 2.0, height - tilt / 2.0]
    }

    /// The stage of the lift.
    pub fn stage(&self) -> Stage {
        stage(&self.shared.own.lift)
    }

    /// The same of the feeder.
    pub fn feeder(&self) -> Stage {
        stage(&self.shared.own.feeder)
    }

    /// The same of the hoist.
    pub fn hoist(&self) -> Stage {
        stage(&self.shared.own.hoist)
    }

    /// True angle of the hoist's shaft since power-on, and where the robot believes it above the switch.
    pub fn hoisted(&self) -> [f64; 2] {
        let true_one = -self.motor(Name::Hoist).state().load_degrees;
        [true_one, f64::from(self.shared.own.hoisted.get())]
    }

    /// The motor of the lift that it blames, if it does.
    pub fn blamed(&self) -> Option<usize> {
        usize::try_from(number(&self.shared.own.blamed)).unwrap().checked_sub(1)
    }

    pub fn fed(&self) -> u64 {
        number(&self.shared.own.fed)
    }

    pub fn jams(&self) -> u64 {
        number(&self.shared.own.jams)
    }

    /// Above the bottom.
    pub fn set_travel(&self, motor: usize, travel: Option<[f64; 2]>) {
        let mut travel = travel.map(|ends| ends.map(|end| UP[motor] * (end + self.bottoms[motor])));
        travel.iter_mut().for_each(|ends| ends.sort_by(f64::total_cmp));
        self.motor(LIFT[motor]).set_travel(travel);
    }

    /// Sets a motor's weight as a multiple of the robot's table.
    pub fn set_weight(&self, motor: usize, factor: f64) {
        self.motor(LIFT[motor]).set_load(-UP[motor] * f64::from(WEIGHT) * factor);
    }

    pub fn forget(&mut self) {
        (self.tilt, self.squares, self.looks) = (0.0, 0.0, 0.0);
    }

    /// Root of the mean square of the ways from the shafts to the profile.
    pub fn rms(&self) -> f64 {
        assert!(self.looks > 100.0);
        (self.squares / self.looks).sqrt()
    }

    fn look(&mut self) {
        let heights = self.heights();
        self.tilt = self.tilt.max((heights[0] - heights[1]).abs());
        let before = std::mem::replace(&mut self.before, heights);
        let status = LIFT.map(|name| self.shared.motor(name).status());
        let told = status.map(|status| Some(status.target));
        if std::mem::replace(&mut self.told, told) == told || self.stage() != Stage::Ready {
            return;
        }
        // New targets are those of the moment before. In the mean of both, corrections cancel out.
        let mut profile = [0.0; 2];
        for motor in 0..2 {
            let Target::Motion(Motion { angle: Some(angle), .. }) = status[motor].target else {
                return;
            };
            // Where the robot believes its zero to be is judged by itself: here it is the true one.
            let counted = status[motor].feedback.total_angle;
            profile[motor] = angle.minus(counted).microdegrees() as f64 * 1e-6 + heights[motor];
        }
        let profile = (profile[0] + profile[1]) / 2.0;
        self.squares += before.map(|at| (profile - at).powi(2)).iter().sum::<f64>();
        self.looks += 2.0;
    }
}

/// A coarse stage of a mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    Idle,
    Homing,
    Ready,
    Failed,
}

/// The coarse stage of a mechanism.
pub fn stage(mechanism: &Mechanism) -> Stage {
    use rc10::app::mechanism::Stage as Exact;
    match Exact::ALL[usize::try_from(number(mechanism.signal())).unwrap()] {
        Exact::NotBegun => Stage::Idle,
        Exact::Ready | Exact::Clearing => Stage::Ready,
        stage if stage.gave_up() => Stage::Failed,
        _ => Stage::Homing,
    }
}

/// A signal that counts; 0 before it has been set.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
fn number(signal: &Signal) -> u64 {
    signal.get() as u64
}
