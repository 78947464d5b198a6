//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_cli::run::build::build_firmware_of;
use rc10_cli::{Description, Event, RemoteControl, Robot, Script};
use rc10_motor::Started;
use rc10_motor::rc10_time::Micros;
use rc10_tasks::status;

use crate::plant::{HANDS, plant};
use crate::table::{BUSES, RECEIVER, REPLY};
use crate::task::{self, SCRIPT};
use crate::{Motors, Shared};

/// The description of the robot.
#[must_use]
pub fn description() -> Description {
    let event = |&(at, label, _): &(u32, &'static str, _)| Event {
        at: Micros::from_millis(at.into()),
        label,
    };
    Description {
        script: Script { events: SCRIPT.iter().map(event).collect(), repeats_after: None },
        remote: Some(RemoteControl::new(RECEIVER, &HANDS, None)),
        firmware: Some(|board| build_firmware_of("mixed-firmware", board)),
        ..Description::of(plant)
    }
}

/// The robot with its tasks, before it runs.
///
/// # Errors
/// None that this declaration has.
pub fn robot<'r>(shared: &'r Shared<'_>, motors: &'r mut Motors) -> anyhow::Result<Robot<'r>> {
    with(shared, motors.start(&shared.switch)?)
}

/// The same with buses and a line that have their motors.
///
/// # Errors
/// Those of [`robot`].
pub fn with<'r>(
    shared: &'r Shared<'_>,
    started: Started<'r, BUSES, 1>,
) -> anyhow::Result<Robot<'r>> {
    let Started { buses, lines: [line] } = started;
    let started = Started { buses, lines: [line.with_reply_timeout(REPLY)?] };
    let robot = Robot::of(description(), started, shared);
    Ok(robot.task(task::run(shared)).task(status::run(shared)))
}
