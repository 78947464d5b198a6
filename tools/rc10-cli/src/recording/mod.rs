//! The recording of a run, from which tables, JSON and the report are made.

pub mod effort;
pub mod excuse;
pub mod load;
pub mod look;
pub mod margin;
pub mod origin;
pub mod problem;
pub mod remote;
pub mod sample;
pub mod signal;
pub mod wheels;

use std::collections::BTreeMap;
use std::fmt;

use rc10_emu::fault::Fault;
use rc10_module::Counters;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{ArmState, MotorStatus, TargetKind};
use rc10_sim::Chassis;
use rc10_tasks::arming::Axis;
use rc10_time::Micros;
use sha2::{Digest, Sha256};

use crate::recording::effort::EffortTrack;
use crate::recording::origin::Origin;
use crate::recording::problem::Problem;
use crate::recording::remote::RemoteTrack;
use crate::recording::sample::{
    BaseMeasurement, BusSample, LOOK_PERIOD, MotorSample, PathPoint, Source, hex_digits,
};
use crate::recording::signal::SignalTrack;
use crate::recording::wheels::Wheels;
use crate::robot::motor::Motor;
use crate::robot::script::Event;

/// The recording of one run.
#[derive(Clone, Default)]
pub struct Recording {
    /// Seed of the world.
    pub seed: u64,
    /// Length of the run, in virtual time.
    pub length: Micros,
    /// Track of each motor, in the order of the robot's table.
    pub motors: Vec<MotorTrack>,
    /// Track of each bus.
    pub buses: Vec<BusTrack>,
    /// Status of each RS-485 line at the end.
    pub lines: Vec<Rs485Status>,
    /// Track of the base, if the robot has one.
    pub base: Option<BaseTrack>,
    /// Events of the robot's script and of its remote's operator, in order.
    pub events: Vec<Event>,
    /// Track of the remote, if the robot has one.
    pub remote: Option<RemoteTrack>,
    /// Counters of each part on a UART but the receiver, at the end; empty for an emulated chip.
    pub parts: Vec<PartTrack>,
    /// Track of each own signal of the robot; empty for an emulated chip.
    pub signals: Vec<SignalTrack>,
    /// Whether the robot was armed, per sample; empty if that is not known.
    pub arm: Vec<ArmState>,
    /// Problems that the simulation itself found, which knows the robot's tasks.
    pub found: Vec<Problem>,
    /// Whether the robot had a heading, per sample; empty for a robot without an IMU.
    pub headings: Vec<bool>,
    /// The axis that was not at rest at the end, so that the remote could not arm the robot.
    pub not_at_rest: Option<Axis>,
    /// Injected faults.
    pub faults: Vec<Fault>,
    /// Mistakes of the run, as a user writes them.
    pub mistakes: Vec<String>,
    /// The robot and the program that recorded it.
    pub origin: Origin,
    /// Whether the buses' logs were left out.
    pub no_logs: bool,
    /// Source of the recording.
    pub source: Source,
    /// Moments that were marked, with words.
    pub marks: Vec<(Micros, String)>,
    /// Name and note of the record; empty without.
    pub about: [String; 2],
    /// What is drawn of the robot: [`Description::drawn`](crate::Description::drawn).
    pub drawn: serde_json::Value,
    /// Degrees of the motors of the drawn mechanisms, by their indices, per sample; NaN before they are heard.
    pub turned: BTreeMap<usize, Vec<f64>>,
    /// Times that were not recorded; later times are nearer by their lengths.
    pub gaps: Vec<Gap>,
}

/// A time that was not recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Time of the gap in the recording.
    pub at: Micros,
    /// Length of the gap.
    pub length: Micros,
    /// Whether the clock went back by the length.
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
    /// A time of the recording as the robot counts it, with the gaps before it.
    pub fn robot_time(&self, at: Micros) -> Micros {
        let before = self.gaps.iter().filter(|gap| gap.at < at);
        before.fold(at, |at, gap| if gap.is_back { at - gap.length } else { at + gap.length })
    }

    /// SHA-256 over the hashes of all buses' logs, in hex digits.
    pub fn trace_hash(&self) -> String {
        let all = |hash: Sha256, bus: &BusTrack| hash.chain_update(&bus.log_hash);
        hex_digits(self.buses.iter().fold(Sha256::new(), all))
    }
}

