//! Identifiers, frames and configurations of a VESC.

use rc10_app::{Amps, ConfigError, Degrees, Direction, Rpm, RpmPerSecond};
use rc10_can::embedded_can::ExtendedId;
use rc10_can::{CanFrame, IdPattern};
use rc10_motor::dji::{self, Dji, FeedbackRate, M3508};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::vesc::{ElectricalRpm, StatusRates};
use rc10_motor::{
    AttachError, CanIds, CanMotor, Clash, DriveMode, FrameError, FrameKind, Frames, Link, Motor,
    MotorBus, Rate, Request, RequestError, Response, Target, Tick, TxBatch, Verdict,
};

use super::*;
use crate::motors::sent_in;

fn vesc(number: u8) -> Vesc {
    Vesc::new(config(number)).unwrap()
}

fn frame(raw: u32, data: &[u8]) -> CanFrame {
    CanFrame::data_frame(ExtendedId::new(raw).unwrap(), data).unwrap()
}

#[test]
fn a_configuration_that_cannot_be_is_refused_by_name() {
    let refused = |change: fn(&mut Config)| {
        let mut config = config(1);
        change(&mut config);
        let ConfigError { field, .. } = Vesc::new(config).unwrap_err();
        field
    };
    let good = config(1);
    assert!(Vesc::new(good).is_ok());
    assert_eq!(refused(|config| config.status.status_1 = 0), "status_1");
    assert_eq!(refused(|config| config.status.status_1 = 1001), "status_1");
    assert_eq!(refused(|config| config.status.status_5 = 201), "status_5");
    assert_eq!(refused(|config| config.command_hz = 0), "command_hz");
    assert_eq!(refused(|config| config.command_hz = 1001), "command_hz");
    assert_eq!(refused(|config| config.timeout = Micros::new(14_999)), "timeout");
    assert_eq!(refused(|config| config.timeout = Micros::ZERO), "timeout");
    let timeout = Micros::from_millis(10);
    assert_eq!(
        Vesc::new(Config { timeout, ..good }).unwrap_err().to_string(),
        "VESC id 1: `timeout` is 0.01, but must be three periods of `command_hz` or more (seconds)"
    );
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let mut config = config(1);
        config.currents.limit = Amps::new(bad);
        assert_eq!(Vesc::new(config).unwrap_err().field, "limit");
    }
    assert_eq!(refused(|config| config.currents.brake = Amps::new(40.5)), "brake");
    assert_eq!(refused(|config| config.currents.handbrake = Amps::new(f32::NAN)), "handbrake");
    assert_eq!(
        refused(|c| c.scale = c.scale.with_minimum(ElectricalRpm::new(f32::NAN))),
        "minimum"
    );
    assert_eq!(
        refused(|config| {
            config.encoder_on_shaft = true;
            config.status.status_4 = 0;
        }),
        "status_4"
    );
    for bad in [39.9, f32::NAN, f32::INFINITY] {
        let relative_to = Some(Amps::new(bad));
        let error = Vesc::new(Config { relative_to, ..good }).unwrap_err();
        assert_eq!(error.field, "relative_to");
    }
    assert_eq!(refused(|config| config.asker = id(config.id)), "asker");
    let mut slow = good;
    slow.status.status_5 = 100;
    let error = Vesc::new(slow.with_angle_loops(LIFT)).unwrap_err();
    assert_eq!((error.field, error.value), ("status_5", 100.0));
    let wrong = Cascade { acceleration: RpmPerSecond::new(0.0), ..LIFT };
    assert_eq!(Vesc::new(good.with_angle_loops(wrong)).unwrap_err().field, "acceleration");
}

#[test]
fn vescs_share_a_bus_with_others_unless_they_would_be_mistaken() {
    let switch = ArmSwitch::new();
    let (mut one, mut two, mut twin) = (vesc(1), vesc(2), vesc(1));
    let mut wheel = Dji::new(dji::Config::new(&M3508, 1)).unwrap();
    let mut asked = vesc(254 - 1);
    let mut as_asker = {
        let mut config = config(254);
        config.asker = id(100);
        Vesc::new(config).unwrap()
    };
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut one, Safety::COAST).unwrap();
    bus.attach(&mut two, Safety::COAST).unwrap();
    bus.attach(&mut wheel, Safety::COAST).unwrap();
    bus.attach(&mut asked, Safety::COAST).unwrap();
    let error = bus.attach(&mut twin, Safety::COAST).unwrap_err();
    assert!(matches!(error, AttachError::Clash { clash: Clash::RxFrames(_), .. }), "{error}");
    assert!(error.to_string().contains("VESC id 1"), "{error}");
    // The answers of the others would be commands to it.
    let error = bus.attach(&mut as_asker, Safety::COAST).unwrap_err();
    assert!(matches!(error, AttachError::Clash { clash: Clash::Confuses(_), .. }), "{error}");
}

