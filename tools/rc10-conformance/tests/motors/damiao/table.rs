//! The signal table says of every frame what the codec says.

use super::{config, controls, device_id};
use crate::motors::damiao_values::values;
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use rc10_can::CanFrame;
use rc10_motor::damiao::signals::{NOT_IN_DBC, Scaled, messages};
use rc10_motor::damiao::wire::{self, State};
use rc10_motor::damiao::{Setpoint, models};
use rc10_motor::signals::{Message, Presence, Signal};

const FRAMES: usize = 10_000;

fn scaled() -> &'static Scaled {
    Box::leak(Box::new(Scaled::of(&models::J4310.limits)))
}

fn random() -> TestRng {
    TestRng::deterministic_rng(RngAlgorithm::ChaCha)
}

fn signal(message: &Message, name: &str) -> &'static Signal {
    message.signals.iter().find(|signal| signal.name == name).expect(name)
}

fn close(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= 1e-6 * (1.0 + a.abs().max(b.abs()))
}

#[test]
fn what_devices_send_has_the_values_that_the_decoder_reads() {
    let scaled = scaled();
    let messages = messages(&config(controls()[0]), scaled);
    let mut random = random();
    let mut compared = [0; 3];
    for (message, compared) in messages.iter().zip(&mut compared) {
        for _ in 0..FRAMES {
            let mut data = [0; 8];
            random.fill_bytes(&mut data);
            if message.name == "DAMIAO_REGISTER" {
                data[2] = [0x33, 0x55, 0xAA][usize::from(data[2]) % 3];
                data[3] = [7, 8, 9, 10, 21, 22, 23, 35, 80, 1][usize::from(data[3]) % 10];
            }
            let frame = CanFrame::eight_bytes(message.id, data);
            for (name, value) in values(message.name, &frame, &models::J4310.limits) {
                let read = signal(message, name).physical(&data).unwrap();
                assert!(close(read, value), "{} {name} in {frame}: {read} {value}", message.name);
                *compared += 1;
            }
        }
    }
    assert_eq!(compared[0], 7 * FRAMES);
    assert!(compared[2] > 2 * FRAMES, "{compared:?}");
}

/// Multiplexed: what is there is what the switch says.
#[test]
fn a_register_has_one_value() {
    let scaled = scaled();
    let messages = messages(&config(controls()[0]), scaled);
    let register = messages.iter().find(|message| message.name == "DAMIAO_REGISTER").unwrap();
    let mut switches = 0;
    for number in 0..=255 {
        let there = register.signals.iter().filter(|s| s.presence == Presence::If(number));
        assert!(there.count() <= 1, "{number}");
    }
    for signal in register.signals {
        switches += usize::from(signal.presence == Presence::Switch);
    }
    assert_eq!(switches, 1);
}

#[test]
fn what_we_send_has_the_values_that_were_sent() {
    let scaled = scaled();
    let mut random = random();
    let mut number = |low: f32, high: f32| {
        let share = f32::from(u16::try_from(random.next_u32() >> 16).unwrap()) / 65_535.0;
        low + share * (high - low)
    };
    for control in controls() {
        let messages = messages(&config(control), scaled);
        let id = device_id(control);
        for _ in 0..FRAMES {
            let (p, v, kp) = (number(-12.5, 12.5), number(0.0, 30.0), number(0.0, 500.0));
            let (kd, torque, share) = (number(0.0, 5.0), number(-10.0, 10.0), number(0.0, 1.0));
            let setpoint = Setpoint { position: p, velocity: v, kp, kd, torque };
            let (frame, sent): (_, Vec<(&str, f32, f32)>) = match control.mode() {
                wire::Mode::Mit => (
                    wire::mit(id, &setpoint, &models::J4310.limits),
                    vec![
                        ("POSITION", p, 25.0 / 65_535.0),
                        ("VELOCITY", v, 60.0 / 4095.0),
                        ("KP", kp, 500.0 / 4095.0),
                        ("KD", kd, 5.0 / 4095.0),
                        ("TORQUE", torque, 20.0 / 4095.0),
                    ],
                ),
                wire::Mode::PositionVelocity => (
                    wire::position_velocity(id, p, v),
                    vec![("POSITION", p, 0.0), ("VELOCITY", v, 0.0)],
                ),
                wire::Mode::Velocity => (wire::velocity(id, v), vec![("VELOCITY", v, 0.0)]),
                wire::Mode::ForcePosition => (
                    wire::force_position(id, p, v, share),
                    vec![("POSITION", p, 0.0), ("VELOCITY", v, 0.01), ("CURRENT", share, 0.0001)],
                ),
            };
            let [message] = messages
                .iter()
                .filter(|m| m.matches(&frame) && m.is_plain())
                .collect::<Vec<_>>()[..]
            else {
                panic!("no message, or several, for {frame}");
            };
            assert_eq!((usize::from(message.len), message.from_device), (frame.len(), false));
            assert_eq!(message.signals.len(), sent.len());
            for (name, sent, step) in sent {
                let read = signal(message, name).physical(frame.bytes()).unwrap();
                let off = (read - f64::from(sent)).abs();
                assert!(off <= f64::from(step) * 1.001 + 1e-5, "{name} in {frame}: {read} {sent}");
            }
        }
    }
}

#[test]
fn names_of_faults_are_those_of_the_codec() {
    let scaled = scaled();
    let messages = messages(&config(controls()[0]), scaled);
    let feedback = messages.iter().find(|message| message.from_device).unwrap();
    let named: Vec<_> = signal(feedback, "ERR").values().collect();
    assert_eq!(named.len(), 11);
    for (code, text) in named.into_iter().filter(|(code, _)| *code > 1) {
        let fault = State::Error(code.try_into().unwrap()).fault().unwrap();
        assert_eq!((fault.code, fault.text), (code, text));
    }
    assert!(
        NOT_IN_DBC.iter().all(|sentence| sentence.starts_with("Damiao") && sentence.ends_with('.'))
    );
}
