//! What goes wrong, and what then happens.

use rc10_app::{NewtonMetres, Rpm, TotalAngle};
use rc10_can::{CanFrame, Micros};
use rc10_conformance::Bench;
use rc10_motor::odrive::{Config, Control, Firmware, InputMode, Node, ODrive, Rates};
use rc10_motor::{
    ArmSwitch, CanMotor, Condition, DriveMode, FrameError, FrameKind, Link, Motor, MotorId,
    Request, RequestError, Response, Safety, Target, Tick,
};
use rc10_sim::odrive::{
    Axis, Settings, Version, encode_estimates, encode_heartbeat, encode_temperatures,
};
use rc10_sim::{Esc, EscFault};

use super::{NODE, bench, is_on, wheel, with};

const SPEED: Target = Target::Speed(Rpm::new(100.0));
/// N m per ampere at the output shaft.
const CONSTANT: f64 = 8.0 * 8.27 / 150.0;

/// Runs for a while after a return; no torque is above what the soft start allows.
fn assert_returns_softly(bench: &mut Bench<'_>, motor: MotorId, esc: &Esc) {
    let mut driven = 0.0;
    for _ in 0..1200 {
        bench.hold(motor, SPEED, 1).unwrap();
        let torque = (esc.state().current * CONSTANT).abs();
        if torque > 0.0 || driven > 0.0 {
            driven += 1.0;
            // 10 % of 8 N m a millisecond.
            assert!(driven > 20.0 || torque <= 0.8 * driven + 0.1, "{torque} after {driven} ms");
        }
    }
    assert!(driven > 500.0);
    let rpm = esc.state().output_rpm;
    assert!((rpm - 100.0).abs() < 3.0, "{rpm}");
}

#[test]
fn unplugged_it_is_lost_and_comes_back_softly() {
    let (mut bench, esc, id) =
        bench(ODrive::new(wheel()).unwrap(), Settings::new(NODE), Safety::HOLD);
    bench.hold(id, SPEED, 500).unwrap();
    let before =
        (bench.status(id).feedback.total_angle.degrees().get(), esc.state().output_degrees);
    bench.wire.set_cut(true);
    bench.hold(id, SPEED, 15).unwrap();
    let status = bench.status(id);
    assert_eq!((status.link, status.drive), (Link::Lost, DriveMode::Coast));
    for _ in 0..100 {
        bench.hold(id, SPEED, 1).unwrap();
        assert_eq!(bench.sent().frames()[0].to_string(), "067#0100000000000000");
    }
    bench.wire.set_cut(false);
    assert_returns_softly(&mut bench, id, &esc);
    // It counted on meanwhile, and was believed; and that is told.
    let feedback = bench.status(id).feedback;
    let moved = f64::from(feedback.total_angle.degrees().get() - before.0);
    assert!((moved - (esc.state().output_degrees - before.1)).abs() < 3.0);
    assert_eq!(feedback.turn_gaps, 1);
}

