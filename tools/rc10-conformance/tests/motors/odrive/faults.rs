//! Restarts, faults, strange messages.

use rc10_app::{NewtonMetres, Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_motor::odrive::{Config, Control, Firmware, InputMode, Node, ODrive, Rates};
use rc10_motor::{
    CanMotor, Condition, DriveMode, FrameError, FrameKind, Link, Motor, Safety, Target, Tick,
};
use rc10_sim::odrive::{Axis, Settings, encode_estimates, encode_heartbeat, encode_temperatures};
use rc10_time::Micros;

use super::{NODE, bench, is_on, wheel, with};
use crate::motors::{assert_returns_softly, sent_in};

const SPEED: Target = Target::Speed(Rpm::new(100.0));
/// N m per ampere at the output shaft.
const CONSTANT: f64 = 8.0 * 8.27 / 150.0;

#[test]
fn an_axis_that_takes_time_to_start_is_switched_on_softly_too() {
    let settings = Settings { starts_for: Micros::from_millis(500), ..Settings::new(NODE) };
    let (mut bench, esc, id) = bench(ODrive::new(wheel()).unwrap(), settings, Safety::COAST);
    bench.hold(id, SPEED, 1000).unwrap();
    esc.set_power(false);
    bench.hold(id, SPEED, 300).unwrap();
    esc.set_power(true);
    bench.hold(id, SPEED, 10).unwrap();
    assert_eq!(bench.status(id).fault, None);
    // 10 % of 8 N m a millisecond.
    let most = |millis| (0.8 * millis + 0.1) / CONSTANT;
    assert_returns_softly(&mut bench, id, &esc, most);
    assert!(is_on(&esc));
}

/// The axis's own loops: it returns to where it is, not to where an old input says.
#[test]
fn a_restarted_position_axis_does_not_jump() {
    for input in [InputMode::Trapezoid, InputMode::Passthrough] {
        let motor = ODrive::new(with(Control::Position(input))).unwrap();
        let (mut bench, esc, id) = bench(motor, Settings::new(NODE), Safety::HOLD);
        let target = Target::TotalAngle(TotalAngle::from_degrees(400));
        bench.hold(id, target, 2000).unwrap();
        let before = esc.state().output_degrees;
        esc.set_power(false);
        bench.hold(id, target, 100).unwrap();
        esc.set_power(true);
        for _ in 0..1500 {
            bench.hold(id, target, 1).unwrap();
            let moved = esc.state().output_degrees - before;
            assert!(moved.abs() < 2.0, "{moved}");
        }
        assert!(is_on(&esc));
        let goal = Target::TotalAngle(TotalAngle::from_degrees(490));
        bench.hold(id, goal, 2000).unwrap();
        assert!((esc.state().output_degrees - before - 90.0).abs() < 2.0);
    }
}

#[test]
fn without_heartbeats_nothing_is_known_and_nothing_driven() {
    let mut motor = ODrive::new(Config { rates: Rates::new(1000, 100), ..wheel() }).unwrap();
    let mut sent = Vec::new();
    motor.set_target(Target::Torque(NewtonMetres::new(1.0))).unwrap();
    for millis in 1..=200 {
        let at = Micros::from_millis(millis);
        let estimates = encode_estimates(NODE, 0.0, 0.0);
        assert_eq!(motor.unpack_feedback(&estimates, at, Link::Online), Ok(FrameKind::Feedback));
        // Idle, then switched on, then silence.
        for (when, state) in [(10, 1), (20, 8), (30, 8)] {
            if millis == when {
                let heartbeat = encode_heartbeat(NODE, 0, state, [0; 3]);
                assert_eq!(
                    motor.unpack_feedback(&heartbeat, at, Link::Online),
                    Ok(FrameKind::Other)
                );
            }
        }
        let tx = sent_in(&mut motor, &Tick::new(DriveMode::Run));
        sent.push(tx.frames().first().map_or(0, |frame| frame.raw_id() & 31));
    }
    assert!(sent[..8].iter().all(|message| *message == 0x07), "{sent:?}");
    assert!(sent[10..18].contains(&0x0B));
    assert!(sent[20..60].iter().all(|message| *message == 0x0E));
    assert!(sent[70..].iter().all(|message| *message == 0x07));
    assert_eq!(motor.condition(), Condition::Starting);
}

#[test]
fn a_watchdog_of_the_axis_does_not_bite_while_disarmed() {
    let settings = Settings { watchdog: Some(Micros::from_millis(50)), ..Settings::new(NODE) };
    let (mut bench, esc, id) = bench(ODrive::new(wheel()).unwrap(), settings, Safety::COAST);
    bench.bus.switch().disarm();
    bench.wait(1000);
    assert_eq!(esc.with(|axis: &mut Axis| axis.errors), Some(0));
    bench.bus.switch().arm().unwrap();
    bench.hold(id, SPEED, 300).unwrap();
    bench.wire.set_cut(true);
    bench.hold(id, SPEED, 100).unwrap();
    assert!(!is_on(&esc), "it stopped by itself");
    bench.wire.set_cut(false);
    bench.hold(id, SPEED, 100).unwrap();
    assert_eq!(bench.status(id).fault.unwrap().text, "watchdog expired");
}

#[test]
fn what_is_no_message_changes_nothing() {
    let rates = Rates { currents: 10, temperatures: 10, supply: 10, ..Rates::new(1000, 50) };
    let mut motor = ODrive::new(Config { rates, ..wheel() }).unwrap();
    let at = Micros::from_millis(1);
    let id = |message| Node::new(NODE).unwrap().can_id(message);
    let mut heard = |frame: &CanFrame| motor.unpack_feedback(frame, at, Link::Online);
    for (frame, error) in [
        // Not set to be sent, or never sent.
        (CanFrame::eight_bytes(id(0x16), [0; 8]), FrameError::NotMine),
        (CanFrame::data_frame(id(0x08), &[0; 4]).unwrap(), FrameError::NotMine),
        (rc10_sim::odrive::encode_currents(NODE + 2, 0.0, 0.0), FrameError::NotMine),
        (encode_estimates(NODE, f64::NAN, 0.0), FrameError::Unexpected),
        (encode_estimates(NODE, 0.0, f64::INFINITY), FrameError::Unexpected),
        (encode_estimates(NODE, 2e7, 0.0), FrameError::Encoder),
        (encode_estimates(NODE, 0.0, -2e4), FrameError::Encoder),
        (rc10_sim::odrive::encode_currents(NODE, 0.0, 1e30), FrameError::Unexpected),
        (rc10_sim::odrive::encode_supply(NODE, -1e30, 0.0), FrameError::Unexpected),
    ] {
        assert_eq!(heard(&frame), Err(error), "{frame}");
    }
    assert_eq!(heard(&encode_temperatures(NODE, 30.0, f64::NAN)), Ok(FrameKind::Other));
    // Starting is no fault in 0.6; the same bit is one in 0.5.
    assert_eq!(heard(&encode_heartbeat(NODE, 1, 1, [0; 3])), Ok(FrameKind::Other));
    assert_eq!(heard(&encode_heartbeat(NODE, 3, 1, [0; 3])), Ok(FrameKind::Fault));
    assert_eq!(motor.fault().unwrap().text, "system failed");
    assert_eq!(motor.feedback(), rc10_motor::Feedback::NEW);
    let mut old = ODrive::new(Config { firmware: Firmware::V0_5, ..wheel() }).unwrap();
    let warm = encode_temperatures(NODE, 30.0, 30.0);
    for unasked in [warm, rc10_sim::odrive::encode_currents(NODE, 0.0, 0.0)] {
        assert_eq!(old.unpack_feedback(&unasked, at, Link::Online), Err(FrameError::NotMine));
    }
    let refused = encode_heartbeat(NODE, 1, 1, [0; 3]);
    assert_eq!(old.unpack_feedback(&refused, at, Link::Online), Ok(FrameKind::Fault));
}

/// It was idle by its last heartbeat, but has been told to follow inputs since.
#[test]
fn stopped_while_it_starts_it_is_told_so_until_a_heartbeat_says_idle() {
    let mut motor = ODrive::new(wheel()).unwrap();
    motor.set_target(Target::Torque(NewtonMetres::new(1.0))).unwrap();
    let tick = |motor: &mut ODrive, millis, drive| {
        let at = Micros::from_millis(millis);
        let estimates = encode_estimates(NODE, 0.0, 0.0);
        motor.unpack_feedback(&estimates, at, Link::Online).unwrap();
        if millis == 1 || millis == 28 {
            let heartbeat = encode_heartbeat(NODE, 0, 1, [0; 3]);
            motor.unpack_feedback(&heartbeat, at, Link::Online).unwrap();
        }
        sent_in(motor, &Tick::new(drive)).frames().first().map(ToString::to_string)
    };
    let idle = Some("067#0100000000000000".to_owned());
    let started: Vec<_> = (1..=12).map(|at| tick(&mut motor, at, DriveMode::Run)).collect();
    // Nothing tells that it has heard its modes, so it gets them in three rounds before it is switched on.
    let modes = started.iter().filter(|it| it.as_deref() == Some("06B#0100000001000000")).count();
    assert!(modes >= 5 && started[..11].iter().all(|it| *it != started[11]), "{started:?}");
    assert_eq!(started[11].as_deref(), Some("067#0800000000000000"), "{started:?}");
    for at in 13..28 {
        assert_eq!(tick(&mut motor, at, DriveMode::Off), idle, "{at}");
    }
    let after: Vec<_> = (28..48).map(|at| tick(&mut motor, at, DriveMode::Off)).collect();
    assert_eq!(after.iter().flatten().count(), 2, "{after:?}");
}
