//! Damiao's codec on random values, bytes and lengths; what comes out is taken apart here again.

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_motor::damiao::registers::{Access, Register, Reply, Value};
use rc10_motor::damiao::{DeviceId, Feedback, Limits, Mode, Operation, Setpoint, models, wire};

use super::any;

/// Mostly near the ranges of real motors.
pub fn number() -> impl Strategy<Value = f32> {
    prop_oneof![2 => any::number_below(20.0), 1 => any::number_below(600.0)]
}

/// CyberGear's are the same.
pub fn setpoint() -> impl Strategy<Value = Setpoint> {
    (number(), number(), number(), number(), number()).prop_map(
        |(position, velocity, kp, kd, torque)| Setpoint { position, velocity, kp, kd, torque },
    )
}

fn limits() -> impl Strategy<Value = Limits> {
    let own = (1e-3..1e6_f32, 1e-3..1e6_f32, 1e-3..1e6_f32);
    prop_oneof![
        proptest::sample::select(models::ALL).prop_map(|model| model.limits),
        own.prop_map(|(p, v, t)| Limits::new(p, v, t)),
    ]
}

fn id() -> impl Strategy<Value = DeviceId> {
    (0..=0x4FE_u16).prop_map(|raw| DeviceId::new(raw).unwrap())
}

fn frame() -> impl Strategy<Value = CanFrame> {
    let long = any::<u32>().prop_map(|raw| Id::Extended(ExtendedId::new(raw >> 3).unwrap()));
    any::frame_of(prop_oneof![7 => any::standard(), 1 => long], vec(any::<u8>(), 0..=8))
}

/// A field of an MIT frame, its bits counted from the end, as a share of its range.
fn share(bits: u64, shift: u32, width: u32) -> f64 {
    let full = (1_u64 << width) - 1;
    ((bits >> shift & full) as f64) / full as f64
}

/// Expected value after packing: limited, the neutral one for NaN.
pub fn limited(x: f32, low: f64, high: f64) -> f64 {
    if x.is_nan() { 0.0 } else { f64::from(x).clamp(low, high) }
}

