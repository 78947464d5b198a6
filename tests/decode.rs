//! `rc10 decode` as somebody with a capture uses it: the command itself, on whole logs.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, Micros};
use rc10_cli::candump;
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

/// What the capture shows over two seconds: each rotor's speed, summed up, is the way it turned.
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
