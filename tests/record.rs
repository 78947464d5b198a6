//! Records: the report of a record is that of its run, in every figure; and what is no record is refused
//! in words.
#![allow(clippy::cast_possible_truncation, reason = "files of a test are short")]

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::common::scratch::Scratch;
use rc10_cli::record::{Heading, RecordWriter, replay};
use rc10_cli::run::simulate::{heading, simulate_into};
use rc10_cli::show::figures::{Figures, to_json};
use rc10_cli::show::report::report;
use rc10_cli::world::robot::Robot;
use rc10_cli::{CommandLine, Motor, Place, Recording};
use rc10_motor::dji::{Config, M3508};
use rc10_sim::Random;
use rc10_time::Micros;

/// Hands the team's robot over.
fn of_team<R>(take: impl FnOnce(Robot<'_>) -> R) -> R {
    let ports = team::Ports::new();
    let (shared, mut motors) = (team::Shared::new(&ports), team::Motors::new());
    take(rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap())
}

/// Hands the mixed robot over.
fn of_mixed<R>(take: impl FnOnce(Robot<'_>) -> R) -> R {
    let ports = mixed::Ports::new();
    let (shared, mut motors) = (mixed::Shared::new(&ports), mixed::Motors::new());
    take(rc10_cli::robot_of::<mixed::Robot>(&shared, &mut motors).unwrap())
}

/// Hands the robot of `examples/omni` over.
fn of_omni<R>(take: impl FnOnce(Robot<'_>) -> R) -> R {
    let ports = omni::Ports::new();
    let (shared, mut motors) = (omni::Shared::new(&ports), omni::Motors::new());
    take(rc10_cli::robot_of::<omni::Robot>(&shared, &mut motors).unwrap())
}

/// A run, written to a record.
fn run(
    mut robot: Robot<'_>,
    path: &Path,
    faults: &[&str],
    mistakes: &[&str],
    length: Micros,
) -> Recording {
    let faults: Vec<_> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    let mistakes: Vec<_> = mistakes.iter().map(|mistake| mistake.parse().unwrap()).collect();
    robot.set_faults(&faults).unwrap();
    robot.set_mistakes(&mistakes).unwrap();
    robot.set_no_logs(true);
    let record = RecordWriter::new(path, true, &heading(&robot, 7)).unwrap();
    let recording = simulate_into(robot, 7, length, Some(record)).unwrap();
    let mistakes = mistakes.iter().map(ToString::to_string).collect();
    Recording { faults, mistakes, ..recording }
}

/// All that is shown of a recording.
fn shown(recording: &Recording) -> [String; 2] {
    let figures = Figures::of(recording);
    let json = to_json(recording, &figures, None);
    // Who made it and when is the record's alone.
    let page = report(recording, &figures);
    let (head, rest) = page.split_once("<p class=\"facts\">robot").unwrap_or((&page, ""));
    let rest = rest.split_once("</code></p>\n").map_or(rest, |(_, rest)| rest);
    [serde_json::to_string_pretty(&json).unwrap(), format!("{head}{rest}")]
}

#[track_caller]
fn assert_same(run: &Recording, (replayed, cut): &(Recording, Option<String>)) {
    assert_eq!(*cut, None);
    let ([json, page], [json_again, page_again]) = (shown(run), shown(replayed));
    let different = json.lines().zip(json_again.lines()).find(|(one, other)| one != other);
    assert!(json == json_again, "{different:?}");
    let at = page.bytes().zip(page_again.bytes()).position(|(one, other)| one != other);
    let around = |text: &str| {
        at.map(|at| {
            String::from_utf8_lossy(&text.as_bytes()[at.saturating_sub(300)..at + 50]).into_owned()
        })
    };
    assert!(page == page_again, "{:?}\n{:?}", around(&page), around(&page_again));
}

#[test]
fn the_report_of_a_record_is_that_of_its_run() {
    let folder = Scratch::new("same");
    let path = folder.join("run.mcap");
    let seconds = |seconds: u64| Micros::from_millis(seconds * 1000);
    for (faults, mistakes, length) in [
        (vec![], vec![], seconds(10)),
        (vec!["remote-lost@1s..1.4s", "remote-lost@2s", "power:1@0.5s..0.7s"], vec![], seconds(3)),
        (vec!["cut:2@0.3s..0.9s"], vec!["direction:wheel-front-left"], Micros::from_millis(1503)),
        (vec![], vec!["gear:lift-front-left=27", "radius:x1.1"], seconds(2)),
    ] {
        let run = of_team(|robot| run(robot, &path, &faults, &mistakes, length));
        assert_eq!(run.length, length);
        assert_same(
            &run,
            &of_team(|robot| replay(&mut File::open(&path).unwrap(), robot)).unwrap(),
        );
    }
    let run_2 = of_mixed(|robot| run(robot, &path, &["cut:L1@0.5s..0.6s"], &[], seconds(2)));
    assert!(run_2.lines[0].traffic.timeouts > 0);
    assert_same(&run_2, &of_mixed(|robot| replay(&mut File::open(&path).unwrap(), robot)).unwrap());
    let run_3 = of_omni(|robot| run(robot, &path, &["remote-lost@1s"], &[], seconds(3)));
    assert_same(&run_3, &of_omni(|robot| replay(&mut File::open(&path).unwrap(), robot)).unwrap());
    // The file alone is there, and nothing beside it.
    assert_eq!(fs::read_dir(&*folder).unwrap().count(), 1);
}

fn refused(bytes: &[u8]) -> String {
    match of_team(|robot| replay(&mut Cursor::new(bytes), robot)) {
        Ok((recording, cut)) => format!("{} us, {cut:?}", recording.length.get()),
        Err(error) => format!("{error:#}"),
    }
}

#[test]
fn what_is_no_record_of_this_robot_is_refused_in_words() {
    let folder = Scratch::new("refused");
    let path = folder.join("run.mcap");
    for bytes in [&b""[..], b"(0.0) can0 201#00\n", b"\x89MCAP0\r\n"] {
        assert!(refused(bytes).starts_with("it is no MCAP file: "), "{}", refused(bytes));
    }
    let mut empty = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    empty.finish().unwrap();
    let said = refused(&empty.into_inner().into_inner());
    assert_eq!(said, "it is no record of a robot: it has no `rc10` metadata");
    of_mixed(|robot| run(robot, &path, &[], &[], Micros::from_millis(20)));
    let said = refused(&fs::read(&path).unwrap());
    assert_eq!(said, "it is of another robot: it has no motor `wheel front left`");
    of_team(|robot| run(robot, &path, &[], &[], Micros::from_millis(20)));
    let mut newer = fs::read(&path).unwrap();
    // The value follows its name and four bytes of length.
    let at = newer.windows(7).position(|word| word == b"version").unwrap() + 11;
    newer[at] = b'3';
    assert_eq!(refused(&newer), "its layout has version 3, and this rc10 reads version 2");
    of_team(|robot| {
        let mut description = robot.description().clone();
        description.motors[0] =
            Motor::new("wheel front left", Place::Bus(1), Config::new(&M3508, 5).device());
        let heading = Heading { description: &description, ..heading(&robot, 1) };
        let record = RecordWriter::new(&path, true, &heading).unwrap();
        simulate_into(robot, 1, Micros::from_millis(5), Some(record)).unwrap();
    });
    let other = fs::read(&path).unwrap();
    assert_eq!(
        refused(&other),
        "it is of another robot: its `wheel front left` is M3508 id 5, and this robot's is M3508 id 1"
    );
}

/// What there is of it is told, and where it ends; nothing panics.
#[test]
fn a_record_that_is_cut_off_or_damaged_is_read_as_far_as_it_goes() {
    let folder = Scratch::new("cut");
    let path = folder.join("run.mcap");
    of_team(|robot| run(robot, &path, &[], &[], Micros::from_millis(1000)));
    let good = fs::read(&path).unwrap();
    let (half, cut) =
        of_team(|robot| replay(&mut Cursor::new(&good[..good.len() / 2]), robot)).unwrap();
    assert!(cut.is_some());
    assert!((Micros::from_millis(100)..Micros::from_millis(1000)).contains(&half.length));
    assert!(half.motors.iter().all(|track| !track.samples.is_empty()));
    // A byte of a message in the middle of a chunk: its checksum tells.
    let told = [3, 4, 5].map(|part| {
        let mut damaged = good.clone();
        damaged[good.len() / part] ^= 1;
        of_team(|robot| replay(&mut Cursor::new(&damaged), robot)).unwrap().1.unwrap_or_default()
    });
    // One of them may be of the times in a chunk's head, which a reader of all has no use for.
    let by_crc = told.iter().filter(|why| why.to_lowercase().contains("crc")).count();
    assert!(by_crc >= 2, "{told:?}");
    for part in 0..60 {
        let _ = refused(&good[..good.len() * part / 60]);
        let mut damaged = good.clone();
        let at = (part * 7919 + 13) % 9000;
        damaged[at] ^= 0x5A;
        let _ = refused(&damaged);
    }
}

#[test]
fn a_record_that_cannot_be_written_leaves_nothing_behind() {
    let folder = Scratch::new("nothing");
    let nowhere = folder.join("missing").join("run.mcap");
    let error = of_team(|robot| {
        RecordWriter::new(&nowhere, false, &heading(&robot, 1)).err().unwrap().to_string()
    });
    assert!(error.starts_with("cannot write ") && error.ends_with("run.mcap"), "{error}");
    let error = of_team(|robot| {
        RecordWriter::new(&folder, false, &heading(&robot, 1)).err().unwrap().to_string()
    });
    assert!(error.ends_with("it is a folder"), "{error}");
    let path = folder.join("run.mcap");
    let error = of_team(|robot| {
        let mut description = robot.description().clone();
        description.motors[1].label = "wheel_front left";
        let heading = Heading { description: &description, ..heading(&robot, 1) };
        format!("{:#}", RecordWriter::new(&path, true, &heading).err().unwrap())
    });
    let why = "`wheel front left` and `wheel_front left` are one topic, /motors/wheel_front_left";
    assert!(error.contains(why), "{error}");
    assert_eq!(fs::read_dir(&*folder).unwrap().count(), 0);
}

/// A file that is there is left as it is, unless somebody says `--force`; a record is in its place from the
/// beginning, and what is in it stays when its program ends early.
#[test]
fn a_record_is_not_lost_and_takes_no_place_of_another() {
    let folder = Scratch::new("kept");
    let path = folder.join("run.mcap");
    let named = path.display().to_string();
    fs::write(&path, b"older").unwrap();
    let out = folder.join("out").display().to_string();
    let run = ["run", "--seconds", "1", "--out", &out, "--no-logs", "--record", &named];
    let error = command(&run).unwrap_err();
    assert!(error.starts_with(&format!("{named} is there already: --force")), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"older");
    command(&[&run[..], &["--force"]].concat()).unwrap();
    let whole = of_team(|robot| replay(&mut File::open(&path).unwrap(), robot)).unwrap();
    assert_eq!((whole.0.length, whole.1), (Micros::from_millis(1000), None));
    // Its program ends while it is written.
    let early = folder.join("early.mcap");
    of_team(|robot| drop(RecordWriter::new(&early, false, &heading(&robot, 1)).unwrap()));
    let (recording, cut) =
        of_team(|robot| replay(&mut File::open(&early).unwrap(), robot)).unwrap();
    assert_eq!((recording.length, cut), (Micros::ZERO, Some("its end is missing".into())));
}

/// A record with other times, in nanoseconds, and of this source.
fn retold(good: &[u8], source: &str, mut time: impl FnMut(u64) -> u64) -> Vec<u8> {
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    for record in mcap::read::ChunkFlattener::new(good).unwrap() {
        match record.unwrap() {
            mcap::records::Record::Metadata(mut it) => {
                it.metadata.insert("source".into(), source.into());
                writer.write_metadata(&it).unwrap();
            }
            mcap::records::Record::DataEnd(_) => break,
            _ => {}
        }
    }
    for message in mcap::MessageStream::new(good).unwrap() {
        let mut message = message.unwrap();
        message.log_time = time(message.log_time);
        message.data = Cow::Owned(message.data.into_owned());
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// A cable that is out over night: what comes after it follows what was before, and the report says so.
#[test]
fn a_gap_is_left_out_and_told() {
    const HOURS: u64 = 10 * 3600 * 1_000_000_000;
    let folder = Scratch::new("gap");
    let path = folder.join("run.mcap");
    of_team(|robot| run(robot, &path, &[], &[], Micros::from_millis(4000)));
    let good = fs::read(&path).unwrap();
    let told = |source, time: &dyn Fn(u64) -> u64| {
        let bytes = retold(&good, source, time);
        let (recording, _) = of_team(|robot| replay(&mut Cursor::new(bytes), robot)).unwrap();
        let gaps: Vec<_> = recording.gaps.iter().map(|gap| (gap.at, gap.to_string())).collect();
        let samples = recording.motors[0].samples.len();
        assert!((395..=405).contains(&samples), "{samples}");
        assert!(recording.length <= Micros::from_millis(4020), "{:?}", recording.length);
        let json = to_json(&recording, &Figures::of(&recording), None).to_string();
        assert!(!json.contains("missed") && !json.contains("answers twice"), "{json}");
        gaps
    };
    let second = |time: u64| time / 1_000_000_000;
    let at = |millis| Micros::from_millis(millis);
    for source in ["robot", "simulation"] {
        assert_eq!(told(source, &|time| time), []);
        let gaps = told(source, &|time| if second(time) < 2 { time } else { time + HOURS });
        assert_eq!(gaps, [(at(1999), "a gap of 36000.001 s".into())]);
        // One time alone is wrong, far forth or back.
        for wrong in [1 << 63, u64::MAX] {
            let gaps = told(source, &|time| if time == 2_000_000_000 { wrong } else { time });
            assert_eq!(gaps.len(), 2, "{gaps:?}");
            assert!(gaps[1].1.starts_with("the time goes back by "), "{gaps:?}");
        }
        let gaps = told(source, &|time| if second(time) < 2 { time + HOURS } else { time });
        assert_eq!(gaps.len(), 2, "{gaps:?}");
    }
}

/// Damages a file at random.
fn mutated(good: &[u8], dice: &mut Random) -> Vec<u8> {
    let mut bytes = good.to_vec();
    // Half of them where the lengths are, and not in the numbers of the messages.
    let most = if dice.index(2) == 0 { good.len() } else { 6000 };
    let (at, length) = (dice.index(most), 1 + dice.index(400));
    let end = (at + length).min(bytes.len());
    match dice.index(6) {
        0 => bytes[at] ^= 1 << dice.index(8),
        1 => bytes.truncate(at),
        2 | 3 => {
            // A length, or a time: of all ones, or with its highest bit.
            let number = if dice.index(2) == 0 { [0xFF; 8] } else { [0, 0, 0, 0, 0, 0, 0, 0x80] };
            let end = (at + 8).min(bytes.len());
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
        4 => drop(bytes.drain(at..end)),
        _ => drop(bytes.splice(at..at, good[at..end].to_vec())),
    }
    bytes
}

/// The same without the checksums of its chunks, so that their content is looked at whatever it is.
fn unchecked(good: &[u8]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    let mut at = mcap::MAGIC.len();
    while at + 9 < bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == mcap::records::op::CHUNK {
            bytes[at + 9 + 24..at + 9 + 28].fill(0);
        }
        at += 9 + length;
    }
    bytes
}

/// Some hundred damaged files, half of them with no checksums that would tell: an error, or what can be read.
#[test]
fn no_damaged_record_does_harm() {
    let folder = Scratch::new("harm");
    let path = folder.join("run.mcap");
    of_team(|robot| run(robot, &path, &[], &[], Micros::from_millis(60)));
    let good = fs::read(&path).unwrap();
    let robot = retold(&good, "robot", |time| time);
    let seeds = [good.clone(), robot.clone(), unchecked(&good), unchecked(&robot)];
    let (mut dice, mut read, mut panics) = (Random::new(1), 0, Vec::new());
    for number in 0..700 {
        let bytes = mutated(&seeds[number % seeds.len()], &mut dice);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let replayed = of_team(|robot| replay(&mut Cursor::new(&bytes), robot));
            replayed.map(|(recording, _)| {
                // One change can make some seconds more of it.
                assert!(recording.length < Micros::from_millis(30_000), "{:?}", recording.length);
                drop(report(&recording, &Figures::of(&recording)));
            })
        }));
        match outcome {
            Ok(outcome) => read += usize::from(outcome.is_ok()),
            Err(_) => panics.push(number),
        }
    }
    assert!(panics.is_empty(), "{panics:?}");
    assert!((100..650).contains(&read), "{read} of 700 could be read");
}

/// What a file claims takes no memory: each is read by a program that may have 1 GB.
#[test]
#[cfg(target_os = "linux")]
fn what_a_file_claims_takes_no_memory() {
    let folder = Scratch::new("claims");
    let path = folder.join("run.mcap");
    of_team(|robot| run(robot, &path, &[], &[], Micros::from_millis(100)));
    let good = fs::read(&path).unwrap();
    let begin = |kind: u8, body: &[u8]| [mcap::MAGIC, &[kind], body, &[0; 100]].concat();
    let hours = |time: u64| if time < 50_000_000 { time } else { time + ((100 * 3600) << 30) };
    for (bytes, is_read) in [
        (retold(&good, "robot", hours), true),
        (retold(&good, "robot", |time| time ^ (time & 1_000_000) << 43), true),
        // Records, and a text, that are as long as can be.
        (begin(3, &[0xFF; 8]), false),
        (begin(6, &[0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0]), false),
        (begin(12, &[&[80, 0, 0, 0, 0, 0, 0, 0][..], &[0xFF; 4]].concat()), false),
    ] {
        fs::write(&path, bytes).unwrap();
        let limited = "ulimit -v 1000000; exec \"$0\" report \"$1\" --out \"$2\"";
        let output = std::process::Command::new("sh")
            .args(["-c", limited, env!("CARGO_BIN_EXE_rc10")])
            .args([&path, &folder.join("out")])
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(if is_read { 0 } else { 2 }), "{said}");
        assert!(!said.contains("panicked"), "{said}");
        assert!(!is_read || said.contains(" s at 0.0"), "{said}");
    }
}

/// Names that lead out of the folder, or that Windows keeps for itself; and letters for a terminal.
#[test]
fn names_of_a_foreign_file_do_no_harm() {
    let folder = Scratch::new("names");
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    for topic in [
        r"/..\..\x",
        "/../../y",
        "/CON",
        "nul",
        "/a.b",
        "/a_b",
        "/A_B",
        "/Com1",
        "/e\x1b[2J\u{9b}m",
    ] {
        let channel = writer.add_channel(0, topic, "json", &Default::default()).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, b"01234567text\0").unwrap();
    }
    writer.finish().unwrap();
    let path = folder.join("foreign.mcap");
    fs::write(&path, writer.into_inner().into_inner()).unwrap();
    let out = folder.join("csv");
    let named = [&path, &out].map(|path| path.display().to_string());
    let (_, said) = command(&["csv", &named[0], "--out", &named[1]]).unwrap();
    assert!(!said.contains(|letter: char| letter.is_control() && letter != '\n'), "{said:?}");
    let mut files: Vec<_> = fs::read_dir(&out)
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let wanted = [
        "A_B__.csv",
        "CON_.csv",
        "Com1_.csv",
        "______x.csv",
        "a_b.csv",
        "a_b_.csv",
        "e__2J_m.csv",
        "nul_.csv",
        "__-__-y.csv",
    ];
    let mut wanted = wanted.to_vec();
    wanted.sort();
    assert_eq!(files, wanted);
    assert_eq!(fs::read_dir(&*folder).unwrap().count(), 2);
    // What an interface is called.
    let log = folder.join("evil.log");
    fs::write(&log, "(1.0) \u{1b}]0;pwn\u{7} 201#0000000000000000\n").unwrap();
    let (_, said) = command(&["decode", &log.display().to_string()]).unwrap();
    assert!(!said.contains(['\u{1b}', '\u{7}']), "{said:?}");
}

