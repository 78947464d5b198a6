use std::num::NonZeroU8;

use rc10_app::{Amps, Degrees, Gear, NewtonMetres, PidConfig, Rpm, RpmPerSecond, TotalAngle};
use rc10_can::Micros;
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::Target;
use rc10_motor::rc10_app::Direction;
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_motor::vesc::{Config, Currents, ElectricalScale, Vesc};
use rc10_sim::vesc::{VescConfig, outrunner_270_kv};
use rc10_sim::{EscFault, Plant};

use super::Check;

const POLE_PAIRS: u8 = 7;
const LIMIT: f32 = 40.0;

/// Our side.
fn ours(id: u8, gear: Gear, direction: Direction) -> Config {
    let scale = ElectricalScale::new(NonZeroU8::new(POLE_PAIRS).unwrap(), gear);
    let currents =
        Currents { limit: Amps::new(LIMIT), brake: Amps::new(15.0), handbrake: Amps::new(20.0) };
    Config::new(id, scale, currents).with_direction(direction)
}

/// The device's side.
fn theirs(id: u8, plant: Plant) -> VescConfig {
    VescConfig {
        status_hz: [200, 0, 0, 10, 200, 0],
        timeout: Micros::from_millis(200),
        current_max: LIMIT.into(),
        brake_max: LIMIT.into(),
        ..VescConfig::new(id, plant)
    }
}

fn run<C: Check>(
    declared: &Declaration,
    plant: Plant,
    config: impl Fn(u8) -> Config,
) -> Result<(), String> {
    C::check(
        declared,
        |id| Vesc::new(config(id)).unwrap(),
        |wire, id| {
            let config = theirs(id, plant);
            wire.add(rc10_sim::vesc::Vesc::new(config).unwrap(), config.plant)
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
        ..ours(id, Gear::DIRECT, direction)
    })
}

/// A lift's drum behind a gearbox of 19 : 1.
pub fn vesc_with_servo<C: Check>(direction: Direction) -> Result<(), String> {
    let plant = outrunner_270_kv();
    let plant = Plant {
        gear_ratio: 19.0,
        torque_constant: plant.torque_constant * 19.0,
        back_emf: plant.back_emf * 19.0,
        load_inertia: 0.05,
        coulomb_friction: 0.3,
        static_friction: 0.4,
        ..plant
    };
    let cascade = Cascade {
        speed: PidConfig::new(0.9, 5.0, 0.0, 40.0),
        angle: PidConfig::new(2.0, 0.0, 0.0, 120.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(400.0),
        feed_forward: FeedForward::NONE,
    };
    let declared = Declaration::new([1, 2], Rpm::new(60.0), NewtonMetres::new(26.0))
        .with_trials(&ALIKE)
        .with_trials(&[
            Trial::new(Target::Speed(Rpm::new(60.0)), 10.0, 3000),
            Trial::new(Target::Angle(Degrees::new(90.0)), 1.5, 3000),
            Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.5, 6000),
        ]);
    let gear = Gear::new(19, 1).unwrap();
    run::<C>(&untold(declared, direction), plant, |id| {
        ours(id, gear, direction).with_angle_loops(cascade)
    })
}
