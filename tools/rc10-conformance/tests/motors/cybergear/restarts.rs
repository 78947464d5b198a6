//! Unplugged, switched off and on, muted, disarmed: never an old torque, and no kick.

use rc10_app::{NewtonMetres, Rpm, TotalAngle};
use rc10_can::embedded_can::ExtendedId;
use rc10_can::{CanFrame, Micros};
use rc10_motor::cybergear::{Config, CyberGear, models};
use rc10_motor::{
    CanMotor, Condition, DriveMode, Impedance, Link, Motor, Safety, Target, Tick, TxBatch,
};
use rc10_sim::cybergear::{self as sim, Mode};

use super::{ADDRESS, Pair, with_cybergear, with_rs04};

fn torque(pair: &Pair<'_, '_>) -> f64 {
    pair.esc.state().current * sim::CYBERGEAR.torque_constant()
}

/// The largest torque in the first milliseconds after it runs again, of `millis`, and after how
/// many it ran.
fn comes_back(pair: &mut Pair<'_, '_>, target: Target, millis: u32) -> (Vec<f64>, u32) {
    let mut torques = Vec::new();
    let mut ran_after = None;
    for millisecond in 0..millis {
        pair.bench.hold(pair.motor, target, 1).unwrap();
        if pair.device(|device| device.mode()) == Mode::Run {
            ran_after.get_or_insert(millisecond);
            torques.push(torque(pair).abs());
        }
    }
    (torques, ran_after.unwrap())
}

/// A tenth of full scale a millisecond: as for every motor of ours. What moves meanwhile must be
/// braked: that is what the torque is for.
fn is_soft(torques: &[f64]) -> bool {
    torques.iter().enumerate().take(10).all(|(tick, torque)| {
        let most = 12.0 * 0.1 * (f64::from(u32::try_from(tick).unwrap()) + 1.0) + 0.3;
        *torque <= most
    })
}

#[test]
fn it_is_enabled_step_by_step_and_disabled_at_once() {
    with_cybergear(Safety::COAST, |pair| {
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
        assert_eq!(pair.bench.status(pair.motor).drive, DriveMode::Off);
        pair.switch.arm().unwrap();
        let target = Target::Torque(NewtonMetres::new(0.5));
        let mut took = 0;
        loop {
            pair.bench.hold(pair.motor, target, 1).unwrap();
            took += 1;
            assert!(took < 10);
            let ready = pair.bench.status(pair.motor).condition == Condition::Ready;
            if ready && pair.device(|device| device.mode()) == Mode::Run {
                break;
            }
            assert_eq!(pair.bench.status(pair.motor).condition, Condition::Starting);
        }
        println!("enabled after {took} ms");
        pair.bench.hold(pair.motor, target, 50).unwrap();
        assert!((torque(&pair) - 0.5).abs() < 0.05);
        pair.switch.disarm();
        pair.bench.hold(pair.motor, target, 2).unwrap();
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
        assert_eq!(torque(&pair), 0.0);
    });
}

/// Whatever run mode somebody else has left: it is set before anything moves.
#[test]
fn another_run_mode_is_put_right_before_it_is_enabled() {
    with_cybergear(Safety::COAST, |pair| {
        pair.device(|device| {
            let parameters = device.parameters_mut();
            (parameters.run_mode, parameters.velocity) = (2, 20.0);
        });
        pair.switch.arm().unwrap();
        for _ in 0..100 {
            pair.bench.hold(pair.motor, Target::Torque(NewtonMetres::ZERO), 1).unwrap();
            assert!(pair.rpm().abs() < 0.1, "{}", pair.rpm());
            let (mode, run_mode) =
                pair.device(|device| (device.mode(), device.parameters().run_mode));
            assert!(mode == Mode::Reset || run_mode == 0);
        }
        assert_eq!(pair.device(|device| device.mode()), Mode::Run);
    });
}

