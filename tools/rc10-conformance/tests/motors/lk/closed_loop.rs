//! Each mode reaches what it is told to reach.

use rc10_app::{Amps, Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::Bench;
use rc10_motor::lk::{Commands, Config, Lk, Model};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{
    ArmSwitch, Condition, Motor, Request, RequestError, Response, Safety, Target, TargetError,
    TargetKind,
};
use rc10_sim::lk::{Drive, Goal, Settings};

use crate::motors::{rpm, settles};

use super::{bench, is_on, joint, joint_plant, wheel, wheel_plant};

#[test]
fn a_joint_reaches_its_speed_and_its_angle() {
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), Settings::mg(1), joint_plant(), Safety::COAST);
    let target = Target::Speed(Rpm::new(100.0));
    // 100 rpm at 1000 rpm/s are 100 ms.
    let took = settles(&mut bench, id, target, || rpm(&esc) - 100.0, 3.0);
    assert!((90..200).contains(&took), "{took} ms");
    bench.hold(id, target, 800).unwrap();
    assert!((rpm(&esc) - 100.0).abs() < 0.3, "{}", rpm(&esc));
    let told = bench.status(id).feedback;
    assert!((f64::from(told.speed.get()) - rpm(&esc)).abs() < 0.5);
    assert!(told.torque().is_some() && told.temperature().is_some());
    assert!((told.supply().unwrap().get() - 24.0).abs() < 0.06);

    let goal = 3 * 360 + 45;
    let start = esc.state().output_degrees;
    let zero = f64::from(told.total_angle.degrees().get());
    let off = || esc.state().output_degrees - start - (f64::from(goal) - zero);
    let target = Target::TotalAngle(TotalAngle::from_degrees(goal));
    let took = settles(&mut bench, id, target, off, 0.5);
    assert!(took < 900, "{took} ms");
    let told = bench.status(id).feedback;
    assert!((told.total_angle.degrees().get() - 1125.0).abs() < 0.3, "{}", told.total_angle);
    assert!((told.angle.get() - 45.0).abs() < 0.3);

    // The shorter way round, backwards.
    let target = Target::Angle(Degrees::new(350.0));
    bench.hold(id, target, 1500).unwrap();
    let told = bench.status(id).feedback;
    assert!((told.total_angle.degrees().get() - (1080.0 - 10.0)).abs() < 0.5);
    assert_eq!((told.turn_gaps, bench.refused()), (0, 0));
}

#[test]
fn a_reversed_wheel_turns_the_other_way() {
    let config = wheel().with_direction(Direction::Reversed);
    let motor = Lk::new(Config { id: 2, ..config }).unwrap();
    let (mut bench, esc, id) = bench(motor, Settings::mf(2), wheel_plant(), Safety::COAST);
    let target = Target::Speed(Rpm::new(200.0));
    let took = settles(&mut bench, id, target, || rpm(&esc) + 200.0, 4.0);
    assert!(took < 600, "{took} ms");
    let told = bench.status(id).feedback;
    assert!((told.speed.get() - 200.0).abs() < 2.0, "{}", told.speed);
    let before = (told.total_angle.degrees().get(), esc.state().output_degrees);
    bench.hold(id, target, 500).unwrap();
    let after = bench.status(id).feedback.total_angle.degrees().get();
    let turned = f64::from(after - before.0) + esc.state().output_degrees - before.1;
    assert!(turned.abs() < 2.0, "{turned}");
}

#[test]
fn currents_and_torques_are_given_as_asked() {
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), Settings::mg(1), joint_plant(), Safety::COAST);
    let step = 33.0 / 2048.0;
    bench.hold(id, Target::Current(Amps::new(1.0)), 60).unwrap();
    assert!((esc.state().current - 1.0).abs() < step, "{}", esc.state().current);
    let torque = Target::Torque(NewtonMetres::new(-1.4));
    bench.hold(id, torque, 60).unwrap();
    assert_eq!(bench.status(id).target, torque);
    assert!((esc.state().current + 2.0).abs() < step, "{}", esc.state().current);
    let told = bench.status(id).feedback;
    assert!((told.torque().unwrap().get() + 1.4).abs() < 0.02);

    // Limits: of the loops, of a request, of the drive's own scale.
    bench.hold(id, Target::Torque(NewtonMetres::new(f32::MAX)), 30).unwrap();
    assert!((esc.state().current - 5.0).abs() < 2.0 * step, "{}", esc.state().current);
    assert_eq!(bench.bus.request(id, Request::CurrentLimit(Amps::new(0.5))), Ok(Response::Done));
    bench.hold(id, Target::Current(Amps::new(-9.0)), 30).unwrap();
    assert!((esc.state().current + 0.5).abs() < step);
    let limit = Request::TorqueLimit(NewtonMetres::new(0.7));
    assert_eq!(bench.bus.request(id, limit), Ok(Response::Done));
    bench.hold(id, Target::Current(Amps::new(9.0)), 30).unwrap();
    assert!((esc.state().current - 1.0).abs() < 2.0 * step);
    for bad in [-1.0, f32::NAN] {
        let limit = Request::TorqueLimit(NewtonMetres::new(bad));
        let Err(RequestError::Config(error)) = bench.bus.request(id, limit) else { panic!() };
        assert_eq!((error.field, error.value.to_bits()), ("torque limit", f32::to_bits(bad)));
    }
    // A number that is none changes nothing.
    let nan = bench.hold(id, Target::Current(Amps::new(f32::NAN)), 1);
    assert!(nan.is_err());
    assert!(bench.hold(id, Target::Duty(0.1), 1).is_err());
}

