//! The shipped robots, with other gains for one of their motors.

use rc10_cli::robot::Robot;
use rc10_cli::simulate::simulate;
use rc10_cli::{mixed, team};
use rc10_motor::damiao::{self, Damiao};
use rc10_motor::dji::Dji;
use rc10_motor::lk::{self, Lk};
use rc10_motor::odrive::{self, ODrive};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::{CanMotor, Device, MotorBus, Names, Safety};
use rc10_robot::mixed as table;
use rc10_robot::table::Name;

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
    let changed = |label: &str, mut cascade: Cascade| {
        change.into_iter().filter(|(name, _)| *name == label).for_each(|(_, f)| f(&mut cascade));
        cascade
    };
    let run = |robot: Robot<'_>| simulate(robot, seed, length).unwrap();
    match which {
        Which::Team => {
            let ports = rc10_robot::Ports::new();
            let shared = &rc10_robot::Shared::new(&ports);
            let mut motors = Vec::from_iter(Name::ALL.iter().map(|name| {
                let entry = name.entry();
                let Device::Dji(config) = entry.config else { panic!("{}", entry.label) };
                Dji::new(config.with_cascade(changed(entry.label, config.cascade))).unwrap()
            }));
            let mut buses = [(); 3].map(|()| MotorBus::new(&shared.switch));
            for (motor, name) in motors.iter_mut().zip(Name::ALL) {
                let bus = &mut buses[usize::from(name.slot().on.bus().unwrap()) - 1];
                bus.attach(motor, name.entry().safety).unwrap();
            }
            run(team::robot(shared, buses))
        }
        Which::Mixed => {
            let shared = &table::Shared::new();
            let mit = damiao::Control::Mit(changed("arm", table::ARM));
            let (id, master) = table::ARM_IDS;
            let mut arm =
                Damiao::new(damiao::Config::new(damiao::models::J4310, id, master, mit)).unwrap();
            let turret = table::TURRET.cascade;
            let turret = lk::Config { cascade: changed("turret", turret), ..table::TURRET };
            let mut turret = Lk::new(lk::Config { id: table::TURRET_ID, ..turret }).unwrap();
            let odrive::Control::Torque(cascade) = table::FLYWHEEL.control else { panic!() };
            let control = odrive::Control::Torque(changed("flywheel", cascade));
            let flywheel = odrive::Config { control, ..table::FLYWHEEL };
            let mut flywheel =
                ODrive::new(odrive::Config { node: table::FLYWHEEL_NODE, ..flywheel }).unwrap();
            let mut wheel = rc10_motor::vesc::Vesc::new(table::wheel()).unwrap();
            let (module, motor) = table::HIP;
            let mut hip =
                rc10_motor::unitree::GoModule::new(ModuleConfig::new(module, motor)).unwrap();
            let model = &rc10_motor::cybergear::models::CYBERGEAR;
            let mut wrist =
                rc10_motor::cybergear::CyberGear::new(cybergear::Config::new(model, table::WRIST))
                    .unwrap();
            let legs = std::array::from_fn(|id| u8::try_from(id).unwrap());
            let legs: [u8; table::LEGS] = legs;
            let mut legs =
                legs.map(|id| rc10_motor::unitree::GoM8010::new(LineConfig::new(id)).unwrap());
            let mut line = table::line(&shared.switch).unwrap();
            for leg in &mut legs {
                line.attach(leg, Safety::HOLD).unwrap();
            }
            let mut buses = [(); 2].map(|()| MotorBus::new(&shared.switch));
            let on_buses: [(usize, &mut dyn CanMotor, Safety); 6] = [
                (0, &mut wheel, Safety::BRAKE),
                (0, &mut arm, Safety::HOLD),
                (0, &mut hip, Safety::HOLD),
                (1, &mut wrist, Safety::COAST),
                (1, &mut turret, Safety::HOLD),
                (1, &mut flywheel, Safety::COAST),
            ];
            for (bus, motor, safety) in on_buses {
                buses[bus].attach(motor, safety).unwrap();
            }
            run(mixed::robot(shared, buses, line).unwrap())
        }
    }
}
