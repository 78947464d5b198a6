//! Writes down what a robot does in its surroundings, whoever runs it.

use rc10_app::TotalAngle;
use rc10_app::angle::shortest_way_degrees;
use rc10_can::Micros;
use rc10_motor::embassy::{BusStatus, LineStatus};
use rc10_motor::{Drive, Link, MotorStatus, Target};
use rc10_sim::{Base, TraceEntry};

use crate::candump;
use crate::recording::{
    BaseHeard, BaseTrack, BusTrack, MotorSample, MotorTrack, PathPoint, Recording, SAMPLE_PERIOD,
    WheelHeard,
};
use crate::robot::{Description, Motor, Twin};

/// Writes down what a robot does. It sees the wires and the shafts for itself; what the robot
/// believes of its motors and buses it must be told.
pub struct Recorder<'d> {
    description: &'d Description,
    seed: u64,
    samples: Vec<Vec<MotorSample>>,
    logs: Vec<(String, u64)>,
    path: Vec<PathPoint>,
    heard: Vec<BaseHeard>,
}

impl<'d> Recorder<'d> {
    /// A recorder before the start. `seed` is the surroundings' one.
    #[must_use]
    pub fn new(description: &'d Description, seed: u64) -> Self {
        Self {
            description,
            seed,
            samples: vec![Vec::new(); description.motors.len()],
            logs: vec![Default::default(); description.buses.into()],
            path: Vec::new(),
            heard: Vec::new(),
        }
    }

    /// How long to let time pass until the next sample, if the run is to end at `end`.
    #[must_use]
    pub fn next_sample(now: Micros, end: Micros) -> Micros {
        (now + SAMPLE_PERIOD).min(end)
    }

    /// Takes frames of a bus down, 0 for the first, in the order of the wire.
    pub fn frames(&mut self, bus: usize, entries: &[TraceEntry]) {
        let Some((log, frames)) = self.logs.get_mut(bus) else {
            return;
        };
        // As can-utils would call them.
        let channel = format!("can{bus}");
        for entry in entries {
            *frames += 1;
            // A string takes everything.
            let _ = candump::write_line(log, entry.at, &channel, &entry.frame);
        }
    }

    /// Takes a sample of everything but the wires. `status` is what is known of the motor in a line
    /// of the robot's table.
    pub fn sample(
        &mut self,
        motors: &[Twin],
        base: Option<&Base>,
        status: impl Fn(usize) -> MotorStatus,
    ) {
        let motors = self.description.motors.iter().zip(motors);
        for (line, (samples, (motor, esc))) in self.samples.iter_mut().zip(motors).enumerate() {
            samples.push(sample(motor, &status(line), esc));
        }
        if let Some(base) = base {
            let pose = base.pose();
            self.path.push(PathPoint { x: pose.x, y: pose.y, yaw: pose.yaw });
        }
    }

    /// Takes a sample of what the robot hears of its base: `status` as for [`sample`](Self::sample),
    /// and by its IMU `yaw`, degrees.
    pub fn base(&mut self, status: impl Fn(usize) -> MotorStatus, yaw: Option<f64>) {
        let Some(base) = &self.description.base else { return };
        let wheels = base.wheels.map(|line| {
            let MotorStatus { link, drive, feedback, .. } = status(line);
            WheelHeard {
                angle: feedback.total_angle.microdegrees() as f64 * 1e-6,
                current: feedback.current().map(|current| current.get().into()),
                follows: link == Link::Online && drive == Drive::Run,
            }
        });
        self.heard.push(BaseHeard { wheels, yaw });
    }

    /// The recording. `motor` is what the robot knows of the motor in a line of its table, `bus`
    /// of its bus with a number, `lines` of its RS-485 lines, at the end.
    #[must_use]
    pub fn finish(
        self,
        length: Micros,
        wires: &[rc10_sim::Bus],
        escs: &[Twin],
        motor: impl Fn(usize) -> MotorStatus,
        bus: impl Fn(u8) -> BusStatus,
        lines: Vec<LineStatus>,
    ) -> Recording {
        let motors = self.description.motors.iter().zip(escs).zip(self.samples);
        let motors = motors.enumerate().map(|(line, ((described, esc), samples))| MotorTrack {
            motor: *described,
            samples,
            last: motor(line),
            overwritten: esc.state().feedback_overwritten,
        });
        let buses = (1..=u8::MAX).zip(wires.iter().zip(self.logs));
        let buses = buses.map(|(number, (wire, (log, frames)))| BusTrack {
            number,
            load: wire.load(),
            load_windows: wire.load_windows(),
            last: bus(number),
            frames,
            log,
        });
        let base = self.description.base;
        Recording {
            seed: self.seed,
            length,
            motors: motors.collect(),
            buses: buses.collect(),
            lines,
            base: base.map(|base| BaseTrack {
                wheels: base.wheels,
                path: self.path,
                chassis: base.chassis,
                heard: self.heard,
            }),
            events: self.description.events(length),
            remote: None,
        }
    }
}

fn sample(motor: &Motor, status: &MotorStatus, esc: &Twin) -> MotorSample {
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
        Target::TotalAngle(wanted) => {
            let degrees = |angle: TotalAngle| angle.microdegrees() as f64 * 1e-6;
            (Some(degrees(wanted)), degrees(feedback.total_angle))
        }
        // What its spring pulls to.
        Target::Impedance(wanted) => {
            let measured = feedback.total_angle.degrees();
            (Some(wanted.angle.get().into()), measured.get().into())
        }
        Target::Speed(wanted) => (Some(wanted.get().into()), feedback.speed.get().into()),
        _ => (None, feedback.speed.get().into()),
    };
    let state = esc.state();
    MotorSample {
        target: wanted.filter(|_| status.drive == Drive::Run),
        measured,
        kind: status.target.kind(),
        current: state.current * motor.sign(),
        rpm: state.output_rpm * motor.sign(),
        link: status.link,
        drive: status.drive,
    }
}
