//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_cli::run::build::build_firmware_of;
use rc10_cli::{ContactPart, Description, RemoteControl, Robot};
use rc10_sim::Closed;
use rc10_tasks::status;

use crate::plant::{HOIST, HOIST_SWITCH, INDEX, SCRIPT, plant};
use crate::table::RECEIVER;
use crate::{Motors, Name, Shared, task};

/// The description of the robot.
#[must_use]
pub fn description() -> Description {
    Description {
        remote: Some(RemoteControl::new(RECEIVER, &SCRIPT, None)),
        contacts: vec![ContactPart::new(Name::Feeder, INDEX), hoist_switch(HOIST[0])],
        firmware: Some(|board| build_firmware_of("lift-firmware", board)),
        ..Description::of(plant)
    }
}

/// The switch of the hoist, for a bottom there: wired by its contact that opens.
#[must_use]
pub fn hoist_switch(bottom: f64) -> ContactPart {
    ContactPart::new(Name::Hoist, Closed::Below(bottom + HOIST_SWITCH)).opening()
}

/// The robot with its tasks, before it runs.
///
/// # Errors
/// None that this declaration has.
pub fn robot<'r>(shared: &'r Shared<'_>, motors: &'r mut Motors) -> anyhow::Result<Robot<'r>> {
    let robot = Robot::of(description(), motors.start(&shared.switch)?, shared);
    let robot = robot.contacts(|[index, bottom]| task::run(shared, index, bottom));
    let robot = robot.task(status::run(shared));
    Ok(robot)
}
