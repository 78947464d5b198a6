//! Time on the page of `rc10 live`: values at a high rate, the time bar, records in the page, and reports from it.

use std::io::{Read as _, Write as _};
use std::process::Command;
use std::time::Instant;

use serde_json::{Value, json};

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::{JSON, http, live};

/// Chooses so many numbers of motors, at a period, as a person does.
fn choose(page: &Browser, count: usize, period: u16) {
    page.look(&format!(
        "chosen = new Set(state.signals.filter((it) => it.folder === 'motors' && !it.states.length).slice(0, {count}).map((it) => it.index)); \
         document.querySelector('#period').value = '{period}'; document.querySelector('#period').dispatchEvent(new Event('change'))"
    ));
}

/// The points of a signal in the second before the newest, and the longest gap between two, in ms.
const SECOND: &str = "const to = state.now - 500000, it = [...chosen][0], reply = new XMLHttpRequest(); \
    reply.open('GET', '/data?signals=' + it + '&from=' + (to - 1000000) + '&to=' + to + '&columns=10000' + \
      (state.fast < +$('period').value && state.fast ? '&every=' + $('period').value : ''), false); \
    reply.overrideMimeType('text/plain; charset=x-user-defined'); reply.send(); \
    const view = new DataView(Uint8Array.from(reply.responseText, (c) => c.charCodeAt(0)).buffer), count = view.getUint32(8, true); \
    let gap = 0; for (let i = 1; i < count; i += 1) gap = Math.max(gap, view.getFloat32(12 + 8 * i, true) - view.getFloat32(4 + 8 * i, true)); \
    return [count, Math.round(gap * 1000)]";

