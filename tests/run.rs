//! The `rc10 run` command, as a user calls it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::common::mixed::mixed;
use crate::common::scratch::Scratch;
use rc10_cli::{CommandLine, Description, Robot};
use serde_json::Value;

fn rc10(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rc10")).args(arguments).output().unwrap()
}

fn run_json(seed: &str, seconds: &str, folder: &Path) -> Value {
    let out = folder.to_str().unwrap();
    let output = rc10(&["run", "--seed", seed, "--seconds", seconds, "--out", out, "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn ten_seconds_lose_nothing_and_leave_the_files() {
    let folder = Scratch::new("ten_seconds");
    let figures = run_json("1", "10", &folder);
    assert_eq!(figures["virtual_seconds"], 10.0);
    // The first ones come after 1.5 ms.
    assert_eq!(figures["ticks"], 29_997);
    let motors = figures["motors"].as_array().unwrap();
    assert_eq!(motors.len(), 11);
    for motor in motors {
        assert_eq!(motor["link"], "Online", "{motor}");
        assert_eq!((&motor["malformed"], &motor["lost"]), (&0.into(), &0.into()), "{motor}");
        assert!(motor["received"].as_u64().unwrap() >= 9_998, "{motor}");
        assert!(motor["error_rms"].is_number() && motor["peak_current_a"].is_number());
    }
    for bus in figures["buses"].as_array().unwrap() {
        for lost in ["lost", "replaced", "refused", "overruns", "unclaimed"] {
            assert_eq!(bus[lost], 0, "{bus}");
        }
        assert_eq!(bus["tick_period_us"]["max"], 1000);
        let plan = &bus["planned_load_percent"];
        let range = plan["least"].as_f64().unwrap()..=plan["worst"].as_f64().unwrap();
        assert!(range.contains(&bus["load_percent"].as_f64().unwrap()), "{bus}");
    }
    for file in ["report.html", "bus1.log", "bus2.log", "bus3.log"] {
        assert!(fs::metadata(folder.join(file)).unwrap().len() > 10_000, "{file}");
    }
    // Nothing half written is left beside them.
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 4);
}

/// The script: a square, a spin, a gimbal sweep, a lift, an emergency stop and recovery.
#[test]
fn the_robot_does_what_its_script_says() {
    use rc10_cli::run::simulate::simulate;
    use rc10_motor::DriveMode;
    use team::table::Name;
    let ports = team::Ports::new();
    let io = &team::Shared::new(&ports);
    let mut motors = team::Motors::new();
    let length = rc10_time::Micros::from_millis(10_000);
    let recording =
        simulate(rc10_cli::robot_of::<team::Robot>(io, &mut motors).unwrap(), 3, length).unwrap();
    let path = recording.base.unwrap().path;
    let sample = |millis: usize| millis / 10 - 1;
    let at = |millis| path[sample(millis)];
    // Back at the start after the square: it went out by a metre and more in x and in y.
    let square = || path[..sample(3800)].iter();
    let reach = |far: f64, value: f64| far.max(value);
    assert!(square().map(|point| point.x).fold(0.0, reach) > 0.8);
    assert!(square().map(|point| point.y).fold(0.0, reach) > 0.8);
    let back = at(4400);
    // Nothing measures where it is: accelerating and slipping leave it some way off.
    assert!(back.x.hypot(back.y) < 0.25, "{back:?}");
    // The spin turned it round, and left it where it was.
    assert!(at(4800).yaw - at(3800).yaw > 3.0);
    let measured = |name: Name, millis| {
        let motor = &recording.motors[name as usize];
        motor.samples[sample(millis)].measured
    };
    assert!(measured(Name::GimbalYaw, 5600) < 140.0 && measured(Name::GimbalYaw, 6400) > 220.0);
    assert!((measured(Name::Feeder, 6500) - 180.0).abs() < 5.0);
    // It follows a moving goal from behind.
    assert!((measured(Name::LiftRearRight, 8500) - 720.0).abs() < 5.0);
    // During the stop the lift holds and everything else coasts; then they run again.
    let drive = |name: Name, millis| recording.motors[name as usize].samples[sample(millis)].drive;
    assert_eq!(drive(Name::LiftFrontLeft, 9000), DriveMode::Hold);
    assert_eq!(drive(Name::WheelFrontLeft, 9000), DriveMode::Coast);
    assert_eq!(drive(Name::WheelFrontLeft, 9500), DriveMode::Run);
    assert!((measured(Name::LiftFrontLeft, 9000) - 720.0).abs() < 5.0);
}

#[test]
fn one_seed_gives_one_trace_and_another_seed_another() {
    let hash = |seed, name| run_json(seed, "1.5", &Scratch::new(name))["trace_hash"].clone();
    let first = hash("7", "seed_a");
    assert_eq!(first, hash("7", "seed_b"));
    assert_ne!(first, hash("8", "seed_c"));
    assert_eq!(first.as_str().unwrap().len(), 64);
}

/// The hash is what it says: SHA-256 of the three logs' SHA-256s, one after another.
#[test]
fn the_hash_is_that_of_the_logs() {
    let folder = Scratch::new("hash");
    let figures = run_json("2", "0.2", &folder);
    let sum = |path: &Path| -> Option<String> {
        let output = Command::new("sha256sum").arg(path).output().ok()?;
        Some(String::from_utf8(output.stdout).unwrap()[..64].to_owned())
    };
    let logs = ["bus1.log", "bus2.log", "bus3.log"].map(|log| sum(&folder.join(log)));
    let Some(joined) = logs.into_iter().collect::<Option<String>>() else {
        println!("no sha256sum on this machine: not compared");
        return;
    };
    let path = folder.join("joined");
    fs::write(&path, joined).unwrap();
    assert_eq!(sum(&path).as_deref(), figures["trace_hash"].as_str());
}

#[test]
fn without_logs_there_are_none_and_the_hash_is_the_same() {
    let folder = Scratch::new("no_logs");
    let out = folder.to_str().unwrap();
    let hash = |more: &[&str]| {
        let run = rc10(&[&["run", "--seconds", "0.2", "--json", "--out", out], more].concat());
        let figures: Value = serde_json::from_slice(&run.stdout).unwrap();
        figures["trace_hash"].as_str().unwrap().to_owned()
    };
    let with = hash(&[]);
    assert!(folder.join("bus2.log").exists());
    assert_eq!(hash(&["--no-logs"]), with);
    assert!(!folder.join("bus2.log").exists() && folder.join("report.html").exists());
}

/// Not to its end: it says so before it begins.
#[test]
fn a_long_run_says_first_how_much_it_will_write() {
    let folder = Scratch::new("long");
    let mut child = Command::new(env!("CARGO_BIN_EXE_rc10"))
        .args(["run", "--seconds", "3600", "--out", folder.to_str().unwrap()])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    std::io::BufRead::read_line(
        &mut std::io::BufReader::new(child.stderr.take().unwrap()),
        &mut line,
    )
    .unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(line.starts_with("rc10: the bus logs will take some 2707 MB in "), "{line}");
    assert!(line.ends_with("; --no-logs writes none\n"), "{line}");
}

#[test]
fn tables_name_every_motor_and_bus() {
    let folder = Scratch::new("tables");
    let output = rc10(&["run", "--seconds", "0.5", "--out", folder.to_str().unwrap()]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    for name in <team::Name as rc10_motor::Names>::ALL {
        assert!(text.contains(rc10_motor::Names::label(*name)), "{text}");
    }
    assert!(text.contains("planned load") && text.contains("report.html"));
}

/// Lost for half a second it coasts and goes on; lost for good it is disarmed a second after the last
/// good frame. JSON and the report say when.
#[test]
fn a_lost_remote_stops_the_robot_and_the_figures_say_when() {
    let run = |fault: &str, name: &str| {
        let folder = Scratch::new(name);
        let out = folder.to_str().unwrap();
        let arguments = ["run", "--remote", "SBUS", "--fault", fault, "--seconds", "5.5", "--out"];
        let output = rc10(&[&arguments[..], &[out, "--json"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let figures: Value = serde_json::from_slice(&output.stdout).unwrap();
        let report = fs::read_to_string(folder.join("report.html")).unwrap();
        (figures["remote"].clone(), report)
    };
    let time = |loss: &Value, field: &str| loss[field].as_u64();
    for (fault, until, name) in [
        ("remote-lost@4s", None, "remote_lost"),
        ("remote-lost@4s..4.5s", Some(4_500_000), "remote_back"),
    ] {
        let (remote, report) = run(fault, name);
        assert_eq!(remote["receiver"], "sbus");
        let losses = remote["losses"].as_array().unwrap();
        let [loss] = losses.as_slice() else { panic!("{losses:?}") };
        assert_eq!((time(loss, "from_us"), time(loss, "until_us")), (Some(4_000_000), until));
        let last = time(loss, "last_good_frame_us").unwrap();
        assert!((3_980_000..=4_003_100).contains(&last), "{loss}");
        let coast = time(loss, "all_coast_us").unwrap();
        assert!((75_000..=120_000).contains(&(coast - last)), "{loss}");
        assert_eq!(time(loss, "frame_to_coast_us").unwrap() / 1000, (coast - last) / 1000);
        if until.is_none() {
            let disarmed = time(loss, "disarmed_us").unwrap();
            assert!((1_000_000..=1_020_000).contains(&(disarmed - last)), "{loss}");
            assert_eq!(time(loss, "resumed_us"), None);
        } else {
            let back = time(loss, "good_frame_again_us").unwrap();
            let resumed = time(loss, "resumed_us").unwrap();
            assert!((4_500_000..=4_520_000).contains(&back), "{loss}");
            assert!((back..=back + 20_000).contains(&resumed), "{loss}");
            assert_eq!(time(loss, "disarmed_us"), None);
        }
        assert!(report.contains("remote lost"), "{fault}");
        assert_eq!(report.contains("remote back"), until.is_some(), "{fault}");
    }
}

/// Each fault of a wire leaves its own trace where it is, and none elsewhere.
#[test]
fn run_does_the_faults_of_wires() {
    let run = |robot: &str, fault: &str| {
        let folder =
            Scratch::new(&format!("fault_{}_{robot}", fault.replace([':', '@', '.'], "_")));
        let out = folder.to_str().unwrap();
        let mut arguments = vec!["run", "--seconds", "1", "--json", "--out", out];
        if !fault.is_empty() {
            arguments.extend(["--fault", fault]);
        }
        let text = if robot == "mixed" {
            let (code, text) = mixed(&arguments);
            assert_eq!(code, Some(0), "{text}");
            text
        } else {
            let output = rc10(&arguments);
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            String::from_utf8(output.stdout).unwrap()
        };
        serde_json::from_str::<Value>(&text).unwrap()
    };
    let number = |value: &Value| value.as_f64().unwrap();
    // Received of the first motor on a place, how often it was lost, and what of the bus was not well.
    let seen = |figures: &Value, motor: usize, bus: usize| {
        let (motor, bus) = (&figures["motors"][motor], &figures["buses"][bus]);
        let [received, lost] = ["received", "lost"].map(|name| number(&motor[name]));
        let unsent = number(&bus["replaced"]) + number(&bus["refused"]);
        (received, lost, unsent, number(&bus["load_percent"]))
    };
    let (plain, other) = (run("team", ""), run("mixed", ""));
    let (received, _, _, load) = seen(&plain, 0, 0);
    for (fault, frames, lost, unsent, full) in [
        ("cut:1@0.4s..0.6s", -200.0, 1.0, true, false),
        ("short:1@0.4s..0.6s", -200.0, 1.0, true, true),
        ("dominant:1@0.4s..0.6s", -200.0, 1.0, true, true),
        ("power:1@0.4s..0.6s", -200.0, 1.0, true, true),
        ("noise:1@0.4s", 0.0, 0.0, false, false),
    ] {
        let figures = run("team", fault);
        let now = seen(&figures, 0, 0);
        assert!((now.0 - received - frames).abs() <= 20.0, "{fault}: {now:?} of {received}");
        assert_eq!((now.1, now.2 > 0.0), (lost, unsent), "{fault}: {now:?}");
        assert_eq!(now.3 > load + 2.0, full, "{fault}: {now:?}, else {load} %");
        // The others did not notice.
        for motor in 4..11 {
            assert_eq!(figures["motors"][motor]["lost"], 0, "{fault}");
        }
        // All is well again.
        assert_eq!(figures["motors"][0]["link"], "Online", "{fault}");
        assert_ne!(figures["trace_hash"], plain["trace_hash"], "{fault}");
    }
    // Filled with the least urgent feedback: that of the second motor of bus 2.
    let figures = run("team", "load:2@0.4s..0.6s");
    let (now, before) = (seen(&figures, 5, 1), seen(&plain, 5, 1));
    assert!(now.0 > before.0 + 400.0 && now.3 > before.3 + 4.0, "{now:?} {before:?}");
    // A line: the answers stop, or one of them is damaged.
    for (fault, counter, motors) in
        [("cut:L1@0.4s..0.6s", "timeouts", 1), ("power:L1@0.4s..0.6s", "timeouts", 1)]
    {
        let figures = run("mixed", fault);
        let [now, before] = [&figures, &other].map(|run| number(&run["lines"][0][counter]));
        assert!(now >= before + 20.0, "{fault}: {now}, else {before}");
        let lost: Vec<_> = (6..14).map(|leg| figures["motors"][leg]["lost"].clone()).collect();
        assert_eq!(lost, [motors; 8], "{fault}");
    }
    let figures = run("mixed", "noise:L1@0.4s");
    assert_eq!(figures["lines"][0]["crc_errors"], 1);
    assert_eq!(figures["motors"][6]["lost"], 0);
}

/// A part on a UART: out, damaged, without power. The motors do not notice, and the verdict excuses it.
#[test]
fn faults_of_parts_have_their_effects_and_no_others() {
    use rc10_cli::run::simulate::simulate;
    use rc10_cli::show::figures::Figures;
    let run = |fault: &str| {
        let ports = team::Ports::new();
        let io = &team::Shared::new(&ports);
        let mut motors = team::Motors::new();
        let mut robot = rc10_cli::robot_of::<team::Robot>(io, &mut motors).unwrap();
        let faults = [fault.parse().unwrap()];
        robot.set_faults(&faults).unwrap();
        let mut recording = simulate(robot, 1, rc10_time::Micros::from_millis(3000)).unwrap();
        recording.faults = faults.into();
        let found = Figures::of(&recording).any_problems();
        let heading = recording.signals.iter().find(|it| it.label == "heading").unwrap().last;
        (recording.parts[0].heard, heading, found)
    };
    let (whole, heading, found) = run("noise:1@2.9s");
    assert!(whole.port_errors == 0 && heading.is_some() && !found);
    for fault in ["cut:IMU@2s", "power:imu@2s..2.5s"] {
        let (heard, heading, found) = run(fault);
        // Without the IMU there is no heading; after a gap not before it is armed anew.
        assert!(heading.is_none() && !found, "{fault}");
        let part = if fault.starts_with("cut") { 0.667 } else { 0.833 };
        let share = f64::from(heard.frames) / f64::from(whole.frames);
        assert!((share - part).abs() < 0.02, "{fault}: {share}");
    }
    let (heard, heading, found) = run("noise:IMU@2s");
    assert!(heard.port_errors == 1 && heading.is_some() && !found, "{heard:?}");
}

#[test]
fn wrong_arguments_end_with_2_and_a_reason() {
    let folder = Scratch::new("a_file");
    let file = folder.join("file");
    fs::write(&file, "in the way").unwrap();
    let file = file.to_str().unwrap();
    let below = format!("{file}/below");
    for (arguments, reason) in [
        (&["run", "--seconds", "0"][..], "seconds"),
        (
            &["run", "--seconds", "-3"],
            "value '-3' for '--seconds <S>': must be a number of seconds",
        ),
        (&["run", "--seed", "-5"], "'-5' for '--seed <N>': must be a whole number from 0"),
        (&["emu", "--seed", "-5"], "'-5' for '--seed <N>': must be a whole number from 0"),
        (&["pty", "--bus", "1", "--seed", "1.5"], "must be a whole number from 0"),
        (&["run", "--seconds", "NaN"], "must be a number of seconds"),
        (&["run", "--seed", "x"], "--seed"),
        (&["run", "--remote", "foo"], "possible values: dr16, sbus, crsf, ppm, vt03"),
        (&["run", "--fault", "remote-lost"], "write KIND@TIME"),
        (&["run", "--fault", "remote-lost@4"], "`4` is no time"),
        (&["run", "--fault", "remote-lost@4s..3s"], "it ends when or before it begins"),
        (&["run", "--fault", "remote-lost:1@4s"], "`remote-lost` takes nothing behind a colon"),
        (
            &["run", "--fault", "remote-lost@4.5s", "--seconds", "4"],
            "remote-lost would begin at 4.5 s, after the end at 4 s: see --seconds",
        ),
        (
            &["run", "--fault", "remote-lost@1s", "--fault", "remote-lost@2s..3s"],
            "remote-lost@2s: the remote is lost already, since 1 s",
        ),
        (&["run", "--fault", "panic@1s"], "--fault panic: rc10 run has no chip to do that to"),
        (&["run", "--fault", "hang@1s..2s"], "rc10 emu does it"),
        (&["run", "--fault", "mask@1s..2s"], "rc10 emu does it"),
        (&["run", "--fault", "cut:4@1s"], "`cut` needs a bus, 1 to 3"),
        (&["run", "--fault", "cut:L1@1s"], "cut:L1: there is no such line; it has no line"),
        (
            &["run", "--fault", "cut:wall@1s"],
            "cut:wall: there is no part on a UART or motor `wall`; there are: IMU, wheel front left",
        ),
        (&["run", "--fault", "torn:feeder@1s"], "there is no contact `feeder`; there are: none"),
        (&["run", "--fault", "stuck@1s"], "`stuck` needs the label of a motor: stuck:feeder"),
        (&["run", "--out", file], "cannot make the folder"),
        (&["run", "--out", &below], "cannot make the folder"),
        (&["fly"], "fly"),
        (&["run", "--robot", "tank"], "unexpected argument '--robot'"),
        (&["pty", "--bus", "9", "--seconds", "1"], "buses 1 to 3"),
        (&["dbc", "--out", &below], "cannot make the folder"),
        (&["--nonsense"], "--nonsense"),
    ] {
        let output = rc10(arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(reason), "{arguments:?}: {error}");
        assert!(output.stdout.is_empty() && !error.contains("panicked"), "{arguments:?}: {error}");
    }
    for (arguments, reason) in [
        (&["run", "--fault", "load:3@1s"][..], "load:3: there is no such bus; the last is 2"),
        (&["run", "--fault", "power:L2@1s"], "power:L2: there is no such line; the last is 1"),
        (&["emu", file, "--fault", "cut:L2@0.1s"], "cut:L2: there is no such line; the last is 1"),
    ] {
        let (code, error) = mixed(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {error}");
        assert!(error.contains(reason), "{arguments:?}: {error}");
    }
    for arguments in [["rc10", "run", "--remote=sbus"], ["rc10", "run", "--fault=remote-lost@1s"]] {
        let deaf = Robot::new(Description::default());
        let error = CommandLine::parse(arguments).unwrap().run_to(deaf, &mut Vec::new());
        let error = error.unwrap_err().to_string();
        assert!(error.contains("this robot has no remote control"), "{arguments:?}: {error}");
    }
}

#[test]
fn help_shows_examples() {
    let output = rc10(&["--help"]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    for example in ["Examples:", "rc10 decode", "--fault remote-lost@"] {
        assert!(text.contains(example), "{example}: {text}");
    }
    let text = String::from_utf8(rc10(&["run", "--help"]).stdout).unwrap();
    assert!(text.contains("sbus: Futaba, FrSky: ") && !text.contains('`'), "{text}");
}
