//! The LK-TECH codec against a second one, written from the manual's tables alone, for thousands of
//! values: the same ones in each run.

use proptest::array::uniform8;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use rc10_app::{Amps, Degrees, RotorRpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_motor::FrameError;
use rc10_motor::lk::{
    CENTIDEGREES, Command, DriveId, EncoderBits, Model, Reply, SpinDirection, pack_multi_motor,
};

use super::any;

/// Mostly near the ranges of real motors.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![2 => any::number_below(50.0), 1 => any::number_below(1e5)]
}

fn drive() -> impl Strategy<Value = DriveId> {
    (1..=32_u8).prop_map(|number| DriveId::new(number).unwrap())
}

fn encoder() -> impl Strategy<Value = EncoderBits> {
    select(&[EncoderBits::Fourteen, EncoderBits::Fifteen, EncoderBits::Sixteen][..])
}

fn model() -> impl Strategy<Value = Model> {
    (select(&[Model::mg, Model::mf, Model::ms][..]), encoder()).prop_map(|(of, bits)| of(bits))
}

fn angle() -> impl Strategy<Value = TotalAngle> {
    prop_oneof![
        any::<i64>().prop_map(TotalAngle::from_microdegrees),
        any::<i32>().prop_map(TotalAngle::from_degrees),
        any::<i64>().prop_map(|counts| TotalAngle::from_counts(counts, CENTIDEGREES)),
    ]
}

/// Little endian, of any width, with a sign.
fn signed(bytes: &[u8]) -> i64 {
    let magnitude = bytes.iter().rev().fold(0, |sum, &byte| sum * 256 + i64::from(byte));
    let wrap = 1_i64 << (8 * bytes.len());
    if magnitude >= wrap / 2 { magnitude - wrap } else { magnitude }
}

fn unsigned(bytes: &[u8]) -> i64 {
    signed(&[bytes, &[0]].concat())
}

/// `actual` steps are the `wanted` number of them, held within the range, give or take `slack`.
fn near(actual: i64, wanted: f64, range: std::ops::RangeInclusive<i64>, slack: f64) -> bool {
    #[expect(clippy::cast_precision_loss, reason = "a few parts in 2^53")]
    let (low, high, actual) = (*range.start() as f64, *range.end() as f64, actual as f64);
    let wanted = wanted.clamp(low, high);
    (low..=high).contains(&actual) && (actual - wanted).abs() <= slack + wanted.abs() * 2e-7
}

/// The value in place of a command that is not a number.
fn packed(command: Command, id: DriveId, model: &Model, bad: bool) -> Option<[u8; 8]> {
    match command.pack(id, model) {
        Ok(frame) if !bad => Some(*frame.all_eight().unwrap()),
        Ok(frame) => panic!("{command:?} is not a number, and became {frame}"),
        Err(error) => {
            assert!(bad, "{command:?}: {error}");
            let bytes = error.neutral.all_eight().unwrap();
            assert_eq!(bytes[1..], [0; 7]);
            None
        }
    }
}

