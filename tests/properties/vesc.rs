//! Properties of every VESC frame, tried with thousands of them: the same ones in each run.

use std::num::NonZeroU8;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use rc10_app::{Amps, Degrees, Gear, Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_motor::FrameError;
use rc10_motor::vesc::{
    Command, ElectricalRpm, ElectricalScale, Packet, Reply, Setting, Status, VescId, coast,
};

use super::any;

fn vesc() -> impl Strategy<Value = VescId> {
    (0..=254_u8).prop_map(|id| VescId::new(id).unwrap())
}

/// Shares, and all else.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![any::number_below(1.5), any::number()]
}

/// A command of each sort, and what a VESC divides its number by.
fn command(value: f32) -> [(Command, f64, f64); 9] {
    let (amps, any) = (Amps::new(value), f64::INFINITY);
    [
        (Command::Duty(value), 1e5, 1.0),
        (Command::Current(amps), 1e3, any),
        (Command::Brake(amps), 1e3, any),
        (Command::Speed(ElectricalRpm::new(value)), 1.0, any),
        (Command::Position(Degrees::new(value)), 1e6, any),
        (Command::RelativeCurrent(value), 1e5, 1.0),
        (Command::RelativeBrake(value), 1e5, 1.0),
        (Command::Handbrake(amps), 1e3, any),
        (Command::RelativeHandbrake(value), 1e5, 1.0),
    ]
}

/// To the nearest step, with an allowance in steps for computing in f32.
fn assert_sent(raw: i32, value: f64, steps: f64, allowance: f64) {
    let wanted = (value * steps).clamp(i32::MIN.into(), i32::MAX.into());
    let off = (f64::from(raw) - wanted).abs();
    assert!(off <= 0.5 + allowance, "{value} sent as {raw}, not {wanted}");
}

/// A product and a sum, each rounded to the 24 bits of an f32.
fn rounded_twice(value: f64, steps: f64) -> f64 {
    (value * steps).abs() * 2.0_f64.powi(-23)
}

fn any_frame() -> impl Strategy<Value = CanFrame> {
    let packet = select(&[9_u32, 14, 15, 16, 18, 27, 28, 58][..]);
    let id = prop_oneof![
        4 => (packet, 0..=255_u32).prop_map(|(packet, id)| packet << 8 | id),
        1 => 0..=0xFFFF_u32,
        1 => 0..=0x1FFF_FFFF_u32,
    ];
    let id = prop_oneof![
        9 => id.prop_map(|raw| Id::Extended(ExtendedId::new(raw).unwrap())),
        1 => any::standard(),
    ];
    let len = prop_oneof![2 => Just(8_usize), 1 => Just(2), 1 => 0..=8_usize];
    any::frame_of(id, len.prop_flat_map(|len| vec(any::<u8>(), len)))
}

/// All numbers of a status.
fn numbers(status: Status) -> Vec<f32> {
    match status {
        Status::Motion { speed, current, duty } => vec![speed.get(), current.get(), duty],
        Status::AmpHours { used, charged } | Status::WattHours { used, charged } => {
            vec![used, charged]
        }
        Status::Temperatures { transistors, motor, input_current, position } => {
            vec![transistors.get(), motor.get(), input_current.get(), position.get()]
        }
        Status::Tachometer { volts, .. } => vec![volts],
        Status::Inputs { analogue: [a, b, c], ppm } => vec![a, b, c, ppm],
    }
}

/// But for a few roundings to f32.
fn near(actual: f32, expected: f64) -> bool {
    (f64::from(actual) - expected).abs() <= 4e-7 * expected.abs()
}

/// Of a frame that can be an answer; `None` for all others.
fn packet_of(frame: &CanFrame) -> Option<Packet> {
    let is_data = frame.is_extended_id() && !frame.is_remote();
    let number = u8::try_from(frame.raw_id() >> 8).ok().filter(|_| is_data)?;
    let is_answer =
        |packet: &Packet| *packet == Packet::Pong || packet.name().starts_with("STATUS");
    Packet::from_number(number).filter(is_answer)
}

