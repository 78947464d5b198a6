extern crate std;

use std::{format, string::ToString};

use rc10_app::{CountsPerTurn, Direction, Gear, Rpm, TotalAngle};

use super::super::{GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508};
use super::*;
use crate::motor::DriveMode;
use crate::request::Gains;
use crate::target::{Target, TargetError};

fn frame(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::eight_bytes(StandardId::new(id).unwrap(), data)
}

/// Feedback of rotor `angle` and `rpm` of the motor with feedback identifier `id`.
fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    frame(id, [a, b, c, d, 0, 0, 0, 0])
}

#[test]
fn feedback_of_a_c620() {
    let mut wheel = Dji::new(Config::new(&M3508, 1)).unwrap();
    let bytes = [0x10, 0x00, 0x01, 0xF4, 0x40, 0x00, 35, 0];
    let heard = wheel.unpack_feedback(&frame(0x201, bytes), Micros::new(7), Link::Online);
    assert_eq!(heard, Ok(FrameKind::Feedback));
    let seen = wheel.feedback();
    assert_eq!((seen.at, seen.current()), (Micros::new(7), Some(Amps::new(20.0))));
    assert_eq!(seen.temperature(), Some(Celsius::new(35.0)));
    assert!((seen.speed.get() - 26.037_315).abs() < 1e-4);
    // Half a rotor turn is 9.37 degrees of the output.
    assert!((seen.total_angle.degrees().get() - 180.0 / 19.203_21).abs() < 1e-3);
    assert!((seen.torque().unwrap().get() - 6.0).abs() < 0.01);
}

#[test]
fn a_c610_has_no_temperature_and_a_gm6020_an_absolute_angle() {
    let mut feeder = Dji::new(Config::new(&M2006, 3)).unwrap();
    feeder
        .unpack_feedback(&frame(0x203, [0, 0, 0, 0, 0, 0, 99, 0]), Micros::ZERO, Link::Online)
        .unwrap();
    assert_eq!(feeder.feedback().temperature(), None);
    let mut yaw = Dji::new(Config::new(&GM6020_VOLTAGE, 1)).unwrap();
    yaw.unpack_feedback(&feedback(0x205, 2048, 0), Micros::ZERO, Link::Online).unwrap();
    assert!((yaw.feedback().angle.get() - 90.0).abs() < 1e-4);
    let mut mirrored =
        Dji::new(Config::new(&GM6020_VOLTAGE, 1).with_direction(Direction::Reversed)).unwrap();
    mirrored.unpack_feedback(&feedback(0x205, 2048, 5), Micros::ZERO, Link::Online).unwrap();
    let seen = mirrored.feedback();
    assert!((seen.angle.get() - 270.0).abs() < 1e-4);
    assert!((seen.total_angle.degrees().get() + 90.0).abs() < 1e-4);
    assert!((seen.speed.get() + 5.0).abs() < 1e-4);
}

#[test]
fn frames_that_are_no_feedback_change_nothing() {
    let mut wheel = Dji::new(Config::new(&M3508, 1)).unwrap();
    wheel.unpack_feedback(&feedback(0x201, 100, 5), Micros::ZERO, Link::Online).unwrap();
    let before = wheel.feedback();
    let id = StandardId::new(0x201).unwrap();
    let short = CanFrame::data_frame(id, &[0; 7]).unwrap();
    let remote = CanFrame::remote_frame(id, 8).unwrap();
    for (frame, error) in [
        (feedback(0x202, 0, 0), FrameError::NotMine),
        (remote, FrameError::NotMine),
        (short, FrameError::Length),
        (feedback(0x201, 8192, 0), FrameError::Encoder),
    ] {
        assert_eq!(
            wheel.unpack_feedback(&frame, Micros::new(5), Link::Online),
            Err(error),
            "{frame}"
        );
        assert_eq!(wheel.feedback(), before);
    }
}

#[test]
fn the_output_angle_stays_exact_through_the_gear() {
    let mut wheel = Dji::new(Config::new(&M3508, 1)).unwrap();
    let mut at = Micros::ZERO;
    // 3591 rotor turns are 187 of the output: it is back where it was.
    for quarter in 0..=3591 * 4_u32 {
        let angle = u16::try_from(quarter % 4 * 2048).unwrap();
        at += Micros::from_millis(1);
        wheel.unpack_feedback(&feedback(0x201, angle, 15_000), at, Link::Online).unwrap();
    }
    let seen = wheel.feedback();
    assert_eq!(seen.total_angle, TotalAngle::from_degrees(360 * 187));
    assert!(seen.angle.get() < 1e-4);
    assert_eq!(seen.turn_gaps, 0);
}

