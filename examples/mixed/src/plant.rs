//! What is on the motors' shafts.

use rc10_cli::Plant;

use crate::table::Name;

/// Inertias in kg m² at the output shaft; our estimates.
#[must_use]
pub fn plant(name: Name) -> Plant {
    Plant::inertia(match name {
        Name::Wheel => 0.003,
        Name::Arm | Name::Hip | Name::Turret => 0.02,
        Name::Wrist => 0.005,
        Name::Flywheel => 0.03,
        _ => 0.01,
    })
}
