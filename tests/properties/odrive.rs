//! `ODrive`'s `CANSimple` against a second codec, written from the DBC alone, for thousands of
//! values: the same ones in each run.

use proptest::array::uniform8;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use rc10_app::{Amps, NewtonMetres};
use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_motor::FrameError;
use rc10_motor::odrive::{
    AxisState, Command, ControlMode, Firmware, InputMode, Message, Node, Query,
};

use super::any;

/// Mostly near the ranges of real motors.
fn number() -> impl Strategy<Value = f32> {
    any::number_below(50.0)
}

fn node() -> impl Strategy<Value = Node> {
    (0..=63_u8).prop_map(|number| Node::new(number).unwrap())
}

/// Little endian, sign by hand.
fn short(bytes: &[u8]) -> i32 {
    let magnitude = i32::from(bytes[0]) + 256 * i32::from(bytes[1]);
    if magnitude > 32_767 { magnitude - 65_536 } else { magnitude }
}

fn long(bytes: &[u8]) -> u32 {
    bytes[..4].iter().rev().fold(0, |sum, &byte| sum * 256 + u32::from(byte))
}

/// The f32 on the wire is the one that was given, or the nearest that there is.
fn carries(bytes: &[u8], x: f32) -> bool {
    let carried = f32::from_bits(long(bytes));
    let wanted = if x.is_infinite() { f32::MAX.copysign(x) } else { x };
    carried.to_bits() == wanted.to_bits()
}

fn carries_steps(bytes: &[u8], x: f32) -> bool {
    let wanted = (f64::from(x) * 1000.0).clamp(-32_768.0, 32_767.0);
    (f64::from(short(bytes)) - wanted).abs() <= 0.51
}

/// The bytes of a command; `None` if it is refused, which it must be exactly if it is `bad`.
fn packed(command: Command, node: Node, message: u8, bad: bool) -> Option<[u8; 8]> {
    let frame = match command.pack(node) {
        Ok(frame) => {
            assert!(!bad, "{command:?} is not a number, and became {frame}");
            frame
        }
        Err(error) => {
            assert!(bad, "{command:?}: {error}");
            let bytes = *error.neutral.all_eight().unwrap();
            let finite = |bytes| f32::from_bits(long(bytes)).is_finite();
            assert!(finite(&bytes[..4]));
            assert!(error.neutral.raw_id() & 31 == 0x0C || finite(&bytes[4..]));
            return None;
        }
    };
    assert_eq!(frame.raw_id(), u32::from(node.number()) * 32 + u32::from(message));
    assert!(!frame.is_extended_id());
    Some(*frame.all_eight().unwrap())
}

