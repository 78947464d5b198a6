//! The remote of a simulated robot in the hands of a page: keyboard, gamepad, mouse, and what may go wrong with them.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::browser::{Browser, has_browser};
use crate::common::served::{JSON, Started, http, live};
use rc10_cli::Receiver;
use rc10_cli::run::running::Running as _;
use rc10_cli::run::simulation::Simulation;
use rc10_motor::ArmState;
use rc10_sim::remote::{Controls, Stick};
use rc10_time::Micros;
use serde_json::{Value, json};

fn begin(more: &[&str]) -> (Started, u16) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    live(command.args(["live", "--page", "0", "--sim"]).args(more))
}

fn open(port: u16) -> Browser {
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.look("look('robot')");
    page.until("return state.whole && !document.querySelector('#drive').hidden");
    page
}

/// So slow that a page on a busy machine says in time where its sticks are: a quarter of a second of the robot's.
const SLOW: &[&str] = &["--pace", "0.2"];

const ARM: &str = "return document.querySelector('#arm').textContent";
const WHEELS: &str =
    "labels('motors').filter((it) => it.startsWith('wheel')).map((it) => value(it, 'speed'))";

/// Clicks on what is written on a button of the panel.
fn click(page: &Browser, text: &str) {
    page.look(&format!(
        "[...document.querySelectorAll('#drive button')].find((it) => it.textContent === '{text}').click()"
    ));
}

/// Takes the remote, and arms by the right switch, which lies where it disarms.
fn arm(page: &Browser) {
    click(page, "Take the remote");
    page.until("return Drive.holds() !== null");
    page.until("return named('', 'remote') === 'Live' || named('', 'remote') !== '–'");
    page.pass(0.5);
    page.keys("e");
    page.until(&format!("{ARM} === 'Armed'"));
}

fn is_driving(page: &Browser) {
    page.until(&format!("return {WHEELS}.every((it) => Math.abs(it) > 50)"));
}

fn is_standing(page: &Browser) {
    page.until(&format!("return {WHEELS}.every((it) => Math.abs(it) < 5)"));
}

#[test]
fn the_keyboard_drives_a_robot_that_begins_disarmed() {
    if !has_browser() {
        return;
    }
    let (_live, port) = begin(SLOW);
    let page = open(port);
    page.pass(2.0);
    assert_eq!(page.look(ARM), json!("Disarmed"));
    page.until("return moving.pace !== null && moving.pace < 0.25");
    // Without the remote in hand keys do nothing.
    page.hold("w", "keyDown");
    page.pass(0.5);
    assert_eq!(page.look("return moving.remote.at[1]"), json!(0));
    page.hold("w", "keyUp");

    arm(&page);
    page.hold("w", "keyDown");
    is_driving(&page);
    // STOP while the key is held: it stops, and the stick is in the middle until the key is pressed anew.
    page.keys(" ");
    page.until(&format!("{ARM} === 'Stopped'"));
    is_standing(&page);
    assert_eq!(page.look("return moving.remote.at[1]"), json!(0));
    page.hold("w", "keyUp");
    // Its own rule: the switch goes through where it disarms.
    page.keys("e");
    page.pass(0.4);
    assert_eq!(page.look(ARM), json!("Stopped"));
    page.keys("cc");
    page.until(&format!("{ARM} === 'Disarmed'"));
    page.keys("e");
    page.until(&format!("{ARM} === 'Armed'"));
    page.hold("w", "keyDown");
    is_driving(&page);
    // Disarm while driving.
    page.look("document.querySelector('#disarm').click()");
    page.until(&format!("{ARM} === 'Disarmed'"));
    is_standing(&page);
}

/// A gamepad that the browser believes in, with its sticks in the middle.
const PAD: &str = "window.pad = { connected: true, mapping: 'standard', axes: [0, 0, 0, 0], \
    buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) }; \
    navigator.getGamepads = () => [null, window.pad]";

fn push(page: &Browser, button: usize) {
    for is_down in [true, false] {
        page.look(&format!(
            "pad.seen = 0; pad.buttons[{button}] = {{ get pressed() {{ pad.seen += 1; return {is_down}; }} }}"
        ));
        page.until("return pad.seen > 0");
    }
}

