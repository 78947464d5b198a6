//! A robot in its surroundings: its own tasks, against simulated motors on simulated wires.

use std::pin::Pin;

use anyhow::Result;
use rc10_can::Micros;
use rc10_motor::MotorStatus;
use rc10_motor::embassy::BusStatus;

use crate::recorder::Recorder;
use crate::recording::Recording;
use crate::robot::Robot;
use crate::surroundings::Surroundings;

/// Runs a robot for `length` of virtual time.
///
/// # Errors
/// If the robot is not as described, or its surroundings cannot be built.
pub fn simulate(robot: Robot<'_>, seed: u64, length: Micros) -> Result<Recording> {
    let (description, ports) = (robot.description().clone(), robot.ports());
    let mut around = Surroundings::new(&description, seed)?;
    let mut tasks = robot.tasks(&around.wires, &around.lines)?;
    let motor =
        |entry| ports.motor(&description, entry).map_or(MotorStatus::NEW, |port| port.status());
    let mut recorder = Recorder::new(&description, seed);
    while around.world.now() < length {
        let until = Recorder::next_sample(around.world.now(), length);
        if around.world.run(Pin::new(&mut tasks), until).is_ready() {
            // A robot that has nothing more to do does not stop time.
            around.world.advance(until);
        }
        for (bus, wire) in around.wires.iter().enumerate() {
            recorder.frames(bus, &wire.take_trace());
        }
        recorder.sample(&around.motors, around.base.as_ref(), motor);
    }
    let bus = |number: u8| {
        let port = usize::from(number).checked_sub(1).and_then(|index| ports.buses.get(index));
        port.map_or_else(BusStatus::default, |port| port.status())
    };
    let lines = ports.lines.iter().map(|port| port.status()).collect();
    Ok(recorder.finish(around.world.now(), &around.wires, &around.motors, motor, bus, lines))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Description;

    #[test]
    fn a_robot_that_does_nothing_lets_time_pass() {
        let robot = Robot::new(Description::default()).task(async {});
        let recording = simulate(robot, 1, Micros::new(25_500)).unwrap();
        assert_eq!(recording.length, Micros::new(25_500));
        assert!(recording.motors.is_empty() && recording.base.is_none());
    }
}
