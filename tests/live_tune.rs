//! Tuning on the page of `rc10 live`: one motor's panel, as a person uses it. Without Chromium and its driver it says so,
//! and nothing is tested.

#[path = "live/table.rs"]
mod table;

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpListener;
use std::process::Command;
use std::time::Duration;

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::{Started, http, live, until};
use rc10_cli::live::Action;
use rc10_cli::record::Kit;
use rc10_cli::run::running::Running as _;
use rc10_cli::run::simulation::Simulation;
use rc10_cli::{Description, Plant, Robot};
use rc10_link::Ask;
use rc10_link::frame::FromPc;
use rc10_module::Stream;
use rc10_motor::embassy::Ports;
use rc10_tasks::Common;
use rc10_time::Micros;
use serde_json::{Value, json};

/// The robot that drives itself, and one that no remote arms.
const DRIVES: &[&str] = &["--sim", "--script"];
const RESTS: &[&str] = &["--sim", "--fault", "remote-lost@0s..3600s"];

fn rc10() -> Command {
    Command::new(env!("CARGO_BIN_EXE_rc10"))
}

/// A disarmed robot behind a serial server, whose time waits for the PC: 40 ms of it pass after each word, and of a motor
/// that is jogged after each jog. So on a busy machine it is slow, and no word comes late. Half of what ends a jog.
fn patient(listener: &TcpListener) {
    let (mut stream, _) = listener.accept().unwrap();
    stream.set_read_timeout(Some(Duration::from_millis(4))).unwrap();
    rc10_cli::with::<team::Robot, _>(|shared, motors| {
        let robot = rc10_cli::robot_of::<team::Robot>(shared, motors).unwrap();
        let mut world = Simulation::new(robot, 1, Some(921_600)).unwrap();
        world.operator().unwrap().lay_down();
        let line = world.console().unwrap().clone();
        let (mut asks, mut bytes) = (Stream::new(FromPc), [0; 4096]);
        let (mut jogs, mut until) = (false, Micros::ZERO);
        loop {
            let now = world.now();
            match stream.read(&mut bytes) {
                Ok(count @ 1..) => {
                    let (said, mut counts) = (&bytes[..count], !jogs);
                    asks.receive(said, now, |ask| {
                        if let Ask::Act { action: Action::Jog(_, tenths), .. } = ask {
                            (jogs, counts) = (tenths != 0, true);
                        }
                    });
                    until = if counts { now + Micros::from_millis(40) } else { until };
                    line.send(said);
                }
                Err(why) if matches!(why.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                _ => return,
            }
            if now < until {
                world.run_to(now + Micros::from_millis(4)).unwrap();
                stream.write_all(&line.take()).unwrap();
            }
        }
    });
}

struct Page {
    browser: Browser,
    port: u16,
    _live: Started,
    folder: Scratch,
}

impl Page {
    fn open(name: &str, source: &[&str]) -> Option<Self> {
        if !has_browser() {
            return None;
        }
        let folder = Scratch::new(name);
        let (_live, port) = Self::serve(&folder, 0, source);
        let browser = Browser::open(&format!("http://127.0.0.1:{port}/"));
        browser.until("return begun && state.signals.length > 100");
        browser.look("look('motors')");
        Some(Self { browser, port, _live, folder })
    }

    fn serve(folder: &Scratch, port: u16, source: &[&str]) -> (Started, u16) {
        let port = port.to_string();
        let mut command = rc10();
        let command = command.args(["live", "--page", &port, "--out"]).arg(&**folder);
        live(command.args(source).current_dir(&**folder))
    }

    fn number(&self, script: &str) -> f64 {
        let value = self.browser.look(&format!("return {script}"));
        value.as_f64().unwrap_or_else(|| panic!("{script}: {value}"))
    }

    fn text(&self, selector: &str) -> String {
        let value =
            self.browser.look(&format!("return document.querySelector(`{selector}`).textContent"));
        value.as_str().unwrap().to_owned()
    }

    fn until_value(&self, full: &str, value: f64) {
        self.browser.until(&format!("return Math.abs(of('{full}').value - {value}) < 1e-6"));
    }

    /// Opens a motor's panel, by its row's button and Return.
    fn tune(&self, label: &str) {
        self.browser.look(&format!(
            "document.querySelector(`#motors tr[data-motor='{label}'] button.plain`).focus()"
        ));
        self.browser.keys("\u{E007}");
        self.browser.until(&format!("return tuned === '{label}' && $('gains').rows.length >= 6"));
    }

    /// Types into the panel's box of a parameter, without Return.
    fn type_in(&self, full: &str, text: &str) {
        self.browser.look(&format!(
            "const it = document.querySelector(`#gains [aria-label='{full}']`); it.focus(); it.select()"
        ));
        self.browser.keys(text);
    }

    fn enter(&self) {
        self.browser.keys("\u{E007}");
    }

    /// What is said at a parameter's box.
    fn said(&self, full: &str) -> String {
        self.text(&format!("#gains tr[data-parameter='{full}'] small"))
    }

    fn until_said(&self, full: &str, words: &str) {
        self.browser.until(&format!(
            "return document.querySelector(`#gains tr[data-parameter='{full}'] small`).textContent.includes('{words}')"
        ));
    }

    /// From now on the bodies of all changes that are sent are kept.
    fn listen(&self) {
        self.browser.look(
            "window.sent = []; const send = window.fetch; \
             window.fetch = (where, what) => { if (what && String(what.body).includes('\"set\"')) sent.push(JSON.parse(what.body).set); return send(where, what); }",
        );
    }
}

#[test]
fn a_gain_ten_times_as_high_is_warned_of_and_turns_red() {
    let Some(page) = Page::open("tune-warned", DRIVES) else { return };
    let (label, full) = ("gimbal yaw", "gimbal_yaw.speed_kp");
    page.tune(label);
    page.browser.until("return named('', 'arm') === 'Armed'");
    let before = page.number(&format!("of('{full}').value"));
    // The plot beside it is that of the motor.
    let of_motor = format!(
        "state.signals.find((it) => it.label === '{label}' && it.name === 'measured').index"
    );
    assert_eq!(page.browser.look(&format!("return chosen.has({of_motor})")), json!(true));
    // With a comma, and nothing is sent yet.
    page.type_in(full, &(10.0 * before).to_string().replace('.', ","));
    page.until_said(full, "ask for");
    let told = page.said(full);
    println!("{told}");
    let part = |after: &str| {
        let rest = told.split(after).nth(1).unwrap_or_else(|| panic!("no {after} in {told}"));
        let number = rest.split([' ', ',', ';']).next().unwrap();
        number.parse::<f64>().unwrap_or_else(|_| panic!("{number} in {told}"))
    };
    let (margin, now, ask) = (part(" loop "), part("now "), part("ask for "));
    assert!((margin * 10.0 - now).abs() < 1.0 && margin < 5.0 && ask < 10.0 * before, "{told}");
    assert!(page.said(full).contains("oscillate"));
    assert!((page.number(&format!("of('{full}').value")) - before).abs() < 1e-9);
    // What it asks for is not warned of.
    page.type_in(full, &ask.to_string());
    page.browser.until(&format!(
        "return document.querySelector(`#gains tr[data-parameter='{full}'] small`).className === 'hint'"
    ));
    // Refused, and why.
    page.type_in(full, &(11.0 * before).to_string());
    page.enter();
    page.until_said(full, "out of its range: 0 to");
    page.type_in(full, "much");
    page.enter();
    page.until_said(full, "no number");
    // Twice: it is meant.
    page.browser.look("document.querySelector('#record').click()");
    page.browser.until("return state.record !== null && state.record.seconds > 1");
    page.type_in(full, &(10.0 * before).to_string().replace('.', ","));
    page.enter();
    page.until_said(full, "once more");
    page.enter();
    page.until_value(full, 10.0 * before);
    // With its angle loop, too, it shakes at the first motion of the script.
    let begin = page.number("state.now");
    page.browser.look("return send([['gimbal_yaw.angle_kp', of('gimbal_yaw.angle_kp').range[1]]])");
    // When it was judged so, in the robot's time: how late the page shows it is the machine's business.
    let mut judged = None;
    until("it shakes", || {
        let (_, state) = http(page.port, "GET", "/state", "", "");
        let state: Value = serde_json::from_str(&state).unwrap();
        judged = state["judged"].as_f64();
        let mut all = state["problems"].as_array().unwrap().iter();
        all.any(|it| it["about"] == label && it["kind"] == "oscillation")
    });
    let told = judged.unwrap() - begin;
    page.browser.until(&format!(
        "return [...document.querySelectorAll('#problems li.problem')].some((it) => it.textContent.includes('{label}: shakes'))"
    ));
    // Since when: 0.6 s in which the effort changes its direction four times in each 0.2 s.
    let script = format!(
        "const done = arguments[0], index = state.signals.find((it) => it.label === '{label}' && it.name === 'effort').index; \
         fetchSeries([index], {begin}, state.now).then((found) => {{ \
           const {{ times, values }} = found.get(index); \
           const turns = (from) => {{ const some = values.slice(from, from + 20), mean = some.reduce((a, b) => a + b, 0) / 20; let side = 0, count = 0; \
             for (const it of some) if (Math.abs(it - mean) > 0.15) {{ if ((it - mean) * side < 0) count += 1; side = it - mean; }} return count; }}; \
           for (let i = 0; i + 60 <= times.length; i += 1) if ([0, 20, 40].every((more) => turns(i + more) >= 4)) return done(times[i]); \
           done(null); }});"
    );
    let since = page.browser.tell("execute/async", &json!({ "script": script, "args": [] }));
    let took = told * 1e-6 - since.as_f64().unwrap();
    println!("red {took:.2} s of the robot's time after it began to shake");
    assert!(took <= 2.0, "{took}");
    page.browser.look("document.querySelector('#record').click()");
    page.browser.until("return document.querySelector('#note').textContent.includes('001.mcap')");
    let report = rc10()
        .arg("report")
        .arg(page.folder.join("001.mcap"))
        .arg("--out")
        .arg(page.folder.join("report"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&report.stdout);
    assert!(text.contains(&format!("{label}: shakes: its effort changes direction")), "{text}");
}

#[test]
fn motors_alike_change_in_one_request_or_none_and_undo_outlives_a_reload() {
    let Some(mut page) = Page::open("tune-alike", RESTS) else { return };
    page.listen();
    page.tune("wheel front left");
    assert_eq!(page.text("#alike-label"), " All 4 alike");
    let wheels = ["front_left", "front_right", "rear_left", "rear_right"];
    let wheels = wheels.map(|place| format!("wheel_{place}.speed_kp"));
    let all = |value: f64| wheels.iter().for_each(|full| page.until_value(full, value));
    // One alone, by a step button.
    page.browser.look(
        "document.querySelector(`#gains [aria-label='wheel_front_left.speed_kp ×1.25']`).click()",
    );
    page.until_value(&wheels[0], 0.5);
    page.until_value(&wheels[1], 0.4);
    // The other three, by one click.
    page.browser.until("return !$('same').hidden");
    assert_eq!(page.text("#same"), "Make the other 3 the same");
    page.browser.look("$('same').click()");
    all(0.5);
    page.browser.look("$('alike').click()");
    page.type_in(&wheels[0], "0,6");
    page.enter();
    all(0.6);
    let sent = page.browser.look("return sent");
    let counts: Vec<_> =
        sent.as_array().unwrap().iter().map(|it| it.as_array().unwrap().len()).collect();
    assert_eq!(counts, [1, 3, 4], "{sent}");
    // One of them is out of its range, as it never is by the page: none changes.
    let why = page.browser.look(
        "const four = alikes(tuned).map((label, at) => [sibling(gainsOf(tuned)[0], label), at < 3 ? 0.7 : 99]); \
         return send(four).then(() => 'sent', (error) => error.message)",
    );
    assert!(why.as_str().unwrap().contains("out of its range"), "{why}");
    page.browser.pass(0.5);
    all(0.6);
    // Marks and steps back are there after a reload.
    page.browser.tell("refresh", &json!({}));
    page.browser.until("return begun && undo.length === 3");
    page.browser.look("look('motors')");
    page.tune("wheel rear right");
    assert_eq!(page.text("#gains tr.changed td"), "speed_kp");
    let marked = "return document.querySelectorAll('#motors td.changed').length";
    assert_eq!(page.browser.look(marked), json!(4));
    for (left, value, alone) in [(2, 0.5, 0.5), (1, 0.5, 0.4), (0, 0.4, 0.4)] {
        page.browser.look("document.querySelector('#tune .undo').click()");
        page.until_value(&wheels[0], value);
        wheels[1..].iter().for_each(|full| page.until_value(full, alone));
        page.browser.until(&format!("return undo.length === {left}"));
    }
    page.browser.until(&marked.replace("length", "length === 0"));
    // Another boot of the same robot at the same address: what was done to the one before is not undone.
    page.type_in("wheel_rear_right.speed_ki", "5");
    page.enter();
    page.until_value("wheel_rear_right.speed_ki", 5.0);
    page.browser.until("return undo.length === 1");
    page._live.0.kill().unwrap();
    page._live.0.wait().unwrap();
    page._live = Page::serve(&page.folder, page.port, RESTS).0;
    page.browser.until(
        "return state.whole && of('wheel_rear_right.speed_ki').value === 4 && undo.length === 0",
    );
    page.browser.tell("refresh", &json!({}));
    page.browser.until("return begun && undoOf !== null && undo.length === 0");
}

#[test]
fn a_copy_for_the_table_is_rust_and_its_values_arrive() {
    let Some(page) = Page::open("tune-copy", RESTS) else { return };
    page.tune("wheel front left");
    page.browser.look("$('alike').click()");
    page.type_in("wheel_front_left.speed_kp", "0,5");
    page.enter();
    page.until_value("wheel_rear_right.speed_kp", 0.5);
    page.browser.look(
        "send([['gimbal_yaw.angle_kp', 1.25], ['gimbal_yaw.limit', 2.5], ['feeder_speed', 200]])",
    );
    page.until_value("feeder_speed", 200.0);
    page.browser.look("$('copy').click()");
    page.browser.until("return $('copied').textContent.includes('feeder speed')");
    let copied = page.text("#copied");
    println!("{copied}");
    let file = include_str!("live/table.rs");
    let mut lines = file.lines().map(str::trim);
    for line in copied.lines() {
        assert!(lines.any(|it| it == line), "not in tests/live/table.rs: {line}\n{copied}");
    }
    let ports = Ports::<table::Name, 2>::new();
    let shared = Common::<_, table::Own>::new(&ports);
    assert!((shared.own.feeder.get() - 200.0).abs() < 1e-6);
    let mut motors = table::Motors::new();
    let buses = motors.start(&shared.switch).unwrap().buses;
    let description = Description::of(|_: table::Name| Plant::inertia(0.05));
    let robot = Robot::on(description, buses, [], &shared);
    let kit = Kit::of(&robot);
    let [wheel, yaw] = [0, 1].map(|line: usize| kit.loops()[line].unwrap().cascade);
    assert_eq!((wheel.speed.kp, wheel.speed.ki, wheel.speed.output_limit), (0.5, 4.0, 20.0));
    assert_eq!((yaw.speed.output_limit, yaw.angle.kp, yaw.speed.kp), (2.5, 1.25, 0.12));
}

/// A system of second order: its answer to a step, the figures of that by formulas, and by looking very closely.
struct SecondOrder {
    frequency: f64,
    damping: f64,
    from: f64,
    to: f64,
    /// Share of the step that it does in the end.
    gain: f64,
}

impl SecondOrder {
    fn share(&self, t: f64) -> f64 {
        let Self { frequency, damping, .. } = *self;
        let root = (1.0 - damping * damping).sqrt();
        let phase = frequency * root * t + damping.acos();
        1.0 - (-damping * frequency * t).exp() / root * phase.sin()
    }

    fn value(&self, t: f64) -> f64 {
        self.from + self.gain * (self.to - self.from) * self.share(t)
    }

    /// Rise time, overshoot in %, settling time, and the error that is left.
    fn figures(&self) -> [f64; 4] {
        let times = || (0..2_000_000).map(|step| f64::from(step) * 1e-6);
        let first = |level: f64| times().find(|t| self.share(*t) >= level).unwrap();
        let last = times().rfind(|t| (self.share(*t) - 1.0).abs() > 0.05).unwrap();
        let root = (1.0 - self.damping * self.damping).sqrt();
        let overshoot = 100.0 * (-std::f64::consts::PI * self.damping / root).exp();
        [first(0.9) - first(0.1), overshoot, last, (1.0 - self.gain) * (self.to - self.from)]
    }
}

#[test]
fn the_figures_of_steps_are_right_and_five_lie_over_one_another() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let place = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || patient(&listener));
    let source = ["--port", &place, "--baud", "921600"];
    let Some(page) = Page::open("tune-steps", &source) else { return };
    for curve in [
        SecondOrder { frequency: 30.0, damping: 0.3, from: 10.0, to: 30.0, gain: 0.95 },
        SecondOrder { frequency: 20.0, damping: 0.6, from: 0.0, to: -20.0, gain: 0.9 },
        SecondOrder { frequency: 60.0, damping: 0.2, from: 100.0, to: 0.0, gain: 1.1 },
    ] {
        // As the page gets it: half a second before the step, and two seconds after, each millisecond.
        let times: Vec<_> = (0..2500).map(|at| f64::from(at) * 1e-3).collect();
        let after = |t: &f64| *t >= 0.5;
        let target: Vec<_> =
            times.iter().map(|t| if after(t) { curve.to } else { curve.from }).collect();
        let value = |t: &f64| if after(t) { curve.value(t - 0.5) } else { curve.from };
        let measured: Vec<_> = times.iter().map(value).collect();
        let found = page.browser.look(&format!(
            "const times = {times:?}; return Step.find({{ times, values: {target:?} }}, {{ times, values: {measured:?} }}, () => true)"
        ));
        assert_eq!(found.as_array().unwrap().len(), 1, "{found}");
        let wanted = curve.figures();
        let told =
            ["rise", "overshoot", "settling", "error"].map(|name| found[0][name].as_f64().unwrap());
        println!("{told:?}, by formulas {wanted:?}");
        for (told, wanted) in told.iter().zip(wanted) {
            assert!((told / wanted - 1.0).abs() < 0.02, "{told} {wanted}");
        }
        assert!((found[0]["at"].as_f64().unwrap() - 0.5).abs() < 1e-6);
    }
    // A ramp is no step.
    let ramp = page.browser.look(
        "const times = [...Array(2000).keys()].map((it) => it / 1000), values = times.map((it) => Math.min(1, it)); \
         return Step.find({ times, values }, { times, values }, () => true).length",
    );
    assert_eq!(ramp, json!(0));

    // On blocks: held by Return.
    page.tune("wheel front left");
    page.browser.look("$('step').focus()");
    page.browser.hold("\u{E007}", "keyDown");
    page.browser.until(
        "return testing === null && held === null && !$('step-said').textContent.includes('turns')",
    );
    page.browser.hold("\u{E007}", "keyUp");
    assert!(page.number("overlay.length") > 0.0, "{}", page.text("#step-said"));
    let number = |name: &str| page.number(&format!("overlay[0].{name}"));
    println!("turned by hand: {}", page.text("#figures"));
    assert!((number("to") - 20.0).abs() < 1e-3 && number("from").abs() < 1.0);
    assert!(number("rise") > 0.0 && number("rise") < 1.0);
    // Denser than the 10 ms of always.
    assert!(number("times.length") / number("times.at(-1)") > 300.0);
}

