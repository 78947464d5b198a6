//! A look at a robot and its world, as plain data: what a [`Recorder`](crate::recorder::Recorder) takes,
//! and what a record keeps.

use rc10_app::TotalAngle;
use rc10_app::angle::shortest_way_degrees;
use rc10_module::Counters;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{
    ArmState, DriveMode, Feedback, Link, Loops, Motion, MotorBus, MotorStatus, Target, TargetKind,
};
use rc10_sim::Esc;
use rc10_sim::remote::Sent;

use crate::effort::effort_of;
use crate::motor::Motor;
use crate::recording::{MotorSample, PathPoint};
use crate::remote::RemoteSample;
use crate::robot::BITS_PER_SECOND;

/// One motor in one millisecond.
#[derive(Clone, Copy, Debug)]
pub struct MotorLook {
    /// What is known of it: by the robot, or by the frames on its bus.
    pub status: MotorStatus,
    /// What is seen of it. Its cells are empty.
    pub seen: MotorSample,
    /// The effort of its loops, in their unit; `None` while they do not drive, and where none run here.
    pub effort: Option<f64>,
}

/// Everything else at one moment. Rarer than looks at motors.
#[derive(Clone, Debug, Default)]
pub struct Moment {
    /// The robot and its base.
    pub robot: RobotLook,
    /// Its buses; the first is number 1.
    pub buses: Vec<BusLook>,
    /// Its RS-485 lines. The same.
    pub lines: Vec<Rs485Status>,
    /// Counters of the parts on its UARTs, where they are known.
    pub parts: Vec<Counters>,
    /// Its remote, if it has one.
    pub remote: Option<RemoteLook>,
}

/// A bus at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct BusLook {
    /// What is known of it: by the robot, or by the frames on it.
    pub status: BusStatus,
    /// Frames on the wire so far.
    pub frames: u64,
    /// Busy share of the wire so far, percent.
    pub load: f64,
}

/// The robot and its base at one moment.
#[derive(Clone, Copy, Debug)]
pub struct RobotLook {
    /// Whether it is armed, if that is known.
    pub arm: Option<ArmState>,
    /// Where its base is in the world; NaN without one.
    pub pose: PathPoint,
    /// Which way it looks by its IMU, degrees, all turns counted.
    pub yaw: Option<f64>,
}

impl BusLook {
    /// At a bus whose frames are all that is known of it: its motors have listened.
    #[must_use]
    pub fn heard(bus: &MotorBus<'_>) -> Self {
        let mut status = BusStatus::default();
        (status.received, status.load) = (bus.counters(), bus.load(BITS_PER_SECOND));
        Self { status, ..Self::default() }
    }
}

impl Default for RobotLook {
    fn default() -> Self {
        Self { arm: None, pose: PathPoint::of(None), yaw: None }
    }
}

/// A remote and its receiver at one moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct RemoteLook {
    /// Whether it is live, and whether the robot is armed.
    pub sample: RemoteSample,
    /// What its receiver has sent.
    pub sent: Sent,
    /// Whether the robot tells what it heard of it.
    pub is_told: bool,
    /// What that is.
    pub heard: Counters,
}

impl MotorLook {
    /// Of a motor that was never heard, and does nothing.
    pub const NEW: Self = Self {
        status: MotorStatus::NEW,
        seen: MotorSample {
            target: None,
            measured: 0.0,
            measured_cell: crate::recording::Cell::ZERO,
            kind: TargetKind::Coast,
            current: 0.0,
            current_cell: crate::recording::Cell::ZERO,
            rpm: 0.0,
            rpm_cell: crate::recording::Cell::ZERO,
            link: Link::NeverSeen,
            drive: DriveMode::Off,
            counters: MotorStatus::NEW.counters,
            overwritten: 0,
        },
        effort: None,
    };

    /// At a motor and its twin. `loops` are those that it has here and not in its device.
    #[must_use]
    pub fn at(motor: &Motor, status: MotorStatus, twin: &Esc, loops: Option<Loops>) -> Self {
        // An effort that was asked for is not judged: no loop has made it.
        let effort = loops.filter(|_| status.is_looped());
        let effort = effort.map(|loops| motor.sign() * effort_of(motor, twin, loops));
        Self { status, seen: sample(motor, &status, twin), effort }
    }

    /// Its newest measurements.
    pub const fn feedback(&self) -> &Feedback {
        &self.status.feedback
    }

    /// The same, to be changed.
    pub const fn feedback_mut(&mut self) -> &mut Feedback {
        &mut self.status.feedback
    }

    /// With the status as it was seen: after it was read back.
    #[must_use]
    pub const fn settled(mut self) -> Self {
        let MotorSample { link, drive, counters, .. } = self.seen;
        (self.status.link, self.status.drive, self.status.counters) = (link, drive, counters);
        self
    }
}

fn sample(motor: &Motor, status: &MotorStatus, esc: &Esc) -> MotorSample {
    let feedback = status.feedback;
    let (wanted, measured) = match status.target {
        Target::Angle(wanted) => {
            let measured = feedback.angle.get();
            // Shown next to its target, also across the end of the turn.
            let way = shortest_way_degrees(wanted, feedback.angle).get();
            (
                Some(f64::from(wanted.get())),
                f64::from(if way.is_finite() { wanted.get() + way } else { measured }),
            )
        }
        Target::TotalAngle(wanted) | Target::Motion(Motion { angle: Some(wanted), .. }) => {
            let degrees = |angle: TotalAngle| angle.microdegrees() as f64 * 1e-6;
            (Some(degrees(wanted)), degrees(feedback.total_angle))
        }
        // What its spring pulls to.
        Target::Impedance(wanted) => {
            let measured = feedback.total_angle.degrees();
            (Some(wanted.angle.get().into()), measured.get().into())
        }
        Target::Speed(wanted) | Target::Motion(Motion { angle: None, speed: wanted, .. }) => {
            (Some(wanted.get().into()), feedback.speed.get().into())
        }
        _ => (None, feedback.speed.get().into()),
    };
    let state = esc.state();
    MotorSample {
        target: wanted.filter(|_| status.drive == DriveMode::Run),
        measured,
        kind: status.target.kind(),
        current: state.current * motor.sign(),
        rpm: state.output_rpm * motor.sign(),
        link: status.link,
        drive: status.drive,
        counters: status.counters,
        overwritten: state.feedback_overwritten,
        ..MotorLook::NEW.seen
    }
}
