//! Records what a robot does in its environment, simulated or emulated.

use rc10_app::TotalAngle;
use rc10_app::angle::shortest_way_degrees;
use rc10_can::Micros;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{ArmState, DriveMode, Link, Loops, MotorStatus, Target, TargetKind};
use rc10_sim::{Base, Esc, TraceEntry};
use sha2::{Digest, Sha256};

use crate::candump;
use crate::description::Description;
use crate::effort::{EffortWatch, effort_of};
use crate::margin::Margins;
use crate::motor::Motor;
use crate::recording::{
    BaseHeard, BaseTrack, BusSample, BusTrack, Cell, LOOK_PERIOD, MotorSample, MotorTrack,
    PathPoint, Recording, SAMPLE_PERIOD, Sum, Tracking, WheelHeard, hex_digits,
};
use crate::signal::{Signal, SignalRecorder};

/// Recorder of what a robot does. It sees the wires and the shafts for itself; what the robot
/// believes of its motors and buses it must be told.
pub struct Recorder<'d> {
    description: &'d Description,
    seed: u64,
    is_emulated: bool,
    motors: Vec<MotorRecorder>,
    buses: Vec<BusRecorder>,
    arm: Vec<ArmState>,
    path: Vec<PathPoint>,
    heard: Vec<BaseHeard>,
    signals: Vec<SignalRecorder>,
}

#[derive(Default)]
struct BusRecorder {
    log: String,
    /// Of what was in the log before, if that is not kept.
    hash: Sha256,
    frames: u64,
    samples: Vec<BusSample>,
}

impl<'d> Recorder<'d> {
    /// A recorder before the start. `seed` is that of the world; `loops` and `twins` are those of
    /// the motors, in the order of the description. On an emulated chip it does not see what the
    /// robot decides.
    #[must_use]
    pub fn new(
        description: &'d Description,
        seed: u64,
        loops: &[Option<Loops>],
        twins: &[Esc],
        is_emulated: bool,
    ) -> Self {
        let watch = |(line, (loops, twin)): (usize, (&Option<Loops>, &Esc))| {
            let loops = (*loops)?;
            Some(EffortWatch::new(loops, Margins::of_motor(loops, line, twin, description)))
        };
        let watches = loops.iter().zip(twins).enumerate().map(watch);
        Self {
            description,
            seed,
            is_emulated,
            motors: watches.map(MotorRecorder::new).collect(),
            buses: (0..description.buses).map(|_| BusRecorder::default()).collect(),
            arm: Vec::new(),
            path: Vec::new(),
            heard: Vec::new(),
            signals: Vec::new(),
        }
    }

