use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Declaration, Trial};
use rc10_motor::cybergear::{Address, Config, CyberGear, Model, models};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{Impedance, Target};
use rc10_sim::cybergear as sim;

use super::Check;

/// Both models are driven alike; the spring is as stiff as the motor is strong.
fn motor<C: Check>(
    model: &'static Model,
    device: &'static sim::Model,
    inertia: f64,
    direction: Direction,
) -> Result<(), String> {
    let full = model.limits.torque;
    let spring =
        Impedance { angle: Degrees::new(90.0), kp: full, kd: 0.1 * full, ..Impedance::default() };
    let declared = Declaration {
        direction,
        // For a moment, when the load changes its way: until the speed loop's integral carries it.
        hold_gives: 14.0,
        ..Declaration::new([1, 2], Rpm::new(60.0), NewtonMetres::new(full))
    }
    .with_trials(&[
        Trial::new(Target::Speed(Rpm::new(100.0)), 2.0, 600),
        Trial::new(Target::Speed(Rpm::new(-50.0)), 2.0, 600),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 5000),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-360)), 1.0, 8000),
        Trial::new(Target::Torque(NewtonMetres::new(0.5 * full)), 0.02 * f64::from(full), 100),
        Trial::new(Target::Impedance(spring), 3.0, 3000),
    ]);
    C::check(
        &declared,
        |motor| {
            CyberGear::new(
                Config::new(model, Address { motor, host: 0xFD }).with_direction(direction),
            )
            .unwrap()
        },
        |wire, motor| {
            let timeout = if model.saves { 2000 } else { 0 };
            let twin = sim::CyberGear::new(device, motor).with_timeout(timeout);
            wire.add(twin, device.plant().with_load_inertia(inertia))
        },
    )
}

pub fn cybergear<C: Check>(direction: Direction) -> Result<(), String> {
    motor::<C>(&models::CYBERGEAR, &sim::CYBERGEAR, 0.01, direction)
}

pub fn rs04<C: Check>(direction: Direction) -> Result<(), String> {
    motor::<C>(&models::RS04, &sim::RS04, 0.1, direction)
}
