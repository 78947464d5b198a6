//! Records a robot in its environment, simulated or emulated.

use anyhow::Result;
use rc10_motor::{DriveMode, Link, Loops, MotorStatus, TargetKind};
use rc10_sim::{Esc, TraceEntry};
use rc10_time::Micros;
use sha2::{Digest, Sha256};

use crate::formats::candump;
use crate::record::RecordWriter;
use crate::recording::effort::EffortWatch;
use crate::recording::load::Carrying;
use crate::recording::look::{Moment, MotorLook};
use crate::recording::margin::Margins;
use crate::recording::remote::{Loss, RemoteTrack};
use crate::recording::sample::{
    BaseMeasurement, BusSample, LOOK_PERIOD, MotorSample, NOWHERE, PathPoint, RemoteSample,
    SAMPLE_PERIOD, Source, Sum, WheelMeasurement, WireEnd, hex_digits,
};
use crate::recording::signal::SignalRecorder;
use crate::recording::wheels::Wheels;
use crate::recording::{BaseTrack, BusTrack, MotorTrack, PartTrack, Recording, Tracking};
use crate::robot::base::Base;
use crate::robot::description::{Description, PoseSignals};
use crate::robot::signal::Signal;

/// Largest turn of a steering shaft between two samples, degrees: 1000 rpm.
const STEERED_ANEW: f64 = 60.0;

/// Recorder of a robot. It reads the wires and the shafts itself, and gets the robot's view of
/// motors and buses from its caller. It also takes recorded looks.
#[derive(Clone)]
pub struct Recorder<'d> {
    description: &'d Description,
    /// The recording so far, but for motors, buses, remote and signals.
    recording: Recording,
    has_imu: bool,
    motors: Vec<MotorRecorder>,
    buses: Vec<BusRecorder>,
    /// The newest angles of the motors that steer, degrees; `None` of one that is not heard.
    steers: Vec<Option<f64>>,
    remote: Vec<RemoteSample>,
    signals: Vec<SignalRecorder>,
    moment: Moment,
    record: Written,
}

/// Degrees of a motor's output shaft, all turns counted.
fn degrees(status: &MotorStatus) -> f64 {
    status.feedback.total_angle.microdegrees() as f64 * 1e-6
}

/// The record that is written, if there is one. A copy writes nothing.
struct Written(Option<RecordWriter>);

impl Clone for Written {
    fn clone(&self) -> Self {
        Self(None)
    }
}

#[derive(Clone, Default)]
struct BusRecorder {
    log: String,
    /// Hash of the log so far, if the log is not kept.
    hash: Sha256,
    frames: u64,
    samples: Vec<BusSample>,
}

impl<'d> Recorder<'d> {
    /// Creates a recorder before the start, with the world's `seed`, and the `loops` and `twins` of
    /// the motors in the order of the description. `source` decides what the robot itself tells.
    pub fn new(
        description: &'d Description,
        seed: u64,
        loops: &[Option<Loops>],
        twins: &[Esc],
        source: Source,
    ) -> Self {
        let watch = |(line, (loops, twin)): (usize, (&Option<Loops>, &Esc))| {
            let loops = (*loops)?;
            Some(EffortWatch::new(loops, margins(loops, line, twin, description.base.as_ref())))
        };
        let watches = loops.iter().zip(twins).enumerate().map(watch);
        let motors = watches.map(MotorRecorder::new).collect();
        let mut recorder = Self { motors, ..Self::of_capture(description) };
        (recorder.recording.seed, recorder.recording.source) = (seed, source);
        recorder
    }

