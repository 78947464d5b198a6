//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_cli::run::build::build_firmware_of;
use rc10_cli::{Base, Description, RemoteControl, Robot, SerialPart};
use rc10_tasks::{heading, status};

use crate::plant::{MASS, SCRIPT, SCRIPT_LENGTH, imu, plant};
use crate::table::{BASE, RECEIVER};
use crate::{Motors, Shared, task};

/// The description of the robot.
#[must_use]
pub fn description() -> Description {
    Description {
        base: Some(Base::of(BASE.wheels, &BASE.geometry).with_mass(MASS)),
        remote: Some(RemoteControl::new(RECEIVER, &SCRIPT, Some(SCRIPT_LENGTH))),
        serials: vec![SerialPart { label: "IMU", uart: 7, twin: imu }],
        firmware: Some(|board| build_firmware_of("omni-firmware", board)),
        ..Description::of(plant)
    }
}

/// The robot with its tasks, before it runs.
///
/// # Errors
/// None that this declaration has.
pub fn robot<'r>(shared: &'r Shared<'_>, motors: &'r mut Motors) -> anyhow::Result<Robot<'r>> {
    robot_in(description(), shared, motors)
}

/// The same in another world: heavier, or with another operator.
///
/// # Errors
/// Those of [`robot`].
pub fn robot_in<'r>(
    world: Description,
    shared: &'r Shared<'_>,
    motors: &'r mut Motors,
) -> anyhow::Result<Robot<'r>> {
    let robot = Robot::of(world, motors.start(&shared.switch)?, shared)
        .serial(&shared.imu_reception, async |port| heading::listen_for(shared, port).await)
        .yaw("heading", |_| Some(f64::from(shared.own.heading.get())).filter(|yaw| yaw.is_finite()))
        .estimate(["odometry x", "odometry y", "odometry heading"])
        .reference(["path x", "path y", "path heading"]);
    Ok(robot.task(task::run(shared)).task(status::run(shared)))
}
