//! `rc10 tune`: from a record of ordinary driving, and by turning a motor of the simulated robot.

use rc10_cli::record::RecordWriter;
use rc10_cli::run::simulate::{heading, simulate_into};
use rc10_cli::{CommandLine, Robot, robot_of};
use rc10_time::Micros;
use team::{Motors, Ports, Shared};

use crate::common::scratch::Scratch;
use crate::interop_python::{python, script};

/// What the command prints, or its error.
fn tune(arguments: &[&str]) -> Result<String, String> {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot: Robot<'_> = robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let command = CommandLine::parse(["rc10", "tune"].iter().chain(arguments));
    let mut out = Vec::new();
    let run = command.and_then(|command| command.run_to(robot, &mut out));
    run.map(|_| String::from_utf8(out).unwrap()).map_err(|error| format!("{error:#}"))
}

/// The number at the begin of a row, and half its interval.
fn row(text: &str, name: &str) -> [f64; 2] {
    let line = text.lines().find(|line| line.trim_start().starts_with(name)).unwrap();
    let rest = line.trim_start().strip_prefix(name).unwrap();
    let mut words = rest.split_whitespace().filter(|word| *word != "±");
    [0; 2].map(|_| words.next().unwrap().parse().unwrap_or_else(|_| panic!("{line}")))
}

#[test]
fn a_record_of_ordinary_driving_tells_what_the_gimbal_moves() {
    let folder = Scratch::new("tune");
    let path = folder.join("run.mcap");
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let record = RecordWriter::new(&path, false, &heading(&robot, 4)).unwrap();
    simulate_into(robot, 4, Micros::from_millis(40_000), Some(record)).unwrap();
    let path = path.to_str().unwrap();
    let text = tune(&["gimbal-yaw", "--from", path]).unwrap();
    println!("{text}");
    // By the simulator: 0.0204 kg m², 0.04 N m and 0.001 N m s of friction, 0.741 N m/A; 1 rpm is 0.1047 rad/s.
    for (name, truth) in [("inertia", 0.0204 * 0.10472 / 0.741), ("dry friction", 0.04 / 0.741)] {
        let [value, half] = row(&text, name);
        assert!((value - truth).abs() < 0.03 * truth + half, "{name}: {value} is not {truth}");
        assert!(half < 0.2 * truth, "{name}: {half}");
    }
    assert!(text.contains("speed: PidConfig::within(3.0).kp(") && text.contains("per_rpm_s: 0.00"));
    let wrong = tune(&["gimbal-jaw", "--from", path]).unwrap_err();
    assert!(
        wrong.contains("there is no motor `gimbal-jaw`; there are: wheel-front-left"),
        "{wrong}"
    );
    let missing = tune(&["feeder", "--from", "/no/such.mcap"]).unwrap_err();
    assert!(missing.contains("cannot read /no/such.mcap"), "{missing}");
}

/// The same records, by scipy: `tests/python/tune.py`.
#[test]
fn scipy_estimates_the_same() {
    let Some(python) = python() else { return };
    let folder = Scratch::new("tune-scipy");
    for (number, mistakes) in
        [&[][..], &["friction:gimbal=x2", "inertia:gimbal=x1.5"], &["torque:gimbal=x0.7"]]
            .into_iter()
            .enumerate()
    {
        let path = folder.join(format!("{number}.mcap"));
        let ports = Ports::new();
        let (shared, mut motors) = (Shared::new(&ports), Motors::new());
        let mut robot = robot_of::<team::Robot>(&shared, &mut motors).unwrap();
        let mistakes: Vec<_> = mistakes.iter().map(|it| it.parse().unwrap()).collect();
        robot.set_mistakes(&mistakes).unwrap();
        let seed = 5 + number as u64;
        let record = RecordWriter::new(&path, false, &heading(&robot, seed)).unwrap();
        simulate_into(robot, seed, Micros::from_millis(40_000), Some(record)).unwrap();
        let path = path.to_str().unwrap();
        for motor in ["gimbal-yaw", "gimbal-pitch"] {
            let ours = tune(&[motor, "--from", path]).unwrap();
            let topic = format!("/motors/{}", motor.replace('-', "_"));
            let mut theirs = std::process::Command::new(python);
            let theirs = theirs.arg(script("tune.py")).args([path, &topic]).output().unwrap();
            assert!(theirs.status.success(), "{}", String::from_utf8_lossy(&theirs.stderr));
            let theirs: serde_json::Value = serde_json::from_slice(&theirs.stdout).unwrap();
            println!("{motor}, record {number}: {theirs}");
            // Its delay has the half tick in it for which an effort is held.
            for (name, key, unit, later) in [
                ("inertia", "inertia", 1.0, 0.0),
                ("dry friction", "friction", 1.0, 0.0),
                ("viscous", "viscous", 1.0, 0.0),
                ("delay", "delay", 1e3, 0.5),
            ] {
                let [value, half] = row(&ours, name);
                let theirs = unit * theirs[key].as_f64().unwrap() - later;
                let near = half + 0.02 * theirs.abs();
                assert!((value - theirs).abs() < near, "{name}: {value} ± {half}, scipy {theirs}");
            }
        }
    }
}

#[test]
fn only_what_may_be_turned_is_turned_and_within_its_travel() {
    let refused = |arguments: &[&str]| tune(arguments).unwrap_err();
    let no_jog = refused(&["gimbal-yaw", "--travel", "90", "--sim"]);
    assert!(no_jog.contains("does not allow to turn it"), "{no_jog}");
    let fast = refused(&["wheel-front-left", "--travel", "90", "--speed", "21", "--sim"]);
    assert!(fast.contains("its with_jog allows 20 rpm"), "{fast}");
    assert!(refused(&["wheel-front-left", "--sim"]).contains("--travel"));
    assert!(
        refused(&["wheel-front-left", "--travel", "-5", "--sim"]).contains("5 to 100000 degrees")
    );
    // With hardly any room it is slow, and never leaves it: that would be an error.
    let little = tune(&["wheel-front-left", "--travel", "8", "--seconds", "12", "--sim"]).unwrap();
    assert!(little.contains(" to 3 rpm"), "{little}");
    let text = tune(&["wheel-front-left", "--travel", "360", "--seconds", "12", "--sim"]).unwrap();
    println!("{text}");
    let [inertia, half] = row(&text, "inertia");
    assert!(inertia > 0.0 && half < 0.3 * inertia);
}
