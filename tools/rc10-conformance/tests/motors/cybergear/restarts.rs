//! Unplugged, switched off and on, muted, disarmed: never an old torque, and no kick.

use rc10_app::{NewtonMetres, Rpm};
use rc10_can::CanFrame;
use rc10_can::embedded_can::ExtendedId;
use rc10_motor::cybergear::{Config, CyberGear, models};
use rc10_motor::{CanMotor, DriveMode, Link, Motor, Safety, Target, Tick};
use rc10_sim::cybergear::Mode;
use rc10_time::Micros;

use super::{ADDRESS, with_cybergear, with_rs04};
use crate::motors::sent_in;

/// Whatever run mode somebody else has left: it is set before anything moves.
#[test]
fn another_run_mode_is_put_right_before_it_is_enabled() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.device(|device| {
            let parameters = &mut device.parameters;
            (parameters.run_mode, parameters.velocity) = (2, 20.0);
        });
        pair.switch.arm().unwrap();
        for _ in 0..100 {
            pair.hold(Target::Torque(NewtonMetres::ZERO), 1);
            assert!(pair.rpm().abs() < 0.1, "{}", pair.rpm());
            let (mode, run_mode) = pair.device(|device| (device.mode, device.parameters.run_mode));
            assert!(mode == Mode::Reset || run_mode == 0);
        }
        assert_eq!(pair.device(|device| device.mode), Mode::Run);
    });
}

/// A device that says that it no longer runs, or that was not heard, is enabled step by step again,
/// even if it stands where it stood.
#[test]
fn a_device_that_stopped_or_was_silent_gets_no_setpoint() {
    let frame = |id: u32, data| CanFrame::eight_bytes(ExtendedId::new(id).unwrap(), data);
    let feedback = |mode: u32| frame(0x0200_01FD | mode << 22, [0x80, 0, 0x80, 0, 0x80, 0, 0, 250]);
    let run_mode = frame(0x1100_01FD, [0x05, 0x70, 0, 0, 0, 0, 0, 0]);
    // Mode 0 is reset, mode 2 runs.
    for (mode, link) in [(0, Link::Online), (2, Link::Lost)] {
        let mut motor = CyberGear::new(Config::new(&models::CYBERGEAR, ADDRESS)).unwrap();
        motor.set_target(Target::Speed(Rpm::new(10.0))).unwrap();
        let mut millis = 0;
        let mut sent_after = |frame: &CanFrame, link| {
            millis += 1;
            motor.unpack_feedback(frame, Micros::from_millis(millis), link).unwrap();
            let tx = sent_in(&mut motor, &Tick::new(DriveMode::Run));
            tx.frames().last().unwrap().raw_id() >> 24
        };
        assert_eq!(sent_after(&feedback(0), Link::NeverSeen), 4, "stop");
        assert_eq!(sent_after(&run_mode, Link::Online), 3, "enable");
        assert_eq!(sent_after(&feedback(2), Link::Online), 1, "setpoint");
        assert_eq!(sent_after(&feedback(2), Link::Online), 1, "setpoint");
        assert_eq!(sent_after(&feedback(mode), link), 4, "stop");
    }
}

/// A RobStride stops by itself when commands stop coming.
#[test]
fn a_robstrides_time_out_is_a_restart() {
    with_rs04(|mut pair| {
        // 20 ms in steps of 50 µs.
        pair.device(|device| device.parameters.timeout = 400);
        pair.switch.arm().unwrap();
        let target = Target::Speed(Rpm::new(40.0));
        pair.hold(target, 500);
        assert!((pair.rpm() - 40.0).abs() < 1.0);
        pair.bench.wire.set_cut(true);
        pair.hold(target, 30);
        assert_eq!(pair.device(|device| device.mode), Mode::Reset);
        pair.bench.wire.set_cut(false);
        pair.hold(target, 500);
        assert!((pair.rpm() - 40.0).abs() < 1.0);
    });
}

/// A RobStride that reports by itself keeps its link alive with that, and nothing else changes.
#[test]
fn a_robstrides_own_reports_are_feedback() {
    with_rs04(|mut pair| {
        let id = 24 << 24 | u32::from(ADDRESS.host) << 8 | u32::from(ADDRESS.motor);
        let id = rc10_can::embedded_can::ExtendedId::new(id).unwrap();
        let report = rc10_can::CanFrame::eight_bytes(id, [1, 2, 3, 4, 5, 6, 1, 0]);
        pair.bench.wire.inject(&report);
        let before = pair.status().counters;
        pair.bench.wait(200);
        let after = pair.status().counters;
        assert_eq!(after.malformed, before.malformed);
        let more = after.received - before.received;
        assert!((215..=225).contains(&more), "{more}");
    });
}
