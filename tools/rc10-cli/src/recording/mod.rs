//! The recording of a run: everything that tables, JSON and the report are made from.

pub mod effort;
pub mod excuse;
pub mod load;
pub mod look;
pub mod margin;
pub mod problem;
pub mod remote;
pub mod sample;
pub mod signal;
pub mod wheels;

use crate::recording::sample::Source;
use std::fmt;

use rc10_can::Micros;
use rc10_module::Counters;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{ArmState, MotorStatus, TargetKind};
use rc10_sim::{Chassis, Fault};
use rc10_tasks::arming::Axis;
use sha2::{Digest, Sha256};

use crate::recording::effort::EffortTrack;
use crate::recording::problem::Problem;
use crate::recording::remote::RemoteTrack;
use crate::recording::sample::{
    BaseHeard, BusSample, LOOK_PERIOD, MotorSample, PathPoint, hex_digits,
};
use crate::recording::signal::SignalTrack;
use crate::recording::wheels::Wheels;
use crate::robot::motor::Motor;
use crate::robot::script::Event;

/// The recording of one run.
#[derive(Default)]
pub struct Recording {
    /// Seed of the world.
    pub seed: u64,
    /// Length of the run, in virtual time.
    pub length: Micros,
    /// One per motor, in the order of the robot's table.
    pub motors: Vec<MotorTrack>,
    /// One per bus.
    pub buses: Vec<BusTrack>,
    /// Status of each RS-485 line at the end.
    pub lines: Vec<Rs485Status>,
    /// The track of its base, if it has one.
    pub base: Option<BaseTrack>,
    /// The events of the run, in order: of the robot's script, and of its remote's operator.
    pub events: Vec<Event>,
    /// The track of its remote, if it has one.
    pub remote: Option<RemoteTrack>,
    /// Counters of each part on a UART beside the remote's receiver, at the end; none of an emulated
    /// chip, whose memory is not looked into.
    pub parts: Vec<PartTrack>,
    /// One per signal of the robot's own; none of an emulated chip, whose memory is not looked into.
    pub signals: Vec<SignalTrack>,
    /// Whether the robot was armed, per sample; empty if that is not known.
    pub arm: Vec<ArmState>,
    /// What the simulation itself found, which knows the robot's tasks.
    pub found: Vec<Problem>,
    /// Whether it had a heading, per sample; empty of a robot without an IMU.
    pub headings: Vec<bool>,
    /// What was not at rest at the end, so that the remote could not arm it.
    pub not_at_rest: Option<Axis>,
    /// Injected faults.
    pub faults: Vec<Fault>,
    /// The buses' logs were not kept.
    pub no_logs: bool,
    /// Where it comes from.
    pub source: Source,
    /// Times that were not recorded, and are left out: those after it are nearer by so much.
    pub gaps: Vec<Gap>,
}

/// A time that was not recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// When, in the recording.
    pub at: Micros,
    /// How long it was.
    pub length: Micros,
    /// The clock went back by so much.
    pub is_back: bool,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.length.get() as f64 / 1e6;
        let what = if self.is_back { "the time goes back by" } else { "a gap of" };
        write!(f, "{what} {seconds} s")
    }
}

impl Recording {
    /// A time of the recording, as the robot counts: with what is left out before it.
    #[must_use]
    pub fn told(&self, at: Micros) -> Micros {
        let before = self.gaps.iter().filter(|gap| gap.at < at);
        before.fold(at, |at, gap| if gap.is_back { at - gap.length } else { at + gap.length })
    }

    /// The hashes of all buses' logs, one after another, as one SHA-256 hash in hex digits.
    #[must_use]
    pub fn trace_hash(&self) -> String {
        let mut hash = Sha256::new();
        for bus in &self.buses {
            hash.update(&bus.log_hash);
        }
        hex_digits(hash)
    }
}

/// The bytes and frames that a task received of a part on a UART.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartTrack {
    /// Label of the part.
    pub label: &'static str,
    /// The chip's UART: 1 for USART1.
    pub uart: u8,
    /// Counters of its bytes and frames.
    pub heard: Counters,
}

