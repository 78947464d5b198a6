//! Restarts, faults, strange answers.

use rc10_app::{Amps, Rpm};
use rc10_can::CanFrame;
use rc10_motor::lk::{Commands, DriveId, Lk};
use rc10_motor::{
    CanMotor, DriveMode, FrameError, FrameKind, Link, Motor, Request, Response, Safety, Target,
    Tick,
};
use rc10_sim::EscFault;
use rc10_sim::lk::{Drive, Settings, State, encode_echo, encode_health, encode_state};
use rc10_time::Micros;

use super::{bench, is_on, joint, joint_plant};
use crate::motors::{assert_returns_softly, sent_in};

const SPEED: Target = Target::Speed(Rpm::new(100.0));

#[test]
fn a_drive_that_is_on_after_power_on_comes_back_softly_too() {
    let settings = Settings { starts_on: true, ..Settings::mg(1) };
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), settings, joint_plant(), Safety::COAST);
    bench.hold(id, SPEED, 500).unwrap();
    esc.set_power(false);
    bench.hold(id, SPEED, 300).unwrap();
    esc.set_power(true);
    // 10 % of 5 A a millisecond, and a step of the drive; a question may take the first one's place.
    let most = |millis| (0.1 * (millis + 1.0) + 0.02) * 5.0;
    assert_returns_softly(&mut bench, id, &esc, most);
    assert!(is_on(&esc));
}

#[test]
fn a_drive_knows_no_encoder_fault_and_protects_itself_from_heat() {
    let mut plant = joint_plant();
    plant.ambient = 101.0;
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), Settings::mg(1), plant, Safety::COAST);
    assert!(!esc.inject(EscFault::Encoder));
    bench.hold(id, SPEED, 200).unwrap();
    assert_eq!(bench.status(id).fault.unwrap().text, "motor too hot");
    assert!(esc.state().output_rpm.abs() < 1e-9);
}

#[test]
fn a_command_timeout_of_the_drive_does_not_bite_while_disarmed() {
    let settings = Settings { command_timeout: Some(Micros::from_millis(50)), ..Settings::mg(1) };
    let (mut bench, esc, id) =
        bench(Lk::new(joint()).unwrap(), settings, joint_plant(), Safety::COAST);
    bench.bus.switch().disarm();
    bench.wait(1000);
    assert_eq!(esc.with(|drive: &mut Drive| drive.errors), Some(0));
    bench.wire.set_cut(true);
    bench.wait(100);
    bench.wire.set_cut(false);
    bench.wait(150);
    assert_eq!(bench.status(id).fault.unwrap().text, "commands have stopped");
}

#[test]
fn what_is_no_answer_changes_nothing() {
    let mut motor = Lk::new(joint()).unwrap();
    let own = DriveId::new(1).unwrap().can_id();
    let at = Micros::from_millis(1);
    let state = State { temperature: 30, current: 5, speed: 60, encoder: 1000 };
    let mut heard = |frame: &CanFrame| motor.unpack_feedback(frame, at, Link::Online);
    let eight = |bytes| CanFrame::eight_bytes(own, bytes);
    let good = encode_state(0x9C, state);
    for (frame, error) in [
        // Moved by others, or unasked.
        (eight(encode_state(0xA2, state)), FrameError::Unasked),
        (eight(encode_echo(0x81)), FrameError::Unasked),
        (eight([0x92; 8]), FrameError::Unasked),
        (eight([0xFF; 8]), FrameError::Unexpected),
    ] {
        assert_eq!(heard(&frame), Err(error), "{frame}");
    }
    assert_eq!(heard(&eight(encode_echo(0x88))), Ok(FrameKind::Other));
    assert_eq!(heard(&eight(encode_health(0x9A, 20, 24.0, 0))), Ok(FrameKind::Other));
    assert_eq!(heard(&eight(encode_health(0x9A, 20, 24.0, 8))), Ok(FrameKind::Fault));
    assert_eq!(heard(&eight(good)), Ok(FrameKind::Feedback));
    assert!((motor.feedback().speed.get() - 1.0).abs() < 1e-6);

    // Fourteen bits cannot show this.
    let mut config = joint();
    config.model.encoder = rc10_motor::lk::EncoderBits::Fourteen;
    let mut small = Lk::new(config).unwrap();
    let far = eight(encode_state(0x9C, State { encoder: 16_384, ..state }));
    assert_eq!(small.unpack_feedback(&far, at, Link::NeverSeen), Err(FrameError::Encoder));
    assert_eq!(small.feedback(), rc10_motor::Feedback::NEW);

    // In the multi-motor frame nothing but measurements comes.
    let mut multi = Lk::new(joint().with_commands(Commands::MultiMotor)).unwrap();
    let health = eight(encode_health(0x9A, 20, 24.0, 8));
    assert_eq!(multi.unpack_feedback(&health, at, Link::Online), Err(FrameError::Unasked));
    assert_eq!(
        multi.unpack_feedback(&eight(encode_state(0xA1, state)), at, Link::Online),
        Ok(FrameKind::Feedback)
    );
}

/// An echo from before a restart is not taken for the new drive's.
#[test]
fn one_echo_is_not_enough() {
    let mut motor = Lk::new(joint()).unwrap();
    let own = DriveId::new(1).unwrap().can_id();
    let state = State { temperature: 30, current: 0, speed: 0, encoder: 1000 };
    let feed = |motor: &mut Lk, bytes, millis, link| {
        let frame = CanFrame::eight_bytes(own, bytes);
        motor.unpack_feedback(&frame, Micros::from_millis(millis), link).unwrap();
        sent_in(motor, &Tick::new(DriveMode::Run)).frames()[0].bytes()[0]
    };
    motor.set_target(Target::Current(Amps::new(1.0))).unwrap();
    let measurement = encode_state(0x9C, state);
    assert_ne!(feed(&mut motor, measurement, 1, Link::NeverSeen), 0xA1);
    assert_ne!(feed(&mut motor, encode_echo(0x88), 2, Link::Online), 0xA1);
    assert_ne!(feed(&mut motor, measurement, 3, Link::Online), 0xA1);
    assert_eq!(feed(&mut motor, encode_echo(0x88), 4, Link::Online), 0xA1);
    // A measurement after a silence is a new drive's.
    assert_ne!(feed(&mut motor, measurement, 20, Link::Lost), 0xA1);
}

/// What the drive was asked before does not tell that its errors are cleared.
#[test]
fn only_the_answer_to_clearing_clears() {
    let mut motor = Lk::new(joint()).unwrap();
    let hear = |motor: &mut Lk, bytes| {
        let frame = CanFrame::eight_bytes(DriveId::new(1).unwrap().can_id(), bytes);
        motor.unpack_feedback(&frame, Micros::from_millis(1), Link::Online).unwrap()
    };
    assert_eq!(hear(&mut motor, encode_health(0x9A, 20, 24.0, 16)), FrameKind::Fault);
    // Another program clears.
    assert_eq!(hear(&mut motor, encode_health(0x9B, 20, 24.0, 0)), FrameKind::Other);
    assert!(motor.fault().is_some() && motor.response().is_none());
    assert_eq!(motor.request(Request::ClearFault), Ok(Response::Pending));
    assert_eq!(hear(&mut motor, encode_health(0x9A, 20, 24.0, 0)), FrameKind::Other);
    assert_eq!(motor.response(), None);
    assert!(motor.fault().is_some());
    assert_eq!(hear(&mut motor, encode_health(0x9B, 20, 24.0, 0)), FrameKind::Other);
    assert_eq!(motor.response(), Some(Ok(Response::Done)));
    assert_eq!(motor.fault(), None);
}
