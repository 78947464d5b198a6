//! Frames of the referee system that Python makes, in both versions of 2026 and with what a next one may append.

use std::process::Command;

use rc10_module::Stream;
use rc10_module::referee::{Referee, Said, frame};
use rc10_time::Micros;
use serde_json::{Value, json};

use super::{bytes_of, must_succeed, python, script};

#[test]
fn the_referee_says_what_python_wrote() {
    let Some(python) = python() else { return };
    for seed in 1..=5 {
        let mut command = Command::new(python);
        let printed = must_succeed(command.arg(script("referee.py")).arg(seed.to_string()));
        let told: Vec<Value> = serde_json::from_str(&printed).unwrap();
        assert_eq!(told.len(), 2400);
        let (mut stream, mut heard) = (Stream::new(Referee), Vec::new());
        for one in &told {
            let bytes = bytes_of(&one["frame"]);
            stream.receive(&bytes, Micros::ZERO, |packet| heard.push((packet, bytes.clone())));
        }
        assert_eq!((heard.len(), stream.counters().skipped), (told.len(), 0));
        for ((packet, bytes), one) in heard.iter().zip(&told) {
            assert_eq!(json!(packet.sequence), one["sequence"]);
            assert_eq!(said(&packet.said()), one["said"], "{packet:?}");
            assert_eq!(
                frame(packet.sequence, packet.command, &packet.data).unwrap()[..],
                bytes[..]
            );
        }
    }
}

fn said(said: &Said) -> Value {
    match said {
        Said::Robot(it) => {
            let outputs: u8 = (0..3).zip(it.supplied).map(|(bit, on)| u8::from(on) << bit).sum();
            let [health, most] = it.health;
            let (cooling, heat, power) = (it.cooling, it.heat_limit, it.power_limit);
            let speed = it.speed_limit.map(f64::from);
            json!(["robot", it.id, it.level, health, most, cooling, heat, power, outputs, speed])
        }
        Said::Power(it) => json!(["power", it.buffer, it.small_heat, it.large_heat]),
        Said::Pose(it) => json!(["pose", f64::from(it.x), f64::from(it.y), f64::from(it.angle)]),
        Said::Shot(it) => json!(["shot", it.kind, it.barrel, it.rate, f64::from(it.speed)]),
        Said::Allowance { small, large, coins } => json!(["allowance", small, large, coins]),
        Said::Game(it) => json!(["game", it.kind, it.stage, it.seconds]),
        other => panic!("{other:?}"),
    }
}