#[test]
fn without_a_torque_constant_there_is_no_torque() {
    let mut motor =
        Lk::new(Config { model: Model { torque_constant: None, ..joint().model }, ..joint() })
            .unwrap();
    assert!(!motor.supports().contains(TargetKind::Torque));
    let torque = Target::Torque(NewtonMetres::new(1.0));
    assert_eq!(motor.set_target(torque), Err(TargetError::Unsupported(TargetKind::Torque)));
    let limit = Request::TorqueLimit(NewtonMetres::new(1.0));
    assert_eq!(motor.request(limit), Err(RequestError::Unsupported));
    assert_eq!(motor.request(Request::SetZero), Err(RequestError::NoFeedback));
    assert_eq!(motor.request(Request::StoreZero), Err(RequestError::Unsupported));
}

#[test]
fn zero_is_where_it_is_set() {
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), Settings::mg(1), joint_plant(), Safety::HOLD);
    let quarter = Target::TotalAngle(TotalAngle::from_degrees(90));
    bench.hold(id, quarter, 1500).unwrap();
    assert_eq!(bench.bus.request(id, Request::SetZeroOfDriven), Ok(Response::Done));
    let before = esc.state().output_degrees;
    bench.wait(300);
    assert!((esc.state().output_degrees - before).abs() < 0.2);
    assert!(bench.status(id).feedback.total_angle.degrees().get().abs() < 0.2);
    bench.hold(id, quarter, 1500).unwrap();
    assert!((esc.state().output_degrees - before - 90.0).abs() < 0.3);
}

#[test]
fn a_drive_is_switched_on_and_off_by_frames_that_are_repeated() {
    let settings = Settings { is_late: true, ..Settings::mg(1) };
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), settings, joint_plant(), Safety::COAST);
    assert!(!is_on(&esc));
    let mut starting = 0;
    while !is_on(&esc) || bench.status(id).condition == Condition::Starting {
        bench.hold(id, Target::Current(Amps::new(1.0)), 1).unwrap();
        starting += 1;
        assert!(starting < 12);
    }
    bench.hold(id, Target::Current(Amps::new(1.0)), 30).unwrap();
    assert_eq!(esc.with(|drive: &mut Drive| drive.goal()), Some(Goal::Current(62)));
    bench.bus.switch().disarm();
    bench.wait(5);
    assert!(!is_on(&esc) && esc.state().current == 0.0);
    // And it stays on the bus, and off, until it is armed.
    for _ in 0..300 {
        bench.tick();
        assert!(!is_on(&esc));
        assert_eq!(bench.status(id).link, rc10_motor::Link::Online);
        for frame in bench.sent().frames() {
            assert!([0x80, 0x9A, 0x9C].contains(&frame.bytes()[0]), "{frame}");
        }
    }
}

#[test]
fn four_drives_are_driven_by_one_frame() {
    let switch = ArmSwitch::new();
    let mut motors = [1, 2, 3, 4]
        .map(|id| Lk::new(Config { id, ..wheel().with_commands(Commands::MultiMotor) }).unwrap());
    let mut bench = Bench::new(3, &switch);
    let escs = [1, 2, 3, 4].map(|id| {
        let settings = Settings { multi_motor: true, ..Settings::mf(id) };
        bench.wire.add(Drive::new(settings).unwrap(), wheel_plant())
    });
    let ids: Vec<_> =
        motors.iter_mut().map(|motor| bench.attach(motor, Safety::COAST).unwrap()).collect();
    bench.wait(20);
    switch.arm().unwrap();
    let speeds = [50.0, -100.0, 150.0, 0.0];
    for _ in 0..1000 {
        let now = bench.world.now();
        for (id, rpm) in ids.iter().zip(speeds) {
            bench.bus.command(*id, Target::Speed(Rpm::new(rpm)), now).unwrap();
        }
        bench.tick();
        assert_eq!(bench.sent().frames().len(), 1);
    }
    for (esc, wanted) in escs.iter().zip(speeds) {
        assert!((rpm(esc) - f64::from(wanted)).abs() < 2.0, "{}", rpm(esc));
    }
    assert_eq!(bench.bus.request(ids[0], Request::ClearFault), Err(RequestError::Unsupported));
    // Other motors' bytes are not touched when one stops.
    switch.disarm();
    bench.tick();
    assert_eq!(bench.sent().frames()[0].to_string(), "280#0000000000000000");
}
