//! Robots that are built otherwise than their table says: how it looks, and what a run says of it.

use crate::common::mixed as common_mixed;
use std::process::Command;

use crate::common::scratch::Scratch;
use rc10_cli::recording::Recording;
use rc10_cli::run::simulate::simulate;
use rc10_motor::Link;
use rc10_time::Micros;
use team::table::Name;

/// Exit code, and what it says on both ways out.
fn rc10(arguments: &[&str]) -> (Option<i32>, String) {
    let folder = arguments.concat().replace([':', '=', ',', ' '], "_");
    let folder = Scratch::new(&folder);
    let output = Command::new(env!("CARGO_BIN_EXE_rc10"))
        .args(["run", "--strict", "--out", folder.to_str().unwrap()])
        .args(arguments)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

/// The same of the mixed robot.
fn mixed(arguments: &[&str]) -> (Option<i32>, String) {
    let folder = Scratch::new(&arguments.concat().replace([':', '=', ',', ' '], "_"));
    let run = ["run", "--strict", "--out", folder.to_str().unwrap()];
    common_mixed::mixed(&[&run[..], arguments].concat())
}

/// The robot's own sensors know each of these, and the run says what it is.
#[test]
fn a_mistake_that_sensors_know_is_named() {
    for (mistake, headline, cause) in [
        (
            "direction:wheel-front-left",
            "wheel front left: direction is reversed",
            "the direction of wheel front left were wrong",
        ),
        (
            "direction:wheel rear right",
            "wheel rear right: direction is reversed",
            "the direction of wheel rear right were wrong",
        ),
        ("radius:x2", RADIUS, "the wheels' radius were 1.9"),
        ("radius:x0.5", RADIUS, "the wheels' radius were 0.50 times that of the table"),
        ("radius:x1.1", RADIUS, "the wheels' radius were 1.10 times that of the table"),
        ("track:x1.5", RADIUS, "wheelbase and track together 1.2"),
        ("imu:over", "robot: IMU is upside down", "the IMU were mounted upside down"),
        // They follow their commands though the floor drags them: the IMU alone sees something of it.
        (
            "swap:wheel-front-l,wheel-rear-l",
            "robot: wheel radius wrong, or two wheels swapped",
            ONE_SIDE,
        ),
        (
            "swap:wheel-front-l,wheel-front-r",
            "robot: two wheels are perhaps swapped",
            "wheel front left and wheel front right were exchanged",
        ),
        (
            "gear:wheel-front-left=36",
            "wheel front left: another gear or wheel",
            "wheel front left turned about 0.4 times as fast",
        ),
        (
            "gear:wheel-rear-left=10",
            "wheel rear left: another gear or wheel",
            "wheel rear left turned about 2.1 times as fast",
        ),
        (
            "id:wheel-front-left=2",
            "wheel front right: two devices, one identifier",
            "wheel front right: answers twice: 2.0 times as many frames as it sends, so two devices \
             on bus 1 have the identifier of M3508 id 2, and wheel front left is never heard",
        ),
        (
            "id:feeder=7",
            "feeder: set to another identifier",
            "frames of 0x207 belong to no motor of the table, and feeder is never heard",
        ),
        (
            "direction:lift-front-left",
            "lift front left: effort stands at its limit",
            "lift front left: its effort stands at its limit",
        ),
    ] {
        let (code, text) = rc10(&["--mistake", mistake]);
        assert_eq!(code, Some(3), "{mistake}: {text}");
        assert!(text.contains(cause), "{mistake}: {text}");
        assert!(text.contains(&format!("\n  {headline}\n")), "{mistake}: {text}");
        // Nothing else is in doubt.
        assert_eq!(text.contains(ONE_SIDE), cause == ONE_SIDE, "{mistake}: {text}");
    }
}

const RADIUS: &str = "robot: wheel radius or track is wrong";
const ONE_SIDE: &str = "times theirs; two wheels of one side that are exchanged look the same";

/// A difference that no sensor knows is no problem, and the run says which sensor would show it.
#[test]
fn a_mistake_that_no_sensor_knows_comes_with_what_would_show_it() {
    for (mistake, length, what) in [
        // Forward becomes left: the wheels turn freely, and the IMU sees what it expects.
        (
            "swap:wheel-front-left,wheel-rear-right",
            "10",
            "drive 1 m forward, see which way it goes",
        ),
        (
            "direction:gimbal-yaw",
            "10",
            "direction and gear not checked, no sensor knows: of gimbal",
        ),
        // Over before it turns.
        ("radius:x2", "3.5", "wheel radius: not checked, it hardly turned: drive 1 m forward"),
    ] {
        let (code, text) = rc10(&["--mistake", mistake, "--seconds", length]);
        assert_eq!(code, Some(0), "{mistake}: {text}");
        assert!(text.contains(what), "{mistake}: {text}");
    }
    let (code, text) = mixed(&["--seconds", "4", "--mistake", "pole-pairs:wheel=14"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("direction and gear not checked, no sensor knows: of wheel"), "{text}");
}

#[test]
fn a_robot_as_its_table_says_gives_no_alarm() {
    for seed in 1..=10 {
        for robot in [rc10, mixed] {
            let (code, text) = robot(&["--seed", &seed.to_string()]);
            assert_eq!(code, Some(0), "seed {seed}: {text}");
        }
    }
    // A fault of a wire is no problem of the base.
    for fault in ["cut:1@1s..1.5s", "power:1@4s..4.2s", "load:1@1s..3s", "remote-lost@4s..4.3s"] {
        let (_, text) = rc10(&["--fault", fault]);
        assert!(!text.contains("it looks as if") && !text.contains("runs away"), "{fault}: {text}");
        assert!(!text.contains("answers twice"), "{fault}: {text}");
    }
}

#[test]
fn a_wrong_mistake_ends_with_2_and_a_reason() {
    for (mistake, why) in [
        (
            "direction:leg",
            "there is no motor `leg`; there are: wheel front left, wheel front right",
        ),
        ("direction:wheel", "`wheel` may be wheel front left, wheel front right, wheel rear left"),
        ("swap:feeder,gimbal-yaw", "feeder is a M2006, gimbal yaw a GM6020"),
        ("swap:feeder", "write swap:"),
        ("id:feeder=9", "a simulated M2006 cannot be set to the identifier 9"),
        ("pole-pairs:feeder=7", "no pole pairs of a M2006 stand in"),
        ("radius:2", "write how many times as large: radius:x2"),
        ("weight:x2", "there is no such mistake; there are: direction:NAME"),
    ] {
        let (code, text) = rc10(&["--mistake", mistake]);
        assert_eq!(code, Some(2), "{mistake}: {text}");
        assert!(text.contains(why) && !text.contains("virtual time in"), "{mistake}: {text}");
    }
    for (mistake, why) in [
        ("radius:x2", "this robot has no base that is simulated"),
        ("gear:arm=5", "no gear of a DM-J4310 stands in a robot's table"),
        ("gear:leg-0=5", "no gear of a GO-M8010-6 stands in a robot's table"),
    ] {
        let (code, text) = mixed(&["--mistake", mistake]);
        assert_eq!(code, Some(2), "{mistake}: {text}");
        assert!(text.contains(why), "{mistake}: {text}");
    }
}

fn run(mistake: &str, millis: u64) -> Recording {
    let ports = team::Ports::new();
    let shared = &team::Shared::new(&ports);
    let mut motors = team::Motors::new();
    let mut robot = rc10_cli::robot_of::<team::Robot>(shared, &mut motors).unwrap();
    if !mistake.is_empty() {
        robot.set_mistakes(&[mistake.parse().unwrap()]).unwrap();
    }
    simulate(robot, 1, Micros::from_millis(millis)).unwrap()
}

/// The world goes its own way, and the robot's wheels still do what they are told.
#[test]
fn the_path_is_that_of_the_world() {
    let end = |mistake: &str, millis: u64| {
        let run = run(mistake, millis);
        let base = run.base.unwrap();
        let wheels = base.heard.last().unwrap().wheels.iter().map(|wheel| wheel.angle);
        let wheels: Vec<f64> = wheels.collect();
        // The robot's own measurement of the same.
        let believed = base.by_wheels().last().copied().unwrap();
        assert_eq!(base.path.len(), base.heard.len());
        assert!((believed.x - 0.84).abs() < 0.1 && believed.y.abs() < 0.05, "{believed:?}");
        (*base.path.last().unwrap(), wheels)
    };
    // Forward, up to the first corner.
    let (plain, turned) = end("", 1100);
    assert!(plain.x > 0.7 && plain.y.abs() < 0.01 && plain.yaw.abs() < 0.01, "{plain:?}");
    let (large, the_same) = end("radius:x1.5", 1100);
    assert!((large.x - 1.5 * plain.x).abs() < 0.1 * plain.x, "{large:?}");
    for (wheel, other) in turned.iter().zip(the_same) {
        assert!((wheel - other).abs() < 0.05 * wheel, "{wheel} {other}");
    }
    let (crooked, _) = end("direction:wheel-front-left", 1100);
    assert!(crooked.yaw > 0.5, "{crooked:?}");
    // Two opposite corners: forward is sideways.
    let (sideways, _) = end("swap:wheel-front-left,wheel-rear-right", 1100);
    assert!(sideways.x.abs() < 0.05 && sideways.y > 0.7, "{sideways:?}");
    // Behind twice the gear a shaft turns half as far: the feeder's, which turns nothing else.
    let feeder = |mistake: &str| {
        let run = run(mistake, 6500);
        run.motors[Name::Feeder as usize].samples.last().unwrap().rpm
    };
    assert!((feeder("gear:feeder=72") - 0.5 * feeder("")).abs() < 5.0);
}

/// Another identifier at other vendors' devices: asked for by nothing, they stay silent.
#[test]
fn other_vendors_devices_can_have_another_identifier_too() {
    for label in ["wheel", "wrist", "turret", "flywheel", "leg 2"] {
        let ports = ::mixed::Ports::new();
        let (shared, mut motors) = (::mixed::Shared::new(&ports), ::mixed::Motors::new());
        let mut robot = ::rc10_cli::robot_of::<mixed::Robot>(&shared, &mut motors).unwrap();
        robot.set_mistakes(&[format!("id:{label}=9").parse().unwrap()]).unwrap();
        let run = simulate(robot, 1, Micros::from_millis(300)).unwrap();
        for track in &run.motors {
            let expected = if track.motor.label == label { Link::NeverSeen } else { Link::Online };
            assert_eq!(track.last.link, expected, "{label} = 9: {}", track.motor.label);
        }
    }
}
