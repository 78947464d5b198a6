//! What an axis cannot be, and who it cannot share a bus with.

use rc10_app::{Amps, Gear, PidConfig, Rpm};
use rc10_motor::odrive::{Config, Control, Firmware, InputMode, Limits, ODrive, Rates};
use rc10_motor::{CanMotor, Rate};

use super::{WHEEL, wheel, with};

fn error(node: u8, config: Config) -> &'static str {
    ODrive::new(Config { node, ..config }).err().unwrap().field
}

#[test]
fn what_cannot_be_is_named() {
    for node in [63, 64, 255] {
        assert_eq!(error(node, wheel()), "node");
    }
    assert_eq!(error(1, wheel().with_gear(Gear::new(1, 3).unwrap())), "gear");
    let cascade = super::Cascade { speed: PidConfig::within(1.0).kp(-1.0), ..WHEEL };
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
