//! Robots in a web page: what the page's worker calls. One buffer carries arguments and answers.
//!
//! | call | the buffer before | the buffer after |
//! |---|---|---|
//! | `begin` | `{"robot": .., "arguments": [..]}`, those of `rc10 live` | empty, or what went wrong |
//! | `step` | | time in seconds; below zero: what went wrong, or the mistakes to begin anew with, as JSON |
//! | `ask` | target and body of a request | the answer, or empty: it comes by `owed` |
//! | `owed` | | the next answer that is there, or empty |
//! | `command` | as of `begin`, of any command | the exit code in a byte, and what was printed |
//!
//! An answer is the request's number (32 bits), its status (16 bits), the length of its kind (8 bits), the kind, the
//! content.
#![expect(unsafe_code, reason = "names for the page's worker")]

use std::cell::RefCell;

use anyhow::{Context, Result, bail};
use rc10_cli::live::{Reply, Web};
use rc10_cli::{CommandLine, Robot, robot_for_good, web};
use serde_json::{Value, json};

/// Sets a robot up.
type Begin = fn() -> Result<Robot<'static>>;

/// The robots, by their packages.
const ROBOTS: [(&str, Begin); 7] = [
    ("starter", robot_for_good::<starter::Robot>),
    ("omni", robot_for_good::<omni::Robot>),
    ("team", robot_for_good::<team::Robot>),
    ("swerve", robot_for_good::<swerve::Robot>),
    ("lift", robot_for_good::<lift::Robot>),
    ("mixed", robot_for_good::<mixed::Robot>),
    ("owl", robot_for_good::<owl::Robot>),
];

/// The robot that runs, and the buffer.
#[derive(Default)]
struct Here {
    web: Option<Web>,
    buffer: Vec<u8>,
}

thread_local! {
    static HERE: RefCell<Here> = RefCell::default();
}

fn here<T>(work: impl FnOnce(&mut Here) -> T) -> T {
    HERE.with_borrow_mut(work)
}

/// A robot and the words of a command, from the buffer.
fn wish(buffer: &[u8]) -> Result<(Begin, Vec<String>)> {
    let wish: Value = serde_json::from_slice(buffer)?;
    let name = wish["robot"].as_str().context("no robot")?;
    let (_, robot) = ROBOTS.into_iter().find(|it| it.0 == name).context("no such robot")?;
    let words = wish["arguments"].as_array().into_iter().flatten().filter_map(Value::as_str);
    Ok((robot, std::iter::once("rc10").chain(words).map(str::to_owned).collect()))
}

/// The buffer with room for so many bytes.
#[unsafe(no_mangle)]
pub extern "C" fn room(bytes: usize) -> *mut u8 {
    here(|it| {
        it.buffer.clear();
        it.buffer.resize(bytes, 0);
        it.buffer.as_mut_ptr()
    })
}

/// Where the buffer is.
#[unsafe(no_mangle)]
pub extern "C" fn at() -> *const u8 {
    here(|it| it.buffer.as_ptr())
}

/// Length of the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn length() -> usize {
    here(|it| it.buffer.len())
}

/// Begins a robot.
#[unsafe(no_mangle)]
pub extern "C" fn begin() {
    here(|it| {
        let begun = wish(&it.buffer).and_then(|(robot, words)| web(&words, robot()?, robot));
        it.buffer.clear();
        match begun {
            Ok(web) => it.web = Some(web),
            Err(error) => it.buffer = format!("{error:#}").into(),
        }
    });
}

/// Lets the robot go on for some milliseconds.
#[unsafe(no_mangle)]
pub extern "C" fn step() -> f64 {
    here(|it| {
        let Some(web) = &mut it.web else { return -1.0 };
        let outcome = match (web.step(), web.take_anew()) {
            (Ok(now), None) => return now.get() as f64 * 1e-6,
            (Ok(_), Some(mistakes)) => json!({ "anew": mistakes }),
            (Err(error), _) => json!({ "error": format!("{error:#}") }),
        };
        it.buffer = outcome.to_string().into();
        -1.0
    })
}

/// Asks as a browser would ask a server.
#[unsafe(no_mangle)]
pub extern "C" fn ask(number: u32, is_post: bool, target: usize) {
    here(|it| {
        let (target, body) = it.buffer.split_at(target.min(it.buffer.len()));
        let target = String::from_utf8_lossy(target);
        let reply = it.web.as_mut().and_then(|web| web.ask(number, is_post, &target, body));
        it.buffer = reply.map_or_else(Vec::new, |reply| answer(number, &reply));
    });
}

/// The next answer that was owed.
#[unsafe(no_mangle)]
pub extern "C" fn owed() {
    here(|it| {
        let owed = it.web.as_mut().and_then(Web::owed);
        it.buffer = owed.map_or_else(Vec::new, |(number, reply)| answer(number, &reply));
    });
}

/// Runs a command to its end.
#[unsafe(no_mangle)]
pub extern "C" fn command() {
    here(|it| {
        let mut out = vec![0];
        let code = run(&it.buffer, &mut out).unwrap_or_else(|error| {
            out.extend(format!("{error:#}\n").into_bytes());
            2
        });
        out[0] = code;
        it.buffer = out;
    });
}

fn run(buffer: &[u8], out: &mut Vec<u8>) -> Result<u8> {
    let (robot, words) = wish(buffer)?;
    if words.get(1).is_some_and(|it| ["live", "pty"].contains(&it.as_str())) {
        bail!("not in a web page");
    }
    CommandLine::parse(words)?.run_to(robot()?, out)
}

fn answer(number: u32, Reply { status, kind, body }: &Reply) -> Vec<u8> {
    let mut bytes = number.to_le_bytes().to_vec();
    bytes.extend(status.to_le_bytes());
    bytes.extend(u8::try_from(kind.len()));
    bytes.extend(kind.as_bytes());
    bytes.extend(body);
    bytes
}
