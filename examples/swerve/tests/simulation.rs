//! The robot in simulation: it does what the sticks say, its wheels hardly slip, it knows where it is,
//! and it stops when the sticks are not heard.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::ops::Range;

use rc10::module::remote::DEAD_BAND;
use rc10::motor::Link;
use rc10::sim::judge::path::PathFigures;
use rc10::sim::recording::Recording;
use rc10::sim::recording::sample::BaseMeasurement;
use rc10::sim::run::simulate::simulate;
use rc10::time::Micros;
use swerve::table::BASE;
use swerve::{Motors, Ports, Robot, Shared};

/// When a stick is moved in the script, and the motion that it asks for: m/s and rad/s.
const ASKED: [(usize, [f64; 3]); 6] = [
    (200, [1.0, 0.0, 0.0]),
    (1200, [-1.0, 0.0, 0.0]),
    (2200, [0.0, 1.0, 0.0]),
    (3200, [0.0, 0.0, 2.0]),
    (4200, [1.0, 0.0, 1.0]),
    (5200, [0.0, 0.0, 0.0]),
];

fn run(seed: u64, fault: Option<&str>, millis: u64) -> Recording {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let mut robot = rc10::sim::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let faults: Vec<_> = fault.iter().map(|fault| fault.parse().unwrap()).collect();
    robot.set_faults(&faults).unwrap();
    simulate(robot, seed, Micros::from_millis(millis)).unwrap()
}

/// The samples of a time.
const fn samples(millis: Range<usize>) -> Range<usize> {
    millis.start / 10..millis.end / 10
}

/// Motion of the base in the world from one sample to another, in its own axes: m/s forward and to the
/// left, rad/s.
fn twist(run: &Recording, samples: Range<usize>) -> [f64; 3] {
    let path = &run.base.as_ref().unwrap().path;
    let (from, to) = (path[samples.start], path[samples.end]);
    let (sin, cos) = f64::midpoint(from.yaw, to.yaw).sin_cos();
    let time = samples.len() as f64 * 0.01;
    let [x, y, yaw] = [to.x - from.x, to.y - from.y, to.yaw - from.yaw].map(|way| way / time);
    [x * cos + y * sin, y * cos - x * sin, yaw]
}

/// What is left of an asked motion: the sticks have a dead band.
fn felt(asked: [f64; 3]) -> [f64; 3] {
    let full = [BASE.full_stick.vx, BASE.full_stick.vy, BASE.full_stick.wz].map(f64::from);
    let band = f64::from(DEAD_BAND);
    let felt =
        |(asked, full): (f64, f64)| (asked / full - band.copysign(asked)) / (1.0 - band) * full;
    [0, 1, 2].map(|at| if asked[at] == 0.0 { 0.0 } else { felt((asked[at], full[at])) })
}

/// How fast the wheels slip over the floor, along and across them, in the worst of some samples, m/s.
fn slip(run: &Recording, samples: Range<usize>) -> f64 {
    let base = run.base.as_ref().unwrap();
    let mut most = 0.0_f64;
    for at in samples {
        let (from, to) = (&base.heard[at], &base.heard[at + 1]);
        let [vx, vy, wz] = twist(run, at..at + 1);
        let rims = base.ways(from, to).into_iter().zip(BaseMeasurement::steered(from, to));
        for ((way, steered), wheel) in rims.zip(&base.chassis.wheels) {
            let (sin, cos) = (wheel.direction + steered.to_radians()).sin_cos();
            let rim = way / 0.01;
            let [x, y] = [vx - wz * wheel.y, vy + wz * wheel.x];
            most = most.max((rim * cos - x).hypot(rim * sin - y));
        }
    }
    most
}

