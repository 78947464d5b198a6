//! Records a robot that runs: the one loop in which it is looked at.

use anyhow::Result;
use rc10_time::Micros;

use crate::judge::searches::{UNARMED_FOR, armed_for};
use crate::record::recorder::Recorder;
use crate::record::{Heading, RecordWriter};
use crate::recording::Recording;
use crate::recording::problem::{About, Problem};
use crate::recording::sample::{Source, seconds};
use crate::run::emulation::Emulation;
use crate::run::running::Running;
use crate::run::simulation::Simulation;
use crate::run::watch::Watch;
use crate::terminal::Progress;
use crate::world::robot::Robot;

/// Runs a robot up to a time, and takes down what is seen of it.
fn record(
    running: &mut impl Running,
    mut recorder: Recorder<'_>,
    length: Micros,
) -> Result<Recording> {
    let mut watch = Watch::new(running.description().remote.as_ref());
    let mut now = running.now();
    let mut next_look = Recorder::next_look(now, length);
    let mut progress = Progress::new();
    while now < length {
        now = watch.next(now).unwrap_or(next_look).min(next_look);
        running.run_to(now)?;
        if let Some(sight) = running.sight() {
            watch.look(now, sight);
        }
        if now < next_look {
            continue;
        }
        next_look = Recorder::next_look(now, length);
        for (bus, frames) in running.take_frames().iter().enumerate() {
            recorder.frames(bus, frames);
        }
        recorder.signals(now, &running.signals(now))?;
        let status = |entry| running.status(entry, now);
        if recorder.look((now, length), running.twins(), status)? {
            recorder.sample(now, running.wires(), running.moment(now))?;
            recorder.inputs(now, &running.take_inputs())?;
            progress.tell(now, length);
        }
    }
    recorder.finish(now, running.wires(), watch.losses)
}

/// What a record of a robot says that is about to run in a simulation.
pub fn heading<'a>(robot: &'a Robot<'_>, seed: u64) -> Heading<'a> {
    let (description, signals) = (robot.description(), robot.signals());
    Heading { seed, source: Source::Simulation, description, signals }
}

/// Runs a robot for `length` of virtual time; fails unless robot and environment are as described.
pub fn simulate(robot: Robot<'_>, seed: u64, length: Micros) -> Result<Recording> {
    simulate_into(robot, seed, length, None)
}

/// Runs a robot for `length` of virtual time, and writes every look into a record. Fails as
/// [`simulate`] does, and if the record cannot be written.
pub fn simulate_into(
    robot: Robot<'_>,
    seed: u64,
    length: Micros,
    writer: Option<RecordWriter>,
) -> Result<Recording> {
    let mut running = Simulation::new(robot, seed, None)?;
    let (description, ports) = (running.description().clone(), running.ports.clone());
    let (loops, twins) = (&running.loops, running.twins());
    let recorder = Recorder::new(&description, seed, loops, twins, Source::Simulation)
        .with_own(&ports.signals, ports.yaw.is_some())
        .with_record(writer);
    let mut recording = record(&mut running, recorder, length)?;
    let was_driven = armed_for(&recording) >= UNARMED_FOR;
    let unread = ports.parameters.iter().filter(|it| was_driven && !it.was_read());
    recording.found.extend(unread.map(|it| {
        let text = "no task has read this parameter: setting it changes nothing".to_owned();
        Problem::new(About::Part(it.label), "unread-parameter", text)
    }));
    recording.found.extend(running.tasks.ended().iter().map(|(name, ended)| {
        let at = seconds(*ended);
        let text = format!(
            "its task {name} ended at {at:.3} s, and a task goes on for ever: is an `.await` missing, \
             or a `loop`?"
        );
        Problem::new(About::Robot, "task-ended", text).in_time(*ended, Micros::ZERO)
    }));
    Ok(recording)
}

impl Emulation<'_> {
    /// Runs up to a time and takes down what the wires and the motors do. Fails as
    /// [`Rig::run`](rc10_emu::Rig::run) does.
    pub fn record(self, length: Micros) -> Result<(Self, Recording)> {
        self.record_into(length, None)
    }

    /// Runs up to a time, and writes every look into a record. Fails as [`record`](Self::record)
    /// does, and if that cannot be written.
    pub fn record_into(
        mut self,
        length: Micros,
        writer: Option<RecordWriter>,
    ) -> Result<(Self, Recording)> {
        let description = self.description.clone();
        let (loops, twins, source) = (&self.loops, &self.motors, Source::Emulation);
        let recorder =
            Recorder::new(&description, self.seed, loops, twins, source).with_record(writer);
        let recording = record(&mut self, recorder, length)?;
        Ok((self, recording))
    }

    /// The heading of its record.
    pub fn heading(&self) -> Heading<'_> {
        let Self { seed, description, .. } = self;
        Heading { seed: *seed, source: Source::Emulation, description, signals: &[] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::description::Description;

    #[test]
    fn a_robot_that_does_nothing_lets_time_pass() {
        let robot = Robot::new(Description::default()).task(async {});
        let recording = simulate(robot, 1, Micros::new(25_500)).unwrap();
        assert_eq!(recording.length, Micros::new(25_500));
        assert!(recording.motors.is_empty() && recording.base.is_none());
    }
}
