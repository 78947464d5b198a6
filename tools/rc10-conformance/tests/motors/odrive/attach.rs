//! What an axis cannot be, and who it cannot share a bus with.

use rc10_app::{Amps, Gear, PidConfig, Rpm};
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::lk::models::MG4010E_I10;
use rc10_motor::lk::{self, Lk};
use rc10_motor::odrive::{Config, Control, Firmware, InputMode, Limits, ODrive, Rates};
use rc10_motor::{
    ArmSwitch, AttachError, CanMotor, Clash, MotorBus, Rate, Safety, TxBatch, Verdict,
};

use super::{NODE, WHEEL, wheel, with};

fn error(node: u8, config: Config) -> &'static str {
    ODrive::new(Config { node, ..config }).err().unwrap().field
}

#[test]
fn what_cannot_be_is_named() {
    for node in [63, 64, 255] {
        assert_eq!(error(node, wheel()), "node");
    }
    assert_eq!(error(1, wheel().with_gear(Gear::new(1, 3).unwrap())), "gear");
    let cascade = super::Cascade { speed: PidConfig::new(-1.0, 0.0, 0.0, 1.0), ..WHEEL };
    assert_eq!(error(1, with(Control::Torque(cascade))), "kp");
    for input in [InputMode::Inactive, InputMode::PositionFilter, InputMode::Mirror] {
        assert_eq!(error(1, with(Control::Velocity(input))), "input mode");
    }
    for input in [InputMode::Inactive, InputMode::VelocityRamp, InputMode::TorqueRamp] {
        assert_eq!(error(1, with(Control::Position(input))), "input mode");
    }
    let bare = Config { limits: None, ..with(Control::Velocity(InputMode::Passthrough)) };
    assert_eq!(error(1, bare), "limits");
    let rates = |rates| Config { rates, ..wheel() };
    assert_eq!(error(1, rates(Rates::new(0, 10))), "estimates");
    assert_eq!(error(1, rates(Rates::new(1001, 10))), "estimates");
    assert_eq!(error(1, rates(Rates::new(100, 0))), "heartbeat");
    assert_eq!(error(1, rates(Rates::new(100, 101))), "heartbeat");
    assert_eq!(error(1, rates(Rates { currents: 101, ..Rates::new(100, 10) })), "currents");
    assert_eq!(error(1, rates(Rates { supply: 101, ..Rates::new(100, 10) })), "supply");
    let warm = Rates { temperatures: 1, ..Rates::new(100, 10) };
    let old = Config { firmware: Firmware::V0_5, rates: warm, ..wheel() };
    assert_eq!(error(1, old), "temperatures");
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let limits = |speed, current| {
            wheel().with_limits(Limits { speed: Rpm::new(speed), current: Amps::new(current) })
        };
        assert_eq!(error(1, limits(bad, 1.0)), "speed limit");
        assert_eq!(error(1, limits(1.0, bad)), "current limit");
        assert_eq!(error(1, Config { torque_constant: Some(bad), ..wheel() }), "torque_constant");
    }
    assert!(ODrive::new(Config { node: 62, ..wheel() }).is_ok());
}

#[test]
fn nodes_that_lie_on_other_vendors_identifiers_are_refused() {
    let switch = ArmSwitch::new();
    let refused = |node: u8, other: &mut dyn CanMotor| {
        let mut odrive = ODrive::new(Config { node, ..wheel() }).unwrap();
        let mut bus = MotorBus::new(&switch);
        bus.attach(other, Safety::COAST).unwrap();
        match bus.attach(&mut odrive, Safety::COAST) {
            Err(AttachError::Clash { motor, clash, .. }) => {
                assert_eq!((motor.model, motor.id), ("ODrive", node.into()));
                Some(clash)
            }
            Err(other) => panic!("{other}"),
            Ok(_) => None,
        }
    };
    let mut dji = Dji::new(dji::Config::new(&M3508, 1)).unwrap();
    for node in 0..63 {
        // 0x200 and 0x201 are node 16's.
        assert_eq!(refused(node, &mut dji).is_some(), node == 16, "{node}");
    }
    let mut fifth = Dji::new(dji::Config::new(&M3508, 5)).unwrap();
    assert!(refused(15, &mut fifth).is_some(), "0x1FF");
    // Its feedback alone lies there, and would be a command.
    assert!(matches!(refused(16, &mut fifth), Some(Clash::Confuses(_))), "0x205");
    let mut joint = Lk::new(lk::Config::new(MG4010E_I10, 1, super::super::lk::JOINT)).unwrap();
    assert!(refused(10, &mut joint).is_some(), "0x141");
    let mut last = Lk::new(lk::Config::new(MG4010E_I10, 32, super::super::lk::JOINT)).unwrap();
    assert!(refused(11, &mut last).is_some(), "0x160");
    let mut same = ODrive::new(wheel()).unwrap();
    assert!(matches!(refused(NODE, &mut same), Some(Clash::RxFrames(_) | Clash::TxFrames(_))));
    assert_eq!(refused(NODE + 1, &mut same), None);
}

#[test]
fn what_comes_is_declared() {
    let rates = Rates { currents: 100, temperatures: 10, supply: 20, ..Rates::new(500, 50) };
    let wiring = ODrive::new(Config { rates, ..wheel() }).unwrap().can_ids();
    let told: Vec<_> =
        wiring.received().iter().map(|it| (it.pattern.to_string(), it.rate)).collect();
    let wanted = [("069", 500), ("061", 50), ("074", 100), ("075", 10), ("077", 20)];
    assert_eq!(told.len(), wanted.len());
    for ((pattern, rate), (id, hz)) in told.into_iter().zip(wanted) {
        assert!(pattern.contains(id), "{pattern}");
        assert_eq!(rate, Rate::Hz(hz));
    }
    assert_eq!(wiring.link_timeout().get(), 10_000);
    let slow = ODrive::new(Config { rates: Rates::new(100, 10), ..wheel() }).unwrap();
    assert_eq!(slow.can_ids().link_timeout().get(), 30_000);
}

/// Percent of 1 Mbit/s.
#[test]
fn three_axes_fit_beside_a_wheel() {
    let switch = ArmSwitch::new();
    let mut dji = Dji::new(dji::Config::new(&M3508, 1)).unwrap();
    let mut axes = [1, 2, 3].map(|node| ODrive::new(Config { node, ..wheel() }).unwrap());
    let mut bus = MotorBus::new(&switch);
    for (count, axis) in axes.iter_mut().enumerate() {
        bus.attach(axis, Safety::COAST).unwrap();
        if count == 0 {
            let load = bus.load(1_000_000);
            assert_eq!((load.typical.round(), load.worst.round()), (24.0, 28.0));
        }
    }
    assert_eq!(bus.load(1_000_000).verdict(), Verdict::Fits);
    bus.attach(&mut dji, Safety::COAST).unwrap();
    assert_eq!(bus.load(1_000_000).verdict(), Verdict::Tight);

    let mut tx = TxBatch::new();
    bus.coast_image(&mut tx).unwrap();
    assert_eq!(tx.frames()[2].to_string(), "067#0100000000000000");
}
