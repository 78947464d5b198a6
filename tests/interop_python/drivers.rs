//! Drivers of others drive our simulated motors over slcan, in lockstep. What they read is compared,
//! never how long it took.

use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use rc10_cli::commands::pty::PtyArgs;
use rc10_cli::commands::pty::serve;
use rc10_cli::world::robot::Robot;
use serde_json::Value;

use super::others::{CYBERGEAR_ID, DAMIAO_ID, DAMIAO_MASTER, bus};
use super::scratch::Scratch;
use super::{must_succeed, python, script};

/// Readings of a script of tests/python from the motors, and the last words of `rc10 pty`.
fn drive(name: &str) -> Option<(Value, String)> {
    let python = python()?;
    let folder = Scratch::new(name);
    let link = folder.join("pty");
    let args = PtyArgs {
        bus: Some(1),
        seconds: None,
        lockstep: true,
        alone: true,
        link: Some(link.clone()),
        seed: 3,
        ..PtyArgs::default()
    };
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let server = scope.spawn(|| {
            let mut out = Vec::new();
            serve(&args, Robot::new(bus()), &mut out, &stop).unwrap();
            String::from_utf8(out).unwrap()
        });
        while !link.exists() {
            assert!(!server.is_finished(), "no pseudo-terminal");
            thread::yield_now();
        }
        let run = || must_succeed(Command::new(python).arg(script(name)).arg(&link));
        // Also if the script fails: else the other side would never stop.
        let printed = std::panic::catch_unwind(run);
        stop.store(true, Ordering::Relaxed);
        let said = server.join().unwrap();
        let printed = printed.unwrap_or_else(|_| panic!("{name} failed; rc10 pty:\n{said}"));
        let found = printed.lines().last().unwrap_or_default();
        Some((serde_json::from_str(found).unwrap(), said))
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// From rest to `goal` and no further than an overshoot of 5 %, without a jump: each millisecond at
/// most what `fastest` (rad/s) allows.
fn assert_step(path: &Value, goal: f64, fastest: f64) {
    let path: Vec<_> = path.as_array().unwrap().iter().map(number).collect();
    let start = path[0];
    assert!((goal - start).abs() > 0.2, "it was there already: {start}");
    let way = |position: f64| (position - start) / (goal - start);
    assert!(path.windows(2).all(|pair| (pair[1] - pair[0]).abs() < fastest * 1e-3), "{path:?}");
    assert!(path.iter().all(|&position| way(position) > -0.05 && way(position) < 1.05), "{path:?}");
    assert!((path[path.len() - 1] - goal).abs() < 0.02, "{path:?}");
}

#[test]
fn damiao_motor_drives_a_j4310() {
    let Some((found, said)) = drive("drive_damiao.py") else { return };
    let registers = &found["registers"];
    let ids = (&registers["can_id"], &registers["mst_id"]);
    assert_eq!(ids, (&DAMIAO_ID.into(), &DAMIAO_MASTER.into()));
    assert_eq!(registers["mode"], 1, "MIT, as it is sold");
    for (limit, value) in [("p", 12.5), ("v", 30.0), ("t", 10.0)] {
        assert_eq!(registers[limit], value, "{limit}");
    }
    assert_eq!(found["before"]["status"], "DISABLED");
    assert_eq!(found["enabled"]["status"], "ENABLED");
    assert_step(&found["path"], 1.0, 25.0);
    let reached = &found["reached"];
    assert_eq!(reached["status"], "ENABLED");
    assert!(number(&reached["vel"]).abs() < 0.1, "{reached}");
    for temperature in ["t_mos", "t_rotor"] {
        assert!((20.0..60.0).contains(&number(&reached[temperature])), "{reached}");
    }
    assert!((number(&found["turning"]["vel"]) + 5.0).abs() < 0.2, "{}", found["turning"]);
    assert_eq!(found["disabled"]["status"], "DISABLED");
    assert_eq!(found["timeout"], 4321);
    assert!(said.ends_with("nothing lost\n"), "{said}");
}

#[test]
fn python_cybergear_drives_a_cybergear() {
    let Some((found, said)) = drive("drive_cybergear.py") else { return };
    let scanned = found["scanned"].as_array().unwrap();
    assert_eq!(scanned.len(), 1, "{scanned:?}");
    assert_eq!((&scanned[0][0], &scanned[0][1]), (&CYBERGEAR_ID.into(), &found["device"]));
    assert_eq!(found["enabled"]["mode"], 2, "running");
    assert_step(&found["path"], 1.0, 35.0);
    let reached = &found["reached"];
    assert!(number(&reached["velocity"]).abs() < 0.1, "{reached}");
    assert!((20.0..60.0).contains(&number(&reached["temperature"])), "{reached}");
    let no_fault = |fault: &Value| fault == false;
    let faults = reached["faults"].as_object().unwrap();
    assert!(faults.iter().all(|(name, set)| no_fault(set) != (name == "calibrated")), "{faults:?}");
    // The same position twice: 16 bits in feedback, a float among the parameters.
    let parameters = &found["parameters"];
    assert_eq!(parameters["run_mode"], 0);
    let apart = number(&parameters["mech_pos"]) - number(&reached["position"]);
    assert!(apart.abs() < 0.01, "{parameters} {reached}");
    assert!((20.0..30.0).contains(&number(&parameters["v_bus"])), "{parameters}");
    assert_eq!(found["disabled"]["mode"], 0, "at rest");
    let speed = &found["speed"];
    assert_eq!((&speed["run_mode"], &speed["spd_ref"]), (&2.into(), &4.0.into()));
    assert_eq!(speed["limit_cur"], 5.0);
    assert!((number(&speed["mech_vel"]) - 4.0).abs() < 0.2, "{speed}");
    assert_eq!(found["stopped"]["mode"], 0);
    assert!(said.ends_with("nothing lost\n"), "{said}");
}
