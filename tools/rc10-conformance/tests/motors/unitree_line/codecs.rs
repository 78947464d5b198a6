use std::f64::consts::TAU;

use crate::motors::{cases, number};
use proptest::prelude::*;
use rc10_app::{Celsius, Gear, NewtonMetres, Rpm, TotalAngle};
use rc10_motor::unitree::wire::line::{Command, Reply};
use rc10_motor::unitree::wire::{Address, Impedance, Motion, RotorScale, Status};
use rc10_sim::unitree_line as device;

/// Steps of torque, speed, angle and gains at the rotor.
const TORQUE: f64 = 1.0 / 256.0;
const SPEED: f64 = TAU / 256.0;
const ANGLE: f64 = TAU / 32_768.0;
const GAIN: f64 = 1.0 / 1280.0;

/// The number on the wire: held within its range, zero for NaN.
fn carried(number: f64, limit: f64) -> f64 {
    if number.is_nan() { 0.0 } else { number.clamp(-limit, limit) }
}

proptest! {
    #![proptest_config(cases(5000))]

    #[test]
    fn the_device_understands_every_command(
        id in 0..=14_u8,
        status in prop::sample::select(&[Status::LOCK, Status::FOC, Status::CALIBRATE][..]),
        geared in any::<bool>(),
        (torque, speed) in (number(1350.0), number(18_000.0)),
        microdegrees in prop_oneof![any::<i64>(), -30_000_000_000_000..=30_000_000_000_000_i64],
        (stiffness, damping) in (number(1650.0), number(1650.0)),
    ) {
        let (shaft, ratio) =
            if geared { (RotorScale::OUTPUT, 6.33) } else { (RotorScale::new(Gear::DIRECT), 1.0) };
        let motion = Motion {
            torque: NewtonMetres::new(torque),
            speed: Rpm::new(speed),
            angle: TotalAngle::from_microdegrees(microdegrees),
        };
        let command = Command {
            address: Address::new(id).unwrap(),
            status,
            motion: shaft.raw(&motion),
            impedance: shaft.raw_impedance(&Impedance { stiffness, damping }),
        };
        let heard = device::Command::read(&command.pack()).unwrap();
        prop_assert_eq!((heard.id, heard.status), (id, status.get()));
        // f32 knows the large ones to a part in 2^24.
        let near = |heard: f64, meant: f64, step: f64| {
            (heard - meant).abs() <= step + meant.abs() * 2e-7
        };
        let torque = carried(f64::from(torque) / ratio, 127.99);
        prop_assert!(near(heard.torque, torque, TORQUE), "{} {torque}", heard.torque);
        let speed = carried(f64::from(speed) * ratio * TAU / 60.0, 804.0);
        prop_assert!(near(heard.speed, speed, SPEED), "{} {speed}", heard.speed);
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^52")]
        let angle = carried((microdegrees as f64 * 1e-6).to_radians() * ratio, 411_774.0);
        prop_assert!(near(heard.angle, angle, ANGLE), "{} {angle}", heard.angle);
        let gains = (heard.stiffness, stiffness);
        for (heard, gain) in [gains, (heard.damping, damping)] {
            let gain = carried(f64::from(gain) / (ratio * ratio), 25.599).max(0.0);
            prop_assert!(near(heard, gain, GAIN), "{heard} {gain}");
        }
    }

    #[test]
    fn we_understand_every_answer(
        id in 0..=14_u8,
        status in 0..=7_u8,
        torque in -127.0..=127.0,
        speed in -800.0..=800.0,
        angle in -411_000.0..=411_000.0,
        (temperature, error, foot_force) in (any::<i8>(), 0..=7_u8, 0..=4095_u16),
    ) {
        let answer =
            device::Answer { id, status, torque, speed, angle, temperature, error, foot_force };
        let reply = Reply::unpack(&answer.write()).unwrap();
        prop_assert_eq!((reply.address.get(), reply.status.get()), (id, status));
        prop_assert_eq!((reply.error, reply.foot_force), (error, foot_force));
        prop_assert_eq!(reply.fault().is_some(), error != 0);
        prop_assert_eq!(reply.temperature, Celsius::new(temperature.into()));
        let motion = RotorScale::new(Gear::DIRECT).motion(reply.motion);
        let near = |ours: f64, meant: f64, step: f64| {
            (ours - meant).abs() <= 0.5 * step + meant.abs() * 2e-7 + 1e-9
        };
        prop_assert!(near(motion.torque.get().into(), torque, TORQUE));
        prop_assert!(near(f64::from(motion.speed.get()) * TAU / 60.0, speed, SPEED));
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^52")]
        let radians = (motion.angle.microdegrees() as f64 * 1e-6).to_radians();
        prop_assert!(near(radians, angle, ANGLE), "{radians} {angle}");
    }
}