#[test]
fn unplugged_it_is_lost_and_comes_back_softly() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.switch.arm().unwrap();
        let told = |pair: &Pair<'_, '_>| {
            f64::from(pair.bench.status(pair.motor).feedback.total_angle.degrees().get())
        };
        let start = pair.degrees() - told(&pair);
        let target = Target::Speed(Rpm::new(60.0));
        pair.bench.hold(pair.motor, target, 500).unwrap();
        pair.bench.wire.set_cut(true);
        pair.bench.hold(pair.motor, target, 300).unwrap();
        assert_eq!(pair.bench.status(pair.motor).link, Link::Lost);
        // A CyberGear knows no time-out: it goes on with what it heard last.
        assert_eq!(pair.device(|device| device.mode()), Mode::Run);
        pair.bench.wire.set_cut(false);
        // The first thing that arrives is a stop.
        pair.bench.hold(pair.motor, target, 2).unwrap();
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
        let before = pair.rpm();
        let (torques, after) = comes_back(&mut pair, target, 500);
        println!("from {before} rpm, enabled {after} ms later");
        assert!(is_soft(&torques), "{torques:?}");
        assert!((pair.rpm() - 60.0).abs() < 3.0);
        assert_eq!(pair.bench.status(pair.motor).counters.lost, 1);
        // It turned on while it was not heard, and that is known.
        assert!((pair.degrees() - start - told(&pair)).abs() < 1.0);
        assert_eq!(pair.bench.status(pair.motor).feedback.turn_gaps, 1);
    });
}

#[test]
fn off_and_on_again_it_starts_over_without_a_kick() {
    let total = Target::TotalAngle(TotalAngle::from_degrees(400));
    let spring = Impedance {
        angle: rc10_app::Degrees::new(400.0),
        kp: 50.0,
        kd: 2.0,
        ..Impedance::default()
    };
    for target in [total, Target::Impedance(spring)] {
        with_cybergear(Safety::COAST, |mut pair| {
            pair.switch.arm().unwrap();
            pair.bench.hold(pair.motor, total, 2000).unwrap();
            pair.bench.hold(pair.motor, target, 500).unwrap();
            let there = pair.degrees();
            let told = pair.bench.status(pair.motor).feedback.total_angle;
            pair.esc.set_power(false);
            pair.bench.hold(pair.motor, target, 200).unwrap();
            assert_eq!(pair.bench.status(pair.motor).link, Link::Lost);
            pair.esc.set_power(true);
            // It counts from somewhere else now: going where that number was would be a blow.
            let (torques, after) = comes_back(&mut pair, target, 1000);
            println!(
                "enabled after {after} ms, largest {:?}",
                torques.iter().copied().fold(0.0, f64::max)
            );
            assert!(is_soft(&torques), "{torques:?}");
            assert!((pair.degrees() - there).abs() < 1.0, "{} {there}", pair.degrees());
            let feedback = pair.bench.status(pair.motor).feedback;
            let moved = feedback.total_angle.minus(told).degrees().get();
            assert!(moved.abs() < 1.0, "{moved}");
            assert_eq!(feedback.turn_gaps, 1);
        });
    }
}

/// A spring that is far from where it pulls to begins softly, each time.
#[test]
fn an_impedance_begins_softly() {
    with_cybergear(Safety::COAST, |mut pair| {
        let angle = pair.bench.status(pair.motor).feedback.total_angle.degrees();
        let angle = angle + rc10_app::Degrees::new(60.0);
        let spring = Impedance { angle, kp: 10.0, kd: 1.0, ..Impedance::default() };
        let target = Target::Impedance(spring);
        for _ in 0..2 {
            pair.switch.arm().unwrap();
            let (torques, _) = comes_back(&mut pair, target, 10);
            // A limit of 12 N m, of which a twentieth more in each millisecond.
            let most = |tick: usize| 0.6 * (f64::from(u32::try_from(tick).unwrap()) + 1.0);
            assert!(
                torques.iter().enumerate().all(|(tick, torque)| *torque < most(tick)),
                "{torques:?}"
            );
            assert!(*torques.last().unwrap() > 0.3, "{torques:?}");
            pair.switch.disarm();
            pair.bench.wait(10);
        }
    });
}

