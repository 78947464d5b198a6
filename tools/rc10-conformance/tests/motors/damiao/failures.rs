//! Cut wires, restarts, faults, strange frames.

use super::{CAN_ID, MASTER_ID, Rig, cascade, config, controls, device, motor, on_bus};
use rc10_app::{Rpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_motor::damiao::{Config, Control, Damiao, models};
use rc10_motor::{
    CanMotor, DriveMode, FrameError, FrameKind, Link, Motor, Request, Response, Safety, Target,
    Tick,
};
use rc10_sim::EscFault;
use rc10_sim::damiao::{DamiaoConfig, Mode};
use rc10_time::Micros;

use crate::motors::sent_in;

fn mit() -> Control {
    Control::Mit(cascade())
}

fn target_of(control: &Control) -> Target {
    match control {
        Control::Velocity => Target::Speed(Rpm::new(100.0)),
        _ => Target::TotalAngle(TotalAngle::from_degrees(600)),
    }
}

/// Another program enables the device.
fn enable(rig: &Rig) {
    let enable = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
    rig.bench.wire.inject(&CanFrame::eight_bytes(StandardId::new(CAN_ID).unwrap(), enable));
}

/// The feedback of a device at rest with this code.
fn says(code: u8) -> CanFrame {
    let id = StandardId::new(MASTER_ID).unwrap();
    CanFrame::eight_bytes(id, [code << 4 | 1, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 25, 25])
}

/// A cut wire: lost after 10 ms. Connected again: driven again at once, softly.
#[test]
fn a_cut_wire_is_survived() {
    for control in controls() {
        let mut rig = on_bus(motor(control), &device(&control), Safety::COAST).armed();
        let target = target_of(&control);
        rig.bench.hold(rig.motor, target, 100).unwrap();
        rig.bench.wire.set_cut(true);
        rig.bench.hold(rig.motor, target, 30).unwrap();
        assert_eq!(rig.status().link, Link::Lost);
        // Its word while it is lost is to disable.
        let said: Vec<_> = rig.bench.sent.frames().iter().map(ToString::to_string).collect();
        assert!(said.iter().all(|frame| frame.ends_with("#FFFFFFFFFFFFFFFD")), "{said:?}");
        rig.bench.wire.set_cut(false);
        // It may be another one now: all five registers are looked at again.
        let mut asked = 0;
        for _ in 0..20 {
            rig.bench.hold(rig.motor, target, 1).unwrap();
            let sent = rig.bench.sent.frames().iter();
            asked += sent.filter(|frame| frame.raw_id() == 0x7FF).count();
        }
        assert!(asked >= 5, "{control:?}: {asked}");
        assert_eq!(rig.status().link, Link::Online);
        assert_eq!(rig.status().feedback.turn_gaps, 1);
        rig.bench.hold(rig.motor, target, 30).unwrap();
        assert!(rig.is_enabled(), "{control:?}");
        assert!(rig.esc.state().output_rpm > 20.0, "{control:?}");
    }
}

/// The registers of a device that cannot be heard are not at fault.
#[test]
fn a_check_that_is_cut_off_begins_again_when_the_device_is_back() {
    let mut rig = on_bus(motor(mit()), &device(&mit()), Safety::COAST);
    let asks = |rig: &mut Rig| {
        rig.bench.tick();
        rig.bench.sent.frames().iter().any(|frame| frame.raw_id() == 0x7FF)
    };
    assert!((0..100).any(|_| asks(&mut rig)));
    rig.bench.wire.set_cut(true);
    rig.bench.wait(300);
    assert_eq!((rig.status().link, rig.status().fault), (Link::Lost, None));
    rig.bench.wire.set_cut(false);
    let mut rig = rig.armed();
    rig.bench.hold(rig.motor, target_of(&mit()), 20).unwrap();
    assert!(rig.is_enabled());
}

/// What came back may be set up otherwise: it is looked at again before it is enabled.
#[test]
fn a_restarted_device_is_looked_at_again() {
    // Shorter than the link timeout, and longer.
    for pause in [3, 300] {
        let wrong = rc10_sim::damiao::Limits { position: 3.2, velocity: 30.0, torque: 10.0 };
        let config = DamiaoConfig { limits: wrong, ..device(&mit()) };
        let mut rig = on_bus(motor(mit()), &config, Safety::COAST);
        rig.bench.wait(20);
        // Set right, and not saved.
        let position = 12.5_f32.to_bits();
        assert_eq!(rig.ask(Request::WriteRegister(21, position)), Ok(Response::Done));
        assert_eq!(rig.ask(Request::ClearFault), Ok(Response::Done));
        let mut rig = rig.armed();
        let target = Target::Speed(Rpm::new(30.0));
        rig.bench.hold(rig.motor, target, 50).unwrap();
        assert!(rig.is_enabled());
        rig.esc.set_power(false);
        rig.bench.hold(rig.motor, target, pause).unwrap();
        rig.esc.set_power(true);
        for _ in 0..50 {
            rig.bench.hold(rig.motor, target, 1).unwrap();
            assert!(!rig.is_enabled(), "{pause}");
        }
        assert_eq!(rig.status().fault.unwrap().code, 0x115);
    }
}

/// Register 9: the device stops by itself when commands stop coming. After a cut that we saw, too, it comes
/// back as from any other, also where an old answer comes first; else it is a fault.
#[test]
fn a_time_out_is_a_fault_unless_the_link_was_lost() {
    for (is_dominant, is_fault) in [(false, false), (true, false), (false, true)] {
        // 20 ms.
        let config = DamiaoConfig { timeout: 400, ..device(&mit()) };
        let mut rig = on_bus(motor(mit()), &config, Safety::COAST).armed();
        let target = target_of(&mit());
        rig.bench.hold(rig.motor, target, 100).unwrap();
        if is_fault {
            assert!(rig.esc.inject(EscFault::CommunicationLost));
        } else {
            let set_broken = |rig: &Rig, broken| match is_dominant {
                true => rig.bench.wire.set_held_dominant(broken),
                false => rig.bench.wire.set_cut(broken),
            };
            set_broken(&rig, true);
            rig.bench.hold(rig.motor, target, 15).unwrap();
            let (is_enabled, current) = (rig.is_enabled(), rig.esc.state().current.abs());
            assert!(is_enabled && current > 0.01, "as it was told last");
            rig.bench.hold(rig.motor, target, 10).unwrap();
            assert!(!rig.is_enabled() && rig.esc.state().current == 0.0);
            set_broken(&rig, false);
        }
        rig.bench.hold(rig.motor, target, 200).unwrap();
        let fault = rig.status().fault.map(|fault| fault.text);
        assert_eq!(fault, is_fault.then_some("communication lost"), "{is_dominant}");
        assert_eq!(rig.is_enabled(), !is_fault);
        assert_eq!(rig.ask(Request::ClearFault), Ok(Response::Done));
        rig.bench.hold(rig.motor, target, 20).unwrap();
        assert!(rig.is_enabled());
    }
}

/// A device that is set up otherwise than we were told is never enabled.
#[test]
fn settings_that_differ_are_faults_with_text() {
    let right = device(&mit());
    let limits = right.limits;
    let with = |limits| DamiaoConfig { limits, ..right };
    for (config, code, values) in [
        (DamiaoConfig { mode: Mode::Velocity, ..right }, 0x10A, [3.0, 1.0]),
        (with(rc10_sim::damiao::Limits { position: 12.6, ..limits }), 0x115, [12.6, 12.5]),
        (with(rc10_sim::damiao::Limits { velocity: 45.0, ..limits }), 0x116, [45.0, 30.0]),
        (with(rc10_sim::damiao::Limits { torque: 9.9, ..limits }), 0x117, [9.9, 10.0]),
        (DamiaoConfig { timeout: 2001, ..right }, 0x109, [100.05, 100.0]),
        // As it is sold: never.
        (DamiaoConfig { timeout: 0, ..right }, 0x109, [0.0, 100.0]),
    ] {
        let mut rig = on_bus(motor(mit()), &config, Safety::COAST);
        rig.bench.wait(20);
        let fault = rig.status().fault.unwrap();
        assert_eq!((fault.code, fault.differs), (code, Some(values)));
        let register = format!("register {} (", code - 0x100);
        assert!(fault.text.starts_with(&register), "{}", fault.text);
        let [held, wanted] = values;
        let words = format!(": it holds {held}, the table says {wanted}");
        assert!(fault.to_string().ends_with(&words), "{fault}");
        rig.switch.arm().unwrap();
        for _ in 0..100 {
            rig.bench.hold(rig.motor, target_of(&mit()), 1).unwrap();
            assert!(!rig.is_enabled());
        }
        // Looked at again, and not better.
        assert_eq!(rig.ask(Request::ClearFault), Ok(Response::Done));
        rig.bench.hold(rig.motor, target_of(&mit()), 20).unwrap();
        assert_eq!(rig.status().fault, Some(fault));
        // Set right.
        rig.switch.disarm();
        rig.bench.wait(2);
        let register = u16::try_from(code - 0x100).unwrap();
        let value = match register {
            9 => 2000,
            10 => 1,
            21 => 12.5_f32.to_bits(),
            22 => 30.0_f32.to_bits(),
            _ => 10.0_f32.to_bits(),
        };
        assert_eq!(rig.ask(Request::WriteRegister(register, value)), Ok(Response::Done));
        assert_eq!(rig.ask(Request::ClearFault), Ok(Response::Done));
        rig.switch.arm().unwrap();
        rig.bench.hold(rig.motor, target_of(&mit()), 20).unwrap();
        assert!(rig.is_enabled(), "{fault}");
    }
    // Not looked at.
    let config = DamiaoConfig { timeout: 0, ..right };
    let motor = Damiao::new(super::config(mit()).with_timeout(Micros::ZERO)).unwrap();
    let mut rig = on_bus(motor, &config, Safety::COAST).armed();
    rig.bench.hold(rig.motor, target_of(&mit()), 20).unwrap();
    assert!(rig.is_enabled());
    // 4π for 12.566.
    let motor =
        Damiao::new(Config::new(models::J3507, CAN_ID, MASTER_ID, Control::Velocity)).unwrap();
    let limits = rc10_sim::damiao::Limits {
        position: 4.0 * std::f64::consts::PI,
        velocity: 50.0,
        torque: 5.0,
    };
    let config = DamiaoConfig { limits, mode: Mode::Velocity, ..right };
    let _ = on_bus(motor, &config, Safety::COAST).armed();
}

/// A device that answers, but whose registers cannot be read, says so; told not to look, it runs.
#[test]
fn firmware_without_registers_is_told_apart() {
    for verify in [true, false] {
        let mut motor = Damiao::new(config(mit()).verify_limits(verify)).unwrap();
        let (mut enabled_at, mut asked) = (None, Vec::new());
        for millis in 1..=200 {
            motor.set_target(Target::Speed(Rpm::new(10.0))).unwrap();
            let drive = if millis < 3 { DriveMode::Off } else { DriveMode::Run };
            let tx = sent_in(&mut motor, &Tick::new(drive));
            let reads = tx.frames().iter().filter(|it| matches!(it.bytes(), [_, _, 0x33, _]));
            asked.extend(reads.map(|_| millis % 10));
            let enables = tx.frames()[0].bytes().ends_with(&[0xFF, 0xFC]);
            if enables {
                enabled_at = enabled_at.or(Some(millis));
            }
            let code = u8::from(enabled_at.is_some());
            let _ = motor
                .unpack_feedback(&says(code), Micros::from_millis(millis), Link::Online)
                .unwrap();
        }
        if verify {
            assert_eq!(enabled_at, None);
            assert_eq!(motor.fault().unwrap().code, 0x1FF);
            // In every phase of what others send each 5 or 10 ms: in one of them all might be lost.
            asked.sort_unstable();
            assert_eq!(asked, (0..10).collect::<Vec<_>>());
            let heard = motor.unpack_feedback(&says(0), Micros::from_millis(201), Link::Online);
            assert_eq!(heard, Ok(FrameKind::Fault));
        } else {
            assert_eq!((enabled_at, motor.fault()), (Some(3), None));
        }
    }
}

/// Old firmware knows operations only with the offset of the mode it is in. It may be in another
/// than ours: it is disabled all the same, on the bare identifier.
#[test]
fn old_firmware_in_another_mode_is_disabled() {
    let control = Control::Velocity;
    let config = DamiaoConfig { mode: Mode::Mit, old_firmware: true, ..device(&control) };
    let mut rig = on_bus(motor(control), &config, Safety::COAST);
    enable(&rig);
    rig.bench.wait(20);
    assert!(!rig.is_enabled());
    assert_eq!(rig.status().fault.unwrap().code, 0x10A);

    let config = DamiaoConfig { old_firmware: true, ..device(&control) };
    let mut rig = on_bus(motor(control), &config, Safety::COAST).armed();
    rig.bench.hold(rig.motor, target_of(&control), 20).unwrap();
    assert!(rig.is_enabled());
}

/// Until the device does it, each operation goes to both identifiers in turn; then to one.
#[test]
fn an_operation_that_is_not_obeyed_goes_to_both_identifiers_in_turn() {
    let (own, bare) = (0x200 + u32::from(CAN_ID), u32::from(CAN_ID));
    for (mode, state, last, in_turn) in [
        (DriveMode::Off, 1, 0xFD, true),
        (DriveMode::Off, 0, 0xFD, false),
        (DriveMode::Run, 0, 0xFC, true),
    ] {
        let mut motor = Damiao::new(config(Control::Velocity).verify_limits(false)).unwrap();
        motor.set_target(Target::Speed(Rpm::new(10.0))).unwrap();
        let mut sent = Vec::new();
        for millis in 1..=6 {
            motor.unpack_feedback(&says(state), Micros::from_millis(millis), Link::Online).unwrap();
            let tx = sent_in(&mut motor, &Tick::new(mode));
            assert_eq!(tx.frames()[0].bytes().last(), Some(&last));
            sent.push(tx.frames()[0].raw_id());
        }
        // The first one is to its own identifier or the bare one: as in the tick before.
        let turns = sent[1..].windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!(turns, if in_turn { 4 } else { 0 }, "{mode:?} {state}: {sent:x?}");
        assert!(in_turn || sent.iter().all(|sent| *sent == own), "{sent:x?}");
        assert!(sent.iter().all(|sent| [own, bare].contains(sent)), "{sent:x?}");
    }
}

#[test]
fn an_enabled_device_is_disabled_before_all_else() {
    for control in controls() {
        let mut rig = on_bus(motor(control), &device(&control), Safety::COAST);
        enable(&rig);
        rig.bench.world.advance(Micros::new(500));
        assert!(rig.is_enabled());
        rig.bench.wait(3);
        assert!(!rig.is_enabled(), "{control:?}");
    }
}

/// The answer to another program's question about register 21.
#[test]
fn an_answer_that_was_not_asked_for_changes_nothing() {
    let mut motor = Damiao::new(config(mit()).verify_limits(false)).unwrap();
    let id = StandardId::new(MASTER_ID).unwrap();
    let reply = CanFrame::eight_bytes(id, [0x11, 0, 0x33, 21, 0, 0, 0x48, 0x41]);
    let heard = motor.unpack_feedback(&reply, Micros::from_millis(5), Link::Online);
    assert_eq!((heard, motor.feedback()), (Err(FrameError::Unasked), rc10_motor::Feedback::NEW));
}

/// Switched off and on, it knows where it is in its turn, and no more: that is believed.
#[test]
fn a_restart_keeps_the_angle_within_the_turn() {
    let id = StandardId::new(MASTER_ID).unwrap();
    for (millis, link) in [(2, Link::Online), (60, Link::Lost)] {
        let mut motor = Damiao::new(config(mit()).verify_limits(false)).unwrap();
        let mut hear = |field: u16, millis, link| {
            let [high, low] = field.to_be_bytes();
            let frame = CanFrame::eight_bytes(id, [0x01, high, low, 0x7F, 0xF7, 0xFF, 30, 40]);
            motor.unpack_feedback(&frame, Micros::from_millis(millis), link).unwrap();
            motor.feedback()
        };
        // 9 rad; then a turn less, and 0.3 rad more.
        let before = hear(56_360, 1, Link::NeverSeen).total_angle;
        let after = hear(40_676, millis, link);
        let moved = after.total_angle.minus(before).degrees().get();
        assert!((moved - 17.2).abs() < 0.1, "{moved}");
        assert_eq!(after.turn_gaps, 1);
    }
}
