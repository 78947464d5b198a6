use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::{GoM8010, LARGEST_TORQUE, LineConfig};
use rc10_motor::{Impedance, Target};
use rc10_sim::unitree_line::{GoM8010 as Device, plant};

use super::Check;

/// The same on a line and behind a module.
pub fn declared(direction: Direction) -> Declaration {
    let spring = Impedance { angle: Degrees::new(45.0), kp: 30.0, kd: 1.0, ..Impedance::default() };
    Declaration {
        direction,
        coasts_freely: Claim::Cannot(
            "disabled it is locked, which is assumed to short its winding",
        ),
        // For a moment, when the load changes its way: until the speed loop's integral carries it.
        hold_gives: 14.0,
        ..Declaration::new([0, 1], Rpm::new(100.0), LARGEST_TORQUE)
    }
    .with_trials(&[
        Trial::new(Target::Speed(Rpm::new(100.0)), 2.0, 400),
        Trial::new(Target::Speed(Rpm::new(-50.0)), 2.0, 400),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 3000),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.0, 4000),
        Trial::new(Target::Torque(NewtonMetres::new(-12.0)), 0.1, 100),
        Trial::new(Target::Impedance(spring), 1.0, 2000),
    ])
}

/// A light load on its shaft.
pub fn go_m8010<C: Check>(direction: Direction) -> Result<(), String> {
    C::check_line(
        &declared(direction),
        |id| GoM8010::new(LineConfig::new(id).with_direction(direction)).unwrap(),
        |wire, id| wire.add(Device::new(id), plant().with_load_inertia(0.01)),
    )
}
