//! GO-M8010-6 behind Unitree's CAN-to-485 module.

mod attach;
mod closed_loop;
mod codecs;
mod faults;
mod set_up;
mod signals;
#[path = "../unitree_module_values.rs"]
mod values;

use rc10_conformance::Bench;
use rc10_motor::rc10_app::Rpm;
use rc10_motor::unitree::GoModule;
use rc10_motor::{ArmSwitch, MotorId, Safety, Target};
use rc10_sim::unitree_module::{Gains, Mode, UnitreeModule, UnitreeMotor, plant};
use rc10_sim::{Esc, Plant};

use crate::motors::leak;

/// One motor behind the factory's module, heard and disarmed.
struct One {
    bench: Bench<'static>,
    switch: &'static ArmSwitch,
    motor: MotorId,
    esc: Esc,
    module: UnitreeModule,
}

impl One {
    fn new(motor: GoModule, safety: Safety) -> Self {
        Self::with(motor, safety, plant())
    }

    fn with(motor: GoModule, safety: Safety, plant: Plant) -> Self {
        let switch = &*leak(ArmSwitch::new());
        let mut bench = Bench::new(7, switch);
        let module = UnitreeModule::new(motor.module().get()).unwrap();
        let esc = bench.wire.add(module.motor(motor.address().get()).unwrap(), plant);
        let motor = bench.attach(leak(motor), safety).unwrap();
        bench.wait(20);
        Self { bench, switch, motor, esc, module }
    }

    fn armed(self) -> Self {
        self.switch.arm().unwrap();
        self
    }

    fn hold(&mut self, target: Target, millis: u32) {
        self.bench.hold(self.motor, target, millis).unwrap();
    }

    fn device<T>(&self, look: impl FnOnce(&mut UnitreeMotor) -> T) -> T {
        self.esc.with(look).unwrap()
    }

    fn mode(&self) -> Mode {
        self.device(|device| device.mode())
    }

    /// The stiffness and damping that the motor follows with.
    fn gains(&self) -> Gains {
        self.device(|device| device.gains())
    }

    /// N m at the output that the motor makes.
    fn torque(&self) -> f64 {
        self.esc.state().current * 0.638_95
    }

    fn rpm(&self) -> f64 {
        self.esc.state().output_rpm
    }

    fn degrees(&self) -> f64 {
        self.bench.status(self.motor).feedback.total_angle.degrees().get().into()
    }
}

fn speed(rpm: f32) -> Target {
    Target::Speed(Rpm::new(rpm))
}
