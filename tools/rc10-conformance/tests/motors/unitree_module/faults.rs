//! Cut wires, lost power, silence, and what a motor finds wrong with itself.

use rc10_motor::rc10_app::{Degrees, NewtonMetres};
use rc10_motor::{Condition, DriveMode, Impedance, Link, SafeState, Safety, Target};
use rc10_sim::EscFault;
use rc10_sim::unitree_module::{Mode, plant};

use super::{One, behind, speed, with_plant};

/// The torque may rise no faster than a soft start allows: 10 % of 23.7 N m a millisecond, seen
/// through a tick and the current loop.
fn assert_soft(one: &mut One, target: Target, millis: u32) {
    let mut last = one.torque();
    for milli in 0..millis {
        one.hold(target, 1);
        let torque = one.torque();
        assert!((torque - last).abs() < 4.8, "{milli} ms: from {last} to {torque}");
        last = torque;
    }
}

#[test]
fn a_cut_wire_is_noticed_and_the_motor_comes_back_without_a_kick() {
    let far = Target::Impedance(Impedance {
        angle: Degrees::new(700.0),
        kp: 60.0,
        kd: 1.0,
        ..Impedance::default()
    });
    for target in [speed(150.0), Target::Torque(NewtonMetres::new(20.0)), far] {
        let heavy = plant().with_load_inertia(1.0);
        let mut one = with_plant(Safety::COAST, heavy).armed();
        one.hold(target, 100);
        one.bench.wire.set_cut(true);
        one.hold(target, 9);
        assert_eq!(one.bench.status(one.motor).link, Link::Online);
        one.hold(target, 100);
        let status = one.bench.status(one.motor);
        assert_eq!((status.link, status.drive), (Link::Lost, DriveMode::Coast));
        let _ = one.bench.wire.take_trace();
        one.bench.wire.set_cut(false);
        // Whatever the motor hears now, it is to be locked: no older torque waits.
        one.hold(target, 2);
        let heard = one.bench.wire.take_trace();
        let heard: Vec<_> = heard.iter().filter(|entry| entry.from_controller).collect();
        assert_eq!(heard[0].frame.raw_id(), 0x180A_0000);
        assert!(heard.iter().all(|entry| entry.frame.raw_id() & 0xF000 == 0), "{heard:?}");
        assert_eq!(one.mode(), Mode::Locked, "{target:?}");
        let status = one.bench.status(one.motor);
        assert_eq!((status.link, status.condition), (Link::Online, Condition::Starting));
        one.hold(target, 4);
        assert_soft(&mut one, target, 60);
        assert_eq!(one.bench.status(one.motor).condition, Condition::Ready);
        assert!(one.torque() > 3.0, "{target:?}: {}", one.torque());
    }
}

#[test]
fn a_motor_that_somebody_else_locked_is_set_up_anew() {
    let mut one = with_plant(Safety::COAST, plant().with_load_inertia(50.0));
    let mut lock = rc10_motor::TxBatch::new();
    one.bench.bus.coast_image(&mut lock).unwrap();
    one.switch.arm().unwrap();
    let target = Target::Torque(NewtonMetres::new(20.0));
    one.hold(target, 200);
    one.bench.wire.inject(&lock.frames()[0]);
    let conditions: Vec<_> = (0..10)
        .map(|_| {
            one.hold(target, 1);
            one.bench.status(one.motor).condition
        })
        .collect();
    assert!(conditions.contains(&Condition::Starting), "{conditions:?}");
    assert_eq!(conditions.last(), Some(&Condition::Ready));
    assert_soft(&mut one, target, 50);
    assert!((one.torque() - 20.0).abs() < 0.1);
    assert_eq!(one.bench.status(one.motor).counters.lost, 0);
}

#[test]
fn a_cable_off_behind_the_module_is_a_lost_motor() {
    let mut one = behind(Safety::COAST).armed();
    one.hold(speed(60.0), 300);
    assert!(one.esc.inject(EscFault::CommunicationLost));
    one.hold(speed(60.0), 30);
    assert_eq!(one.bench.status(one.motor).link, Link::Lost);
    assert!(!one.esc.inject(EscFault::UnderVoltage));
}

#[test]
fn an_impedance_ends_in_the_safe_state_too() {
    for state in [SafeState::Coast, SafeState::Brake, SafeState::Hold] {
        let mut one = behind(Safety::new(state)).armed();
        let spring = Impedance { kp: 20.0, kd: 0.5, ..Impedance::default() };
        one.hold(Target::Impedance(spring), 300);
        one.switch.emergency_stop();
        one.bench.wait(10);
        assert_eq!(one.gains().stiffness, 0.0, "{state:?}");
        assert_eq!(one.bench.status(one.motor).condition, Condition::Ready);
        one.esc.set_load(1.0);
        one.bench.wait(300);
        match state {
            SafeState::Coast => assert!(one.rpm() > 60.0, "{}", one.rpm()),
            SafeState::Brake => assert!(one.rpm() < 5.0, "{}", one.rpm()),
            SafeState::Hold => assert!(one.rpm().abs() < 1.0, "{}", one.rpm()),
        }
    }
}
