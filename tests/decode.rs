//! `rc10 decode` with a capture: the command itself, on whole logs.

use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use crate::common::mixed::mixed;
use crate::common::scratch::Scratch;
use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_cli::formats::candump;
use rc10_time::Micros;
use serde_json::Value;

fn rc10(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.arg("decode").args(arguments);
    command
}

fn capture(name: &str) -> String {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests", "logs", name].iter().collect();
    path.to_str().unwrap().to_owned()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

fn with_input(arguments: &[&str], input: &[u8]) -> Output {
    let mut command = rc10(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn a_capture_with_broken_lines_is_read_to_its_end() {
    let output = rc10(&[&capture("c620-spinup.candump.log")]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let errors: Vec<&str> = text(&output.stderr).lines().collect();
    assert_eq!(errors.len(), 2, "{errors:?}");
    assert!(errors[0].starts_with("line 501: not a frame"), "{errors:?}");
    assert!(errors[1].starts_with("line 502: a classic CAN frame carries at most 8"), "{errors:?}");
    let printed = text(&output.stdout);
    // 201#000100080BB81E00: 8 rotor rpm behind 3591 : 187, 0x0BB8 of 16384 for 20 A, 0x1E degrees.
    let line = printed.lines().nth(1).unwrap();
    let words: Vec<&str> = line.split_whitespace().collect();
    let expected = "1732150000.000150 can0 wheel front left M3508 id 1 angle 0.002 deg \
                    total 0.002 deg speed 0.42 rpm current 3.662 A 30 degC";
    assert_eq!(words.join(" "), expected);
    let sums = "frames 501: feedback 400, commands 100, malformed 1, unknown 0";
    assert!(printed.contains(sums), "{printed}");
    assert!(printed.contains("lines 503, of which broken 2"), "{printed}");
}

#[test]
fn a_capture_of_python_can_is_one_json_object() {
    let output = rc10(&[&capture("c620-spinup.python-can.log"), "--json"]).output().unwrap();
    let object = json(&output);
    let frames = object["frames"].as_array().unwrap();
    let kind = |kind: &str| frames.iter().filter(|frame| frame["kind"] == kind).count() as u64;
    let summary = &object["summary"];
    assert_eq!(summary["feedback"], kind("feedback"));
    assert_eq!(summary["commands"], kind("command"));
    assert_eq!(summary["malformed"], kind("malformed"));
    assert_eq!((kind("feedback"), kind("command")), (8000, 2000));
    assert_eq!(frames[0]["direction"], "sent");
    assert_eq!(frames[1]["direction"], "received");
    assert_eq!(frames[1]["time_us"], 1_732_150_000_000_150_u64);
    assert!(frames.windows(2).all(|pair| pair[0]["line"].as_u64() < pair[1]["line"].as_u64()));
}

/// The capture over two seconds: each rotor's speed, summed up, is the way it turned.
/// Speeds are whole rpm and angles come late by at most one frame, hence the half per cent.
#[test]
fn the_angle_over_a_whole_capture_is_the_integral_of_the_speed() {
    let output = rc10(&[&capture("c620-spinup.python-can.log"), "--json"]).output().unwrap();
    let object = json(&output);
    for id in 1..=4 {
        let of_motor = |frame: &&Value| frame["kind"] == "feedback" && frame["id"] == id;
        let frames: Vec<&Value> =
            object["frames"].as_array().unwrap().iter().filter(of_motor).collect();
        let number = |frame: &Value, name: &str| frame[name].as_f64().unwrap();
        let mut way = 0.0;
        for pair in frames.windows(2) {
            let seconds = (number(pair[1], "time_us") - number(pair[0], "time_us")) * 1e-6;
            let rpm = (number(pair[0], "speed_rpm") + number(pair[1], "speed_rpm")) / 2.0;
            way += rpm * 6.0 * seconds;
        }
        let (first, last) = (frames[0], frames[frames.len() - 1]);
        let turned = number(last, "total_angle_deg") - number(first, "total_angle_deg");
        assert!(turned.abs() > 360.0, "motor {id} turned {turned}");
        assert!((turned / way - 1.0).abs() < 0.005, "motor {id}: {turned} and {way}");
    }
}

/// The same frames in the console form give the same motors.
#[test]
fn the_console_form_says_the_same_as_the_file_form() {
    let log = std::fs::read_to_string(capture("c620-spinup.candump.log")).unwrap();
    let mut console = String::new();
    for line in log.lines() {
        let Ok(Some(line)) = candump::parse(line) else { continue };
        let at = candump::SecondsOf(line.at.unwrap());
        let bytes = line.frame.bytes();
        let data: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        let (id, data) = (line.frame.raw_id(), data.join(" "));
        console += &format!(" ({at})  {}  {id:03X}   [{}]  {data}\r\n", line.channel, bytes.len());
    }
    let from_console = with_input(&["-"], console.as_bytes());
    let from_file = rc10(&[&capture("c620-spinup.candump.log")]).output().unwrap();
    assert_eq!(from_console.status.code(), Some(0), "{}", text(&from_console.stderr));
    let frames = |output: &Output| text(&output.stdout).split("\n\n").next().unwrap().to_owned();
    assert_eq!(frames(&from_console), frames(&from_file));
}

#[test]
fn a_reader_that_has_seen_enough_ends_it_quietly() {
    let mut command = rc10(&[&capture("c620-spinup.python-can.log")]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut some = [0; 100];
    child.stdout.take().unwrap().read_exact(&mut some).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), ""));
}

#[test]
fn what_cannot_be_done_is_said_and_ends_with_2() {
    for (arguments, said) in [
        (&["nowhere.log"][..], "cannot read nowhere.log"),
        (&["-", "--bus", "can0"], "CHANNEL=NUMBER"),
        (&["-", "--bus", "can0=9"], "the robot has buses 1 to 3"),
        (&["-", "--bus", "a=1", "--bus", "b=1"], "a and b cannot both be bus 1"),
        (&[], "FILE"),
    ] {
        let output = with_input(arguments, b"");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains(said), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

/// Frames that are neither setpoint nor measurement, by hand from the vendors' documents; their
/// motors in the mixed robot; and their text.
const SPECIAL: &[(&str, &str, &str)] = &[
    // Manuals of J4310, J10010L and S3519.
    ("can0 011#FFFFFFFFFFFFFFFC", "arm", "DAMIAO_ENABLE"),
    ("can0 011#FFFFFFFFFFFFFFFD", "arm", "DAMIAO_DISABLE"),
    ("can0 011#FFFFFFFFFFFFFFFE", "arm", "DAMIAO_STORE_ZERO"),
    ("can0 011#FFFFFFFFFFFFFFFB", "arm", "DAMIAO_CLEAR_ERROR"),
    ("can0 7FF#11003315", "arm", "DAMIAO_READ_REGISTER REGISTER PMAX"),
    ("can0 7FF#1100330A00000000", "arm", "DAMIAO_READ_REGISTER REGISTER CTRL_MODE"),
    ("can0 031#1100331500004841", "arm", "DAMIAO_REGISTER_HOLDS PMAX 12.5 rad"),
    ("can0 7FF#1100550A02000000", "arm", "DAMIAO_WRITE_REGISTER CTRL_MODE position-velocity"),
    ("can0 031#1100550A02000000", "arm", "DAMIAO_REGISTER_WRITTEN CTRL_MODE position-velocity"),
    ("can0 7FF#1100AA01", "arm", "DAMIAO_SAVE_REGISTERS"),
    ("can0 031#1100AA0100000000", "arm", "DAMIAO_REGISTERS_SAVED"),
    ("can0 7FF#1100CC00", "arm", "DAMIAO_REFRESH"),
    // bldc, `comm_can.c`.
    ("can0 00001101#FE", "wheel", "VESC_PING VESC_PING_FROM 254"),
    ("can0 000012FE#0100", "wheel", "VESC_PONG VESC_PONG_FROM 1 VESC_PONG_HARDWARE VESC"),
    (
        "can0 00001501#FFFF15A00000EA60",
        "wheel",
        "VESC_CURRENT_LIMITS VESC_LIMIT_MIN -60 A VESC_LIMIT_MAX 60 A",
    ),
    (
        "can0 00001E01#00004E2000004844",
        "wheel",
        "VESC_STORE_BATTERY_CUT VESC_CUT_BEGINS 20 V VESC_CUT_ENDS 18.5 V",
    ),
    ("can0 00001F01#", "wheel", "VESC_SHUTDOWN"),
    ("can0 000001FF#00000000", "wheel", "VESC_SET_CURRENT VESC_SET_CURRENT 0 A"),
    (
        "can0 00003A01#04E209C402EE01F4",
        "wheel",
        "VESC_STATUS_6 VESC_INPUT_1 1.25 V VESC_INPUT_2 2.5 V VESC_INPUT_3 0.75 V VESC_PPM 0.5",
    ),
    // module manual V1.0.
    ("can0 180A0000#0000000000000000", "hip", "UNITREE_GO_LOCK"),
    ("can0 180A2000#0000000000000000", "hip", "UNITREE_GO_CALIBRATE"),
    (
        "can0 180B0000#0005000A00000000",
        "hip",
        "UNITREE_GO_SET_GAINS Damping 40.069 Nms/rad Stiffness 80.138 Nm/rad",
    ),
    ("can0 180C0000#0000000000000000", "hip", "UNITREE_GO_READ_GAINS"),
    (
        "can0 180D1000#0000000000000000",
        "hip",
        "UNITREE_GO_CONTROL_UNANSWERED Angle 0 deg Speed 0 rpm Torque 0 Nm",
    ),
    (
        "can0 1D071023#0000000000000000",
        "hip",
        "UNITREE_GO_STATE Status controlled Angle 0 deg Speed 0 rpm Torque 0 Nm Temperature 35 degC AirPressure 7",
    ),
    (
        "can0 1D011080#0000000000000000",
        "hip",
        "UNITREE_GO_FAULT Status controlled Error over-temperature",
    ),
    (
        "can0 1E020000#0005000A00000000",
        "hip",
        "UNITREE_GO_GAINS Damping 40.069 Nms/rad Stiffness 80.138 Nm/rad",
    ),
    // CyberGear manual, types 0 to 22.
    ("can1 0300FD7F#0000000000000000", "wrist", "CYBERGEAR_ENABLE"),
    ("can1 0400FD7F#0100000000000000", "wrist", "CYBERGEAR_STOP CLEARS_FAULTS yes"),
    ("can1 0600FD7F#0100000000000000", "wrist", "CYBERGEAR_SET_ZERO"),
    ("can1 0705FD7F#0100000000000000", "wrist", "CYBERGEAR_SET_ID NEW_ID 5"),
    ("can1 0000FD7F#0000000000000000", "wrist", "CYBERGEAR_IDENTIFY"),
    ("can1 00007FFE#0000000000000102", "wrist", "CYBERGEAR_IDENTITY CHIP 258"),
    ("can1 1100FD7F#1670000000000000", "wrist", "CYBERGEAR_READ_PARAMETER INDEX POSITION"),
    ("can1 11007FFD#1C70000000006041", "wrist", "CYBERGEAR_PARAMETER SUPPLY 14 V"),
    ("can1 1200FD7F#0570000001000000", "wrist", "CYBERGEAR_WRITE_PARAMETER RUN_MODE position"),
    ("can1 1600FD7F#0200000000000000", "wrist", "CYBERGEAR_SET_BIT_RATE BIT_RATE 500 kbit/s"),
    (
        "can1 01FFFF7F#7FFF7FFF00000000",
        "wrist",
        "CYBERGEAR_MOTION POSITION 0 rad VELOCITY 0 rad/s KP 0 N m/rad KD 0 N m s/rad TORQUE 12 N m",
    ),
    (
        "can1 02847FFD#7FFF7FFF7FFF00FA",
        "wrist",
        "CYBERGEAR_FEEDBACK MODE runs FAULT_2 too hot POSITION 0 rad VELOCITY 0 rad/s TORQUE 0 N m TEMPERATURE 25 degC",
    ),
    (
        "can1 15007FFD#0100000000000000",
        "wrist",
        "CYBERGEAR_FAULTS DRIVER_CHIP good OVER_CURRENT_A good OVER_CURRENT_B good OVER_CURRENT_C good TOO_HOT motor too hot (80 °C) OVERLOAD good OVER_VOLTAGE good UNDER_VOLTAGE good NOT_CALIBRATED good GETS_HOT good",
    ),
    // LK CAN manual V2.3.
    ("can1 141#8000000000000000", "turret", "LK_OFF"),
    ("can1 141#8100000000000000", "turret", "LK_STOP"),
    ("can1 141#8800000000000000", "turret", "LK_RUN"),
    ("can1 141#9A00000000000000", "turret", "LK_READ_ERRORS"),
    (
        "can1 141#9A1900F000000000",
        "turret",
        "LK_ANSWER COMMAND errors REPORTED_TEMPERATURE 25 degC SUPPLY 24 V",
    ),
    ("can1 141#9B00000000000000", "turret", "LK_CLEAR_ERRORS"),
    ("can1 141#A100000064000000", "turret", "LK_CURRENT CURRENT 1.611 A"),
    (
        "can1 141#A119640064000040",
        "turret",
        "LK_ANSWER COMMAND torque current TEMPERATURE 25 degC CURRENT 1.611 A ROTOR_SPEED 100 deg/s ROTOR_ANGLE 90 deg",
    ),
    ("can1 141#A200000010270000", "turret", "LK_SPEED ROTOR_SPEED 100 deg/s"),
    (
        "can1 141#A219640064000040",
        "turret",
        "LK_MOTION COMMAND speed TEMPERATURE 25 degC CURRENT 1.611 A ROTOR_SPEED 100 deg/s ROTOR_ANGLE 90 deg",
    ),
    ("can1 141#A4006400A08C0000", "turret", "LK_TURN_TO ROTOR_ANGLE 360 deg SPEED_LIMIT 100 deg/s"),
    ("can1 141#9200000000000000", "turret", "LK_READ_MULTI_TURN"),
    ("can1 141#92A08C0000000000", "turret", "LK_MULTI_TURN ROTOR_ANGLE 360 deg"),
    // firmware 0.6: CAN protocol page, and `can_simple.hpp`.
    ("can1 074#R8", "flywheel", "ODRIVE_ASK_CURRENTS"),
    ("can1 069#R", "flywheel", "ODRIVE_ASK_ESTIMATES"),
    (
        "can1 061#0000000001000000",
        "flywheel",
        "ODRIVE_HEARTBEAT AXIS_STATE idle PROCEDURE_RESULT 0 TRAJECTORY_DONE 0",
    ),
    ("can1 062#", "flywheel", "ODRIVE_EMERGENCY_STOP"),
    (
        "can1 067#0800000000000000",
        "flywheel",
        "ODRIVE_SET_STATE REQUESTED_STATE closed-loop control",
    ),
    ("can1 064#00030100", "flywheel", "ODRIVE_READ_ENDPOINT ENDPOINT 259"),
    (
        "can1 064#0103010000002041",
        "flywheel",
        "ODRIVE_ENDPOINT_REQUEST OPERATION write ENDPOINT 259 VALUE 1092616192 VALUE_AS_FLOAT 10",
    ),
    (
        "can1 065#0003010000002041",
        "flywheel",
        "ODRIVE_ENDPOINT_HOLDS ENDPOINT 259 VALUE 1092616192 VALUE_AS_FLOAT 10",
    ),
    ("can1 078#", "flywheel", "ODRIVE_CLEAR_ERRORS"),
];

fn words(line: &str) -> String {
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_special_frame_of_every_vendor_has_its_name() {
    let log: String = SPECIAL.iter().map(|(frame, ..)| format!("(1.0) {frame}\n")).collect();
    let folder = Scratch::new("special");
    let file = folder.join("special.log");
    std::fs::write(&file, log).unwrap();
    let (code, printed) = mixed(&["decode", file.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{printed}");
    for (line, (frame, motor, said)) in printed.lines().zip(SPECIAL) {
        let (words, channel) = (words(line), frame.split(' ').next().unwrap());
        let whose = format!("1.000000 {channel} {motor} ");
        let rest = words.strip_prefix(&whose).unwrap_or_else(|| panic!("{frame}: {words}"));
        let name = said.split(' ').next().unwrap();
        let told = rest.find(name).map(|start| &rest[start..]);
        assert_eq!(told, Some(*said), "{frame}: {words}");
    }
    assert!(printed.contains("malformed 0, unknown 0"), "{printed}");
    // Sent to all four: the identifiers of DJI's motors.
    let output = with_input(&["-"], b"(1.0) can0 700#0000000000000000\n");
    let said = words(text(&output.stdout).lines().next().unwrap());
    assert_eq!(said, "1.000000 can0 several DJI_QUICK_ID_SETTING");
}

/// A whole run: each frame has a name, none is bad, and a disabling frame is no setpoint.
#[test]
fn every_frame_of_a_healthy_robot_is_named_and_none_is_malformed() {
    for (robot, buses) in [("mixed", 2), ("team", 3)] {
        let folder = Scratch::new(&format!("decode-{robot}"));
        let rc10 = |arguments: &[&str]| {
            if robot == "mixed" {
                return mixed(arguments);
            }
            let output = Command::new(env!("CARGO_BIN_EXE_rc10")).args(arguments).output().unwrap();
            (output.status.code(), String::from_utf8(output.stdout).unwrap())
        };
        let (code, said) = rc10(&["run", "--seconds", "3", "--out", folder.to_str().unwrap()]);
        assert_eq!(code, Some(0), "{robot}: {said}");
        let mut names = std::collections::BTreeSet::new();
        let mut unasked = 0;
        for bus in 1..=buses {
            let log = folder.join(format!("bus{bus}.log"));
            let lines = std::fs::read_to_string(&log).unwrap().lines().count();
            let (_, printed) = rc10(&["decode", log.to_str().unwrap(), "--json"]);
            let object: Value = serde_json::from_str(&printed).unwrap();
            let summary = &object["summary"];
            let frames = object["frames"].as_array().unwrap();
            assert_eq!((frames.len(), &summary["frames"]), (lines, &lines.into()), "{robot}");
            assert_eq!((&summary["malformed"], &summary["unknown"]), (&0.into(), &0.into()));
            for motor in summary["motors"].as_array().unwrap() {
                assert_eq!(motor["malformed"], 0, "{motor}");
                unasked += motor["unasked"].as_u64().unwrap();
            }
            for frame in frames {
                let name = frame["message"].as_str().or(frame["kind"].as_str()).unwrap();
                names.insert(name.to_owned());
                let says = |end: &str| frame["frame"].as_str().is_some_and(|it| it.ends_with(end));
                assert_eq!(name == "DAMIAO_DISABLE", says("#FFFFFFFFFFFFFFFD"), "{frame}");
                let is_full = |signal: &Value| signal["signal"] == "KP" && signal["value"] == 500.0;
                let signals = frame["signals"].as_array();
                assert!(!signals.is_some_and(|all| all.iter().any(is_full)), "{frame}");
            }
        }
        let special: &[&str] = match robot {
            "mixed" => &[
                "CYBERGEAR_ENABLE",
                "CYBERGEAR_MOTION",
                "CYBERGEAR_PARAMETER",
                "CYBERGEAR_READ_PARAMETER",
                "CYBERGEAR_STOP",
                "DAMIAO_DISABLE",
                "DAMIAO_ENABLE",
                "DAMIAO_READ_REGISTER",
                "DAMIAO_REGISTER_HOLDS",
                "LK_CURRENT",
                "LK_OFF",
                "LK_READ_ERRORS",
                "LK_READ_MEASUREMENT",
                "LK_RUN",
                "ODRIVE_SET_STATE",
                "UNITREE_GO_GAINS",
                "UNITREE_GO_LOCK",
                "UNITREE_GO_READ_GAINS",
                "UNITREE_GO_SET_GAINS",
                "UNITREE_GO_STATE",
            ],
            _ => &["command", "feedback"],
        };
        for name in special {
            assert!(names.contains(*name), "{robot}: no {name} in {names:?}");
        }
        // Five registers of the arm, and the gains of the hip: this program has not asked.
        assert_eq!(unasked, if robot == "mixed" { 6 } else { 0 }, "{robot}");
    }
}

mod round_trip {
    use super::*;
    use proptest::prelude::*;

    fn any_frame() -> impl Strategy<Value = CanFrame> {
        let id = prop_oneof![
            (0..=0x7FF_u16).prop_map(|raw| Id::Standard(StandardId::new(raw).unwrap())),
            (0..=0x1FFF_FFFF_u32).prop_map(|raw| Id::Extended(ExtendedId::new(raw).unwrap())),
        ];
        let data = proptest::collection::vec(any::<u8>(), 0..=8);
        (id, data, any::<bool>()).prop_map(|(id, data, remote)| {
            if remote {
                CanFrame::remote_frame(id, data.len()).unwrap()
            } else {
                CanFrame::data_frame(id, &data).unwrap()
            }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn a_written_frame_is_read_back(
            frame in any_frame(),
            micros in 0..=u64::MAX,
            channel in "[a-z]{1,5}[0-9]{1,3}",
        ) {
            let mut text = String::new();
            candump::write_line(&mut text, Micros::new(micros), &channel, &frame).unwrap();
            let line = candump::parse(&text).unwrap().unwrap();
            prop_assert_eq!((line.at, line.frame), (Some(Micros::new(micros)), frame));
            prop_assert_eq!((line.channel, line.direction), (channel.as_str(), None));
        }

        #[test]
        fn no_text_makes_it_panic(text in "\\PC*|[ ()0-9a-fR#.\\[\\]']{0,40}") {
            let _ = candump::parse(&text);
        }
    }
}

#[test]
fn frames_are_filtered_by_motor_time_and_changes() {
    let log = "\
(100.0) can0 201#0100000000000000
(100.1) can0 202#0100000000000000
(100.2) can0 201#0100000000000000
(100.3) can0 200#00010002000000FF
(100.4) can0 201#0200000000000000
(100.5) can0 201#0200000000000000
(101.0) can0 203#0100000000000000
";
    let lines = |arguments: &[&str]| -> Vec<String> {
        let output = with_input(&[&["-"], arguments].concat(), log.as_bytes());
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        let frames = text(&output.stdout).lines().filter(|line| line.contains(" can0 "));
        frames.map(|line| line.split_whitespace().next().unwrap().to_owned()).collect()
    };
    let at = |wanted: &[&str]| -> Vec<String> {
        wanted.iter().map(|time| format!("{time}00000")).collect()
    };
    let all = ["100.0", "100.1", "100.2", "100.3", "100.4", "100.5", "101.0"];
    assert_eq!(lines(&[]), at(&all));
    let left = ["100.0", "100.2", "100.3", "100.4", "100.5"];
    assert_eq!(lines(&["--motor", "wheel-front-left"]), at(&left));
    assert_eq!(lines(&["--motor", "Wheel front l"]), at(&left));
    assert_eq!(lines(&["--motor", "3"]), at(&["100.3", "101.0"]));
    assert_eq!(lines(&["--from", "0.3", "--to", "0.4"]), at(&["100.3", "100.4"]));
    assert_eq!(lines(&["--changes"]), at(&["100.0", "100.1", "100.3", "100.4", "101.0"]));
    let both = ["--changes", "--motor", "wheel-front-left", "--from", "0.2"];
    assert_eq!(lines(&both), at(&["100.2", "100.3", "100.4"]));
    let json = json(&with_input(&["-", "--json", "--motor", "3"], log.as_bytes()));
    assert_eq!(json["frames"].as_array().unwrap().len(), 2);
    assert_eq!(json["summary"]["frames"], 7);
    for (wrong, why) in [
        (["--motor", "leg"], "there is no such motor; there are: wheel front left"),
        (["--from", "soon"], "must be a number of seconds, 0 or more"),
        (["--to", "-1"], "unexpected argument"),
    ] {
        let output = with_input(&["-", wrong[0], wrong[1]], log.as_bytes());
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(why), "{wrong:?}: {}", text(&output.stderr));
    }
    // Times since power-on have no zeros of a date.
    let output = with_input(&["-"], b"(0000000000.000567) can0 201#0100000000000000\n");
    assert!(text(&output.stdout).trim_start().starts_with("0.000567 "), "{}", text(&output.stdout));
}
