//! `rc10 decode`: a candump log in words.

use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use rc10_time::Micros;

use crate::decode::filter::{Filter, Wanted};
use crate::decode::print::Printer;
use crate::decode::{BusOfChannel, Decoder, Summary, excerpt, known_on};
use crate::files::{is_record, open, unreadable};
use crate::formats::candump::{Numbered, Reader};
use crate::world::robot::Robot;

/// Arguments of `rc10 decode`.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(after_help = HELP)]
pub struct DecodeArgs {
    /// A log of candump (file or console form) or of python-can; `-` reads standard input
    pub file: PathBuf,
    /// Which of the robot's buses an interface is; canN is bus N+1 unless told. Repeatable
    #[arg(long = "bus", value_name = "CHANNEL=NUMBER")]
    pub buses: Vec<BusOfChannel>,
    #[command(flatten)]
    pub(crate) wanted: Wanted,
    /// Print one JSON object, { "frames": [..], "summary": {..} }, instead of text
    #[arg(long)]
    pub json: bool,
}

const HELP: &str = "\
Angles, speeds and currents are those of the output shaft, counted the way the robot counts: a
motor that is mounted mirrored has its signs turned. Which motor is where stands in the robot's
table of motors. Standard error has the lines that cannot be read, interfaces that are no bus of the
robot, and those of --bus that never came.

What is no plain setpoint or measurement has a name of its own: DAMIAO_DISABLE,
DAMIAO_READ_REGISTER, LK_OFF, ODRIVE_ASK_CURRENTS, VESC_PING. Answers to requests count as feedback.

