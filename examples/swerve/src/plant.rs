//! The loads of the motors, and the operator's script.

use rc10_cli::robot::remote::ScriptLine;
use rc10_cli::{Base, Plant};
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_sim::{Chassis, Steering, Wheel};
use rc10_time::Micros;

use crate::table::{AHEAD, BASE, DRIVES, Name, STEERS};

/// Drives and steering get theirs from the base. The encoders of the steering say zero at power-on: so
/// each wheel looks another way then.
#[must_use]
pub fn plant(name: Name) -> Plant {
    Plant { rotor: STEERS.contains(&name).then_some(0.0), ..Plant::default() }
}

/// The base, by the measures that the robot has.
#[must_use]
pub fn base() -> Base {
    let steering = Some(Steering::default());
    let wheels = BASE.geometry.places().iter().zip(AHEAD).map(|(place, ahead)| {
        let [x, y, radius] = [place.x, place.y, BASE.geometry.radius()].map(f64::from);
        // Where it looks while its encoder says zero.
        let direction = -f64::from(ahead.degrees().get()).to_radians();
        Wheel { direction, steering, ..Wheel::plain(x, y, radius) }
    });
    let [mass, yaw_inertia] = [BASE.body.mass_kg, BASE.body.yaw_inertia_kg_m2].map(f64::from);
    let chassis = Chassis { mass, yaw_inertia, ..Chassis::on(wheels.collect()) };
    Base::new(DRIVES, chassis).with_steering(STEERS)
}

/// The operator's controls, from these times on.
pub const SCRIPT: [ScriptLine; 8] = [
    at(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    at(100, "arm", ARMED),
    at(200, "forward", moves(1.0, 0.0, 0.0)),
    at(1200, "back", moves(-1.0, 0.0, 0.0)),
    at(2200, "to the left", moves(0.0, 1.0, 0.0)),
    at(3200, "spin", moves(0.0, 0.0, 2.0)),
    at(4200, "a curve", moves(1.0, 0.0, 1.0)),
    at(5200, "stand", ARMED),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;

const fn at(millis: u64, label: &'static str, controls: Controls) -> ScriptLine {
    ScriptLine { at: Micros::from_millis(millis), label, controls }
}

/// Forward and to the left, m/s; counter-clockwise, rad/s.
const fn moves(forward: f64, left: f64, turn: f64) -> Controls {
    let full = BASE.full_stick;
    let stick = Stick { x: -left / full.vy as f64, y: forward / full.vx as f64 };
    Controls { left: stick, right: Stick { x: -turn / full.wz as f64, y: 0.0 }, ..ARMED }
}
