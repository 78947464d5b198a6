//! Packets of `rm_vision` that Python makes, both ways.

use std::process::Command;

use rc10_module::Stream;
use rc10_module::vision::{Gimbal, RmVision, Target};
use rc10_time::Micros;
use serde_json::Value;

use super::{bytes_of, must_succeed, python, script};

#[test]
fn packets_of_auto_aim_are_those_of_python() {
    let Some(python) = python() else { return };
    for seed in 1..=3 {
        let mut command = Command::new(python);
        let printed = must_succeed(command.arg(script("vision.py")).arg(seed.to_string()));
        let told: Value = serde_json::from_str(&printed).unwrap();
        let mut stream = Stream::new(RmVision);
        let from_pc = told["from_pc"].as_array().unwrap();
        for one in from_pc {
            let mut heard = Vec::new();
            stream.receive(&bytes_of(&one["packet"]), Micros::ZERO, |it| heard.push(it));
            let Target { is_tracked, number, armours, .. } = heard[0];
            let Target { place, yaw, velocity, yaw_rate, radii, rise, .. } = heard[0];
            let head = [u8::from(is_tracked), number, armours].map(f32::from);
            let all = [&head[..], &place, &[yaw], &velocity, &[yaw_rate], &radii, &[rise]].concat();
            let says = one["says"].as_array().unwrap().iter().map(|it| it.as_f64().unwrap());
            assert_eq!(
                all.into_iter().map(f64::from).collect::<Vec<_>>(),
                says.collect::<Vec<_>>()
            );
        }
        assert_eq!(from_pc.len(), 500);
        for one in told["to_pc"].as_array().unwrap() {
            #[expect(clippy::cast_possible_truncation, reason = "Python rounded it")]
            let number = |at: usize| one["says"][at].as_f64().unwrap() as f32;
            let gimbal = Gimbal {
                aims_at_blue: one["says"][0] == 1,
                resets: one["says"][1] == 1,
                attitude: [2, 3, 4].map(number),
                aim: [5, 6, 7].map(number),
            };
            assert_eq!(gimbal.packet()[..], bytes_of(&one["packet"])[..]);
        }
    }
}