#[test]
fn powered_off_and_on_it_is_switched_on_again_softly() {
    for (pause, starts_for) in [(300, 0), (30, 0), (300, 500)] {
        let switch = ArmSwitch::new();
        let mut motor = ODrive::new(wheel()).unwrap();
        let settings =
            Settings { starts_for: Micros::from_millis(starts_for), ..Settings::new(NODE) };
        let mut bench = Bench::new(5, &switch);
        let esc = bench.wire.add(Axis::new(settings).unwrap(), super::plant());
        let id = bench.attach(&mut motor, Safety::COAST).unwrap();
        bench.wait(700);
        switch.arm().unwrap();
        bench.hold(id, SPEED, 1000).unwrap();
        let total = bench.status(id).feedback.total_angle.degrees().get();
        assert!(total > 100.0, "{total}");
        esc.set_power(false);
        bench.hold(id, SPEED, pause).unwrap();
        assert_eq!(bench.status(id).link, Link::Lost);
        esc.set_power(true);
        bench.hold(id, SPEED, 10).unwrap();
        // It counts from zero again; the angle goes on.
        let feedback = bench.status(id).feedback;
        assert!((feedback.total_angle.degrees().get() - total).abs() < 40.0);
        assert_eq!((feedback.turn_gaps, bench.status(id).fault), (1, None));
        assert_returns_softly(&mut bench, id, &esc);
        assert!(is_on(&esc));
    }
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
fn muted_it_is_made_idle_although_nobody_hears_it() {
    let (mut bench, esc, id) =
        bench(ODrive::new(wheel()).unwrap(), Settings::new(NODE), Safety::HOLD);
    bench.hold(id, SPEED, 500).unwrap();
    esc.set_feedback(false);
    bench.hold(id, SPEED, 20).unwrap();
    assert!(!is_on(&esc), "the safe word reached it");
    esc.set_feedback(true);
    assert_returns_softly(&mut bench, id, &esc);
}

#[test]
fn each_fault_has_its_text_and_is_cleared_only_on_request() {
    use EscFault::{CommunicationLost, Encoder, OverCurrent, OverTemperature, OverVoltage};
    for (version, firmware, fault, text) in [
        (Version::V0_6, Firmware::V0_6, OverTemperature, "motor too hot"),
        (Version::V0_6, Firmware::V0_6, CommunicationLost, "watchdog expired"),
        (Version::V0_6, Firmware::V0_6, OverCurrent, "current limit violated"),
        (Version::V0_6, Firmware::V0_6, OverVoltage, "supply voltage too high"),
        (Version::V0_6, Firmware::V0_6, EscFault::UnderVoltage, "supply voltage too low"),
        (Version::V0_6, Firmware::V0_6, Encoder, "encoder estimate missing"),
        (Version::V0_5, Firmware::V0_5, OverTemperature, "too hot"),
        (Version::V0_5, Firmware::V0_5, OverCurrent, "motor failed"),
        (Version::V0_5, Firmware::V0_5, Encoder, "encoder failed"),
        (Version::V0_5, Firmware::V0_5, CommunicationLost, "watchdog expired"),
        (Version::V0_5, Firmware::V0_5, OverVoltage, "supply voltage too high"),
        (Version::V0_5, Firmware::V0_5, EscFault::UnderVoltage, "supply voltage too low"),
    ] {
        let motor = ODrive::new(Config { firmware, ..wheel() }).unwrap();
        let settings = Settings { version, ..Settings::new(NODE) };
        let (mut bench, esc, id) = bench(motor, settings, Safety::BRAKE);
        bench.hold(id, SPEED, 300).unwrap();
        assert!(esc.inject(fault));
        bench.hold(id, SPEED, 25).unwrap();
        let status = bench.status(id);
        assert_eq!(status.fault.map(|fault| fault.text), Some(text));
        assert_eq!((status.drive, status.link), (DriveMode::Brake, Link::Online));
        for _ in 0..300 {
            bench.hold(id, SPEED, 1).unwrap();
            assert!(!is_on(&esc));
            for frame in bench.sent().frames() {
                assert_eq!(frame.to_string(), "067#0100000000000000");
            }
        }

        // The cause is still there.
        assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Pending));
        assert_eq!(bench.bus.request(id, Request::SetZeroOfDriven), Err(RequestError::Busy));
        bench.hold(id, SPEED, 80).unwrap();
        let code = esc.with(|axis: &mut Axis| axis.errors()).unwrap();
        assert_eq!(bench.bus.response(id), Some(Err(RequestError::Refused(code))));
        bench.hold(id, SPEED, 100).unwrap();
        assert!(!is_on(&esc) && bench.status(id).drive == DriveMode::Brake);

        // It is gone, and nothing happens by itself.
        esc.with(Axis::heal).unwrap();
        bench.hold(id, SPEED, 300).unwrap();
        assert!(!is_on(&esc) && bench.status(id).fault.is_some());
        assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Pending));
        let mut waited = 0;
        let answer = loop {
            bench.hold(id, SPEED, 1).unwrap();
            waited += 1;
            match bench.bus.response(id) {
                Some(answer) => break answer,
                None => assert!(waited < 60),
            }
        };
        assert_eq!(answer, Ok(Response::Done));
        assert_returns_softly(&mut bench, id, &esc);
        assert_eq!(bench.status(id).fault, None);
        assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Done));
    }
}

