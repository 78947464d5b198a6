//! The loads of the motors, and the operator's script.

use anyhow::{Context, Result};
use rc10_cli::Plant;
use rc10_cli::robot::remote::ScriptLine;
use rc10_sim::imu::Hwt101;
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_sim::{Base, Nanos, Nonlinear, Serial, World};
use rc10_time::Micros;

use crate::table::{BASE, Name};

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

/// Puts the robot's IMU on the base.
///
/// # Errors
/// Without a base.
pub fn imu(world: &mut World, base: Option<&Base>) -> Result<Serial> {
    let phase = world.chance(Nanos::new(5_000_000));
    let base = base.context("it must stand on a base")?;
    Ok(world.add_serial(Hwt101::SERIAL, Hwt101::new(base, phase)))
}

/// Period of the script.
pub const SCRIPT_LENGTH: Micros = Micros::from_millis(10_000);

/// The operator's controls, from these times on.
pub const SCRIPT: [ScriptLine; 12] = [
    at(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    at(100, "arm", ARMED),
    at(200, "forward", Controls { left: stick(0.0, 1.0), ..ARMED }),
    at(1000, "to the left", Controls { left: stick(-1.0, 0.0), ..ARMED }),
    at(1800, "spin, arm up", Controls { right: stick(-2.0, 90.0), ..ARMED }),
    at(2600, "flywheel and turret", SHOOTING),
    at(3000, "along the path", Controls { right_switch: Switch::Up, ..SHOOTING }),
    at(
        4000,
        "arm down",
        Controls { right: stick(0.0, -90.0), right_switch: Switch::Up, ..SHOOTING },
    ),
    at(4400, "arm stays", Controls { dial: 0.5, left_switch: Switch::Up, ..ALONG }),
    at(7000, "flywheel off, arm and turret home", ALONG),
    at(9200, "by hand: back", Controls { left: stick(0.0, -0.5), ..ARMED }),
    at(9600, "stand", ARMED),
];

/// Armed, sticks let go.
pub const ARMED: Controls = Controls { right_switch: Switch::Middle, ..Controls::REST };
/// Along the path.
pub const ALONG: Controls = Controls { right_switch: Switch::Up, ..ARMED };
const SHOOTING: Controls = Controls { left_switch: Switch::Up, dial: 0.5, ..ARMED };

/// A line of a script, for a world of one's own.
#[must_use]
pub const fn at(millis: u64, label: &'static str, controls: Controls) -> ScriptLine {
    ScriptLine { at: Micros::from_millis(millis), label, controls }
}

/// A stick: to the side and away: m/s for the left stick; rad/s and degrees per second for the right one.
#[must_use]
pub const fn stick(side: f64, away: f64) -> Stick {
    let full = if away.abs() > 2.0 { [BASE.full_stick.wz as f64, 90.0] } else { [1.5, 1.5] };
    Stick { x: side / full[0], y: away / full[1] }
}
