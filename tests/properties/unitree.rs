//! Unitree's codec, for every input: packed values come back, and bytes that are no frame are
//! refused.

use proptest::array::uniform8;
use proptest::collection::vec;
use proptest::prelude::*;
use rc10_app::{Gear, NewtonMetres, Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_motor::FrameError;
use rc10_motor::unitree::wire::line::{self, COMMAND_LEN, Command, Parser, REPLY_LEN};
use rc10_motor::unitree::wire::module::{self, Content, Module, Request};
use rc10_motor::unitree::wire::{
    Address, Impedance, Motion, RawImpedance, RawMotion, RotorScale, Status,
};

use super::any;

fn shaft() -> impl Strategy<Value = RotorScale> {
    prop_oneof![Just(RotorScale::OUTPUT), Just(RotorScale::new(Gear::DIRECT))]
}

fn address() -> impl Strategy<Value = Address> {
    (0..=15_u8).prop_map(|id| Address::new(id).unwrap_or(Address::BROADCAST))
}

fn status() -> impl Strategy<Value = Status> {
    prop_oneof![Just(Status::LOCK), Just(Status::FOC), Just(Status::CALIBRATE)]
}

/// Any command.
fn raw_motion() -> impl Strategy<Value = RawMotion> {
    let angle = -2_147_479_307..=2_147_479_307_i32;
    (-32765..=32765_i16, -32758..=32758_i16, angle).prop_map(|(torque, speed, angle)| RawMotion {
        torque,
        speed,
        angle,
    })
}

fn raw_impedance() -> impl Strategy<Value = RawImpedance> {
    (0..=32767_u16, 0..=32767_u16)
        .prop_map(|(stiffness, damping)| RawImpedance { stiffness, damping })
}

fn any_motion() -> impl Strategy<Value = Motion> {
    let angle = prop_oneof![any::<i64>(), -1_000_000_000_000..=1_000_000_000_000_i64];
    (any::number(), any::number(), angle).prop_map(|(torque, speed, angle)| Motion {
        torque: NewtonMetres::new(torque),
        speed: Rpm::new(speed),
        angle: TotalAngle::from_microdegrees(angle),
    })
}

fn any_impedance() -> impl Strategy<Value = Impedance> {
    (any::number(), any::number()).prop_map(|(stiffness, damping)| Impedance { stiffness, damping })
}

/// An answer as a motor would make it, written without the codec.
fn reply() -> impl Strategy<Value = [u8; REPLY_LEN]> {
    prop::array::uniform11(any::<u8>()).prop_map(|[mode, rest @ ..]| {
        let mut bytes = [0; REPLY_LEN];
        bytes[..3].copy_from_slice(&[0xFD, 0xEE, mode]);
        bytes[3..13].copy_from_slice(&rest);
        sealed(bytes)
    })
}

fn sealed(mut bytes: [u8; REPLY_LEN]) -> [u8; REPLY_LEN] {
    let crc = bitwise_crc(&bytes[..14]).to_le_bytes();
    bytes[14..].copy_from_slice(&crc);
    bytes
}

/// CRC-16/KERMIT as a textbook has it.
fn bitwise_crc(bytes: &[u8]) -> u16 {
    let bit = |crc: u16, _| if crc & 1 == 1 { crc >> 1 ^ 0x8408 } else { crc >> 1 };
    bytes.iter().fold(0, |crc, byte| (0..8).fold(crc ^ u16::from(*byte), bit))
}

/// The frames that a parser without memory limits finds: at each place a reply or a byte to be
/// skipped.
fn searched(stream: &[u8]) -> Vec<line::Reply> {
    let (mut found, mut at) = (Vec::new(), 0);
    while let Some(window) = stream.get(at..at + REPLY_LEN) {
        match line::Reply::unpack(window) {
            Ok(reply) => {
                found.push(reply);
                at += REPLY_LEN;
            }
            Err(_) => at += 1,
        }
    }
    found
}

/// Pieces of a stream: garbage, heads without a body, beginnings of answers, broken answers.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        vec(any::<u8>(), 0..40),
        vec(prop_oneof![Just(0xFD), Just(0xEE), Just(0xFE)], 0..40),
        (reply(), 0..REPLY_LEN).prop_map(|(reply, len)| reply[..len].to_vec()),
        (reply(), 2..REPLY_LEN, 0..8).prop_map(|(mut reply, at, bit)| {
            reply[at] ^= 1_u8 << bit;
            reply.to_vec()
        }),
        reply().prop_map(|reply| reply.to_vec()),
        // A half-duplex line may hear its own command.
        (raw_motion(), raw_impedance(), address(), status()).prop_map(
            |(motion, impedance, address, status)| {
                Command { address, status, motion, impedance }.pack().to_vec()
            }
        ),
    ]
}

