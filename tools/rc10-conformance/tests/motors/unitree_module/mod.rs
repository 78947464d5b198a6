//! GO-M8010-6 behind Unitree's CAN-to-485 module.

mod attach;
mod closed_loop;
mod codecs;
mod faults;
mod set_up;
mod signals;
#[path = "../unitree_module_values.rs"]
mod values;

use rc10_motor::rc10_app::Rpm;
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{Safety, Target};
use rc10_sim::Plant;
use rc10_sim::unitree_module::{Gains, Mode, UnitreeModule, UnitreeMotor, plant};

/// A motor behind its module.
type One = crate::motors::One<UnitreeMotor>;

/// One that is heard, and disarmed.
fn behind(safety: Safety) -> One {
    with_plant(safety, plant())
}

fn with_plant(safety: Safety, plant: Plant) -> One {
    with_module(ModuleConfig::new(3, 0), safety, plant).0
}

fn with_module(config: ModuleConfig, safety: Safety, plant: Plant) -> (One, UnitreeModule) {
    let motor = GoModule::new(config).unwrap();
    let module = UnitreeModule::new(config.module).unwrap();
    let device = module.motor(config.motor).unwrap();
    let mut one = One::new(motor, device, plant, safety);
    one.bench.wait(20);
    (one, module)
}

impl One {
    fn mode(&self) -> Mode {
        self.device(|device| device.mode)
    }

    /// The stiffness and damping that the motor follows with.
    fn gains(&self) -> Gains {
        self.device(|device| device.gains)
    }

    /// N m at the output that the motor makes.
    fn torque(&self) -> f64 {
        self.esc.state().torque
    }

    /// The angle that it tells, degrees.
    fn told(&self) -> f64 {
        self.status().feedback.total_angle.degrees().get().into()
    }
}

fn speed(rpm: f32) -> Target {
    Target::Speed(Rpm::new(rpm))
}
