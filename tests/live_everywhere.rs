//! The page and the report for everyone: on each width, in the dark, by keyboard, before a screen reader, on a
//! phone. Without Chromium and its driver it says so, and nothing is tested; without npm axe does not look.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use serde_json::{Value, json};

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::{Started, live, start};

/// axe's script, pinned in `tests/node`.
fn axe() -> Option<&'static str> {
    static AXE: OnceLock<Option<String>> = OnceLock::new();
    let load = || {
        if Command::new("npm").arg("--version").output().is_err() {
            eprintln!("SKIPPED: no npm on this machine: axe does not look at the page");
            return None;
        }
        let place = Scratch::new("axe");
        for name in ["package.json", "package-lock.json"] {
            let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/node").join(name);
            fs::copy(from, place.join(name)).unwrap();
        }
        let install = Command::new("npm")
            .args(["ci", "--no-audit", "--no-fund"])
            .current_dir(&place)
            .output();
        let install = install.unwrap();
        assert!(install.status.success(), "npm ci: {}", String::from_utf8_lossy(&install.stderr));
        Some(fs::read_to_string(place.join("node_modules/axe-core/axe.min.js")).unwrap())
    };
    AXE.get_or_init(load).as_deref()
}

/// Shows the page in a window of this size, light or dark.
fn dress(page: &Browser, [width, height]: [u32; 2], is_dark: bool) {
    let tell = |cmd: &str, params: Value| {
        page.tell("goog/cdp/execute", &json!({ "cmd": cmd, "params": params }));
    };
    tell(
        "Emulation.setDeviceMetricsOverride",
        json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500 }),
    );
    let scheme = if is_dark { "dark" } else { "light" };
    let features = [json!({ "name": "prefers-color-scheme", "value": scheme })];
    tell("Emulation.setEmulatedMedia", json!({ "features": features }));
}

/// What axe finds that is serious or critical, with the first place of each.
fn findings(page: &Browser) -> Value {
    let Some(axe) = axe() else { return json!([]) };
    page.look(axe);
    let script = "const done = arguments[arguments.length - 1]; \
        axe.run(document, { resultTypes: ['violations'] }).then((all) => done(all.violations \
        .filter((it) => ['serious', 'critical'].includes(it.impact)) \
        .map((it) => [it.id, it.nodes[0].html, it.nodes[0].failureSummary])), (error) => done(String(error)));";
    page.tell("execute/async", &json!({ "script": script, "args": [] }))
}

/// The sizes of a phone, a small and a large window.
const SIZES: [[u32; 2]; 3] = [[390, 844], [1000, 700], [1440, 900]];

fn look_everywhere(page: &Browser, name: &str) -> Vec<String> {
    let mut found = Vec::new();
    for is_dark in [false, true] {
        for size in SIZES {
            dress(page, size, is_dark);
            for finding in findings(page).as_array().unwrap() {
                found.push(format!("{name}, {size:?}, dark: {is_dark}: {finding}"));
            }
            // A phone's browser widens its window for what is too wide: `innerWidth` would be that.
            let wide = page.look("return document.documentElement.scrollWidth");
            if wide.as_f64().unwrap() > f64::from(size[0]) {
                found.push(format!("{name} scrolls sideways at {size:?}"));
            }
        }
    }
    found
}

#[test]
fn axe_finds_nothing_serious_on_page_and_report() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("everywhere");
    let (_live, port) = live(
        Command::new(env!("CARGO_BIN_EXE_rc10")).args(["live", "--sim", "--script", "--page", "0"]),
    );
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return document.querySelectorAll('.plot').length >= 2");
    for view in ["robot", "motors", "more"] {
        page.look(&format!("document.querySelector('[aria-controls=tab-{view}]').click()"));
        let found = look_everywhere(&page, view);
        assert!(found.is_empty(), "{found:#?}");
    }
    // STOP is in sight of a phone, and large.
    dress(&page, SIZES[0], false);
    page.until(
        "const it = document.querySelector('#stop').getBoundingClientRect(); \
         return it.top >= 0 && it.bottom <= innerHeight && it.height >= 44 && it.width >= 150",
    );
    let report = folder.join("report.html");
    let run = Command::new(env!("CARGO_BIN_EXE_rc10"))
        .args(["run", "--seconds", "4", "--out"])
        .arg(&*folder)
        .output()
        .unwrap();
    assert!(report.is_file(), "{}", String::from_utf8_lossy(&run.stderr));
    page.tell("url", &json!({ "url": format!("file://{}", report.display()) }));
    page.until("return document.querySelectorAll('canvas').length > 3");
    let found = look_everywhere(&page, "report");
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn the_page_by_keyboard_alone() {
    if !has_browser() {
        return;
    }
    let (_live, port) = live(
        Command::new(env!("CARGO_BIN_EXE_rc10")).args(["live", "--sim", "--script", "--page", "0"]),
    );
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return document.querySelectorAll('.plot').length >= 2");
    // Every control that is seen is reached by Tab, and Return works it.
    page.look("document.querySelector('[aria-controls=tab-more]').focus()");
    page.keys("\u{E007}");
    page.until("return !document.querySelector('#tab-more').hidden");
    let unreachable = "return [...document.querySelectorAll('button, input, select, summary, a')] \
        .filter((it) => it.checkVisibility() && it.tabIndex < 0).length";
    assert_eq!(page.look(unreachable), json!(0));
    page.look("document.querySelector('#search').focus()");
    page.keys("\u{E004}");
    page.until("return document.activeElement.tagName === 'SUMMARY'");
    page.keys("\u{E007}\u{E004}");
    page.until("return document.activeElement.type === 'checkbox'");
}