    /// Creates a recorder of a capture: without a world, and without loops to judge.
    pub fn of_capture(description: &'d Description) -> Self {
        let base = description.base.as_ref().map(|base| BaseTrack {
            wheels: base.wheels.clone(),
            steering: base.steering.clone(),
            chassis: base.chassis.clone(),
            ..BaseTrack::default()
        });
        let (source, no_logs) = (Source::Capture, description.no_logs);
        Self {
            description,
            recording: Recording {
                base,
                source,
                no_logs,
                drawn: description.drawn(),
                turned: description.drawn_motors().map(|line| (line, Vec::new())).collect(),
                ..Recording::default()
            },
            has_imu: false,
            motors: description.motors.iter().map(|_| MotorRecorder::new(None)).collect(),
            buses: vec![BusRecorder::default(); description.buses.into()],
            steers: Vec::new(),
            remote: Vec::new(),
            signals: Vec::new(),
            moment: Moment::default(),
            record: Written(None),
        }
    }

    /// Adds the robot's own signals, and whether it has an IMU.
    #[must_use]
    pub fn with_own(self, signals: &[Signal<'_>], has_imu: bool) -> Self {
        Self { signals: signals.iter().map(SignalRecorder::new).collect(), has_imu, ..self }
    }

    /// Adds a record for every look.
    #[must_use]
    pub fn with_record(self, record: Option<RecordWriter>) -> Self {
        Self { record: Written(record), ..self }
    }

    /// Takes the values of the own signals, every [`LOOK_PERIOD`]; fails if the record cannot be
    /// written.
    pub fn signals(&mut self, now: Micros, values: &[Option<f64>]) -> Result<()> {
        self.signals.iter_mut().zip(values).for_each(|(signal, value)| signal.look(*value));
        self.record.0.as_mut().map_or(Ok(()), |record| record.signals(now, values))
    }

    /// The time of the next look in a run that ends at `end`.
    pub fn next_look(now: Micros, end: Micros) -> Micros {
        (now + LOOK_PERIOD).min(end)
    }

    /// Whether a sample is due after a look, in a run that ends at `end`.
    pub(crate) fn is_sample_due(now: Micros, end: Micros) -> bool {
        now >= end || now.get().is_multiple_of(SAMPLE_PERIOD.get())
    }

    /// Takes frames of a bus, 0 for the first, in the order of the wire.
    pub fn frames(&mut self, bus: usize, entries: &[TraceEntry]) {
        let Some(BusRecorder { log, hash, frames, .. }) = self.buses.get_mut(bus) else {
            return;
        };
        // The name that can-utils would use.
        let channel = format!("can{bus}");
        for entry in entries {
            *frames += 1;
            let _ = candump::write_line(log, entry.at, &channel, &entry.frame);
        }
        if self.description.no_logs {
            hash.update(&*log);
            log.clear();
        }
    }

    /// Looks at the motors, every [`LOOK_PERIOD`], with the `status` of the motor in a line of the
    /// table; returns whether a [`sample`](Self::sample) is due. Fails if the record cannot be
    /// written.
    pub fn look(
        &mut self,
        (now, end): (Micros, Micros),
        motors: &[Esc],
        status: impl Fn(usize) -> MotorStatus,
    ) -> Result<bool> {
        let described = self.description.motors.iter().zip(&self.motors);
        let looks = described.zip(motors).enumerate().map(|(line, ((motor, recorder), twin))| {
            let mut status = status(line);
            if self.recording.source == Source::Emulation {
                status.drive =
                    if motor.is_driven(twin) { DriveMode::Run } else { DriveMode::Coast };
            }
            MotorLook::at(motor, status, twin, recorder.loops())
        });
        let looks: Vec<_> = looks.collect();
        self.take_look(now, &looks)?;
        Ok(Self::is_sample_due(now, end))
    }

    /// Takes a look at each motor; fails if the record cannot be written.
    pub fn take_look(&mut self, now: Micros, looks: &[MotorLook]) -> Result<()> {
        self.motors.iter_mut().zip(looks).for_each(|(recorder, look)| recorder.look(now, look));
        self.record.0.as_mut().map_or(Ok(()), |record| record.motors(now, looks))
    }

    /// Takes a sample, with the looks at motors since the last one; adds the state of the wires to
    /// `moment`. Fails if the record cannot be written.
    pub fn sample(
        &mut self,
        now: Micros,
        wires: &[rc10_sim::Bus],
        mut moment: Moment,
    ) -> Result<()> {
        for (look, (recorder, wire)) in moment.buses.iter_mut().zip(self.buses.iter().zip(wires)) {
            (look.frames, look.load) = (recorder.frames, wire.load());
        }
        self.take_sample(now, moment)
    }

    /// Takes what reached the ticks since the last sample; fails if the record cannot be written.
    pub fn inputs(&mut self, now: Micros, words: &[u32]) -> Result<()> {
        let record = self.record.0.as_mut().filter(|_| !words.is_empty());
        record.map_or(Ok(()), |record| record.inputs(now, words))
    }

    /// Takes a recorded sample; fails if the record cannot be written.
    pub fn take_sample(&mut self, now: Micros, moment: Moment) -> Result<()> {
        self.motors.iter_mut().for_each(MotorRecorder::sample);
        self.signals.iter_mut().for_each(SignalRecorder::sample);
        for (recorder, look) in self.buses.iter_mut().zip(&moment.buses) {
            recorder.samples.push(BusSample::of(&look.status));
        }
        self.recording.arm.extend(moment.robot.whole.arm);
        if self.has_imu {
            self.recording.headings.push(moment.robot.yaw.is_some());
        }
        self.remote.extend(moment.remote.map(|look| look.sample));
        for (line, angles) in &mut self.recording.turned {
            let status = self.motors.get(*line).map(|motor| &motor.last.status);
            let heard = status.filter(|it| it.link != Link::NeverSeen);
            angles.push(heard.map_or(f64::NAN, degrees));
        }
        if let Some(base) = &self.description.base {
            let wheels = self.wheels(base);
            let Description { estimate, reference, .. } = self.description;
            let pose = |labels| self.pose(labels).unwrap_or(NOWHERE);
            let [estimate, reference] = [estimate, reference].map(|labels| labels.map(pose));
            if let Some(track) = &mut self.recording.base {
                track.path.push(moment.robot.pose);
                track.heard.push(BaseMeasurement { wheels, yaw: moment.robot.yaw });
                track.estimate.extend(estimate);
                track.reference.extend(reference);
            }
        }
        if let Some(record) = &mut self.record.0 {
            record.sample(now, self.motors.iter().map(|motor| &motor.last), &moment)?;
        }
        self.moment = moment;
        Ok(())
    }

    /// Measurements of the motors of a base's wheels.
    fn wheels(&mut self, base: &Base) -> Vec<WheelMeasurement> {
        let status =
            |line: usize| self.motors.get(line).map_or(MotorStatus::NEW, |motor| motor.last.status);
        let follows =
            |status: &MotorStatus| status.link == Link::Online && status.drive == DriveMode::Run;
        let mut steering = base.steering.iter();
        let mut steers = Vec::new();
        let wheels = base.wheels.iter().zip(&base.chassis.wheels).enumerate();
        let wheels = wheels.map(|(index, (line, wheel))| {
            let motor = status(*line);
            let mut heard = WheelMeasurement {
                angle: degrees(&motor),
                current: motor.feedback.current().map(|current| current.get().into()),
                follows: follows(&motor),
                steered: 0.0,
            };
            let gear = wheel.steering.and_then(|gear| Some((gear.gear, *steering.next()?)));
            let Some((gear, line)) = gear else { return heard };
            let motor = status(line);
            heard.follows &= follows(&motor);
            let shaft = (motor.link == Link::Online).then(|| degrees(&motor));
            let last = self.steers.get(steers.len()).copied().flatten();
            heard.steered = if self.recording.source.is_simulated() {
                // From the wheels' first direction on, at any angle of the motor; a jump is a new
                // zero.
                let heard = self.recording.base.as_ref().and_then(|base| base.heard.last());
                let before = heard.and_then(|heard| heard.wheels.get(index));
                let step = shaft.zip(last).map_or(0.0, |(now, last)| now - last);
                let step = if step.abs() < STEERED_ANEW { step } else { 0.0 };
                before.map_or(0.0, |before| before.steered) + step / gear
            } else {
                shaft.unwrap_or_default() / gear
            };
            steers.push(shaft.or(last));
            heard
        });
        let wheels = wheels.collect();
        self.steers = steers;
        wheels
    }

    /// The pose in three of the robot's own signals; `None` while one of them has no value.
    fn pose(&self, labels: PoseSignals) -> Option<PathPoint> {
        let value = |label: &str| {
            let track = self.signals.iter().map(|it| &it.track).find(|it| it.label == label)?;
            Some((track.last?, track.unit))
        };
        let [x, y, yaw] = labels.map(value);
        let ((x, _), (y, _), (yaw, unit)) = (x?, y?, yaw?);
        Some(PathPoint { x, y, yaw: if unit == "rad" { yaw } else { yaw.to_radians() } })
    }

    /// Ends the recording with the `losses` of the remote; fails if the record cannot be written.
    pub fn finish(
        mut self,
        length: Micros,
        wires: &[rc10_sim::Bus],
        losses: Vec<Loss>,
    ) -> Result<Recording> {
        let ends = self.buses.iter_mut().zip(wires).map(|(recorder, wire)| {
            let log = std::mem::take(&mut recorder.log);
            let hash = std::mem::take(&mut recorder.hash).chain_update(&log);
            WireEnd { load_windows: wire.load_windows(), log_hash: hex_digits(hash), log }
        });
        let ends = ends.collect();
        self.finish_with(length, ends, losses)
    }

    /// Ends the recording with what is known of the wires; fails if the record cannot be written.
    pub fn finish_with(
        mut self,
        length: Micros,
        wires: Vec<WireEnd>,
        losses: Vec<Loss>,
    ) -> Result<Recording> {
        // A real robot follows its driver, not a script.
        let is_scripted = self.recording.source != Source::Robot;
        let events = if is_scripted { self.description.events(length) } else { Vec::new() };
        if let Some(record) = self.record.0.take() {
            let faults = self.motors.iter().map(|motor| motor.last.status.fault);
            let described = self.description.motors.iter().zip(&self.motors);
            let margins = described.filter_map(|(motor, recorder)| {
                Some((motor.label, recorder.effort.as_ref()?.margins()?))
            });
            record.finish(length, &wires, &losses, &events, faults, margins)?;
        }
        let motors = self.description.motors.iter().zip(self.motors);
        let motors = motors.map(|(described, recorder)| MotorTrack {
            motor: described.clone(),
            samples: recorder.samples,
            last: recorder.last.status,
            overwritten: recorder.last.shaft.overwritten,
            tracking: recorder.tracking,
            peak_current: recorder.peak_current,
            effort: recorder.effort.map(EffortWatch::finish),
        });
        let Moment { robot, buses, lines, parts, remote } = self.moment;
        let buses = (1..=u8::MAX).zip(buses.into_iter().zip(self.buses).zip(wires));
        let buses = buses.map(|(number, ((look, recorder), wire))| BusTrack {
            number,
            load: look.load,
            load_windows: wire.load_windows,
            last: look.status,
            samples: recorder.samples,
            frames: look.frames,
            log_hash: wire.log_hash,
            log: wire.log,
        });
        let parts = self.description.serials.iter().zip(parts);
        let parts =
            parts.map(|(part, heard)| PartTrack { label: part.label, uart: part.uart, heard });
        Ok(Recording {
            length,
            motors: motors.collect(),
            buses: buses.collect(),
            lines,
            events,
            remote: remote.zip(self.description.remote.as_ref()).map(|(look, control)| {
                RemoteTrack {
                    receiver: control.receiver,
                    sent: look.sent,
                    heard: look.is_told.then_some(look.heard),
                    losses,
                    samples: self.remote,
                }
            }),
            parts: parts.collect(),
            signals: self.signals.into_iter().map(SignalRecorder::finish).collect(),
            not_at_rest: robot.whole.not_at_rest,
            ..self.recording
        })
    }
}

/// Gain margins of the loops of the motor in a line of the table, with its share of a base; `None`
/// if its load is not described.
pub fn margins(loops: Loops, line: usize, twin: &Esc, base: Option<&Base>) -> Option<Margins> {
    let mut plant = twin.plant();
    if plant.load_inertia <= 0.0 {
        return None;
    }
    if let Some(base) = base
        && let Some(wheel) = base.wheels.iter().position(|wheel| *wheel == line)
        && let Some(wheel) = base.chassis.wheels.get(wheel)
    {
        // Its share of all wheels' motion as the base goes ahead.
        let shares = Wheels::new(&base.chassis, &[]).ahead();
        plant.load_inertia += base.chassis.mass * wheel.radius.powi(2) / shares;
    }
    Some(Margins::of(loops, &plant))
}

/// The samples of one motor, and the looks for the next one.
#[derive(Clone)]
struct MotorRecorder {
    samples: Vec<MotorSample>,
    tracking: Vec<Tracking>,
    peak_current: f64,
    effort: Option<EffortWatch>,
    /// The last look, and whether it is newer than the last sample.
    last: MotorLook,
    is_new: bool,
    /// Measurement, current and speed since the last sample.
    sums: [Sum; 3],
}

impl MotorRecorder {
    fn new(effort: Option<EffortWatch>) -> Self {
        Self {
            samples: Vec::new(),
            tracking: Vec::new(),
            peak_current: 0.0,
            effort,
            last: MotorLook::NEW,
            is_new: false,
            sums: Default::default(),
        }
    }

