//! Each mode reaches what it is told to reach.

use rc10_app::{Amps, NewtonMetres, Rpm};
use rc10_conformance::Bench;
use rc10_motor::lk::{Commands, Config, Lk, Model};
use rc10_motor::{
    ArmSwitch, Condition, Motor, Request, RequestError, Safety, Target, TargetError, TargetKind,
};
use rc10_sim::lk::{Drive, Goal, Settings};

use crate::motors::rpm;

use super::{bench, is_on, joint, joint_plant, wheel, wheel_plant};

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
    assert_eq!(esc.with(|drive: &mut Drive| drive.goal), Some(Goal::Current(62)));
    bench.bus.switch().disarm();
    bench.wait(5);
    assert!(!is_on(&esc) && esc.state().current == 0.0);
    // And it stays on the bus, and off, until it is armed.
    for _ in 0..300 {
        bench.tick();
        assert!(!is_on(&esc));
        assert_eq!(bench.status(id).link, rc10_motor::Link::Online);
        for frame in bench.sent.frames() {
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
        assert_eq!(bench.sent.frames().len(), 1);
    }
    for (esc, wanted) in escs.iter().zip(speeds) {
        assert!((rpm(esc) - f64::from(wanted)).abs() < 2.0, "{}", rpm(esc));
    }
    assert_eq!(bench.bus.request(ids[0], Request::ClearFault), Err(RequestError::Unsupported));
    // Other motors' bytes are not touched when one stops.
    switch.disarm();
    bench.tick();
    assert_eq!(bench.sent.frames()[0].to_string(), "280#0000000000000000");
}
