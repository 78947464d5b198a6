use rc10_motor::dji;
use rc10_sim::{Chassis, Steering};

use super::*;
use crate::recording::sample::{PathPoint, WheelMeasurement};
use crate::robot::motor::Motor;

/// A run in which four wheels did this in each window, and the IMU saw that.
pub(crate) fn run(
    rims: impl Fn(usize) -> [f64; 4],
    imu: impl Fn(usize) -> Option<f64>,
    amps: f64,
) -> Recording {
    run_on(Chassis::default(), 0.0, rims, imu, amps)
}

/// The same of another base, whose wheels are steered by an angle, degrees.
fn run_on<const N: usize>(
    chassis: Chassis,
    steered: f64,
    rims: impl Fn(usize) -> [f64; N],
    imu: impl Fn(usize) -> Option<f64>,
    amps: f64,
) -> Recording {
    let wheel = |(label, id)| MotorTrack {
        motor: Motor::dji_on(label, 1, &dji::M3508, id),
        samples: Vec::new(),
        last: Default::default(),
        overwritten: 0,
        tracking: Vec::new(),
        peak_current: 0.0,
        effort: None,
    };
    let radius = chassis.wheels[0].radius;
    let (mut angles, mut yaw) = ([0.0; N], 0.0);
    let heard = (0..=300).map(|index: usize| {
        let window = index.saturating_sub(1) / WINDOW;
        if index > 0 {
            for (angle, rim) in angles.iter_mut().zip(rims(window)) {
                *angle += (rim / radius).to_degrees() / WINDOW as f64;
            }
            yaw += imu(window).unwrap_or(0.0).to_degrees() / WINDOW as f64;
        }
        let wheel = |angle| WheelMeasurement { angle, current: Some(amps), follows: true, steered };
        BaseMeasurement { wheels: angles.map(wheel).into(), yaw: imu(window).map(|_| yaw) }
    });
    let heard = heard.collect();
    let path = vec![PathPoint { x: 0.0, y: 0.0, yaw: 0.0 }];
    Recording {
        length: Micros::from_millis(3000),
        motors: [("a", 1), ("b", 2), ("c", 3), ("d", 4)].into_iter().take(N).map(wheel).collect(),
        base: Some(BaseTrack {
            wheels: (0..N).collect(),
            steering: Vec::new(),
            path,
            estimate: Vec::new(),
            reference: Vec::new(),
            chassis,
            heard,
        }),
        ..Recording::default()
    }
}

fn said(recording: &Recording) -> (bool, String) {
    let mut found = Vec::new();
    base_and_wheels(recording, &mut found);
    let [problem] = found.as_slice() else { panic!("{found:?}") };
    (crate::recording::problem::any(&found), problem.text.clone())
}

#[test]
fn a_base_is_judged_by_what_its_robot_has() {
    let forward = |_| [0.1; 4];
    // Turns the base by 0.238 rad in each window.
    let turning = |_| [-0.1, 0.1, -0.1, 0.1];
    for (run, is_problem, words) in [
        (run(forward, |_| Some(0.0), 1.0), false, "it hardly turned"),
        (run(forward, |_| None, 1.0), false, "not checked, no sensor knows"),
        (run(turning, |_| Some(0.238), 1.0), false, "its IMU says 6."),
        (run(turning, |_| Some(0.119), 1.0), true, "the wheels' radius were 0.50 times"),
        (run(forward, |_| Some(0.119), 1.0), true, "differ on how fast it turns"),
        (run(forward, |_| None, 8.0), true, "push with 40 % of their largest current"),
        (run(forward, |_| None, 8.0), true, "the direction, or the gear, of one of its wheels"),
        (run(|_| [0.1, 0.1, 0.02, 0.1], |_| None, 1.0), true, "as on no rigid base"),
    ] {
        let (found, text) = said(&run);
        assert!(found == is_problem && text.contains(words), "{text}");
    }
}