/// The command line of the team's robot: exit code, and what it says; or why not.
fn command(arguments: &[&str]) -> Result<(u8, String), String> {
    let mut out = Vec::new();
    let arguments = ["rc10"].iter().chain(arguments);
    let done = of_team(|robot| CommandLine::parse(arguments).unwrap().run_to(robot, &mut out));
    let text = String::from_utf8(out).unwrap();
    done.map(|code| (code, text)).map_err(|error| format!("{error:#}"))
}

#[test]
fn the_commands_say_what_they_did() {
    let folder = Scratch::new("commands");
    let path = |name: &str| folder.join(name).display().to_string();
    let (record, out) = (path("a.mcap"), path("out"));
    let ran = command(&["run", "--seconds", "0.5", "--record", &record, "--out", &out]).unwrap();
    let (code, said) = command(&["report", &record, "--out", &path("report")]).unwrap();
    let body = |text: &str| {
        let lines = text.lines().skip(1).filter(|line| !line.starts_with("open"));
        lines.filter(|line| !line.starts_with("logs")).collect::<Vec<_>>().join("\n")
    };
    assert_eq!((code, body(&said)), (0, body(&ran.1)));
    assert!(said.starts_with(&format!("0.5 s of {record}, seed 1\n")), "{said}");
    assert!(folder.join("report/report.html").is_file());
    let (_, said) = command(&["csv", &record, "--out", &path("csv")]).unwrap();
    assert!(said.contains("     500 rows  ") && said.contains("motors-wheel_front_left.csv"));
    let table = fs::read_to_string(folder.join("csv/motors-wheel_front_left.csv")).unwrap();
    let lines: Vec<_> = table.lines().collect();
    assert!(lines[0].starts_with("time_s,target_kind,target,measured,link,"), "{}", lines[0]);
    assert_eq!(lines.len(), 501);
    assert!(lines.iter().all(|line| line.split(',').count() == 11));
    assert!(lines[500].starts_with("0.500000000,"), "{}", lines[500]);
    let events = fs::read_to_string(folder.join("csv/events.csv")).unwrap();
    assert!(events.starts_with("time_s,label\n0.000000000,switches down\n"), "{events}");
    let error = command(&["report", &path("none.mcap")]).unwrap_err();
    assert!(error.starts_with("cannot read "), "{error}");
    let error = command(&["csv", &path("out/bus1.log")]).unwrap_err();
    assert!(error.contains("bus1.log: it is no MCAP file"), "{error}");
}

