//! The robot of many vendors follows its script, on both buses and the line, by what its simulated
//! shafts really do.

use mixed::{Motors, Ports, Shared};
use rc10_cli::recording::{MotorTrack, Recording};
use rc10_cli::run::simulate::simulate;
use rc10_motor::{DriveMode, Link};
use rc10_time::Micros;

fn run(seed: u64) -> Recording {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<mixed::Robot>(&shared, &mut motors).unwrap();
    simulate(robot, seed, Micros::from_millis(10_000)).unwrap()
}

fn track<'r>(run: &'r Recording, label: &str) -> &'r MotorTrack {
    run.motors.iter().find(|track| track.motor.label == label).unwrap()
}

#[test]
fn every_motor_follows_the_script() {
    let run = run(1);
    let sample = |label: &str, millis: usize| track(&run, label).samples[millis / 10 - 1];
    let turns = |label: &str, millis, rpm: f64| {
        let real = sample(label, millis).rpm;
        assert!((real - rpm).abs() < 0.02 * rpm.abs() + 3.0, "{label} at {millis} ms: {real} rpm");
    };
    let is_at = |label: &str, millis, degrees: f64| {
        let measured = sample(label, millis).measured;
        let way = (measured - degrees + 180.0).rem_euclid(360.0) - 180.0;
        assert!(way.abs() < 1.5, "{label} at {millis} ms: {measured} degrees");
        turns(label, millis, 0.0);
    };
    turns("wheel", 2450, 600.0);
    turns("wheel", 5900, -400.0);
    turns("wheel", 8400, 0.0);
    turns("flywheel", 4000, 250.0);
    for (label, out) in [("arm", 60.0), ("hip", 45.0), ("wrist", 90.0), ("turret", 180.0)] {
        is_at(label, 2950, out);
        is_at(label, 6400, 0.0);
    }
    turns("hip", 8400, 60.0);
    turns("wrist", 8400, 30.0);
    for leg in 0..8 {
        let leg = format!("leg {leg}");
        is_at(&leg, 4900, 20.0);
        is_at(&leg, 9900, 0.0);
    }
    for motor in ["wheel", "hip", "wrist", "turret", "flywheel"] {
        let last = sample(motor, 10_000);
        assert!(last.current.abs() < 0.05, "{motor} is let go: {} A", last.current);
    }
}

#[test]
fn nothing_is_lost_and_one_seed_gives_one_trace() {
    let run_1 = run(1);
    for track in &run_1.motors {
        let (label, last) = (track.motor.label, &track.last);
        assert_eq!(
            (last.link, last.drive, last.fault),
            (Link::Online, DriveMode::Run, None),
            "{label}"
        );
        let counters = last.counters;
        let bad = (counters.malformed, counters.lost, counters.refused.total(), track.overwritten);
        assert_eq!(bad, (0, 0, 0, 0), "{label}");
    }
    for bus in &run_1.buses {
        let last = &bus.last;
        let lost = (last.health.receive_lost, last.replaced, last.refused, last.received.unclaimed);
        assert_eq!(lost, (0, 0, 0, 0), "bus {}", bus.number);
        let (least, worst) = (f64::from(last.load.least), f64::from(last.load.worst));
        let load = bus.load;
        assert!((least - 3.0..=worst).contains(&load) && load < 90.0, "bus {}", bus.number);
    }
    for line in &run_1.lines {
        let traffic = &line.traffic;
        let bad = (traffic.timeouts, traffic.crc_errors, traffic.garbage, traffic.unexpected);
        assert_eq!((bad, line.overruns), ((0, 0, 0, 0), 0));
        assert!(traffic.exchanges > 79_800, "{} exchanges", traffic.exchanges);
    }
    assert_eq!(run_1.trace_hash(), run(1).trace_hash());
    assert_ne!(run_1.trace_hash(), run(2).trace_hash());
}
