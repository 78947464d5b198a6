//! Mistakes that `rc10 doctor` names first: written down here, by family, before it had a rule for them.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use rc10_cli::judge::doctor::causes;
use rc10_cli::robot::mistake::Mistake;
use rc10_cli::run::simulate::simulate;
use rc10_cli::{Description, Place};
use rc10_emu::fault::Fault;

use super::hours::{ROBOTS, with_robot};
use super::*;

/// What is done to a robot, and what is to be named first: kinds or causes, and what it is of.
struct Case {
    package: &'static str,
    family: &'static str,
    words: String,
    kinds: &'static [&'static str],
    about: String,
}

const LOSS: &[&str] = &["was-lost", "lost", "never-heard"];
const ALONE: &[&str] = &["bus-alone", "bus-silent", "bus-loose", "power-gone"];
const WHEEL: &[&str] = &["base", "runaway"];

/// Families of a robot: each names what it is about by a motor, a bus or a part.
fn families(package: &'static str, it: &Description) -> Vec<Case> {
    let mut all = Vec::new();
    let mut add = |family, words: String, kinds, about: &str| {
        all.push(Case { package, family, words, kinds, about: about.to_owned() });
    };
    let word = |label: &str| label.replace(' ', "-");
    // Without an IMU wheels of a base look alike.
    let has_wheels = it.base.is_some() && it.yaw.is_some();
    for motor in &it.motors {
        let (label, name) = (motor.label, word(motor.label));
        let shares = it.motors.iter().filter(|other| other.on == motor.on).count() > 1;
        if has_wheels && label.starts_with("wheel") {
            add("direction of a wheel", format!("direction:{name}"), WHEEL, label);
            if motor.dji().is_some() {
                add("gear of a wheel", format!("gear:{name}=8"), WHEEL, label);
            }
        }
        if motor.dji().is_some() {
            let free = (1..=7).find(|id| {
                it.motors.iter().all(|other| other.on != motor.on || other.name().id != *id)
            });
            if let Some(free) = free {
                add("identifier", format!("id:{name}={free}"), &["other-identifier"], label);
            }
        }
        if let Place::Bus(_) = motor.on
            && shares
        {
            add("plug of a motor", format!("cut:{name}@2.5s..3s"), LOSS, label);
            add("power of a motor", format!("power:{name}@3s"), LOSS, label);
        }
    }
    for bus in 1..=it.buses {
        let motors = it.motors.iter().filter(|motor| motor.on == Place::Bus(bus));
        if motors.count() < 2 {
            continue;
        }
        // Of a robot with one bus its supply looks alike.
        let about = format!("bus {bus}");
        add("bus comes and goes", format!("cut:{bus}@2s..2.4s"), &["bus-loose"], &about);
        add("supply of a bus", format!("power:{bus}@3s"), ALONE, &about);
        add("short", format!("short:{bus}@2.5s"), &["bus-shorted"], &about);
        add("never plugged in", format!("cut:{bus}@0s"), ALONE, &about);
    }
    if has_wheels {
        add("IMU", "imu:over".into(), &["base"], "IMU is upside down");
    }
    for part in &it.serials {
        add("part", format!("cut:{}@0s", word(part.label)), &["never-heard"], part.label);
    }
    add("remote", "remote-lost@3s..4s".into(), &["remote-lost"], "remote");
    all
}

/// The families of the wheels that are exchanged or of another size, of the team's robot.
fn of_the_team() -> Vec<Case> {
    let case = |family, words: &str, kinds, about: &str| Case {
        package: "team",
        family,
        words: words.into(),
        kinds,
        about: about.into(),
    };
    vec![
        case("swap", "swap:wheel-front-left,wheel-front-right", WHEEL, "swapped"),
        case("swap", "swap:wheel-rear-left,wheel-rear-right", WHEEL, "swapped"),
        case("measures", "radius:x1.6", WHEEL, "robot"),
        case("measures", "radius:x0.6", WHEEL, "robot"),
        case("load", "load:lift=x4", &["saturation", "feed-forward", "gave-up"], "lift"),
    ]
}

/// The place of the cause that is meant, and what is first.
fn place(case: &Case) -> (Option<usize>, String) {
    let recording = with_robot(case.package, |mut robot| {
        robot.set_no_logs(true);
        match case.words.parse::<Fault>() {
            Ok(fault) => robot.set_faults(&[fault]).unwrap(),
            Err(_) => robot.set_mistakes(&[case.words.parse::<Mistake>().unwrap()]).unwrap(),
        }
        simulate(robot, 1, Micros::from_millis(8000)).unwrap()
    });
    let found = causes(&recording);
    let first = found.first().map_or_else(|| "nothing".into(), |it| it.problem.headline());
    let is_it = |it: &rc10_cli::judge::doctor::Cause| {
        case.kinds.contains(&it.problem.kind) && it.problem.headline().contains(&case.about)
    };
    for cause in &found {
        assert!(!cause.problem.remedy().1[0].is_empty(), "no remedy: {}", cause.problem.kind);
    }
    (found.iter().position(is_it), first)
}

/// 24 of them, drawn; `RC10_DOCTOR=100` for more, with the table of what was taken for what.
#[test]
fn mistakes_are_named_first() {
    let mut all = of_the_team();
    for package in ROBOTS {
        all.extend(with_robot(package, |robot| families(package, robot.description())));
    }
    let count = std::env::var("RC10_DOCTOR").map_or(24, |it| it.parse().unwrap());
    // Each family in its turn, so that a small number has all of them.
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut by_family: BTreeMap<&str, Vec<Case>> = BTreeMap::new();
    all.into_iter().for_each(|case| by_family.entry(case.family).or_default().push(case));
    let mut drawn = Vec::new();
    while drawn.len() < count && by_family.values().any(|cases| !cases.is_empty()) {
        for cases in by_family.values_mut().filter(|cases| !cases.is_empty()) {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            drawn.push(cases.swap_remove(usize::try_from(state >> 33).unwrap() % cases.len()));
        }
    }
    drawn.truncate(count);
    let (next, table) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(case) = drawn.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let (place, first) = place(case);
                    let name = format!("{} {}", case.package, case.words);
                    table.lock().unwrap().insert((case.family, name), (place, first));
                }
            });
        }
    });
    let table = table.into_inner().unwrap();
    let first = table.values().filter(|(place, _)| *place == Some(0)).count();
    let third = table.values().filter(|(place, _)| place.is_some_and(|it| it < 3)).count();
    for ((family, name), (place, first)) in &table {
        let place = place.map_or("-".into(), |it| (it + 1).to_string());
        println!("{place}  {family:20} {name:50} {first}");
    }
    println!("{} mistakes: {first} named first, {third} among the first three", table.len());
    assert!(100 * first >= 95 * table.len(), "{first} of {}", table.len());
}
