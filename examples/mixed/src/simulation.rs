//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_cli::emulate::build_firmware_of;
use rc10_cli::{Description, Event, Robot, Script};
use rc10_motor::Started;
use rc10_motor::rc10_can::Micros;
use rc10_tasks::status;

use crate::plant::plant;
use crate::table::{BUSES, REPLY};
use crate::task::{self, ARMED_AT, SCRIPT};
use crate::{Motors, Shared};

/// Its description.
#[must_use]
pub fn description() -> Description {
    let event = |&(at, label, _): &(u32, &'static str, _)| Event {
        at: Micros::from_millis(at.into()),
        label,
    };
    let armed = Event { at: Micros::from_millis(ARMED_AT), label: "arm" };
    Description {
        script: Script {
            events: std::iter::once(armed).chain(SCRIPT.iter().map(event)).collect(),
            repeats_after: None,
        },
        firmware: Some(|| build_firmware_of("mixed-firmware")),
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
/// As [`robot`].
pub fn with<'r>(
    shared: &'r Shared<'_>,
    started: Started<'r, BUSES, 1>,
) -> anyhow::Result<Robot<'r>> {
    let (Started { buses, lines: [line] }, ports) = (started, shared.ports);
    let robot = Robot::new(description()).line(line.with_reply_timeout(REPLY)?, &ports.lines[0]);
    let robot =
        std::iter::zip(buses, &ports.buses).fold(robot, |robot, (bus, port)| robot.bus(bus, port));
    Ok(robot.switch(&shared.switch).task(task::run(shared)).task(status::run(shared, [])))
}