#[test]
fn an_axis_that_does_not_answer_is_given_up_on() {
    let (mut bench, esc, id) =
        bench(ODrive::new(wheel()).unwrap(), Settings::new(NODE), Safety::COAST);
    esc.inject(EscFault::OverCurrent);
    bench.hold(id, SPEED, 50).unwrap();
    esc.set_power(false);
    bench.wait(5);
    assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Pending));
    bench.wait(65);
    assert_eq!(bench.bus.response(id), None);
    bench.wait(15);
    assert_eq!(bench.bus.response(id), Some(Err(RequestError::Timeout)));
    esc.set_power(true);
    bench.hold(id, SPEED, 300).unwrap();
    assert!(!is_on(&esc) && bench.status(id).fault.is_some());
    assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Pending));
    bench.hold(id, SPEED, 300).unwrap();
    assert_eq!(bench.bus.response(id), Some(Ok(Response::Done)));
    assert!(is_on(&esc));
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
        motor.update(&Tick::new(DriveMode::Run));
        let mut tx = rc10_motor::TxBatch::new();
        motor.pack_command(&mut tx).unwrap();
        sent.push(tx.frames().first().map_or(0, |frame| frame.raw_id() & 31));
    }
    assert!(sent[..8].iter().all(|message| *message == 0x07), "{sent:?}");
    assert!(sent[10..18].contains(&0x0B));
    assert!(sent[20..60].iter().all(|message| *message == 0x0E));
    assert!(sent[70..].iter().all(|message| *message == 0x07));
    assert_eq!(motor.condition(), Condition::Starting);
}

#[test]
fn commands_expire_and_stops_stop() {
    for (safety, state) in [(Safety::COAST, DriveMode::Coast), (Safety::HOLD, DriveMode::Hold)] {
        let (mut bench, esc, id) =
            bench(ODrive::new(wheel()).unwrap(), Settings::new(NODE), safety);
        bench.hold(id, SPEED, 500).unwrap();
        bench.wait(60);
        assert_eq!(bench.status(id).drive, state);
        bench.wait(500);
        if state == DriveMode::Coast {
            // Coasting is torque zero, and no braking.
            assert!(esc.state().current.abs() < 1e-6 && is_on(&esc));
            assert_eq!(bench.sent().frames()[0].to_string(), "06E#0000000000000000");
        } else {
            let stands = esc.state().output_degrees;
            esc.set_load(1.0);
            bench.wait(1000);
            let given = esc.state().output_degrees - stands;
            assert!(given.abs() < 2.0, "{given}");
            esc.set_load(0.0);
        }
        bench.hold(id, SPEED, 500).unwrap();
        bench.bus.switch().emergency_stop();
        bench.hold(id, SPEED, 5).unwrap();
        assert_eq!(bench.status(id).drive, state);
        bench.bus.switch().reset();
        bench.hold(id, SPEED, 5).unwrap();
        assert!(!is_on(&esc) && bench.status(id).drive == DriveMode::Off);
        bench.bus.switch().arm().unwrap();
        assert_returns_softly(&mut bench, id, &esc);
    }
}

#[test]
fn a_watchdog_of_the_axis_does_not_bite_while_disarmed() {
    let settings = Settings { watchdog: Some(Micros::from_millis(50)), ..Settings::new(NODE) };
    let (mut bench, esc, id) = bench(ODrive::new(wheel()).unwrap(), settings, Safety::COAST);
    bench.bus.switch().disarm();
    bench.wait(1000);
    assert_eq!(esc.with(|axis: &mut Axis| axis.errors()), Some(0));
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
        (CanFrame::data_frame(id(0x09), &[0; 7]).unwrap(), FrameError::Length),
        (encode_estimates(NODE + 1, 0.0, 0.0), FrameError::NotMine),
        (CanFrame::remote_frame(id(0x09), 8).unwrap(), FrameError::NotMine),
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
        if millis == 1 || millis == 20 {
            let heartbeat = encode_heartbeat(NODE, 0, 1, [0; 3]);
            motor.unpack_feedback(&heartbeat, at, Link::Online).unwrap();
        }
        motor.update(&Tick::new(drive));
        let mut tx = rc10_motor::TxBatch::new();
        motor.pack_command(&mut tx).unwrap();
        tx.frames().first().map(ToString::to_string)
    };
    let idle = Some("067#0100000000000000".to_owned());
    let started: Vec<_> = (1..=4).map(|at| tick(&mut motor, at, DriveMode::Run)).collect();
    assert_eq!(started[3].as_deref(), Some("067#0800000000000000"), "{started:?}");
    for at in 5..20 {
        assert_eq!(tick(&mut motor, at, DriveMode::Off), idle, "{at}");
    }
    let after: Vec<_> = (20..40).map(|at| tick(&mut motor, at, DriveMode::Off)).collect();
    assert_eq!(after.iter().flatten().count(), 2, "{after:?}");
}
