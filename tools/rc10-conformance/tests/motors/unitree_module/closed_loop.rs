//! Each sort of target is reached, bare and loaded, with a motor that is not quite what we think.

use rc10_motor::rc10_app::{Degrees, NewtonMetres, TotalAngle};
use rc10_motor::unitree::ModuleConfig;
use rc10_motor::{Impedance, Request, RequestError, Safety, Target, TargetError, TargetKind};
use rc10_sim::unitree_module::plant;
use rc10_sim::{Plant, Scale};

use super::{One, behind, speed, with_module, with_plant};

/// Bare and with 0.02 kg m², each with inertia, friction and magnets 30 % off.
fn plants() -> Vec<Plant> {
    let mut plants = Vec::new();
    for load in [0.0, 0.02] {
        for (inertia, friction, torque_constant) in
            [(1.0, 1.0, 1.0), (1.3, 0.7, 0.7), (0.7, 1.3, 1.3), (1.3, 1.3, 0.7), (0.7, 0.7, 1.3)]
        {
            let by = Scale { inertia, friction, torque_constant };
            plants.push(plant().with_load_inertia(load).scaled(by));
        }
    }
    plants
}

/// Follows a target from rest: the largest overshoot, and the millisecond from which it stays
/// within the band.
fn respond(
    one: &mut One,
    target: Target,
    goal: f64,
    (millis, band): (usize, f64),
    measure: impl Fn(&One) -> f64,
) -> (f64, usize) {
    let track: Vec<f64> = (0..millis)
        .map(|_| {
            one.hold(target, 1);
            measure(one)
        })
        .collect();
    let over = track.iter().fold(0.0_f64, |most, at| most.max((at - goal) * goal.signum()));
    let settled = track.iter().rposition(|at| (at - goal).abs() > band).map_or(0, |last| last + 1);
    (over, settled)
}

#[test]
fn a_speed_is_reached_and_kept() {
    for plant in plants() {
        let mut one = with_plant(Safety::COAST, plant).armed();
        let (over, settled) = respond(&mut one, speed(150.0), 150.0, (1000, 3.0), |one| one.rpm());
        assert!(over < 3.5 && settled < 300, "{over} rpm over, {settled} ms: {plant:?}");
        assert!((one.rpm() - 150.0).abs() < 1.5, "{}", one.rpm());
        one.hold(speed(-20.0), 800);
        assert!((one.rpm() + 20.0).abs() < 1.5, "{}", one.rpm());
    }
}

#[test]
fn an_angle_is_reached_and_kept() {
    for plant in plants() {
        let (mut one, _) = with_module(ModuleConfig::new(2, 14), Safety::COAST, plant);
        one.bench.bus.request(one.motor, Request::SetZeroOfDriven).unwrap();
        one.switch.arm().unwrap();
        let target = Target::TotalAngle(TotalAngle::from_degrees(720));
        let (over, settled) = respond(&mut one, target, 720.0, (2500, 1.0), |one| one.told());
        assert!(over < 0.5 && settled < 1600, "{over} degrees over, {settled} ms: {plant:?}");
        assert!((one.told() - 720.0).abs() < 0.5, "{}", one.told());
        // 350 degrees lie ten back.
        one.hold(Target::Angle(Degrees::new(350.0)), 800);
        assert!((one.told() - 710.0).abs() < 0.5, "{}", one.told());
    }
}

fn spring(kp: f32, kd: f32) -> Impedance {
    Impedance { kp, kd, ..Impedance::default() }
}

#[test]
fn an_impedance_obeys_the_torque_limit_and_starts_softly() {
    let heavy = plant().with_load_inertia(50.0);
    let mut one = with_plant(Safety::COAST, heavy);
    one.bench.bus.request(one.motor, Request::SetZeroOfDriven).unwrap();
    one.switch.arm().unwrap();
    let far = |torque| Impedance {
        angle: Degrees::new(3000.0),
        torque: NewtonMetres::new(torque),
        ..spring(100.0, 2.0)
    };
    let mut last = 0.0;
    for millis in 0..60 {
        one.hold(Target::Impedance(far(0.0)), 1);
        let torque = one.torque();
        // 5 % of 23.7 N m a millisecond, seen through a tick and the current loop.
        assert!(torque - last < 2.4, "{millis} ms: from {last} to {torque}");
        last = torque;
    }
    assert!((last - 23.7).abs() < 0.2, "{last}");
    let limit = Request::TorqueLimit(NewtonMetres::new(3.0));
    one.bench.bus.request(one.motor, limit).unwrap();
    // The spring alone asks for 5,000 N m: nothing on top turns that round.
    for (asked, made) in [(0.0, 3.0), (50.0, 3.0), (-50.0, 3.0)] {
        one.hold(Target::Impedance(far(asked)), 100);
        assert!((one.torque() - made).abs() < 0.2, "{asked}: {}", one.torque());
    }
}

#[test]
fn whatever_takes_over_starts_softly() {
    let torque = NewtonMetres::new(20.0);
    // Without stiffness and damping no set-up lies between the two.
    let given = Target::Impedance(Impedance { torque, ..Impedance::default() });
    let far = |kp| Target::Impedance(Impedance { angle: Degrees::new(3000.0), ..spring(kp, 1.0) });
    for [first, second] in
        [[Target::Torque(torque), given], [given, Target::Torque(torque)], [far(50.0), far(80.0)]]
    {
        let heavy = plant().with_load_inertia(50.0);
        let mut one = with_plant(Safety::COAST, heavy).armed();
        for target in [second, first] {
            one.hold(target, 100);
            assert!(one.torque() > 19.0, "{target:?}");
        }
        let track: Vec<f64> = (0..60)
            .map(|_| {
                one.hold(second, 1);
                one.torque()
            })
            .collect();
        let least = track.iter().copied().fold(f64::INFINITY, f64::min);
        let steepest = track.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        assert!(least < 8.0 && steepest < 4.8, "{second:?}: {track:?}");
        assert!(track.last().is_some_and(|last| *last > 19.0), "{second:?}: {track:?}");
    }
}

#[test]
fn what_cannot_be_is_refused_and_changes_nothing() {
    let mut one = behind(Safety::COAST);
    let now = one.bench.world.now();
    let mut refused = |target| {
        let error = one.bench.bus.command(one.motor, target, now).unwrap_err();
        assert_eq!(one.bench.status(one.motor).target, Target::Coast);
        error.to_string()
    };
    let out = TargetError::OutOfRange(TargetKind::Impedance).to_string();
    assert_eq!(refused(Target::Impedance(spring(-1.0, 0.0))), out);
    assert_eq!(refused(Target::Impedance(spring(0.0, 1026.0))), out);
    let far = Impedance { angle: Degrees::new(1e13), ..spring(1.0, 0.0) };
    assert_eq!(refused(Target::Impedance(far)), out);
    let nan = TargetError::NotFinite(TargetKind::Impedance).to_string();
    assert_eq!(refused(Target::Impedance(spring(f32::NAN, 0.0))), nan);
    let unsupported = TargetError::Unsupported(TargetKind::Duty).to_string();
    assert_eq!(refused(Target::Duty(0.5)), unsupported);
    for request in [Request::StoreZero, Request::ReadRegister(0), Request::SaveRegisters] {
        let answer = one.bench.bus.request(one.motor, request);
        assert_eq!(answer, Err(RequestError::Unsupported));
    }
}