/// Every VESC obeys frames to id 255.
#[test]
fn no_other_motor_may_send_what_every_vesc_obeys() {
    let id = ExtendedId::new(0x3FF).unwrap();
    let stranger = Frames::new(IdPattern::exact(id), 4, Rate::EveryTick);
    let stranger = CanIds::new().transmits(stranger);
    assert_eq!(vesc(1).can_ids().clash(&stranger), Some(Clash::Confuses(id.into())));
}

#[test]
fn loads_are_as_said_and_as_measured() {
    let switch = ArmSwitch::new();
    let mut vescs = [1, 2, 3, 4].map(vesc);
    let mut wheels = [1, 2].map(|id| {
        Dji::new(dji::Config::new(&M3508, id).with_feedback_rate(FeedbackRate::Hz500)).unwrap()
    });
    let mut bench = Bench::new(3, &switch);
    let mut motors = Vec::new();
    for (motor, number) in vescs.iter_mut().zip(1..) {
        let device = device(number);
        bench.wire.add(rc10_sim::vesc::Vesc::new(device).unwrap(), device.plant);
        motors.push(bench.attach(motor, Safety::COAST).unwrap());
    }
    let alone = bench.bus.load(1_000_000);
    // 200 commands, 200 and 200 and 10 reports a second, each.
    assert_eq!(alone.frames_per_second, 4 * 610);
    assert!((31.0..34.0).contains(&alone.typical), "{}", alone.typical);
    for (wheel, number) in wheels.iter_mut().zip(1..) {
        let mut config = rc10_sim::EscConfig::new(rc10_sim::Model::C620, number);
        config.rate = rc10_sim::FeedbackRate::Hz500;
        bench.wire.add_esc(config).unwrap();
        motors.push(bench.attach(wheel, Safety::COAST).unwrap());
    }
    let plan = bench.bus.load(1_000_000);
    assert_eq!(plan.verdict(), Verdict::Fits);
    switch.arm().unwrap();
    for _ in 0..3000 {
        let now = bench.world.now();
        for motor in &motors {
            bench.bus.command(*motor, Target::Speed(Rpm::new(300.0)), now).unwrap();
        }
        bench.tick();
    }
    let measured = bench.wire.load();
    assert!((measured - f64::from(plan.typical)).abs() < 3.0, "{measured} {plan:?}");
    assert!(measured < f64::from(plan.worst) && measured > f64::from(plan.least));
    assert_eq!(bench.refused, 0);
}

#[test]
fn with_every_status_six_fit_and_the_seventh_is_refused_by_name() {
    let every = StatusRates {
        status_1: 50,
        status_2: 5,
        status_3: 5,
        status_4: 5,
        status_5: 50,
        status_6: 5,
    };
    let mut vescs = [1, 2, 3, 4, 5, 6, 7]
        .map(|number| Vesc::new(Config { status: every, ..config(number) }).unwrap());
    let switch = ArmSwitch::new();
    let mut bus = MotorBus::new(&switch);
    for (index, vesc) in vescs.iter_mut().enumerate() {
        match bus.attach(vesc, Safety::COAST) {
            Ok(_) => assert!(index < 6),
            Err(error) => {
                assert_eq!(index, 6);
                assert!(matches!(error, AttachError::TableFull { .. }));
                assert!(error.to_string().contains("VESC id 7"), "{error}");
            }
        }
    }
}

#[test]
fn a_frame_is_sent_when_there_is_something_to_say() {
    let mut motor = vesc(5);
    let mut sent = Vec::new();
    let mut tick = |motor: &mut Vesc, link, mode, millis: u32| {
        sent.clear();
        for _ in 0..millis {
            let tx = sent_in(motor, &Tick { link, ..Tick::new(mode) });
            let key = CanFrame::key_of(ExtendedId::new(5).unwrap());
            for (frame, stream) in tx.entries() {
                assert!(frame.raw_id() == 0x1105 || stream == key);
                sent.push(frame.to_string());
            }
        }
        sent.clone()
    };
    // Repeated at 200 Hz; after half a second it is asked whether it is there.
    assert_eq!(tick(&mut motor, Link::NeverSeen, DriveMode::Off, 1), ["00000105#00000000"]);
    let sent = tick(&mut motor, Link::NeverSeen, DriveMode::Off, 510);
    assert_eq!(sent.iter().filter(|frame| *frame == "00000105#00000000").count(), 102);
    assert_eq!(sent.iter().filter(|frame| *frame == "00001105#FE").count(), 1);
    assert_eq!(sent.len(), 103);
    // Nothing is done before it was heard.
    motor.set_target(Target::Duty(0.5)).unwrap();
    assert_eq!(tick(&mut motor, Link::NeverSeen, DriveMode::Run, 1), ["00000105#00000000"]);
    motor.unpack_feedback(&frame(0x905, &[0; 8]), Micros::ZERO, Link::NeverSeen).unwrap();
    // Another way to drive does not wait, and the same one does.
    motor.set_target(Target::Speed(Rpm::new(100.0))).unwrap();
    let _ = tick(&mut motor, Link::Online, DriveMode::Off, 2);
    assert_eq!(tick(&mut motor, Link::Online, DriveMode::Run, 1), ["00000305#000002BC"]);
    motor.set_target(Target::Speed(Rpm::new(200.0))).unwrap();
    assert_eq!(tick(&mut motor, Link::Online, DriveMode::Run, 5), ["00000305#00000578"]);
    motor.set_target(Target::Brake(Amps::new(3.0))).unwrap();
    assert_eq!(tick(&mut motor, Link::Online, DriveMode::Run, 1), ["00000205#00000BB8"]);
    assert_eq!(tick(&mut motor, Link::Online, DriveMode::Coast, 1), ["00000105#00000000"]);
    let mut image = TxBatch::new();
    motor.coast_frames(&mut image).unwrap();
    assert_eq!(image.frames()[0].to_string(), "00000105#00000000");
}