proptest! {
    #![proptest_config(any::cases(4096))]

    #[test]
    fn a_setpoint_comes_out_within_a_step(id in id(), wanted in setpoint(), limits in limits()) {
        let frame = wire::mit(id, &wanted, &limits);
        prop_assert_eq!(frame.id(), Id::Standard(StandardId::new(id.raw()).unwrap()));
        let bits = u64::from_be_bytes(*frame.all_eight().unwrap());
        for (x, limit, shift, width) in [
            (wanted.position, limits.position, 48, 16),
            (wanted.velocity, limits.velocity, 36, 12),
            (wanted.torque, limits.torque, 0, 12),
        ] {
            let limit = f64::from(limit);
            let step = 2.0 * limit / ((1 << width) - 1) as f64;
            let got = share(bits, shift, width) * 2.0 * limit - limit;
            let off = limited(x, -limit, limit) - got;
            // Truncated: never above, but for the rounding of an f32.
            prop_assert!((-0.01 * step..=1.01 * step).contains(&off), "{} as {}", x, got);
        }
        for (x, limit, shift) in [(wanted.kp, limits.kp, 24), (wanted.kd, limits.kd, 12)] {
            let limit = f64::from(limit);
            let step = limit / 4095.0;
            let off = limited(x, 0.0, limit) - share(bits, shift, 12) * limit;
            prop_assert!((-0.01 * step..=1.01 * step).contains(&off), "{} off by {}", x, off);
        }
    }

    #[test]
    fn no_setpoint_is_an_operation(
        id in id(), wanted in setpoint(), limits in limits(), torque in 0.99..1.01_f32,
    ) {
        let operations = |mode| {
            [Operation::ClearError, Operation::Enable, Operation::Disable, Operation::StoreZero]
                .map(|operation| wire::operate(id, mode, operation))
        };
        let brim = Setpoint {
            position: f32::MAX, velocity: f32::MAX, kp: f32::MAX, kd: f32::MAX,
            torque: torque * limits.torque,
        };
        for setpoint in [wanted, brim] {
            prop_assert!(!operations(Mode::Mit).contains(&wire::mit(id, &setpoint, &limits)));
        }
        let Setpoint { position, velocity, torque, .. } = wanted;
        let frame = wire::position_velocity(id, position, velocity);
        prop_assert!(!operations(Mode::PositionVelocity).contains(&frame));
        let frame = wire::force_position(id, position, velocity, torque);
        prop_assert!(!operations(Mode::ForcePosition).contains(&frame));
    }

    #[test]
    fn the_other_modes_send_finite_numbers_unchanged(
        id in id(), p in number(), v in number(), i in number(),
    ) {
        let same = |sent: &[u8], x: f32| {
            let sent = f32::from_le_bytes(sent.try_into().unwrap());
            let wanted = if x.is_nan() { 0.0 } else { x.clamp(f32::MIN, f32::MAX) };
            sent.to_bits() == wanted.to_bits()
        };
        let frame = wire::position_velocity(id, p, v);
        prop_assert!(same(&frame.bytes()[..4], p) && same(&frame.bytes()[4..], v));
        prop_assert!(same(wire::velocity(id, v).bytes(), v));
        let frame = wire::force_position(id, p, v, i);
        prop_assert!(same(&frame.bytes()[..4], p));
        for (x, unit, at) in [(v, 100.0, 4), (i, 10_000.0, 6)] {
            let raw = u16::from_le_bytes([frame.bytes()[at], frame.bytes()[at + 1]]);
            let wanted = limited(x * unit, 0.0, 10_000.0);
            prop_assert!((wanted - f64::from(raw)).abs() <= 0.501, "{} as {}", x, raw);
        }
    }

    #[test]
    fn any_feedback_is_finite_and_within_its_limits(frame in frame(), limits in limits()) {
        let heard = Feedback::unpack(&frame, &limits);
        let whole = !frame.is_extended_id() && frame.all_eight().is_some();
        prop_assert_eq!(heard.is_ok(), whole);
        let Ok(heard) = heard else { return Ok(()) };
        prop_assert!(heard.position.abs() <= limits.position);
        prop_assert!(heard.velocity.abs() <= limits.velocity);
        prop_assert!(heard.torque.abs() <= limits.torque);
        // Sent again, as the fields of a setpoint, it is what it was, give or take a step.
        let Feedback { position, velocity, torque, .. } = heard;
        let setpoint = Setpoint { position, velocity, torque, ..Setpoint::COAST };
        let id = DeviceId::new(heard.id.into()).unwrap();
        let again = u64::from_be_bytes(*wire::mit(id, &setpoint, &limits).all_eight().unwrap());
        let bits = u64::from_be_bytes(*frame.all_eight().unwrap());
        for (sent, received, width) in [(48, 40, 16), (36, 28, 12), (0, 16, 12)] {
            let (a, b) = (share(again, sent, width), share(bits, received, width));
            prop_assert!((a - b).abs() * ((1 << width) - 1) as f64 <= 1.01);
        }
    }

    #[test]
    fn any_register_reply_is_finite(frame in frame(), operation in 0..4_usize, id in id()) {
        // Random third bytes are seldom a reply.
        let mut frame = frame;
        if let Some(bytes) = frame.all_eight_mut() {
            bytes[2] = [0x33, 0x55, 0xAA, bytes[2]][operation];
        }
        if let Ok(reply) = Reply::unpack(&frame) {
            if let Some((_, Value::Real(real))) = reply.held {
                prop_assert!(real.is_finite());
            }
            prop_assert!(reply.id == id.raw() || !reply.answers(id, &Access::Save));
        }
    }

    #[test]
    fn what_is_written_is_what_the_reply_holds(
        id in id(), register in any::<u8>(), bits in any::<u32>(),
    ) {
        let register = Register(register);
        let value = if register.is_whole() { Value::Whole(bits) } else { Value::Real(f32::from_bits(bits)) };
        let access = Access::Write(register, value);
        let Ok(request) = access.pack(id) else {
            prop_assert!(!f32::from_bits(bits).is_finite());
            return Ok(());
        };
        // The motor sends the same bytes back.
        let reply = Reply::unpack(&request).unwrap();
        prop_assert_eq!((reply.held, reply.is_written), (Some((register, value)), true));
        prop_assert!(reply.answers(id, &access));
    }
}
