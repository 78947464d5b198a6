//! Samples of a run: motors, buses and base at one moment, and the range of values between two.

use rc10_motor::embassy::BusStatus;
use rc10_motor::{ArmState, DriveMode, Link, MotorCounters, TargetKind};
use rc10_time::Micros;
use sha2::{Digest, Sha256};

/// A position of the base.
pub use rc10_sim::Pose as PathPoint;

/// Period of samples.
pub const SAMPLE_PERIOD: Micros = Micros::from_millis(10);

/// Period of looks, of which a sample is made: that of the control loops.
pub const LOOK_PERIOD: Micros = Micros::from_millis(1);

/// The range of values between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Lowest value.
    pub min: f32,
    /// Mean value.
    pub mean: f32,
    /// Highest value.
    pub max: f32,
}

impl Cell {
    /// The range of a value that does not change.
    pub const fn of(value: f64) -> Self {
        let value = value as f32;
        Self { min: value, mean: value, max: value }
    }
}

/// Sums for a [`Cell`].
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

    /// Lowest, mean and highest; `None` without a value.
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
    /// Target in the unit of `kind`; `None` while the motor does not follow one.
    pub target: Option<f64>,
    /// Measurement in the same unit: rpm for speeds, degrees for angles.
    pub measured: f64,
    /// Range of `measured` since the sample before, as far as it was of this kind.
    pub measured_cell: Cell,
    /// Kind of the target.
    pub kind: TargetKind,
    /// Current in the winding, A, as the simulated motor knows it.
    pub current: f64,
    /// Range of the current since the sample before.
    pub current_cell: Cell,
    /// Speed of the output shaft, rpm, as the simulated motor knows it.
    pub rpm: f64,
    /// Range of the speed since the sample before.
    pub rpm_cell: Cell,
    /// Whether the motor is heard.
    pub link: Link,
    /// Drive mode; on an emulated chip [`DriveMode::Run`] if driven, else [`DriveMode::Coast`].
    pub drive: DriveMode,
    /// Counters so far.
    pub counters: MotorCounters,
    /// Feedback frames that were overwritten in the ESC so far.
    pub overwritten: u64,
    /// Temperature of the motor, degrees Celsius; NaN if it tells none.
    pub temperature: f32,
    /// Voltage that it is supplied with; NaN if it tells none.
    pub supply: f32,
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

/// Measurements of a base by the robot's own sensors at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BaseMeasurement {
    /// The wheels, in the order of [`BaseTrack::wheels`](super::BaseTrack::wheels).
    pub wheels: Vec<WheelMeasurement>,
    /// Heading by the IMU, degrees counter-clockwise, all turns counted.
    pub yaw: Option<f64>,
}

impl BaseMeasurement {
    /// The steering angles of the wheels between two moments, degrees.
    pub fn steered(from: &Self, to: &Self) -> Vec<f64> {
        let pairs = from.wheels.iter().zip(&to.wheels);
        pairs.map(|(from, to)| f64::midpoint(from.steered, to.steered)).collect()
    }
}

/// Feedback of a wheel's motor, in the robot's direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelMeasurement {
    /// Degrees of the output shaft, all turns counted.
    pub angle: f64,
    /// Current in the winding, A, if the device tells it.
    pub current: Option<f64>,
    /// Whether the motor is heard and follows a target, and the one that steers it, too.
    pub follows: bool,
    /// The angle by which the wheel is steered, degrees.
    pub steered: f64,
}

/// The position of a base that is not known.
pub(crate) const NOWHERE: PathPoint = PathPoint { x: f64::NAN, y: f64::NAN, yaw: f64::NAN };

pub(crate) fn hex_digits(hash: Sha256) -> String {
    format!("{:x}", hash.finalize())
}

/// The state of a bus's wire at the end of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WireEnd {
    /// Load in each 100 ms, percent.
    pub load_windows: Vec<f64>,
    /// Frames as a candump log; empty if it was not kept.
    pub log: String,
    /// SHA-256 of the log in hex digits.
    pub log_hash: String,
}

pub(crate) fn seconds(time: Micros) -> f64 {
    // Divided, not multiplied: correctly rounded, so that 0.9 s is printed as 0.9.
    time.get() as f64 / 1e6
}

/// A number rounded to `places` decimals, never a negative zero.
pub(crate) fn rounded(value: f64, places: i32) -> f64 {
    let power = 10_f64.powi(places);
    (value * power).round() / power + 0.0
}

pub(crate) fn time_of(index: usize) -> Micros {
    Micros::new((index as u64 + 1) * SAMPLE_PERIOD.get())
}

/// Whether targets of a kind are angles, in degrees; the others are speeds, in rpm.
pub(crate) const fn is_angle(kind: TargetKind) -> bool {
    use TargetKind::{Angle, Impedance, Motion, TotalAngle};
    matches!(kind, Angle | TotalAngle | Impedance | Motion)
}

/// The source of a recording, which decides what is known of the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// A simulation: everything is known.
    #[default]
    Simulation,
    /// An emulated chip: wires and shafts are known, the robot's own view is not.
    Emulation,
    /// A capture of a real robot's buses: only the frames are known.
    Capture,
    /// A real robot that told of itself: its own view is known.
    Robot,
}

impl Source {
    /// Whether the robot's own view and its motors' targets are known.
    pub const fn is_told(self) -> bool {
        matches!(self, Self::Simulation | Self::Robot)
    }

    /// Whether the run has a seed and virtual time.
    pub const fn is_simulated(self) -> bool {
        matches!(self, Self::Simulation | Self::Emulation)
    }
}

/// A remote and its robot at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RemoteSample {
    /// Whether the receiver's frames come from the remote.
    pub is_live: bool,
    /// Whether the robot is armed, if it says so.
    pub arm: Option<ArmState>,
}