#[test]
fn each_page_keeps_its_period_and_what_does_not_fit_is_refused_before() {
    if !has_browser() {
        return;
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let (_live, port) =
        live(command.args(["live", "--sim", "--script", "--baud", "921600", "--page", "0"]));
    let url = format!("http://127.0.0.1:{port}/");
    let page = Browser::open(&url);
    page.until("return begun && state.fits.length === 3");
    // How many there are is said before.
    page.until("return /^1 ms, 1[0-9] signals$/.test(document.querySelector('#period').options[0].textContent)");
    let most = usize::try_from(page.look("return state.fits[0][1]").as_u64().unwrap()).unwrap();
    choose(&page, most, 1);
    page.until("return state.fast === 1 && had !== null && had.period === '1' && document.querySelector('#fits').textContent.startsWith('all else every')");
    page.until("return state.now > 4e6");
    page.look("window.since = state.now");
    page.until("return state.now > window.since + 2.5e6");
    let second = page.look(SECOND);
    println!("{most} signals at 1 ms: points of a second, longest gap in ms: {second}");
    assert!(second[0].as_u64().unwrap() >= 1000 && second[1] == json!(1), "{second}");
    // One more is refused with the number that fits, and nothing changes.
    choose(&page, most + 1, 1);
    page.until(&format!("return document.querySelector('#refused').textContent.includes('carries {most} signals every 1 ms')"));
    assert_eq!(page.look("return [chosen.size, state.fast]"), json!([most, 1]));

    // Another page has its own.
    let other = Browser::open(&url);
    other.until("return begun && had !== null");
    choose(&other, 3, 10);
    other.until("return had.period === '10'");
    page.until("return state.fast === 1");
    other.look("window.since = state.now");
    other.until("return state.now > window.since + 2.5e6");
    let (ours, theirs) = (page.look(SECOND), other.look(SECOND));
    println!("two pages, 1 ms and 10 ms: {ours}, {theirs}");
    assert!(ours[0].as_u64().unwrap() >= 1000 && ours[1] == json!(1), "{ours}");
    assert!((98..=104).contains(&theirs[0].as_u64().unwrap()), "{theirs}");
    assert_eq!(page.look("return document.querySelector('#period').value"), json!("1"));
    let losses = page.look("return state.losses");
    assert_eq!((&losses["samples"], &losses["skipped"]), (&json!(0), &json!(0)), "{losses}");
    // It asks for signals of its own, for which there is no room beside ours.
    other.look("chosen = new Set(state.signals.filter((it) => it.folder === 'motors' && !it.states.length).slice(40, 44).map((it) => it.index)); document.querySelector('#period').value = '5'; watch()");
    other.until("return document.querySelector('#refused').textContent.includes('on all pages')");
    // Without the first page there is.
    page.tell("url", &json!({ "url": "about:blank" }));
    other.until("return state.fast === null");
    choose(&other, 4, 5);
    other.until("return state.fast === 5");
    let (_, body) = http(port, "POST", "/wish", JSON, r#"{"watch":[1,2],"period":0,"page":9}"#);
    let answer: Value = serde_json::from_str(&body).unwrap();
    assert!(answer["ok"]["period"] == json!(1) || answer["refused"].is_string(), "{body}");
}

/// Waits for the robot's time, in seconds.
fn wait_for(page: &Browser, seconds: u32) {
    page.until(&format!("return state.now > {seconds}e6"));
}

#[test]
fn the_past_of_a_robot_is_scrubbed_played_and_led_to() {
    if !has_browser() {
        return;
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let (_live, port) = live(command.args([
        "live",
        "--sim",
        "--script",
        "--page",
        "0",
        "--fault",
        "power:2@4s..500s",
    ]));
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return begun && had !== null");
    wait_for(&page, 12);
    page.until("return happened.size > 2 && [...happened.values()].some(([, what]) => what.includes('lost'))");
    page.look("window.hatched = 0; Plot.hatch = ((old) => (...all) => { window.hatched += 1; old(...all); })(Plot.hatch)");
    // By keyboard, and by the bar: the window ends where one is.
    page.look("document.querySelector('#scrub').focus()");
    page.keys("\u{E012}");
    assert_eq!(
        page.look("return end !== null && end < state.now - 0.05 * span * 1e6"),
        json!(true)
    );
    page.keys("\u{E011}");
    page.until("return Math.abs(end - beginOf([...chosen])) < 1 && from <= Math.round(end)");
    // Before the data it is hatched, on the bar and in each plot.
    page.until("return window.hatched > 4");
    let bar = "document.querySelector('#scrub').getBoundingClientRect()";
    page.look(&format!(
        "const bar = document.querySelector('#scrub'), at = {bar}; \
         for (const type of ['pointerdown', 'pointerup']) bar.dispatchEvent(new PointerEvent(type, {{ pointerId: 1, clientX: at.left + at.width / 2, clientY: at.top + 9, buttons: 1, bubbles: true }}))"
    ));
    page.until("const [first, last] = extent(); return end > first + 0.3 * (last - first) && end < first + 0.7 * (last - first)");
    page.until("return Math.abs(from + span * 1e6 - Math.max(end, span * 1e6)) < 2 && [...data.values()].some((it) => it.times.length > 20)");
    // In and out: it plays between them.
    page.look("seek(6e6); marked = [null, null]");
    page.keys("i");
    page.look("seek(7e6)");
    page.keys("o");
    assert_eq!(page.look("return marked"), json!([6_000_000, 7_000_000]));
    page.look("document.querySelector('#speed').value = '8'; window.most = 0; window.turns = 0; window.was = end; \
        setInterval(() => { if (end !== null) { window.most = Math.max(window.most, end); window.turns += end < window.was; window.was = end; } }, 5); \
        document.querySelector('#play').click()");
    page.until("return window.turns > 1");
    assert_eq!(page.look("return window.most <= 7.001e6 && end >= 5.999e6"), json!(true));
    // Without them it plays up to the newest, and is live again.
    page.look("marked = [null, null]");
    page.until("return end === null && playing === null");
    assert_eq!(
        page.look("return document.querySelector('#live').getAttribute('aria-pressed')"),
        json!("true")
    );
    // An event leads to its time.
    page.look("[...document.querySelectorAll('#happened .when')].find((it) => it.parentNode.textContent.includes('lost')).click()");
    page.until("return lead !== null && Math.abs(lead - 4) < 0.5 && Math.abs(end * 1e-6 - lead - span / 2) < 0.01");
    page.until("return marks(view()).some(([, what]) => what.includes('lost'))");
    // The space bar stops the robot, whatever plays.
    page.keys(" ");
    page.until("return document.querySelector('#arm').textContent === 'Stopped'");
}

#[test]
fn a_record_opens_in_the_same_page() {
    let folder = Scratch::new("live-record-page");
    let file = folder.join("tonight.mcap");
    let rc10 = || Command::new(env!("CARGO_BIN_EXE_rc10"));
    let mut run = rc10();
    run.args(["run", "--no-logs", "--seconds", "20", "--fault", "power:2@5s..15s", "--out"]);
    let run = run.arg(&*folder).arg("--record").arg(&file).output().unwrap();
    assert!(file.exists(), "{run:?}");
    let begin = Instant::now();
    let mut command = rc10();
    let (_live, port) = live(command.arg("live").arg(&file).args(["--page", "0"]));
    println!(
        "20 s with every motor every millisecond are open after {} ms",
        begin.elapsed().as_millis()
    );
    let (status, body) = http(port, "POST", "/wish", JSON, r#"{"do":"stop"}"#);
    assert!(status == 409 && body.contains("this is a record, and no robot"), "{body}");
    // What came in, for `rc10 replay`, is no event.
    let (_, state) = http(port, "GET", "/state", "", "");
    let state: Value = serde_json::from_str(&state).unwrap();
    let mut events = state["happened"].as_array().unwrap().iter().filter_map(|it| it[1].as_str());
    let odd = events.find(|it| it.contains(|it: char| it.is_control() || it == '\u{FFFD}'));
    assert_eq!(odd, None);
    if !has_browser() {
        return;
    }
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return begun && state.file && state.file.judged");
    for id in ["stop", "disarm", "record", "pause", "live", "naming"] {
        assert_eq!(
            page.look(&format!("return document.querySelector('#{id}').offsetParent")),
            json!(null),
            "{id}"
        );
    }
    // The tables show the time at which one is.
    let link = "return document.querySelector('#motors tr[data-motor=\"gimbal yaw\"]').cells[1].textContent";
    page.look("seek(4e6)");
    page.until(&format!("{link} === 'Online'"));
    page.look("seek(10e6)");
    page.until(&format!("{link} === 'Lost'"));
    page.look("seek(19e6)");
    page.until(&format!("{link} === 'Online'"));
    // What happened up to then, and where it leads.
    page.until("return document.querySelector('#happened').textContent.includes('cut')  || document.querySelectorAll('#happened li').length > 2");
    let took = page.look("const begin = performance.now(), it = new XMLHttpRequest(); it.open('GET', '/state?at=9000000', false); it.send(); return performance.now() - begin");
    println!("a seek takes {took} ms");
    // The space bar plays.
    page.look(
        "seek(1e6); document.querySelector('#speed').value = '1'; document.activeElement.blur()",
    );
    page.keys(" ");
    page.until("return playing !== null && end > 2e6");
    page.keys(" ");
    assert_eq!(page.look("return playing"), json!(null));
    let (status, report) = http(port, "GET", "/report", "", "");
    assert!(status == 200 && report.contains("gimbal yaw"));
}

/// What a page chose is in the record as often as it was sent, and in the page that opens it.
#[test]
fn a_record_has_what_was_chosen_at_1_khz() {
    let folder = Scratch::new("live-record-chosen");
    let rc10 = || Command::new(env!("CARGO_BIN_EXE_rc10"));
    let mut command = rc10();
    let (robot, port) =
        live(command.args(["live", "--sim", "--script", "--page", "0", "--out"]).arg(&*folder));
    let state =
        |port| serde_json::from_str::<Value>(&http(port, "GET", "/state", "", "").1).unwrap();
    let until = |port, is_so: &dyn Fn(&Value) -> bool| {
        let began = Instant::now();
        loop {
            let state = state(port);
            if is_so(&state) {
                return state;
            }
            assert!(began.elapsed().as_secs() < 300, "{state}");
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
    };
    let wish = |body: Value| http(port, "POST", "/wish", JSON, &body.to_string());
    let begun = until(port, &|state| state["whole"] == true);
    let find = |state: &Value, name: &str| {
        let all = state["signals"].as_array().unwrap().iter();
        let mut found = all.filter(|it| it["label"] == "feeder" && it["name"] == name);
        found.next().unwrap()["index"].as_u64().unwrap()
    };
    let speed = find(&begun, "speed");
    assert_eq!(wish(json!({ "watch": [speed], "period": 1, "page": 7 })).0, 200);
    assert_eq!(wish(json!({ "record": true })).0, 200);
    until(port, &|state| state["record"]["seconds"].as_f64() > Some(2.5));
    assert_eq!(wish(json!({ "record": false })).0, 200);
    until(port, &|state| state["record"].is_null());
    drop(robot);
    let file = folder.join("001.mcap");
    let mut command = rc10();
    let (_live, port) = live(command.arg("live").arg(&file).args(["--page", "0"]));
    let opened = until(port, &|state| state["file"]["judged"] == true);
    assert_eq!(opened["trouble"], Value::Null);
    let values = |name: &str| {
        let signal = find(&opened, name);
        let query = format!("/data?signals={signal}&from=1000000&to=2000000&columns=10000");
        let mut stream = std::net::TcpStream::connect(("127.0.0.1", port)).unwrap();
        let request =
            format!("GET {query} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let body = answer.windows(4).position(|it| it == b"\r\n\r\n").unwrap() + 4 + 8;
        let word = |at: usize| <[u8; 4]>::try_from(&answer[body + 4 * at..][..4]).unwrap();
        let count = u32::from_le_bytes(word(0)) as usize;
        let times = (0..count).map(|at| f32::from_le_bytes(word(1 + 2 * at)));
        let values = (0..count).map(|at| f32::from_le_bytes(word(2 + 2 * at)));
        assert!(values.into_iter().all(f32::is_finite), "{name}");
        let times: Vec<_> = times.collect();
        times.windows(2).map(|two| ((two[1] - two[0]) * 1000.0).round()).collect::<Vec<_>>()
    };
    let [chosen, other] = ["speed", "total_angle"].map(values);
    assert!(chosen.len() >= 1000 && chosen.iter().all(|gap| (gap - 1.0).abs() < 0.1), "{chosen:?}");
    assert!(other.len() < 110 && other.iter().all(|gap| *gap > 8.5), "{other:?}");
    // The report and the CSV files take it as they take any record.
    let csv = rc10().args(["csv", "--out"]).arg(folder.join("csv")).arg(&file).output().unwrap();
    assert!(csv.status.success(), "{csv:?}");
    let lines = std::fs::read_to_string(folder.join("csv/chosen-motors-feeder.csv")).unwrap();
    assert!(lines.lines().count() > 2000, "{}", lines.lines().count());
}

#[test]
fn a_record_becomes_a_report_without_a_terminal() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("live-record-report");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let (_live, port) =
        live(command.args(["live", "--sim", "--script", "--page", "0", "--out"]).arg(&*folder));
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.until("return begun && had !== null");
    wait_for(&page, 3);
    page.look("document.querySelector('#title-of').value = '<b>../first try</b>'; document.querySelector('#record').click()");
    page.until("return state.record !== null && state.record.seconds > 1");
    page.keys("m");
    page.until("return (state.happened || []).some(([, what]) => what === 'mark 1')");
    page.look("document.querySelector('#words').value = 'it shook'; document.querySelector('#mark').click()");
    page.until(
        "return state.record.seconds > 3 && marks(view()).some(([, what]) => what === 'it shook')",
    );
    page.look("document.querySelector('#note-of').value = 'new tyres & grip'; document.querySelector('#record').click()");
    page.until("return document.querySelector('#note').textContent.includes('.mcap')");
    page.until("return !document.querySelector('#report').hidden");
    let report = page.look("const it = new XMLHttpRequest(); it.open('GET', document.querySelector('#report').href, false); it.send(); return it.responseText");
    let report = report.as_str().unwrap();
    for text in ["&lt;b&gt;../first try&lt;/b&gt;", "new tyres &amp; grip", "mark 1", "it shook"] {
        assert!(report.contains(text), "{text}");
    }
    let names: Vec<_> =
        std::fs::read_dir(&*folder).unwrap().map(|it| it.unwrap().file_name()).collect();
    assert!(names.iter().any(|it| it == "001-_b____first_try__b_.mcap"), "{names:?}");
    // The message goes by itself.
    page.until("return document.querySelector('#note').hidden");
    // A picture and the numbers of a plot.
    page.look("window.saved = []; save = (name, blob) => { blob.text().then((text) => window.saved.push([name, blob.type, blob.size, text.slice(0, 200000)])); }; \
        document.querySelectorAll('.plot:not([data-unit=states]) .save').forEach((it) => it.click())");
    page.until(
        "return ['png', 'csv'].every((kind) => window.saved.some(([name]) => name.endsWith(kind)))",
    );
    let saved = page.look("return window.saved.map(([name, type, size, text]) => [name.split('.').pop(), type, size > 1000, type === 'text/csv' ? text.split('\\r\\n')[0].split(',')[0] + ' ' + (text.split('\\r\\n').length > 500) : ''])");
    let has = |wanted: &Value| saved.as_array().unwrap().iter().any(|it| it == wanted);
    assert!(
        has(&json!(["png", "image/png", true, ""]))
            && has(&json!(["csv", "text/csv", true, "time_s true"])),
        "{saved}"
    );
}
