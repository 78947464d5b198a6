//! The robot for the tools on a PC: the loads of its motors, and the operator's script.

use rc10::sim::prelude::*;

use crate::{BASE, Name, Robot};

impl Simulated for Robot {
    fn description() -> Description {
        Description {
            base: Some(Base::of(BASE.wheels, &BASE.geometry)),
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, Some(Micros::from_millis(5000)))),
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// kg m² and N m at the output shaft. The wheels get theirs from the base.
fn plant(name: Name) -> Plant {
    match name {
        Name::Feeder => Plant::inertia(0.002),
        _ => Plant::default(),
    }
}

/// The operator's controls, from these milliseconds on.
const SCRIPT: [ScriptLine; 6] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(100, "arm", ARMED),
    ScriptLine::new(200, "forward", Controls { left: Stick { x: 0.0, y: 0.6 }, ..ARMED }),
    ScriptLine::new(1200, "to the left", Controls { left: Stick { x: -0.6, y: 0.0 }, ..ARMED }),
    ScriptLine::new(2200, "spin, feed", Controls { right: SPIN, left_switch: Switch::Up, ..ARMED }),
    ScriptLine::new(3200, "stand", ARMED),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;
/// Counter-clockwise.
const SPIN: Stick = Stick { x: -0.5, y: 0.0 };