    fn loops(&self) -> Option<Loops> {
        self.effort.as_ref().map(EffortWatch::loops)
    }

    fn look(&mut self, now: Micros, look: &MotorLook) {
        let seen = look.seen();
        if let (Some(target), DriveMode::Run) = (seen.target, seen.drive) {
            self.track(seen.kind, target - seen.measured);
        }
        self.peak_current = self.peak_current.max(seen.current.abs());
        if let Some(watch) = &mut self.effort {
            watch.look(now, look.effort);
            let MotorSample { kind, target, measured, .. } = seen;
            let (feedback, effort) = (&look.status.feedback, look.effort);
            watch.look_at_load(now, &Carrying { kind, target, measured, feedback, effort });
        }
        if self.is_new && self.last.kind != seen.kind {
            self.sums[0] = Sum::default();
        }
        for (sum, value) in self.sums.iter_mut().zip([seen.measured, seen.current, seen.rpm]) {
            sum.add(value);
        }
        (self.last, self.is_new) = (*look, true);
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
        if !std::mem::take(&mut self.is_new) {
            return;
        }
        let cells = std::mem::take(&mut self.sums).map(|sum| sum.cell().unwrap_or_default());
        let [measured_cell, current_cell, rpm_cell] = cells;
        let seen = self.last.seen();
        self.samples.push(MotorSample { measured_cell, current_cell, rpm_cell, ..seen });
    }
}

#[cfg(test)]
mod tests {
    use rc10_app::Rpm;
    use rc10_motor::Target;
    use rc10_motor::dji::M3508;
    use rc10_sim::{BusConfig, World};

    use super::*;
    use crate::robot::motor::Motor;

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
            recorder.look(Micros::ZERO, &MotorLook::at(&motor, status, &twin, None));
            recorder.sample();
        }
        let targets: Vec<_> = recorder.samples.iter().map(|sample| sample.target).collect();
        assert_eq!(targets, [Some(100.0), None, Some(100.0)]);
        let expected = Tracking { kind: TargetKind::Speed, looks: 2, squares: 25.0, peak: 4.0 };
        assert_eq!(recorder.tracking, [expected]);
        assert!((expected.rms() - 12.5_f64.sqrt()).abs() < 1e-9);
    }
}
