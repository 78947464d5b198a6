//! The page in a browser alone, as `cargo xtask web` makes it: those robots, in a worker. `RC10_WEB` says where it is.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use rc10_cli::{CommandLine, Robot, robot_for_good};
use serde_json::{Value, json};

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::{Started, start};

/// The folder, any file server, and its address.
fn served() -> Option<(PathBuf, Started, String)> {
    let folder = PathBuf::from(std::env::var_os("RC10_WEB").expect("cargo xtask web makes it"));
    has_browser().then(|| {
        let mut server = Command::new("python3");
        server.args(["-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory"]);
        let (server, line) = start(server.arg(&folder), "http://");
        let at = line.split_once("http://").unwrap().1.split('/').next().unwrap().to_owned();
        (folder, server, format!("http://{at}/"))
    })
}

const ARM: &str = "document.querySelector('#arm').textContent";
const WHEELS: &str = "labels('motors').map((it) => value(it, 'speed'))";

/// Arms by the keys that the page names, and drives forward.
fn drive(page: &Browser) {
    page.until("return Drive.holds() !== null && state.whole && moving.remote.on");
    // The switch that arms goes to its safe place, and out of it.
    page.keys("c");
    page.until(&format!("return {ARM} === 'Disarmed' && named('', 'not_at_rest') !== '–'"));
    page.keys("e");
    page.until(&format!("return {ARM} === 'Armed'"));
    page.hold("w", "keyDown");
    page.until(&format!("return {WHEELS}.some((it) => Math.abs(it) > 20)"));
}

fn seconds(page: &Browser, of: &str) -> f64 {
    page.look(&format!("return {of}")).as_f64().unwrap()
}

#[test]
#[ignore = "needs the folder"]
fn wheels_turn_by_the_keyboard_and_coast_when_the_remote_is_let_go() {
    let Some((_, _server, address)) = served() else { return };
    let page = Browser::open(&format!("{address}#robot=starter"));
    drive(&page);
    let [wall, robot] = ["performance.now() / 1e3", "moving.now"].map(|it| seconds(&page, it));
    println!("wheels turn {:.1} s after navigation, {robot:.2} s after the chip's power-on", wall);
    // How long either is, is this machine's; the chip is never before the clock.
    assert!(robot <= wall, "{robot} {wall}");
    // Nothing from another host, and nothing that is not there.
    let asked = page.look("return performance.getEntriesByType('resource').map((it) => it.name)");
    let strangers: Vec<_> = asked
        .as_array()
        .unwrap()
        .iter()
        .filter(|it| !it.as_str().unwrap().starts_with(&address))
        .collect();
    assert!(strangers.is_empty() && asked.as_array().unwrap().len() >= 2, "{asked}");

    // Let go: suspended and coasting within the remote's 120 ms, from the last frame that the robot heard.
    let click = "const begin = moving.now; [...document.querySelectorAll('#drive button')].find((it) => it.textContent === 'Let it go').click(); return begin";
    let begin = page.look(click).as_f64().unwrap();
    page.until(&format!("return {ARM} !== 'Armed'"));
    page.pass(0.5);
    let indices = page.look("return ['remote_frames', 'arm', 'drive'].flatMap((name) => state.signals.filter((it) => it.name === name)).map((it) => it.index)");
    page.look(&format!(
        "fetch('data?signals={}&from={}&to={}&columns=10000').then((it) => it.arrayBuffer()).then((it) => {{ window.got = it; }})",
        indices.as_array().unwrap().iter().map(ToString::to_string).collect::<Vec<_>>().join(","),
        (begin * 1e6).round(), (seconds(&page, "state.now")).round(),
    ));
    page.until("return window.got !== undefined");
    // When the number of frames changed last, and when each of the others left what it was.
    let left = page.look("const view = new DataView(window.got); let at = 8; const left = []; \
        while (at < view.byteLength) { const count = view.getUint32(at, true); at += 4; let first = null, when = null; \
        for (let k = 0; k < count; k += 1, at += 8) { const value = view.getFloat32(at + 4, true); if (first === null) first = value; else if (value !== first && (when === null || !left.length)) [first, when] = [left.length ? first : value, view.getFloat32(at, true)]; } \
        left.push(when); } return left");
    // The arming and the wheels' drives: the starter has nothing else.
    let all: Vec<_> = left.as_array().unwrap().iter().map(Value::as_f64).collect();
    assert!(all.len() >= 4 && all.iter().all(Option::is_some), "{left}");
    let latest = all[1..].iter().flatten().copied().fold(0.0, f64::max) - all[0].unwrap();
    println!("let go: suspended and off after {:.0} ms", latest * 1e3);
    assert!(latest > 0.0 && latest < 0.25, "{left}");
    page.hold("w", "keyUp");
}

