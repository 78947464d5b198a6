//! Looks at a robot and its world, as plain data: input of a
//! [`Recorder`](crate::record::recorder::Recorder), content of a record.

use rc10_module::Counters;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{DriveMode, Feedback, Loops, MotorBus, MotorStatus, TargetKind};
use rc10_sim::Esc;
use rc10_sim::remote::Sent;
use rc10_tasks::seen::{Field, OFTEN, Seen, Value, Whole};

use crate::recording::sample::{Cell, MotorSample, NOWHERE, PathPoint, RemoteSample};
use crate::robot::motor::{BITS_PER_SECOND, Motor};

/// One motor in one millisecond.
#[derive(Clone, Copy, Debug)]
pub struct MotorLook {
    /// Status of the motor: the robot's own, or by the frames on its bus.
    pub status: MotorStatus,
    /// Kind of the target.
    pub kind: TargetKind,
    /// Target in the unit of its kind; NaN without one.
    pub target: f64,
    /// The measurement in the same unit.
    pub measured: f64,
    /// Effort of the loops in their unit; `None` while they do not drive, and without loops here.
    pub effort: Option<f64>,
    /// Shaft of the simulated motor.
    pub shaft: Shaft,
}

/// The shaft of a simulated motor, and its ESC.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shaft {
    /// Speed of the output shaft, rpm.
    pub rpm: f64,
    /// Current in the winding, A.
    pub current: f64,
    /// Feedback frames that were overwritten in the ESC.
    pub overwritten: u64,
}

impl Shaft {
    /// The shaft as its device tells of it.
    pub(crate) fn told(feedback: &Feedback) -> Self {
        let current = feedback.current().map_or(0.0, |current| current.get().into());
        Self { rpm: feedback.speed.get().into(), current, overwritten: 0 }
    }
}

/// Everything but the motors at one moment, more seldom than those.
#[derive(Clone, Debug, Default)]
pub struct Moment {
    /// The robot and its base.
    pub robot: RobotLook,
    /// The buses; the first is number 1.
    pub buses: Vec<BusLook>,
    /// The RS-485 lines; the first is number 1.
    pub lines: Vec<Rs485Status>,
    /// Counters of the parts on UARTs, where they are known.
    pub parts: Vec<Counters>,
    /// The remote, if the robot has one.
    pub remote: Option<RemoteLook>,
}

/// A bus at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct BusLook {
    /// Status of the bus: the robot's own, or by the frames on it.
    pub status: BusStatus,
    /// Frames on the wire so far.
    pub frames: u64,
    /// Busy share of the wire so far, percent.
    pub load: f64,
}

/// The robot and its base at one moment.
#[derive(Clone, Copy, Debug)]
pub struct RobotLook {
    /// The robot's own view.
    pub whole: Whole,
    /// True pose of the base in the world; NaN without one.
    pub pose: PathPoint,
    /// Yaw by the IMU, degrees, all turns counted.
    pub yaw: Option<f64>,
}

impl BusLook {
    /// Looks at a bus of which only the frames are known; its motors have listened.
    pub fn heard(bus: &MotorBus<'_>) -> Self {
        let mut status = BusStatus::default();
        (status.received, status.load) = (bus.counters(), bus.load(BITS_PER_SECOND));
        Self { status, ..Self::default() }
    }
}

impl Default for RobotLook {
    fn default() -> Self {
        Self { whole: Whole::default(), pose: NOWHERE, yaw: None }
    }
}

/// A remote and its receiver at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct RemoteLook {
    /// Whether the remote is live, and whether the robot is armed.
    pub sample: RemoteSample,
    /// Counters of the receiver's frames.
    pub sent: Sent,
    /// Whether `heard` is known.
    pub is_told: bool,
    /// Counters of the frames that the robot received.
    pub heard: Counters,
}

impl MotorLook {
    /// A motor that was never heard, and does nothing.
    pub const NEW: Self = Self {
        status: MotorStatus::NEW,
        kind: TargetKind::Coast,
        target: f64::NAN,
        measured: 0.0,
        effort: None,
        shaft: Shaft { rpm: 0.0, current: 0.0, overwritten: 0 },
    };

    /// Looks at a motor by its own status.
    pub fn of(status: MotorStatus) -> Self {
        let mut look = Self { status, ..Self::NEW };
        // Its own are among the first.
        for at in 0..OFTEN {
            look.put(at, status.exact(at));
        }
        Self { status, ..look }
    }

    /// Looks at a motor and its twin; on an emulated chip the effort is what the twin obeys.
    pub fn at(motor: &Motor, status: MotorStatus, twin: &Esc, loops: Option<Loops>) -> Self {
        let mut look = Self::of(status);
        // An effort that was commanded is not judged: no loop has made it.
        let obeyed = || loops.filter(|_| status.is_looped()).map(|it| motor.effort(twin, it));
        look.effort = look.effort.or_else(obeyed);
        let state = twin.state();
        look.shaft = Shaft {
            rpm: state.output_rpm * motor.sign(),
            current: state.current * motor.sign(),
            overwritten: state.feedback_overwritten,
        };
        look
    }

    /// A sample of the look, with empty cells; without a followed target it has the speed.
    pub fn seen(&self) -> MotorSample {
        use TargetKind::{Angle, Impedance, Motion, Speed, SpeedMotion, TotalAngle};
        let Self { status, kind, target, measured, shaft, .. } = *self;
        let follows = matches!(kind, Speed | Angle | TotalAngle | Impedance | Motion | SpeedMotion);
        let is_driven = status.drive == DriveMode::Run;
        MotorSample {
            target: Some(target).filter(|it| follows && is_driven && !it.is_nan()),
            measured: if follows { measured } else { status.feedback.speed.get().into() },
            measured_cell: Cell::default(),
            kind,
            current: shaft.current,
            current_cell: Cell::default(),
            rpm: shaft.rpm,
            rpm_cell: Cell::default(),
            link: status.link,
            drive: status.drive,
            counters: status.counters,
            overwritten: shaft.overwritten,
            temperature: status.feedback.temperature().map_or(f32::NAN, |it| it.get()),
            supply: status.feedback.supply().map_or(f32::NAN, |it| it.get()),
        }
    }
}

/// The fields of the status; those of the target are the look's own, as a record has no target.
impl Seen for MotorLook {
    const FIELDS: &'static [Field] = MotorStatus::FIELDS;
    const ABOUT: &'static [&'static str] = MotorStatus::ABOUT;
    const COUNTS: &'static [bool] = MotorStatus::COUNTS;

    fn short(&self, at: usize) -> f32 {
        self.exact(at) as f32
    }

    fn exact(&self, at: usize) -> f64 {
        match Self::FIELDS[at].name {
            "target_kind" => self.kind.exact(),
            "target" => self.target,
            "measured" => self.measured,
            "effort" => self.effort.exact(),
            _ => self.status.exact(at),
        }
    }

    fn put(&mut self, at: usize, number: f64) {
        match Self::FIELDS[at].name {
            "target_kind" => self.kind = Value::of(number),
            "target" => self.target = number,
            "measured" => self.measured = number,
            "effort" => self.effort = Value::of(number),
            _ => self.status.put(at, number),
        }
    }
}
