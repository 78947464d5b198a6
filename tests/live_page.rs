//! The page of `rc10 live` in a browser, driven as a person does. Without Chromium and its driver (Debian:
//! `chromium`, `chromium-driver`) it says so, and nothing is tested.

use std::ffi::OsStr;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::{JSON, http, live, start};
use serde_json::{Value, json};

/// Opens the page of a robot, and does with it what one does on a test day.
fn a_test_day(name: &str, source: &[&OsStr]) {
    let folder = Scratch::new(name);
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.args(["live", "--page", "0", "--out"]).arg(&*folder).args(source);
    let (_live, port) = live(&mut command);
    other_sites_are_refused(port);
    if !has_browser() {
        return;
    }
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    // It describes itself, and drives.
    page.until("return document.querySelectorAll('#motors tr[data-motor]').length === 11");
    page.until("return [...document.querySelectorAll('#motors tr[data-motor]')].every((row) => row.cells[1].textContent === 'Online')");
    page.until("return document.querySelector('#arm').textContent === 'Armed'");
    page.until("return document.querySelectorAll('.plot').length >= 2");
    page.until("return [...data.values()].some((it) => it.times.length > 50)");
    // What stands on the page is what the robot says: the lift does not turn by itself.
    let wheel =
        "state.signals.find((it) => it.label === 'wheel front left' && it.name === 'speed').value";
    page.until(&format!("return Math.abs({wheel}) > 50"));

    // A gain, and back.
    let gain = "document.querySelector('[aria-label=\"wheel_front_left.speed_kp\"]')";
    let now = "state.parameters.find((it) => it.full === 'wheel_front_left.speed_kp').value";
    page.look(&format!("{gain}.value = '0.25'; {gain}.dispatchEvent(new Event('change'))"));
    page.until(&format!("return Math.abs({now} - 0.25) < 1e-6"));
    page.until("return document.querySelector('tr[data-parameter=\"wheel_front_left.speed_kp\"]').className === 'changed'");
    page.until("return !document.querySelector('#undo').disabled");
    page.look("document.querySelector('#undo').click()");
    page.until(&format!("return Math.abs({now} - 0.4) < 1e-6"));
    // One that is refused says why, and changes nothing.
    page.look(&format!("{gain}.value = '-1'; {gain}.dispatchEvent(new Event('change'))"));
    page.until(
        "return document.querySelector('#parameters').textContent.includes('out of its range')",
    );
    page.until(&format!("return Math.abs({now} - 0.4) < 1e-6"));

    // A record.
    page.look("document.querySelector('#record').click()");
    page.until("return state.record !== null && state.record.seconds > 3");
    let pictured = |picture_name| {
        if source == ["--sim", "--script"] {
            picture(&page, picture_name);
        }
    };
    page.look("look('robot')");
    page.until("return View.scale() > 0 && ($('tabs').scrollIntoView(), true)");
    pictured("live.png");
    page.look("look('motors')");
    page.look("document.querySelector('#record').click()");
    page.until("return document.querySelector('#note').textContent.includes('001.mcap')");
    let record = folder.join("001.mcap");
    let report = Command::new(env!("CARGO_BIN_EXE_rc10"))
        .args(["report", "--strict"])
        .arg(&record)
        .arg("--out")
        .arg(folder.join("report"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&report.stdout);
    // The report begins long after the robot did: earlier counts are no problems.
    assert!(report.status.success() && text.contains("wheel front left"), "{text}");

    // An armed robot's motor gets no new zero; and a gain that would shake is said so before it is sent.
    // Its script disarms it now and then: asked until it is armed.
    page.until(
        "if (flying > 0) return false; \
         const told = document.querySelector('#motors').textContent.includes('disarmed'); \
         if (!told) document.querySelector('[aria-label^=\"Zero lift front left\"]').click(); \
         return told",
    );
    page.look(&format!("{gain}.value = '4'; {gain}.dispatchEvent(new Event('change'))"));
    page.until("return document.querySelector('#parameters').textContent.includes('margin')");
    page.until(&format!("return Math.abs({now} - 0.4) < 1e-6"));

    // A space is a space where text is typed, and Esc stops there. Signals are chosen by Return.
    let is_pressed = || page.look("return pressed.stop !== null") == json!(true);
    page.look("document.querySelector('#search').focus()");
    page.keys("wheel front");
    page.until("return document.querySelector('#search').value === 'wheel front'");
    page.until("return document.querySelectorAll('#tree details').length === 2");
    page.look("document.querySelector('#tree input').focus()");
    let before = page.look("return chosen.size");
    page.keys("\u{E007}");
    page.until(&format!("return chosen.size !== {before}"));
    assert!(!is_pressed());
    page.look("document.querySelector('#search').focus()");
    page.keys("\u{E00C}");
    assert!(is_pressed());
    page.until("return document.querySelector('#arm').textContent === 'Stopped'");
    page.until("return document.querySelector('#stop').textContent.startsWith('STOP')");
    // The space bar, on a box too.
    page.look("pressed.stop = null; document.querySelector('#tree input').focus()");
    page.keys(" ");
    assert!(is_pressed() && page.look("return held") == json!(null));
    page.until("return document.querySelector('#happened').textContent.includes('emergency stop')");
    // It lasts: the script's hands do not arm a robot that is stopped.
    page.pass(0.3);
    assert_eq!(page.look("return named('', 'arm')"), json!("EStopped"));

    // The robot is gone, and the page says so.
    drop(_live);
    page.until("return document.querySelector('#trouble').textContent.includes('has ended')");

    // A look at what was recorded.
    let report = folder.join("report/report.html");
    page.tell("url", &json!({ "url": format!("file://{}", report.display()) }));
    page.until("return document.querySelectorAll('canvas').length > 3");
    // Of no interest to others: where this test writes.
    page.look("const it = document.querySelector('.facts code'); if (it) it.textContent = it.textContent.replace(/ --out \\S+/, '')");
    pictured("report.png");
}

/// Makes a picture of the documentation, in `target/pictures`: it is to be copied to `docs/pictures` when the
/// page has changed. That one must be there, and as large.
fn picture(page: &Browser, name: &str) {
    let path = format!("/session/{}/screenshot", page.session);
    let (_, body) = http(page.port, "GET", &path, "", "");
    let answer: Value = serde_json::from_str(&body).unwrap();
    let text = answer["value"].as_str().unwrap();
    // Base64, without another crate.
    let digit = |letter: u8| match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let letters: Vec<u8> = text.bytes().filter(|letter| *letter != b'=').map(digit).collect();
    let bytes: Vec<u8> = letters
        .chunks(4)
        .flat_map(|four| {
            let bits = four.iter().fold(0_u32, |bits, digit| bits << 6 | u32::from(*digit));
            let bits = bits << (6 * (4 - four.len()));
            bits.to_be_bytes()[1..four.len()].to_vec()
        })
        .collect();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("pictures");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(name), &bytes).unwrap();
    let of_docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pictures").join(name);
    let of_docs = std::fs::read(&of_docs).unwrap_or_else(|_| panic!("{name}: docs have none"));
    // Where a PNG says its width and height.
    assert_eq!(bytes[16..24], of_docs[16..24], "{name}: docs have an old one");
}

