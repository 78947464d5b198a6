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

use rc10_motor::Safety;
use rc10_motor::cybergear::{Address, Config, CyberGear, Model, models};
use rc10_sim::cybergear as sim;

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

type Pair = super::One<sim::CyberGear>;

/// A motor and a device 20 ms after power-on, not armed.
fn with_pair(
    motor: CyberGear,
    device: (sim::CyberGear, rc10_sim::Plant),
    safety: Safety,
    test: impl FnOnce(Pair),
) {
    let mut pair = Pair::new(motor, device.0, device.1, safety);
    pair.bench.wait(20);
    test(pair);
}

/// A CyberGear with a load of 0.01 kg m².
fn with_cybergear(safety: Safety, test: impl FnOnce(Pair)) {
    let device = sim::CyberGear::new(&sim::CYBERGEAR, 1);
    let plant = sim::CYBERGEAR.plant().with_load_inertia(0.01);
    with_pair(cybergear(), (device, plant), safety, test);
}

/// An RS04 with a load of 0.1 kg m².
fn with_rs04(test: impl FnOnce(Pair)) {
    let motor = CyberGear::new(Config::new(&models::RS04, ADDRESS)).unwrap();
    let device = sim::CyberGear::new(&sim::RS04, 1).with_timeout(2000);
    let plant = sim::RS04.plant().with_load_inertia(0.1);
    with_pair(motor, (device, plant), Safety::COAST, test);
}
