use super::super::models::{CYBERGEAR, RS00, RS04};
use super::*;
extern crate std;
use std::string::ToString;

use embedded_can::StandardId;

const TO: Address = Address { motor: 127, host: 0xFD };

fn setpoint(position: f32, velocity: f32, torque: f32, kp: f32, kd: f32) -> Setpoint {
    Setpoint { position, velocity, kp, kd, torque }
}

/// From `CyberGearDriver`, run; RobStride's with its manual's ranges.
#[test]
fn setpoints_have_the_bytes_of_other_drivers() {
    let cybergear = CYBERGEAR.limits;
    let four_pi = Limits { position: 4.0 * core::f32::consts::PI, ..cybergear };
    let full = setpoint(12.5, 30.0, 12.0, 500.0, 5.0);
    let some = setpoint(3.3, -7.7, 5.5, 77.0, 2.25);
    for (motor, setpoint, limits, bytes) in [
        (127, Setpoint::COAST, cybergear, "017FFF7F#7FFF7FFF00000000"),
        (1, full, cybergear, "01FFFF01#FFFFFFFFFFFFFFFF"),
        (16, some, cybergear, "01BAA910#A1CA5F25276C7332"),
        (1, full, four_pi, "01FFFF01#FF51FFFFFFFFFFFF"),
        (16, some, four_pi, "01BAA910#A19C5F25276C7332"),
        (9, setpoint(1.0, -4.0, 2.0, 40.0, 0.8), RS00.limits, "01924809#8A2E707B147A28F5"),
        (9, setpoint(6.0, -1.5, 60.5, 1000.0, 33.0), RS04.limits, "01C08709#BD1873323333547A"),
    ] {
        assert_eq!(motion(motor, &setpoint, &limits).to_string(), bytes);
    }
    let nan = setpoint(f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN);
    assert_eq!(motion(127, &nan, &cybergear).to_string(), "017FFF7F#7FFF7FFF00000000");
}

#[test]
fn commands_have_the_bytes_of_other_drivers() {
    let mute = Address { host: 0, ..TO };
    for (frame, bytes) in [
        (identify(TO), "0000FD7F#0000000000000000"),
        (enable(TO), "0300FD7F#0000000000000000"),
        (stop(TO), "0400FD7F#0000000000000000"),
        (clear_faults(TO), "0400FD7F#0100000000000000"),
        (set_zero(TO), "0600FD7F#0100000000000000"),
        (set_id(TO, 5), "0705FD7F#0100000000000000"),
        (read(TO, Parameter::SUPPLY), "1100FD7F#1C70000000000000"),
        (write_byte(mute, Parameter::RUN_MODE, 2), "1200007F#0570000002000000"),
        (write_real(mute, Parameter::POSITION, -1.25), "1200007F#167000000000A0BF"),
        (write_real(mute, Parameter::POSITION, f32::NAN), "1200007F#1670000000000000"),
    ] {
        assert_eq!(frame.to_string(), bytes);
    }
}

fn extended(raw: u32, data: [u8; 8]) -> CanFrame {
    CanFrame::eight_bytes(ExtendedId::new(raw).unwrap(), data)
}

#[test]
fn feedback_has_the_values_of_other_drivers() {
    for kind in [0x02, 0x18] {
        let bytes = [0xFF, 0xFF, 0, 0, 0xFF, 0xFF, 3, 0xE9];
        let frame = extended(kind << 24 | 0x85_0312, bytes);
        let Ok(Reply::Feedback(heard)) = Reply::unpack(&frame, &CYBERGEAR.limits) else {
            panic!("no feedback")
        };
        assert_eq!(heard.address, Address { motor: 3, host: 0x12 });
        assert_eq!((heard.mode, heard.faults), (Mode::Run, 5));
        let values = [heard.position, heard.velocity, heard.torque].map(f32::to_bits);
        assert_eq!(values, [12.5_f32, -30.0, 12.0].map(f32::to_bits));
        assert!((heard.temperature.get() - 100.1).abs() < 1e-4);
    }
}

#[test]
fn parameters_faults_and_identities_are_told_apart() {
    let unpack = |raw, data| Reply::unpack(&extended(raw, data), &CYBERGEAR.limits);
    let address = Address { motor: 127, host: 0xFD };
    let Ok(Reply::Parameter(value)) = unpack(0x1100_7FFD, [0x1C, 0x70, 0, 0, 0, 0, 0xC0, 0x41])
    else {
        panic!("no parameter")
    };
    assert_eq!((value.address, value.parameter), (address, Parameter::SUPPLY));
    assert_eq!((value.real(), value.byte()), (Some(24.0), 0));
    let infinite = ParameterValue { bytes: [0, 0, 0x80, 0x7F], ..value };
    assert_eq!(infinite.real(), None);
    let Ok(Reply::Parameter(unknown)) = unpack(0x1101_7FFD, [0x1C, 0x77, 0, 0, 0, 0, 0, 0]) else {
        panic!("no parameter")
    };
    assert!(unknown.refused && !value.refused);
    assert_eq!(
        unpack(0x1500_7FFD, [4, 0, 1, 0, 1, 0, 0, 0]),
        Ok(Reply::Faults(FaultReport { address, faults: 0x1_0004, warnings: 1 }))
    );
    assert_eq!(
        unpack(0x0000_7FFE, [1, 2, 3, 4, 5, 6, 7, 8]),
        Ok(Reply::Identity { motor: 127, chip: 0x0102_0304_0506_0708 })
    );
}

#[test]
fn what_is_no_reply_says_why() {
    let unpack = |frame| Reply::unpack(&frame, &CYBERGEAR.limits).unwrap_err();
    // What hosts send.
    for kind in [0_u32, 1, 3, 4, 6, 7, 18, 22, 31] {
        assert_eq!(unpack(extended(kind << 24 | 0xFD7F, [0; 8])), FrameError::NotMine, "{kind}");
    }
    let id = ExtendedId::new(0x0280_7F00).unwrap();
    assert_eq!(unpack(CanFrame::data_frame(id, &[0; 7]).unwrap()), FrameError::Length);
    assert_eq!(unpack(CanFrame::remote_frame(id, 8).unwrap()), FrameError::NotMine);
    let short = StandardId::new(0x7F).unwrap();
    assert_eq!(unpack(CanFrame::eight_bytes(short, [0; 8])), FrameError::NotMine);
}
