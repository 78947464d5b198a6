use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::{GoModule, LARGEST_TORQUE, ModuleConfig};
use rc10_motor::{Impedance, Target};
use rc10_sim::EscFault;
use rc10_sim::unitree_module::{UnitreeModule, plant};

use super::Check;

/// Each motor behind a module of its own: [`UnitreeModule`]s are told apart by their number.
pub fn go_m8010<C: Check>(direction: Direction) -> Result<(), String> {
    let spring = Impedance { angle: Degrees::new(45.0), kp: 30.0, kd: 1.0, ..Impedance::default() };
    let declared = Declaration {
        direction,
        coasts_freely: Claim::Cannot(
            "disabled it is locked, which is assumed to short its winding",
        ),
        // For a moment, until the speed loop's integral carries the load.
        hold_gives: 14.0,
        untold_faults: vec![(
            EscFault::CommunicationLost,
            "its cable to the module is off: the module is silent about it, and the motor is lost",
        )],
        ..Declaration::new([0, 1], Rpm::new(100.0), LARGEST_TORQUE)
    }
    .with_trials(&[
        Trial::new(Target::Speed(Rpm::new(100.0)), 2.0, 400),
        Trial::new(Target::Speed(Rpm::new(-50.0)), 2.0, 400),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 3000),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.0, 4000),
        Trial::new(Target::Torque(NewtonMetres::new(-12.0)), 0.1, 100),
        Trial::new(Target::Impedance(spring), 1.0, 2000),
    ]);
    C::check(
        &declared,
        |motor| GoModule::new(ModuleConfig::new(3, motor).with_direction(direction)).unwrap(),
        |wire, motor| {
            let module = UnitreeModule::new(3).unwrap();
            wire.add(module.motor(motor).unwrap(), plant().with_load_inertia(0.01))
        },
    )
}