fn parse(parser: &mut Parser, stream: &[u8]) -> Vec<line::Reply> {
    stream.iter().filter_map(|&byte| parser.push(byte)).collect()
}

proptest! {
    #![proptest_config(any::cases(4096))]

    #[test]
    fn raw_numbers_survive_their_physical_values(
        shaft in shaft(), motion in raw_motion(), impedance in raw_impedance(),
    ) {
        prop_assert_eq!(shaft.raw(&shaft.motion(motion)), motion);
        prop_assert_eq!(shaft.raw_impedance(&shaft.impedance(impedance)), impedance);
    }

    #[test]
    fn physical_values_come_back_within_half_a_step(
        torque in -800.0..800.0_f32, speed in -1200.0..1200.0_f32, angle in -3_000_000_000..3_000_000_000_i64,
        stiffness in 0.0..1025.0_f32, damping in 0.0..1025.0_f32,
    ) {
        let motion = Motion {
            torque: NewtonMetres::new(torque),
            speed: Rpm::new(speed),
            angle: TotalAngle::from_microdegrees(angle),
        };
        let back = RotorScale::OUTPUT.motion(RotorScale::OUTPUT.raw(&motion));
        let near = |a: f32, b: f32, step: f32| (a - b).abs() <= 0.505 * step;
        prop_assert!(near(back.torque.get(), torque, 6.33 / 256.0), "{:?}", back);
        prop_assert!(near(back.speed.get(), speed, 60.0 / 256.0 / 6.33), "{:?}", back);
        // A step is 1735.6 microdegrees.
        prop_assert!((back.angle.microdegrees() - angle).abs() <= 869, "{:?}", back);
        let impedance = Impedance { stiffness, damping };
        let back = RotorScale::OUTPUT.impedance(RotorScale::OUTPUT.raw_impedance(&impedance));
        let step = 6.33 * 6.33 / 1280.0;
        prop_assert!(near(back.stiffness, stiffness, step), "{:?}", back);
        prop_assert!(near(back.damping, damping, step), "{:?}", back);
    }

    #[test]
    fn whatever_is_asked_stays_within_the_protocol_and_keeps_its_sign(
        shaft in shaft(), motion in any_motion(), impedance in any_impedance(),
    ) {
        let raw = shaft.raw(&motion);
        prop_assert!(raw.torque.unsigned_abs() <= 32765 && raw.speed.unsigned_abs() <= 32758);
        prop_assert!(raw.angle.unsigned_abs() <= 2_147_479_307);
        let agrees = |raw: i64, asked: f32| raw == 0 || (raw > 0) == (asked > 0.0);
        prop_assert!(agrees(raw.torque.into(), motion.torque.get()), "{:?}", raw);
        prop_assert!(agrees(raw.speed.into(), motion.speed.get()), "{:?}", raw);
        prop_assert!(i64::from(raw.angle.signum()) * motion.angle.microdegrees().signum() >= 0);
        let gains = shaft.raw_impedance(&impedance);
        prop_assert!(gains.stiffness <= 32767 && gains.damping <= 32767);
        prop_assert!(gains.stiffness == 0 || impedance.stiffness > 0.0);
        prop_assert!(gains.damping == 0 || impedance.damping > 0.0);
    }

    #[test]
    fn a_command_on_the_line_holds_what_was_put_in(
        address in address(), status in status(), motion in raw_motion(), impedance in raw_impedance(),
    ) {
        let bytes: [u8; COMMAND_LEN] = Command { address, status, motion, impedance }.pack();
        let [0xFE, 0xEE, mode, rest @ ..] = bytes else {
            return Err(TestCaseError::fail(format!("{bytes:02X?}")));
        };
        prop_assert_eq!((mode & 0xF, mode >> 4), (address.get(), status.get()));
        prop_assert_eq!(i16::from_le_bytes([rest[0], rest[1]]), motion.torque);
        prop_assert_eq!(i16::from_le_bytes([rest[2], rest[3]]), motion.speed);
        prop_assert_eq!(i32::from_le_bytes([rest[4], rest[5], rest[6], rest[7]]), motion.angle);
        prop_assert_eq!(u16::from_le_bytes([rest[8], rest[9]]), impedance.stiffness);
        prop_assert_eq!(u16::from_le_bytes([rest[10], rest[11]]), impedance.damping);
        prop_assert_eq!(bitwise_crc(&bytes[..15]).to_le_bytes(), &bytes[15..]);
    }

    #[test]
    fn any_sealed_reply_is_finite(bytes in reply(), shaft in shaft()) {
        let reply = line::Reply::unpack(&bytes).unwrap();
        let motion = shaft.motion(reply.motion);
        prop_assert!(motion.torque.is_finite() && motion.speed.is_finite());
        prop_assert!(motion.angle.degrees().is_finite() && reply.temperature.is_finite());
        prop_assert_eq!(reply.fault().is_some(), reply.error > 0);
        prop_assert!(reply.foot_force <= 0xFFF && reply.error <= 7 && reply.status.get() <= 7);
        prop_assert_eq!(shaft.raw(&motion).torque, reply.motion.torque.clamp(-32765, 32765));
    }

    #[test]
    fn no_bytes_with_another_crc_are_a_reply(bytes in vec(any::<u8>(), 0..40), head in any::<bool>()) {
        let mut bytes = bytes;
        if let ([first, second, ..], true) = (bytes.as_mut_slice(), head) {
            (*first, *second) = (0xFD, 0xEE);
        }
        let sound = bytes.len() == REPLY_LEN
            && bytes.starts_with(&[0xFD, 0xEE])
            && bitwise_crc(&bytes[..14]).to_le_bytes() == bytes[14..];
        prop_assert_eq!(line::Reply::unpack(&bytes).is_ok(), sound);
    }

    #[test]
    fn one_wrong_bit_or_byte_never_yields_a_value(
        mut bytes in reply(), at in 0..REPLY_LEN, wrong in 1..=255_u8,
    ) {
        bytes[at] ^= wrong;
        prop_assert!(line::Reply::unpack(&bytes).is_err());
        prop_assert_eq!(parse(&mut Parser::new(), &bytes), []);
    }

    #[test]
    fn a_parser_finds_what_a_search_finds(pieces in vec(piece(), 0..12), last in reply()) {
        let mut stream = pieces.concat();
        let mut parser = Parser::new();
        let found = parse(&mut parser, &stream);
        prop_assert_eq!(&found, &searched(&stream));
        // Every byte is part of an answer, skipped, or waiting: fewer than sixteen wait.
        let accounted = found.len() * REPLY_LEN + parser.skipped() as usize;
        prop_assert!(stream.len() - accounted < REPLY_LEN, "{} of {}", accounted, stream.len());
        let waiting = stream.len() - accounted;
        prop_assert!(parser.crc_errors() <= parser.skipped());
        // After whatever came before, a good answer that no other overlaps comes out. What waited
        // may, once in 65536 times, make an answer of its own with the beginning of this one.
        stream.extend(last);
        let after = parse(&mut parser, &last);
        prop_assert_eq!(&[found, after.clone()].concat(), &searched(&stream));
        prop_assert!(waiting > 0 || after == [line::Reply::unpack(&last).unwrap()]);
    }

    #[test]
    fn after_clear_the_next_reply_comes(garbage in piece(), good in reply()) {
        let mut parser = Parser::new();
        let before = parse(&mut parser, &garbage).len() * REPLY_LEN;
        parser.clear();
        prop_assert_eq!(before + parser.skipped() as usize, garbage.len());
        prop_assert_eq!(parse(&mut parser, &good), [line::Reply::unpack(&good).unwrap()]);
    }

    #[test]
    fn a_request_to_a_module_holds_what_was_put_in(
        module in 0..4_u8, address in address(), status in status(),
        motion in raw_motion(), impedance in raw_impedance(),
    ) {
        let to = Module::new(module).unwrap();
        let id = |operation: u32, status: u32| {
            u32::from(module) << 27 | operation << 16 | status << 12 | u32::from(address.get()) << 8
        };
        let status_bits = u32::from(status.get());
        for (request, id) in [
            (Request::Control(status, motion), id(10, status_bits)),
            (Request::SetImpedance(impedance), id(11, 0)),
            (Request::ReadImpedance, id(12, 0)),
            (Request::ControlUnanswered(status, motion), id(13, status_bits)),
        ] {
            let frame = request.pack(to, address);
            prop_assert!(frame.is_extended_id());
            prop_assert_eq!(frame.raw_id(), id);
            let data = *frame.all_eight().unwrap();
            // A command is laid out like a reply, and is itself none.
            prop_assert_eq!(module::Reply::unpack(&frame).unwrap_err(), FrameError::NotMine);
            let content = |bits: u32| {
                let id = ExtendedId::new(id | 1 << 26 | bits << 24).unwrap();
                module::Reply::unpack(&CanFrame::eight_bytes(Id::Extended(id), data)).unwrap()
            };
            match request {
                Request::Control(..) | Request::ControlUnanswered(..) => {
                    let reply = content(1);
                    prop_assert_eq!((reply.module, reply.address), (to, address));
                    let Content::State { status: was, motion: back, .. } = reply.content else {
                        return Err(TestCaseError::fail(format!("{reply:?}")));
                    };
                    prop_assert_eq!((was, back), (status, motion));
                }
                Request::SetImpedance(_) => {
                    prop_assert_eq!(content(2).content, Content::Impedance(impedance));
                }
                Request::ReadImpedance => prop_assert_eq!(data, [0; 8]),
            }
        }
    }

    #[test]
    fn any_frame_of_a_module_is_an_answer_or_an_error(
        raw in 0..=0x1FFF_FFFF_u32, data in uniform8(any::<u8>()), len in 0..=8_usize,
        shaft in shaft(),
    ) {
        let id = ExtendedId::new(raw).unwrap();
        let frame = CanFrame::data_frame(id, &data[..len]).unwrap();
        let reply = module::Reply::unpack(&frame);
        let answer = raw >> 26 & 1 == 1 && matches!(raw >> 24 & 3, 1 | 2) && len == 8;
        prop_assert_eq!(reply.is_ok(), answer);
        let Ok(reply) = reply else { return Ok(()) };
        prop_assert_eq!(u32::from(reply.module.get()), raw >> 27);
        prop_assert_eq!(u32::from(reply.address.get()), raw >> 8 & 0xF);
        let is_fault = raw >> 24 & 3 == 1 && raw & 0xFF == 0x80;
        prop_assert_eq!(reply.fault().map(|fault| fault.code), is_fault.then_some(raw));
        match reply.content {
            Content::State { motion, temperature, .. } => {
                let motion = shaft.motion(motion);
                prop_assert!(motion.torque.is_finite() && motion.speed.is_finite());
                prop_assert!((-127.0..=127.0).contains(&temperature.get()));
            }
            Content::Impedance(impedance) => {
                let impedance = shaft.impedance(impedance);
                prop_assert!(impedance.stiffness.is_finite() && impedance.damping.is_finite());
            }
            Content::Fault { .. } => {}
        }
    }

    #[test]
    fn no_other_frame_is_an_answer(frame in any::frame()) {
        if !frame.is_extended_id() || frame.is_remote() {
            prop_assert!(module::Reply::unpack(&frame).is_err());
        }
    }
}
