use rc10_app::{Amps, Degrees, NewtonMetres, PidConfig, Rpm, RpmPerSecond, TotalAngle};
use rc10_conformance::{Claim, Declaration, Trial};
use rc10_motor::Target;
use rc10_motor::lk::models::{MF9025, MG4010E_I10};
use rc10_motor::lk::{Commands, Config, Lk};
use rc10_motor::rc10_app::Direction;
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_sim::EscFault;
use rc10_sim::lk::{Drive, Settings, mf9025, mg4010e_i10};

use super::Check;

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
    let cascade = Cascade {
        speed: PidConfig::new(0.2, 2.0, 0.0, 5.0),
        angle: PidConfig::new(3.0, 0.0, 0.0, 200.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    };
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
        |id| Lk::new(Config::new(MG4010E_I10, id, cascade).with_direction(direction)).unwrap(),
        |wire, id| {
            let plant = mg4010e_i10().with_load_inertia(0.02);
            wire.add(Drive::new(Settings::mg(id)).unwrap(), plant)
        },
    )
}

/// 12 A at 0.32 N m/A.
pub fn mf9025_multi_motor<C: Check>(direction: Direction) -> Result<(), String> {
    const UNTOLD: &str = "in the multi-motor frame a drive tells no errors";
    let cascade = Cascade {
        speed: PidConfig::new(0.1, 0.5, 0.0, 12.0),
        angle: PidConfig::new(2.0, 0.0, 0.0, 200.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(2000.0),
        feed_forward: FeedForward::NONE,
    };
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
            let config = Config::new(MF9025, id, cascade)
                .with_commands(Commands::MultiMotor)
                .with_direction(direction);
            Lk::new(Config { id, ..config }).unwrap()
        },
        |wire, id| {
            let settings = Settings { multi_motor: true, ..Settings::mf(id) };
            wire.add(Drive::new(settings).unwrap(), mf9025().with_load_inertia(0.005))
        },
    )
}