#[test]
fn a_gamepad_drives_until_the_focus_or_the_tab_is_lost() {
    if !has_browser() {
        return;
    }
    let (_live, port) = begin(SLOW);
    let page = open(port);
    page.look(PAD);
    // It was deflected before the remote was taken: it counts from when it was in its middle.
    page.look("pad.axes[1] = -1");
    click(&page, "Take the remote");
    page.until("return Drive.holds() !== null");
    page.pass(0.6);
    assert_eq!(page.look("return moving.remote.at[1]"), json!(0));
    page.look("pad.axes[1] = 0.05");
    page.pass(0.3);
    push(&page, 5);
    page.until(&format!("{ARM} === 'Armed'"));
    page.look("pad.axes[1] = -1");
    is_driving(&page);
    assert_eq!(page.look("return moving.remote.at[1]"), json!(1));

    // The focus is lost: sticks in the middle, the switches stay, and the robot is armed.
    let switches = "return JSON.stringify(moving.remote.at.slice(5))";
    let before = page.look(switches);
    page.look("window.dispatchEvent(new Event('blur'))");
    is_standing(&page);
    assert_eq!((page.look(switches), page.look(ARM)), (before, json!("Armed")));
    // The focus alone moves nothing: the stick goes through its middle first.
    page.look("window.dispatchEvent(new Event('focus'))");
    page.pass(0.5);
    assert_eq!(page.look("return moving.remote.at[1]"), json!(0));
    page.look("pad.axes[1] = 0");
    page.pass(0.3);
    page.look("pad.axes[1] = -1");
    is_driving(&page);

    // The tab is closed: the remote is lost at once.
    page.tell("url", &json!({ "url": "about:blank" }));
    until(port, |it| it["remote"]["on"] == false && it["remote"]["holder"] == "table");
    until_state(port, |state| {
        (signal(state, "", "arm") - f64::from(ArmState::Armed as u8)).abs() > 0.5
    });
    until_state(port, |state| signal(state, "wheel front left", "speed").abs() < 5.0);
}

/// The tab that the driver looks at.
fn tab(page: &Browser) -> Value {
    let path = format!("/session/{}/window", page.session);
    let (_, body) = http(page.port, "GET", &path, "", "");
    serde_json::from_str::<Value>(&body).unwrap()["value"].clone()
}

/// Chooses a period as a person does, in a window of a second, and waits until points that far apart are drawn.
fn plots_every(page: &Browser, millis: u32, is_new: bool) {
    if is_new {
        page.look(&format!(
            "$('window').value = 1; $('window').onchange(); $('period').value = {millis}; $('period').onchange()"
        ));
    }
    page.until(&format!(
        "const {{ times }} = [...data.values()].find((it) => it.times.length > 50) || {{ times: [] }}; \
         const gaps = [...times].slice(1).map((at, index) => at - times[index]).sort((a, b) => a - b); \
         return Math.round(1000 * gaps[gaps.length >> 1]) === {millis} && $('period').value === '{millis}'"
    ));
}

#[test]
fn a_second_tab_takes_the_remote_and_each_has_its_own_period() {
    if !has_browser() {
        return;
    }
    let (_live, port) = begin(&["--script"]);
    let page = open(port);
    // The script's hands are shown, and what it does.
    let says = |text: &str| {
        page.until(&format!("return $('drive').textContent.includes('{text}')"));
    };
    let takes = || {
        click(&page, "Take the remote");
        page.until("return Drive.holds() !== null && moving.remote.holder === Drive.holds()");
        page.look("return Drive.holds()")
    };
    says("The script holds the remote");
    page.until("return document.querySelector('#drive b').textContent.startsWith('square')");
    page.until(&format!("{ARM} === 'Armed'"));
    let first = takes();
    is_standing(&page);
    plots_every(&page, 2, true);

    let tabs = [tab(&page), page.tell("window/new", &json!({ "type": "tab" }))["handle"].clone()];
    let goes_to = |at: usize| page.tell("window", &json!({ "handle": tabs[at] }));
    goes_to(1);
    page.tell("url", &json!({ "url": format!("http://127.0.0.1:{port}/") }));
    page.look("look('robot')");
    page.until("return state.whole && !$('drive').hidden");
    says("Another page holds the remote.");
    plots_every(&page, 10, true);
    assert_ne!(takes(), first);

    goes_to(0);
    page.until("return Drive.holds() === null");
    says("Another page has taken the remote.");
    plots_every(&page, 2, false);
    // It drives no more with the number that it had.
    let (status, body) = drive(port, &json!([first, 1_000_000, 1, 1, 1, 1, 0, 0, 0, 0, 0]));
    assert!(status == 409 && body.contains("other hands"), "{status} {body}");
    // It takes it back, many times: what is on its way meanwhile does not let it go.
    for turn in 0..12 {
        goes_to(turn % 2);
        takes();
    }
    // The script can have it back.
    click(&page, "Let the script drive");
    says("The script holds the remote");
    page.until(&format!("{ARM} === 'Armed'"));
}

