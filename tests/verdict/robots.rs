//! The shipped robots, with other gains for one of their motors.

use mixed::simulation;
use rc10_cli::robot::Robot;
use rc10_cli::simulate::simulate;
use rc10_cli::team;
use rc10_motor::cybergear::CyberGear;
use rc10_motor::damiao::{self, Damiao};
use rc10_motor::dji::Dji;
use rc10_motor::lk::Lk;
use rc10_motor::odrive::{self, ODrive};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::unitree::{GoM8010, GoModule, Rs485Bus};
use rc10_motor::vesc::Vesc;
use rc10_motor::{CanMotor, Device, MotorBus, Names, Place, Safety, Started};

use super::*;

/// A shipped robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    Team,
    Mixed,
}

pub const TEN_SECONDS: Micros = Micros::from_millis(10_000);

/// Other gains for the motor of a label.
pub type Change<'c> = (&'c str, &'c dyn Fn(&mut Cascade));

/// Runs it as it is shipped, but for a change.
pub fn run(which: Which, seed: u64, length: Micros, change: Option<Change<'_>>) -> Recording {
    let run = |robot: Robot<'_>| simulate(robot, seed, length).unwrap();
    match which {
        Which::Team => {
            let ports = rc10_robot::Ports::new();
            let shared = &rc10_robot::Shared::new(&ports);
            let mut all = motors::<rc10_robot::Name>(change);
            let mut buses = [(); 3].map(|()| MotorBus::new(&shared.switch));
            attach(&mut all, &mut buses.each_mut(), &mut []);
            run(team::robot(shared, buses))
        }
        Which::Mixed => {
            let ports = mixed::Ports::new();
            let shared = &mixed::Shared::new(&ports);
            let mut all = motors::<mixed::Name>(change);
            let mut started = Started::new(&shared.switch);
            let Started { buses, lines } = &mut started;
            attach(&mut all, &mut buses.each_mut(), &mut lines.each_mut());
            run(simulation::with(shared, started).unwrap())
        }
    }
}

/// A motor of a declaration, and where it is plugged in.
struct Made {
    motor: Either,
    on: Place,
    safety: Safety,
}

enum Either {
    Can(Box<dyn CanMotor>),
    Line(GoM8010),
}

/// The motors of a declaration, with the change.
fn motors<N: Names>(change: Option<Change<'_>>) -> Vec<Made> {
    let made = |name: &N| {
        let entry = name.entry();
        let change = |cascade: &mut Cascade| {
            change
                .into_iter()
                .filter(|(label, _)| *label == entry.label)
                .for_each(|(_, f)| f(cascade));
        };
        Made { motor: made(entry.config, change), on: entry.on, safety: entry.safety }
    };
    N::ALL.iter().map(made).collect()
}

fn made(device: Device, change: impl Fn(&mut Cascade)) -> Either {
    Either::Can(match device {
        Device::Dji(mut config) => {
            change(&mut config.cascade);
            Box::new(Dji::new(config).unwrap())
        }
        Device::Damiao(mut config) => {
            let damiao::Control::Mit(cascade) = &mut config.control else { panic!() };
            change(cascade);
            Box::new(Damiao::new(config).unwrap())
        }
        Device::Lk(mut config) => {
            change(&mut config.cascade);
            Box::new(Lk::new(config).unwrap())
        }
        Device::ODrive(mut config) => {
            let odrive::Control::Torque(cascade) = &mut config.control else { panic!() };
            change(cascade);
            Box::new(ODrive::new(config).unwrap())
        }
        Device::CyberGear(mut config) => {
            change(&mut config.cascade);
            Box::new(CyberGear::new(config).unwrap())
        }
        Device::Vesc(config) => Box::new(Vesc::new(config).unwrap()),
        Device::GoModule(mut config) => {
            change(&mut config.cascade);
            Box::new(GoModule::new(config).unwrap())
        }
        Device::GoM8010(mut config) => {
            change(&mut config.cascade);
            return Either::Line(GoM8010::new(config).unwrap());
        }
        device => panic!("{device:?}"),
    })
}

fn attach<'m>(
    all: &'m mut [Made],
    buses: &mut [&mut MotorBus<'m>],
    lines: &mut [&mut Rs485Bus<'m>],
) {
    for Made { motor, on, safety } in all {
        match (motor, *on) {
            (Either::Can(motor), Place::Bus(bus)) => {
                buses[usize::from(bus) - 1].attach(&mut **motor, *safety).unwrap();
            }
            (Either::Line(motor), Place::Line(line)) => {
                lines[usize::from(line) - 1].attach(motor, *safety).unwrap();
            }
            _ => panic!("{on}"),
        }
    }
}
