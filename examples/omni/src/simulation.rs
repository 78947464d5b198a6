//! The robot for the tools on a PC: the loads of its motors, and the operator's script.

use crate::Robot;
use crate::table::{BASE, Name};
use rc10::sim::prelude::*;

impl Simulated for Robot {
    fn description() -> Description {
        Description {
            base: Some(Base::of(BASE.wheels, &BASE.geometry).with_mass(MASS)),
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, Some(SCRIPT_LENGTH))),
            yaw: Some("heading"),
            mechanisms: vec![
                Shape::arm("arm", [(Name::Arm, 0.0, 1.0)]),
                Shape::turret("turret", Name::Turret, 0.0),
            ],
            estimate: Some(["odometry x", "odometry y", "odometry heading"]),
            reference: Some(["path x", "path y", "path heading"]),
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// Mass of the robot, kg; our estimate.
pub const MASS: f64 = 12.0;

/// At the output shaft; our estimates. The wheels get theirs from the base.
#[must_use]
pub fn plant(name: Name) -> Plant {
    match name {
        // Level at zero, on a stop, where its weight pulls it to.
        Name::Arm => Plant {
            nonlinear: Nonlinear { gravity_torque: 0.5, ..Nonlinear::NONE },
            travel: Some([-5.0, 130.0]),
            ..Plant::inertia(0.02)
        },
        Name::Turret => Plant::inertia(0.02),
        Name::Flywheel => Plant::inertia(0.001),
        _ => Plant::default(),
    }
}

/// Period of the script.
pub const SCRIPT_LENGTH: Micros = Micros::from_millis(10_000);

/// The operator's controls, from these times on.
pub const SCRIPT: [ScriptLine; 12] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(100, "arm", ARMED),
    ScriptLine::new(200, "forward", Controls { left: stick(0.0, 1.0), ..ARMED }),
    ScriptLine::new(1000, "to the left", Controls { left: stick(-1.0, 0.0), ..ARMED }),
    ScriptLine::new(1800, "spin, arm up", Controls { right: stick(-2.0, 90.0), ..ARMED }),
    ScriptLine::new(2600, "flywheel and turret", SHOOTING),
    ScriptLine::new(3000, "along the path", Controls { right_switch: Switch::Up, ..SHOOTING }),
    ScriptLine::new(
        4000,
        "arm down",
        Controls { right: stick(0.0, -90.0), right_switch: Switch::Up, ..SHOOTING },
    ),
    ScriptLine::new(4400, "arm stays", Controls { dial: 0.5, left_switch: Switch::Up, ..ALONG }),
    ScriptLine::new(7000, "flywheel off, arm and turret home", ALONG),
    ScriptLine::new(9200, "by hand: back", Controls { left: stick(0.0, -0.5), ..ARMED }),
    ScriptLine::new(9600, "stand", ARMED),
];

/// Armed, sticks let go.
pub const ARMED: Controls = Controls { right_switch: Switch::Middle, ..Controls::REST };
/// Along the path.
pub const ALONG: Controls = Controls { right_switch: Switch::Up, ..ARMED };
const SHOOTING: Controls = Controls { left_switch: Switch::Up, dial: 0.5, ..ARMED };

/// A stick: to the side and away: m/s for the left stick; rad/s and degrees per second for the right one.
#[must_use]
pub const fn stick(side: f64, away: f64) -> Stick {
    let full = if away.abs() > 2.0 { [BASE.full_stick.wz as f64, 90.0] } else { [1.5, 1.5] };
    Stick { x: side / full[0], y: away / full[1] }
}
