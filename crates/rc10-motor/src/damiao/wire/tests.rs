#![expect(clippy::approx_constant, reason = "the numbers the vendor code was run with")]

use super::*;
extern crate std;
use std::string::ToString;

use embedded_can::ExtendedId;

fn id(raw: u16) -> DeviceId {
    DeviceId::new(raw).unwrap()
}

fn limits(position: f32, velocity: f32, torque: f32) -> Limits {
    Limits::new(position, velocity, torque)
}

fn setpoint(position: f32, velocity: f32, kp: f32, kd: f32, torque: f32) -> Setpoint {
    Setpoint { position, velocity, kp, kd, torque }
}

/// From the vendor's compiled `dm_motor_drv.c`; the last, which the vendor would wrap, by the rule.
#[test]
fn setpoints_have_the_bytes_of_the_vendor_code() {
    let j4310 = limits(12.5, 30.0, 10.0);
    for (raw, setpoint, limits, bytes) in [
        (1, Setpoint::COAST, j4310, "001#7FFF7FF0000007FF"),
        (1, setpoint(-3.141_592_7, -5.5, 120.0, 2.5, -1.25), j4310, "001#5FD46883D67FF6FF"),
        (2, setpoint(-12.5, -30.0, 0.0, 0.0, -10.0), j4310, "002#0000000000000000"),
        (
            4,
            setpoint(-6.0, 10.0, 200.0, 4.0, -20.0),
            limits(12.5, 45.0, 54.0),
            "004#428F9C6666CCC509",
        ),
        (
            9,
            setpoint(11.1, 3.0, 250.0, 1.75, -150.0),
            limits(12.5, 20.0, 200.0),
            "009#F1A99327FF5991FF",
        ),
        (1, setpoint(13.0, -31.0, -1.0, 6.0, 10.5), j4310, "001#FFFF000000FFFFFF"),
    ] {
        assert_eq!(mit(id(raw), &setpoint, &limits).to_string(), bytes);
    }
}

#[test]
fn not_a_number_is_the_neutral_value() {
    let nan = setpoint(f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN);
    assert_eq!(mit(id(1), &nan, &limits(12.5, 30.0, 10.0)).to_string(), "001#7FFF7FF0000007FF");
    assert_eq!(velocity(id(1), f32::NAN).to_string(), "201#00000000");
    assert_eq!(force_position(id(1), 0.0, f32::NAN, f32::NAN).to_string(), "301#0000000000000000");
}

#[test]
fn no_setpoint_is_an_operation() {
    let limits = limits(12.5, 30.0, 1.0);
    // Every value of the torque field, from the middle of its step.
    for raw in 0..4096_u16 {
        let torque = (f32::from(raw) + 0.5) / 4095.0 * 2.0 - 1.0;
        let frame = mit(id(1), &setpoint(99.0, 99.0, 999.0, 9.0, torque), &limits);
        let bytes = *frame.all_eight().unwrap();
        let kd = if (0xFFB..=0xFFE).contains(&raw) { 0xE0 } else { 0xF0 };
        let [high, low] = raw.to_be_bytes();
        assert_eq!(bytes, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, kd | high, low]);
    }
}

#[test]
fn the_other_modes_have_the_bytes_of_the_vendor_code() {
    for (frame, bytes) in [
        (position_velocity(id(5), 3.14159, 10.0), "105#D00F494000002041"),
        (position_velocity(id(12), 100.125, -0.5), "10C#0040C842000000BF"),
        (velocity(id(3), 6.283), "203#560EC940"),
        (force_position(id(1), 1.5, 12.25, 0.5), "301#0000C03FC9048813"),
        (force_position(id(11), 0.0, 100.0, 1.0), "30B#0000000010271027"),
        (force_position(id(11), 0.0, 1e9, -1.0), "30B#0000000010270000"),
        (velocity(id(3), f32::NEG_INFINITY), "203#FFFF7FFF"),
        (operate(id(1), Mode::Mit, Operation::Enable), "001#FFFFFFFFFFFFFFFC"),
        (operate(id(1), Mode::PositionVelocity, Operation::Disable), "101#FFFFFFFFFFFFFFFD"),
        (operate(id(5), Mode::Velocity, Operation::StoreZero), "205#FFFFFFFFFFFFFFFE"),
        (operate(id(5), Mode::ForcePosition, Operation::ClearError), "305#FFFFFFFFFFFFFFFB"),
    ] {
        assert_eq!(frame.to_string(), bytes);
    }
}

#[test]
fn an_identifier_leaves_room_for_every_offset() {
    assert_eq!(DeviceId::new(0x4FF), None);
    assert_eq!(id(0x4FE).command_id(Mode::ForcePosition).as_raw(), 0x7FE);
    assert!(id(0x12).answers_as(2) && !id(0x12).answers_as(1));
}

#[test]
fn feedback_has_the_values_of_the_vendor_code() {
    let bytes = [0x14, 0x5A, 0x3C, 0x91, 0xE4, 0x37, 0x23, 0x31];
    let frame = CanFrame::eight_bytes(standard(0x11), bytes);
    let feedback = Feedback::unpack(&frame, &limits(12.5, 10.0, 28.0)).unwrap();
    assert_eq!((feedback.id, feedback.state), (4, State::Enabled));
    assert!((feedback.position + 3.687_914_9).abs() < 1e-5);
    assert!((feedback.velocity - 1.399_267_2).abs() < 1e-5);
    assert!((feedback.torque + 13.244_445).abs() < 1e-4);
    assert_eq!(feedback.driver_temperature, Celsius::new(35.0));
    assert_eq!(feedback.motor_temperature, Celsius::new(49.0));
}

#[test]
fn errors_have_a_text_and_unknown_ones_their_code() {
    for code in 0..16 {
        let bytes = [code << 4 | 1, 0, 0, 0, 0, 0, 0, 0];
        let frame = CanFrame::eight_bytes(standard(0), bytes);
        let state = Feedback::unpack(&frame, &limits(1.0, 1.0, 1.0)).unwrap().state;
        assert_eq!(state.code(), code);
        assert_eq!(state.fault().map(|fault| fault.code), (code > 1).then_some(code.into()));
    }
    assert_eq!(State::Error(0xD).fault(), Some(Fault::new(13, "communication lost")));
}

#[test]
fn what_is_no_feedback_says_why() {
    let unpack = |frame| Feedback::unpack(&frame, &limits(1.0, 1.0, 1.0)).unwrap_err();
    let long = ExtendedId::new(0x11).unwrap();
    assert_eq!(unpack(CanFrame::eight_bytes(long, [0; 8])), FrameError::NotMine);
    assert_eq!(unpack(CanFrame::remote_frame(standard(0), 8).unwrap()), FrameError::NotMine);
    assert_eq!(unpack(CanFrame::data_frame(standard(0), &[0; 7]).unwrap()), FrameError::Length);
}
