use rc10_app::{Amps, Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::Target;
use rc10_motor::rc10_app::Direction;
use rc10_motor::vesc::{Config, Vesc};
use rc10_sim::vesc::{VescConfig, outrunner_270_kv};
use rc10_sim::{EscFault, Plant};

use super::Check;
use crate::motors::vesc::{config, device, lift, lift_plant};

/// A.
const LIMIT: f32 = 40.0;

fn run<C: Check>(
    declared: &Declaration,
    plant: Plant,
    config: impl Fn(u8) -> Config,
) -> Result<(), String> {
    C::check(
        declared,
        |id| Vesc::new(config(id)).unwrap(),
        |wire, id| {
            let config = VescConfig { plant, ..device(id) };
            wire.add(rc10_sim::vesc::Vesc::new(config).unwrap(), plant)
        },
    )
}

/// No frame of a VESC tells them.
fn untold(declared: Declaration, direction: Direction) -> Declaration {
    let faults = [
        EscFault::OverTemperature,
        EscFault::OverCurrent,
        EscFault::OverVoltage,
        EscFault::UnderVoltage,
        EscFault::Encoder,
    ];
    let untold_faults = faults.map(|fault| (fault, "no CAN frame of a VESC tells a fault")).into();
    Declaration { direction, untold_faults, ..declared }
}

const ALIKE: [Trial; 5] = [
    Trial::new(Target::Coast, 0.01, 50),
    Trial::new(Target::Current(Amps::new(-5.0)), 0.1, 100),
    Trial::new(Target::Duty(-0.2), 20.0, 500),
    Trial::new(Target::Brake(Amps::new(15.0)), 5.0, 3000),
    // It does not brake: it catches what friction has slowed down, and lets it swing.
    Trial::new(Target::Handbrake(Amps::new(20.0)), 300.0, 8000),
];

pub fn vesc<C: Check>(direction: Direction) -> Result<(), String> {
    wheel::<C>(direction, None)
}

/// Its currents are sent as shares of the device's limit.
pub fn vesc_relative<C: Check>(direction: Direction) -> Result<(), String> {
    wheel::<C>(direction, Some(Amps::new(LIMIT)))
}

/// A wheel of 0.5 kg without gearbox.
fn wheel<C: Check>(direction: Direction, relative_to: Option<Amps>) -> Result<(), String> {
    let plant = outrunner_270_kv().with_load_inertia(6e-4);
    let declared = Declaration {
        holds: Claim::Cannot("a still field holds to half its turn: 26 degrees of this shaft"),
        ..Declaration::new([1, 2], Rpm::new(1000.0), NewtonMetres::new(1.4))
    }
    .with_trials(&ALIKE)
    .with_trials(&[Trial::new(Target::Speed(Rpm::new(1000.0)), 60.0, 3000)]);
    run::<C>(&untold(declared, direction), plant, |id| Config {
        relative_to,
        direction,
        ..config(id)
    })
}

pub fn vesc_with_servo<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration::new([1, 2], Rpm::new(60.0), NewtonMetres::new(26.0))
        .with_trials(&ALIKE)
        .with_trials(&[
            Trial::new(Target::Speed(Rpm::new(60.0)), 10.0, 3000),
            Trial::new(Target::Angle(Degrees::new(90.0)), 1.5, 3000),
            Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.5, 6000),
        ]);
    run::<C>(&untold(declared, direction), lift_plant(), |id| Config { direction, ..lift(id) })
}
