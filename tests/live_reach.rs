//! Shells that reach a robot which `rc10 live` keeps running: by its file, with its key, beside its page.
#![cfg(unix)]

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::scratch::Scratch;
use crate::common::served::{Started, http, page_of, start, until};
use rc10_cli::live::{Client, frame};
use rc10_link::{Ask, Urgent};
use rc10_time::Micros;
use serde_json::Value;

/// A user's folder, and the robots in it.
struct Home(Scratch);

impl Home {
    fn new(name: &str) -> Self {
        Self(Scratch::new(name))
    }

    fn rc10(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
        command.args(arguments).env("XDG_RUNTIME_DIR", &*self.0);
        command
    }

    /// A simulated robot, with its page's port.
    fn keep(&self) -> (Started, u16) {
        self.keep_of(&["--sim"])
    }

    fn keep_of(&self, source: &[&str]) -> (Started, u16) {
        let mut live = self.rc10(&[&["live", "--page", "0"], source, &["--out"]].concat());
        let (live, line) = start(live.arg(self.0.join("records")), "http://");
        (live, page_of(&line))
    }

    /// What a command prints on both ways, and whether it succeeds.
    fn run(&self, arguments: &[&str]) -> (bool, String) {
        let output = self.rc10(arguments).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8(text).unwrap())
    }

    fn file(&self, page: u16) -> PathBuf {
        self.0.join("rc10").join(format!("sim-{page}"))
    }

    /// Port and key of a robot's line.
    fn line(&self, page: u16) -> (u16, String) {
        let text = fs::read_to_string(self.file(page)).unwrap();
        let mut words = text.split(' ');
        (words.next().unwrap().parse().unwrap(), words.next().unwrap().to_owned())
    }
}

fn state(page: u16) -> Value {
    serde_json::from_str(&http(page, "GET", "/state", "", "").1).unwrap()
}

/// The newest value of one of a page's signals or parameters.
fn shown(page: u16, all: &str, name: &str, value: &str) -> f64 {
    let state = state(page);
    let found =
        state[all].as_array().unwrap().iter().find(|it| it["name"] == name || it["full"] == name);
    found.and_then(|it| it[value].as_f64()).unwrap_or(f64::NAN)
}

