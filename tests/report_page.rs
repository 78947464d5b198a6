//! The report in a browser, on a wide window, a small one and a phone, and on paper. Without Chromium and its driver
//! it says so, and nothing is tested.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;

fn rc10(arguments: &[&str], folder: &Path) -> Output {
    let out = ["--out", folder.to_str().unwrap()];
    Command::new(env!("CARGO_BIN_EXE_rc10")).args(arguments).args(out).output().unwrap()
}

fn opened(folder: &Path, [width, height]: [u32; 2]) -> Browser {
    let page = Browser::open(&format!("file://{}", folder.join("report.html").display()));
    let size =
        json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500 });
    page.tell(
        "goog/cdp/execute",
        &json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": size }),
    );
    page
}

fn texts(page: &Browser, selector: &str) -> Vec<String> {
    let script =
        format!("return [...document.querySelectorAll({selector:?})].map((it) => it.textContent)");
    serde_json::from_value(page.look(&script)).unwrap()
}

#[test]
fn the_cause_stands_first_with_its_time_its_plot_its_row_and_its_lane() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("report-cause");
    let run =
        ["run", "--no-logs", "--mistake", "direction:wheel-front-left", "--fault", "cut:2@1s..2s"];
    assert!(rc10(&run, &folder).status.success());
    for size in [[1440, 900], [1000, 700], [390, 844]] {
        let page = opened(&folder, size);
        let headlines = texts(&page, ".verdict.bad summary, .verdict.bad li p");
        assert_eq!(headlines[0], "wheel front left: direction is reversed");
        for headline in texts(&page, ".verdict summary, .verdict li p") {
            assert!(headline.split_whitespace().count() <= 8, "{headline}");
        }
        let folded = "return document.querySelector('.verdict details').open";
        assert_eq!(page.look(folded), json!(false));
        // The path is beside the verdict in a wide window, and under it on a phone.
        let places = "const box = (it) => document.querySelector(it).getBoundingClientRect(), \
            [verdict, path, tiles] = ['.verdict', '#plot-path', '.tiles'].map(box); \
            return [path.left >= verdict.right, path.top >= verdict.bottom, path.bottom <= innerHeight, \
                tiles.top >= path.bottom, document.documentElement.scrollWidth <= innerWidth]";
        let wide = size[0] > 999;
        let seen = page.look(places);
        assert_eq!(
            (&seen[0], &seen[1], &seen[3], &seen[4]),
            (&json!(wide), &json!(!wide), &json!(true), &json!(true)),
            "{size:?}: {seen}"
        );
        assert!(size != [1440, 900] || seen[2] == json!(true), "below the fold: {seen}");
        // Red are its row and its lane, and no other wheel's.
        assert_eq!(texts(&page, "tr.bad td:first-child"), ["wheel front left"]);
        let data = "return JSON.parse(document.getElementById('data').textContent)";
        let lanes = page.look(&format!("{data}.lanes.filter((it) => it.bad).map((it) => it.name)"));
        assert_eq!(lanes, json!(["wheel front left"]));
        let ink = "const canvas = document.querySelector('[data-plot=timeline]'), \
            pen = canvas.getContext('2d'), all = pen.getImageData(0, 0, 40, canvas.height).data; let red = 0; \
            for (let at = 0; at < all.length; at += 4) if (all[at] > 250 && all[at + 1] === 229 && all[at + 2] === 227) red += 1; \
            return red > 300";
        assert_eq!(page.look(ink), json!(true), "no red lane");
        // What was done to it is said, and is an event with a mark.
        assert_eq!(
            texts(&page, ".injected b"),
            ["fault cut:2@1s..2s, mistake direction:wheel-front-left"]
        );
        let events = page.look(&format!("{data}.events.filter((it) => it[2])"));
        let wanted = json!([
            [0, "mistake direction:wheel-front-left", true],
            [1, "fault cut:2 begins", true],
            [2, "fault cut:2 ends", true]
        ]);
        assert_eq!(events, wanted);
        let facts = texts(&page, ".facts").join(" ");
        for text in
            ["robot team", " UTC", "rc10 run --no-logs --mistake direction:wheel-front-left"]
        {
            assert!(facts.contains(text), "{text}: {facts}");
        }
        // The link leads to the time.
        let reset = "return document.querySelector('#reset').checkVisibility()";
        assert_eq!(page.look(reset), json!(false));
        page.look("document.querySelector('.verdict a[data-zoom]').click()");
        page.until(reset);
        let link = "const link = document.querySelector('.verdict a[data-zoom]'); \
            return document.querySelector(link.getAttribute('href')).querySelector('h3').textContent.trim()";
        assert_eq!(page.look(link), json!("Wheel speed"));
        // Reset is in the window wherever one has zoomed.
        let in_view = "const box = document.querySelector('#reset').getBoundingClientRect(); \
            scrollTo(0, document.body.scrollHeight); \
            return box.top > 0 && box.bottom <= innerHeight && box.right <= innerWidth";
        assert_eq!(page.look(in_view), json!(true));
        page.look("document.querySelector('#reset').click()");
        // By keyboard.
        page.look("document.querySelector('[data-plot=\"0\"]').focus()");
        page.keys("+");
        assert_eq!(page.look(reset), json!(true));
        page.keys("\u{e014}\u{e012}-");
        assert_eq!(page.look(reset), json!(false));
        page.keys("++0");
        assert_eq!(page.look(reset), json!(false));
        let labels = page.look("return [...document.querySelectorAll('canvas')].map((it) => it.getAttribute('aria-label'))");
        let labels: Vec<String> = serde_json::from_value(labels).unwrap();
        let mut different = labels.clone();
        different.sort();
        different.dedup();
        assert_eq!(different.len(), labels.len(), "{labels:?}");
    }
}