#[test]
fn what_a_fault_of_a_wire_does_is_none_of_the_base_s() {
    let bad = || run(|_| [0.1; 4], |_| Some(0.119), 8.0);
    let with = |fault: &str| Recording { faults: vec![fault.parse().unwrap()], ..bad() };
    assert!(said(&bad()).0 && said(&with("cut:1@2.5s")).0 && said(&with("noise:1@1ms")).0);
    assert!(!said(&with("cut:1@1ms")).0 && !said(&with("power:1@1ms..2.9s")).0);
    assert!(said(&with("cut:2@1ms")).0, "its wheels are on bus 1");
}

#[test]
fn other_bases_are_judged_by_their_own_geometry() {
    let omni = || Chassis::omni(4, 0.05, 0.25);
    let swerve = || Chassis::swerve(0.05, 0.2, 0.3, Steering::default());
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let ahead = |_| [-half, -half, half, half].map(|share| 0.1 * share);
    let said = |run: &Recording| {
        let mut found = Vec::new();
        base_and_wheels(run, &mut found);
        let text: Vec<_> = found.iter().map(|problem| problem.text.as_str()).collect();
        (crate::recording::problem::any(&found), text.join("; "))
    };
    for (run, is_problem, words) in [
        (run_on(omni(), 0.0, ahead, |_| Some(0.0), 1.0), false, "it hardly turned"),
        // Rims of 0.1 m in 0.25 m: 0.4 rad in each window.
        (run_on(omni(), 0.0, |_| [0.1; 4], |_| Some(0.4), 1.0), false, "its IMU says 11.6"),
        (
            run_on(omni(), 0.0, |_| [0.1; 4], |_| Some(0.8), 1.0),
            true,
            "radius were 2.00 times that of the table, or its wheels' distances from its middle 0.50",
        ),
        (
            run_on(omni(), 0.0, |_| [0.1, -0.1, 0.1, 0.1], |_| Some(0.4), 1.0),
            true,
            "the direction of b were wrong",
        ),
        (run_on(omni(), 0.0, |_| [0.1, 0.1, 0.04, 0.1], |_| None, 1.0), true, "no rigid base"),
        // Sideways, and a wheel that does not go along.
        (run_on(swerve(), 90.0, |_| [0.1; 4], |_| Some(0.0), 1.0), false, "it hardly turned"),
        (run_on(swerve(), 90.0, |_| [0.1, 0.1, 0.02, 0.1], |_| None, 1.0), true, "no rigid base"),
    ] {
        let (found, text) = said(&run);
        assert!(found == is_problem && text.contains(words), "{text}");
        assert!(!text.contains("whatever they do"), "{text}");
    }
    let differential = |rims: [f64; 2], yaw| {
        run_on(Chassis::differential(0.05, 0.4), 0.0, move |_| rims, move |_| Some(yaw), 1.0)
    };
    for (run, is_problem, words) in [
        (differential([0.1, 0.1], 0.0), false, "its 2 wheels fit one another whatever they do"),
        (differential([-0.1, 0.1], 0.5), false, "its wheels turned it by 14.50 rad"),
        (differential([0.1, 0.1], 0.5), true, "the direction of a were wrong"),
        (differential([0.1, 0.1], -0.5), true, "the direction of b were wrong"),
        (
            run_on(Chassis::omni(3, 0.05, 0.25), 0.0, |_| [0.1, 0.0, 0.0], |_| None, 1.0),
            false,
            "its 3 wheels fit one another",
        ),
    ] {
        let (found, text) = said(&run);
        assert!(found == is_problem && text.contains(words), "{text}");
    }
}

#[test]
fn windows_in_which_wheels_are_steered_are_not_judged() {
    let swerve = Chassis::swerve(0.05, 0.2, 0.3, Steering::default());
    let mut run = run_on(swerve, 0.0, |_| [0.1, 0.1, 0.02, 0.1], |_| None, 1.0);
    assert!(said(&run).0);
    for (index, heard) in run.base.as_mut().unwrap().heard.iter_mut().enumerate() {
        heard.wheels[1].steered = index as f64;
    }
    assert!(!said(&run).0);
}
