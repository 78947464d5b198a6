//! The commands that speak with a robot at a serial port: a pseudo-terminal with the console of the
//! simulated robot behind it.
#![cfg(unix)]

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::scratch::Scratch;
use crate::common::served::until as wait_for;

/// A program that ends with the test.
struct Started(Child);

impl Drop for Started {
    fn drop(&mut self) {
        // Gently, so that it removes its link.
        let _ = Command::new("kill").arg(self.0.id().to_string()).status();
        let _ = self.0.wait();
    }
}

fn rc10() -> Command {
    Command::new(env!("CARGO_BIN_EXE_rc10"))
}

/// The robot's console, at this path.
fn plug_in(link: &Path) -> Started {
    let mut child = rc10()
        .args(["pty", "--console", "--link"])
        .arg(link)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().starts_with("pty /dev/"));
    Started(child)
}

/// What a command prints on both ways, and whether it succeeds.
fn run(arguments: &[&str], port: &Path) -> (bool, String) {
    let output = rc10().args(arguments).arg("--port").arg(port).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(text).unwrap())
}

fn size(record: &Path) -> u64 {
    fs::metadata(record).map_or(0, |file| file.len())
}

/// Waits until some seconds more are in a record.
fn grows(record: &Path) {
    let before = size(record);
    wait_for("the record grows", || size(record) > before + 200_000);
}

#[test]
fn parameters_are_read_and_set_from_a_shell() {
    let folder = Scratch::new("live-shell");
    let link = folder.join("console");
    let _robot = plug_in(&link);
    let (done, text) = run(&["params"], &link);
    assert!(done && text.contains("lift_rear_right.angle_kp = "), "{text}");
    assert!(text.contains("feeder_speed = 300 rpm  (0 to 450)"), "{text}");
    let (done, text) = run(&["set", "feeder_speed=200", "feeder.speed_kp=0.5"], &link);
    assert!(done && text.contains("feeder_speed = 200, before 300"), "{text}");
    // Another program, another link: the robot has kept it.
    let (done, text) = run(&["get", "feeder_speed", "feeder.speed_kp"], &link);
    assert!(done && text == "200\n0.5\n", "{text}");
    let (_, text) = run(&["params", "--rust"], &link);
    assert!(text.contains("// feeder: speed_kp was") && text.contains(".kp(0.5)"), "{text}");
    for (change, why) in [
        (&["set", "feeder_speed=451"][..], "out of its range"),
        (&["set", "feeder_speed=100", "feeder.limit=99"], "feeder limit (0 to 10)"),
        (&["set", "feeder_speed=x"], "`x` is no number"),
        (&["set", "feeder_speed"], "NAME=VALUE"),
        (&["set", "nothing=1"], "there is no parameter `nothing`"),
        (&["set", "speed_kp=1"], "there are wheel_front_left.speed_kp"),
    ] {
        let (done, text) = run(change, &link);
        assert!(!done && text.contains(why), "{change:?}: {text}");
    }
    let (_, text) = run(&["get", "feeder_speed"], &link);
    assert_eq!(text, "200\n");
}

#[test]
fn a_port_that_is_not_there_or_taken_is_said_so() {
    let folder = Scratch::new("live-port");
    let link = folder.join("console");
    let (done, text) = run(&["params"], &link);
    assert!(!done && text.contains("there is no such port"), "{text}");
    let (done, text) = run(&["params"], Path::new("tcp:nowhere"));
    assert!(!done && text.contains("tcp:HOST:PORT"), "{text}");
    let robot = plug_in(&link);
    let (done, text) = run(&["params", "--baud", "100"], &link);
    assert!(!done && text.contains("--baud"), "{text}");
    let mut holder = rc10()
        .args(["live", "--page", "0", "--port"])
        .arg(&link)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(holder.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().contains("http://"));
    let holder = Started(holder);
    let (done, text) = run(&["params"], &link);
    // Root may open a port that another has to itself.
    let is_root = text.contains("speed_kp");
    assert!(is_root || (!done && text.contains("another program has it open")), "{text}");
    drop((holder, robot));
    // A port at which nothing speaks.
    let (done, text) = run(&["params"], Path::new("/dev/null"));
    assert!(!done, "{text}");
}