/// What is drawn on a canvas, as calls with the colours; a page's `draw` draws.
const DRAWN: &str = "const calls = [], kept = {}, on = CanvasRenderingContext2D.prototype; \
    for (const name of ['fillRect', 'moveTo', 'lineTo']) { kept[name] = on[name]; on[name] = function (...at) { \
        calls.push([this.canvas.dataset.plot, name, ...at, this.fillStyle, this.strokeStyle]); kept[name].apply(this, at); }; } \
    dispatchEvent(new Event('resize')); Object.assign(on, kept); ";

#[test]
fn the_field_and_the_mechanisms_are_drawn_beside_the_verdict() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("report-field");
    let record = folder.join("a.mcap").to_str().unwrap().to_owned();
    assert!(rc10(&["run", "--no-logs", "--record", &record], &folder).status.success());
    for from_record in [false, true] {
        if from_record {
            assert!(rc10(&["report", &record], &folder).status.success());
        }
        let page = opened(&folder, [1440, 900]);
        let data = "const data = JSON.parse(document.getElementById('data').textContent); ";
        // At 7.9 s the lift is up: two turns above the middle of the script.
        let lift = |at: f64| {
            page.look(&format!("document.querySelector('[data-plot=\"0\"]').parentNode.dispatchEvent(new PointerEvent('pointermove', {{ \
                pointerType: 'mouse', clientX: document.querySelector('[data-plot=\"0\"]').getBoundingClientRect().left + 46 + {at} / 10 * (document.querySelector('[data-plot=\"0\"]').clientWidth - 54) }}))"));
            let look = format!(
                "{DRAWN}{data} const bar = calls.find(([plot, name]) => plot === 'mechanisms' && name === 'fillRect'), \
                box = calls.filter(([plot, name]) => plot === 'mechanisms' && name === 'lineTo').slice(0, 4).map((it) => it[3]), \
                angles = data.turned['lift front left']; \
                return [bar[5] / (Math.max(...box) - Math.min(...box)), (angles[Math.round({at} * 100) - 1] + 90) / 1200, calls.filter(([plot]) => plot === 'path').length]"
            );
            serde_json::from_value::<[f64; 3]>(page.look(&look)).unwrap()
        };
        for (at, least, most) in [(2.0, 0.0, 0.1), (8.0, 0.6, 0.8)] {
            let [drawn, share, path] = lift(at);
            println!("the lift at {at} s: {drawn:.3} of its bar, {share:.3} by its angle");
            assert!((drawn - share).abs() < 0.02 && (least..most).contains(&drawn) && path > 500.0);
        }
    }
}

#[test]
fn a_good_run_has_nothing_to_skip() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("report-good");
    let run = rc10(&["run", "--no-logs"], &folder);
    assert!(!String::from_utf8_lossy(&run.stdout).contains("Good to know"));
    let page = opened(&folder, [1440, 900]);
    assert_eq!(texts(&page, ".verdict"), ["✓ All 11 motors online · no frame lost · no overruns"]);
    // What no run can show is folded, at the end, with a link that is there.
    let link = page.look("return document.querySelector('.standing a').href");
    let path = link.as_str().unwrap().strip_prefix("file://").unwrap();
    assert!(fs::read_to_string(path).unwrap().starts_with("# "), "{path}");
    assert_eq!(page.look("return document.querySelector('.standing').open"), json!(false));
    // On paper: two pages, with the remote's line.
    let paper = page.tell("print", &json!({ "page": { "width": 21.0, "height": 29.7 } }));
    let pdf = bytes(paper.as_str().unwrap());
    let is_page = |it: &&[u8]| it.starts_with(b"/Type /Page") && !it.ends_with(b"s");
    let count = pdf.windows(12).filter(is_page).count();
    println!("a report of 10 s on paper: {count} pages");
    assert!((1..=2).contains(&count), "{count} pages");
    let printed = "document.documentElement.classList.add('print'); \
        return document.querySelector('.heard').checkVisibility()";
    assert_eq!(page.look(printed), json!(true));
}

