//! Page, report and verdict in Chinese: no English word is left but names and units. Without Chromium and its driver
//! it says so, and pages are not tested.

use std::collections::BTreeSet;
use std::process::Command;

use rc10_cli::Simulated as _;
use serde_json::Value;

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::live;

/// Gathers every text of a page, also those on canvases.
const GATHER: &str = r#"
const draw = CanvasRenderingContext2D.prototype.fillText;
window.gathered = new Set();
CanvasRenderingContext2D.prototype.fillText = function (words, ...rest) { gathered.add(String(words)); draw.call(this, words, ...rest); };
window.gather = () => {
  const walk = document.createTreeWalker(document.documentElement, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const it = walk.currentNode;
    if (!it.parentNode.closest('script, style, code, noscript')) gathered.add(it.data.trim());
  }
  for (const it of document.querySelectorAll('*')) for (const name of ['title', 'aria-label', 'placeholder']) if (it.hasAttribute(name)) gathered.add(it.getAttribute(name));
  return [...gathered];
};
"#;

/// Names of products, standards and signs that stay, and units.
const KEPT: &str = "1s 2s cut direction team UTC M3508 GM6020 M2006 dr16 Lift Heading RMS L1 L2 R1 R2 fault mistake RC10 sim docs bring up md bus CAN RS MCAP CSV PNG STOP Esc USB UART SPI IMU PID kp ki kd ff rpm rad deg ms us kHz Hz \
    kB MB bit baud DR SBUS CRSF VT console kt Nm mA mV kg id ID FDCAN GO TOML json html csv png mcap A M N V W C s m";

/// What the script of the robot calls the sides of its square: they stay, though a text may be called so.
const SQUARE: [&str; 4] = ["forward", "left", "back", "right"];

/// Texts with a word that is neither a name nor a unit.
fn english(texts: &[String], names: &BTreeSet<String>) -> Vec<String> {
    let mut longest: Vec<_> = names.iter().collect();
    longest.sort_by_key(|name| std::cmp::Reverse(name.len()));
    let is_english = |text: &&String| {
        let mut rest = (*text).clone();
        for name in &longest {
            rest = rest.replace(name.as_str(), " ");
        }
        rest.split(|letter: char| !letter.is_ascii_alphanumeric()).any(|word| {
            let is_word =
                word.len() > 1 && word.contains(|letter: char| letter.is_ascii_alphabetic());
            is_word && !KEPT.split_whitespace().any(|kept| kept == word)
        })
    };
    texts.iter().filter(is_english).cloned().collect()
}

fn strings(value: &Value) -> Vec<String> {
    value.as_array().unwrap().iter().map(|it| it.as_str().unwrap().to_owned()).collect()
}

/// Names of the robot that a page shows.
fn names(page: &Browser) -> BTreeSet<String> {
    let script = "return state.signals.flatMap((it) => [it.label, it.name]) \
        .concat(state.parameters.flatMap((it) => [it.label, it.name, it.full]), [state.name])";
    let mut names: BTreeSet<_> =
        strings(&page.look(script)).into_iter().filter(|name| name.len() > 1).collect();
    // Names of several words are shown by their last ones, too.
    let words: Vec<String> =
        names.iter().flat_map(|name| name.split(' ')).map(str::to_owned).collect();
    names.extend(words.into_iter().filter(|word| word.len() > 1));
    // What the script of the robot calls its parts.
    let script = team::Robot::description().remote.unwrap().script;
    names.extend(script.iter().map(|line| line.label.replace(": ", "：")));
    names
}

#[test]
fn the_page_and_the_report_have_no_english_word_left() {
    if !has_browser() {
        return;
    }
    let folder = Scratch::new("chinese");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let (_live, port) = live(
        command
            .args(["live", "--sim", "--script", "--page", "0", "--lang", "zh", "--out"])
            .arg(&*folder),
    );
    let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
    page.look(GATHER);
    page.until("return document.querySelectorAll('.plot').length >= 2");
    for view in ["robot", "motors", "more"] {
        page.look(&format!("document.querySelector('[aria-controls=tab-{view}]').click()"));
        page.look("return gather()");
    }
    page.until("return document.querySelector('#arm').textContent !== '–'");
    page.look("document.querySelector('#stop').click()");
    page.until("return named('', 'arm') === 'EStopped'");
    page.look("for (const id of ['robot', 'motors', 'more']) look(id)");
    page.until("gather(); return state.happened.length > 0");
    let texts = strings(&page.look("return gather()"));
    assert!(texts.len() > 100 && texts.iter().any(|it| it == "急停"), "{texts:?}");
    let names = names(&page);
    let left = english(&texts, &names);
    assert!(left.is_empty(), "page: {left:#?}");

    // A run with faults and a mistake in the table has findings.
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_rc10"))
            .args(["run", "--seconds", "5", "--lang", "zh", "--out"])
            .arg(&*folder)
            .args(arguments)
            .output()
            .unwrap();
        page.tell(
            "url",
            &serde_json::json!({ "url": format!("file://{}/report.html", folder.display()) }),
        );
        page.look(GATHER);
        page.look("window.dispatchEvent(new Event('resize'))");
        page.until("return document.querySelectorAll('canvas').length > 3");
        // Both frames of the browser after it: then all of it is drawn.
        let drawn = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done(0)))";
        page.tell("execute/async", &serde_json::json!({ "script": drawn, "args": [] }));
        // The revision of this checkout.
        let is_revision = |text: &String| {
            text.trim_end_matches("-dirty").bytes().all(|it| it.is_ascii_hexdigit())
        };
        let mut texts = strings(&page.look("return gather()"));
        texts.retain(|text| !is_revision(text));
        let left = english(&texts, &names);
        assert!(left.is_empty(), "{arguments:?}: {left:#?}");
        for way in SQUARE {
            let way = format!("square：{way}");
            assert!(texts.iter().any(|text| text.contains(&way)), "{way}: {texts:?}");
        }
        // The verdict on the terminal.
        let said = String::from_utf8(output.stdout).unwrap();
        let said = &said[said.find(['✓', '✗']).unwrap()..];
        let lines: Vec<_> = said.lines().map(str::to_owned).collect();
        let left = english(&lines, &names);
        assert!(left.is_empty(), "{arguments:?}: {left:#?}");
        said.to_owned()
    };
    assert_eq!(run(&[]).trim(), "✓ 11 个电机全部在线 · 无丢帧 · 无超时");
    let said = run(&["--mistake", "direction:wheel-front-left", "--fault", "cut:2@1s..2s"]);
    assert!(said.starts_with("✗ 1 个问题\n  wheel front left：方向反了"), "{said}");
}
