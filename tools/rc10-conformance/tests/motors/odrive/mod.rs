//! `ODrive`: [`rc10_motor::odrive`] against [`rc10_sim::odrive`].

mod attach;
mod closed_loop;
mod codecs;
mod faults;
mod signals;
#[path = "../odrive_values.rs"]
mod values;

use rc10_app::{Amps, Gear, PidConfig, Rpm, RpmPerSecond};
use rc10_conformance::Bench;
use rc10_motor::odrive::{Config, Control, Firmware, Limits, ODrive, Rates};
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_motor::{ArmSwitch, MotorId, Safety};
use rc10_sim::odrive::{Axis, Settings, State, d6374_8to1};
use rc10_sim::{Esc, Plant};

use crate::motors::leak;

/// For a D6374 behind an 8 : 1 belt with a wheel of 0.03 kg m².
pub const WHEEL: Cascade = Cascade {
    speed: PidConfig::within(8.0).kp(0.1).ki(1.0),
    angle: PidConfig::within(250.0).kp(3.0),
    outer_divider: 5,
    acceleration: RpmPerSecond::new(1500.0),
    feed_forward: FeedForward::NONE,
};

pub const NODE: u8 = 3;

/// 8 N m.
pub const LIMITS: Limits = Limits { speed: Rpm::new(300.0), current: Amps::new(18.1) };

pub fn with(control: Control) -> Config {
    Config { control, ..wheel().with_limits(LIMITS) }
}

pub fn wheel() -> Config {
    Config::new(NODE, Firmware::V0_6, Control::Torque(WHEEL), Rates::new(1000, 50))
        .with_gear(Gear::new(8, 1).unwrap())
}

pub fn plant() -> Plant {
    d6374_8to1().with_load_inertia(0.03)
}

/// A bench with one axis, the motor armed and heard of.
pub fn bench(motor: ODrive, settings: Settings, safety: Safety) -> (Bench<'static>, Esc, MotorId) {
    let mut bench = Bench::new(11, leak(ArmSwitch::new()));
    let esc = bench.wire.add(Axis::new(settings).unwrap(), plant());
    let id = bench.attach(leak(motor), safety).unwrap();
    bench.wait(150);
    bench.bus.switch().arm().unwrap();
    (bench, esc, id)
}

pub fn state(esc: &Esc) -> State {
    esc.with(|axis: &mut Axis| axis.state).unwrap()
}

pub fn is_on(esc: &Esc) -> bool {
    state(esc) == State::ClosedLoop
}