#[test]
fn a_record_outlives_a_pulled_cable() {
    let folder = Scratch::new("live-record");
    let (link, record) = (folder.join("console"), folder.join("run.mcap"));
    let robot = plug_in(&link);
    let mut recorder = rc10()
        .args(["record", "--seconds", "60", "-o"])
        .arg(&record)
        .arg("--port")
        .arg(&link)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(recorder.stderr.take().unwrap()).lines();
    assert!(said.next().unwrap().unwrap().contains("the disk has room for"));
    grows(&record);
    drop(robot);
    let line = said.next().unwrap().unwrap();
    assert!(line.contains("the port is gone") || line.contains("no such port"), "{line}");
    let _robot = plug_in(&link);
    let back = said.find(|line| line.as_ref().unwrap().contains("the robot is back"));
    assert!(back.is_some());
    grows(&record);
    let _ = Command::new("kill").arg(recorder.id().to_string()).status();
    let output = recorder.wait_with_output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("topics"), "{text}");
    let report =
        rc10().arg("report").arg(&record).arg("--out").arg(folder.join("report")).output().unwrap();
    let text = String::from_utf8(report.stdout).unwrap();
    assert!(report.status.success() && text.contains("wheel front left"), "{text}");
    // The robot was restarted, and counts anew: the record goes on.
    assert!(!text.contains("answers twice") && !text.contains("missed"), "{text}");
}

/// A disk of 4 MB, if this user may make one.
struct Disk(std::path::PathBuf);

impl Disk {
    fn mount(folder: &Path) -> Option<Self> {
        let disk = folder.join("disk");
        fs::create_dir(&disk).unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=4m", "tmpfs"]).arg(&disk).stderr(Stdio::null());
        mount.status().is_ok_and(|status| status.success()).then(|| Self(disk))
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).status();
    }
}

/// Seconds in a record that has no end, as its report says.
fn seconds_of(record: &Path, out: &Path) -> f64 {
    let report = rc10().arg("report").arg(record).arg("--out").arg(out).output().unwrap();
    let text = String::from_utf8(report.stderr).unwrap();
    assert!(report.status.success() && text.contains("at byte "), "{text}");
    String::from_utf8(report.stdout).unwrap().split(' ').next().unwrap().parse().unwrap()
}

