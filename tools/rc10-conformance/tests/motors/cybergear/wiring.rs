//! What stands on the bus: configuration, clashes, load, frames of others.

use rc10_app::NewtonMetres;
use rc10_can::CanFrame;
use rc10_can::IdPattern;
use rc10_can::embedded_can::ExtendedId;
use rc10_motor::cybergear::{Address, Config, CyberGear, models, wire};
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::{
    ArmSwitch, CanIds, CanMotor, Clash, DriveMode, FrameError, FrameKind, Frames, Impedance, Link,
    Motor, Rate, Request, Response, Safety, Target, Tick, TxBatch,
};
use rc10_time::Micros;

use super::{ADDRESS, CONFIG, HOST, cybergear};
use crate::motors::{clash, sent_in};

fn at(motor: u8, host: u8) -> CyberGear {
    CyberGear::new(Config::new(&models::CYBERGEAR, Address { motor, host })).unwrap()
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    for (motor, host, field) in
        [(0, HOST, "motor"), (128, HOST, "motor"), (5, 5, "host"), (5, 254, "host")]
    {
        let error =
            CyberGear::new(Config::new(&models::RS00, Address { motor, host })).unwrap_err();
        assert_eq!(error.field, field, "{motor} {host}");
        assert!(!error.must_be.is_empty());
    }
    for range in [0.0, -1.0, 15.1, f32::NAN, f32::INFINITY] {
        assert_eq!(CONFIG.with_position_range(range).validate().unwrap_err().field, "position");
    }
    let mut cascade = models::CYBERGEAR.cascade;
    cascade.speed.output_limit = 13.0;
    assert_eq!(CONFIG.with_cascade(cascade).validate().unwrap_err().field, "output_limit");
    cascade.speed.output_limit = f32::NAN;
    assert!(CONFIG.with_cascade(cascade).validate().is_err());
}

#[test]
fn who_cannot_share_a_bus_with_it_is_told() {
    // The same identifier twice; a host that is called as a motor is.
    assert!(matches!(clash(&mut at(1, HOST), &mut at(1, HOST)), Some(Clash::RxFrames(_))));
    assert!(matches!(clash(&mut at(1, 2), &mut at(2, 1)), Some(Clash::Confuses(_))));
    assert_eq!(clash(&mut at(1, HOST), &mut at(2, HOST)), None);
    // Standard identifiers are another world.
    let mut wheel = Dji::new(dji::Config::new(&M3508, 1)).unwrap();
    assert_eq!(clash(&mut at(1, HOST), &mut wheel), None);
    // A VESC's status 3 with the same low byte is a command to it: 0xF01 asks who it is.
    let wiring = at(1, HOST).can_ids();
    let id = ExtendedId::new(0x0F01).unwrap();
    let receive = Frames::new(IdPattern::exact(id), 8, Rate::Hz(50));
    let vesc = CanIds::new().receives(receive);
    assert_eq!(wiring.clash(&vesc), Some(Clash::Confuses(id.into())));
}

/// Only the parameter that was asked for is the answer, and only as it was written.
#[test]
fn an_answer_about_another_parameter_ends_no_request() {
    let says = |parameter: u16, value: f32| {
        let ([a, b], [c, d, e, f]) = (parameter.to_le_bytes(), value.to_le_bytes());
        let id = ExtendedId::new(0x1100_01FD).unwrap();
        CanFrame::data_frame(id, &[a, b, 0, 0, c, d, e, f]).unwrap()
    };
    let (limit, other, bits) = (0x700B, 0x7017, 9.0_f32.to_bits());
    for (request, wrong, done) in [
        (Request::ReadRegister(limit), None, Response::Register(bits)),
        (Request::WriteRegister(limit, bits), Some(8.0), Response::Done),
    ] {
        let mut motor = cybergear();
        assert_eq!(motor.request(request), Ok(Response::Pending));
        let mut hear = |frame| {
            sent_in(&mut motor, &Tick::new(DriveMode::Off));
            let heard = motor.unpack_feedback(&frame, Micros::from_millis(1), Link::Online);
            (heard, motor.response())
        };
        assert_eq!(hear(says(other, 9.0)), (Err(FrameError::Unasked), None), "{request:?}");
        if let Some(wrong) = wrong {
            assert_eq!(hear(says(limit, wrong)), (Ok(FrameKind::Other), None));
        }
        assert_eq!(hear(says(limit, 9.0)), (Ok(FrameKind::Other), Some(Ok(done))), "{request:?}");
    }
}

