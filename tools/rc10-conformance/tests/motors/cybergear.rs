//! CyberGear and RobStride: our motor against the simulated device.

mod codecs;
mod driver;
mod faults;
mod loops;
mod requests;
mod restarts;
mod table;
#[path = "cybergear_values.rs"]
mod values;
mod wiring;

use rc10_conformance::Bench;
use rc10_motor::cybergear::{Address, Config, CyberGear, Model, models};
use rc10_motor::{ArmSwitch, MotorId, Safety};
use rc10_sim::{Esc, cybergear as sim};

const HOST: u8 = 0xFD;
pub const ADDRESS: Address = Address { motor: 1, host: HOST };

/// Every model of ours with its simulated one.
fn models() -> impl Iterator<Item = (&'static Model, &'static sim::Model)> {
    models::ALL.into_iter().zip(sim::ALL)
}

const CONFIG: Config = Config::new(&models::CYBERGEAR, ADDRESS);

fn cybergear() -> CyberGear {
    CyberGear::new(CONFIG).unwrap()
}

/// A motor of ours and a device, alone on a bus, 20 ms after power-on, not armed.
struct Pair<'b, 'm> {
    bench: &'b mut Bench<'m>,
    motor: MotorId,
    esc: Esc,
    switch: &'m ArmSwitch,
}

impl Pair<'_, '_> {
    fn degrees(&self) -> f64 {
        self.esc.state().output_degrees
    }

    fn rpm(&self) -> f64 {
        self.esc.state().output_rpm
    }

    fn device<T>(&self, look: impl FnOnce(&mut sim::CyberGear) -> T) -> T {
        self.esc.with(look).unwrap()
    }
}

fn with_pair(
    mut motor: CyberGear,
    device: (sim::CyberGear, rc10_sim::Plant),
    safety: Safety,
    test: impl FnOnce(Pair<'_, '_>),
) {
    let switch = ArmSwitch::new();
    let mut bench = Bench::new(7, &switch);
    let esc = bench.wire.add(device.0, device.1);
    let motor = bench.attach(&mut motor, safety).unwrap();
    bench.wait(20);
    test(Pair { bench: &mut bench, motor, esc, switch: &switch });
    assert_eq!(bench.refused(), 0);
}

/// A CyberGear with a load of 0.01 kg m².
fn with_cybergear(safety: Safety, test: impl FnOnce(Pair<'_, '_>)) {
    let device = sim::CyberGear::new(&sim::CYBERGEAR, 1);
    let plant = sim::CYBERGEAR.plant().with_load_inertia(0.01);
    with_pair(cybergear(), (device, plant), safety, test);
}

/// An RS04 with a load of 0.1 kg m².
fn with_rs04(test: impl FnOnce(Pair<'_, '_>)) {
    let motor = CyberGear::new(Config::new(&models::RS04, ADDRESS)).unwrap();
    let device = sim::CyberGear::new(&sim::RS04, 1);
    let plant = sim::RS04.plant().with_load_inertia(0.1);
    with_pair(motor, (device, plant), Safety::COAST, test);
}
