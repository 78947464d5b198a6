//! Both boards for the tools on a PC: what is on the shafts, and an operator's script.

use rc10::sim::prelude::*;
use rc10::tasks::boards::Role;

use crate::boards::BOARDS;
use crate::{chassis, gimbal};

impl Simulated for gimbal::Robot {
    fn description() -> Description {
        Description {
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, Some(Micros::from_millis(5000)))),
            partner: Some(Partner::of::<chassis::Robot>(BOARDS, Role::Leads)),
            mechanisms: vec![Shape::turret("gimbal", gimbal::Name::Yaw, 0.0)],
            // It looks ahead at power-on.
            ..Description::of_program::<Self>(|_| Plant {
                rotor: Some(0.0),
                ..Plant::inertia(0.02)
            })
        }
    }
}

impl Simulated for chassis::Robot {
    fn description() -> Description {
        Description {
            base: Some(Base::of(chassis::BASE.wheels, &chassis::BASE.geometry).with_mass(18.0)),
            partner: Some(Partner::of::<gimbal::Robot>(BOARDS, Role::Follows)),
            ..Description::of_program::<Self>(|_| Plant::default())
        }
    }
}

/// The operator's controls, from these milliseconds on.
pub const SCRIPT: [ScriptLine; 7] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(100, "arm", ARMED),
    ScriptLine::new(200, "forward", Controls { left: Stick { x: 0.0, y: 0.6 }, ..ARMED }),
    ScriptLine::new(
        1200,
        "look to the left",
        Controls { right: Stick { x: -0.5, y: 0.0 }, ..ARMED },
    ),
    ScriptLine::new(2200, "ahead of it", Controls { left: Stick { x: 0.0, y: 0.6 }, ..ARMED }),
    ScriptLine::new(3200, "spin below it", Controls { right: Stick { x: 0.0, y: 0.8 }, ..ARMED }),
    ScriptLine::new(4200, "stand", ARMED),
];

/// Armed, sticks let go.
pub const ARMED: Controls = Controls::REST;
