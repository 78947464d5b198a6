//! The robot of `rc10-robot`, for the tools. It is the robot of the `rc10` command.

use rc10_can::Micros;
use rc10_robot::driver::{EARLIEST_START, SCRIPT, SCRIPT_LENGTH};
use rc10_robot::table::{BASE, BUSES, Entry, LIFT, MOTORS, Name, WHEELS};
use rc10_robot::{Bus, Io, chassis, driver, mechanisms, status};
use rc10_sim::Chassis;

use crate::emulate::build_firmware;
use crate::recording::Event;
use crate::robot::{Base, Description, Device, Motor, Place, Robot, Script};

/// What the tools must know of it.
#[must_use]
pub fn description() -> Description {
    let chassis = Chassis {
        wheel_radius: BASE.wheel_radius.into(),
        half_length: BASE.half_wheelbase.into(),
        half_width: BASE.half_track.into(),
        ..Chassis::default()
    };
    let event = |&(at, label, _): &(u32, &'static str, _)| Event {
        at: Micros::from_millis(EARLIEST_START + u64::from(at)),
        label,
    };
    Description {
        motors: MOTORS.iter().map(motor).collect(),
        buses: BUSES as u8,
        lines: 0,
        base: Some(Base { wheels: WHEELS.map(|name| name as usize), chassis }),
        script: Script {
            events: SCRIPT.iter().map(event).collect(),
            repeats_after: Some(Micros::from_millis(SCRIPT_LENGTH.into())),
        },
        firmware: Some(build_firmware),
    }
}

fn motor(entry: &Entry) -> Motor {
    // kg m² and N m at the output shaft; our estimates. The wheels get theirs from the base, and
    // the weight of the lift pulls every one of its shafts down.
    let (inertia, load) = match entry.name {
        Name::Yaw => (0.02, 0.0),
        Name::Pitch => (0.01, 0.0),
        Name::Feeder => (0.002, 0.0),
        name if LIFT.contains(&name) => (0.01, -1.0),
        _ => (0.0, 0.0),
    };
    let &Entry { label, bus, model, id, direction, rate, .. } = entry;
    let device = Device::Dji { model, id, rate };
    Motor { direction, inertia, load, ..Motor::with_device(label, Place::Bus(bus), device) }
}

/// The robot with all its tasks, before it runs.
#[must_use]
pub fn robot<'r>(io: &'r Io<'_>, buses: [Bus<'r>; BUSES]) -> Robot<'r> {
    let robot = Robot::new(description());
    let robot =
        buses.into_iter().zip(io.buses).fold(robot, |robot, (bus, port)| robot.bus(bus, port));
    robot
        .task(chassis::run(io))
        .task(mechanisms::run(io))
        .task(driver::run(io))
        .task(status::run(io))
}
