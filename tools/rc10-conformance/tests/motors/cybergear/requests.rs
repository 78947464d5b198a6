//! Registers, zero, gains, limits.

use rc10_app::{Rpm, TotalAngle};
use rc10_motor::cybergear::{Config, CyberGear, models};
use rc10_motor::{DriveMode, Motor, Request, RequestError, Response, Safety, Target, Tick};

use rc10_sim::cybergear as sim;
use rc10_time::Micros;

use super::{ADDRESS, Pair, with_cybergear, with_pair, with_rs04};
use crate::motors::sent_in;

const COAST: Target = Target::Coast;

fn degrees(pair: &Pair) -> f32 {
    pair.status().feedback.total_angle.degrees().get()
}

#[test]
fn registers_are_read_and_written() {
    with_cybergear(Safety::COAST, |mut pair| {
        let real = |value: f32| Ok(Response::Register(value.to_bits()));
        assert_eq!(pair.ask(Request::ReadRegister(0x701C)), real(24.0));
        assert_eq!(pair.ask(Request::ReadRegister(0x7018)), real(23.0));
        let write = Request::WriteRegister(0x7018, 10.0_f32.to_bits());
        assert_eq!(pair.ask(write), Ok(Response::Done));
        assert_eq!(pair.device(|device| device.parameters.current_limit), 10.0);
        assert_eq!(pair.ask(Request::ReadRegister(0x7018)), real(10.0));
        // More than it takes: it holds something else now, and says what.
        let write = Request::WriteRegister(0x7018, 99.0_f32.to_bits());
        assert_eq!(pair.ask(write), Err(RequestError::Refused(23.0_f32.to_bits())));
        assert_eq!(pair.ask(Request::ReadRegister(0x7FFF)), Err(RequestError::Refused(1)));
        let write = Request::WriteRegister(0x7FFF, 0);
        assert_eq!(pair.ask(write), Err(RequestError::Refused(1)));
        pair.esc.set_power(false);
        assert_eq!(pair.ask(Request::ReadRegister(0x7018)), Err(RequestError::Timeout));
    });
}

#[test]
fn a_question_asked_while_it_is_enabled_waits_for_its_tick() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.hold(COAST, 20);
        pair.switch.arm().unwrap();
        let request = Request::ReadRegister(0x7018);
        assert_eq!(pair.bench.bus.request(pair.motor, request), Ok(Response::Pending));
        let (speed, mut most) = (Target::Speed(Rpm::new(30.0)), 0);
        for _ in 0..50 {
            pair.hold(speed, 1);
            most = most.max(pair.bench.sent.frames().len());
        }
        assert_eq!(most, 2);
        let answer = pair.bench.bus.response(pair.motor);
        assert_eq!(answer, Some(Ok(Response::Register(23.0_f32.to_bits()))));
        pair.hold(speed, 300);
        assert!((pair.rpm() - 30.0).abs() < 0.5);
    });
}

/// Reading disturbs nothing; the rest waits until the robot is disarmed.
#[test]
fn an_armed_robot_is_not_changed() {
    with_rs04(|mut pair| {
        pair.switch.arm().unwrap();
        let speed = Target::Speed(Rpm::new(30.0));
        pair.hold(speed, 300);
        let bus = &mut pair.bench.bus;
        for request in
            [Request::StoreZero, Request::SaveRegisters, Request::WriteRegister(0x7018, 0)]
        {
            assert_eq!(bus.request(pair.motor, request), Err(RequestError::NotWhileArmed));
        }
        let read = bus.request(pair.motor, Request::ReadRegister(0x7018));
        assert_eq!(read, Ok(Response::Pending));
        pair.hold(speed, 5);
        let answer = pair.bench.bus.response(pair.motor);
        assert_eq!(answer, Some(Ok(Response::Register(90.0_f32.to_bits()))));
        assert!((pair.rpm() - 30.0).abs() < 0.5);
        assert_eq!(pair.device(|device| device.saves), 0);
        // Armed before it is sent.
        pair.switch.disarm();
        pair.bench.wait(5);
        pair.bench.bus.request(pair.motor, Request::SaveRegisters).unwrap();
        pair.switch.arm().unwrap();
        pair.bench.tick();
        let answer = pair.bench.bus.response(pair.motor);
        assert_eq!(answer, Some(Err(RequestError::NotWhileArmed)));
        assert_eq!(pair.device(|device| device.saves), 0);
    });
}

