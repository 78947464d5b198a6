//! Two codecs, written apart: what one writes the other reads.

use super::{controls, device_id};
use crate::motors::{cases, number};
use proptest::prelude::*;
use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_motor::damiao::registers::{Access, Register, Value};
use rc10_motor::damiao::wire::{self, DeviceId, Feedback};
use rc10_motor::damiao::{Limits, Setpoint, models};
use rc10_sim::damiao as device;

fn model() -> impl Strategy<Value = Limits> {
    prop::sample::select(models::ALL).prop_map(|model| model.limits)
}

fn theirs(limits: &Limits) -> device::Limits {
    device::Limits {
        position: limits.position.into(),
        velocity: limits.velocity.into(),
        torque: limits.torque.into(),
    }
}

fn id() -> impl Strategy<Value = DeviceId> {
    (0_u16..=0x4FE).prop_filter_map("an identifier", DeviceId::new)
}

/// What arrives of a number in a field from `low` to `high`: limited, and `neutral` for NaN.
fn arrives(sent: f32, low: f32, high: f32, neutral: f32) -> f64 {
    if sent.is_nan() { neutral.into() } else { sent.clamp(low, high).into() }
}

fn within(read: f64, wanted: f64, step: f64) -> bool {
    (read - wanted).abs() <= step * 1.001 + 1e-6
}

fn finite(sent: f32) -> f64 {
    if sent.is_nan() { 0.0 } else { sent.clamp(f32::MIN, f32::MAX).into() }
}

proptest! {
    #![proptest_config(cases(4000))]

    #[test]
    fn the_device_understands_a_setpoint(
        id in id(), limits in model(), fields in prop::array::uniform5(number(100.0))
    ) {
        let [position, velocity, kp, kd, torque] = fields;
        let setpoint = Setpoint { position, velocity, kp, kd, torque };
        let frame = wire::mit(id, &setpoint, &limits);
        prop_assert_eq!(device::Operation::decode(frame.bytes()), None);
        let read = device::Setpoint::decode(device::Mode::Mit, frame.bytes(), &theirs(&limits));
        let Some(device::Setpoint::Mit { position: p, velocity: v, kp: stiff, kd: damp, torque: t })
            = read else { panic!("{read:?}") };
        let (pmax, vmax, tmax) = (limits.position, limits.velocity, limits.torque);
        for (read, sent, low, high, bits) in [
            (p, position, -pmax, pmax, 16),
            (v, velocity, -vmax, vmax, 12),
            (stiff, kp, 0.0, 500.0, 12),
            (damp, kd, 0.0, 5.0, 12),
            (t, torque, -tmax, tmax, 12),
        ] {
            let step = f64::from(high - low) / f64::from((1 << bits) - 1);
            prop_assert!(within(read, arrives(sent, low, high, 0.0), step), "{sent} as {read}");
        }
    }

    #[test]
    fn the_device_understands_the_other_modes(
        id in id(), position in number(100.0), velocity in number(100.0), share in number(100.0)
    ) {
        let limits = theirs(&models::J4310.limits);
        let read = |mode, frame: &CanFrame| {
            device::Setpoint::decode(mode, frame.bytes(), &limits)
        };
        let frame = wire::position_velocity(id, position, velocity);
        let there = device::Setpoint::PositionVelocity {
            position: finite(position), velocity: finite(velocity),
        };
        prop_assert_eq!(read(device::Mode::PositionVelocity, &frame), Some(there));
        let frame = wire::velocity(id, velocity);
        let there = device::Setpoint::Velocity(finite(velocity));
        prop_assert_eq!(read(device::Mode::Velocity, &frame), Some(there));
        let frame = wire::force_position(id, position, velocity, share);
        let Some(device::Setpoint::ForcePosition { position: p, velocity: v, share: s }) =
            read(device::Mode::ForcePosition, &frame) else { panic!("not understood") };
        prop_assert_eq!(p, finite(position));
        prop_assert!(within(v, arrives(velocity, 0.0, 100.0, 0.0), 0.01), "{velocity} as {v}");
        prop_assert!(within(s, arrives(share, 0.0, 1.0, 0.0), 0.0001), "{share} as {s}");
    }

    #[test]
    fn we_understand_a_report(
        limits in model(), can_id in 0_u16..=0x7FF, code in 0_u8..16,
        p in -1.2_f64..1.2, v in -1.2_f64..1.2, t in -1.2_f64..1.2,
        bridge in -50.0_f64..300.0, winding in -50.0_f64..300.0
    ) {
        let range = theirs(&limits);
        let report = device::Report {
            id: can_id,
            code,
            position: p * range.position,
            velocity: v * range.velocity,
            torque: t * range.torque,
            bridge_temperature: bridge,
            winding_temperature: winding,
        };
        let frame = CanFrame::eight_bytes(StandardId::ZERO, report.encode(&range));
        let told = Feedback::unpack(&frame, &limits).unwrap();
        prop_assert_eq!((u16::from(told.id), told.state.code()), (can_id & 0xF, code));
        for (read, sent, limit, bits) in [
            (told.position, report.position, range.position, 16),
            (told.velocity, report.velocity, range.velocity, 12),
            (told.torque, report.torque, range.torque, 12),
        ] {
            let step = 2.0 * limit / f64::from((1 << bits) - 1);
            let sent = sent.clamp(-limit, limit);
            prop_assert!(within(read.into(), sent, step + 1e-6 * limit), "{sent} as {read}");
        }
        let degrees = f64::from(told.driver_temperature.get());
        prop_assert!((degrees - bridge.clamp(0.0, 255.0)).abs() <= 0.5);
    }

    #[test]
    fn the_device_understands_questions_about_registers(
        id in id(), number in 0_u8..82, real in number(100.0), whole in any::<u32>()
    ) {
        let asked = |access: Access| {
            let frame = access.pack(id).ok()?;
            assert_eq!(frame.raw_id(), 0x7FF);
            let (to, access) = device::Access::decode(frame.bytes())?;
            assert_eq!(to, id.raw());
            Some(access)
        };
        let register = Register(number);
        prop_assert_eq!(asked(Access::Read(register)), Some(device::Access::Read(number)));
        prop_assert_eq!(asked(Access::Save), Some(device::Access::Save));
        prop_assert_eq!(asked(Access::Refresh), Some(device::Access::Report));
        let (value, bytes) = if register.is_whole() {
            (Value::Whole(whole), Some(whole.to_le_bytes()))
        } else {
            (Value::Real(real), real.is_finite().then(|| real.to_le_bytes()))
        };
        let there = bytes.map(|bytes| device::Access::Write(number, bytes));
        prop_assert_eq!(asked(Access::Write(register, value)), there);
    }
}