#[test]
fn answers_that_were_not_asked_for_change_nothing() {
    let mut motor = cybergear();
    let frame =
        |id: u32, data: &[u8]| CanFrame::data_frame(ExtendedId::new(id).unwrap(), data).unwrap();
    let now = Micros::from_millis(1);
    // A parameter that was not asked for here.
    let other = frame(0x1100_01FD, &[0x19, 0x70, 0, 0, 0, 0, 0, 0]);
    let heard = motor.unpack_feedback(&other, now, Link::NeverSeen);
    assert_eq!((heard, motor.feedback()), (Err(FrameError::Unasked), rc10_motor::Feedback::NEW));
    // The mode is asked for until the answer is there: the second one is late, not wrong.
    let late = frame(0x1100_01FD, &[0x05, 0x70, 0, 0, 0, 0, 0, 0]);
    assert_eq!(motor.unpack_feedback(&late, now, Link::NeverSeen), Ok(FrameKind::Other));
    assert_eq!(motor.feedback(), rc10_motor::Feedback::NEW);
    let good = frame(0x0280_01FD, &[0xFF, 0xFF, 0x80, 0, 0x80, 0, 0, 250]);
    assert_eq!(motor.unpack_feedback(&good, now, Link::NeverSeen), Ok(FrameKind::Feedback));
    assert!((motor.feedback().total_angle.degrees().get() - 716.197).abs() < 0.01);
}

/// The torque is part of the identifier: all of a motor's commands are one stream nevertheless.
#[test]
fn only_the_newest_command_waits() {
    let switch = ArmSwitch::new();
    let mut motor = cybergear();
    let mut bench = rc10_conformance::Bench::new(3, &switch);
    let esc = bench.wire.add(
        rc10_sim::cybergear::CyberGear::new(&rc10_sim::cybergear::CYBERGEAR, 1),
        rc10_sim::cybergear::CYBERGEAR.plant(),
    );
    let id = bench.attach(&mut motor, Safety::COAST).unwrap();
    bench.wait(20);
    switch.arm().unwrap();
    let torque = |torque| Target::Torque(NewtonMetres::new(torque));
    bench.hold(id, torque(1.0), 20).unwrap();
    // The bus is blocked for 8 ms: torques gather, unless they replace each other.
    bench.wire.set_held_dominant(true);
    for step in 0..8_u8 {
        bench.hold(id, torque(1.0 + f32::from(step) * 0.1), 1).unwrap();
    }
    bench.wire.set_held_dominant(false);
    let before = esc.state().commands;
    bench.hold(id, torque(2.0), 2).unwrap();
    let after = esc.state().commands - before;
    assert!(after <= 3, "{after} commands in 2 ms");
    assert_eq!(bench.refused, 0);
}

#[test]
fn a_panic_stops_it_and_nothing_is_sent_that_is_no_number() {
    let mut motor = cybergear();
    let mut tx = TxBatch::new();
    motor.coast_frames(&mut tx).unwrap();
    assert_eq!(tx.frames(), [wire::stop(ADDRESS)]);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(motor.set_target(Target::Torque(NewtonMetres::new(value))).is_err());
        let impedance = Impedance { kd: value, ..Impedance::default() };
        assert!(motor.set_target(Target::Impedance(impedance)).is_err());
    }
    assert_eq!(motor.target(), Target::Coast);
    // Never heard.
    let tx = sent_in(&mut motor, &Tick { link: Link::NeverSeen, ..Tick::new(DriveMode::Run) });
    assert_eq!(tx.frames(), [wire::stop(ADDRESS)]);
}