/// Counters of a part on a UART.
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
#[derive(Clone)]
pub struct MotorTrack {
    /// The motor, as described.
    pub motor: Motor,
    /// Samples of the motor.
    pub samples: Vec<MotorSample>,
    /// Status at the end.
    pub last: MotorStatus,
    /// Feedback frames that were overwritten in the ESC because the bus was busy.
    pub overwritten: u64,
    /// Tracking of each kind of target, in the order of their first use.
    pub tracking: Vec<Tracking>,
    /// Largest current in the winding either way, A.
    pub peak_current: f64,
    /// Summary of the loops' effort; `None` if it runs in the device or is not visible.
    pub effort: Option<EffortTrack>,
}

/// Tracking of the targets of one kind, over all looks in which the motor followed one.
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
    pub fn rms(&self) -> f64 {
        (self.squares / self.looks as f64).sqrt()
    }

    /// Time in which the motor followed such targets.
    pub const fn time(&self) -> Micros {
        Micros::new(self.looks * LOOK_PERIOD.get())
    }
}

/// The track of one bus.
#[derive(Clone)]
pub struct BusTrack {
    /// Number of the bus; the first is 1.
    pub number: u8,
    /// Busy share of the wire over the whole run, percent.
    pub load: f64,
    /// Busy share in each 100 ms, percent.
    pub load_windows: Vec<f64>,
    /// Status at the end, with the planned load as known before the start.
    pub last: BusStatus,
    /// Counters, per sample.
    pub samples: Vec<BusSample>,
    /// Frames on the wire.
    pub frames: u64,
    /// Frames on the wire, as a candump log; empty if logs are left out.
    pub log: String,
    /// SHA-256 of the log in hex digits, also of one that is not kept.
    pub log_hash: String,
}

/// The track of a base.
#[derive(Clone, Default)]
pub struct BaseTrack {
    /// The wheels: indices into [`Recording::motors`].
    pub wheels: Vec<usize>,
    /// The motors that steer them: indices into [`Recording::motors`].
    pub steering: Vec<usize>,
    /// True path of the base, a point per sample.
    pub path: Vec<PathPoint>,
    /// The robot's estimate in its own axes, a point per sample, NaN without one; may be empty.
    pub estimate: Vec<PathPoint>,
    /// The reference in the same axes, a point per sample; NaN or empty like the estimate.
    pub reference: Vec<PathPoint>,
    /// Masses and measures by the robot's table.
    pub chassis: Chassis,
    /// Measurements of the robot's sensors, per sample.
    pub heard: Vec<BaseMeasurement>,
}

impl BaseTrack {
    /// Path by the wheels' turns, the robot's measures and least squares, a point per sample.
    pub fn by_wheels(&self) -> Vec<PathPoint> {
        let fixed = Wheels::new(&self.chassis, &[]);
        let mut at = PathPoint { x: 0.0, y: 0.0, yaw: 0.0 };
        let before = self.heard.first().into_iter().chain(&self.heard);
        let step = |(before, now): (&BaseMeasurement, &BaseMeasurement)| {
            let ways = self.ways(before, now);
            let [forward, left, turn] = if self.steering.is_empty() {
                fixed.motion(&ways)
            } else {
                Wheels::new(&self.chassis, &BaseMeasurement::steered(before, now)).motion(&ways)
            };
            let (sin, cos) = (at.yaw + turn / 2.0).sin_cos();
            at.x += forward * cos - left * sin;
            at.y += forward * sin + left * cos;
            at.yaw += turn;
            at
        };
        before.zip(&self.heard).map(step).collect()
    }

    /// Distance of each wheel's rim between two moments, by the robot's measures, m.
    pub fn ways(&self, from: &BaseMeasurement, to: &BaseMeasurement) -> Vec<f64> {
        let angles = from.wheels.iter().zip(&to.wheels).map(|(from, to)| to.angle - from.angle);
        let ways = angles.zip(&self.chassis.wheels);
        ways.map(|(degrees, wheel)| degrees.to_radians() * wheel.radius).collect()
    }
}
