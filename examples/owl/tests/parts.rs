//! Each part of the robot does its work.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::float_cmp, reason = "pulses are whole microseconds")]

use owl::simulation::{START, WALL};
use owl::{Name, Robot};
use rc10::prelude::*;
use rc10::sim::judge::problems;
use rc10::sim::recording::Recording;
use rc10::sim::recording::problem::any;
use rc10::sim::{Simulated, simulated};

fn run(seconds: u64) -> Recording {
    simulated::<Robot>(Robot::description(), 1, Micros::from_millis(1000 * seconds)).unwrap()
}

/// A signal at this time.
fn at(run: &Recording, label: &str, millis: usize) -> f64 {
    let signal = run.signals.iter().find(|signal| signal.label == label).unwrap();
    f64::from(signal.samples[millis / 10 - 1].unwrap().max)
}

#[test]
fn each_part_does_its_work() {
    let run = run(10);
    let found = problems(&run);
    assert!(!any(&found), "{found:?}");
    // It brakes a metre from the wall, and does not touch it.
    let path = &run.base.as_ref().unwrap().path;
    let x = path.last().unwrap().x;
    assert!(x > WALL - 1.0 && x < WALL - 0.3, "{x} m");
    assert!((at(&run, "wall", 9000) - (WALL - x)).abs() < 0.02);
    // The throttle in the middle is the middle of the lift's range, at its low end the bottom.
    assert!((at(&run, "lift height", 8400) - 855.0).abs() < 2.0);
    assert!((at(&run, "pressure", 5000) - 5.0).abs() < 1e-3);
    assert_eq!([5500, 7000].map(|at_ms| at(&run, "gripper pulse", at_ms)), [2000.0, 1000.0]);
}

/// It begins 5 degrees below level, where the encoder says 355, and no joint runs into a stop.
#[test]
fn the_arm_knows_where_it_is() {
    let run = run(7);
    for (label, start) in [("shoulder angle", START[0]), ("elbow angle", START[1])] {
        assert!((at(&run, label, 900) - start).abs() < 1.0, "{label}");
    }
    // 80 % of 15 rpm for a second.
    assert!((at(&run, "shoulder angle", 6500) - (START[0] + 72.0)).abs() < 3.0);
    assert!((at(&run, "elbow angle", 6500) - (START[1] + 72.0)).abs() < 3.0);
    // The motors' shafts are where the robot believes them to be.
    let turned = |name: Name| {
        let samples = &run.motors[name.index()].samples;
        samples.iter().map(|sample| sample.rpm * 0.06).sum::<f64>()
    };
    assert!(
        (turned(Name::Shoulder) - 72.0).abs() < 3.0 && (turned(Name::Elbow) - 72.0).abs() < 3.0
    );
}

/// It is armed though the throttle is at its low end; a stick that springs back must be in the middle.
#[test]
fn a_stick_that_is_not_in_the_middle_keeps_it_from_arming() {
    let mut world = Robot::description();
    for line in &mut world.remote.as_mut().unwrap().script {
        line.controls.right.x = 0.5;
    }
    let run = simulated::<Robot>(world, 1, Micros::from_millis(2000)).unwrap();
    // The lift has not begun to home.
    assert_eq!(at(&run, "lift", 1900), 0.0);
}
