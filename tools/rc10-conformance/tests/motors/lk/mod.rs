//! LK-TECH: [`rc10_motor::lk`] against [`rc10_sim::lk`].

mod attach;
mod closed_loop;
mod codecs;
mod faults;
mod signals;
#[path = "../lk_values.rs"]
mod values;

use rc10_app::{PidConfig, RpmPerSecond};
use rc10_conformance::Bench;
use rc10_motor::lk::models::{MF9025, MG4010E_I10};
use rc10_motor::lk::{Config, Lk};
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_motor::{ArmSwitch, MotorId, Safety};
use rc10_sim::lk::{Drive, Settings, mf9025, mg4010e_i10};
use rc10_sim::{Esc, Plant};

use crate::motors::leak;

/// For an MG4010E-i10 with a joint of 0.02 kg m².
pub const JOINT: Cascade = Cascade {
    speed: PidConfig::within(5.0).kp(0.2).ki(2.0),
    angle: PidConfig::within(200.0).kp(3.0),
    outer_divider: 5,
    acceleration: RpmPerSecond::new(1000.0),
    feed_forward: FeedForward::NONE,
};

/// For an MF9025 with a wheel of 0.005 kg m².
pub const WHEEL: Cascade = Cascade {
    speed: PidConfig::within(12.0).kp(0.1).ki(0.5),
    angle: PidConfig::within(200.0).kp(2.0),
    outer_divider: 5,
    acceleration: RpmPerSecond::new(2000.0),
    feed_forward: FeedForward::NONE,
};

pub fn joint() -> Config {
    Config::new(MG4010E_I10, 1, JOINT)
}

pub fn wheel() -> Config {
    Config::new(MF9025, 1, WHEEL)
}

pub fn joint_plant() -> Plant {
    mg4010e_i10().with_load_inertia(0.02)
}

pub fn wheel_plant() -> Plant {
    mf9025().with_load_inertia(0.005)
}

/// A bench with one drive, the motor armed and heard of.
pub fn bench(
    motor: Lk,
    settings: Settings,
    plant: Plant,
    safety: Safety,
) -> (Bench<'static>, Esc, MotorId) {
    let mut bench = Bench::new(7, leak(ArmSwitch::new()));
    let esc = bench.wire.add(Drive::new(settings).unwrap(), plant);
    let id = bench.attach(leak(motor), safety).unwrap();
    bench.wait(20);
    bench.bus.switch().arm().unwrap();
    (bench, esc, id)
}

/// Whether the drive is on.
pub fn is_on(esc: &Esc) -> bool {
    esc.with(|drive: &mut Drive| drive.is_on).unwrap()
}