/// A busy PC: its words come so late that the motor stands in between.
#[test]
fn a_step_with_late_words_is_called_interrupted() {
    let Some(page) = Page::open("tune-late", RESTS) else { return };
    page.tune("wheel front left");
    page.browser.look(
        "const send = window.fetch, late = () => new Promise((go) => setTimeout(go, 250)); \
         window.fetch = async (where, what) => { if (what && String(what.body).includes('jog')) await late(); return send(where, what); }; \
         $('step').focus()",
    );
    page.browser.hold("\u{E007}", "keyDown");
    page.browser.until("return testing === null && !$('step-said').textContent.includes('turns')");
    page.browser.hold("\u{E007}", "keyUp");
    let told = page.text("#step-said");
    assert!(told.starts_with("Interrupted: this PC was too late"), "{told}");
}

#[test]
fn a_warning_goes_with_the_value_that_it_was_of() {
    let Some(page) = Page::open("tune-undone", RESTS) else { return };
    let full = "gimbal_yaw.speed_kp";
    page.tune("gimbal yaw");
    let before = page.number(&format!("of('{full}').value"));
    page.type_in(full, &(10.0 * before).to_string());
    page.enter();
    page.until_said(full, "once more");
    page.enter();
    page.until_value(full, 10.0 * before);
    page.browser.pass(0.5);
    page.until_said(full, "oscillate");
    page.browser.look("document.querySelector('#tune .undo').click()");
    page.until_value(full, before);
    page.browser.until(&format!(
        "return document.querySelector(`#gains tr[data-parameter='{full}'] small`).hidden"
    ));
}