#[test]
fn a_robstride_keeps_its_registers_and_its_zero() {
    with_rs04(|mut pair| {
        let write = Request::WriteRegister(0x7018, 40.0_f32.to_bits());
        assert_eq!(pair.ask(write), Ok(Response::Done));
        assert_eq!(pair.ask(Request::SaveRegisters), Ok(Response::Done));
        assert_eq!(pair.device(|device| device.saves), 1);
        // Away from where it started, disarmed again.
        pair.switch.arm().unwrap();
        let place = Target::TotalAngle(TotalAngle::from_degrees(50));
        pair.hold(place, 1500);
        pair.switch.disarm();
        pair.bench.wait(10);
        assert_eq!(pair.ask(Request::StoreZero), Ok(Response::Done));
        assert!(degrees(&pair).abs() < 0.1, "{}", degrees(&pair));
        assert_eq!(pair.device(|device| device.saves), 2);
        pair.esc.set_power(false);
        pair.bench.wait(200);
        pair.esc.set_power(true);
        pair.bench.wait(20);
        assert!(degrees(&pair).abs() < 0.1, "{}", degrees(&pair));
        assert_eq!(pair.device(|device| device.parameters.current_limit), 40.0);
    });
}

/// Its answer is plain feedback: what comes after a save must have that one cause.
#[test]
fn nothing_else_is_sent_around_a_save() {
    let mut motor = CyberGear::new(Config::new(&models::RS04, ADDRESS)).unwrap();
    assert_eq!(motor.request(Request::SaveRegisters), Ok(Response::Pending));
    let sent: Vec<_> = (0..400)
        .map(|_| {
            let tx = sent_in(&mut motor, &Tick::new(DriveMode::Off));
            tx.frames().iter().map(|frame| frame.raw_id() >> 24).collect::<Vec<_>>()
        })
        .collect();
    assert!(sent[..2].iter().all(Vec::is_empty), "{sent:?}");
    assert_eq!(sent[2], [22]);
    assert!(sent[3..].iter().all(Vec::is_empty), "{sent:?}");
}

/// It forgets its zero, and type 22 would change its bit rate.
#[test]
fn a_cybergear_cannot_save() {
    with_cybergear(Safety::COAST, |mut pair| {
        for request in [Request::StoreZero, Request::SaveRegisters] {
            assert_eq!(pair.ask(request), Err(RequestError::Unsupported));
        }
        pair.esc.set_power(false);
        pair.bench.wait(200);
        pair.esc.set_power(true);
        pair.bench.wait(20);
        assert_eq!(pair.status().link, rc10_motor::Link::Online);
    });
}

/// A RobStride as it is sold keeps its last torque when it is cut off: it is not enabled before it is set up.
#[test]
fn a_time_out_that_is_missing_or_too_long_is_a_fault_with_both_values() {
    let most = |timeout| Config::new(&models::RS04, ADDRESS).with_timeout(timeout);
    let hundred = Micros::from_millis(100);
    for (timeout, steps, differs) in [
        (hundred, 0, Some([0.0, 100.0])),
        (hundred, 2001, Some([100.05, 100.0])),
        (hundred, 2000, None),
        (hundred, 200, None),
        (Micros::ZERO, 0, None),
    ] {
        let device = sim::CyberGear::new(&sim::RS04, 1).with_timeout(steps);
        let plant = sim::RS04.plant().with_load_inertia(0.1);
        let motor = CyberGear::new(most(timeout)).unwrap();
        with_pair(motor, (device, plant), Safety::COAST, |mut pair| {
            let fault = |pair: &Pair| pair.status().fault.map(|fault| fault.differs);
            assert_eq!(fault(&pair), differs.map(Some), "{steps}");
            pair.switch.arm().unwrap();
            let speed = Target::Speed(Rpm::new(30.0));
            pair.hold(speed, 300);
            assert_eq!(pair.rpm() > 20.0, differs.is_none(), "{steps}");
            let Some(differs) = differs else { return };
            // Looked at again, and not better; then set right.
            pair.switch.disarm();
            pair.bench.wait(5);
            assert_eq!(pair.ask(Request::ClearFault), Ok(Response::Done));
            pair.bench.wait(20);
            assert_eq!(fault(&pair), Some(Some(differs)));
            assert_eq!(pair.ask(Request::WriteRegister(0x7028, 1000)), Ok(Response::Done));
            assert_eq!(pair.ask(Request::ClearFault), Ok(Response::Done));
            pair.switch.arm().unwrap();
            pair.hold(speed, 300);
            assert!(pair.rpm() > 20.0);
            // Power-off takes back what was not saved.
            pair.esc.set_power(false);
            pair.hold(speed, 100);
            pair.esc.set_power(true);
            pair.hold(speed, 100);
            assert_eq!(fault(&pair), Some(Some(differs)));
        });
    }
    let cybergear = Config::new(&models::CYBERGEAR, ADDRESS).with_timeout(hundred);
    let refused = CyberGear::new(cybergear).unwrap_err().to_string();
    assert!(refused.contains("a CyberGear has none"), "{refused}");
}
