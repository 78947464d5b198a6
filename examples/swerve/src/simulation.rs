//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_cli::run::build::build_firmware_of;
use rc10_cli::{Description, RemoteControl, Robot};
use rc10_tasks::status;
use rc10_time::Micros;

use crate::plant::{SCRIPT, base, plant};
use crate::table::RECEIVER;
use crate::{Motors, Shared, task};

/// The description of the robot.
#[must_use]
pub fn description() -> Description {
    Description {
        base: Some(base()),
        remote: Some(RemoteControl::new(RECEIVER, &SCRIPT, Some(Micros::from_millis(6200)))),
        firmware: Some(|board| build_firmware_of("swerve-firmware", board)),
        ..Description::of(plant)
    }
}

/// The robot with its tasks, before it runs.
///
/// # Errors
/// None that this declaration has.
pub fn robot<'r>(shared: &'r Shared<'_>, motors: &'r mut Motors) -> anyhow::Result<Robot<'r>> {
    let robot = Robot::of(description(), motors.start(&shared.switch)?, shared).estimate([
        "odometry x",
        "odometry y",
        "odometry heading",
    ]);
    Ok(robot.task(task::run(shared)).task(status::run(shared)))
}
