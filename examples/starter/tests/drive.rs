//! The robot does what hands tell it.

use rc10::motor::Link;
use rc10::prelude::*;
use rc10::sim::judge::problems;
use rc10::sim::recording::problem::any;
use rc10::sim::{Simulated, replayed, simulated};
use starter::{Name, Robot};

#[test]
fn it_drives_forward_and_has_no_problems() {
    let run = simulated::<Robot>(Robot::description(), 1, Micros::from_millis(5000)).unwrap();
    assert!(run.motors.iter().all(|track| track.last.link == Link::Online));
    let found = problems(&run);
    assert!(!any(&found), "{found:?}");
    // A sample is 10 ms: forward at the end of the first second.
    let path = run.base.unwrap().path;
    assert!(path[119].x > 0.5 && path[119].y.abs() < 0.05, "{:?}", path[119]);
    // 3.0 s: the feeder turns.
    let feeder = run.motors[Name::Feeder.index()].samples[299].rpm;
    assert!((feeder - 200.0).abs() < 10.0, "{feeder} rpm");
}

#[test]
fn it_is_the_same_twice_and_can_be_replayed() {
    let same = replayed::<Robot>(1, Micros::from_millis(5000));
    assert!(same.is_ok(), "{}", same.unwrap_err());
}
