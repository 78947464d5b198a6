//! VESC.

mod closed_loop;
mod codec;
mod safety;
mod wiring;

use std::num::NonZeroU8;

use rc10_app::{Amps, Gear, PidConfig, RpmPerSecond};
use rc10_conformance::Bench;
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_motor::vesc::{Config, Currents, ElectricalScale, Vesc, VescId};
use rc10_motor::{ArmSwitch, MotorId, Safety};
use rc10_sim::vesc::{VescConfig, outrunner_270_kv};
use rc10_sim::{Esc, Plant};
use rc10_time::Micros;

/// Pole pairs of the wheel's motor in the simulation.
const POLE_PAIRS: u8 = 7;

fn id(number: u8) -> VescId {
    VescId::new(number).unwrap()
}

fn amps(limit: f32, brake: f32, handbrake: f32) -> Currents {
    let (limit, brake) = (Amps::new(limit), Amps::new(brake));
    Currents { limit, brake, handbrake: Amps::new(handbrake) }
}

/// Our side: an outrunner without gearbox.
pub fn config(number: u8) -> Config {
    let scale = ElectricalScale::new(NonZeroU8::new(POLE_PAIRS).unwrap(), Gear::DIRECT);
    Config::new(number, scale, amps(40.0, 15.0, 20.0))
}

/// Its side, set up as the page says: rates and timeout; a wheel of 1 kg, radius 5 cm.
pub fn device(number: u8) -> VescConfig {
    VescConfig {
        status_hz: [200, 0, 0, 10, 200, 0],
        timeout: Micros::from_millis(200),
        current_max: 40.0,
        brake_max: 40.0,
        ..VescConfig::new(number, outrunner_270_kv().with_load_inertia(1.25e-3))
    }
}

/// For the drum of a lift behind a gearbox of 19 : 1.
pub const LIFT: Cascade = Cascade {
    speed: PidConfig::within(40.0).kp(0.9).ki(5.0),
    angle: PidConfig::within(120.0).kp(2.0),
    outer_divider: 5,
    acceleration: RpmPerSecond::new(400.0),
    feed_forward: FeedForward::NONE,
};

/// Our side of the lift.
pub fn lift(number: u8) -> Config {
    let gear = Gear::new(19, 1).unwrap();
    let scale = ElectricalScale::new(NonZeroU8::new(POLE_PAIRS).unwrap(), gear);
    Config { scale, ..config(number) }.with_angle_loops(LIFT)
}

/// With 1 N m of friction and the load that a shaft of its size has.
pub fn lift_plant() -> Plant {
    let plant = outrunner_270_kv();
    Plant {
        gear_ratio: 19.0,
        torque_constant: plant.torque_constant * 19.0,
        back_emf: plant.back_emf * 19.0,
        load_inertia: 0.05,
        coulomb_friction: 0.3,
        static_friction: 0.4,
        ..plant
    }
}

/// A motor of ours and a device, on a bench; then the test.
fn on_bench(
    motor: Vesc,
    device: VescConfig,
    safety: Safety,
    test: impl FnOnce(&mut Bench<'_>, MotorId, &Esc, &ArmSwitch),
) {
    let switch = ArmSwitch::new();
    let mut motor = motor;
    let mut bench = Bench::new(7, &switch);
    let esc = bench.wire.add(rc10_sim::vesc::Vesc::new(device).unwrap(), device.plant);
    let motor = bench.attach(&mut motor, safety).unwrap();
    test(&mut bench, motor, &esc, &switch);
    assert_eq!(bench.refused, 0);
    assert_eq!(bench.bus.counters().malformed, 0);
    assert_eq!(esc.state().malformed, 0);
}

/// The same, armed.
fn on_armed_bench(
    motor: Vesc,
    device: VescConfig,
    safety: Safety,
    test: impl FnOnce(&mut Bench<'_>, MotorId, &Esc),
) {
    on_bench(motor, device, safety, |bench, motor, esc, switch| {
        switch.arm().unwrap();
        bench.wait(50);
        test(bench, motor, esc);
    });
}

/// The usual motor, device and safety, armed.
fn armed(test: impl FnOnce(&mut Bench<'_>, MotorId, &Esc)) {
    on_armed_bench(Vesc::new(config(1)).unwrap(), device(1), Safety::COAST, test);
}

/// The device's electronics.
fn inside<T>(esc: &Esc, look: impl FnOnce(&mut rc10_sim::vesc::Vesc) -> T) -> T {
    esc.with(look).unwrap()
}