    /// The same, with the robot's own signals.
    #[must_use]
    pub fn with_signals(mut self, signals: &[Signal<'_>]) -> Self {
        self.signals = signals.iter().map(SignalRecorder::new).collect();
        self
    }

    /// Takes the values of the robot's own signals, in their order: every [`LOOK_PERIOD`].
    pub fn signals(&mut self, values: impl Iterator<Item = Option<f64>>) {
        self.signals.iter_mut().zip(values).for_each(|(signal, value)| signal.look(value));
    }

    /// The time of the next look, if the run is to end at `end`.
    #[must_use]
    pub fn next_look(now: Micros, end: Micros) -> Micros {
        (now + LOOK_PERIOD).min(end)
    }

    /// Takes frames of a bus down, 0 for the first, in the order of the wire.
    pub fn frames(&mut self, bus: usize, entries: &[TraceEntry]) {
        let Some(BusRecorder { log, hash, frames, .. }) = self.buses.get_mut(bus) else {
            return;
        };
        // As can-utils would call them.
        let channel = format!("can{bus}");
        for entry in entries {
            *frames += 1;
            // A string takes everything.
            let _ = candump::write_line(log, entry.at, &channel, &entry.frame);
        }
        if self.description.no_logs {
            hash.update(&*log);
            log.clear();
        }
    }

    /// Looks at the motors: every [`LOOK_PERIOD`]. `status` is what is known of the motor in a line
    /// of the robot's table. Whether it is time for a [`sample`](Self::sample), too.
    pub fn look(
        &mut self,
        (now, end): (Micros, Micros),
        motors: &[Esc],
        status: impl Fn(usize) -> MotorStatus,
    ) -> bool {
        let motors = self.description.motors.iter().zip(motors);
        for (line, (recorder, (motor, twin))) in self.motors.iter_mut().zip(motors).enumerate() {
            let mut status = status(line);
            if self.is_emulated {
                status.drive =
                    if motor.is_driven(twin) { DriveMode::Run } else { DriveMode::Coast };
            }
            recorder.look(now, motor, &status, twin);
        }
        now >= end || now.get().is_multiple_of(SAMPLE_PERIOD.get())
    }

    /// Takes a sample of everything but the wires: of the motors what was seen since the last one.
    /// `bus` is what is known of a bus with a number, `arm` whether the robot is armed, if that is
    /// known.
    pub fn sample(
        &mut self,
        base: Option<&Base>,
        bus: impl Fn(u8) -> BusStatus,
        arm: Option<ArmState>,
    ) {
        self.motors.iter_mut().for_each(MotorRecorder::sample);
        self.signals.iter_mut().for_each(SignalRecorder::sample);
        for (number, recorder) in (1..=u8::MAX).zip(&mut self.buses) {
            recorder.samples.push(BusSample::of(&bus(number)));
        }
        self.arm.extend(arm);
        if let Some(base) = base {
            let pose = base.pose();
            self.path.push(PathPoint { x: pose.x, y: pose.y, yaw: pose.yaw });
        }
    }

    /// Takes a sample of what the robot hears of its base: `status` as for [`sample`](Self::sample),
    /// and by its IMU `yaw`, degrees.
    pub fn base(
        &mut self,
        motors: &[Esc],
        status: impl Fn(usize) -> MotorStatus,
        yaw: Option<f64>,
    ) {
        let Some(base) = &self.description.base else { return };
        let wheels = base.wheels.map(|line| {
            let MotorStatus { link, drive, feedback, .. } = status(line);
            let is_driven = match self.description.motors.get(line).zip(motors.get(line)) {
                Some((motor, twin)) if self.is_emulated => motor.is_driven(twin),
                _ => drive == DriveMode::Run,
            };
            WheelHeard {
                angle: feedback.total_angle.microdegrees() as f64 * 1e-6,
                current: feedback.current().map(|current| current.get().into()),
                follows: link == Link::Online && is_driven,
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
        escs: &[Esc],
        motor: impl Fn(usize) -> MotorStatus,
        bus: impl Fn(u8) -> BusStatus,
        lines: Vec<Rs485Status>,
    ) -> Recording {
        let motors = self.description.motors.iter().zip(escs).zip(self.motors);
        let motors = motors.enumerate().map(|(line, ((described, esc), recorder))| MotorTrack {
            motor: described.clone(),
            samples: recorder.samples,
            last: motor(line),
            overwritten: esc.state().feedback_overwritten,
            tracking: recorder.tracking,
            peak_current: recorder.peak_current,
            effort: recorder.effort.map(EffortWatch::finish),
        });
        let buses = (1..=u8::MAX).zip(wires.iter().zip(self.buses));
        let buses = buses.map(|(number, (wire, recorder))| BusTrack {
            number,
            load: wire.load(),
            load_windows: wire.load_windows(),
            last: bus(number),
            samples: recorder.samples,
            frames: recorder.frames,
            log_hash: hex_digits(recorder.hash.chain_update(&recorder.log)),
            log: recorder.log,
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
            arm: self.arm,
            signals: self.signals.into_iter().map(SignalRecorder::finish).collect(),
            no_logs: self.description.no_logs,
            is_emulated: self.is_emulated,
            ..Recording::default()
        }
    }
}

/// Samples of one motor in this run, and what the next one is made of.
struct MotorRecorder {
    samples: Vec<MotorSample>,
    tracking: Vec<Tracking>,
    peak_current: f64,
    effort: Option<EffortWatch>,
    /// Since the last sample.
    newest: Option<MotorSample>,
    measured: Sum,
    current: Sum,
    rpm: Sum,
}

impl MotorRecorder {
    fn new(effort: Option<EffortWatch>) -> Self {
        Self {
            samples: Vec::new(),
            tracking: Vec::new(),
            peak_current: 0.0,
            effort,
            newest: None,
            measured: Sum::default(),
            current: Sum::default(),
            rpm: Sum::default(),
        }
    }

    fn look(&mut self, now: Micros, motor: &Motor, status: &MotorStatus, twin: &Esc) {
        let seen = sample(motor, status, twin);
        if let (Some(target), DriveMode::Run) = (seen.target, seen.drive) {
            self.track(seen.kind, target - seen.measured);
        }
        self.peak_current = self.peak_current.max(seen.current.abs());
        if let Some(watch) = &mut self.effort {
            let is_driven = !matches!(seen.drive, DriveMode::Off | DriveMode::Coast);
            // An effort that was asked for is not judged: no loop has made it.
            let asked = matches!(
                status.target.kind(),
                TargetKind::Current | TargetKind::Torque | TargetKind::Duty | TargetKind::Impedance
            );
            let is_judged = is_driven && seen.link == Link::Online && !asked;
            let loops = watch.loops();
            watch.look(now, is_judged.then(|| effort_of(motor, twin, loops)));
        }
        if self.newest.is_some_and(|newest| newest.kind != seen.kind) {
            self.measured = Sum::default();
        }
        self.measured.add(seen.measured);
        self.current.add(seen.current);
        self.rpm.add(seen.rpm);
        self.newest = Some(seen);
    }

    fn track(&mut self, kind: TargetKind, error: f64) {
        let known = self.tracking.iter().position(|tracking| tracking.kind == kind);
        let index = known.unwrap_or_else(|| {
            self.tracking.push(Tracking { kind, looks: 0, squares: 0.0, peak: 0.0 });
            self.tracking.len() - 1
        });
        let tracking = &mut self.tracking[index];
        tracking.looks += 1;
        tracking.squares += error * error;
        tracking.peak = tracking.peak.max(error.abs());
    }

    fn sample(&mut self) {
        let Some(newest) = self.newest.take() else { return };
        let cell = |sum: &mut Sum| std::mem::take(sum).cell().unwrap_or_default();
        self.samples.push(MotorSample {
            measured_cell: cell(&mut self.measured),
            current_cell: cell(&mut self.current),
            rpm_cell: cell(&mut self.rpm),
            ..newest
        });
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
        target: wanted.filter(|_| status.drive == DriveMode::Run),
        measured,
        measured_cell: Cell::default(),
        kind: status.target.kind(),
        current: state.current * motor.sign(),
        current_cell: Cell::default(),
        rpm: state.output_rpm * motor.sign(),
        rpm_cell: Cell::default(),
        link: status.link,
        drive: status.drive,
        counters: status.counters,
        overwritten: state.feedback_overwritten,
    }
}

#[cfg(test)]
mod tests {
    use rc10_app::Rpm;
    use rc10_motor::dji::M3508;
    use rc10_sim::{BusConfig, World};

    use super::*;

    /// Three looks at a motor that measured 97, 50 and 96 rpm. In the second it was not driven, so
    /// there was no target to follow.
    #[test]
    fn looks_without_a_target_are_not_in_the_error() {
        let motor = Motor::dji_on("wheel", 1, &M3508, 1);
        let wire = World::new(1).add_bus(BusConfig::default());
        let twin = motor.plug_in(&[wire], &[]).unwrap();
        let mut recorder = MotorRecorder::new(None);
        for (rpm, drive) in
            [(97.0, DriveMode::Run), (50.0, DriveMode::Coast), (96.0, DriveMode::Run)]
        {
            let mut status = MotorStatus::NEW;
            status.drive = drive;
            status.target = Target::Speed(Rpm::new(100.0));
            status.feedback.speed = Rpm::new(rpm);
            recorder.look(Micros::ZERO, &motor, &status, &twin);
            recorder.sample();
        }
        let targets: Vec<_> = recorder.samples.iter().map(|sample| sample.target).collect();
        assert_eq!(targets, [Some(100.0), None, Some(100.0)]);
        let expected = Tracking { kind: TargetKind::Speed, looks: 2, squares: 25.0, peak: 4.0 };
        assert_eq!(recorder.tracking, [expected]);
        assert!((expected.rms() - 12.5_f64.sqrt()).abs() < 1e-9);
    }
}