#[test]
fn a_layout_is_kept_and_shared_as_a_file() {
    if !has_browser() {
        return;
    }
    let (_live, port) = live(
        Command::new(env!("CARGO_BIN_EXE_rc10")).args(["live", "--sim", "--script", "--page", "0"]),
    );
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return document.querySelectorAll('.plot').length >= 2");
    let open = |text: &str| {
        page.tell(
            "execute/sync",
            &json!({ "script": "const all = new DataTransfer(); all.items.add(new File([arguments[0]], 'a.json')); \
                const it = document.querySelector('#layout-file'); it.files = all.files; it.dispatchEvent(new Event('change'));",
                "args": [text] }),
        );
    };
    let wanted = "motors/wheel front left/speed";
    open(&json!({ "form": "rc10 layout 1", "chosen": [wanted, "motors/tail/speed"], "span": 2, "period": 5 }).to_string());
    page.until("return document.querySelector('#refused').textContent === 'This robot does not have: motors/tail/speed'");
    let shown = || {
        page.look("return [[...chosen].map(key), span, document.querySelector('#period').value]")
    };
    assert_eq!(shown(), json!([[wanted], 2, "5"]));
    // What is saved is what is opened; and after a reload it is there.
    let saved = page.look("return JSON.stringify(layout())");
    page.look("chosen = new Set(); span = 30;");
    open(saved.as_str().unwrap());
    page.until("return chosen.size === 1");
    assert_eq!(shown(), json!([[wanted], 2, "5"]));
    page.tell("refresh", &json!({}));
    page.until("return begun && chosen.size === 1");
    assert_eq!(shown(), json!([[wanted], 2, "5"]));
    // Others change nothing, and are named.
    for wrong in ["", "{", "null", "[1]", "{\"form\":\"another\"}", &"x".repeat(70_000)] {
        page.look("document.querySelector('#refused').textContent = ''");
        open(wrong);
        page.until("return document.querySelector('#refused').textContent.startsWith('a.json: ')");
        assert_eq!(shown(), json!([[wanted], 2, "5"]), "{wrong:.20}");
    }
}

#[test]
fn a_phone_watches_and_stops_and_no_more() {
    if !has_browser() {
        return;
    }
    // An address of this PC that is not the one of its own page.
    let (_live, line): (Started, String) = start(
        Command::new(env!("CARGO_BIN_EXE_rc10"))
            .args(["live", "--sim", "--script", "--page", "0", "--lan=127.0.0.2"])
            .env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR")),
        "phone  ",
    );
    let url = line.split_whitespace().last().unwrap();
    let page = Browser::open(url);
    dress(&page, SIZES[0], false);
    page.until("return [...data.values()].some((it) => it.times.length > 50)");
    assert_eq!(page.look("return document.body.className"), json!("guest"));
    let seen = "return ['record', 'disarm'].filter((id) => document.getElementById(id).checkVisibility()).length \
        + document.querySelectorAll('#motors button:not([hidden])').values().filter((it) => it.checkVisibility()).toArray().length";
    assert_eq!(page.look(seen), json!(0));
    // The robot is asked by the page's own means, which are not shown there.
    let ask = |wish: Value| {
        let script = "const done = arguments[arguments.length - 1]; \
            post(arguments[0]).then(() => done('done'), (error) => done(error.message));";
        page.tell("execute/async", &json!({ "script": script, "args": [wish] }))
    };
    for wish in [
        json!({ "do": "disarm" }),
        json!({ "do": "zero", "motor": "lift front left" }),
        json!({ "do": "jog", "motor": "lift front left", "speed": 5 }),
        json!({ "record": true }),
        json!({ "set": [["wheel_front_left.speed_kp", 0.2]] }),
        json!({ "watch": [1], "period": 1 }),
    ] {
        assert_eq!(ask(wish.clone()), json!("from another device only STOP"), "{wish}");
    }
    let before = page.look("return document.querySelector('#arm').textContent");
    assert_ne!(before, json!("Stopped"));
    page.look("document.querySelector('#stop').click()");
    page.until("return document.querySelector('#arm').textContent === 'Stopped'");
    // Without the key, or with another.
    let (host, key) = url.trim_end_matches('/').rsplit_once('/').unwrap();
    let wrong =
        if key.starts_with('0') { key.replacen('0', "1", 1) } else { format!("0{}", &key[1..]) };
    for path in ["/", "/state", &format!("/{wrong}/"), &format!("/{wrong}/state")] {
        page.tell("url", &json!({ "url": format!("{host}{path}") }));
        let text = page.look("return document.body.textContent");
        assert!(text.as_str().unwrap().contains("the key is missing"), "{path}: {text}");
    }
}