/// The columns of a CSV file, and its rows by their milliseconds.
fn table(file: &Path) -> (String, BTreeMap<u64, Vec<f64>>) {
    let text = fs::read_to_string(file).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let number = |cell: &str| if cell.is_empty() { f64::NAN } else { cell.parse().unwrap() };
    let row = |line: &str| {
        let numbers: Vec<f64> = line.split(',').map(number).collect();
        ((numbers[0] * 1e3).round() as u64, numbers[1..].to_vec())
    };
    (head.to_owned(), rows.lines().map(row).collect())
}

/// One drive, recorded as it was simulated, and over the link: the same columns, and the same values but
/// for what the link rounds to 32 bits.
#[test]
fn both_records_of_a_drive_are_equal() {
    let folder = Scratch::new("both");
    let path = |name: &str| folder.join(name).display().to_string();
    let [run, live] = [path("run.mcap"), path("live.mcap")];
    command(&["run", "--seconds", "4", "--record", &run, "--out", &path("out")]).unwrap();
    command(&["record", "--sim", "--seconds", "3", "--output", &live]).unwrap();
    for (record, out) in [(run, path("run")), (live, path("live"))] {
        command(&["csv", &record, "--out", &out]).unwrap();
    }
    let error = |one: f64, other: f64| match (one.is_nan(), other.is_nan()) {
        (true, true) => 0.0,
        (false, false) => (one - other).abs() / one.abs().max(1.0),
        _ => f64::INFINITY,
    };
    let worst = |told: &BTreeMap<u64, Vec<f64>>, seen: &BTreeMap<u64, Vec<f64>>, shift: u64| {
        let rows = told.iter().map(|(at, row)| (row, seen.get(&(at + shift))));
        let pairs = rows.flat_map(|(row, seen)| row.iter().zip(seen.into_iter().flatten()));
        pairs.map(|(one, other)| error(*one, *other)).fold(0.0, f64::max)
    };
    // A record over the link begins with its first sample.
    let names = |name: &str| (folder.join("live").join(name), folder.join("run").join(name));
    let (told, seen) = names("motors-wheel_front_left.csv");
    let ((_, told), (_, seen)) = (table(&told), table(&seen));
    let shifts = (0..900).map(|shift| (worst(&told, &seen, shift), shift));
    let (_, shift) = shifts.min_by(|one, other| one.0.total_cmp(&other.0)).unwrap();
    let mut tables = 0;
    for file in fs::read_dir(folder.join("live")).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap();
        let (told, seen) = names(&name);
        let ((columns, told), (expected, seen)) = (table(&told), table(&seen));
        assert_eq!(columns, expected, "{name}");
        let worst = worst(&told, &seen, shift);
        assert!(told.len() >= 29 && worst < 2e-7, "{name}: {worst}, {shift} ms later");
        tables += 1;
    }
    // Eleven motors often and seldom, three buses, the robot, and its signals.
    assert!(tables > 26, "{tables}");
}