#[test]
fn what_rc10_tune_has_found_is_in_the_panel_of_its_motor() {
    let Some(page) = Page::open("tune-found", RESTS) else { return };
    page.tune("wheel front left");
    assert_eq!(page.browser.look("return $('found').hidden"), json!(true));
    // In the folder of the page, from a shell.
    let motor = ["tune", "wheel-front-left", "--travel", "360", "--seconds", "8"];
    let on_blocks = ["--sim", "--mistake", "mass:x0.01"];
    let tuned = rc10().args(motor).args(on_blocks).current_dir(&*page.folder).output().unwrap();
    assert!(tuned.status.success(), "{}", String::from_utf8_lossy(&tuned.stderr));
    page.browser.until("return !$('found').hidden");
    assert!(page.text("#found-text").contains("speed, tuned"), "{}", page.text("#found-text"));
    assert_eq!(page.text("#bode-names"), "nownow, measuredtunedtuned, measured");
    let inks = "const it = $('bode'), all = it.getContext('2d').getImageData(0, 0, it.width, it.height).data; \
         let inked = 0; for (let k = 3; k < all.length; k += 4) inked += all[k] > 200; return inked";
    assert!(page.number(&format!("(() => {{ {inks} }})()")) > 2000.0);
    // Of another motor nothing is found.
    page.tune("wheel rear right");
    page.browser.until("return $('found').hidden");
}