#[test]
fn it_does_what_the_sticks_say() {
    let run = run(1, None, 6200);
    for (begin, asked) in ASKED {
        let wanted = felt(asked);
        // The largest change is 2 m/s, at 3 m/s²; and another 150 ms to settle.
        for millis in (begin + 820..begin + 940).step_by(10) {
            let real = twist(&run, samples(millis..millis + 50));
            let off = [0, 1, 2].map(|at| (real[at] - wanted[at]).abs());
            assert!(off.iter().all(|off| *off < 0.01), "{millis} ms: {real:?}, not {wanted:?}");
        }
    }
    // The wheels that looked any way have turned it at the start, and it has turned back.
    let path = &run.base.as_ref().unwrap().path[samples(0..3200)];
    let degrees: Vec<_> = path.iter().map(|pose| pose.yaw.abs().to_degrees()).collect();
    let (aside, held) = (degrees.iter().copied().fold(0.0, f64::max), degrees[degrees.len() - 1]);
    println!("turned aside by {aside:.2} degrees at most, {held:.2} at last");
    assert!(held < 0.3, "{held} degrees");
    assert!(run.motors.iter().all(|track| track.last.link == Link::Online));
    assert!(run.buses.iter().all(|bus| bus.last.refused + bus.last.replaced == 0));
}

#[test]
fn its_wheels_hardly_slip() {
    let run = run(1, None, 6200);
    for (begin, asked) in ASKED {
        let [changing, steady] = [begin..begin + 800, begin + 800..begin + 980]
            .map(|millis| slip(&run, samples(millis)));
        println!("{asked:?}: {changing:.3} m/s while it changes, then {steady:.3} m/s");
        // At first the wheels look any way.
        let most = if begin == 200 { 0.15 } else { 0.1 };
        assert!(changing < most && steady < 0.01, "{asked:?}");
    }
    // What the robot itself sees of it: speeds of single samples.
    let seen = run.signals.iter().find(|track| track.label == "wheels slip").unwrap();
    let [_, _, most] = seen.range.unwrap();
    assert!(most < 0.1, "{most} m/s");
}

#[test]
fn a_start_turns_each_module_by_a_quarter_at_most_and_a_reversal_none() {
    let run = run(1, None, 6200);
    let heard = &run.base.as_ref().unwrap().heard;
    let turned = |wheel: usize, millis| {
        let angles = heard[samples(millis)].iter().map(|heard| heard.wheels[wheel].steered);
        angles.clone().fold(f64::MIN, f64::max) - angles.fold(f64::MAX, f64::min)
    };
    let ways = |millis: Range<usize>| [0, 1, 2, 3].map(|wheel| turned(wheel, millis.clone()));
    let (start, reversal, quarter) = (ways(0..1200), ways(1200..2200), ways(2200..3200));
    println!("start {start:.1?}, reversal {reversal:.1?}, to the left {quarter:.1?}");
    // By the way that is not the shorter one they would turn by 35, 148, 59 and 98 degrees.
    assert!(start.iter().all(|way| *way < 91.0), "{start:?}");
    assert!(start[1] < 35.0 && start[3] < 85.0, "{start:?}");
    // The floor pushes a module aside while its wheel turns round.
    assert!(reversal.iter().all(|way| *way < 4.0), "{reversal:?}");
    assert!(quarter.iter().all(|way| (*way - 90.0).abs() < 2.0), "{quarter:?}");
}

/// After some 3.5 m and half a turn.
#[test]
fn its_odometry_ends_where_it_is() {
    let worst = (1..=8).fold([0.0_f64; 2], |[metres, degrees], seed| {
        let apart = PathFigures::of(&run(seed, None, 6200)).unwrap().estimate.unwrap();
        [metres.max(apart.metres), degrees.max(apart.degrees)]
    });
    println!("worst of 8 seeds: {worst:?} m and degrees");
    let [metres, degrees] = worst;
    assert!(metres < 0.015 && degrees < 0.5, "{worst:?}");
}

#[test]
fn a_lost_remote_stops_it() {
    let run = run(1, Some("remote-lost@1s"), 4200);
    for track in &run.motors {
        let after = &track.samples[samples(1200..4200)];
        let most = after.iter().map(|sample| sample.current.abs()).fold(0.0, f64::max);
        assert!(most < 0.05, "{}: {most} A", track.motor.label);
    }
    // Its wheels have coasted to a stand.
    let motion = twist(&run, samples(4000..4190));
    assert!(motion.iter().all(|motion| motion.abs() < 1e-3), "{motion:?}");
}
