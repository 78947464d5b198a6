//! What one codec writes, the other reads: random values, their extremes, and what is no number.

use proptest::prelude::*;
use rc10_motor::cybergear::wire::{self, Mode, Parameter};
use rc10_motor::cybergear::{Address, Reply, Setpoint};
use rc10_sim::cybergear::wire::{self as device, Command, Report};

use super::models;
use crate::motors::{cases, number};

fn gain() -> impl Strategy<Value = f32> {
    prop_oneof![4 => 0.0..600.0_f32, 2 => 0.0..6.0_f32, 1 => number(40.0)]
}

fn address() -> impl Strategy<Value = Address> {
    (1..=127_u8, any::<u8>()).prop_map(|(motor, host)| Address { motor, host })
}

/// The number that arrives, between `low` and `high`.
fn limited(x: f32, low: f64, high: f64) -> f64 {
    if x.is_nan() { low.midpoint(high).max(0.0) } else { f64::from(x).clamp(low, high) }
}

fn near(is: f64, wanted: f64, low: f64, high: f64) -> bool {
    // One step, and what an f32 cannot hold.
    (is - wanted).abs() <= (high - low) / 65_535.0 * 1.01
}

proptest! {
    #![proptest_config(cases(4096))]

    #[test]
    fn setpoints_are_understood(
        which in 0..8_usize,
        to in address(),
        [position, velocity, torque] in [number(40.0), number(40.0), number(40.0)],
        [kp, kd] in [gain(), gain()],
    ) {
        let (ours, theirs) = models().nth(which).unwrap();
        let setpoint = Setpoint { position, velocity, kp, kd, torque };
        let frame = wire::motion(to.motor, &setpoint, &ours.limits);
        let (target, _, command) = device::read(&frame, theirs).unwrap();
        let Some(Command::Motion(motion)) = command else { panic!("{command:?}") };
        prop_assert_eq!(target, to.motor);
        for (is, asked, range) in [
            (motion.position, position, theirs.position),
            (motion.velocity, velocity, theirs.velocity),
            (motion.torque, torque, theirs.torque),
        ] {
            prop_assert!(near(is, limited(asked, -range, range), -range, range), "{} {}", is, asked);
        }
        for (is, asked, range) in [(motion.kp, kp, theirs.kp), (motion.kd, kd, theirs.kd)] {
            let wanted = if asked.is_nan() { 0.0 } else { limited(asked, 0.0, range) };
            prop_assert!(near(is, wanted, 0.0, range), "{} {}", is, asked);
        }
    }

    #[test]
    fn all_other_commands_are_understood(
        to in address(),
        index in any::<u16>(),
        bytes in any::<[u8; 4]>(),
        real in number(40.0),
        id in any::<u8>(),
    ) {
        let model = &rc10_sim::cybergear::RS00;
        let parameter = Parameter(index);
        let sent = if real.is_finite() { real } else if real.is_nan() { 0.0 } else { f32::MAX.copysign(real) };
        for (frame, wanted) in [
            (wire::identify(to), Command::Identify),
            (wire::enable(to), Command::Enable),
            (wire::stop(to), Command::Stop { clear: false }),
            (wire::clear_faults(to), Command::Stop { clear: true }),
            (wire::set_zero(to), Command::SetZero),
            (wire::set_id(to, id), Command::SetId(id)),
            (wire::read(to, parameter), Command::Read(index)),
            (wire::write(to, parameter, bytes), Command::Write(index, bytes)),
            (wire::write_byte(to, parameter, id), Command::Write(index, [id, 0, 0, 0])),
            (wire::save(to), Command::SaveOrBitRate([1, 2, 3, 4, 5, 6, 7, 8])),
        ] {
            prop_assert_eq!(device::read(&frame, model), Some((to.motor, to.host, Some(wanted))));
        }
        let frame = wire::write_real(to, parameter, real);
        let (.., command) = device::read(&frame, model).unwrap();
        let Some(Command::Write(_, written)) = command else { panic!("{command:?}") };
        let written = f32::from_le_bytes(written);
        prop_assert!(written.is_finite());
        if real.is_finite() || real.is_nan() {
            prop_assert_eq!(written, sent);
        }
    }

    #[test]
    fn feedback_is_understood(
        which in 0..8_usize,
        from in address(),
        unasked in any::<bool>(),
        mode in 0..4_u8,
        faults in 0..64_u8,
        [position, velocity, torque] in [number(40.0), number(40.0), number(40.0)],
        temperature in 0.0..6553.0_f64,
    ) {
        let (ours, theirs) = models().nth(which).unwrap();
        // A device measures numbers.
        let real = |x: f32| if x.is_nan() { 0.0 } else { f64::from(x) };
        let report = Report {
            mode,
            faults,
            position: real(position),
            velocity: real(velocity),
            torque: real(torque),
            temperature,
        };
        let frame = device::feedback(unasked, from.motor, from.host, &report, theirs);
        let Ok(Reply::Feedback(heard)) = Reply::unpack(&frame, &ours.limits) else { panic!() };
        prop_assert_eq!(heard.address, from);
        let modes = [Mode::Reset, Mode::Calibration, Mode::Run, Mode::Unknown];
        prop_assert_eq!(heard.mode, modes[usize::from(mode)]);
        prop_assert_eq!(heard.faults, faults);
        for (is, was, range) in [
            (heard.position, report.position, theirs.position),
            (heard.velocity, report.velocity, theirs.velocity),
            (heard.torque, report.torque, theirs.torque),
        ] {
            prop_assert!(near(is.into(), was.clamp(-range, range), -range, range), "{} {}", is, was);
        }
        prop_assert!((f64::from(heard.temperature.get()) - temperature).abs() < 0.051);
    }

    #[test]
    fn all_other_answers_are_understood(
        from in address(),
        index in any::<u16>(),
        bytes in any::<[u8; 4]>(),
        [faults, warnings] in any::<[u32; 2]>(),
        chip in any::<[u8; 8]>(),
    ) {
        let limits = &rc10_motor::cybergear::models::RS00.limits;
        let Address { motor, host } = from;
        let frame = device::parameter(motor, host, index, Some(bytes));
        let Ok(Reply::Parameter(value)) = Reply::unpack(&frame, limits) else { panic!() };
        prop_assert_eq!(
            (value.address, value.parameter, value.refused, value.bytes),
            (from, Parameter(index), false, bytes)
        );
        let frame = device::parameter(motor, host, index, None);
        let Ok(Reply::Parameter(value)) = Reply::unpack(&frame, limits) else { panic!() };
        prop_assert!(value.refused);
        let frame = device::faults(motor, host, faults, warnings);
        let Ok(Reply::Faults(report)) = Reply::unpack(&frame, limits) else { panic!() };
        prop_assert_eq!((report.address, report.faults, report.warnings), (from, faults, warnings));
        let wanted = Reply::Identity { motor, chip: u64::from_be_bytes(chip) };
        prop_assert_eq!(Reply::unpack(&device::identity(motor, chip), limits), Ok(wanted));
    }
}