#[test]
fn turns_in_a_gap_are_estimated_from_the_speed_and_counted() {
    let mut wheel = Dji::new(Config::new(&M2006, 1)).unwrap();
    wheel.unpack_feedback(&feedback(0x201, 0, 6000), Micros::ZERO, Link::Online).unwrap();
    // 6000 rpm for 50 ms are five turns.
    wheel
        .unpack_feedback(&feedback(0x201, 100, 6000), Micros::from_millis(50), Link::Online)
        .unwrap();
    let seen = wheel.feedback();
    assert_eq!(
        (seen.total_angle.counts_at(CountsPerTurn::new(8192 * 36, 1)), seen.turn_gaps),
        (5 * 8192 + 100, 1)
    );
    // At rest a late frame is nothing special.
    wheel.unpack_feedback(&feedback(0x201, 100, 0), Micros::from_millis(51), Link::Online).unwrap();
    wheel.unpack_feedback(&feedback(0x201, 90, 0), Micros::from_millis(90), Link::Online).unwrap();
    assert_eq!(wheel.feedback().turn_gaps, 1);
}

#[test]
fn a_current_target_leaves_in_the_right_lane_with_the_right_sign() {
    for (id, direction, command, lane, sign) in [
        (1, Direction::Forward, 0x200, 0, 1),
        (4, Direction::Reversed, 0x200, 6, -1),
        (6, Direction::Forward, 0x1FF, 2, 1),
    ] {
        let mut wheel = Dji::new(Config::new(&M3508, id).with_direction(direction)).unwrap();
        wheel.set_target(Target::Current(Amps::new(5.0))).unwrap();
        wheel
            .unpack_feedback(&feedback(0x200 + u16::from(id), 0, 0), Micros::ZERO, Link::Online)
            .unwrap();
        for _ in 0..30 {
            wheel.update(&Tick::new(DriveMode::Run));
        }
        let mut tx = TxBatch::new();
        wheel.pack_command(&mut tx).unwrap();
        let sent = tx.frames()[0];
        assert_eq!(sent.raw_id(), command);
        let mut expected = [0; 8];
        expected[lane..lane + 2].copy_from_slice(&(4096_i16 * sign).to_be_bytes());
        assert_eq!(sent.bytes(), expected);
        tx.clear();
        wheel.coast_frames(&mut tx).unwrap();
        assert_eq!(tx.frames()[0].bytes(), [0; 8]);
    }
}

#[test]
fn nothing_is_driven_before_the_first_feedback() {
    let mut wheel = Dji::new(Config::new(&M3508, 1)).unwrap();
    wheel.set_target(Target::Speed(Rpm::new(300.0))).unwrap();
    for drive in
        [DriveMode::Run, DriveMode::Hold, DriveMode::Brake, DriveMode::Coast, DriveMode::Off]
    {
        wheel.update(&Tick::new(drive));
        assert_eq!(wheel.raw_command(), 0, "{drive:?}");
    }
}

#[test]
fn a_motor_in_voltage_mode_takes_duty_and_no_current() {
    let mut pitch = Dji::new(Config::new(&GM6020_VOLTAGE, 2)).unwrap();
    let refused = pitch.set_target(Target::Current(Amps::new(1.0)));
    assert_eq!(refused, Err(TargetError::Unsupported(TargetKind::Current)));
    pitch.set_target(Target::Duty(2.0)).unwrap();
    pitch.unpack_feedback(&feedback(0x206, 0, 0), Micros::ZERO, Link::Online).unwrap();
    for _ in 0..30 {
        pitch.update(&Tick::new(DriveMode::Run));
    }
    assert_eq!(pitch.raw_command(), 25000);
}