/// What is in a record when the disk is full stays there, and `rc10 live` goes on.
#[test]
fn a_full_disk_leaves_what_was_recorded() {
    let folder = Scratch::new("live-full");
    let no_room = rc10().args(["record", "--sim", "--force", "-o", "/dev/full"]).output().unwrap();
    let text = String::from_utf8(no_room.stderr).unwrap();
    let is_known = text.ends_with("/dev/full: 0 s are in it; the disk is full\n");
    assert!(
        no_room.status.code() == Some(2) && (is_known || cfg!(not(target_os = "linux"))),
        "{text}"
    );
    let Some(disk) = Disk::mount(&folder) else {
        println!("SKIPPED: this user may not mount a small disk");
        return;
    };
    let record = disk.0.join("match.mcap");
    let command = ["record", "--sim", "--seconds", "600", "-o"];
    let full = rc10().args(command).arg(&record).output().unwrap();
    let text = String::from_utf8(full.stderr).unwrap();
    assert_eq!(full.status.code(), Some(2), "{text}");
    assert!(text.contains("WARNING: the disk has room for some 0 min"), "{text}");
    let line = text.lines().last().unwrap();
    let said = line.strip_prefix(&format!("rc10: {}: ", record.display())).unwrap();
    let said = said.strip_suffix(" s are in it; the disk is full").unwrap();
    let seconds: f64 = said.parse().unwrap();
    assert!((5.0..60.0).contains(&seconds), "{line}");
    let read = seconds_of(&record, &folder.join("report"));
    assert!((read - seconds).abs() < 0.1, "{read} of {seconds}");
    // It is named to the next one, which does not take its place.
    let again = rc10().args(command).arg(&record).output().unwrap();
    let text = String::from_utf8(again.stderr).unwrap();
    assert!(!again.status.success() && text.contains("is there already"), "{text}");
    let named = format!("not finished, or still being written: {};", record.display());
    assert!(text.contains(&named), "{text}");

    // A page's record, on a disk that is nearly full.
    fs::remove_file(&record).unwrap();
    fs::write(disk.0.join("filler"), vec![0; 3_400_000]).unwrap();
    let mut live = rc10();
    live.args(["live", "--sim", "--page", "0", "--out"]).arg(&disk.0);
    let mut live = live.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let line = BufReader::new(live.stdout.take().unwrap()).lines().next().unwrap().unwrap();
    let live = Started(live);
    let address = line.split("http://").nth(1).unwrap().trim_end_matches('/').to_owned();
    let ask = |request: &str, body: &str| {
        let mut stream = TcpStream::connect(&address).unwrap();
        let length = body.len();
        let head = format!("{request} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n");
        let kind = format!("Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n");
        stream.write_all(format!("{head}{kind}{body}").as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    let until = |what: &str| {
        let begin = Instant::now();
        loop {
            let state = ask("GET /state", "");
            if state.contains(what) {
                return state;
            }
            assert!(begin.elapsed() < Duration::from_secs(600), "{what}: {state}");
            std::thread::sleep(Duration::from_millis(100));
        }
    };
    until("\"whole\":true");
    let begun = ask("POST /wish", "{\"record\":true}");
    assert!(begun.contains("\"ok\""), "{begun}");
    until("s are in it; the disk is full");
    assert!(until("\"record\":null").contains("001.mcap"));
    // The page is still there, and the robot still runs.
    let now = |state: String| {
        let digits = state.split("\"now\":").nth(1).unwrap().split(',').next().unwrap().to_owned();
        digits.parse::<u64>().unwrap()
    };
    let before = now(ask("GET /state", ""));
    wait_for("the robot runs", || now(ask("GET /state", "")) > before);
    drop(live);
    assert!(seconds_of(&disk.0.join("001.mcap"), &folder.join("report")) > 0.3);
}

/// A program that is killed leaves all but the last seconds, where it was told to.
#[test]
fn a_killed_program_leaves_its_record() {
    let folder = Scratch::new("live-killed");
    let (link, record) = (folder.join("console"), folder.join("run.mcap"));
    let _robot = plug_in(&link);
    let mut recorder = rc10();
    recorder.args(["record", "-o"]).arg(&record).arg("--port").arg(&link);
    let mut recorder = recorder.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for("it grows", || size(&record) > 600_000);
    recorder.kill().unwrap();
    recorder.wait().unwrap();
    assert!(seconds_of(&record, &folder.join("report")) > 2.0);
    // The next one that is begun here names it.
    let next = ["record", "--sim", "--seconds", "1", "-o"];
    let next = rc10().args(next).arg(folder.join("next.mcap")).output().unwrap();
    let text = String::from_utf8(next.stderr).unwrap();
    let named = format!("not finished, or still being written: {};", record.display());
    assert!(next.status.success() && text.contains(&named), "{text}");
}

/// A terminal that is closed ends a record as Ctrl-C does.
#[test]
fn a_closed_terminal_ends_a_record_properly() {
    let folder = Scratch::new("live-hup");
    let (link, record) = (folder.join("console"), folder.join("run.mcap"));
    let _robot = plug_in(&link);
    let mut recorder = rc10();
    recorder.args(["record", "-o"]).arg(&record).arg("--port").arg(&link);
    let mut recorder = recorder.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(recorder.stderr.take().unwrap()).lines();
    assert!(said.next().unwrap().unwrap().contains("of the record"));
    grows(&record);
    let hang_up = ["-HUP", &recorder.id().to_string()].map(str::to_owned);
    assert!(Command::new("kill").args(hang_up).status().unwrap().success());
    assert!(recorder.wait().unwrap().success());
    assert!(fs::read(&record).unwrap().ends_with(b"\x89MCAP0\r\n"));
}

/// The floats of a frame of VOFA+'s `JustFloat`: its document says that a frame ends with
/// `00 00 80 7F`.
fn just_float(bytes: &[u8]) -> Vec<f32> {
    let body = bytes.strip_suffix(&[0x00, 0x00, 0x80, 0x7F]).expect("its tail");
    assert_eq!(body.len() % 4, 0);
    body.chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect()
}

#[test]
fn other_viewers_get_what_their_documents_say() {
    let folder = Scratch::new("live-viewers");
    let link = folder.join("console");
    let _robot = plug_in(&link);
    let socket = || {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(600))).unwrap();
        socket
    };
    let (juggler, vofa) = (socket(), socket());
    let place = |socket: &UdpSocket| socket.local_addr().unwrap().to_string();
    let live = |more: &[&str]| {
        let mut command = rc10();
        command.args(["live", "--page", "0", "--port"]).arg(&link).args(more);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let channels =
        ["--channel", "wheel_front_left.target", "--channel", "wheel_front_left.measured"];
    let udp = format!("udp:{}", place(&vofa));
    let fed = live(&[&["--plotjuggler", &place(&juggler), "--vofa", &udp], &channels[..]].concat());
    let fed = Started(fed);
    let mut buffer = [0; 65_536];
    // PlotJuggler: JSON objects with numbers in them, and the time in seconds as `timestamp`.
    let (mut last, mut seen) = (0.0, false);
    for _ in 0..100 {
        let count = juggler.recv(&mut buffer).unwrap();
        let sample: serde_json::Value = serde_json::from_slice(&buffer[..count]).unwrap();
        let time = sample["timestamp"].as_f64().unwrap();
        assert!(time >= last - 0.11, "{time} after {last}");
        last = time;
        seen |=
            sample["wheel_front_left"]["speed"].is_f64() && sample["feeder"]["current"].is_f64();
    }
    assert!(seen);
    for _ in 0..100 {
        let count = vofa.recv(&mut buffer).unwrap();
        assert_eq!(just_float(&buffer[..count]).len(), 2);
    }
    drop(fed);

    // By TCP: it waits, and whole frames follow each other.
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let fed = Started(live(&[&["--vofa", &format!("tcp:{free}")], &channels[..]].concat()));
    let begin = Instant::now();
    let mut reader = loop {
        match TcpStream::connect(free) {
            Ok(reader) => break reader,
            Err(error) => assert!(begin.elapsed() < Duration::from_secs(600), "{error}"),
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    reader.set_read_timeout(Some(Duration::from_secs(600))).unwrap();
    let mut bytes = [0; 12 * 50];
    reader.read_exact(&mut bytes).unwrap();
    bytes.chunks(12).for_each(|frame| assert_eq!(just_float(frame).len(), 2));
    drop(fed);

    let mut wrong = live(&["--vofa", "udp:127.0.0.1:9", "--channel", "wheel_front_left.nothing"]);
    let mut text = String::new();
    wrong.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(!wrong.wait().unwrap().success() && text.contains("no such signal"), "{text}");
}

#[test]
fn a_robot_is_stopped_from_a_shell() {
    let folder = Scratch::new("live-stop");
    let link = folder.join("console");
    let _robot = plug_in(&link);
    let (done, text) = run(&["stop", "--disarm"], &link);
    assert!(done && text.starts_with("disarmed after "), "{text}");
    let (done, text) = run(&["stop"], &link);
    assert!(done && text.starts_with("stopped after "), "{text}");
    // One that does not answer: it is said, and goes on until Ctrl-C.
    let mute = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let place = format!("tcp:{}", mute.local_addr().unwrap());
    let stop = rc10().args(["stop", &place]).stderr(Stdio::piped()).spawn().unwrap();
    // It ends also where the test fails.
    let Started(stop) = &mut Started(stop);
    let mut said = BufReader::new(stop.stderr.take().unwrap()).lines();
    let begin = Instant::now();
    assert!(said.next().unwrap().unwrap().contains("NOT HEARD by the robot ("));
    // Not before it is so, and once.
    assert!(begin.elapsed() >= Duration::from_millis(100));
    std::thread::sleep(Duration::from_millis(200));
    let _ = Command::new("kill").args(["-INT", &stop.id().to_string()]).status();
    assert!(said.next().unwrap().unwrap().contains("may not be stopped"));
    assert_eq!(stop.wait().unwrap().code(), Some(2));
}