proptest! {
    #![proptest_config(any::cases(3000))]

    #[test]
    fn a_current_arrives_within_a_step(id in drive(), model in model(), x in number()) {
        let packed = packed(Command::Current(Amps::new(x)), id, &model, x.is_nan());
        if let Some(bytes) = packed {
            prop_assert_eq!([bytes[0], bytes[1], bytes[2], bytes[3]], [0xA1, 0, 0, 0]);
            prop_assert_eq!([bytes[6], bytes[7]], [0, 0]);
            let raw = signed(&bytes[4..6]);
            if model.amps_per_count > 0.0 {
                let wanted = f64::from(x) / f64::from(model.amps_per_count);
                prop_assert!(near(raw, wanted, -2048..=2048, 1.0), "{} {}", x, raw);
                // Never more than was asked for.
                prop_assert!((raw.unsigned_abs() as f64) <= wanted.abs() * (1.0 + 2e-7));
            } else {
                prop_assert_eq!(raw, 0);
            }
        }
    }

    #[test]
    fn a_speed_arrives_within_a_step(id in drive(), model in model(), x in number()) {
        let packed = packed(Command::Speed(RotorRpm::new(x)), id, &model, x.is_nan());
        if let Some(bytes) = packed {
            prop_assert_eq!([bytes[0], bytes[1], bytes[2], bytes[3]], [0xA2, 0, 0, 0]);
            let range = i64::from(i32::MIN)..=i64::from(i32::MAX);
            prop_assert!(near(signed(&bytes[4..]), f64::from(x) * 600.0, range, 0.51));
        }
    }

    #[test]
    fn an_angle_arrives_exactly(
        id in drive(), model in model(), angle in angle(), limit in proptest::option::of(number()),
        by in any::<bool>(),
    ) {
        let speed_limit = limit.map(RotorRpm::new);
        let command = if by {
            Command::TurnBy { angle, speed_limit }
        } else {
            Command::TurnTo { angle, speed_limit }
        };
        let bad = limit.is_some_and(f32::is_nan);
        if let Some(bytes) = packed(command, id, &model, bad) {
            let free = if by { 0xA7 } else { 0xA3 };
            prop_assert_eq!([bytes[0], bytes[1]], [free + u8::from(limit.is_some()), 0]);
            let range = i64::from(i32::MIN)..=i64::from(i32::MAX);
            let wanted = angle.counts_at(CENTIDEGREES).clamp(*range.start(), *range.end());
            prop_assert_eq!(signed(&bytes[4..]), wanted);
            let limit = f64::from(limit.unwrap_or(0.0)) * 6.0;
            prop_assert!(near(unsigned(&bytes[2..4]), limit, 0..=65_535, 0.51));
        }
    }

    #[test]
    fn an_angle_within_a_turn_stays_within_it(
        id in drive(), model in model(), degrees in number(),
        limit in proptest::option::of(number()), counter in any::<bool>(),
    ) {
        let ways = [SpinDirection::Clockwise, SpinDirection::CounterClockwise];
        let command = Command::TurnWithin {
            angle: Degrees::new(degrees),
            direction: ways[usize::from(counter)],
            speed_limit: limit.map(RotorRpm::new),
        };
        let bad = degrees.is_nan() || limit.is_some_and(f32::is_nan);
        if let Some(bytes) = packed(command, id, &model, bad) {
            prop_assert_eq!(bytes[0], 0xA5 + u8::from(limit.is_some()));
            prop_assert_eq!((bytes[1], bytes[6], bytes[7]), (u8::from(counter), 0, 0));
            let raw = unsigned(&bytes[4..6]);
            prop_assert!(near(raw, f64::from(degrees) * 100.0, 0..=35_999, 0.51));
            let limit = f64::from(limit.unwrap_or(0.0)) * 6.0;
            prop_assert!(near(unsigned(&bytes[2..4]), limit, 0..=65_535, 0.51));
        }
    }

    #[test]
    fn power_is_limited_and_lanes_are_not(
        id in drive(), model in model(), power in any::<i16>(), raw in any::<[i16; 4]>(),
    ) {
        let bytes = packed(Command::OpenLoop(power), id, &model, false).unwrap();
        prop_assert_eq!(signed(&bytes[4..6]), i64::from(power).clamp(-850, 850));
        let frame = pack_multi_motor(raw);
        for (number, raw) in (1..).zip(raw) {
            let lane = DriveId::new(number).unwrap().multi_motor_lane().unwrap();
            prop_assert_eq!(signed(&frame.bytes()[lane..lane + 2]), i64::from(raw));
        }
    }

    #[test]
    fn every_answer_is_what_the_manual_says(
        id in drive(), model in model(), mut bytes in uniform8(any::<u8>()),
        command in prop_oneof![
            4 => select(&[
                0x80, 0x81, 0x88, 0x92, 0x94, 0x9A, 0x9B, 0x9C, 0x9D, 0xA0, 0xA1, 0xA8,
            ][..]),
            1 => any::<u8>(),
        ],
    ) {
        bytes[0] = command;
        let reply = Reply::from_frame(&CanFrame::eight_bytes(id.can_id(), bytes), id);
        let celsius = signed(&bytes[1..2]);
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let is = |x: f32, raw: i64, step: f64| {
            let wanted = raw as f64 * step;
            (f64::from(x) - wanted).abs() <= 1e-6 * wanted.abs() && x.is_finite()
        };
        match (reply, command) {
            (Ok(Reply::Off), 0x80) | (Ok(Reply::Stop), 0x81) | (Ok(Reply::Run), 0x88) => {}
            (Ok(Reply::Motion(motion)), 0x9C | 0xA0..=0xA8) => {
                prop_assert_eq!(motion.command, command);
                prop_assert!(is(motion.temperature().get(), celsius, 1.0));
                prop_assert_eq!(i64::from(motion.effort), signed(&bytes[2..4]));
                prop_assert!(is(motion.speed().get(), signed(&bytes[4..6]), 1.0 / 6.0));
                let raw = unsigned(&bytes[6..]);
                let turn = i64::from(model.encoder.counts());
                match model.angle(&motion) {
                    Ok(angle) => {
                        prop_assert!(raw < turn);
                        #[expect(clippy::cast_precision_loss, reason = "at most 65,536")]
                        let step = 360.0 / turn as f64;
                        prop_assert!(is(angle.get(), raw, step) && angle.get() < 360.0);
                    }
                    Err(_) => prop_assert!(raw >= turn),
                }
                if let Some(current) = model.current(&motion) {
                    let step = f64::from(model.amps_per_count);
                    prop_assert!(is(current.get(), motion.effort.into(), step));
                    // And out again, unless the drive exaggerates.
                    let again = model.raw_current(current);
                    prop_assert_eq!(again, motion.effort.clamp(-2048, 2048));
                } else {
                    prop_assert!(command == 0xA0 || model.name == "MS");
                }
            }
            (Ok(Reply::Health(health)), 0x9A | 0x9B) => {
                prop_assert!(is(health.temperature.get(), celsius, 1.0));
                prop_assert!(is(health.supply, unsigned(&bytes[3..5]), 0.1));
                prop_assert_eq!(health.errors.bits(), bytes[7]);
                prop_assert_eq!(health.errors.fault().is_some(), bytes[7] != 0);
                let named = health.errors.texts().count();
                prop_assert_eq!(named, bytes[7].count_ones() as usize);
            }
            (Ok(Reply::PhaseCurrents(currents)), 0x9D) => {
                prop_assert!(is(currents.temperature.get(), celsius, 1.0));
                for (phase, raw) in currents.phases.into_iter().zip(bytes[2..].chunks(2)) {
                    prop_assert!(is(phase.get(), signed(raw), 1.0 / 64.0));
                }
            }
            (Ok(Reply::MultiTurn(angle)), 0x92) => {
                // It saturates beyond 2.5 · 10¹⁰ turns.
                let wanted = signed(&bytes[1..]).saturating_mul(10_000);
                prop_assert_eq!(angle.microdegrees(), wanted);
                prop_assert!(angle.degrees().is_finite());
            }
            (Ok(Reply::SingleTurn(angle)), 0x94) => {
                prop_assert_eq!(angle.microdegrees(), unsigned(&bytes[4..]) * 10_000);
            }
            (Err(error), _) => {
                prop_assert_eq!(error, FrameError::Unexpected);
                prop_assert!(!matches!(
                    command,
                    0x80 | 0x81 | 0x88 | 0x92 | 0x94 | 0x9A..=0x9D | 0xA0..=0xA8
                ));
            }
            (Ok(reply), _) => prop_assert!(false, "{:#04X} became {:?}", command, reply),
        }
    }

    #[test]
    fn only_eight_bytes_of_its_own_are_an_answer(
        id in drive(),
        frame in any::frame_of(
            any::either(prop_oneof![0x13F..=0x162_u16, 0..=0x7FF_u16]), vec(any::<u8>(), 0..=8),
        ),
    ) {
        let own = !frame.is_extended_id()
            && !frame.is_remote()
            && frame.raw_id() == 0x140 + u32::from(id.number());
        match Reply::from_frame(&frame, id) {
            Err(FrameError::NotMine) => prop_assert!(!own),
            Err(FrameError::Length) => prop_assert!(own && frame.len() != 8),
            Err(FrameError::Unexpected) | Ok(_) => prop_assert!(own && frame.len() == 8),
            Err(other) => prop_assert!(false, "{:?}", other),
        }
    }
}