#[test]
fn requests_take_effect_or_say_why_not() {
    let mut lift = Dji::new(Config::new(&M3508, 1)).unwrap();
    assert_eq!(lift.request(Request::SetZero), Err(RequestError::NoFeedback));
    assert_eq!(lift.request(Request::ClearFault), Err(RequestError::Unsupported));
    lift.unpack_feedback(&feedback(0x201, 5000, 0), Micros::ZERO, Link::Online).unwrap();
    lift.request(Request::SetZero).unwrap();
    assert_eq!(lift.feedback().total_angle, TotalAngle::ZERO);
    let bad = Gains { kp: f32::NAN, ..Gains::default() };
    assert!(matches!(lift.request(Request::SpeedGains(bad)), Err(RequestError::Config(_))));
    lift.request(Request::CurrentLimit(Amps::new(2.0))).unwrap();
    lift.set_target(Target::Current(Amps::new(20.0))).unwrap();
    for _ in 0..30 {
        lift.update(&Tick::new(DriveMode::Run));
    }
    assert_eq!(lift.raw_command(), round_to_i16(2.0 * 16384.0 / 20.0));
    let negative = lift.request(Request::CurrentLimit(Amps::new(-1.0)));
    assert!(matches!(negative, Err(RequestError::Config(_))));
}

#[test]
fn told_to_coast_after_a_new_zero_it_coasts() {
    let mut lift = Dji::new(Config::new(&M3508, 1)).unwrap();
    lift.unpack_feedback(&feedback(0x201, 5000, 0), Micros::ZERO, Link::Online).unwrap();
    lift.set_target(Target::TotalAngle(TotalAngle::from_degrees(90))).unwrap();
    lift.update(&Tick::new(DriveMode::Run));
    lift.request(Request::SetZero).unwrap();
    lift.set_target(Target::Coast).unwrap();
    for _ in 0..30 {
        lift.update(&Tick::new(DriveMode::Run));
    }
    assert_eq!(lift.raw_command(), 0);
}

#[test]
fn all_shipped_gains_can_be_used() {
    for model in [&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE] {
        Config::new(model, 1).validate().unwrap();
        Config::new(model, 1).with_gear(Gear::DIRECT).validate().unwrap();
        assert!(model.cascade.speed.output_limit <= model.effort.full());
    }
}

#[test]
fn a_configuration_is_checked_in_a_constant_and_its_motor_occupies_what_it_says() {
    const YAW: Config = Config::new(&GM6020_CURRENT, 7).with_feedback_rate(FeedbackRate::Hz125);
    const _: () = assert!(YAW.validate().is_ok());
    const IDS: CanIds = YAW.can_ids();
    let motor = Dji::new(YAW).unwrap();
    assert_eq!(motor.name(), YAW.name());
    assert_eq!(motor.can_ids().received(), IDS.received());
    assert_eq!(motor.can_ids().transmitted(), IDS.transmitted());
    let refused = |config: Config| Dji::new(config).unwrap_err().to_string();
    for (config, sentence) in [
        (Config { id: 8, ..YAW }, "GM6020 (current mode) id 8: `id` is 8, but must be 1 to 7"),
        (Config::new(&M3508, 9), "M3508 id 9: `id` is 9, but must be 1 to 8"),
        (Config::new(&M3508, 0), "M3508 id 0: `id` is 0, but must be 1 to 8"),
    ] {
        assert_eq!(refused(config), sentence);
    }
    let mut cascade = M3508.cascade;
    cascade.speed.kp = f32::NAN;
    let sentence = "M3508 id 1: `speed.kp` is NaN, but must be finite and not negative";
    assert_eq!(refused(Config::new(&M3508, 1).with_cascade(cascade)), sentence);
    // More than its controller can.
    for (model, limit, unit) in [
        (&M3508, 20.0, "the model's largest current, in A"),
        (&M2006, 10.0, "the model's largest current, in A"),
        (&GM6020_CURRENT, 3.0, "the model's largest current, in A"),
        (&GM6020_VOLTAGE, 1.0, "1, the whole voltage"),
    ] {
        let with = |limit| {
            let mut cascade = model.cascade;
            cascade.speed.output_limit = limit;
            Config::new(model, 1).with_cascade(cascade)
        };
        assert_eq!(with(limit).validate(), Ok(()));
        let sentence = format!(
            "{} id 1: `speed.output_limit` is {}, but must be at most {unit}",
            model.name,
            limit + 5.0
        );
        assert_eq!(refused(with(limit + 5.0)), sentence);
    }
}