/// Another site that is open in the same browser reads and does nothing.
fn other_sites_are_refused(port: u16) {
    let stop = r#"{"do":"stop"}"#;
    for headers in [
        format!("{JSON}Origin: http://example.org\r\n"),
        format!("{JSON}Origin: http://127.0.0.1:1\r\n"),
        "Content-Type: text/plain\r\n".to_owned(),
        String::new(),
    ] {
        let (status, body) = http(port, "POST", "/wish", &headers, stop);
        assert_eq!(status, 403, "{headers}: {body}");
    }
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    write!(stream, "GET /state HTTP/1.1\r\nHost: example.org\r\nConnection: close\r\n\r\n")
        .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    let (status, body) = http(port, "POST", "/wish", JSON, "{}");
    assert!(status == 409 && body.contains("not understood"), "{status} {body}");
}

/// What a page of another site tries: each a way that needs no leave of the one it is sent to.
const EVIL: &str = r#"<!doctype html><iframe name="frame"></iframe>
<form method="post" enctype="text/plain" target="frame" action="PAGE/wish">
<input name='{"do":"stop","x":"' value='"}'></form>
<script>
const part = new Blob([new Uint8Array(1 << 26)]), huge = new Blob(Array(1024).fill(part));
const stop = '{"do":"stop"}', json = { type: 'application/json' };
const post = (body, headers = {}) => fetch('PAGE/wish', { method: 'POST', mode: 'no-cors', body, headers });
const image = (query) => new Promise((done) => {
  const it = new Image(); it.onload = it.onerror = done; it.src = 'PAGE/data?' + query;
});
document.forms[0].submit();
navigator.sendBeacon('PAGE/wish', stop);
try { navigator.sendBeacon('PAGE/wish', new Blob([stop], json)); } catch { /* not allowed */ }
const all = [post(huge), post(huge), post(stop), fetch('PAGE/wish', { method: 'POST', body: stop, headers: { 'Content-Type': json.type } })];
for (let count = 0; count < 8; count += 1) {
  all.push(image('signals=' + '0,'.repeat(3000) + '&from=0&to=99999999&columns=9999'));
  all.push(image('signals=0&from=9999999&to=0&columns=9'));
}
Promise.allSettled(all).then(() => { document.title = 'tried'; });
</script>"#;

