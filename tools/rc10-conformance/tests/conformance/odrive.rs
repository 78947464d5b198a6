use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::Target;
use rc10_motor::odrive::{Config, Control, InputMode, ODrive, Rates};
use rc10_motor::rc10_app::Direction;
use rc10_sim::odrive::{Axis, Settings};

use super::Check;
use crate::motors::odrive::{WHEEL, plant, with};

/// N m.
const FULL: f32 = 8.0;

const SPEEDS: [Trial; 2] = [
    Trial::new(Target::Speed(Rpm::new(100.0)), 2.0, 500),
    Trial::new(Target::Speed(Rpm::new(-50.0)), 2.0, 500),
];
const ANGLES: [Trial; 2] = [
    Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 3000),
    Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.0, 2500),
];

fn odrive<C: Check>(
    control: Control,
    declared: Declaration,
    direction: Direction,
) -> Result<(), String> {
    let config = Config { rates: Rates::new(1000, 100), direction, ..with(control) };
    C::check(
        &Declaration { direction, ..declared },
        |node| ODrive::new(Config { node, ..config }).unwrap(),
        |wire, node| {
            let settings = Settings {
                heartbeat_every: rc10_time::Micros::from_millis(10),
                ..Settings::new(node)
            };
            wire.add(Axis::new(settings).unwrap(), plant())
        },
    )
}

/// Two heartbeats until it is known to be idle, and then to follow inputs.
fn declared() -> Declaration {
    let declared = Declaration::new([3, 4], Rpm::new(80.0), NewtonMetres::new(FULL));
    Declaration { enables_within: 40, ..declared }
}

pub fn torque<C: Check>(direction: Direction) -> Result<(), String> {
    let torque = Trial::new(Target::Torque(NewtonMetres::new(-4.0)), 0.1, 100);
    let declared = declared().with_trials(&[torque]).with_trials(&SPEEDS).with_trials(&ANGLES);
    odrive::<C>(Control::Torque(WHEEL), declared, direction)
}

pub fn velocity<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration {
        holds: Claim::Cannot("a velocity loop keeps no angle"),
        ..declared().with_trials(&SPEEDS)
    };
    odrive::<C>(Control::Velocity(InputMode::VelocityRamp), declared, direction)
}

pub fn position<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration {
        far: Some(TotalAngle::from_degrees(36_000)),
        // What its current may be rises by 5 % a millisecond; when the axis has braked, its own
        // loops let go faster than that.
        softness: 0.16,
        ..declared().with_trials(&ANGLES)
    };
    odrive::<C>(Control::Position(InputMode::Trapezoid), declared, direction)
}