type Begin = fn() -> Robot<'static>;

/// What `rc10 emu --json` prints, on this machine.
fn native(robot: Robot<'static>, elf: &Path, seconds: &str) -> (Value, Duration) {
    let (out, mut text, begin) = (Scratch::new("web"), Vec::new(), Instant::now());
    let words = ["rc10", "emu", "--json", "--seconds", seconds].map(Into::into);
    let words = words.into_iter().chain([
        "--out".into(),
        out.as_os_str().to_owned(),
        elf.as_os_str().to_owned(),
    ]);
    CommandLine::parse(words).unwrap().run_to(robot, &mut text).unwrap();
    (serde_json::from_slice(&text).unwrap(), begin.elapsed())
}

#[test]
#[ignore = "needs the folder"]
fn the_same_bytes_are_on_the_wires_in_the_browser() {
    let Some((folder, _server, address)) = served() else { return };
    let robots: [(&str, Begin); 3] = [
        ("starter", || robot_for_good::<starter::Robot>().unwrap()),
        ("omni", || robot_for_good::<omni::Robot>().unwrap()),
        ("team", || robot_for_good::<team::Robot>().unwrap()),
    ];
    for (name, robot) in robots {
        let elf = folder.join(format!("robots/{name}-h723zg.elf"));
        // The page's own robot is a simulated one, and stands still.
        let page = Browser::open(&format!("{address}#robot={name}&board=sim"));
        page.until("return state.whole");
        page.look(&format!(
            "Web.program('{name}', 'h723zg').then((elf) => {{ window.begun = performance.now(); return Web.command(['emu', '/robot.elf', '--json', '--seconds', '10', '--out', '/out'], {{ 'robot.elf': elf }}); }}) \
             .then((it) => {{ window.took = performance.now() - window.begun; window.ran = it; }}, (error) => {{ window.ran = {{ text: String(error) }}; }})"
        ));
        page.until("return window.ran !== undefined");
        let text = page.look("return window.ran.text");
        let here: Value =
            serde_json::from_str(text.as_str().unwrap()).unwrap_or_else(|_| panic!("{text}"));
        let took = seconds(&page, "window.took") / 1e3;
        drop(page);
        let (there, native) = native(robot(), &elf, "10");
        println!(
            "{name}: {} in both; 10 s took {took:.1} s in the browser, {:.1} s natively: {:.2} of real time, {:.2} of native",
            there["content_hash"],
            native.as_secs_f64(),
            10.0 / took,
            native.as_secs_f64() / took
        );
        assert_eq!(here["content_hash"], there["content_hash"], "{name}");
        assert_eq!(here["instructions"], there["instructions"], "{name}");
        assert!(there["content_hash"].as_str().unwrap().len() == 64);
    }
}