/// The bytes of base64.
fn bytes(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let six = text.bytes().filter_map(|letter| LETTERS.iter().position(|it| *it == letter));
    let six: Vec<u32> = six.map(|it| u32::try_from(it).unwrap()).collect();
    let four = six.chunks(4).flat_map(|four| {
        let bits = four.iter().enumerate().fold(0, |sum, (at, it)| sum | it << (26 - 6 * at));
        bits.to_be_bytes()[..four.len() * 6 / 8].to_vec()
    });
    four.collect()
}

#[test]
fn two_runs_are_compared() {
    let folder = Scratch::new("report-against");
    let record = |name: &str, more: &[&str]| {
        let path = folder.join(name).to_str().unwrap().to_owned();
        let run = ["run", "--no-logs", "--seconds", "4", "--record", &path];
        assert!(rc10(&[&run[..], more].concat(), &folder).status.success());
        path
    };
    let good = record("good.mcap", &[]);
    let heavy = record("heavy.mcap", &["--mistake", "friction:wheel=x3"]);
    let said = rc10(&["report", &heavy, "--against", &good], &folder);
    let said = String::from_utf8(said.stdout).unwrap();
    let row = said.lines().find(|it| {
        it.starts_with("wheel front left") && it.contains("RMS error") && it.contains("worse")
    });
    let row = row.unwrap_or_else(|| panic!("{said}"));
    assert!(row.ends_with(|it: char| it.is_ascii_digit()), "{row}");
    let sentence = said.lines().last().unwrap();
    assert!(sentence.starts_with(&format!("Against {good}: ")), "{sentence}");
    assert!(sentence.contains(" worse, ") && sentence.contains("most: "), "{sentence}");
    // The other way round it is better; and against itself nothing differs.
    let json = |before: &str, now: &str| -> Value {
        let said = rc10(&["report", now, "--against", before, "--json"], &folder);
        serde_json::from_slice::<Value>(&said.stdout).unwrap()["against"].clone()
    };
    let of = |told: &Value| {
        let all = told["differences"].as_array().unwrap().clone();
        let wheel =
            |it: &&Value| it["motor"] == "wheel front left" && it["figure"] == "peak current";
        all.iter().find(wheel).map(|it| it["is_better"].clone())
    };
    assert_eq!(of(&json(&good, &heavy)), Some(json!(false)));
    assert_eq!(of(&json(&heavy, &good)), Some(json!(true)));
    let same = json(&good, &good);
    assert_eq!((&same["differences"], &same["alone"]), (&json!([]), &json!([])));
    // A record of another robot: what both have.
    let mixed = folder.join("mixed.mcap").to_str().unwrap().to_owned();
    let out = folder.join("mixed").to_str().unwrap().to_owned();
    let run = ["run", "--no-logs", "--seconds", "2", "--record", &mixed, "--out", &out];
    let (code, text) = crate::common::mixed::mixed(&run);
    assert_eq!(code, Some(0), "{text}");
    let other = json(&mixed, &good);
    assert!(other["alone"].as_array().unwrap().contains(&json!("feeder")), "{other}");
    // A file that is no record, or none, is named.
    fs::write(folder.join("bad.mcap"), "nothing").unwrap();
    for name in ["bad.mcap", "missing.mcap"] {
        let path = folder.join(name).to_str().unwrap().to_owned();
        let said = rc10(&["report", &good, "--against", &path], &folder);
        assert_eq!(said.status.code(), Some(2));
        let why = String::from_utf8(said.stderr).unwrap();
        assert!(why.contains(&format!("--against {path}")), "{why}");
    }
    if has_browser() {
        assert!(rc10(&["report", &heavy, "--against", &good], &folder).status.success());
        let page = opened(&folder, [1440, 900]);
        assert!(texts(&page, "h2").contains(&"Against the earlier run".to_owned()));
        assert!(texts(&page, "td.bad").contains(&"worse".to_owned()));
        let curves = "return JSON.parse(document.getElementById('data').textContent).charts[0].series[0].before.length";
        assert_eq!(page.look(curves), json!(400));
        assert!(texts(&page, ".legend .before").len() > 3);
        // The record's own origin, not that of this command.
        assert!(texts(&page, ".facts").join(" ").contains("--mistake friction:wheel=x3"));
    }
}

#[test]
fn a_long_run_is_grouped() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("report-long");
    assert!(rc10(&["run", "--no-logs", "--seconds", "100"], &folder).status.success());
    let page = opened(&folder, [1440, 900]);
    let events = texts(&page, ".events li");
    assert!(events.len() <= 60 && events.iter().any(|it| it.contains("× 10")), "{events:?}");
    assert!(!events.iter().any(|it| it.contains("more")), "{events:?}");
    let all =
        page.look("return JSON.parse(document.getElementById('data').textContent).events.length");
    assert!(all.as_u64().unwrap() > 110, "{all}");
}
