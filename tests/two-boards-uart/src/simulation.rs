//! Both boards for the tools on a PC.

use rc10::sim::prelude::*;
use rc10::tasks::boards::Role;

use crate::{BOARDS, follower, leader};

impl Simulated for leader::Robot {
    const TWINS: &'static [Twin] = &[Twin::Board("follower")];

    fn description() -> Description {
        Description {
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, None)),
            partner: Some(Partner::of::<follower::Robot>(BOARDS, Role::Leads)),
            ..Description::of_program::<Self>(|_| Plant::inertia(0.02))
        }
    }
}

impl Simulated for follower::Robot {
    const TWINS: &'static [Twin] = &[Twin::Board("leader")];

    fn description() -> Description {
        Description {
            partner: Some(Partner::of::<leader::Robot>(BOARDS, Role::Follows)),
            ..Description::of_program::<Self>(|_| Plant::inertia(0.01))
        }
    }
}

/// The operator's controls, from these milliseconds on.
pub const SCRIPT: [ScriptLine; 3] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(100, "arm", ARMED),
    ScriptLine::new(200, "turn", Controls { left: Stick { x: 0.0, y: 0.6 }, ..ARMED }),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;
