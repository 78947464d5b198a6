//! What a simulated run leaves behind: everything that tables, JSON and the report are made from.

use rc10_can::Micros;
use rc10_motor::embassy::BusStatus;
use rc10_motor::{BusLoad, Drive, Link, MotorStatus, TargetKind};
use rc10_robot::table::Entry;

/// Samples are taken this far apart.
pub const SAMPLE_PERIOD: Micros = Micros::from_millis(10);

/// One run.
pub struct Recording {
    /// Seed of the world.
    pub seed: u64,
    /// How long it ran, in virtual time.
    pub length: Micros,
    /// One per motor, in the order of the robot's table.
    pub motors: Vec<MotorTrack>,
    /// One per bus.
    pub buses: Vec<BusTrack>,
    /// Where the base was, per sample.
    pub path: Vec<PathPoint>,
    /// What the driver's script did, in order.
    pub events: Vec<Event>,
}

/// What one motor did.
pub struct MotorTrack {
    /// Its line in the robot's table.
    pub entry: &'static Entry,
    /// One per sample.
    pub samples: Vec<MotorSample>,
    /// Its status at the end.
    pub last: MotorStatus,
    /// Feedback frames that were overwritten in the ESC because the bus was busy.
    pub overwritten: u64,
}

/// One motor at one moment.
#[derive(Clone, Copy, Debug)]
pub struct MotorSample {
    /// What it was told, in the unit of `kind`; `None` while it does not follow a target.
    pub target: Option<f64>,
    /// What it measured, in the same unit: rpm for speeds, degrees for angles.
    pub measured: f64,
    /// What the target is: it says what `target` and `measured` are.
    pub kind: TargetKind,
    /// Current in the winding, A, as the simulated motor knows it.
    pub current: f64,
    /// Speed of the output shaft, rpm, as the simulated motor knows it.
    pub rpm: f64,
    /// Whether it is heard.
    pub link: Link,
    /// What its bus lets it do.
    pub drive: Drive,
}

/// What one bus did.
pub struct BusTrack {
    /// 1, 2 or 3.
    pub number: u8,
    /// What its motors need, as known before the start.
    pub plan: BusLoad,
    /// Busy share of the wire, per cent, over the whole run.
    pub load: f64,
    /// The same in each 100 ms.
    pub load_windows: Vec<f64>,
    /// Its status at the end.
    pub last: BusStatus,
    /// Frames on the wire.
    pub frames: u64,
    /// Frames on the wire, as a candump log.
    pub log: String,
}

/// Where the base was.
#[derive(Clone, Copy, Debug)]
pub struct PathPoint {
    /// Metres.
    pub x: f64,
    /// Metres, to the left of where it started.
    pub y: f64,
    /// Radians, counter-clockwise.
    pub yaw: f64,
}

/// Something the driver did.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// When.
    pub at: Micros,
    /// What.
    pub label: &'static str,
}
