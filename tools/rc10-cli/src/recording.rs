//! The recording of a run: everything that tables, JSON and the report are made from.

use std::fmt::{self, Write as _};

use rc10_can::Micros;
use rc10_emu::fault::Fault;
use rc10_module::Counters;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{ArmState, DriveMode, Link, MotorCounters, MotorStatus, TargetKind};
use rc10_sim::{Base, Chassis};
use rc10_tasks::arming::Axis;
use sha2::{Digest, Sha256};

use crate::effort::EffortTrack;
use crate::motor::Motor;
use crate::problems::Problem;
use crate::remote::RemoteTrack;
use crate::script::Event;
use crate::signal::SignalTrack;
use crate::wheels::Wheels;

/// Samples are taken this far apart.
pub const SAMPLE_PERIOD: Micros = Micros::from_millis(10);
/// A sample is made from looks this far apart: as often as control loops run.
pub const LOOK_PERIOD: Micros = Micros::from_millis(1);

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

/// Where a recording comes from: that decides what is known of the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// A simulation, which knows all.
    #[default]
    Simulation,
    /// An emulated chip: what was on the wires and at the shafts, and not what the robot believed.
    Emulation,
    /// A capture of a real robot's buses: what was on the wires.
    Capture,
    /// A robot that ran and told of itself: what it believed.
    Robot,
}

impl Source {
    /// Whether it is known what the robot believed, and what its motors were told.
    #[must_use]
    pub const fn is_told(self) -> bool {
        matches!(self, Self::Simulation | Self::Robot)
    }

    /// Whether all chance in it is of a seed, and its time is virtual.
    #[must_use]
    pub const fn is_simulated(self) -> bool {
        matches!(self, Self::Simulation | Self::Emulation)
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

/// A finished hash in hex digits.
pub(crate) fn hex_digits(hash: Sha256) -> String {
    hash.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
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

/// The range of values between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// The lowest.
    pub min: f32,
    /// Their mean.
    pub mean: f32,
    /// The highest.
    pub max: f32,
}

impl Cell {
    /// Of zero.
    pub(crate) const ZERO: Self = Self { min: 0.0, mean: 0.0, max: 0.0 };

    /// Of a value that does not change.
    #[must_use]
    pub const fn of(value: f64) -> Self {
        let value = value as f32;
        Self { min: value, mean: value, max: value }
    }
}

/// Values on their way to a [`Cell`].
#[derive(Clone, Default)]
pub(crate) struct Sum {
    count: u32,
    sum: f64,
    min: f64,
    max: f64,
}

impl Sum {
    pub(crate) fn add(&mut self, value: f64) {
        if self.count == 0 {
            (self.min, self.max) = (value, value);
        }
        (self.min, self.max) = (self.min.min(value), self.max.max(value));
        self.sum += value;
        self.count += 1;
    }

    /// Lowest, mean and highest; `None` of no values.
    pub(crate) fn range(&self) -> Option<[f64; 3]> {
        (self.count > 0).then(|| [self.min, self.sum / f64::from(self.count), self.max])
    }

    pub(crate) fn cell(&self) -> Option<Cell> {
        let [min, mean, max] = self.range()?.map(|value| value as f32);
        Some(Cell { min, mean, max })
    }
}

/// One motor at one moment, and since the one before.
#[derive(Clone, Copy, Debug)]
pub struct MotorSample {
    /// Its target, in the unit of `kind`; `None` while it does not follow a target.
    pub target: Option<f64>,
    /// Its measurement, in the same unit: rpm for speeds, degrees for angles.
    pub measured: f64,
    /// `measured` since the sample before, as long as it was of this kind.
    pub measured_cell: Cell,
    /// Kind of the target: it says what `target` and `measured` are.
    pub kind: TargetKind,
    /// Current in the winding, A, as the simulated motor knows it.
    pub current: f64,
    /// The same since the sample before.
    pub current_cell: Cell,
    /// Speed of the output shaft, rpm, as the simulated motor knows it.
    pub rpm: f64,
    /// The same since the sample before.
    pub rpm_cell: Cell,
    /// Whether it is heard.
    pub link: Link,
    /// Its drive mode. On an emulated chip [`DriveMode::Run`] if the simulated motor is driven,
    /// else [`DriveMode::Coast`].
    pub drive: DriveMode,
    /// Its counters so far.
    pub counters: MotorCounters,
    /// Its feedback frames so far that were overwritten in the ESC.
    pub overwritten: u64,
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
    /// [`Description::no_logs`]: crate::Description::no_logs
    pub log: String,
    /// SHA-256 of that log in hex digits, also of one that is not kept.
    pub log_hash: String,
}

/// Counters of a bus at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusSample {
    /// Ticks that did not happen.
    pub overruns: u32,
    /// Received frames lost.
    pub lost: u32,
    /// Commands replaced before they left.
    pub replaced: u32,
    /// Frames refused.
    pub refused: u32,
    /// Times it was off.
    pub bus_offs: u32,
}

impl BusSample {
    pub(crate) const fn of(status: &BusStatus) -> Self {
        Self {
            overruns: status.overruns,
            lost: status.health.receive_lost,
            replaced: status.replaced,
            refused: status.refused,
            bus_offs: status.health.bus_offs,
        }
    }
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

/// Measurements of a base by the robot's own sensors at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BaseHeard {
    /// Its wheels, in the order of [`BaseTrack::wheels`].
    pub wheels: Vec<WheelHeard>,
    /// Heading by its IMU, degrees counter-clockwise, all turns counted.
    pub yaw: Option<f64>,
}

impl BaseHeard {
    /// The steering angles of the wheels between two moments, degrees.
    #[must_use]
    pub fn steered(from: &Self, to: &Self) -> Vec<f64> {
        let pairs = from.wheels.iter().zip(&to.wheels);
        pairs.map(|(from, to)| f64::midpoint(from.steered, to.steered)).collect()
    }
}

/// Feedback of a wheel's motor, as the robot counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelHeard {
    /// Degrees of the output shaft, all turns counted.
    pub angle: f64,
    /// Current in the winding, A, if the device tells it.
    pub current: Option<f64>,
    /// It is heard, and follows a target; so does the motor that steers it.
    pub follows: bool,
    /// The angle by which the wheel is steered, degrees.
    pub steered: f64,
}

impl PathPoint {
    /// Not known.
    pub(crate) const NOWHERE: Self = Self { x: f64::NAN, y: f64::NAN, yaw: f64::NAN };

    /// Of a base; NaN without one.
    pub(crate) fn of(base: Option<&Base>) -> Self {
        base.map(Base::pose).map_or(Self::NOWHERE, |pose| Self {
            x: pose.x,
            y: pose.y,
            yaw: pose.yaw,
        })
    }
}

/// A position of the base.
#[derive(Clone, Copy, Debug)]
pub struct PathPoint {
    /// Metres.
    pub x: f64,
    /// Metres, to the left of where it started.
    pub y: f64,
    /// Radians, counter-clockwise.
    pub yaw: f64,
}