With --json each frame is a line of its own, written while the log is read:
  feedback   {\"line\", \"time_us\", \"channel\", \"bus\", \"direction\", \"kind\": \"feedback\", \"motor\", \"model\",
             \"id\", \"angle_deg\", \"total_angle_deg\", \"speed_rpm\", \"current_a\", \"torque_nm\",
             \"temperature_c\", \"raw\": {\"angle\", \"rpm\", \"current\", \"temperature\"}}
  command    {.., \"kind\": \"command\", \"frame\", \"lanes\": [{\"lane\", \"raw\", \"motor\", \"model\", \"id\",
             \"current_a\" or \"voltage_percent\", \"beyond_full_scale\"}]}; the lane of a command that no
             motor takes has only \"lane\" and \"raw\"
  message    {.., \"kind\": \"message\", \"frame\", \"motor\", \"model\", \"id\", \"message\", \"from_device\",
             \"signals\": [{\"signal\", \"value\", \"unit\", \"name\"}]}: a frame of a motor of another vendor
             that is sent to several, if motor is null
  unasked    {.., \"kind\": \"unasked\", \"frame\", \"motor\"}: an answer to a request, without a name
  malformed  {.., \"kind\": \"malformed\", \"frame\", \"motor\", \"error\"}
Unknown frames are only counted, in the summary. What a line does not tell is null.

Filters leave frames out of the lines, not out of the sums; together they must all fit.

Examples:
  rc10 decode capture.log
  rc10 decode capture.log --motor wheel-front-left --from 1.5 --to 2 --changes
  rc10 decode capture.log --bus can0=2 --bus slcan0=3
  candump can0 | rc10 decode -

Exit code 0: every line was read; 1: some were broken; 2: the file cannot be read.";

/// Prints what a log of the robot's buses says to `out`, and its broken lines and unknown
/// interfaces to `err`; returns whether there were broken lines. Fails if the file cannot be read;
/// a bus or an interface is given twice, or the robot has no such bus; the robot is not as
/// described; or an output fails (an [`io::Error`], so that a closed pipe can be told apart).
pub fn decode(
    args: &DecodeArgs,
    robot: Robot<'_>,
    out: &mut dyn Write,
    err: &mut dyn Write,
) -> anyhow::Result<bool> {
    if args.file == Path::new("-") {
        return decode_log(io::stdin().lock(), args, robot, out, err);
    }
    let is_record = args.file.is_file() && is_record(&args.file)?;
    ensure!(!is_record, "{}: this is a record: rc10 report or rc10 csv", args.file.display());
    decode_log(BufReader::new(open(&args.file)?), args, robot, out, err)
}

fn decode_log(
    source: impl BufRead,
    args: &DecodeArgs,
    robot: Robot<'_>,
    out: &mut dyn Write,
    err: &mut dyn Write,
) -> anyhow::Result<bool> {
    let (robot, buses, _) = robot.into_buses()?;
    let mut filter = Filter::new(&args.wanted, &robot)?;
    let messages = (1..=robot.buses).map(|bus| known_on(&robot, bus)).collect();
    let mut decoder = Decoder { robot: &robot, messages, buses, newest: Micros::ZERO };
    let mut summary = Summary::new(&args.buses, robot.buses)?;
    let mut printer = Printer::new(out, args.json, &robot)?;
    let mut log = Reader::new(source);
    while let Some(Numbered { number, text, line }) =
        log.next_line().with_context(|| unreadable(&args.file))?
    {
        summary.lines += 1;
        match line {
            Ok(None) => {}
            Ok(Some(line)) => {
                if let Some(hint) = summary.greet(line.channel) {
                    writeln!(err, "{hint}")?;
                }
                if let Some((bus, meaning)) = summary.count(&mut decoder, &line) {
                    let body = printer.body(&line, &meaning);
                    if filter.takes(&line, &meaning, &body) {
                        printer.frame(number, &line, bus, &meaning, &body)?;
                    }
                }
                // The bus may be watched live.
                if args.file == Path::new("-") {
                    printer.out.flush()?;
                }
            }
            Err(error) => {
                summary.broken_lines += 1;
                writeln!(err, "line {number}: {error}: {}", excerpt(text))?;
            }
        }
    }
    printer.finish(&summary, &decoder)?;
    for hint in summary.silent() {
        writeln!(err, "{hint}")?;
    }
    Ok(summary.broken_lines > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::MOST_IDS;
    use serde_json::{Value, json};

    struct Output {
        text: String,
        errors: String,
        broken: bool,
    }

    fn run(log: &[u8], buses: &[&str], json: bool) -> anyhow::Result<Output> {
        let buses = buses.iter().map(|bus| bus.parse().unwrap()).collect();
        let args =
            DecodeArgs { file: PathBuf::from("test.log"), buses, json, ..DecodeArgs::default() };
        let (mut out, mut err) = (Vec::new(), Vec::new());
        let broken = decode_team(log, &args, &mut out, &mut err)?;
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Ok(Output { text: text(out), errors: text(err), broken })
    }

    fn decode_team(
        log: &[u8],
        args: &DecodeArgs,
        out: &mut dyn Write,
        err: &mut dyn Write,
    ) -> anyhow::Result<bool> {
        let ports = team::Ports::new();
        let io = team::Shared::new(&ports);
        let mut motors = team::Motors::new();
        let buses = motors.start(&io.switch)?.buses;
        decode_log(log, args, crate::tests::robot(&io, buses), out, err)
    }

    fn frames(log: &str) -> Vec<Value> {
        let output = run(log.as_bytes(), &[], true).unwrap();
        assert_eq!(output.errors, "");
        let mut object: Value = serde_json::from_str(&output.text).unwrap();
        serde_json::from_value(object["frames"].take()).unwrap()
    }

    fn summary(log: &[u8], buses: &[&str]) -> Value {
        let output = run(log, buses, true).unwrap();
        serde_json::from_str::<Value>(&output.text).unwrap()["summary"].take()
    }

    /// 0x0100 of 8192 counts, 3591 rotor rpm, 0x2000 of 16384 for 20 A, 35 degrees.
    #[test]
    fn feedback_is_that_of_the_output_shaft_the_way_the_robot_counts() {
        let frames = frames(
            "(1732150000.000150) can0 201#01000E0720002300 R\n\
             (1732150000.000151) can0 202#01000E0720002300 R\n",
        );
        let [forward, mirrored] = frames.as_slice() else { panic!("{frames:?}") };
        assert_eq!(forward["time_us"], 1_732_150_000_000_150_u64);
        assert_eq!(forward["motor"], "wheel front left");
        assert_eq!((&forward["model"], &forward["id"]), (&json!("M3508"), &json!(1)));
        assert_eq!((&forward["speed_rpm"], &forward["current_a"]), (&json!(187.0), &json!(10.0)));
        assert_eq!(forward["temperature_c"], 35.0);
        assert_eq!(forward["direction"], "received");
        let raw = json!({ "angle": 256, "rpm": 3591, "current": 8192, "temperature": 35 });
        assert_eq!(forward["raw"], raw);
        // 360 degrees / 32 at the rotor.
        let angle = forward["angle_deg"].as_f64().unwrap();
        assert!((angle - 11.25 * 187.0 / 3591.0).abs() < 1e-5, "{angle}");
        assert_eq!(mirrored["motor"], "wheel front right");
        assert_eq!(
            (&mirrored["speed_rpm"], &mirrored["current_a"]),
            (&json!(-187.0), &json!(-10.0))
        );
    }

    #[test]
    fn turns_are_counted_over_frames() {
        // A rotor that steps a quarter turn forward each millisecond, five turns in all.
        let line = |step: u32| {
            format!("(0.{:03}000) can1 203#{:04X}3A9800000000\n", step, step % 4 * 2048)
        };
        let frames = frames(&(0..=20).map(line).collect::<String>());
        let total = frames[20]["total_angle_deg"].as_f64().unwrap();
        assert!((total - 5.0 * 360.0 / 36.0).abs() < 1e-5, "{total}");
        assert_eq!(
            (&frames[20]["model"], &frames[20]["temperature_c"]),
            (&json!("M2006"), &Value::Null)
        );
    }

    #[test]
    fn commands_are_those_of_the_motors_of_their_bus() {
        let frames = frames(
            "(0.0) can0 200#20002000E0007FFF T\n\
             (0.0) can1 200#0000000013880001\n\
             (0.0) can1 1FF#0000C35000000000\n\
             (0.0) can1 1FE#2000000000000000\n\
             (0.0) can2 2FF#0000000000000000\n",
        );
        let lanes = |index: usize| frames[index]["lanes"].clone();
        assert_eq!(frames[0]["direction"], "sent");
        assert_eq!(lanes(0)[0]["current_a"], 10.0);
        assert_eq!(lanes(0)[1]["current_a"], -10.0, "mirrored");
        assert_eq!(lanes(0)[2]["current_a"], -10.0);
        assert_eq!(lanes(0)[3]["beyond_full_scale"], true);
        assert_eq!(lanes(1)[0]["motor"], "feeder");
        assert_eq!(lanes(1)[0]["current_a"], 5.0);
        assert_eq!(lanes(1)[1], json!({ "lane": 4, "raw": 1 }));
        assert_eq!(
            (&lanes(2)[0]["motor"], &lanes(2)[0]["raw"]),
            (&json!("gimbal pitch"), &json!(-15536))
        );
        assert_eq!(lanes(2)[0]["voltage_percent"], -62.144);
        assert_eq!(
            (&lanes(3)[0]["motor"], &lanes(3)[0]["current_a"]),
            (&json!("gimbal yaw"), &json!(1.5))
        );
        assert_eq!(lanes(4), json!([]));
    }

    const MIXED: &[u8] = b"# a comment\r\n\
        (1.0) can0 201#0000000000000000\r\n\
        \r\n\
        (1.0) can0 201#00\r\n\
        (1.0) can0 201#FFFF000000000000\r\n\
        (1.0) can0 200#00\r\n\
        nothing\x1B[2J\xFF\r\n\
        (1.0) can0 00000201#00\r\n\
        (1.0) can0 201#R8\r\n\
        (1.0) can0 201#0\r\n\
        (1.0) can5 201#0000000000000000\r\n\
        (1.0) can0 200#0000000000000000\r\n";

    #[test]
    fn every_line_is_counted_once() {
        let summary = summary(MIXED, &[]);
        for (name, count) in [
            ("lines", 12),
            ("broken_lines", 2),
            ("frames", 8),
            ("feedback", 1),
            ("commands", 1),
            ("malformed", 3),
            ("unknown", 3),
        ] {
            assert_eq!(summary[name], count, "{name}");
        }
        let unknown = |channel: &str, id: &str, remote: bool| json!({ "channel": channel, "id": id, "remote": remote, "frames": 1 });
        // As in arbitration: the first 11 bits of the extended one are zero.
        let all = [
            unknown("can0", "00000201", false),
            unknown("can0", "201", true),
            unknown("can5", "201", false),
        ];
        assert_eq!(summary["unknown_ids"], Value::from(all.to_vec()));
    }

    #[test]
    fn broken_lines_are_named_and_cannot_speak_to_the_terminal() {
        let output = run(MIXED, &[], false).unwrap();
        assert!(output.broken);
        let lines: Vec<&str> = output.errors.lines().collect();
        assert_eq!(lines.len(), 3, "{lines:?}");
        assert!(
            lines[0].starts_with("line 7: it is not UTF-8 text: \"nothing\\u{1b}[2J"),
            "{lines:?}"
        );
        assert!(lines[1].starts_with("line 10: odd number of hex digits"), "{lines:?}");
        assert!(lines[2].starts_with("can5: no bus of the robot"), "{lines:?}");
        assert!(
            output.text.contains("MALFORMED: 1 data bytes instead of 8: 201#00"),
            "{}",
            output.text
        );
        assert!(!output.text.contains('\x1B'));
    }

    #[test]
    fn an_interface_is_the_given_bus() {
        let log = b"(1.0) slcan0 203#0000000000000000\n(1.0) can1 203#0000000000000000\n";
        let told = summary(log, &["slcan0=2"]);
        let channels = |summary: &Value| summary["channels"].clone();
        // Otherwise the turns of two motors would be mixed up in one.
        let expected = json!([
            { "channel": "can1", "bus": null, "frames": 1 },
            { "channel": "slcan0", "bus": 2, "frames": 1 },
        ]);
        assert_eq!(channels(&told), expected);
        assert_eq!((&told["feedback"], &told["motors"][2]["feedback"]), (&json!(1), &json!(1)));
        let stock = summary(log, &[]);
        assert_eq!(channels(&stock)[0]["bus"], 2);
        assert_eq!(channels(&stock)[1]["bus"], Value::Null);
    }

    #[test]
    fn interfaces_that_are_no_bus_and_buses_that_never_come_are_said() {
        let log = b"(1.0) can7 203#0000000000000000\n(1.1) can7 203#0000000000000000\n\
                    (1.2) can0 203#0000000000000000\n";
        let said = |buses: &[&str]| run(log, buses, true).unwrap().errors;
        let stray = "can7: no bus of the robot (1 to 3), its frames are not decoded; ";
        assert_eq!(said(&[]), format!("{stray}--bus can7=1 makes it one\n"));
        let silent = "--bus foo=1: no frame came on foo; the log has can0, can7\n";
        assert_eq!(
            said(&["foo=1"]),
            format!(
                "{stray}--bus can7=2 makes it one\n\
                 can0: no bus of the robot (1 to 3), its frames are not decoded; --bus can0=2 makes \
                 it one\n{silent}"
            )
        );
        assert_eq!(said(&["can7=2"]), "");
        let nothing = run(b"", &["foo=1"], false).unwrap().errors;
        assert_eq!(nothing, "--bus foo=1: no frame came on foo; the log has no frames\n");
    }

    #[test]
    fn wrong_buses_are_refused_in_words() {
        let parse = |text: &str| text.parse::<BusOfChannel>();
        assert_eq!(parse("can0=3"), Ok(BusOfChannel { channel: "can0".to_owned(), bus: 3 }));
        for text in ["can0", "=1", "can0=", "can0=0", "can0=x", "can0=256"] {
            assert!(parse(text).is_err(), "{text}");
        }
        let error = |buses: &[&str]| run(b"", buses, false).map(|_| ()).unwrap_err().to_string();
        assert_eq!(error(&["can0=4"]), "--bus can0=4: the robot has buses 1 to 3");
        assert_eq!(error(&["can0=1", "can0=2"]), "--bus: can0 is given twice");
        assert_eq!(error(&["can0=1", "can1=1"]), "--bus: can0 and can1 cannot both be bus 1");
    }

    #[test]
    fn an_empty_log_says_so() {
        let output = run(b"", &[], false).unwrap();
        assert!(!output.broken && output.text.starts_with("The log is empty."), "{}", output.text);
        assert_eq!(summary(b"", &[])["lines"], 0);
        assert!(run(b"# x\n", &[], false).unwrap().text.starts_with("The log has no frames."));
    }

    #[test]
    fn identifiers_without_end_do_not_fill_the_memory() {
        let log: String = (0..2000).map(|id| format!("(1.0) can0 {id:08X}#\n")).collect();
        let summary = summary(log.as_bytes(), &[]);
        assert_eq!(summary["unknown"], 2000);
        assert_eq!(summary["unknown_ids"].as_array().map(Vec::len), Some(MOST_IDS));
        assert_eq!(summary["unknown_of_further_ids"], 1000);
    }

    /// A pipe whose reader has gone.
    struct Closed;

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_closed_pipe_is_recognised() {
        let file = PathBuf::from("test.log");
        let args = DecodeArgs { file, json: true, ..DecodeArgs::default() };
        let error = decode_team(MIXED, &args, &mut Closed, &mut io::sink()).unwrap_err();
        let kind = error.downcast_ref::<io::Error>().map(io::Error::kind);
        assert_eq!(kind, Some(io::ErrorKind::BrokenPipe));
    }
}