/// All at their ends in every direction: never an operation.
#[test]
fn no_saturated_setpoint_is_an_operation() {
    let limits = models::J4310.limits;
    let id = DeviceId::new(1).unwrap();
    let steps = 10.0 - 20.0 / 4095.0 * 5.0;
    for torque in [f32::MAX, 10.0, steps, 9.99, 9.98] {
        for extreme in [f32::MAX, f32::INFINITY, 1e9] {
            let (position, velocity, kp, kd) = (extreme, extreme, extreme, extreme);
            let setpoint = Setpoint { position, velocity, kp, kd, torque };
            let frame = wire::mit(id, &setpoint, &limits);
            assert_eq!(device::Operation::decode(frame.bytes()), None, "{frame}");
        }
    }
}

#[test]
fn operations_are_understood_in_every_mode() {
    for control in controls() {
        let (id, mode) = (device_id(control), control.mode());
        for (ours, theirs) in [
            (wire::Operation::ClearError, device::Operation::ClearError),
            (wire::Operation::Enable, device::Operation::Enable),
            (wire::Operation::Disable, device::Operation::Disable),
            (wire::Operation::StoreZero, device::Operation::StoreZero),
        ] {
            let frame = wire::operate(id, mode, ours);
            assert_eq!(device::Operation::decode(frame.bytes()), Some(theirs));
        }
    }
}

/// Frames as other drivers send them: eight bytes for every question, eight for a velocity.
#[test]
fn frames_of_other_drivers_are_answered() {
    let mut world = rc10_sim::World::new(5);
    let wire = world.add_bus(rc10_sim::BusConfig::default());
    let config = device::DamiaoConfig::j4310(0x01, 0x11);
    let esc = wire.add(device::Damiao::new(&config), config.plant);
    let mut port = wire.port();
    let mut millis = 0;
    let mut say = |raw: u16, data: [u8; 8]| {
        let _ = port.submit(&CanFrame::eight_bytes(StandardId::new(raw).unwrap(), data));
        millis += 1;
        world.advance(rc10_time::Micros::from_millis(millis));
        port.receive().map(|(frame, _)| (frame.raw_id(), *frame.all_eight().unwrap()))
    };
    let operation = |last| [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last];
    let (id, report) = say(0x01, operation(0xFC)).unwrap();
    assert_eq!((id, report[0]), (0x11, 0x11), "enabled");
    let (_, limit) = say(0x7FF, [1, 0, 0x33, 21, 0, 0, 0, 0]).unwrap();
    assert_eq!(limit, [1, 0, 0x33, 21, 0, 0, 0x48, 0x41]);
    let (_, report) = say(0x7FF, [1, 0, 0xCC, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(report[0], 0x11);
    assert_eq!(say(0x7FF, [2, 0, 0x33, 21, 0, 0, 0, 0]), None, "somebody else");
    let (_, held) = say(0x7FF, [1, 0, 0x55, 10, 3, 0, 0, 0]).unwrap();
    assert_eq!(held, [1, 0, 0x55, 10, 3, 0, 0, 0]);
    let [a, b, c, d] = 5.0_f32.to_le_bytes();
    let (_, report) = say(0x201, [a, b, c, d, 0, 0, 0, 0]).unwrap();
    assert_eq!(report[0], 0x11);
    // Another mode's frame is answered, and not obeyed.
    assert!(say(0x01, [0xFF; 8]).is_some());
    let followed = esc.with(|damiao: &mut device::Damiao| damiao.setpoint()).unwrap();
    assert_eq!(followed, Some(device::Setpoint::Velocity(5.0)));
    let (_, report) = say(0x201, operation(0xFD)).unwrap();
    assert_eq!(report[0], 0x01, "disabled");
}
