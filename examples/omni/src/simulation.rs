//! The robot as the tools see it, and with its tasks in a simulated world.

use rc10_can::Micros;
use rc10_cli::emulate::build_firmware_of;
use rc10_cli::remote::{Line, ReceiverPort};
use rc10_cli::{Description, Plant, Receiver, RemoteControl, Robot};
use rc10_motor::Started;
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_tasks::{remote, status};

use crate::table::{FULL_STICK, Name, RECEIVER};
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

/// At the output shaft; our estimates. A wheel carries a quarter of 12 kg.
fn plant(name: Name) -> Plant {
    match name {
        // It stands on a stop at zero, and its weight pulls it there.
        Name::Arm => Plant { load: -0.5, travel: Some([-5.0, 130.0]), ..Plant::inertia(0.02) },
        Name::Turret => Plant::inertia(0.02),
        Name::Flywheel => Plant::inertia(0.003),
        _ => Plant::inertia(0.017),
    }
}

/// What hands do, from when on.
pub const SCRIPT: [Line; 8] = [
    at(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    at(100, "arm", ARMED),
    at(200, "forward", Controls { left: stick(0.0, 1.0), ..ARMED }),
    at(1000, "to the left", Controls { left: stick(-1.0, 0.0), ..ARMED }),
    at(1800, "spin, arm up", Controls { right: stick(-2.0, 90.0), ..ARMED }),
    at(2600, "flywheel and turret", Controls { left_switch: Switch::Up, dial: 0.5, ..ARMED }),
    at(4000, "arm down", Controls { right: stick(0.0, -90.0), ..ARMED }),
    at(4800, "stand", ARMED),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;

const fn at(millis: u64, label: &'static str, controls: Controls) -> Line {
    Line { at: Micros::from_millis(millis), label, controls }
}

/// To the side and away: m/s for the left stick; rad/s and degrees per second for the right one.
const fn stick(side: f64, away: f64) -> Stick {
    let full = if away.abs() > 2.0 { [FULL_STICK.wz as f64, 90.0] } else { [1.5, 1.5] };
    Stick { x: side / full[0], y: away / full[1] }
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
