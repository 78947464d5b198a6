//! The robot for the tools on a PC: the loads of its motors, and the operator's script.

use crate::Robot;
use crate::table::{HOISTED, Name, WEIGHT};
use rc10::sim::prelude::*;
use rc10::sim::simulator::Closed;

impl Simulated for Robot {
    const TWINS: &'static [Twin] = &[
        Twin::Contact("index", || ContactPart::new(Name::Feeder, INDEX)),
        Twin::Contact("bottom", || hoist_switch(HOIST[0])),
    ];

    fn description() -> Description {
        Description {
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, None)),
            mechanisms: vec![
                Shape::lift("lift", Name::LiftLeft, [bottom(Name::LiftLeft), TRAVEL]),
                Shape::lift("hoist", Name::Hoist, [HOIST[0], HOIST[0] + HOIST[1]]),
            ],
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// The switch of the hoist, for a bottom there.
#[must_use]
pub fn hoist_switch(bottom: f64) -> ContactPart {
    ContactPart::new(Name::Hoist, Closed::Below(bottom + HOIST_SWITCH)).opening()
}

/// Where the bottom is, in degrees since power-on: the lift begins above it, and not level.
#[must_use]
pub const fn bottom(name: Name) -> f64 {
    match name {
        Name::LiftLeft => -60.0,
        _ => -45.0,
    }
}

/// Between the bottom and the upper stop, degrees.
pub const TRAVEL: f64 = 1100.0;

/// Where the feeder's marker is, degrees since power-on in any turn. It is found backwards: the pockets
/// stand at its upper end.
pub const INDEX: [f64; 2] = [-110.0, -104.0];

/// Where the bottom of the hoist is, degrees since power-on, and how far it goes up from there.
pub const HOIST: [f64; 2] = [-200.0, 1900.0];
/// Its switch is closed below this height.
pub const HOIST_SWITCH: f64 = 20.0;

/// At the output shaft; our estimates.
#[must_use]
pub fn plant(name: Name) -> Plant {
    match name {
        Name::Feeder => Plant::inertia(0.002),
        Name::Hoist => Plant {
            load: -f64::from(HOISTED),
            travel: Some([HOIST[0], HOIST[0] + HOIST[1]]),
            ..Plant::inertia(0.01)
        },
        lift => Plant {
            load: -f64::from(WEIGHT),
            nonlinear: Nonlinear { backlash: 0.3, ..Nonlinear::NONE },
            travel: Some([bottom(lift), bottom(lift) + TRAVEL]),
            ..Plant::inertia(0.01)
        },
    }
}

/// The operator's controls, from these times on.
pub const SCRIPT: [ScriptLine; 15] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(100, "arm: it homes", ARMED),
    ScriptLine::new(2000, "to the middle", Controls { right: Stick { x: 1.0, y: 0.0 }, ..ARMED }),
    ScriptLine::new(2100, "stick let go", ARMED),
    ScriptLine::new(2600, "hoist up", Controls { dial: 1.0, ..ARMED }),
    ScriptLine::new(3400, "hoist stays", ARMED),
    ScriptLine::new(3600, "feed", FEED),
    ScriptLine::new(3700, "switch back", ARMED),
    ScriptLine::new(4100, "to the top", Controls { right: Stick { x: 0.0, y: 1.0 }, ..ARMED }),
    ScriptLine::new(4200, "feed", FEED),
    ScriptLine::new(4300, "switch back", ARMED),
    ScriptLine::new(5600, "lower slowly", Controls { left: Stick { x: 0.0, y: -0.4 }, ..ARMED }),
    ScriptLine::new(6600, "stay", ARMED),
    ScriptLine::new(7000, "to the bottom", Controls { right: Stick { x: 0.0, y: -1.0 }, ..ARMED }),
    ScriptLine::new(7100, "stick let go", ARMED),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;

const FEED: Controls = Controls { left_switch: Switch::Up, ..ARMED };
