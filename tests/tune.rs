//! `rc10 tune`: from a record of ordinary driving, and by turning a motor of the simulated robot.

#[cfg(unix)]
use std::process::Command;

use rc10_cli::record::RecordWriter;
use rc10_cli::run::simulate::{heading, simulate_into};
use rc10_cli::{CommandLine, Robot, robot_of};
use rc10_motor::{Gains, Request};
use rc10_time::Micros;
use team::{Motors, Ports, Shared};

use crate::common::scratch::Scratch;
#[cfg(unix)]
use crate::common::served::{http, page_of, start, until};
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

/// On blocks: what stands on the wheels weighs nothing.
const ON_BLOCKS: [&str; 3] = ["--sim", "--mistake", "mass:x0.01"];

/// What the page has of a motor.
fn page(folder: &Scratch, motor: &str) -> serde_json::Value {
    let page = std::fs::read_to_string(folder.join(format!("tune-{motor}.html"))).unwrap();
    let data = page.split("type=\"application/json\">").nth(1).unwrap().split("</script>").next();
    serde_json::from_str(data.unwrap()).unwrap()
}

#[test]
fn a_wheel_on_blocks_is_tuned_and_a_sweep_measures_its_loops() {
    let folder = Scratch::new("tune-apply");
    let out = folder.display().to_string();
    let motor =
        ["wheel-front-left", "--travel", "720", "--seconds", "12", "--apply", "--out", &out];
    let text = tune(&[&motor[..], &ON_BLOCKS].concat()).unwrap();
    println!("{text}");
    assert!(text.contains("The new gains are set, until power-off"));
    assert!(text.contains("Measured at 1.5 to 59 Hz"));
    let data = page(&folder, "wheel-front-left");
    let numbers = |it: &serde_json::Value| -> Vec<f64> {
        it.as_array().unwrap().iter().map(|it| it.as_f64().unwrap()).collect()
    };
    let curves = data["curves"].as_array().unwrap();
    assert_eq!(curves.len(), 4);
    for pair in curves.chunks(2) {
        let [hz, db, deg] = ["hz", "db", "deg"].map(|key| numbers(&pair[1][key]));
        let [grid, level, phase] = ["hz", "db", "deg"].map(|key| numbers(&pair[0][key]));
        assert!(hz.len() == 15 && grid.len() > 100);
        for (at, hz) in hz.iter().enumerate() {
            let near = grid.iter().position(|it| it >= hz).unwrap();
            // The grid's steps are 0.4 dB, and the model has more delay than the simulated device.
            assert!((db[at] - level[near]).abs() < 1.5, "{hz} Hz: {} {}", db[at], level[near]);
            let more = deg[at] - phase[near];
            assert!((-5.0..0.5 * hz + 5.0).contains(&more), "{hz} Hz: {more}");
        }
    }
    // Its steps, before and after.
    let steps = data["steps"].as_array().unwrap();
    let target = |at: usize| -> Vec<f64> {
        steps[at]["target"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(serde_json::Value::as_f64)
            .collect()
    };
    for at in 0..2 {
        let jumps = target(at).windows(2).filter(|it| it[1] - it[0] > 3.0).count();
        assert!(jumps >= 4, "{jumps}");
    }
    // Without --apply nothing is set, and the page has no steps with new gains.
    let text = tune(&[&motor[..5], &motor[6..], &ON_BLOCKS].concat()).unwrap();
    assert!(!text.contains("are set") && text.contains("speed, tuned"), "{text}");
    assert_eq!(page(&folder, "wheel-front-left")["steps"].as_array().unwrap().len(), 1);
}

#[test]
fn what_goes_wrong_with_new_gains_puts_the_old_ones_back() {
    let motor = ["wheel-front-left", "--travel", "720", "--seconds", "12", "--apply"];
    let early = ["--fault", "cut:1@10s..3600s"];
    let before = tune(&[&motor[..], &ON_BLOCKS, &early].concat()).unwrap_err();
    assert!(!before.contains("gains"), "{before}");
    let late = ["--fault", "cut:1@35s..3600s"];
    let after = tune(&[&motor[..], &ON_BLOCKS, &late].concat()).unwrap_err();
    assert!(after.contains("the gains before are set again"), "{after}");
    // Where too little of the new loop is measured.
    let little = ["wheel-front-left", "--travel", "75", "--seconds", "8", "--apply"];
    let little = tune(&[&little[..], &ON_BLOCKS].concat()).unwrap_err();
    assert!(little.contains("set again: the sweep tells too little"), "{little}");
    // On the floor it is no stiff body: no gains, so none are set.
    let none = tune(&[&motor[..], &["--sim"]].concat()).unwrap_err();
    assert!(none.contains("No gains are set"), "{none}");
}

#[test]
fn a_motor_that_gets_nowhere_is_let_go() {
    let motor = ["wheel-front-left", "--travel", "96", "--sim"];
    for wrong in [
        ["--mistake", "friction:wheel-front-left=x100"],
        // What it tells stands still, and the shaft turns on.
        ["--fault", "frozen:wheel-front-left@3s..3600s"],
    ] {
        let error = tune(&[&motor[..], &wrong].concat()).unwrap_err();
        assert!(error.contains("did not get there: is it blocked?"), "{error}");
    }
}

#[test]
fn gains_are_kept_when_the_motor_rests() {
    let motor = ["wheel-front-left", "--travel", "720", "--seconds", "8", "--keep"];
    let text = tune(&[&motor[..], &ON_BLOCKS].concat()).unwrap();
    assert!(text.contains("The new gains are set, kept over a power-off"), "{text}");
}

/// A command in a folder, whose robots no other user sees.
#[cfg(unix)]
fn shell(folder: &Scratch, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.args(arguments).env("XDG_RUNTIME_DIR", &**folder).current_dir(&**folder);
    command
}

/// Ctrl-C while a robot is turned with its new gains: it has those before again, as another shell sees.
#[cfg(unix)]
#[test]
fn ctrl_c_leaves_no_new_gains() {
    let folder = Scratch::new("tune-ctrl-c");
    let rc10 = |arguments: &[&str]| shell(&folder, arguments);
    let simulated = ["live", "--page", "0", "--sim", "--mistake", "mass:x0.01"];
    let rests = ["--fault", "remote-lost@0s..3600s"];
    let (_live, _) = start(&mut rc10(&[&simulated[..], &rests].concat()), "http://");
    let gain = || {
        let output = rc10(&["get", "wheel_front_left.speed_kp", "--port", "sim"]).output().unwrap();
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    };
    until("the gain of the table", || gain() == "0.4");
    let motor = ["tune", "wheel-front-left", "--travel", "720", "--seconds", "5", "--apply"];
    let begin = || rc10(&[&motor[..], &["--port", "sim"]].concat()).spawn().unwrap();
    let mut tune = begin();
    until("a new gain", || {
        // On a busy machine its jogs may come too late.
        if tune.try_wait().unwrap().is_some_and(|it| !it.success()) {
            tune = begin();
        }
        gain() != "0.4"
    });
    let _ = Command::new("kill").args(["-INT", &tune.id().to_string()]).status();
    assert!(!tune.wait().unwrap().success());
    assert_eq!(gain(), "0.4");
}

/// Proportional and integral gains of a motor's speed and angle.
type Four = [f32; 4];

/// A run of the team's robot whose gimbal has these gains, with its record if wanted: its errors, degrees.
fn gimbal(gains: [Option<Four>; 2], record: Option<&std::path::Path>) -> [f64; 2] {
    const NAMES: [team::Name; 2] = [team::Name::GimbalYaw, team::Name::GimbalPitch];
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let loops = robot.loops();
    let mut robot = robot;
    for (name, gains) in NAMES.into_iter().zip(gains) {
        let (port, at) = (ports.motor(name), name as usize);
        let Some([speed_kp, speed_ki, angle_kp, angle_ki]) = gains else { continue };
        let cascade = loops[at].unwrap().cascade;
        robot = robot.task(async move {
            let speed = Gains { kp: speed_kp, ki: speed_ki, kd: cascade.speed.kd };
            let angle = Gains { kp: angle_kp, ki: angle_ki, kd: cascade.angle.kd };
            for request in [Request::SpeedGains(speed), Request::AngleGains(angle)] {
                // Not before it has been heard of.
                while port.request(request).await.is_err() {
                    embassy_time::Timer::after_millis(5).await;
                }
            }
        });
    }
    let writer = record.map(|path| RecordWriter::new(path, false, &heading(&robot, 4)).unwrap());
    let recording = simulate_into(robot, 4, Micros::from_millis(40_000), writer).unwrap();
    NAMES.map(|name| {
        let tracking = &recording.motors[name as usize].tracking;
        tracking.iter().map(rc10_cli::recording::Tracking::rms).fold(0.0, f64::max)
    })
}

/// Detuned three times either way and tuned by a record of that, the gimbal follows as well as with the gains of its table.
#[test]
fn a_detuned_gimbal_is_as_good_as_before_or_better() {
    let folder = Scratch::new("tune-detuned");
    let shipped = gimbal([None; 2], None);
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let loops = robot_of::<team::Robot>(&shared, &mut motors).unwrap().loops();
    for factor in [3.0, 1.0 / 3.0] {
        let path = folder.join(format!("{factor}.mcap"));
        let wrong = [team::Name::GimbalYaw, team::Name::GimbalPitch].map(|name| {
            let it = loops[name as usize].unwrap().cascade;
            Some([it.speed.kp, it.speed.ki, it.angle.kp, it.angle.ki].map(|gain| factor * gain))
        });
        let detuned = gimbal(wrong, Some(&path));
        let new = ["gimbal-yaw", "gimbal-pitch"].map(|motor| {
            let out = folder.display().to_string();
            let text = tune(&[motor, "--from", path.to_str().unwrap(), "--out", &out]).unwrap();
            let gain = |line: &str, name: &str| -> f32 {
                let line = text.lines().find(|it| it.starts_with(line)).unwrap();
                let rest = line.split(&format!(".{name}(")).nth(1);
                rest.map_or(0.0, |it| it.split(')').next().unwrap().parse().unwrap())
            };
            Some([gain("speed:", "kp"), gain("speed:", "ki"), gain("angle:", "kp"), 0.0])
        });
        let tuned = gimbal(new, None);
        println!(
            "x{factor:.2}: shipped {shipped:.3?} deg, detuned {detuned:.3?}, tuned {tuned:.3?}, {new:?}"
        );
        for at in 0..2 {
            assert!(tuned[at] <= 1.01 * shipped[at], "{tuned:?} {shipped:?}");
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

/// The flashed program on the emulated chip, detuned three times either way and tuned through its link, from shells.
#[cfg(unix)]
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_detuned_wheel_is_tuned_on_the_emulated_chip_through_its_link() {
    let firmware = std::env::var("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    let folder = Scratch::new("tune-chip");
    let rc10 = |arguments: &[&str]| shell(&folder, arguments);
    let run = |arguments: &[&str]| {
        let output = rc10(arguments).output().unwrap();
        let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        (output.status.success(), text)
    };
    // Disarmed, and on blocks.
    let emulated = ["live", "--page", "0", "--emu", &firmware, "--mistake", "mass:x0.01"];
    let (_live, line) = start(
        &mut rc10(&[&emulated[..], &["--fault", "remote-lost@0s..3600s"]].concat()),
        "http://",
    );
    let page = page_of(&line);
    let names = ["speed_kp", "speed_ki", "angle_kp"].map(|it| format!("wheel_front_left.{it}"));
    let gains = || -> Vec<f32> {
        let (done, text) = run(&["get", &names[0], &names[1], &names[2], "--port", "emu"]);
        assert!(done, "{text}");
        text.lines().map(|it| it.parse().unwrap()).collect()
    };
    until("an answer", || run(&["get", &names[0], "--port", "emu"]).0);
    let shipped = gains();
    let mut found = Vec::new();
    for factor in [3.0, 1.0 / 3.0] {
        let changes: Vec<_> = names
            .iter()
            .zip(&shipped)
            .map(|(name, it)| format!("{name}={}", factor * it))
            .collect();
        let (done, text) = run(&["set", &changes[0], &changes[1], &changes[2], "--port", "emu"]);
        assert!(done, "{text}");
        // On a machine that is busy a jog may come so late that the motor rests, and what is measured then is less.
        until("tuned", || {
            let motor = ["tune", "wheel-front-left", "--travel", "720", "--seconds", "8"];
            let (done, text) = run(&[&motor[..], &["--apply", "--port", "emu"]].concat());
            println!("x{factor:.2}: {text}");
            done
        });
        found.push(gains());
    }
    println!("shipped {shipped:?}, tuned {found:?}");
    for gains in &found {
        for (it, best) in gains.iter().zip(&found[0]) {
            assert!((it / best - 1.0).abs() < 0.05, "{found:?}");
        }
    }
    // The page of the robot shows what was found of the motor, and of no other.
    let state = http(page, "GET", "/state", "", "").1;
    let state: serde_json::Value = serde_json::from_str(&state).unwrap();
    let signals = state["signals"].as_array().unwrap();
    let of = |label: &str| {
        let mut all = signals.iter();
        let found = all.find(|it| it["folder"] == "motors" && it["label"] == label).unwrap();
        http(page, "GET", &format!("/tuned?{}", found["index"]), "", "")
    };
    let (status, text) = of("wheel front left");
    assert!(status == 200 && text.contains("speed, tuned"), "{status}");
    assert_eq!(of("wheel rear right").0, 404);
    assert_eq!(http(page, "GET", "/tuned?../../wheel", "", "").0, 404);
}