/// Of the logs of a run there is what its motors said: the same counters, speeds and loads.
#[test]
fn a_capture_makes_a_report_of_what_was_on_the_wires() {
    let folder = Scratch::new("capture");
    let path = |name: &str| folder.join(name).display().to_string();
    let json = |arguments: &[&str]| -> serde_json::Value {
        serde_json::from_str(&command(arguments).unwrap().1).unwrap()
    };
    let out = path("out");
    let run = json(&["run", "--seconds", "3", "--json", "--out", &out]);
    let logs = [1, 2, 3].map(|bus| path(&format!("out/bus{bus}.log")));
    let report = path("report");
    let [one, two, three] = logs.each_ref().map(String::as_str);
    let heard = json(&["report", three, one, two, "--json", "--out", &report]);
    for (motor, told) in
        heard["motors"].as_array().unwrap().iter().zip(run["motors"].as_array().unwrap())
    {
        assert_eq!(motor["motor"], told["motor"]);
        let received = [motor, told].map(|motor| motor["received"].as_i64().unwrap());
        // A frame may be on its way when the run ends.
        assert!((received[0] - received[1]).abs() <= 1, "{motor}");
        assert_eq!(motor["link"], "Online");
    }
    assert_eq!(heard["motors"].as_array().unwrap().len(), 11);
    for (bus, told) in
        heard["buses"].as_array().unwrap().iter().zip(run["buses"].as_array().unwrap())
    {
        assert_eq!(bus["frames"], told["frames"]);
        let load = [bus, told].map(|bus| bus["load_percent"].as_f64().unwrap());
        assert!((load[0] - load[1]).abs() < 0.1, "{load:?}");
    }
    assert_eq!(
        heard["problems"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|one| one["severity"] == "problem")
            .count(),
        0
    );
    // One bus alone, under another name, by the clock of a calendar: the others are not missed.
    let log = fs::read_to_string(one).unwrap();
    let later: String = log
        .lines()
        .map(|line| line.replace("can0", "slcan7").replace("(0000000000.", "(1732150000.") + "\n")
        .filter(|line| line.starts_with("(1732150000."))
        .collect();
    let other = path("later.log");
    fs::write(&other, later).unwrap();
    let alone = json(&["report", &other, "--bus", "slcan7=1", "--json", "--out", &report]);
    let labels: Vec<_> =
        alone["motors"].as_array().unwrap().iter().map(|one| &one["motor"]).collect();
    assert_eq!(
        labels,
        ["wheel front left", "wheel front right", "wheel rear left", "wheel rear right"]
    );
    assert_eq!(alone["buses"].as_array().unwrap().len(), 1);
    assert!(alone["virtual_seconds"].as_f64().unwrap() <= 1.0);
    let page = fs::read_to_string(folder.join("report/report.html")).unwrap();
    assert!(page.contains("capture of its buses"));
    // What no report can be made of.
    let bad = |name: &str, text: &str| {
        fs::write(folder.join(name), text).unwrap();
        command(&["report", &path(name)]).unwrap_err()
    };
    let error = bad("timeless.log", "can0  201   [8]  00 01 00 08 0B B8 1E 00\n");
    assert!(
        error.contains("timeless.log: line 1 has no time: write the log with candump"),
        "{error}"
    );
    let error = bad("strange.log", "(1.0) vcan9 201#00\nnonsense\n");
    assert!(error.contains("strange.log: no frame of a bus of the robot is in it"), "{error}");
    let error = bad("long.log", "(1.0) can0 201#00\n(4000.0) can0 201#00\n");
    assert!(error.contains("are 4000 s, and a report is made of 3600 at most"), "{error}");
    assert!(bad("empty.log", "").contains("no frame of a bus"));
    let record = path("a.mcap");
    of_team(|robot| run_short(robot, &record));
    let error = command(&["report", &record, one]).unwrap_err();
    assert!(error.ends_with("one record at a time"), "{error}");
    let error = command(&["report", &record, "--bus", "can0=2"]).unwrap_err();
    assert!(error.contains("--bus is for captures"), "{error}");
}

fn run_short(robot: Robot<'_>, path: &str) {
    run(robot, Path::new(path), &[], &[], Micros::from_millis(10));
}