/// One who means harm, without a browser.
#[test]
fn what_may_not_drive_does_not_and_a_stop_is_not_delayed() {
    let (_live, port) = begin(&[]);
    until_state(port, |state| state["whole"] == true);
    let number = take(port);
    let at = |message: u64, stick: Value| json!([number, message, 0, stick, 0, 0, 0, 0, 0, 0, 0]);
    // Disarmed by the switch first, then armed: as hands do.
    let mut message = 0;
    let mut say = |stick: f64, right: i64| {
        message += 1;
        let (status, body) =
            drive(port, &json!([number, message, 0, stick, 0, 0, 0, 0, right, 0, 0]));
        assert_eq!(status, 200, "{body}");
        message
    };
    let armed = f64::from(ArmState::Armed as u8);
    let stopped = f64::from(ArmState::EStopped as u8);
    for right in [-1, 0] {
        let now = || moving(port)["now"].as_f64().unwrap();
        let end = now() + 0.6;
        while now() < end {
            say(0.0, right);
            sleep(Duration::from_millis(20));
        }
    }
    until_state(port, |state| {
        say(0.0, 0);
        (signal(state, "", "arm") - armed).abs() < 1e-9
    });
    let newest = say(0.0, 0);
    for (wish, why) in [
        (json!([number.wrapping_add(1), newest + 9, 0, 1, 0, 0, 0, 0, 0, 0, 0]), "other hands"),
        (json!([number.to_string(), newest + 9, 0, 1, 0, 0, 0, 0, 0, 0, 0]), "other hands"),
        (at(newest, json!(1)), "late"),
        (at(newest - 1, json!(1)), "late"),
        (at(newest + 1, Value::Null), "positions"),
        (at(newest + 2, json!(1.01)), "positions"),
        (at(newest + 3, json!("1")), "positions"),
        (json!([number, newest + 4, 1]), "positions"),
        (json!([number, newest + 5, 0, 1, 0, 0, 0, 0.5, 0, 0, 0]), "positions"),
        (json!({ "drive": 1 }), "not understood"),
        (json!([]), "not understood"),
    ] {
        let (status, body) = drive(port, &wish);
        assert!(status == 409 && body.contains(why), "{wish}: {status} {body}");
    }
    let (status, _) = http(
        port,
        "POST",
        "/drive",
        JSON,
        &format!("[{number},{},0,1e999,0,0,0,0,0,0,0]", newest + 6),
    );
    assert_eq!(status, 409);
    for headers in [
        format!("{JSON}Origin: http://example.org\r\n"),
        format!("{JSON}Sec-Fetch-Site: cross-site\r\n"),
        "Content-Type: text/plain\r\n".to_owned(),
    ] {
        assert_eq!(http(port, "POST", "/drive", &headers, "\"take\"").0, 403);
    }
    assert!(moving(port)["remote"]["at"][1].as_f64().is_some_and(|it| it.abs() < 1e-9));

    // A flood of messages, of the holder and of others, and a stop among them.
    let enough = Arc::new(AtomicBool::new(false));
    let flood: Vec<_> = (0..4_u64)
        .map(|lane| {
            let enough = Arc::clone(&enough);
            std::thread::spawn(move || {
                let mut count = 0_u64;
                while !enough.load(Ordering::Relaxed) {
                    count += 1;
                    let wish = if lane % 2 == 0 {
                        json!([number, 1_000_000 + 4 * count + lane, 0, 1, 0, 0, 0, 0, 0, 0, 0])
                    } else {
                        json!([number.wrapping_sub(1), count, 1, 1, 1, 1, 1, 1, 1, 1, 1])
                    };
                    drive(port, &wish);
                }
                count
            })
        })
        .collect();
    sleep(Duration::from_millis(1000));
    let begin = Instant::now();
    while http(port, "POST", "/wish", JSON, r#"{"do":"stop"}"#).0 != 200 {}
    let after = begin.elapsed();
    until_state(port, |state| (signal(state, "", "arm") - stopped).abs() < 1e-9);
    // It drives on, and the robot rolls out and does not.
    until_state(port, |state| signal(state, "wheel front left", "speed").abs() < 5.0);
    for _ in 0..20 {
        let state = state(port);
        assert!((signal(&state, "", "arm") - stopped).abs() < 1e-9);
        assert!(signal(&state, "wheel front left", "speed").abs() < 5.0);
        sleep(Duration::from_millis(50));
    }
    enough.store(true, Ordering::Relaxed);
    let count: u64 = flood.into_iter().map(|it| it.join().unwrap()).sum();
    println!("{count} messages, STOP answered after {after:?}");
    assert!(count > 20, "no flood: {count}");

    // Silence: the transmitter is off, a quarter of a second of the robot's time after the last word.
    let number = take(port);
    let (status, _) = drive(port, &json!([number, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(status, 200);
    let said = moving(port)["now"].as_f64().unwrap();
    // When it is looked at is this machine's business: never is it on later.
    let lost = until(port, |it| {
        let after = it["now"].as_f64().unwrap() - said;
        println!("{after:.3} s after the last word, the transmitter on: {}", it["remote"]["on"]);
        assert!(after < 0.4 || it["remote"]["on"] == false, "{it:.600}");
        it["remote"]["on"] == false
    });
    assert_eq!(lost["remote"]["at"][1], 0.0);
}

/// At a line that leaves the program there is no remote to move, whatever is at its other end.
#[test]
#[cfg(unix)]
fn a_robot_at_a_port_is_never_driven() {
    let folder = crate::common::scratch::Scratch::new("drive-port");
    let rc10 = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
        command.env("XDG_RUNTIME_DIR", &*folder);
        command
    };
    let mut keeper = rc10();
    let (_keeper, line) =
        crate::common::served::start(keeper.args(["live", "--sim", "--page", "0"]), "http://");
    let place = format!("sim:{}", crate::common::served::page_of(&line));
    let mut command = rc10();
    let (_live, line) =
        crate::common::served::start(command.args(["live", &place, "--page", "0"]), "http://");
    let port = crate::common::served::page_of(&line);
    until_state(port, |state| state["whole"] == true);
    for wish in [json!("take"), json!("script"), json!([1, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0])] {
        let (status, body) = drive(port, &wish);
        assert!(
            status == 409 && body.contains("a real robot is driven by its own"),
            "{status} {body}"
        );
    }
    assert!(moving(port)["remote"].is_null() && state(port)["is_simulated"] == false);
    let (status, body) = http(port, "POST", "/wish", JSON, r#"{"break":"cut:1"}"#);
    assert!(status == 409 && body.contains("a real robot"), "{status} {body}");
    for (more, why) in [
        ("--script", "--script is for --sim and --emu"),
        ("--pace=0.2", "--pace are for --sim and --emu"),
        ("--pace=0", "from 0.01 to 1"),
        ("--pace=NaN", "from 0.01 to 1"),
    ] {
        let refused = rc10().args(["live", &place, "--page", "0", more]).output().unwrap();
        assert!(String::from_utf8_lossy(&refused.stderr).contains(why), "{refused:?}");
    }
    if has_browser() {
        let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
        page.look("look('robot')");
        page.until("return state.whole === true && moving.field !== undefined");
        assert_eq!(
            page.look("return $('drive').hidden && $('broken').hidden && !$('field').hidden"),
            json!(true)
        );
    }
}

fn drive(port: u16, wish: &Value) -> (u16, String) {
    http(port, "POST", "/drive", JSON, &wish.to_string())
}

fn take(port: u16) -> u64 {
    let (status, body) = drive(port, &json!("take"));
    assert_eq!(status, 200, "{body}");
    serde_json::from_str::<Value>(&body).unwrap()["number"].as_u64().unwrap()
}

fn state(port: u16) -> Value {
    serde_json::from_str(&http(port, "GET", "/state", "", "").1).unwrap()
}

fn moving(port: u16) -> Value {
    serde_json::from_str(&http(port, "GET", "/moving", "", "").1).unwrap()
}

fn signal(state: &Value, label: &str, name: &str) -> f64 {
    let all = state["signals"].as_array();
    let found =
        all.and_then(|all| all.iter().find(|it| it["label"] == label && it["name"] == name));
    found.and_then(|it| it["value"].as_f64()).unwrap_or(f64::NAN)
}

fn until_of(look: impl Fn() -> Value, mut is_so: impl FnMut(&Value) -> bool) -> Value {
    let begin = Instant::now();
    loop {
        let value = look();
        if is_so(&value) {
            return value;
        }
        assert!(begin.elapsed() < Duration::from_secs(300), "never: {value:.600}");
        sleep(Duration::from_millis(10));
    }
}

fn until(port: u16, is_so: impl FnMut(&Value) -> bool) -> Value {
    until_of(|| moving(port), is_so)
}

fn until_state(port: u16, is_so: impl FnMut(&Value) -> bool) -> Value {
    until_of(|| state(port), is_so)
}

/// A robot with this receiver, whose remote lies there disarmed.
fn with_robot<T>(receiver: Receiver, seed: u64, test: impl FnOnce(&mut Simulation<'_>) -> T) -> T {
    rc10_cli::with::<team::Robot, _>(|shared, motors| {
        let mut robot = rc10_cli::robot_of::<team::Robot>(shared, motors).unwrap();
        robot.set_remote(receiver).unwrap();
        let mut running = Simulation::new(robot, seed, None).unwrap();
        running.operator().unwrap().lay_down();
        test(&mut running)
    })
}

/// Lets it go on, with hands that say every 20 ms where the controls are.
fn hold_for(running: &mut Simulation<'_>, controls: Controls, millis: u64) {
    for _ in 0..millis / 20 {
        let now = running.now();
        running.operator().unwrap().hold(controls, Some(now + Micros::from_millis(250)));
        running.run_to(now + Micros::from_millis(20)).unwrap();
    }
}

fn arm_of(running: &Simulation<'_>) -> ArmState {
    running.moment(running.now()).robot.whole.arm.unwrap()
}

/// Page's look at a gamepad and step of the world, in which a stick may have moved already.
const BEFORE: Micros = Micros::from_millis(4 + 4);

/// From the stick to the wheel, in the robot's time, over the phases of each receiver's frames and the robot's tasks.
#[test]
fn a_wheel_follows_its_stick_within_60_ms() {
    let armed = Controls::REST;
    let forward = Controls { left: Stick { x: 0.0, y: 1.0 }, ..armed };
    for receiver in Receiver::ALL {
        let mut worst = Micros::ZERO;
        for phase in 0..24 {
            let late = with_robot(receiver, 1 + phase, |running| {
                let safe = running.operator().unwrap().safe();
                hold_for(running, safe, 600);
                hold_for(running, armed, 400);
                assert_eq!(arm_of(running), ArmState::Armed, "{receiver}");
                let begin = running.now() + Micros::new(phase * 917);
                running.run_to(begin).unwrap();
                running.operator().unwrap().hold(forward, Some(begin + Micros::from_millis(250)));
                let mut now = begin;
                let turns = |it: &Simulation<'_>| it.twins()[0].state().output_rpm.abs() > 1.0;
                while !turns(running) {
                    now += Micros::new(500);
                    assert!(now.since(begin) < Micros::from_millis(200), "{receiver}: never");
                    running.run_to(now).unwrap();
                }
                now.since(begin)
            });
            worst = worst.max(late);
        }
        let all = worst + BEFORE;
        println!(
            "{receiver}: worst {worst:?} from the hand, {all:?} from the gamepad, of 24 phases"
        );
        assert!(all < Micros::from_millis(60), "{receiver}: {all:?}");
    }
}

/// A page that says nothing more: every receiver does what such receivers do, and the robot stands, then is disarmed.
#[test]
fn without_a_word_of_the_page_every_robot_loses_its_remote() {
    let forward = Controls { left: Stick { x: 0.0, y: 1.0 }, ..Controls::REST };
    for receiver in Receiver::ALL {
        with_robot(receiver, 7, |running| {
            let safe = running.operator().unwrap().safe();
            hold_for(running, safe, 600);
            hold_for(running, Controls::REST, 400);
            hold_for(running, forward, 600);
            assert!(running.twins()[0].state().output_rpm.abs() > 50.0, "{receiver}");
            let end = running.now();
            let frames = running.operator().unwrap().remote().sent().live;
            running.run_to(end + Micros::from_millis(800)).unwrap();
            // The last word holds for 250 ms less the 20 since it.
            let operator = running.operator().unwrap();
            assert!(!operator.is_on(), "{receiver}");
            let more = operator.remote().sent().live - frames;
            assert!(more < 45, "{receiver}: {more} frames");
            assert_ne!(arm_of(running), ArmState::Armed, "{receiver}");
            running.run_to(end + Micros::from_millis(2500)).unwrap();
            assert_eq!(arm_of(running), ArmState::Disarmed, "{receiver}");
            assert!(running.twins()[0].state().idle, "{receiver}: it coasts");
            // Back, but not armed: the switch was in no other position since.
            hold_for(running, forward, 400);
            assert!(running.operator().unwrap().is_on());
            assert_eq!(arm_of(running), ArmState::Disarmed, "{receiver}");
            hold_for(running, safe, 400);
            hold_for(running, Controls::REST, 400);
            assert_eq!(arm_of(running), ArmState::Armed, "{receiver}");
        });
    }
}