#[test]
fn a_simulated_robot_is_tuned_recorded_watched_and_stopped_from_other_shells() {
    let home = Home::new("reach");
    let (live, page) = home.keep();
    let name = format!("the simulated robot at sim:{page}");
    let only_owner = fs::metadata(home.0.join("rc10")).unwrap().permissions().mode();
    assert_eq!(only_owner & 0o777, 0o700);
    until("whole", || state(page)["whole"] == true);
    assert_eq!(state(page)["name"], name.as_str());

    let (done, text) = home.run(&["set", "feeder_speed=200", "--port", "sim"]);
    assert!(done && text == format!("feeder_speed = 200, before 300: {name}\n"), "{text}");
    until("200", || (shown(page, "parameters", "feeder_speed", "value") - 200.0).abs() < 1e-9);
    let (done, text) = home.run(&["get", "feeder_speed", "--port", &format!("sim:{page}")]);
    assert!(done && text == "200\n", "{text}");
    let (done, text) = home.run(&["set", "feeder_speed=451", "--port", "sim"]);
    assert!(!done && text.contains("out of its range"), "{text}");

    // Oftener than the page has them, which goes on as before.
    let record = home.0.join("run.mcap").display().to_string();
    let wanted = ["record", "--port", "sim", "--period", "5", "--seconds", "2", "-o", &record];
    let (done, text) = home.run(&wanted);
    assert!(done && text.contains(&format!("topics of {name}: ")), "{text}");
    assert!(!text.contains("lost") && !text.contains("damaged"), "{text}");
    let csv = home.0.join("csv");
    assert!(home.run(&["csv", &record, "--out", &csv.display().to_string()]).0);
    let motor = fs::read_to_string(csv.join("motors-wheel_front_left.csv")).unwrap();
    let rows = motor.lines().count();
    assert!((380..=420).contains(&rows), "{rows} rows of 5 ms in 2 s");
    assert_eq!(state(page)["losses"]["samples"], 0);

    // Another page at the same robot.
    let mut second = home.rc10(&["live", "sim", "--page", "0", "--out"]);
    let (_second, line) = start(second.arg(home.0.join("more")), "http://");
    let other = page_of(&line);
    until("whole", || state(other)["whole"] == true);
    assert_eq!(state(other)["name"], name.as_str());
    until("200", || (shown(other, "parameters", "feeder_speed", "value") - 200.0).abs() < 1e-9);
    assert!(!home.file(other).exists(), "one robot has one name");

    let (done, text) = home.run(&["stop", "sim"]);
    assert!(done && text.starts_with("stopped after ") && text.contains(&name), "{text}");
    let stopped = rc10_motor::ArmState::EStopped as u8;
    until("stopped", || (shown(page, "signals", "arm", "value") - f64::from(stopped)).abs() < 1e-9);

    // It ends as it does by Ctrl-C, and takes its file along.
    let _ = Command::new("kill").args(["-INT", &live.0.id().to_string()]).status();
    until("no file", || !home.file(page).exists());
    let (done, text) = home.run(&["get", "feeder_speed", "--port", "sim"]);
    assert!(!done && text.contains("no robot `sim` runs on this PC"), "{text}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_emulated_chip_is_tuned_recorded_and_stopped_from_other_shells() {
    let firmware = std::env::var("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    let home = Home::new("reach-emu");
    let (_live, page) = home.keep_of(&["--emu", &firmware]);
    let name = format!(" on the emulated chip at emu:{page}");
    until("whole", || state(page)["whole"] == true);
    let (done, text) = home.run(&["set", "feeder_speed=200", "--port", "emu"]);
    assert!(done && text.starts_with("feeder_speed = 200, before 300: "), "{text}");
    assert!(text.contains(&name), "{text}");
    let (done, text) = home.run(&["get", "feeder_speed", "--port", "emu"]);
    assert!(done && text == "200\n", "{text}");
    let record = home.0.join("run.mcap").display().to_string();
    let (done, text) = home.run(&["record", "emu", "--seconds", "1", "-o", &record]);
    assert!(done && text.contains(&name) && !text.contains("lost"), "{text}");
    let (done, text) = home.run(&["stop", "emu"]);
    assert!(done && text.starts_with("stopped after ") && text.contains(&name), "{text}");
}

/// The emulated chip panics while it drives, and is asked after it has started again.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn what_a_crash_has_left_is_fetched_and_replayed() {
    let firmware = std::env::var("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    let home = Home::new("reach-crash");
    let elf = format!("{firmware}-black-box");
    let (_live, page) = home.keep_of(&["--emu", &elf, "--fault", "panic@1.7s"]);
    until("whole", || state(page)["whole"] == true);
    let file = home.0.join("crash.bin").display().to_string();
    let mut text = String::new();
    until("held", || {
        let _ = fs::remove_file(&file);
        let (done, said) = home.run(&["blackbox", "--port", "emu", "--output", &file]);
        assert!(done, "{said}");
        text = said;
        text.contains("\na panic ended it\nthe robot keeps it until it is armed 2 times more\n")
    });
    assert!(text.contains(&format!("next: rc10 replay {file}\n")), "{text}");
    assert_eq!(fs::metadata(&file).unwrap().len(), 327_456);
    let (done, replayed) = home.run(&["replay", &file]);
    println!("{text}{replayed}");
    assert!(done && replayed.starts_with("equal: "), "{replayed}");
    // It starts some ms after power-on, and has recorded up to the last half of a tick.
    let last = replayed.split_once(" s to ").unwrap().1.split(' ').next().unwrap();
    let last: f64 = last.parse().unwrap();
    assert!((1.690..1.7).contains(&last), "{last}");
    let (done, said) = home.run(&["blackbox", "--port", "emu", "--output", &file]);
    assert!(!done && said.contains("is there: --force writes over it"), "{said}");
    let other = home.0.join("match.bin").display().to_string();
    let (done, said) = home.run(&["blackbox", "--port", "emu", "--match", "--output", &other]);
    assert!(!done && said.contains("its board keeps no matches: a DM-MC02 does"), "{said}");

    // Of another program it is told at once, and nothing panics.
    let mut other = fs::read(&file).unwrap();
    other[8] ^= 1;
    fs::write(&file, other).unwrap();
    let (done, said) = home.run(&["replay", &file]);
    assert!(!done && said.contains("it is of another program"), "{said}");

    // A program without one says so; so does the simulated robot.
    for source in [&["--emu", &firmware][..], &["--sim"]] {
        let home = Home::new(&format!("reach-none{}", source.len()));
        let (_live, page) = home.keep_of(source);
        until("whole", || state(page)["whole"] == true);
        let none = home.0.join("none.bin");
        let (done, said) = home.run(&["blackbox", "--output", &none.display().to_string()]);
        assert!(!done && said.contains("its program has no black box: build it with"), "{said}");
        assert!(!none.exists());
    }
}

/// Two matches in the serial flash of an emulated DM-MC02.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_match_is_fetched_from_the_flash_and_replayed() {
    let firmware = std::env::var("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    let home = Home::new("reach-match");
    let elf = format!("{firmware}-dm-mc02-black-box");
    let (_live, page) = home.keep_of(&["--emu", &elf, "--script", "--fault", "cut-power@4s..4.1s"]);
    until("whole", || state(page)["whole"] == true);
    let file = home.0.join("match.bin").display().to_string();
    let fetch = |which: &str| {
        let _ = fs::remove_file(&file);
        home.run(&["blackbox", "--port", "emu", which, "--output", &file])
    };
    let mut last = 0.0;
    // Up to the cut of power, or to when it was slow to erase before.
    until("kept", || {
        let (done, text) = fetch("--match");
        if !done {
            assert!(text.contains("there is no such match") || text.contains("does not"), "{text}");
            return false;
        }
        println!("{text}");
        let (done, replayed) = home.run(&["replay", &file]);
        assert!(done && replayed.starts_with("equal: "), "{replayed}");
        let to = replayed.split_once(" s to ").unwrap().1.split(' ').next().unwrap();
        last = to.parse().unwrap();
        last > 1.5
    });
    let (done, text) = fetch("--match=7");
    assert!(!done && text.contains("there is no such match in its flash"), "{text}");
    assert!(!fs::exists(&file).unwrap());
    let (done, text) = fetch("--match=0");
    assert!(!done && text.contains("0 is not in 1..=65535"), "{text}");
    // Its RAM is another thing; the other board has no such flash.
    let (done, text) = home.run(&["blackbox", "--port", "emu", "--output", &file]);
    assert!(done && fs::metadata(&file).unwrap().len() == 327_456, "{text}");
}

#[test]
fn of_two_robots_the_one_that_is_named_is_reached() {
    let home = Home::new("reach-two");
    let ((_one, first), (_other, second)) = (home.keep(), home.keep());
    let names = [first, second].map(|page| format!("the simulated robot at sim:{page}"));
    // Also without a name, whatever serial ports there are.
    for wanted in [&["set", "feeder_speed=1"][..], &["get", "feeder_speed"], &["live"]] {
        let (done, text) = home.run(wanted);
        assert!(!done && text.contains("which robot? --port with one of these: "), "{text}");
        assert!(names.iter().all(|name| text.contains(name)), "{text}");
    }
    let place = format!("sim:{second}");
    let (done, text) = home.run(&["set", "feeder_speed=111", "--port", &place]);
    assert!(done && text.contains(&names[1]) && !text.contains(&names[0]), "{text}");
    let (_, text) = home.run(&["get", "feeder_speed", "--port", &format!("sim:{first}")]);
    assert_eq!(text, "300\n");
    let (done, text) = home.run(&["get", "feeder_speed", "--port", "emu"]);
    assert!(!done && text.contains("no robot `emu` runs"), "{text}");
    // A stop is for all of them.
    let (done, text) = home.run(&["stop", "sim"]);
    assert!(done && names.iter().all(|name| text.contains(name)), "{text}");
    for page in [first, second] {
        let stopped = f64::from(rc10_motor::ArmState::EStopped as u8);
        until("stopped", || (shown(page, "signals", "arm", "value") - stopped).abs() < 1e-9);
    }
    // `--sim` begins another one, and no other shell may think that it is this one.
    let (done, text) = home.run(&["set", "feeder_speed=1", "--sim"]);
    assert!(!done && text.contains("unexpected argument"), "{text}");
}

#[test]
fn an_old_file_names_no_robot_whatever_has_its_port() {
    let home = Home::new("reach-old");
    let (live, page) = home.keep();
    let file = home.file(page);
    let kept = fs::read_to_string(&file).unwrap();
    // It is killed, and leaves its file.
    drop(live);
    let get = |home: &Home| home.run(&["get", "feeder_speed", "--port", "sim"]);
    assert!(file.exists());
    let (done, text) = get(&home);
    assert!(!done && text.contains("no robot `sim` runs on this PC"), "{text}");
    assert!(!file.exists());
    for foreign in [&b"HTTP/1.1 400 Bad Request\r\n\r\n"[..], b"", &[0xE7; 4000]] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let (_, rest) = kept.split_once(' ').unwrap();
        fs::write(&file, format!("{port} {rest}")).unwrap();
        std::thread::spawn(move || {
            while let Ok((mut stream, _)) = listener.accept() {
                let _ = stream.write_all(foreign);
                let _ = stream.read(&mut [0; 64]);
            }
        });
        let (done, text) = get(&home);
        assert!(!done && text.contains("no robot `sim` runs"), "{text}");
    }
    for garbage in [&b""[..], b"8010", b"x y z", b"70000 a b c", &[0xFF; 99]] {
        fs::write(&file, garbage).unwrap();
        let (done, text) = get(&home);
        assert!(!done && text.contains("no robot `sim` runs"), "{text}");
    }
    // The next robot at this page has the name.
    let mut next = home.rc10(&["live", "--sim", "--page", &page.to_string()]);
    let _next = start(&mut next, "http://");
    assert_eq!(get(&home), (true, "300\n".into()));
}

/// Whoever has the key may be as slow or as wild as he likes.
#[test]
fn wild_and_slow_shells_disturb_neither_the_robot_nor_its_page() {
    let home = Home::new("reach-wild");
    let (_live, page) = home.keep();
    until("whole", || state(page)["whole"] == true);
    let (port, key) = home.line(page);
    let connect = |said: &[u8]| {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(600))).unwrap();
        stream.write_all(said).unwrap();
        stream
    };
    let stop = frame(&Ask::Urge { id: 1, what: Urgent::Stop });
    // A page of another site can send any bytes behind its head.
    let mut post = connect(&[b"POST / HTTP/1.1\r\n\r\n", key.as_bytes(), &stop].concat());
    assert!(post.read(&mut [0; 9]).map_or(0, |count| count) == 0, "it is answered");
    // Everything at 1 kHz, and never read.
    let mut client = Client::new();
    for group in 0..4 {
        client.watch(group, 1, 0..250);
    }
    client.step(Micros::ZERO);
    let greedy = [key.as_bytes(), &client.take_out()].concat();
    let _greedy: Vec<_> = (0..3).map(|_| connect(&greedy)).collect();
    // Half a frame, and gone; half a frame, and silent.
    drop(connect(&[key.as_bytes(), &stop[..stop.len() - 1]].concat()));
    let _half = connect(&[key.as_bytes(), &stop[..5]].concat());
    // Garbage without an end.
    let mut garbage = connect(key.as_bytes());
    let flood = std::thread::spawn(move || while garbage.write_all(&[0xE7; 4096]).is_ok() {});
    let now = || state(page)["now"].as_u64().unwrap();
    let (begin, before) = (Instant::now(), now());
    for value in [100, 200] {
        let change = format!("feeder_speed={value}");
        let (done, text) = home.run(&["set", &change, "--port", "sim"]);
        assert!(done, "{text}");
    }
    until("it runs", || now() > before + 1_000_000);
    println!("{:?} for {} us", begin.elapsed(), now() - before);
    let arm = shown(page, "signals", "arm", "value");
    assert!((arm - f64::from(rc10_motor::ArmState::EStopped as u8)).abs() > 0.5, "it was stopped");
    let (done, text) = home.run(&["stop", "sim"]);
    assert!(done, "{text}");
    drop(_live);
    flood.join().unwrap();
}

#[test]
fn a_record_goes_on_with_the_next_robot_of_that_name() {
    let home = Home::new("reach-back");
    let (live, page) = home.keep();
    let record = home.0.join("run.mcap");
    let place = format!("sim:{page}");
    let mut recorder = home.rc10(&["record", "--port", &place, "--seconds", "60", "-o"]);
    let recorder = recorder.arg(&record).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let Started(recorder) = &mut Started(recorder.unwrap());
    let mut said = BufReader::new(recorder.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(said.any(|line| line.contains("the disk has room for")));
    until("a record", || fs::metadata(Path::new(&record)).is_ok_and(|it| it.len() > 200_000));
    drop(live);
    assert!(said.any(|line| line.contains("the port is gone") || line.contains("has ended")));
    let mut next = home.rc10(&["live", "--sim", "--page", &page.to_string()]);
    let _next = start(&mut next, "http://");
    assert!(said.any(|line| line.contains("the robot is back")));
    let _ = Command::new("kill").args(["-INT", &recorder.id().to_string()]).status();
    let mut text = String::new();
    recorder.stdout.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(recorder.wait().unwrap().success() && text.contains(&place), "{text}");
}