/// The track of one motor.
pub struct MotorTrack {
    /// The motor, as described.
    pub motor: Motor,
    /// One per sample.
    pub samples: Vec<MotorSample>,
    /// Its status at the end.
    pub last: MotorStatus,
    /// Feedback frames that were overwritten in the ESC because the bus was busy.
    pub overwritten: u64,
    /// Tracking of its targets: one per kind of target, in the order of their coming.
    pub tracking: Vec<Tracking>,
    /// Largest current in the winding either way, A.
    pub peak_current: f64,
    /// Summary of the effort of its loops; `None` where they run in the device, or their effort
    /// cannot be seen.
    pub effort: Option<EffortTrack>,
}

/// Tracking of the targets of one kind by a motor: all looks in which it followed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking {
    /// The kind of target.
    pub kind: TargetKind,
    /// Number of looks.
    pub looks: u64,
    /// Sum of the squares of target minus measured.
    pub squares: f64,
    /// Largest difference either way.
    pub peak: f64,
}

impl Tracking {
    /// Root of the mean square difference of target and measurement, in the unit of the kind.
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.squares / self.looks as f64).sqrt()
    }

    /// For how long it followed such targets.
    #[must_use]
    pub const fn time(&self) -> Micros {
        Micros::new(self.looks * LOOK_PERIOD.get())
    }
}

/// The track of one bus.
pub struct BusTrack {
    /// The first one is 1.
    pub number: u8,
    /// Busy share of the wire, per cent, over the whole run.
    pub load: f64,
    /// The same in each 100 ms.
    pub load_windows: Vec<f64>,
    /// Its status at the end; with what its motors need of it, as known before the start.
    pub last: BusStatus,
    /// Its counters, per sample.
    pub samples: Vec<BusSample>,
    /// Frames on the wire.
    pub frames: u64,
    /// Frames on the wire, as a candump log; empty if [`Description::no_logs`] says so.
    ///
    /// [`Description::no_logs`]: crate::robot::description::Description::no_logs
    pub log: String,
    /// SHA-256 of that log in hex digits, also of one that is not kept.
    pub log_hash: String,
}

/// The track of a base.
pub struct BaseTrack {
    /// Its wheels: places in [`Recording::motors`].
    pub wheels: Vec<usize>,
    /// The motors that steer them. The same.
    pub steering: Vec<usize>,
    /// Path of the base, a point per sample.
    pub path: Vec<PathPoint>,
    /// Where the robot believed to be, in its own axes, and where it was to be, a point per sample; NaN
    /// where it did not say, and empty if it never does.
    pub estimate: Vec<PathPoint>,
    /// See [`estimate`](Self::estimate).
    pub reference: Vec<PathPoint>,
    /// Its measures, as the robot's table has them.
    pub chassis: Chassis,
    /// Measurements of its sensors, per sample.
    pub heard: Vec<BaseHeard>,
}

impl BaseTrack {
    /// Path of the base by the robot's wheels, a point per sample: their turns, by the robot's
    /// measures and least squares.
    #[must_use]
    pub fn by_wheels(&self) -> Vec<PathPoint> {
        let fixed = Wheels::new(&self.chassis, &[]);
        let mut at = PathPoint { x: 0.0, y: 0.0, yaw: 0.0 };
        let before = self.heard.first().into_iter().chain(&self.heard);
        let step = |(before, now): (&BaseHeard, &BaseHeard)| {
            let ways = self.ways(before, now);
            let [forward, left, turn] = if self.steering.is_empty() {
                fixed.motion(&ways)
            } else {
                Wheels::new(&self.chassis, &BaseHeard::steered(before, now)).motion(&ways)
            };
            let (sin, cos) = (at.yaw + turn / 2.0).sin_cos();
            at.x += forward * cos - left * sin;
            at.y += forward * sin + left * cos;
            at.yaw += turn;
            at
        };
        before.zip(&self.heard).map(step).collect()
    }

    /// The way of each wheel's rim from one moment to another, by the robot's measures, m.
    #[must_use]
    pub fn ways(&self, from: &BaseHeard, to: &BaseHeard) -> Vec<f64> {
        let angles = from.wheels.iter().zip(&to.wheels).map(|(from, to)| to.angle - from.angle);
        let ways = angles.zip(&self.chassis.wheels);
        ways.map(|(degrees, wheel)| degrees.to_radians() * wheel.radius).collect()
    }
}