proptest! {
    #![proptest_config(any::cases(3000))]

    #[test]
    fn inputs_arrive_as_they_were_given(
        node in node(), x in number(), y in number(), z in number(),
    ) {
        let torque = NewtonMetres::new;
        let bad = x.is_nan() || y.is_nan() || z.is_nan();
        let position = Command::Position { position: x, velocity: y, torque: torque(z) };
        if let Some(bytes) = packed(position, node, 0x0C, bad) {
            prop_assert!(carries(&bytes, x));
            prop_assert!(carries_steps(&bytes[4..], y) && carries_steps(&bytes[6..], z));
        }
        let bad = x.is_nan() || y.is_nan();
        let velocity = Command::Velocity { velocity: x, torque: torque(y) };
        if let Some(bytes) = packed(velocity, node, 0x0D, bad) {
            prop_assert!(carries(&bytes, x) && carries(&bytes[4..], y));
        }
        let limits = Command::Limits { velocity: x, current: Amps::new(y) };
        if let Some(bytes) = packed(limits, node, 0x0F, bad) {
            prop_assert!(long(&bytes) == 0 || carries(&bytes, x.max(0.0)));
            prop_assert!(long(&bytes[4..]) == 0 || carries(&bytes[4..], y.max(0.0)));
            prop_assert_eq!((x > 0.0, y > 0.0), (long(&bytes) != 0, long(&bytes[4..]) != 0));
        }
        if let Some(bytes) = packed(Command::Torque(torque(x)), node, 0x0E, x.is_nan()) {
            prop_assert!(carries(&bytes, x) && long(&bytes[4..]) == 0);
        }
    }

    #[test]
    fn states_and_modes_are_their_numbers(
        node in node(),
        state in any::<u8>(),
        control in select(&[
            (0, ControlMode::Voltage), (1, ControlMode::Torque), (2, ControlMode::Velocity),
            (3, ControlMode::Position),
        ][..]),
        input in select(&[
            (0, InputMode::Inactive), (1, InputMode::Passthrough), (2, InputMode::VelocityRamp),
            (3, InputMode::PositionFilter), (4, InputMode::MixChannels), (5, InputMode::Trapezoid),
            (6, InputMode::TorqueRamp), (7, InputMode::Mirror), (8, InputMode::Tuning),
        ][..]),
    ) {
        let bytes = packed(Command::State(AxisState::new(state)), node, 0x07, false).unwrap();
        prop_assert_eq!((long(&bytes), long(&bytes[4..])), (state.into(), 0));
        let modes = Command::Modes(control.1, input.1);
        let bytes = packed(modes, node, 0x0B, false).unwrap();
        prop_assert_eq!((long(&bytes), long(&bytes[4..])), (control.0, input.0));
    }

    #[test]
    fn every_message_is_what_the_dbc_says(
        node in node(),
        bytes in prop_oneof![
            uniform8(any::<u8>()),
            (number(), number()).prop_map(|(x, y)| {
                let [[a, b, c, d], [e, f, g, h]] = [x, y].map(f32::to_le_bytes);
                [a, b, c, d, e, f, g, h]
            }),
        ],
        message in prop_oneof![4 => select(&[1_u8, 9, 0x14, 0x17][..]), 1 => 0..=31_u8],
    ) {
        let id = StandardId::new(u16::from(node.number()) * 32 + u16::from(message)).unwrap();
        prop_assert_eq!(Node::of(id), (node, message));
        let heard = Message::from_frame(&CanFrame::eight_bytes(id, bytes), node);
        let (low, high) = (f32::from_bits(long(&bytes)), f32::from_bits(long(&bytes[4..])));
        let same = |a: f32, b: f32| {
            a.to_bits() == low.to_bits() && b.to_bits() == high.to_bits()
                && a.is_finite() && b.is_finite()
        };
        match (heard, message) {
            (Ok(Message::Heartbeat(heartbeat)), 1) => {
                prop_assert_eq!(heartbeat.errors, long(&bytes));
                prop_assert_eq!(heartbeat.state.number(), bytes[4]);
                prop_assert_eq!(heartbeat.details, [bytes[5], bytes[6], bytes[7]]);
                for firmware in [Firmware::V0_5, Firmware::V0_6] {
                    let fault = firmware.fault(heartbeat.errors);
                    prop_assert_eq!(fault.map_or(0, |fault| fault.code), long(&bytes));
                }
            }
            (Ok(Message::Estimates(it)), 9) => prop_assert!(same(it.position, it.velocity)),
            (Ok(Message::Currents(it)), 0x14) => {
                prop_assert!(same(it.setpoint.get(), it.measured.get()));
            }
            (Ok(Message::Supply(it)), 0x17) => {
                prop_assert!(same(it.voltage, it.current.get()));
            }
            (Err(FrameError::Unexpected), 9 | 0x14 | 0x17) => {
                prop_assert!(!low.is_finite() || !high.is_finite());
            }
            (Err(FrameError::Unexpected), other) => prop_assert!(other != 1),
            (other, message) => prop_assert!(false, "{:#04X} became {:?}", message, other),
        }
    }

    #[test]
    fn only_eight_bytes_of_its_own_are_a_message(
        (node, frame) in node().prop_flat_map(|node| {
            let first = u16::from(node.number()) << 5;
            let ids = any::either(prop_oneof![first..=first + 31, 0..=0x7FF_u16]);
            (Just(node), any::frame_of(ids, vec(any::<u8>(), 0..=8)))
        }),
    ) {
        let own = !frame.is_extended_id()
            && !frame.is_remote()
            && frame.raw_id() >> 5 == u32::from(node.number());
        match Message::from_frame(&frame, node) {
            Err(FrameError::NotMine) => prop_assert!(!own),
            Err(FrameError::Length) => prop_assert!(own && frame.len() != 8),
            Ok(_) | Err(_) => prop_assert!(own && frame.len() == 8),
        }
    }
}

#[test]
fn queries_and_clearing_carry_nothing() {
    for number in 0..=63 {
        let node = Node::new(number).unwrap();
        let base = u32::from(number) * 32;
        for (query, message) in
            [(Query::Estimates, 9), (Query::Currents, 0x14), (Query::Supply, 0x17)]
        {
            let frame = query.pack(node);
            assert!(frame.is_remote() && frame.raw_id() == base + message, "{frame}");
        }
        let frame = Command::ClearErrors.pack(node).unwrap();
        assert!(frame.raw_id() == base + 0x18 && frame.len() == 0, "{frame}");
    }
}
