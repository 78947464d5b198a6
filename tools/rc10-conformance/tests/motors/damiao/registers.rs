//! Registers, the zero in flash, and who may touch them when.

use super::{CAN_ID, MASTER_ID, Rig, cascade, config, controls, device, motor, on_bus};
use rc10_app::{Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_conformance::Bench;
use rc10_motor::damiao::{Config, Control, Damiao, models};
use rc10_motor::{
    ArmSwitch, CanMotor, Condition, DriveMode, Link, Motor, Request, RequestError, Response,
    Safety, Target, Tick,
};
use rc10_sim::damiao::{Damiao as Device, DamiaoConfig};
use rc10_time::Micros;

use crate::motors::sent_in;

fn mit() -> Control {
    Control::Mit(cascade())
}

fn bits(answer: Result<Response, RequestError>) -> u32 {
    match answer {
        Ok(Response::Register(bits)) => bits,
        other => panic!("{other:?}"),
    }
}

fn restart(rig: &mut Rig) {
    for power in [false, true] {
        rig.esc.set_power(power);
        rig.bench.wait(20);
    }
}

#[test]
fn registers_are_read_also_while_it_turns() {
    for control in controls() {
        let mut rig = on_bus(motor(control), &device(&control), Safety::HOLD).armed();
        rig.bench.wait(20);
        assert!(rig.is_enabled());
        let ratio = f32::from_bits(bits(rig.ask(Request::ReadRegister(20))));
        assert_eq!(ratio, 10.0);
        assert_eq!(bits(rig.ask(Request::ReadRegister(8))), u32::from(CAN_ID));
        assert_eq!(bits(rig.ask(Request::ReadRegister(7))), u32::from(MASTER_ID));
        assert!(rig.is_enabled());
        assert_eq!(rig.status().counters.malformed, 0);
        assert_eq!(rig.status().link, Link::Online);
        // A register that does not exist: no answer comes.
        assert_eq!(rig.ask(Request::ReadRegister(49)), Err(RequestError::Timeout));
        let error = rig.ask(Request::ReadRegister(256));
        assert!(matches!(error, Err(RequestError::Config(error)) if error.field == "register"));
    }
}

#[test]
fn registers_are_written_and_saved_only_while_disarmed() {
    for acknowledges_with in [0x55, 0x33] {
        let config = DamiaoConfig { acknowledges_with, ..device(&mit()) };
        let mut rig = on_bus(motor(mit()), &config, Safety::COAST);
        rig.bench.wait(20);
        assert_eq!(rig.ask(Request::WriteRegister(9, 400)), Ok(Response::Done));
        assert_eq!(rig.device(|device| device.register(9)), Some(400));
        let acceleration = 150.0_f32.to_bits();
        assert_eq!(rig.ask(Request::WriteRegister(4, acceleration)), Ok(Response::Done));
        // Out of its range: the old value stays and is told.
        let refused = rig.ask(Request::WriteRegister(10, 7));
        assert_eq!(refused, Err(RequestError::Refused(1)));
        // Read only.
        let ratio = 10.0_f32.to_bits();
        let refused = rig.ask(Request::WriteRegister(20, 1.0_f32.to_bits()));
        assert_eq!(refused, Err(RequestError::Refused(ratio)));
        let nan = rig.ask(Request::WriteRegister(4, f32::NAN.to_bits()));
        assert!(matches!(nan, Err(RequestError::Config(_))));
        // Looked at again after each.
        rig.bench.wait(10);
        assert_eq!(rig.status().condition, Condition::Ready);

        // Forgotten without power, unless saved.
        restart(&mut rig);
        assert_eq!(bits(rig.ask(Request::ReadRegister(9))), 2000);
        assert_eq!(rig.ask(Request::WriteRegister(9, 1000)), Ok(Response::Done));
        assert_eq!(rig.ask(Request::SaveRegisters), Ok(Response::Done));
        assert_eq!(rig.device(|device| device.saves), 1);
        restart(&mut rig);
        assert_eq!(bits(rig.ask(Request::ReadRegister(9))), 1000);

        rig.switch.arm().unwrap();
        rig.bench.wait(2);
        for request in [Request::WriteRegister(9, 0), Request::SaveRegisters, Request::StoreZero] {
            let refused = rig.bench.bus.request(rig.motor, request);
            assert_eq!(refused, Err(RequestError::NotWhileArmed), "{request:?}");
        }
        // Disarmed, but still enabled.
        rig.bench.hold(rig.motor, Target::Speed(Rpm::new(10.0)), 5).unwrap();
        rig.switch.disarm();
        let refused = rig.bench.bus.request(rig.motor, Request::StoreZero);
        assert_eq!((refused, rig.is_enabled()), (Err(RequestError::NotWhileArmed), true));
        rig.bench.tick();
        let refused = rig.bench.bus.request(rig.motor, Request::StoreZero);
        assert_eq!(refused, Err(RequestError::NotWhileArmed));
        // Armed before it goes out.
        rig.switch.disarm();
        rig.bench.wait(2);
        assert_eq!(rig.bench.bus.request(rig.motor, Request::StoreZero), Ok(Response::Pending));
        let busy = rig.bench.bus.request(rig.motor, Request::ReadRegister(1));
        assert_eq!(busy, Err(RequestError::Busy));
        rig.switch.arm().unwrap();
        rig.bench.tick();
        let answer = rig.bench.bus.response(rig.motor);
        assert_eq!(answer, Some(Err(RequestError::NotWhileArmed)));
        assert_eq!(rig.bench.bus.response(rig.motor), None);
        assert_eq!(rig.device(|device| device.register(9)), Some(1000));
    }
}

#[test]
fn a_zero_in_flash_is_kept_without_power() {
    for control in controls() {
        let mut rig = on_bus(motor(control), &device(&control), Safety::COAST).armed();
        let target = match control {
            Control::Velocity => Target::Speed(Rpm::new(60.0)),
            _ => Target::TotalAngle(TotalAngle::from_degrees(70)),
        };
        rig.bench.hold(rig.motor, target, 300).unwrap();
        rig.switch.disarm();
        // Until friction has stopped it.
        rig.bench.wait(4000);
        // Ours first, so that it is seen to go.
        assert_eq!(rig.ask(Request::SetZeroOfDriven), Ok(Response::Done));
        assert_eq!(rig.ask(Request::StoreZero), Ok(Response::Done));
        let degrees = |rig: &Rig| rig.status().feedback.total_angle.degrees().get();
        assert!(degrees(&rig).abs() < 0.1, "{}", degrees(&rig));
        restart(&mut rig);
        assert!(degrees(&rig).abs() < 0.1, "{}", degrees(&rig));
        assert!(!rig.is_enabled());
    }
}

/// Any disabled device answers: only one whose angle is zero has a new zero.
#[test]
fn a_stored_zero_is_believed_once_the_angle_is_zero() {
    let id = StandardId::new(MASTER_ID).unwrap();
    let says = |position: u16| {
        let [high, low] = position.to_be_bytes();
        CanFrame::eight_bytes(id, [1, high, low, 0x7F, 0xF7, 0xFF, 25, 25])
    };
    let mut motor = Damiao::new(config(mit()).verify_limits(false)).unwrap();
    let mut now = Micros::ZERO;
    let mut tick = |motor: &mut Damiao, position| {
        now += Micros::from_millis(1);
        motor.unpack_feedback(&says(position), now, Link::Online).unwrap();
        sent_in(motor, &Tick::new(DriveMode::Off));
        motor.response()
    };
    assert_eq!(tick(&mut motor, 0x9000), None);
    assert_eq!(motor.request(Request::StoreZero), Ok(Response::Pending));
    for _ in 0..5 {
        assert_eq!(tick(&mut motor, 0x9000), None);
    }
    let before = motor.feedback().total_angle;
    assert!(before.degrees().get() > 30.0);
    let target = TotalAngle::from_degrees(200);
    motor.set_target(Target::TotalAngle(target)).unwrap();
    assert_eq!(tick(&mut motor, 0x7FFF), Some(Ok(Response::Done)));
    assert!(motor.feedback().total_angle.degrees().get().abs() < 0.1);
    // What is sought stays where it is.
    assert_eq!(motor.target(), Target::TotalAngle(target.minus(before)));
}

#[test]
fn what_is_written_into_a_register_that_is_checked_is_checked_again() {
    let mut rig = on_bus(motor(mit()), &device(&mit()), Safety::COAST);
    rig.bench.wait(20);
    assert_eq!(rig.status().fault, None);
    let wrong = 3.2_f32.to_bits();
    assert_eq!(rig.ask(Request::WriteRegister(21, wrong)), Ok(Response::Done));
    rig.bench.wait(10);
    assert_eq!(rig.status().fault.map(|fault| fault.code), Some(0x115));
}

#[test]
fn a_device_that_is_not_there_answers_nothing() {
    let mut rig = on_bus(motor(mit()), &device(&mit()), Safety::COAST);
    rig.esc.set_power(false);
    rig.bench.wait(5);
    assert_eq!(rig.ask(Request::SetZeroOfDriven), Err(RequestError::NoFeedback));
    assert_eq!(rig.ask(Request::ClearFault), Err(RequestError::NoFeedback));
    assert_eq!(rig.ask(Request::ReadRegister(21)), Err(RequestError::Timeout));
    assert_eq!(rig.ask(Request::StoreZero), Err(RequestError::Timeout));
    assert_eq!(rig.ask(Request::SaveRegisters), Err(RequestError::Timeout));
    assert_eq!(rig.status().fault, None);
    rig.esc.set_power(true);
    // The frame without an acknowledge still waits: it saves first.
    rig.bench.wait(60);
    assert_eq!(rig.status().link, Link::Online);
    assert_eq!(rig.status().condition, Condition::Ready);
}

/// Three motors on one `MST_ID`, all asked at once, all on 0x7FF.
#[test]
fn several_motors_share_one_master_id() {
    let switch = ArmSwitch::new();
    let mut motors =
        [1, 2, 3].map(|id| Damiao::new(Config::new(models::J4310, id, 0x00, mit())).unwrap());
    let mut bench = Bench::new(3, &switch);
    let mut escs = Vec::new();
    let mut ids = Vec::new();
    for (can_id, motor) in (1..).zip(&mut motors) {
        let config = DamiaoConfig { can_id, master_id: 0, ..device(&mit()) };
        escs.push(bench.wire.add(Device::new(&config), config.plant));
        ids.push(bench.attach(motor, Safety::COAST).unwrap());
    }
    bench.wait(50);
    for &id in &ids {
        assert_eq!(bench.status(id).condition, Condition::Ready);
        assert_eq!(bench.bus.request(id, Request::ReadRegister(8)), Ok(Response::Pending));
    }
    let mut answers = vec![None; 3];
    for _ in 0..20 {
        bench.tick();
        for (&id, answer) in ids.iter().zip(&mut answers) {
            *answer = answer.or_else(|| bench.bus.response(id));
        }
    }
    let own = |id| Some(Ok(Response::Register(id)));
    assert_eq!(answers, [own(1), own(2), own(3)]);
    switch.arm().unwrap();
    for _ in 0..600 {
        for (index, &id) in (0_u8..).zip(&ids) {
            let target = Target::Speed(Rpm::new(40.0 + 20.0 * f32::from(index)));
            bench.bus.command(id, target, bench.world.now()).unwrap();
        }
        bench.tick();
    }
    for (index, (esc, &id)) in (0_u8..).zip(escs.iter().zip(&ids)) {
        let (wanted, rpm) = (40.0 + 20.0 * f64::from(index), esc.state().output_rpm);
        assert!((rpm - wanted).abs() < 2.0, "{rpm}");
        let status = bench.status(id);
        assert!((f64::from(status.feedback.speed.get()) - wanted).abs() < 2.0);
        assert_eq!((status.counters.malformed, status.counters.lost), (0, 0));
    }
    assert_eq!(bench.bus.counters().unclaimed, 0);
}