proptest! {
    #![proptest_config(any::cases(5000))]

    #[test]
    fn commands_arrive_to_the_nearest_step(to in vesc(), value in number()) {
        for (command, steps, limit) in command(value) {
            match command.pack(to) {
                Ok(frame) => {
                    let raw = i32::from_be_bytes(frame.bytes().try_into().unwrap());
                    let value = f64::from(value).clamp(-limit, limit);
                    let allowance = match command {
                        Command::Position(_) => 0.1,
                        _ => rounded_twice(value, steps),
                    };
                    assert_sent(raw, value, steps, allowance);
                    let id = u32::from(command.packet().number()) << 8 | u32::from(to.get());
                    prop_assert_eq!(frame.raw_id(), id);
                    prop_assert!(frame.is_extended_id());
                }
                Err(error) => {
                    prop_assert!(value.is_nan());
                    prop_assert_eq!(error.field, command.packet().name());
                    prop_assert_eq!(error.neutral, coast(to));
                }
            }
        }
    }

    #[test]
    fn settings_arrive_to_the_nearest_step(to in vesc(), first in number(), second in number()) {
        let (min, max) = (Amps::new(first), Amps::new(second));
        let (openloop, sensorless) = (ElectricalRpm::new(first), ElectricalRpm::new(second));
        for setting in [
            Setting::MotorCurrent { min, max },
            Setting::InputCurrent { min, max },
            Setting::FieldOriented { openloop, sensorless },
            Setting::BatteryCut { start: first, end: second },
        ] {
            let (Ok(held), Ok(stored)) = (setting.pack(to), setting.pack_store(to)) else {
                prop_assert!(first.is_nan() || second.is_nan());
                continue;
            };
            prop_assert_eq!(held.bytes(), stored.bytes());
            prop_assert_eq!(held.raw_id() + 0x100, stored.raw_id());
            let bytes = held.all_eight().unwrap();
            for (half, value) in bytes.chunks(4).zip([first, second]) {
                let value = f64::from(value);
                let raw = i32::from_be_bytes(half.try_into().unwrap());
                assert_sent(raw, value, 1e3, rounded_twice(value, 1e3));
            }
        }
    }

    #[test]
    fn a_status_tells_what_was_sent(
        from in vesc(), word in any::<i32>(), other in any::<i32>(),
        halves in any::<[i16; 4]>(),
    ) {
        let [a, b, c, d] = halves.map(f64::from);
        let (erpm, hours) = (f64::from(word), [word, other].map(|raw| f64::from(raw) / 1e4));
        let halves: Vec<u8> = halves.into_iter().flat_map(i16::to_be_bytes).collect();
        let word_first = [&word.to_be_bytes()[..], &halves[4..]].concat();
        let words = [word.to_be_bytes(), other.to_be_bytes()].concat();
        for (packet, bytes, expected) in [
            (Packet::Status, &word_first, vec![erpm, c / 10.0, d / 1e3]),
            (Packet::Status2, &words, hours.to_vec()),
            (Packet::Status3, &words, hours.to_vec()),
            (Packet::Status4, &halves, vec![a / 10.0, b / 10.0, c / 10.0, d / 50.0]),
            (Packet::Status5, &word_first, vec![c / 10.0]),
            (Packet::Status6, &halves, vec![a / 1e3, b / 1e3, c / 1e3, d / 1e3]),
        ] {
            let frame = CanFrame::data_frame(packet.id(from), bytes).unwrap();
            let Ok(Reply::Status { from: told, status }) = Reply::unpack(&frame) else {
                panic!("{frame}")
            };
            prop_assert_eq!(told, from);
            let actual = numbers(status);
            prop_assert_eq!(actual.len(), expected.len());
            for (actual, expected) in actual.into_iter().zip(expected) {
                prop_assert!(near(actual, expected), "{:?} {} {}", packet, actual, expected);
            }
            if let Status::Tachometer { steps, .. } = status {
                prop_assert_eq!(steps, word);
            }
        }
    }

    #[test]
    fn any_frame_is_an_answer_or_an_error(frame in any_frame()) {
        match Reply::unpack(&frame) {
            Ok(Reply::Status { from, status }) => {
                prop_assert_eq!(frame.len(), 8);
                prop_assert_eq!(u32::from(from.get()), frame.raw_id() & 0xFF);
                prop_assert!(frame.raw_id() < 0x10000);
                prop_assert!(numbers(status).into_iter().all(f32::is_finite));
            }
            Ok(Reply::Pong { to, .. }) => {
                prop_assert_eq!(frame.len(), 2);
                prop_assert_eq!(frame.raw_id(), 0x1200 | u32::from(to.get()));
            }
            Err(FrameError::Length) => {
                let packet = packet_of(&frame).unwrap();
                prop_assert_ne!(frame.len(), if packet == Packet::Pong { 2 } else { 8 });
            }
            Err(error) => {
                prop_assert_eq!(error, FrameError::NotMine);
                let is_pong = packet_of(&frame) == Some(Packet::Pong);
                let is_of_all = frame.raw_id() & 0xFF == 255 || is_pong && frame.bytes()[0] == 255;
                prop_assert!(packet_of(&frame).is_none() || is_of_all);
            }
        }
    }

    #[test]
    fn electrical_speeds_and_angles_go_there_and_back(
        pairs in 1..=255_u8, teeth in (1..=0xFFFF_u32, 1..=0xFFFF_u32), rpm in -1e5..1e5_f32,
        steps in any::<i32>(),
    ) {
        let gear = Gear::new(teeth.0, teeth.1).unwrap();
        let scale = ElectricalScale::new(NonZeroU8::new(pairs).unwrap(), gear);
        let ratio = f64::from(teeth.0) / f64::from(teeth.1) * f64::from(pairs);
        let electrical = scale.to_electrical(Rpm::new(rpm));
        prop_assert!(near(electrical.get(), f64::from(rpm) * ratio));
        prop_assert!(near(scale.to_output(electrical).get(), rpm.into()));
        let angle = TotalAngle::from_counts(steps.into(), scale.steps_per_turn());
        prop_assert_eq!(angle.counts_at(scale.steps_per_turn()), i64::from(steps));
        // 60 degrees of the field a step; kept as whole millionths of a degree of the output.
        let degrees = f64::from(steps) * 60.0 / ratio;
        let off = f64::from(angle.degrees().get()) - degrees;
        prop_assert!(off.abs() <= 1e-6 + 3e-7 * degrees.abs());
    }
}