/// Off for less than the link's time-out is long enough for a kick: the device says that it no
/// longer runs.
#[test]
fn a_short_break_of_power_starts_it_over_too() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.switch.arm().unwrap();
        let target = Target::Speed(Rpm::new(50.0));
        pair.bench.hold(pair.motor, target, 300).unwrap();
        pair.esc.set_power(false);
        pair.bench.hold(pair.motor, target, 4).unwrap();
        pair.esc.set_power(true);
        let (torques, _) = comes_back(&mut pair, target, 300);
        assert_eq!(pair.bench.status(pair.motor).counters.lost, 0);
        assert!(is_soft(&torques), "{torques:?}");
        assert!((pair.rpm() - 50.0).abs() < 2.0);
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
            motor.update(&Tick::new(DriveMode::Run));
            let mut tx = TxBatch::new();
            motor.pack_command(&mut tx).unwrap();
            tx.frames().last().unwrap().raw_id() >> 24
        };
        assert_eq!(sent_after(&feedback(0), Link::NeverSeen), 4, "stop");
        assert_eq!(sent_after(&run_mode, Link::Online), 3, "enable");
        assert_eq!(sent_after(&feedback(2), Link::Online), 1, "setpoint");
        assert_eq!(sent_after(&feedback(2), Link::Online), 1, "setpoint");
        assert_eq!(sent_after(&feedback(mode), link), 4, "stop");
    }
}

#[test]
fn muted_it_is_stopped_although_it_cannot_be_heard() {
    with_cybergear(Safety::HOLD, |pair| {
        pair.switch.arm().unwrap();
        let target = Target::Torque(NewtonMetres::new(3.0));
        pair.bench.hold(pair.motor, target, 20).unwrap();
        pair.esc.set_feedback(false);
        pair.bench.hold(pair.motor, target, 14).unwrap();
        assert_eq!(pair.bench.status(pair.motor).link, Link::Lost);
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
        assert_eq!(torque(&pair), 0.0);
        pair.esc.set_feedback(true);
        pair.bench.hold(pair.motor, target, 20).unwrap();
        assert_eq!(pair.device(|device| device.mode()), Mode::Run);
    });
}

#[test]
fn commands_expire_and_an_emergency_stop_holds() {
    with_cybergear(Safety::HOLD, |pair| {
        pair.switch.arm().unwrap();
        let target = Target::Speed(Rpm::new(60.0));
        pair.bench.hold(pair.motor, target, 300).unwrap();
        pair.bench.wait(1000);
        assert_eq!(pair.bench.status(pair.motor).drive, DriveMode::Hold);
        assert_eq!(pair.bench.status(pair.motor).counters.expired, 1);
        assert!(pair.rpm().abs() < 0.5);
        pair.bench.hold(pair.motor, target, 300).unwrap();
        assert!((pair.rpm() - 60.0).abs() < 2.0);
        pair.switch.emergency_stop();
        pair.bench.hold(pair.motor, target, 1000).unwrap();
        assert!(pair.rpm().abs() < 0.5);
        assert_eq!(pair.bench.status(pair.motor).drive, DriveMode::Hold);
        pair.switch.reset();
        pair.bench.hold(pair.motor, target, 5).unwrap();
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
    });
}

/// A RobStride stops by itself when commands stop coming.
#[test]
fn a_robstrides_time_out_is_a_restart() {
    with_rs04(|pair| {
        // 20 ms in steps of 50 µs.
        pair.device(|device| device.parameters_mut().timeout = 400);
        pair.switch.arm().unwrap();
        let target = Target::Speed(Rpm::new(40.0));
        pair.bench.hold(pair.motor, target, 500).unwrap();
        assert!((pair.rpm() - 40.0).abs() < 1.0);
        pair.bench.wire.set_cut(true);
        pair.bench.hold(pair.motor, target, 30).unwrap();
        assert_eq!(pair.device(|device| device.mode()), Mode::Reset);
        pair.bench.wire.set_cut(false);
        pair.bench.hold(pair.motor, target, 500).unwrap();
        assert!((pair.rpm() - 40.0).abs() < 1.0);
    });
}

/// A RobStride that reports by itself keeps its link alive with that, and nothing else changes.
#[test]
fn a_robstrides_own_reports_are_feedback() {
    with_rs04(|pair| {
        let address = CyberGear::new(Config::new(&models::RS04, ADDRESS)).unwrap().address();
        let id = 24 << 24 | u32::from(address.host) << 8 | u32::from(address.motor);
        let id = rc10_can::embedded_can::ExtendedId::new(id).unwrap();
        let report = rc10_can::CanFrame::eight_bytes(id, [1, 2, 3, 4, 5, 6, 1, 0]);
        pair.bench.wire.inject(&report);
        let before = pair.bench.status(pair.motor).counters;
        pair.bench.wait(200);
        let after = pair.bench.status(pair.motor).counters;
        assert_eq!(after.malformed, before.malformed);
        let more = after.received - before.received;
        assert!((215..=225).contains(&more), "{more}");
    });
}
