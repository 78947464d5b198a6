//! The robot for the tools on a PC: the loads of its motors, and the script.

use rc10::sim::prelude::*;
use rc10::sim::{Event, Script};

use crate::Robot;
use crate::table::Name;
use crate::task::SCRIPT;

impl Simulated for Robot {
    fn description() -> Description {
        let event = |&(at, label, _): &(u32, &'static str, _)| Event {
            at: Micros::from_millis(at.into()),
            label,
        };
        Description {
            script: Script { events: SCRIPT.iter().map(event).collect(), repeats_after: None },
            remote: Some(RemoteControl::of::<Self>(&HANDS, None)),
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// Inertias in kg m² at the output shaft; our estimates.
fn plant(name: Name) -> Plant {
    Plant::inertia(match name {
        Name::Wheel => 0.003,
        Name::Arm | Name::Hip | Name::Turret => 0.02,
        Name::Wrist => 0.005,
        Name::Flywheel => 0.03,
        _ => 0.01,
    })
}

/// The operator's controls: they arm the robot.
const HANDS: [ScriptLine; 2] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..Controls::REST }),
    ScriptLine::new(100, "arm", Controls::REST),
];
