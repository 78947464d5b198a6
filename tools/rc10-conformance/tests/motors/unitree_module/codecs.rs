//! Two codecs, written apart, must agree.

use std::f64::consts::TAU;

use crate::motors::{cases, number};
use proptest::prelude::*;
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_motor::rc10_app::{NewtonMetres, Rpm, TotalAngle};
use rc10_motor::unitree::wire::module::{Content, Module, Reply, Request};
use rc10_motor::unitree::wire::{Address, Impedance, Motion, RotorScale, Status};
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{CanMotor, FrameError, FrameKind, Link, Motor};
use rc10_sim::unitree_module::{self as device, Asked, Command, Report, Told};
use rc10_time::Micros;

const GEAR: f64 = 6.33;

/// What a number becomes on the wire: nothing for NaN, else limited.
fn limited(x: f32, limit: f64) -> f64 {
    if x.is_nan() { 0.0 } else { f64::from(x).clamp(-limit, limit) }
}

fn near(a: f64, b: f64, lsb: f64) -> bool {
    (a - b).abs() <= 1.001 * lsb + 1e-6 * b.abs()
}

proptest! {
    #![proptest_config(cases(4000))]

    #[test]
    fn the_device_understands_every_command(
        module in 0..4_u8, motor in 0..=15_u8, follow in any::<bool>(), answered in any::<bool>(),
        torque in number(200.0), rpm in number(400.0),
        degrees in -3_700_000_000_000..=3_700_000_000_000_i64,
        stiffness in number(500.0), damping in number(50.0),
    ) {
        let to = Module::new(module).unwrap();
        let address = Address::new(motor).unwrap_or(Address::BROADCAST);
        let status = if follow { Status::FOC } else { Status::LOCK };
        let raw = RotorScale::OUTPUT.raw(&Motion {
            torque: NewtonMetres::new(torque),
            speed: Rpm::new(rpm),
            angle: TotalAngle::from_microdegrees(degrees),
        });
        let control = match answered {
            true => Request::Control(status, raw),
            false => Request::ControlUnanswered(status, raw),
        };
        let command = Command::unpack(&control.pack(to, address)).unwrap();
        prop_assert_eq!((command.module, command.motor), (module, motor));
        let Some(Asked::Control { status: told, motion, answered: answers }) = command.asked else {
            return Err(TestCaseError::fail(format!("{command:?}")));
        };
        prop_assert_eq!((told, answers), (u8::from(follow), answered));
        let wanted = limited(torque, 127.99 * GEAR) / GEAR;
        prop_assert!(near(motion.torque, wanted, 1.0 / 256.0), "{torque} {motion:?}");
        let wanted = limited(rpm, 804.0 / GEAR * 60.0 / TAU) * GEAR * TAU / 60.0;
        prop_assert!(near(motion.speed, wanted, TAU / 256.0), "{rpm} {motion:?}");
        let wanted = (degrees as f64 * 1e-6).to_radians() * GEAR;
        prop_assert!(near(motion.angle, wanted, TAU / 32768.0), "{degrees} {motion:?}");

        let raw = RotorScale::OUTPUT.raw_impedance(&Impedance { stiffness, damping });
        let command = Command::unpack(&Request::SetImpedance(raw).pack(to, address)).unwrap();
        let Some(Asked::SetGains(gains)) = command.asked else {
            return Err(TestCaseError::fail(format!("{command:?}")));
        };
        let wanted = |gain: f32| limited(gain, 25.599 * GEAR * GEAR).max(0.0) / (GEAR * GEAR);
        prop_assert!(near(gains.stiffness, wanted(stiffness), 1.0 / 1280.0), "{gains:?}");
        prop_assert!(near(gains.damping, wanted(damping), 1.0 / 1280.0), "{gains:?}");
        let command = Command::unpack(&Request::ReadImpedance.pack(to, address)).unwrap();
        prop_assert_eq!(command.asked, Some(Asked::ReadGains));
    }

    #[test]
    fn we_understand_every_report(
        module in 0..4_u8, motor in 0..=14_u8, status in 0..3_u8,
        torque in -127.0..127.0_f64, speed in -800.0..800.0_f64, angle in -4e5..4e5_f64,
        temperature in -140.0..140.0_f64, air_pressure in any::<u8>(), error in 1..5_u8,
        stiffness in 0.0..25.0_f64, damping in 0.0..25.0_f64,
    ) {
        let report = |told| Reply::unpack(&Report { module, motor, told }.pack()).unwrap();
        let motion = device::Motion { torque, speed, angle };
        let state = report(Told::State { status, motion, temperature, air_pressure });
        prop_assert_eq!((state.module.get(), state.address.get()), (module, motor));
        let Content::State { status: read, motion, temperature: degrees, air_pressure: air } =
            state.content
        else {
            return Err(TestCaseError::fail(format!("{state:?}")));
        };
        prop_assert_eq!((read.get(), air), (status, air_pressure));
        prop_assert!(near(degrees.get().into(), temperature.clamp(-127.0, 127.0), 0.5));
        let motion = RotorScale::OUTPUT.motion(motion);
        prop_assert!(near(motion.torque.get().into(), torque * GEAR, GEAR / 256.0));
        let step = 60.0 / 256.0 / GEAR;
        prop_assert!(near(motion.speed.get().into(), speed / GEAR * 60.0 / TAU, step));
        let wanted = (angle / GEAR).to_degrees() * 1e6;
        let step = 360e6 / 32768.0 / GEAR;
        prop_assert!(near(motion.angle.microdegrees() as f64, wanted, step));

        let fault = report(Told::Fault { status, error }).fault().unwrap();
        let texts = ["over-temperature", "over-current", "over-voltage", "encoder"];
        prop_assert_eq!(fault.text, texts[usize::from(error) - 1]);
        let gains = report(Told::Gains(device::Gains { stiffness, damping })).content;
        let Content::Impedance(raw) = gains else {
            return Err(TestCaseError::fail(format!("{gains:?}")));
        };
        let read = RotorScale::OUTPUT.impedance(raw);
        let step = GEAR * GEAR / 1280.0;
        prop_assert!(near(read.stiffness.into(), stiffness * GEAR * GEAR, step));
        prop_assert!(near(read.damping.into(), damping * GEAR * GEAR, step));
    }

    #[test]
    fn a_motor_takes_what_is_its_own_and_nothing_else(
        id in 0..=0x1FFF_FFFF_u32, force in any::<bool>(), data in any::<[u8; 8]>(),
        len in prop_oneof![3 => Just(8_usize), 1 => 0..8_usize],
    ) {
        let mut motor = GoModule::new(ModuleConfig::new(3, 2)).unwrap();
        // Half of them are its own by module, direction and motor.
        let id = if force { id & !0x1C00_0F00 | 0x1C00_0200 } else { id };
        let frame =
            CanFrame::data_frame(Id::Extended(ExtendedId::new(id).unwrap()), &data[..len]).unwrap();
        let heard = motor.unpack_feedback(&frame, Micros::ZERO, Link::Online);
        let expected = match id >> 24 & 3 {
            _ if id & 0x1C00_0F00 != 0x1C00_0200 => Err(FrameError::NotMine),
            _ if len < 8 => Err(FrameError::Length),
            1 if id & 0xFF == 0x80 => Ok(FrameKind::Fault),
            1 => Ok(FrameKind::Feedback),
            2 => Err(FrameError::Unasked),
            _ => Err(FrameError::Unexpected),
        };
        prop_assert_eq!(heard, expected, "{}", frame);
        let feedback = motor.feedback();
        prop_assert!(feedback.speed.is_finite() && (0.0..360.0).contains(&feedback.angle.get()));
        prop_assert_eq!(feedback.torque().is_some(), expected == Ok(FrameKind::Feedback));
        prop_assert_eq!(motor.fault().is_some(), expected == Ok(FrameKind::Fault));
    }
}

#[test]
fn the_device_refuses_what_is_no_command() {
    let frame = |id, len| {
        let id = Id::Extended(ExtendedId::new(id).unwrap());
        CanFrame::data_frame(id, &[0; 8][..len]).unwrap()
    };
    assert_eq!(Command::unpack(&frame(0x180E_0200, 8)).unwrap().asked, None);
    assert_eq!(Command::unpack(&frame(0x180A_0200, 7)).unwrap().asked, None);
    assert_eq!(Command::unpack(&frame(0x1D0A_0200, 8)), None);
    assert!(Command::unpack(&frame(0x180A_0200, 8)).unwrap().asked.is_some());
    assert!(device::UnitreeModule::new(4).is_err());
    assert!(device::UnitreeModule::new(0).unwrap().motor(15).is_err());
}
