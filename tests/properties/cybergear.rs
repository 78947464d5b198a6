//! CyberGear's and RobStride's codec on random values, bytes and lengths; what comes out is taken
//! apart here again.

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_motor::cybergear::wire::{self, Parameter};
use rc10_motor::cybergear::{Address, Limits, Reply, Setpoint, models};

use super::any;
use super::damiao::{limited, number, setpoint};

fn limits() -> impl Strategy<Value = Limits> {
    let own = (1e-3..1e6_f32, 1e-3..1e6_f32, 1e-3..1e6_f32, 1e-3..1e6_f32, 1e-3..1e6_f32);
    prop_oneof![
        proptest::sample::select(&models::ALL[..]).prop_map(|model| model.limits),
        own.prop_map(|(p, v, t, kp, kd)| Limits::new(p, v, t).with_gains(kp, kd)),
    ]
}

/// Any frame, those with the type of a reply more often.
fn frame() -> impl Strategy<Value = CanFrame> {
    let kind = prop_oneof![
        3 => proptest::sample::select(&[0_u32, 2, 17, 21, 24][..]),
        1 => 0..32_u32,
    ];
    let long = (kind, 0..1_u32 << 24)
        .prop_map(|(kind, rest)| Id::Extended(ExtendedId::new(kind << 24 | rest).unwrap()));
    let data = prop_oneof![3 => vec(any::<u8>(), 8), 1 => vec(any::<u8>(), 0..=8)];
    any::frame_of(prop_oneof![7 => long, 1 => any::standard()], data)
}

proptest! {
    #![proptest_config(any::cases(4096))]

    #[test]
    fn a_setpoint_comes_out_within_a_step(
        motor in any::<u8>(), wanted in setpoint(), limits in limits(),
    ) {
        let frame = wire::motion(motor, &wanted, &limits);
        let bytes = *frame.all_eight().unwrap();
        let field = |at: usize| u16::from_be_bytes([bytes[at], bytes[at + 1]]);
        prop_assert!(frame.is_extended_id());
        let [kind, high, low, to] = frame.raw_id().to_be_bytes();
        prop_assert_eq!((kind, to), (1, motor));
        for (x, raw, limit, lowest) in [
            (wanted.position, field(0), limits.position, -1.0),
            (wanted.velocity, field(2), limits.velocity, -1.0),
            (wanted.kp, field(4), limits.kp, 0.0),
            (wanted.kd, field(6), limits.kd, 0.0),
            (wanted.torque, u16::from_be_bytes([high, low]), limits.torque, -1.0),
        ] {
            let (limit, low) = (f64::from(limit), lowest * f64::from(limit));
            let step = (limit - low) / 65535.0;
            let off = limited(x, low, limit) - (f64::from(raw) * step + low);
            // Truncated: never above, but for the rounding of an f32.
            prop_assert!((-0.02 * step..=1.02 * step).contains(&off), "{} off by {}", x, off);
        }
    }

    #[test]
    fn any_reply_is_finite_and_within_its_limits(frame in frame(), limits in limits()) {
        let [kind, upper, motor, host] = frame.raw_id().to_be_bytes();
        let from = Address { motor, host };
        match Reply::unpack(&frame, &limits) {
            Ok(Reply::Feedback(heard)) => {
                prop_assert!(kind == 2 || kind == 24);
                prop_assert_eq!(heard.address, from);
                prop_assert_eq!((heard.mode as u8) << 6 | heard.faults, upper);
                prop_assert!(heard.position.abs() <= limits.position);
                prop_assert!(heard.velocity.abs() <= limits.velocity);
                prop_assert!(heard.torque.abs() <= limits.torque);
                prop_assert!((0.0..=6553.6).contains(&heard.temperature.get()));
                // Sent again, as a setpoint, it is what it was, give or take a step.
                let again = Setpoint {
                    position: heard.position,
                    velocity: heard.velocity,
                    torque: heard.torque,
                    ..Setpoint::COAST
                };
                let again = wire::motion(motor, &again, &limits);
                let pair = |frame: &CanFrame, at: usize| {
                    u16::from_be_bytes([frame.bytes()[at], frame.bytes()[at + 1]])
                };
                let [_, high, low, _] = again.raw_id().to_be_bytes();
                prop_assert!(pair(&again, 0).abs_diff(pair(&frame, 0)) <= 1);
                prop_assert!(pair(&again, 2).abs_diff(pair(&frame, 2)) <= 1);
                prop_assert!(u16::from_be_bytes([high, low]).abs_diff(pair(&frame, 4)) <= 1);
            }
            Ok(Reply::Parameter(heard)) => {
                prop_assert_eq!((kind, heard.address), (17, from));
                prop_assert!(heard.real().is_none_or(f32::is_finite));
            }
            Ok(Reply::Faults(heard)) => prop_assert_eq!((kind, heard.address), (21, from)),
            Ok(_) => prop_assert_eq!((kind, host), (0, 0xFE), "an identity"),
            Err(_) => {
                let whole = frame.is_extended_id() && frame.all_eight().is_some();
                let known = [2, 17, 21, 24].contains(&kind) || (kind == 0 && host == 0xFE);
                prop_assert!(!whole || !known);
            }
        }
    }

    #[test]
    fn what_is_written_is_what_a_reply_holds(
        motor in any::<u8>(), host in any::<u8>(), index in any::<u16>(), value in number(),
    ) {
        let to = Address { motor, host };
        let request = wire::write_real(to, Parameter(index), value);
        prop_assert_eq!(request.raw_id().to_be_bytes(), [18, 0, host, motor]);
        // The motor puts the same bytes into its reply, type 17.
        let id = ExtendedId::new(u32::from_be_bytes([17, 0, motor, host])).unwrap();
        let reply = CanFrame::eight_bytes(id, *request.all_eight().unwrap());
        let Ok(Reply::Parameter(heard)) = Reply::unpack(&reply, &models::CYBERGEAR.limits) else {
            return Err(TestCaseError::fail("no parameter"));
        };
        prop_assert_eq!((heard.address, heard.parameter), (to, Parameter(index)));
        let sent = if value.is_nan() { 0.0 } else { value.clamp(f32::MIN, f32::MAX) };
        prop_assert_eq!(heard.real().map(f32::to_bits), Some(sent.to_bits()));
    }
}
