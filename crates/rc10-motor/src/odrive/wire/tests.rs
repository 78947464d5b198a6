use super::super::Firmware;
use super::*;
extern crate std;
use std::string::{String, ToString};

fn node(number: u8) -> Node {
    Node::new(number).unwrap()
}

fn sent(command: Command) -> String {
    command.pack(node(3)).unwrap().to_string()
}

#[test]
fn nodes_go_from_0_to_63() {
    assert_eq!(Node::new(64), None);
    assert_eq!(node(63).can_id(0x1F).as_raw(), 0x7FF);
    assert_eq!(node(0).can_id(ESTIMATES).as_raw(), 0x009);
    assert_eq!(Node::of(node(42).can_id(0x17)), (node(42), 0x17));
}

/// odrive-can's DBC of firmware 0.5.6, and IEEE 754.
#[test]
fn commands_have_the_bytes_of_the_vendors_dbc() {
    let torque = NewtonMetres::new;
    for (command, frame) in [
        (Command::State(AxisState::CLOSED_LOOP), "067#0800000000000000"),
        (Command::Modes(ControlMode::Velocity, InputMode::Trapezoid), "06B#0200000005000000"),
        (
            Command::Position { position: 1.5, velocity: -0.25, torque: torque(1.5) },
            "06C#0000C03F06FFDC05",
        ),
        (
            Command::Position {
                position: f32::INFINITY,
                velocity: 33.0,
                torque: torque(f32::NEG_INFINITY),
            },
            "06C#FFFF7F7FFF7F0080",
        ),
        (Command::Velocity { velocity: 2.5, torque: torque(-0.25) }, "06D#00002040000080BE"),
        (Command::Torque(torque(0.75)), "06E#0000403F00000000"),
        (Command::Torque(torque(f32::NEG_INFINITY)), "06E#FFFF7FFF00000000"),
        (Command::Limits { velocity: 10.0, current: Amps::new(20.0) }, "06F#000020410000A041"),
        (Command::Limits { velocity: -1.0, current: Amps::new(-20.0) }, "06F#0000000000000000"),
        (Command::ClearErrors, "078#"),
    ] {
        assert_eq!(sent(command), frame, "{command:?}");
    }
    assert_eq!(Query::Estimates.pack(node(3)).to_string(), "069#R8");
    assert_eq!(Query::Currents.pack(node(3)).to_string(), "074#R8");
    assert_eq!(Query::Supply.pack(node(3)).to_string(), "077#R8");
}

#[test]
fn what_is_not_a_number_is_reported_and_neutral() {
    let (nan, one) = (f32::NAN, NewtonMetres::new(1.0));
    let none = NewtonMetres::new(nan);
    for (command, field, neutral) in [
        (Command::Torque(none), "torque", "06E#0000000000000000"),
        (Command::Velocity { velocity: nan, torque: one }, "velocity", "06D#000000000000803F"),
        (Command::Velocity { velocity: 1.0, torque: none }, "torque", "06D#0000803F00000000"),
        (
            Command::Position { position: nan, velocity: 1.0, torque: one },
            "position",
            "06D#0000000000000000",
        ),
        (
            Command::Position { position: 1.0, velocity: nan, torque: one },
            "velocity",
            "06C#0000803F0000E803",
        ),
        (
            Command::Position { position: 1.0, velocity: 1.0, torque: none },
            "torque",
            "06C#0000803FE8030000",
        ),
        (
            Command::Limits { velocity: nan, current: Amps::new(1.0) },
            "velocity limit",
            "06F#0000000000000000",
        ),
        (
            Command::Limits { velocity: 1.0, current: Amps::new(nan) },
            "current limit",
            "06F#0000000000000000",
        ),
    ] {
        let error = command.pack(node(3)).unwrap_err();
        assert_eq!((error.field, error.neutral.to_string().as_str()), (field, neutral));
    }
}

fn heard(message: u8, bytes: [u8; 8]) -> Result<Message, FrameError> {
    Message::from_frame(&CanFrame::eight_bytes(node(5).can_id(message), bytes), node(5))
}

