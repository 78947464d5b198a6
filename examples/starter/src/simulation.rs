//! The robot for the tools: its tasks, the loads of its motors, and the operator's script.

use rc10_cli::robot::base::Base;
use rc10_cli::robot::remote::ScriptLine;
use rc10_cli::run::build::build_firmware_in;
use rc10_cli::{Description, Plant, RemoteControl, Robot};
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_tasks::status;
use rc10_time::Micros;

use crate::table::{BASE, Name, RECEIVER};
use crate::{Motors, Shared, task};

/// The description of the robot.
#[must_use]
pub fn description() -> Description {
    Description {
        base: Some(Base::of(BASE.wheels, &BASE.geometry)),
        remote: Some(RemoteControl::new(RECEIVER, &SCRIPT, Some(Micros::from_millis(5000)))),
        firmware: Some(|board| build_firmware_in(env!("CARGO_MANIFEST_DIR"), board)),
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

/// kg m² and N m at the output shaft. The wheels get theirs from the base.
fn plant(name: Name) -> Plant {
    match name {
        Name::Feeder => Plant::inertia(0.002),
        _ => Plant::default(),
    }
}

/// The operator's controls, from these times on.
const SCRIPT: [ScriptLine; 6] = [
    at(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    at(100, "arm", ARMED),
    at(200, "forward", Controls { left: Stick { x: 0.0, y: 0.6 }, ..ARMED }),
    at(1200, "to the left", Controls { left: Stick { x: -0.6, y: 0.0 }, ..ARMED }),
    at(2200, "spin, feed", Controls { right: SPIN, left_switch: Switch::Up, ..ARMED }),
    at(3200, "stand", ARMED),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;
/// Counter-clockwise.
const SPIN: Stick = Stick { x: -0.5, y: 0.0 };

const fn at(millis: u64, label: &'static str, controls: Controls) -> ScriptLine {
    ScriptLine { at: Micros::from_millis(millis), label, controls }
}
