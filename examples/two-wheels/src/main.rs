//! Two wheels, in simulation: `cargo run`.
//!
//! [`robot`] is the robot. Here stands what the simulator must know of it beyond that, and that is
//! all: the command line, the tables and the report come from `rc10::sim`.

mod robot;

use std::process::ExitCode;

use rc10::motor::{SetupError, Started};
use rc10::sim::{Description, Event, Plant, Robot, Script};

use robot::{Motors, Name, SCRIPT, Shared, drive};

fn main() -> ExitCode {
    rc10::sim::main_for(&description(), |command| {
        let (shared, mut motors) = (Shared::new(), Motors::new());
        command.run(ready(&shared, &mut motors)?)
    })
}

fn ready<'r>(shared: &'r Shared, motors: &'r mut Motors) -> Result<Robot<'r>, SetupError> {
    let Started { buses: [bus], .. } = motors.start(&shared.switch)?;
    let robot = Robot::new(description()).bus(bus, &shared.ports.buses[0]).task(drive(shared));
    // A value of the robot's own: a plot and a line in the tables.
    Ok(robot.signal("distance by its wheels", "m", |_| shared.distance()))
}

fn description() -> Description {
    Description {
        script: Script {
            events: SCRIPT.map(|(at, label, _)| Event { at, label }).into(),
            repeats_after: None,
        },
        // A robot of 10 kg on wheels of 76 mm radius: 0.029 kg m² for each.
        ..Description::of(|_: Name| Plant::inertia(0.029))
    }
}

#[cfg(test)]
mod tests {
    use rc10::sim::run::simulate::simulate;
    use rc10::time::Micros;

    use super::*;

    #[test]
    fn both_wheels_reach_every_speed_of_the_script() {
        let (shared, mut motors) = (Shared::new(), Motors::new());
        let run =
            simulate(ready(&shared, &mut motors).unwrap(), 1, Micros::from_millis(2000)).unwrap();
        // 1.6 m/s, 2.4 rad/s and 0.9 m/s, on wheels of 76 mm that are 400 mm apart.
        for (millis, speeds) in [(950, [201.0, 201.0]), (1450, [-60.3, 60.3]), (2000, [113.1; 2])] {
            for (wheel, rpm) in run.motors.iter().zip(speeds) {
                // The motion of the simulated shaft, not the robot's feedback.
                let real = wheel.samples[millis / 10 - 1].rpm;
                assert!((real - rpm).abs() < 4.0, "{} at {millis} ms: {real}", wheel.motor.label);
            }
        }
        // 0.9 s forward at 1.6 m/s, half a second turning, half a second at 0.9 m/s.
        let metres = run.signals[0].last.unwrap();
        assert!((1.3..2.0).contains(&metres), "{metres} m");
        let lost = run.buses[0].last.refused + run.buses[0].last.replaced;
        assert_eq!((run.buses[0].last.ticks, lost), (1999, 0));
    }
}
