//! The robot for the tools on a PC: the loads of its motors, and the operator's script.

use rc10::sim::prelude::*;
use rc10::sim::simulator::{Chassis, Steering, Wheel};

use crate::Robot;
use crate::table::{AHEAD, BASE, DRIVES, Name, STEERS};

impl Simulated for Robot {
    fn description() -> Description {
        Description {
            base: Some(base()),
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, Some(Micros::from_millis(6200)))),
            estimate: Some(["odometry x", "odometry y", "odometry heading"]),
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// Drives and steering get theirs from the base. The encoders of the steering say zero at power-on: so
/// each wheel looks another way then.
fn plant(name: Name) -> Plant {
    Plant { rotor: STEERS.contains(&name).then_some(0.0), ..Plant::default() }
}

/// The base, by the measures that the robot has.
fn base() -> Base {
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
const SCRIPT: [ScriptLine; 8] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(100, "arm", ARMED),
    ScriptLine::new(200, "forward", moves(1.0, 0.0, 0.0)),
    ScriptLine::new(1200, "back", moves(-1.0, 0.0, 0.0)),
    ScriptLine::new(2200, "to the left", moves(0.0, 1.0, 0.0)),
    ScriptLine::new(3200, "spin", moves(0.0, 0.0, 2.0)),
    ScriptLine::new(4200, "a curve", moves(1.0, 0.0, 1.0)),
    ScriptLine::new(5200, "stand", ARMED),
];

/// Armed, sticks let go.
const ARMED: Controls = Controls::REST;

/// Forward and to the left, m/s; counter-clockwise, rad/s.
const fn moves(forward: f64, left: f64, turn: f64) -> Controls {
    let full = BASE.full_stick;
    let stick = Stick { x: -left / full.vy as f64, y: forward / full.vx as f64 };
    Controls { left: stick, right: Stick { x: -turn / full.wz as f64, y: 0.0 }, ..ARMED }
}
