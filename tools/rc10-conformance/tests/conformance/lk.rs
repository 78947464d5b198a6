use rc10_app::{Amps, Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::Target;
use rc10_motor::lk::{Commands, Config, Lk};
use rc10_motor::rc10_app::Direction;
use rc10_sim::EscFault;
use rc10_sim::lk::{Drive, Settings};

use super::Check;
use crate::motors::lk::{joint, joint_plant, wheel, wheel_plant};

fn trials(cruise: f32) -> [Trial; 4] {
    [
        Trial::new(Target::Speed(Rpm::new(cruise)), 2.0, 300),
        Trial::new(Target::Speed(Rpm::new(-0.5 * cruise)), 2.0, 300),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 1500),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.0, 2000),
    ]
}

/// 5 A at 0.7 N m/A.
pub fn mg4010e<C: Check>(direction: Direction) -> Result<(), String> {
    let declared = Declaration::new([1, 2], Rpm::new(60.0), NewtonMetres::new(3.5))
        .with_trials(&trials(60.0))
        .with_trials(&[
            Trial::new(Target::Current(Amps::new(2.5)), 0.1, 100),
            Trial::new(Target::Torque(NewtonMetres::new(-1.75)), 0.05, 100),
        ]);
    C::check(
        &Declaration {
            direction,
            untold_faults: vec![(EscFault::Encoder, "no error bit says so")],
            ..declared
        },
        |id| Lk::new(Config { id, direction, ..joint() }).unwrap(),
        |wire, id| wire.add(Drive::new(Settings::mg(id)).unwrap(), joint_plant()),
    )
}

/// 12 A at 0.32 N m/A.
pub fn mf9025_multi_motor<C: Check>(direction: Direction) -> Result<(), String> {
    const UNTOLD: &str = "in the multi-motor frame a drive tells no errors";
    let faults = [
        EscFault::OverTemperature,
        EscFault::CommunicationLost,
        EscFault::OverCurrent,
        EscFault::OverVoltage,
        EscFault::UnderVoltage,
        EscFault::Encoder,
    ];
    let declared = Declaration::new([1, 2], Rpm::new(100.0), NewtonMetres::new(3.84))
        .with_trials(&trials(100.0))
        .with_trials(&[
            Trial::new(Target::Current(Amps::new(-6.0)), 0.1, 100),
            Trial::new(Target::Torque(NewtonMetres::new(1.92)), 0.05, 100),
        ]);
    C::check(
        &Declaration {
            direction,
            disables: Claim::Cannot("in the multi-motor frame there is no command for it"),
            untold_faults: faults.map(|fault| (fault, UNTOLD)).to_vec(),
            ..declared
        },
        |id| {
            let config = wheel().with_commands(Commands::MultiMotor);
            Lk::new(Config { id, direction, ..config }).unwrap()
        },
        |wire, id| {
            let settings = Settings { multi_motor: true, ..Settings::mf(id) };
            wire.add(Drive::new(settings).unwrap(), wheel_plant())
        },
    )
}
