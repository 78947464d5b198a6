//! The motors of a declaration, made at run time.

use rc10_motor::cybergear::CyberGear;
use rc10_motor::damiao::{self, Damiao};
use rc10_motor::dji::Dji;
use rc10_motor::lk::Lk;
use rc10_motor::odrive::{self, ODrive};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::unitree::{GoM8010, GoModule, Rs485Bus};
use rc10_motor::vesc::Vesc;
use rc10_motor::{CanMotor, Device, Entry, MotorBus, Place, Safety};

/// A motor of a declaration, and where it is plugged in.
pub struct Made {
    motor: Either,
    on: Place,
    safety: Safety,
}

#[allow(clippy::large_enum_variant, reason = "a test's")]
enum Either {
    Can(Box<dyn CanMotor>),
    Line(GoM8010),
}

impl Made {
    /// The motor of a line, with other gains.
    pub fn new(entry: &Entry<Device>, change: impl Fn(&mut Cascade)) -> Self {
        Self { motor: made(entry.config, change), on: entry.on, safety: entry.safety }
    }
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

/// Attaches them, in this order.
pub fn attach<'m>(
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
