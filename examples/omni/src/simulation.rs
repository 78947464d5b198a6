//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_can::Micros;
use rc10_cli::emulate::build_firmware_of;
use rc10_cli::{Base, Description, RemoteControl, Robot};
use rc10_tasks::status;

use crate::plant::{MASS, SCRIPT, plant};
use crate::table::{BASE, RECEIVER, WHEELS};
use crate::{Motors, Shared, task};

/// Its description.
#[must_use]
pub fn description() -> Description {
    Description {
        base: Some(Base::of(WHEELS, &BASE).with_mass(MASS)),
        remote: Some(RemoteControl::new(RECEIVER, &SCRIPT, Some(Micros::from_millis(5000)))),
        firmware: Some(|board| build_firmware_of("omni-firmware", board)),
        ..Description::of(plant)
    }
}

/// The robot with its tasks, before it runs.
///
/// # Errors
/// None that this declaration has.
pub fn robot<'r>(shared: &'r Shared<'_>, motors: &'r mut Motors) -> anyhow::Result<Robot<'r>> {
    let robot = Robot::of(description(), motors.start(&shared.switch)?, shared);
    Ok(robot.task(task::run(shared)).task(status::run(shared)))
}