/// A page of another site that is open in the same browser neither stops the robot nor ends the tool.
#[test]
fn another_site_in_the_browser_does_nothing() {
    if !has_browser() {
        return;
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let (_live, port) = live(command.args(["live", "--sim", "--script", "--page", "0"]));
    let site = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/", site.local_addr().unwrap());
    let text = EVIL.replace("PAGE", &format!("http://127.0.0.1:{port}"));
    std::thread::spawn(move || {
        for stream in site.incoming() {
            // The browser may think better of it.
            let _ = stream.and_then(|mut stream| {
                let _ = stream.read(&mut [0; 4096])?;
                let length = text.len();
                write!(stream, "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{text}")
            });
        }
    });
    let browser = Browser::open(&url);
    browser.until("return document.title === 'tried'");
    let (status, state) = http(port, "GET", "/state", "", "");
    assert!(status == 200 && !state.contains("emergency stop"), "{status} {state}");
    browser.tell("url", &json!({ "url": format!("http://127.0.0.1:{port}/") }));
    browser.until("return document.querySelector('#arm').textContent === 'Armed'");
    // Here it can be done.
    browser.look("document.querySelector('#stop').click()");
    browser.until("return document.querySelector('#arm').textContent === 'Stopped'");
}

#[test]
fn the_simulated_robot_on_a_page() {
    a_test_day("live-sim", &["--sim".as_ref(), "--script".as_ref()]);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_emulated_chip_on_a_page() {
    let firmware = std::env::var("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    a_test_day("live-emu", &["--emu".as_ref(), firmware.as_ref(), "--script".as_ref()]);
}

/// The tool and the chip know of each other by the bytes at a port alone.
#[test]
#[cfg(unix)]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_emulated_chip_behind_a_serial_port() {
    let firmware = std::env::var("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    let folder = Scratch::new("live-terminal");
    let link = folder.join("console");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.args(["pty", "--console", "--emu", &firmware, "--link"]).arg(&link);
    let _chip = start(&mut command, "pty ");
    a_test_day("live-port", &["--port".as_ref(), link.as_os_str()]);
}

/// STOP is pressed while `rc10 live` is away: the page sends it until the robot has stopped.
#[test]
fn a_stop_that_was_not_heard_stops_the_robot_that_comes_back() {
    if !has_browser() {
        return;
    }
    let serve = |port: u16| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
        live(command.args(["live", "--sim", "--script", "--page", &port.to_string()]))
    };
    let (first, port) = serve(0);
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return document.querySelector('#arm').textContent === 'Armed'");
    drop(first);
    page.look("document.querySelector('#stop').click()");
    page.until("return document.querySelector('#stop').textContent.startsWith('STOP NOT HEARD') && !$('refused').hidden");
    let told = page.look("return $('refused').textContent");
    assert_eq!(told, json!("rc10 live has ended"));
    let _second = serve(port);
    page.until(
        "return document.querySelector('#arm').textContent === 'Stopped' && $('refused').hidden",
    );
    page.until("return pressed.stop === null && document.querySelector('#stop').textContent.startsWith('STOP ')");
}

/// What problems are about, and of which kind, of a report or of a page.
fn problems(told: &Value) -> Vec<String> {
    let told = told["problems"].as_array().unwrap().iter();
    let mut told: Vec<_> = told.map(|it| format!("{} {}", it["about"], it["kind"])).collect();
    told.sort();
    told
}

/// Robots with something wrong: the page says what a report of the same time says.
#[test]
fn problems_are_those_of_a_report() {
    let folder = Scratch::new("live-problems");
    let wrong: [&[&str]; 4] = [
        &[],
        &["--mistake", "direction:wheel-front-left"],
        &["--mistake", "id:feeder=7"],
        &["--fault", "power:2@1s..500s"],
    ];
    for (number, wrong) in wrong.into_iter().enumerate() {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
        let (_live, port) =
            live(command.args(["live", "--page", "0", "--sim", "--script"]).args(wrong));
        let file = folder.join(format!("{number}.mcap"));
        let rc10 = || Command::new(env!("CARGO_BIN_EXE_rc10"));
        let record = rc10()
            .args(["record", "--sim", "--seconds", "12", "-o"])
            .arg(&file)
            .args(wrong)
            .output()
            .unwrap();
        assert!(record.status.success(), "{record:?}");
        let report = rc10()
            .args(["report", "--json", "--out"])
            .arg(folder.join("report"))
            .arg(&file)
            .output()
            .unwrap();
        let wanted = problems(&serde_json::from_slice(&report.stdout).unwrap());
        assert_eq!(wanted.iter().any(|it| !it.starts_with("\"robot\"")), number > 1, "{wanted:?}");
        let begin = Instant::now();
        loop {
            let (_, body) = http(port, "GET", "/state", "", "");
            let state: Value = serde_json::from_str(&body).unwrap_or_default();
            if state["whole"] == json!(true) && problems(&state) == wanted {
                let happened = state["happened"].to_string();
                let is_cut = wrong.contains(&"power:2@1s..500s");
                assert_eq!(happened.contains("gimbal yaw lost"), is_cut, "{happened}");
                break;
            }
            assert!(begin.elapsed() < Duration::from_secs(600), "{wanted:?} {}", state["problems"]);
            sleep(Duration::from_millis(200));
        }
    }
}
