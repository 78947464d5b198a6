use rc10_conformance::Declaration;
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_sim::EscFault;
use rc10_sim::unitree_module::{UnitreeModule, plant};

use super::{Check, unitree_line};

/// Each motor behind a module of its own: [`UnitreeModule`]s are told apart by their number.
pub fn go_m8010<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration {
        untold_faults: vec![(
            EscFault::CommunicationLost,
            "its cable to the module is off: the module is silent about it, and the motor is lost",
        )],
        ..unitree_line::declared(direction)
    };
    C::check(
        &declared,
        |motor| GoModule::new(ModuleConfig::new(3, motor).with_direction(direction)).unwrap(),
        |wire, motor| {
            let module = UnitreeModule::new(3).unwrap();
            wire.add(module.motor(motor).unwrap(), plant().with_load_inertia(0.01))
        },
    )
}
