//! A kp ten times too high turns red for every motor whose loops run here; the shipped robots are
//! far from every threshold.

use std::fmt::Write as _;
use std::fs;

use rc10_cli::recording::MotorTrack;
use rc10_cli::recording::{effort, margin};
use rc10_motor::rc10_app::Cascade;

use super::robots::{TEN_SECONDS, Which, run};
use super::{Micros, problems};

/// Seven of the team's and three of the mixed robot's: the other wheels and lifts are as the first.
const OURS: [(Which, &str); 8] = [
    (Which::Team, "wheel front left"),
    (Which::Team, "gimbal yaw"),
    (Which::Team, "gimbal pitch"),
    (Which::Team, "feeder"),
    (Which::Team, "lift front left"),
    (Which::Mixed, "arm"),
    (Which::Mixed, "turret"),
    (Which::Mixed, "flywheel"),
];

#[test]
fn a_kp_ten_times_too_high_is_red_for_every_motor_whose_loops_are_ours() {
    for (which, label) in OURS {
        for loop_name in ["speed", "angle"] {
            let change = |cascade: &mut Cascade| {
                let is_speed = loop_name == "speed";
                let pid = if is_speed { &mut cascade.speed } else { &mut cascade.angle };
                pid.kp *= 10.0;
            };
            let recording = run(which, 1, Micros::from_millis(1500), Some((label, &change)));
            let problems = problems(&recording);
            let cause = format!("{label}: the gain margin of its {loop_name} loop is ");
            assert!(problems.contains(&cause), "{label}, {loop_name}: {problems}");
        }
    }
}

/// The margin is true: below it the loop is calm, above it the effort bangs.
#[test]
fn a_kp_beyond_its_gain_margin_shakes() {
    for (which, label, calm, shaking) in [
        (Which::Team, "feeder", 9.0_f32, 20.0_f32),
        (Which::Team, "lift front left", 3.0, 10.0),
        (Which::Mixed, "turret", 8.0, 20.0),
    ] {
        let shakes = |by: f32| {
            let change = |cascade: &mut Cascade| cascade.speed.kp *= by;
            problems(&run(which, 1, TEN_SECONDS, Some((label, &change))))
                .contains(&format!("{label}: shakes: its effort changes direction"))
        };
        assert!(!shakes(calm) && shakes(shaking), "{label}");
    }
}

/// The table of `docs/verdict.md`, over seeds 1 to 10; nothing is found in any of them.
#[test]
fn the_shipped_robots_are_as_far_from_the_thresholds_as_the_docs_say() {
    let mut rows: Vec<(String, [f64; 4])> = Vec::new();
    for which in [Which::Team, Which::Mixed] {
        for seed in 1..=10 {
            let recording = run(which, seed, TEN_SECONDS, None);
            assert_eq!(problems(&recording), "", "{which:?}, seed {seed}");
            for track in &recording.motors {
                let Some(worst) = worst(track) else { continue };
                match rows.iter_mut().find(|(label, _)| label == track.motor.label) {
                    None => rows.push((track.motor.label.to_owned(), worst)),
                    Some((_, known)) => {
                        let [speed, angle, reversals, at_limit] = worst;
                        known[0] = known[0].min(speed);
                        known[1] = known[1].min(angle);
                        known[2] = known[2].max(reversals);
                        known[3] = known[3].max(at_limit);
                    }
                }
            }
        }
    }
    let mut table = format!(
        "| motor | gain margin, speed | gain margin, angle | changes of direction | at its limit |\n\
         |---|---|---|---|---|\n\
         | **problem** | **< {}** | **< {}** | **>= {}** | **>= {} %** |\n",
        margin::LEAST,
        margin::LEAST,
        effort::REVERSALS,
        effort::SHARE_AT_LIMIT / 10,
    );
    for (label, [speed, angle, reversals, at_limit]) in rows {
        let percent = at_limit / 10.0;
        writeln!(table, "| {label} | {speed:.1} | {angle:.1} | {reversals:.0} | {percent:.0} % |")
            .unwrap();
    }
    println!("{table}");
    let docs = fs::read_to_string("docs/verdict.md").unwrap();
    assert!(docs.contains(&table), "docs/verdict.md has another table than this:\n{table}");
}

fn worst(track: &MotorTrack) -> Option<[f64; 4]> {
    let effort = track.effort.as_ref()?;
    let margins = effort.margins?;
    let [reversals, at_limit] = [&effort.reversals, &effort.at_limit].map(|worst| worst.count);
    Some([margins.speed, margins.angle, reversals.into(), at_limit.into()])
}
