//! Two codecs that were written apart: what one says, the other hears.

use crate::motors::{cases, number};
use proptest::prelude::*;
use rc10_app::{Amps, NewtonMetres};
use rc10_motor::odrive::{
    AxisState, Command, ControlMode, InputMode, Message, Node, Query, Temperatures,
};
use rc10_sim::odrive::{
    Order, decode, encode_currents, encode_estimates, encode_heartbeat, encode_supply,
    encode_temperatures,
};

fn node(number: u8) -> Node {
    Node::new(number).unwrap()
}

/// What the axis hears; `None` where there is no number to send.
fn heard(command: Command, number: u8) -> Option<Order> {
    let packed = command.pack(node(number));
    let frame = packed.as_ref().map_or_else(|nan| nan.neutral, |frame| *frame);
    assert_eq!(frame.raw_id() >> 5, u32::from(number));
    let order = decode((frame.raw_id() & 31) as u8, frame.bytes()).unwrap();
    packed.is_ok().then_some(order)
}

fn finite(number: f32) -> f32 {
    number.clamp(f32::MIN, f32::MAX)
}

fn steps(number: f32) -> f64 {
    (f64::from(number) * 1000.0).clamp(-32_768.0, 32_767.0)
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn inputs_arrive(number in 0..64_u8, a in number(50.0), b in number(50.0), c in number(50.0)) {
        let torque = NewtonMetres::new;
        match heard(Command::Position { position: a, velocity: b, torque: torque(c) }, number) {
            Some(Order::Position(position, velocity, torque)) => {
                prop_assert_eq!(position.to_bits(), finite(a).to_bits());
                prop_assert!((f64::from(velocity) - steps(b)).abs() <= 1.0);
                prop_assert!((f64::from(torque) - steps(c)).abs() <= 1.0);
            }
            other => prop_assert!(
                other.is_none() && (a.is_nan() || b.is_nan() || c.is_nan()), "{other:?}"
            ),
        }
        match heard(Command::Velocity { velocity: a, torque: torque(b) }, number) {
            Some(Order::Velocity(velocity, torque)) => {
                prop_assert_eq!(velocity.to_bits(), finite(a).to_bits());
                prop_assert_eq!(torque.to_bits(), finite(b).to_bits());
            }
            other => prop_assert!(other.is_none() && (a.is_nan() || b.is_nan()), "{other:?}"),
        }
        match heard(Command::Torque(torque(a)), number) {
            Some(Order::Torque(torque)) => prop_assert_eq!(torque.to_bits(), finite(a).to_bits()),
            other => prop_assert!(other.is_none() && a.is_nan(), "{other:?}"),
        }
        match heard(Command::Limits { velocity: a, current: Amps::new(b) }, number) {
            Some(Order::Limits(velocity, current)) => {
                prop_assert!(velocity == finite(a).max(0.0) && current == finite(b).max(0.0));
            }
            other => prop_assert!(other.is_none() && (a.is_nan() || b.is_nan()), "{other:?}"),
        }
    }

    #[test]
    fn messages_arrive(number in 0..64_u8, a in number(50.0), b in number(50.0), bytes: [u8; 8]) {
        let [x, y] = [a, b].map(f64::from);
        let refused = !a.is_finite() || !b.is_finite();
        let same = |one: f32, other: f32| one.to_bits() == other.to_bits();
        for frame in [
            encode_estimates(number, x, y),
            encode_currents(number, x, y),
            encode_supply(number, x, y),
        ] {
            let (low, high) = match Message::from_frame(&frame, node(number)) {
                Ok(Message::Estimates(it)) => (it.position, it.velocity),
                Ok(Message::Currents(it)) => (it.setpoint.get(), it.measured.get()),
                Ok(Message::Supply(it)) => (it.voltage, it.current.get()),
                other => {
                    prop_assert!(refused && other.is_err(), "{other:?}");
                    continue;
                }
            };
            prop_assert!(same(low, a) && same(high, b) && !refused);
        }
        let told = Temperatures::from_frame(&encode_temperatures(number, x, y), node(number)).unwrap();
        for (told, sent) in [(told.controller.get(), a), (told.motor.get(), b)] {
            let arrived = if sent.is_finite() { same(told, sent) } else { told.is_nan() };
            prop_assert!(arrived);
        }
        let [p, q, r, s, state, details @ ..] = bytes;
        let errors = u32::from_le_bytes([p, q, r, s]);
        let frame = encode_heartbeat(number, errors, state, details);
        let Ok(Message::Heartbeat(heartbeat)) = Message::from_frame(&frame, node(number)) else {
            return Err(TestCaseError::fail("no heartbeat"));
        };
        prop_assert_eq!((heartbeat.errors, heartbeat.state.number()), (errors, state));
        prop_assert_eq!(heartbeat.details, details);
    }
}

#[test]
fn modes_states_and_clearing_arrive() {
    use ControlMode::{Position, Torque, Velocity, Voltage};
    use InputMode::{Passthrough, PositionFilter, Trapezoid, VelocityRamp};
    for (control, number) in [(Voltage, 0), (Torque, 1), (Velocity, 2), (Position, 3)] {
        for (input, mode) in
            [(Passthrough, 1), (VelocityRamp, 2), (PositionFilter, 3), (Trapezoid, 5)]
        {
            let order = heard(Command::Modes(control, input), 7);
            assert_eq!(order, Some(Order::Modes(number, mode)));
        }
    }
    assert_eq!(heard(Command::State(AxisState::IDLE), 7), Some(Order::State(1)));
    assert_eq!(heard(Command::State(AxisState::CLOSED_LOOP), 7), Some(Order::State(8)));
    assert_eq!(heard(Command::ClearErrors, 7), Some(Order::ClearErrors));
}

/// Old firmware sends some messages only when asked.
#[test]
fn questions_are_answered() {
    use rc10_can::CanPort;
    use rc10_sim::odrive::{Axis, Settings, Version};
    use rc10_time::Micros;
    let mut world = rc10_sim::World::new(3);
    let bus = world.add_bus(rc10_sim::BusConfig::default());
    let settings = Settings {
        version: Version::V0_5,
        estimates_every: Micros::from_millis(1000),
        heartbeat_every: Micros::from_millis(1000),
        ..Settings::new(7)
    };
    bus.add(Axis::new(settings).unwrap(), super::plant());
    let mut port = bus.port();
    world.advance(Micros::from_millis(1001));
    while port.receive().is_some() {}
    for (millis, query) in [(1, Query::Estimates), (2, Query::Currents), (3, Query::Supply)] {
        let _ = port.submit(&query.pack(node(7)));
        world.advance(Micros::from_millis(1001 + millis));
        let (frame, _) = port.receive().unwrap();
        match (query, Message::from_frame(&frame, node(7)).unwrap()) {
            (Query::Estimates, Message::Estimates(_)) | (Query::Currents, Message::Currents(_)) => {
            }
            (Query::Supply, Message::Supply(supply)) => assert_eq!(supply.voltage, 24.0),
            other => panic!("{other:?}"),
        }
    }
}
