//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_can::Micros;
use rc10_cli::emulate::build_firmware_of;
use rc10_cli::remote::ReceiverPort;
use rc10_cli::{Description, Receiver, RemoteControl, Robot};
use rc10_motor::Started;
use rc10_tasks::{remote, status};

use crate::plant::{SCRIPT, plant};
use crate::table::RECEIVER;
use crate::{Motors, Shared, task};

/// Its description. The remote is at UART5, or at PF8: `firmware/src/board.rs`.
#[must_use]
pub fn description() -> Description {
    Description {
        remote: Some(RemoteControl {
            receiver: RECEIVER,
            receivers: Receiver::ALL.into(),
            uart: 5,
            pulse_pin: ('F', 8),
            script: SCRIPT.into(),
            repeats_after: Some(Micros::from_millis(5000)),
            lost: Vec::new(),
        }),
        firmware: Some(|| build_firmware_of("omni-firmware")),
        ..Description::of(plant)
    }
}

/// The robot with its tasks, before it runs.
///
/// # Errors
/// None that this declaration has.
pub fn robot<'r>(shared: &'r Shared<'_>, motors: &'r mut Motors) -> anyhow::Result<Robot<'r>> {
    let Started { buses, .. } = motors.start(&shared.switch)?;
    let robot = std::iter::zip(buses, &shared.ports.buses)
        .fold(Robot::new(description()), |robot, (bus, port)| robot.bus(bus, port));
    let robot = robot.switch(&shared.switch).task(task::run(shared)).task(status::run(shared, []));
    Ok(robot.remote(&shared.remote_reception, async |receiver, port| match port {
        ReceiverPort::Serial(port) => remote::listen(shared, receiver, port).await,
        ReceiverPort::Pulses(mut port) => {
            remote::listen_pulses(shared, async || port.rising_edge().await).await
        }
    }))
}