/// Its encoder shows 90 degrees where its tachometer has just begun at zero.
#[test]
fn an_angle_that_the_device_seeks_stays_where_it_is_under_a_new_zero() {
    for (direction, seen, sought) in [
        (Direction::Forward, 90.0, "00000405#05F5E100"),
        // 260 degrees.
        (Direction::Reversed, 270.0, "00000405#0F7F4900"),
    ] {
        let mut config = Config { encoder_on_shaft: true, direction, ..config(5) };
        config.status.status_4 = 200;
        let mut motor = Vesc::new(config).unwrap();
        let hear = |motor: &mut Vesc, raw, data: [u8; 8]| {
            motor.unpack_feedback(&frame(raw, &data), Micros::ZERO, Link::Online).unwrap();
        };
        hear(&mut motor, 0x905, [0; 8]);
        hear(&mut motor, 0x1B05, [0; 8]);
        assert_eq!(motor.request(Request::SetZero), Err(RequestError::NoFeedback));
        // 4500 steps of 0.02 degrees.
        hear(&mut motor, 0x1005, [0, 0, 0, 0, 0, 0, 0x11, 0x94]);
        assert_eq!(motor.feedback().angle, Degrees::new(seen));
        motor.set_target(Target::Angle(Degrees::new(100.0))).unwrap();
        let sent = |motor: &mut Vesc| {
            // As long as until a command is repeated.
            (0..4).for_each(|_| motor.update(&Tick::new(DriveMode::Run)));
            sent_in(motor, &Tick::new(DriveMode::Run)).frames()[0].to_string()
        };
        assert_eq!(sent(&mut motor), sought);
        assert_eq!(motor.request(Request::SetZero), Ok(Response::Done));
        let way = (100.0 - seen).rem_euclid(360.0);
        assert_eq!(motor.target(), Target::Angle(Degrees::new(way)));
        assert_eq!(motor.feedback().angle, Degrees::ZERO);
        assert_eq!(sent(&mut motor), sought);
    }
}

#[test]
fn a_frame_that_finds_no_room_is_sent_in_the_next_tick() {
    let mut motor = vesc(5);
    motor.unpack_feedback(&frame(0x905, &[0; 8]), Micros::ZERO, Link::NeverSeen).unwrap();
    motor.set_target(Target::Brake(Amps::new(3.0))).unwrap();
    motor.update(&Tick::new(DriveMode::Run));
    let mut full = TxBatch::new();
    while full.push(frame(1, &[])).is_ok() {}
    assert!(motor.pack_command(&mut full).is_err());
    let tx = sent_in(&mut motor, &Tick::new(DriveMode::Run));
    assert_eq!(tx.frames()[0].to_string(), "00000205#00000BB8");
}

#[test]
fn frames_of_others_and_of_other_lengths_change_nothing() {
    let mut motor = vesc(5);
    let at = Micros::from_millis(3);
    let eight = [0, 0, 0x10, 0, 0, 10, 0, 10];
    for (frame, error) in [
        // Not switched on.
        (frame(0xE05, &eight), FrameError::NotMine),
        (frame(0x12FE, &[5, 0, 0]), FrameError::Length),
        (frame(0x12FE, &[6, 0]), FrameError::NotMine),
        (frame(0x12FE, &[5, 1]), FrameError::Unexpected),
        (frame(0x12FD, &[5, 0]), FrameError::NotMine),
        (frame(0x12FE, &[6, 0, 0]), FrameError::NotMine),
        (frame(0xE05, &eight[..7]), FrameError::NotMine),
    ] {
        assert_eq!(motor.unpack_feedback(&frame, at, Link::Online), Err(error), "{frame}");
        assert_eq!(motor.feedback(), rc10_motor::Feedback::NEW);
    }
    assert_eq!(
        motor.unpack_feedback(&frame(0x905, &eight), at, Link::Online),
        Ok(FrameKind::Feedback)
    );
    assert_eq!(
        motor.unpack_feedback(&frame(0x1B05, &eight), at, Link::Online),
        Ok(FrameKind::Other)
    );
    assert_eq!(
        motor.unpack_feedback(&frame(0x12FE, &[5, 0]), at, Link::Online),
        Ok(FrameKind::Other)
    );
    let told = motor.feedback();
    assert_eq!((told.at, told.speed), (at, Rpm::new(4096.0 / 7.0)));
    assert_eq!(told.current(), Some(Amps::new(1.0)));
}
