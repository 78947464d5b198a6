//! Time on the page of `rc10 live`: values at a high rate, the time bar, records in the page, and reports from it.

use std::process::Command;

use serde_json::{Value, json};

use crate::common::browser::{Browser, has_browser};
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
    let (_live, port) = live(command.args(["live", "--sim", "--baud", "921600", "--page", "0"]));
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
