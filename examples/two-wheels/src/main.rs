//! Two wheels, in simulation: `cargo run --release`.
//!
//! [`robot`] is the robot. Here stands what the simulator must know of it beyond that, and that is
//! all: the command line, the tables and the report come from `rc10-cli`.

mod robot;

use std::process::ExitCode;

use rc10_cli::{Description, Event, Motor, Robot, Script};
use rc10_motor::AttachError;
use rc10_motor::dji::M3508;

use robot::{SCRIPT, TwoWheels, WHEELS, drive};

fn main() -> ExitCode {
    rc10_cli::main_for(&description(), |command| {
        let mut robot = TwoWheels::new()?;
        command.run(ready(&mut robot)?)
    })
}

fn ready(robot: &mut TwoWheels) -> Result<Robot<'_>, AttachError> {
    let (shared, bus) = robot.start()?;
    let robot = Robot::new(description()).bus(bus, &shared.bus).task(drive(shared));
    // A value of the robot's own: a plot and a line in the tables.
    Ok(robot.signal("distance by its wheels", "m", |_| shared.distance()))
}

fn description() -> Description {
    // A robot of 10 kg on wheels of 76 mm radius: 0.029 kg m² for each.
    let wheel = |(label, id, direction)| Motor {
        direction,
        inertia: 0.029,
        ..Motor::new(label, 1, &M3508, id)
    };
    Description {
        motors: WHEELS.map(wheel).into(),
        buses: 1,
        script: Script {
            events: SCRIPT.map(|(at, label, _)| Event { at, label }).into(),
            repeats_after: None,
        },
        ..Description::default()
    }
}

#[cfg(test)]
mod tests {
    use rc10_cli::simulate::simulate;
    use rc10_motor::rc10_can::Micros;

    use super::*;

    #[test]
    fn both_wheels_reach_every_speed_of_the_script() {
        let mut robot = TwoWheels::new().unwrap();
        let run = simulate(ready(&mut robot).unwrap(), 1, Micros::from_millis(2000)).unwrap();
        for (millis, speeds) in [(950, [200.0, 200.0]), (1450, [-60.0, 60.0]), (2000, [120.0; 2])] {
            for (wheel, rpm) in run.motors.iter().zip(speeds) {
                // The motion of the simulated shaft, not the robot's feedback.
                let real = wheel.samples[millis / 10 - 1].rpm;
                assert!((real - rpm).abs() < 4.0, "{} at {millis} ms: {real}", wheel.motor.label);
            }
        }
        // 0.9 s forward at 200 rpm, half a second turning, half a second at 120 rpm.
        let metres = run.signals[0].last.unwrap();
        assert!((1.3..2.0).contains(&metres), "{metres} m");
        let lost = run.buses[0].last.refused + run.buses[0].last.replaced;
        assert_eq!((run.buses[0].last.ticks, lost), (2000, 0));
    }
}
