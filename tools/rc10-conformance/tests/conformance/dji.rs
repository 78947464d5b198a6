use rc10_app::{Amps, Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::Target;
use rc10_motor::dji::{self, Dji};
use rc10_motor::rc10_app::Direction;
use rc10_sim::{EscConfig, Model, Plant};

use super::Check;

/// All models are driven alike. Each has about the inertia on its shaft that its gains are made for.
fn dji<C: Check>(
    model: &'static dji::Model,
    esc: Model,
    direction: Direction,
    declared: Declaration,
    inertia: f64,
) -> Result<(), String> {
    let trials = [
        Trial::new(Target::Speed(declared.cruise), 2.0, 1500),
        Trial::new(Target::Speed(Rpm::new(-0.5 * declared.cruise.get())), 2.0, 1500),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 3000),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.0, 4000),
    ];
    let plant: Plant = esc.plant().with_load_inertia(inertia);
    C::check(
        &Declaration {
            direction,
            disables: Claim::Cannot("it has no enable command"),
            ..declared.with_trials(&trials)
        },
        |id| Dji::new(dji::Config::new(model, id).with_direction(direction)).unwrap(),
        |wire, id| wire.add_esc(EscConfig { plant, ..EscConfig::new(esc, id) }).unwrap(),
    )
}

pub fn m3508<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration::new([1, 2], Rpm::new(100.0), NewtonMetres::new(6.0))
        .with_trials(&[Trial::new(Target::Current(Amps::new(-10.0)), 0.2, 100)]);
    dji::<C>(&dji::M3508, Model::C620, direction, declared, 0.029)
}

/// The second one is commanded by the other frame.
pub fn m2006<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration::new([1, 5], Rpm::new(100.0), NewtonMetres::new(1.8))
        .with_trials(&[Trial::new(Target::Current(Amps::new(5.0)), 0.1, 100)]);
    dji::<C>(&dji::M2006, Model::C610, direction, declared, 0.002)
}

pub fn gm6020_current<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration::new([1, 2], Rpm::new(60.0), NewtonMetres::new(2.2))
        .with_trials(&[Trial::new(Target::Current(Amps::new(1.5)), 0.05, 100)]);
    dji::<C>(&dji::GM6020_CURRENT, Model::Gm6020Current, direction, declared, 0.01)
}

pub fn gm6020_voltage<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration {
        coasts_freely: Claim::Cannot("no voltage shorts the winding: it turns with a drag"),
        // The winding's inductance.
        stops_within: 30,
        // At standstill a tenth of the voltage is far more than a tenth of the torque.
        softness: 0.25,
        ..Declaration::new([1, 2], Rpm::new(60.0), NewtonMetres::new(2.2))
    }
    .with_trials(&[Trial::new(Target::Duty(0.5), 100.0, 500)]);
    dji::<C>(&dji::GM6020_VOLTAGE, Model::Gm6020Voltage, direction, declared, 0.01)
}
