//! The loads of the motors, and the operator's script.

use rc10_cli::Plant;
use rc10_cli::robot::remote::ScriptLine;
use rc10_sim::remote::{Controls, Switch};
use rc10_time::Micros;

use crate::table::Name;

/// Inertias in kg m² at the output shaft; our estimates.
#[must_use]
pub fn plant(name: Name) -> Plant {
    Plant::inertia(match name {
        Name::Wheel => 0.003,
        Name::Arm | Name::Hip | Name::Turret => 0.02,
        Name::Wrist => 0.005,
        Name::Flywheel => 0.03,
        _ => 0.01,
    })
}

/// The operator's controls: they arm the robot.
pub const HANDS: [ScriptLine; 2] = [
    ScriptLine {
        at: Micros::ZERO,
        label: "switches down",
        controls: Controls { right_switch: Switch::Down, ..Controls::REST },
    },
    ScriptLine { at: Micros::from_millis(100), label: "arm", controls: Controls::REST },
];