#[test]
fn messages_are_unpacked() {
    let heartbeat = Heartbeat { errors: 64, state: AxisState::CLOSED_LOOP, details: [1, 2, 3] };
    assert_eq!(heard(0x01, [0x40, 0, 0, 0, 8, 1, 2, 3]), Ok(Message::Heartbeat(heartbeat)));
    assert_eq!(
        heard(0x09, [0, 0, 0xC0, 0x3F, 0, 0, 0x50, 0xC0]),
        Ok(Message::Estimates(Estimates { position: 1.5, velocity: -3.25 }))
    );
    assert_eq!(
        heard(0x14, [0, 0, 0x40, 0x40, 0, 0, 0x38, 0x40]),
        Ok(Message::Currents(Currents { setpoint: Amps::new(3.0), measured: Amps::new(2.875) }))
    );
    assert_eq!(
        heard(0x17, [0, 0, 0xC4, 0x41, 0, 0, 0xA0, 0xBF]),
        Ok(Message::Supply(Supply { voltage: 24.5, current: Amps::new(-1.25) }))
    );
}

#[test]
fn what_is_no_message_is_refused() {
    for message in [0x00, 0x02, 0x07, 0x0D, 0x18, 0x1F] {
        assert_eq!(heard(message, [0; 8]), Err(FrameError::Unexpected));
    }
    for message in [0x09, 0x14, 0x17] {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let [a, b, c, d] = bad.to_le_bytes();
            for bytes in [[a, b, c, d, 0, 0, 0, 0], [0, 0, 0, 0, a, b, c, d]] {
                assert_eq!(heard(message, bytes), Err(FrameError::Unexpected));
            }
        }
    }
    let of = |frame| Message::from_frame(&frame, node(5));
    let id = node(5).can_id(ESTIMATES);
    assert_eq!(of(CanFrame::data_frame(id, &[0; 7]).unwrap()), Err(FrameError::Length));
    let extended = embedded_can::ExtendedId::new(id.as_raw().into()).unwrap();
    for stranger in [
        CanFrame::remote_frame(id, 8).unwrap(),
        CanFrame::eight_bytes(extended, [0; 8]),
        CanFrame::eight_bytes(node(4).can_id(ESTIMATES), [0; 8]),
    ] {
        assert_eq!(of(stranger), Err(FrameError::NotMine));
    }
}

#[test]
fn the_gravest_error_speaks() {
    let text = |firmware: Firmware, errors| firmware.fault(errors).map(|fault| fault.text);
    assert_eq!(text(Firmware::V0_5, 0), None);
    assert_eq!(text(Firmware::V0_5, 1 << 6 | 1), Some("motor failed"));
    assert_eq!(text(Firmware::V0_6, 1 << 6 | 1 << 14), Some("controller too hot"));
    assert_eq!(text(Firmware::V0_5, 1 << 31), Some("an undocumented error"));
    assert_eq!(Firmware::V0_5.fault(65).map(|fault| fault.code), Some(65));
    for firmware in [Firmware::V0_5, Firmware::V0_6] {
        let bits = firmware.errors.iter().fold(0, |bits, (bit, _)| bits | 1 << bit);
        assert_eq!(u32::count_ones(bits), u32::try_from(firmware.errors.len()).unwrap());
    }
    assert_eq!(AxisState::CLOSED_LOOP.name(), Some("closed-loop control"));
    assert_eq!(AxisState::new(15).name(), None);
}

#[test]
fn temperatures_may_be_missing() {
    let [a, b, c, d] = 31.5_f32.to_le_bytes();
    let of = |message, bytes| {
        let frame = CanFrame::eight_bytes(node(5).can_id(message), bytes);
        Temperatures::from_frame(&frame, node(5))
    };
    for absent in [f32::NAN, f32::INFINITY] {
        let [e, f, g, h] = absent.to_le_bytes();
        let told = of(0x15, [a, b, c, d, e, f, g, h]).unwrap();
        assert_eq!(told.controller, Celsius::new(31.5));
        assert!(told.motor.get().is_nan());
    }
    assert_eq!(of(0x09, [0; 8]), Err(FrameError::Unexpected));
    assert_eq!(of(0x16, [0; 8]), Err(FrameError::Unexpected));
}
