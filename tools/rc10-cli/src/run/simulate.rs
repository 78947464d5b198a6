//! Runs of a robot in the simulator: its own tasks, against simulated motors and wires.

use anyhow::Result;
use rc10_can::Micros;
use rc10_module::Reception;
use rc10_motor::embassy::BusPort;
use rc10_motor::{ArmSwitch, MotorStatus};
use rc10_tasks::seen::Whole;

use crate::judge::searches::{UNARMED_FOR, armed_for};
use crate::record::recorder::Recorder;
use crate::record::{Heading, RecordWriter};
use crate::recording::Recording;
use crate::recording::look::{BusLook, Moment, RobotLook};
use crate::recording::problem::{About, Problem};
use crate::recording::sample::Source;
use crate::recording::sample::{PathPoint, seconds};
use crate::run::watch::{Sight, Watch};
use crate::world::environment::{Environment, rounded_up};
use crate::world::robot::Robot;

/// The begin of a simulated run's record.
#[must_use]
pub fn heading<'a>(robot: &'a Robot<'_>, seed: u64) -> Heading<'a> {
    let (description, signals) = (robot.description(), robot.signals());
    Heading { seed, source: Source::Simulation, description, signals }
}

/// Runs a robot for `length` of virtual time; fails unless robot and environment are as described.
pub fn simulate(robot: Robot<'_>, seed: u64, length: Micros) -> Result<Recording> {
    simulate_into(robot, seed, length, None)
}

/// Runs a robot like [`simulate`] and writes every look into a record; fails if it cannot.
pub fn simulate_into(
    robot: Robot<'_>,
    seed: u64,
    length: Micros,
    record: Option<RecordWriter>,
) -> Result<Recording> {
    let loops = robot.loops();
    let (description, ports) = (robot.description().clone(), robot.ports());
    let mut around = Environment::new(&description, seed)?;
    let mut tasks = robot.tasks(&around)?;
    let motor =
        |entry| ports.motor(&description, entry).map_or(MotorStatus::NEW, |port| port.status());
    let mut recorder =
        Recorder::new(&description, seed, &loops, &around.motors, Source::Simulation)
            .with_imu(ports.yaw.is_some())
            .with_signals(&ports.signals)
            .with_record(record);
    let mut watch = Watch::new(description.remote.as_ref());
    let mut faults = around.faults(&description)?;
    // A robot need not say what arms it: its buses and lines know.
    let arm = || {
        let told = ports.switch.map(ArmSwitch::state);
        let bus = || ports.buses.first().map(|port| port.status().arm);
        told.or_else(bus).or_else(|| ports.lines.first().map(|port| port.status().arm))
    };
    let mut next_look = Recorder::next_look(around.world.now(), length);
    while around.world.now() < length {
        let watched = watch.next(around.world.now()).unwrap_or(next_look);
        let next_fault = faults.next(around.world.now_ns()).map_or(next_look, rounded_up);
        around.run(&mut tasks, watched.min(next_look).min(next_fault));
        let now = around.world.now();
        for (bus, wire) in around.wires.iter().enumerate() {
            let news = wire.take_trace();
            faults.heard(bus, &news);
            recorder.frames(bus, &news);
        }
        // The remote's are in its operator's hands, those of a chip are refused.
        let _ = faults.act(now.into());
        let sight = around.remote.as_ref().map(|link| Sight {
            sent: link.remote.sent(),
            motors: &description.motors,
            twins: &around.motors,
            arm: ports.switch.map(ArmSwitch::state),
        });
        if let Some(sight) = sight {
            watch.look(now, sight);
        }
        if now < next_look {
            continue;
        }
        next_look = Recorder::next_look(now, length);
        let values: Vec<_> = ports.signals.iter().map(|signal| (signal.read)(now)).collect();
        recorder.signals(now, &values)?;
        if !recorder.look((now, length), &around.motors, motor)? {
            continue;
        }
        let bus = |port: &&BusPort| BusLook { status: port.status(), ..BusLook::default() };
        let robot = RobotLook {
            whole: ports
                .whole
                .as_ref()
                .map_or_else(|| Whole { arm: arm(), ..Whole::default() }, |whole| whole()),
            pose: PathPoint::of(around.base.as_ref()),
            yaw: ports.yaw.as_ref().and_then(|(_, yaw)| yaw(now)),
        };
        let moment = Moment {
            robot,
            buses: ports.buses.iter().map(bus).collect(),
            lines: ports.lines.iter().map(|port| port.status()).collect(),
            parts: ports.parts.iter().map(|reception| reception.read()).collect(),
            remote: sight.map(|sight| sight.remote(ports.reception.map(Reception::read))),
        };
        recorder.sample(now, &around.wires, moment)?;
    }
    let mut recording = recorder.finish(around.world.now(), &around.wires, watch.finish())?;
    let was_driven = armed_for(&recording) >= UNARMED_FOR;
    let unread = ports.parameters.iter().filter(|it| was_driven && !it.was_read());
    recording.found.extend(unread.map(|it| {
        let text = "no task has read this parameter: setting it changes nothing".to_owned();
        Problem::new(About::Part(it.label), "unread-parameter", text)
    }));
    recording.found.extend(tasks.ended().iter().map(|(name, at)| {
        let at = seconds(*at);
        let text = format!(
            "its task {name} ended at {at:.3} s, and a task goes on for ever: is an `.await` missing, \
             or a `loop`?"
        );
        Problem::new(About::Robot, "task-ended", text)
    }));
    Ok(recording)
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