/// Steps that the script makes while the robot is armed serve as well; and small things of the tables.
#[test]
fn an_armed_robot_s_own_steps_are_found_and_its_tables_are_clear() {
    let Some(page) = Page::open("tune-armed", DRIVES) else { return };
    page.tune("feeder");
    page.browser.until("return named('', 'arm') === 'Armed'");
    page.browser.look("window.seen = new Map()");
    for gain in ["0,08", "0,09", "0,11", "0,12", "0,13", "0,14"] {
        page.type_in("feeder.speed_kp", gain);
        page.enter();
        let gain = gain.replace(',', ".");
        page.until_value("feeder.speed_kp", gain.parse().unwrap());
        page.browser.until(&format!(
            "$('steps-found').click(); overlay.forEach((it) => seen.set(it.at, it.gains)); \
             return overlay.some((it) => it.gains.startsWith('speed_kp {gain},'))"
        ));
    }
    println!("{}", page.text("#figures"));
    // The newest five, each with its gains.
    let shown = page.browser.look("return overlay.map((it) => [it.at, it.gains])");
    let newest = page.browser.look("return [...seen].sort((a, b) => a[0] - b[0]).slice(-5)");
    assert!(shown == newest && shown.as_array().unwrap().len() == 5, "{shown} {newest}");
    assert!(page.number("seen.size") > 5.0);
    let rows = "[...$('figures').rows].slice(1)";
    let named = format!(
        "return {rows}.every((row, at) => row.cells[1].textContent === overlay[at].gains) && {rows}.length"
    );
    assert_eq!(page.browser.look(&named), json!(5));
    let inks = page.browser.look(
        "drawSteps(); const it = $('steps'), all = it.getContext('2d').getImageData(0, 0, it.width, it.height).data, seen = new Set(); \
         for (let k = 0; k < all.length; k += 4) if (all[k + 3] > 200) seen.add([all[k], all[k + 1], all[k + 2]].map((it) => it >> 3).join()); \
         const spot = document.body.appendChild(document.createElement('i')); \
         return [0, 1, 2, 3, 4].filter((at) => { spot.style.color = Plot.colour(at); const ink = getComputedStyle(spot).color.match(/\\d+/g).map((it) => it >> 3).join(); return seen.has(ink); }).length",
    );
    // Of lines that are one upon the other the last is seen.
    assert!(inks.as_u64().unwrap() >= 2, "{inks}");
    // Refused, and said below the motor's row.
    let row = "document.querySelector(`#motors tr[data-motor='wheel front left']`)";
    let below = format!(
        "const it = {row}.nextElementSibling; return !it.dataset.motor && it.textContent.includes('disarmed')"
    );
    for at in [1, 3] {
        page.browser.until(&format!(
            "if (named('', 'arm') !== 'Armed') return false; const it = {row}.querySelectorAll('button')[{at}]; \
             it.click(); it.dispatchEvent(new KeyboardEvent('keydown', {{ key: 'Enter' }})); return true"
        ));
        page.browser.until(&below);
        page.browser.look("held = null; tellOf('wheel front left', '')");
    }
    let sizes = "return [...document.querySelectorAll('#motors button, #gains button')].every((it) => { const box = it.getBoundingClientRect(); return box.width >= 24 && box.height >= 24 && it.textContent.length > 0; })";
    assert_eq!(page.browser.look(sizes), json!(true));
    // A counter is an integer; a simulated tick takes no time; states have the colours of the report.
    let (large, small) = ("number(112345)", "number(3.25)");
    assert_eq!(page.browser.look(&format!("return [{large}, {small}]")), json!(["112345", "3.25"]));
    assert!(!page.text("#buses").contains("tick"));
    let colours = page
        .browser
        .look("return ['Run', 'Hold', 'Coast', 'Lost', 'Odd'].map((it) => Plot.state(it, 6))");
    assert_eq!(colours, json!(["state-run", "state-hold", "state-coast", "state-lost", "shade-6"]));
    // Disarmed, there is no target.
    page.browser.look("$('stop').click()");
    page.browser.until("return named('', 'arm') === 'EStopped'");
    page.browser.until(&format!(
        "return named('wheel front left', 'drive') !== 'Run' && {row}.cells[3].textContent === '–'"
    ));
}