#[test]
#[ignore = "needs the folder"]
fn what_is_broken_by_click_stands_on_the_page_and_in_the_log() {
    let Some((folder, _server, address)) = served() else { return };
    let page = Browser::open(&format!("{address}#robot=omni&lesson=plug"));
    drive(&page);
    page.look("document.querySelector('#log').open = true; attempt({ break: 'cut:' + labels('motors')[0].replaceAll(' ', '-') })");
    page.until("return state.broken.length === 1 && state.problems.length > 0");
    page.until(
        "return /[^0-9]6 of 7 motors online/.test(document.querySelector('#log pre').textContent)",
    );
    // It is drawn a moment after it is known.
    page.until(
        "return document.querySelector('#problems').textContent.includes(labels('motors')[0])",
    );
    let label = page.look("return labels('motors')[0]");
    let problems = page.look("return document.querySelector('#problems').textContent");
    println!("{problems}\n{}", page.look("return state.log.slice(-3)"));
    assert!(problems.as_str().unwrap().contains(label.as_str().unwrap()), "{problems}");
    page.look("attempt({ mend: state.broken[0] })");
    page.until("return state.broken.length === 0");
    page.until("return document.querySelectorAll('.lesson .done').length >= 4");

    // A mistake begins the robot anew, and stands in the address.
    page.look("attempt({ break: 'radius:x2' })");
    page.until("return location.hash.includes('mistake=radius') && state.whole && state.broken.length === 1 && moving.now < 20");
    page.hold("w", "keyUp");

    // A program of one's own, as rc10 new leads to.
    let place = Scratch::new("own");
    let elf = place.join("mine.elf");
    fs::copy(folder.join("robots/starter-h723zg.elf"), &elf).unwrap();
    page.look("history.replaceState(null, '', '#robot=starter')");
    page.tell("refresh", &json!({}));
    page.until("return state.whole && state.name.length > 0");
    let input =
        page.tell("element", &json!({ "using": "css selector", "value": "#web input[type=file]" }));
    let id = input.as_object().unwrap().values().next().unwrap().as_str().unwrap().to_owned();
    page.tell(&format!("element/{id}/value"), &json!({ "text": elf.display().to_string() }));
    page.until("return (state.name || '').includes('mine.elf') && state.whole");
    // A record, and its report.
    page.look("$('record').click()");
    page.until("return state.record && state.record.seconds > 1");
    page.look("$('record').click()");
    page.until("return state.report === 'ready'");
    page.look("fetch('report').then((it) => it.text()).then((it) => { window.gotten = it; })");
    page.until(
        "return (window.gotten || '').includes('<canvas') || (window.gotten || '').length > 20000",
    );
    // Nonsense is refused, and the page says why.
    page.look("history.replaceState(null, '', '#robot=nobody')");
    page.tell("refresh", &json!({}));
    page.until("return document.querySelector('#web span').textContent.length > 0");
    println!("{}", page.look("return document.querySelector('#web span').textContent"));
}

#[test]
#[ignore = "needs the folder"]
fn module_page_and_a_program_are_at_most_three_megabytes() {
    let folder = PathBuf::from(std::env::var_os("RC10_WEB").expect("cargo xtask web makes it"));
    let packed = |file: PathBuf| {
        let output = Command::new("gzip").args(["-9", "--stdout"]).arg(file).output().unwrap();
        output.stdout.len()
    };
    let inside = |name: &str| fs::read_dir(folder.join(name)).unwrap().map(|it| it.unwrap().path());
    let elf = inside("robots").map(packed).max().unwrap();
    let rest: usize = inside(".").filter(|it| it.is_file()).chain(inside("wasi")).map(packed).sum();
    println!("{} bytes, {elf} of them the largest program", rest + elf);
    assert!(rest > 1_000_000 && rest + elf <= 3_000_000, "{rest} {elf}");
}

/// The state after every tick is the same on three processors: the emulated chip's, this one's, and WebAssembly's.
#[test]
#[ignore = "needs the folder"]
fn what_the_chip_recorded_is_replayed_in_webassembly_bit_for_bit() {
    let folder = PathBuf::from(std::env::var_os("RC10_WEB").expect("cargo xtask web makes it"));
    let files = Scratch::new("web-replay");
    let team = |words: &[&str]| {
        let mut out = Vec::new();
        let words = ["rc10"].iter().chain(words);
        let robot = robot_for_good::<team::Robot>().unwrap();
        let code = CommandLine::parse(words).unwrap().run_to(robot, &mut out).unwrap();
        assert_eq!(code, 0);
        String::from_utf8(out).unwrap()
    };
    let path = |name: &str| files.join(name).display().to_string();
    // With its own build of the firmware, which has a black box.
    for (how, name) in [("emu", "chip.mcap"), ("run", "sim.mcap")] {
        let [record, out] = [path(name), path("out")];
        team(&[how, "--seconds", "2", "--record", &record, "--out", &out]);
        let own = team(&["replay", &record]);
        let node = Command::new("node")
            .args(["--no-warnings", "tests/node/replay.mjs"])
            .arg(folder.join("rc10.wasm"))
            .arg(&*files)
            .args(["team", "replay", &format!("/{name}")])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&node.stdout);
        println!("{said}");
        assert!(own.starts_with("equal: ") && own.lines().count() == 1, "{own}");
        assert_eq!(said, own, "{}", String::from_utf8_lossy(&node.stderr));
    }
}
