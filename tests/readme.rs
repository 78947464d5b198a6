//! The READMEs: their length, and the robot that they show, driven.

use rc10_cli::judge::problems;
use rc10_cli::recording::problem::any;
use rc10_cli::{Simulated as _, simulated};
use rc10_motor::Names as _;
use rc10_time::Micros;

#[allow(dead_code, reason = "`main` is the example's")]
#[path = "../crates/rc10/examples/thirty.rs"]
mod thirty;

use thirty::{Name, Robot};

const ROBOT: &str = include_str!("../crates/rc10/examples/thirty.rs");
const READMES: [&str; 2] = [include_str!("../README.md"), include_str!("../README.zh-CN.md")];

#[test]
fn both_are_short_and_show_the_robot_that_is_compiled() {
    let (shown, _) = ROBOT.split_once("\n// So far the READMEs.").unwrap();
    assert!(shown.lines().count() <= 30, "{} lines", shown.lines().count());
    for readme in READMES {
        assert!(readme.len() <= 9_000, "{} bytes", readme.len());
        assert!(readme.contains(&format!("```rust\n{shown}```\n")), "another robot than:\n{shown}");
    }
}

#[test]
fn its_wheels_turn_as_the_sticks_say() {
    let run = simulated::<Robot>(Robot::description(), 1, Micros::from_millis(2500)).unwrap();
    let found = problems(&run);
    assert!(!any(&found), "{found:?}");
    // Half of the full speed: both forward; the left one forward and the right one back; none.
    for (millis, speeds) in
        [(190, [0.0; 2]), (980, [100.0; 2]), (1780, [100.0, -100.0]), (2490, [0.0; 2])]
    {
        for (name, expected) in [Name::Left, Name::Right].into_iter().zip(speeds) {
            let rpm = run.motors[name.index()].samples[millis / 10].rpm;
            assert!((rpm - expected).abs() < 4.0, "{name:?} at {millis} ms: {rpm} rpm");
        }
    }
}
