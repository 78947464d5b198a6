//! The page of `rc10 live`, and the data on it: a web server for this PC alone.
//!
//! It is our own, on `std::net`: any web page could end a small one of others, and with it the STOP
//! button; a large one brings a runtime and a slower first compile. `connection` has the sockets,
//! [`request`](crate::live::request) the rules.

use crate::live::connection::look;
use std::net::{IpAddr, TcpListener};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use rc10_link::Urgent;
use rc10_time::Micros;
use serde_json::{Value, json};

use super::client::NOT_HEARD;
use super::connection;
use super::connection::Reply;
use super::hands::Hands;
use super::history::{History, thin};
use super::request::{Door, Plots, Request};
use crate::files::tuned_page;
use crate::lang;

/// A request of a page.
#[derive(Clone, Debug, PartialEq)]
pub enum PageRequest {
    /// Watch signals often: the page's number, the period in ms, and their numbers.
    Watch(u32, u16, Vec<u16>),
    /// Change parameters, by their full names.
    Set(Vec<(String, f32)>),
    /// Give the effect of this value of a parameter.
    Advise(String, f32),
    /// Give what is changed as lines for the robot's table.
    Table,
    /// Stop or disarm.
    Urge(Urgent),
    /// Do an action: its name, the motor's label, and a speed in rpm.
    Do(String, String, f32),
    /// Begin or end a record, which has this name and note.
    Record(bool, [String; 2]),
    /// Mark this moment, with some words.
    Mark(String),
    /// Let something go wrong in these words, or take it back.
    Break(String, bool),
}

/// A request of a page, and the way back for its answer.
pub type PendingRequest = (PageRequest, Sender<Result<Value, String>>);

/// The data of the pages: written by the thread that talks to the robot.
#[derive(Default)]
pub struct Shown {
    /// Values of the last minutes.
    pub history: History,
    /// Time of the robot.
    pub now: Micros,
    /// All else, as JSON.
    pub state: Arc<str>,
    /// The report of the last record.
    pub report: Option<Vec<u8>>,
    /// What moves, as JSON: the remote, and the base.
    pub moving: Arc<str>,
}

/// A server that runs.
pub struct Pages {
    /// The data of the pages.
    pub shown: Arc<Mutex<Shown>>,
    /// The pages' hands at a remote.
    pub hands: Arc<Mutex<Hands>>,
    /// Requests of the pages.
    pub requests: Receiver<PendingRequest>,
    /// The address for a browser.
    pub address: String,
    /// The port of the address.
    pub port: u16,
    queue: Sender<PendingRequest>,
}

/// Limit of letters of a name, a note and a mark.
const TEXT: usize = 200;
/// Time limit of a request.
const PATIENCE: Duration = Duration::from_secs(5);

impl Pages {
    /// Pages without sockets: who has them asks by [`ask`](Self::ask).
    pub fn unserved() -> Self {
        let shown = Arc::new(Mutex::new(Shown {
            state: "null".into(),
            moving: "null".into(),
            ..Shown::default()
        }));
        let (queue, requests) = channel();
        Self { shown, hands: Arc::default(), requests, queue, address: String::new(), port: 0 }
    }

    /// Begins to serve, on this PC only (port 0: any free one); fails if the port is taken.
    pub fn serve(port: u16) -> Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", port)).with_context(|| {
            format!("no page at port {port} of this PC; --page 0 takes one that is free")
        })?;
        let port = listener.local_addr()?.port();
        let address = format!("http://127.0.0.1:{port}/");
        let pages = Self { address, port, ..Self::unserved() };
        pages.open(listener, Door::here(port));
        Ok(pages)
    }

    /// Serves other devices in the network too, at this address of this PC; gives what they are to open. Fails if the
    /// address is not this PC's, or the port is taken there.
    pub fn serve_guests(&self, address: IpAddr) -> Result<String> {
        let listener = TcpListener::bind((address, self.port))
            .with_context(|| format!("no page at {address}, port {}", self.port))?;
        let (door, url) = Door::lan(listener.local_addr()?);
        self.open(listener, door);
        Ok(url)
    }

    /// Answers a request of a page in the same program.
    pub fn ask(&self, request: &Request) -> Answered {
        respond(request, &self.shown, &self.hands, &self.queue, false)
    }

    fn open(&self, listener: TcpListener, door: Door) {
        let (seen, hands) = (Arc::clone(&self.shown), Arc::clone(&self.hands));
        let (queue, is_guest) = (self.queue.clone(), door.is_for_guests());
        let answer =
            move |request: &Request| respond(request, &seen, &hands, &queue, is_guest).wait();
        thread::spawn(move || connection::serve(&listener, &door, answer));
    }
}

/// The answer to a request of a page, or what it waits for.
pub enum Answered {
    /// The answer.
    Now(Reply),
    /// The robot's answer: it comes within a time, or the page is told so.
    Later(Receiver<Result<Value, String>>, Duration, &'static str),
}

impl Answered {
    fn of_robot(outcome: Result<Value, String>) -> Reply {
        let (status, body) = match outcome {
            Ok(value) => (200, json!({ "ok": value })),
            Err(why) => (409, json!({ "refused": why })),
        };
        Reply { status, kind: "application/json", body: body.to_string().into() }
    }

    /// Waits for the answer.
    pub fn wait(self) -> Reply {
        match self {
            Self::Now(reply) => reply,
            Self::Later(answer, patience, why) => {
                let outcome = answer.recv_timeout(patience);
                Self::of_robot(outcome.unwrap_or_else(|_| Err(why.into())))
            }
        }
    }

    /// The answer, if it is there after this time; itself if not. Fails if it is not there yet.
    pub fn poll(self, waited: Duration) -> Result<Reply, Self> {
        match self {
            Self::Later(answer, patience, why) => match answer.try_recv() {
                Ok(outcome) => Ok(Self::of_robot(outcome)),
                Err(TryRecvError::Empty) if waited < patience => {
                    Err(Self::Later(answer, patience, why))
                }
                Err(_) => Ok(Self::of_robot(Err(why.into()))),
            },
            Self::Now(reply) => Ok(reply),
        }
    }
}

/// A guest watches, and stops.
fn respond(
    request: &Request,
    shown: &Mutex<Shown>,
    hands: &Mutex<Hands>,
    queue: &Sender<PendingRequest>,
    is_guest: bool,
) -> Answered {
    let ok = |kind, body| Reply { status: 200, kind, body };
    let (path, query) = request.target.split_once('?').unwrap_or((&request.target, ""));
    Answered::Now(match (request.is_post, path) {
        (false, "/") => ok("text/html; charset=utf-8", page().into()),
        (false, "/state") => {
            let state = Arc::clone(&look(shown).state);
            let at = query.strip_prefix("at=").and_then(|it| it.parse().ok());
            ok(
                "application/json",
                match at {
                    Some(at) => state_at(&state, Micros::new(at), shown),
                    None => state.as_bytes().into(),
                },
            )
        }
        (false, "/report") => match look(shown).report.clone() {
            Some(report) => ok("text/html; charset=utf-8", report),
            None => Reply::text(404, "there is no report yet"),
        },
        // What rc10 tune has found of a motor, by the number of one of its signals.
        (false, "/tuned") => match label_of(query, shown).as_deref().and_then(tuned_page) {
            Some(page) => ok("text/html; charset=utf-8", page.into()),
            None => Reply::text(404, "rc10 tune has no page of this motor yet"),
        },
        (false, "/moving") => ok("application/json", look(shown).moving.as_bytes().into()),
        // Answered here: a page that drives neither waits for the robot's thread nor delays it.
        (true, "/drive") if !is_guest => {
            let wish = serde_json::from_slice(&request.body).map_err(|error| error.to_string());
            match wish.and_then(|wish: Value| look(hands).ask(&wish)) {
                Ok(Value::Null) => ok("application/json", look(shown).moving.as_bytes().into()),
                Ok(answer) => ok("application/json", answer.to_string().into()),
                Err(why) => {
                    let body = json!({ "refused": why }).to_string().into();
                    Reply { status: 409, kind: "application/json", body }
                }
            }
        }
        (false, "/data") => match Plots::parse(query) {
            Some(plots) => ok("application/octet-stream", data(&plots, shown)),
            None => Reply::text(400, Plots::FORM),
        },
        (false, "/favicon.ico") => ok("image/x-icon", Vec::new()),
        (true, "/wish") => {
            let allowed = |it| match it {
                PageRequest::Urge(Urgent::Stop) => Ok(it),
                _ if is_guest => Err("from another device only STOP".to_owned()),
                _ => Ok(it),
            };
            let outcome = read_request(&request.body).and_then(allowed);
            match outcome.and_then(|it| forward(it, queue)) {
                Ok(later) => return later,
                Err(why) => Answered::of_robot(Err(why)),
            }
        }
        _ => Reply::text(404, "there is no such page"),
    })
}

/// The label of a motor, by the number of one of its signals.
fn label_of(index: &str, shown: &Mutex<Shown>) -> Option<String> {
    let index: u64 = index.parse().ok()?;
    let state: Value = serde_json::from_str(&Arc::clone(&look(shown).state)).ok()?;
    let mut signals = state.get("signals")?.as_array()?.iter();
    let found = signals.find(|it| it["index"] == index && it["folder"] == "motors")?;
    Some(found.get("label")?.as_str()?.to_owned())
}

/// The state with the values that signals had at a time.
fn state_at(state: &str, at: Micros, shown: &Mutex<Shown>) -> Vec<u8> {
    let mut state: Value = serde_json::from_str(state).unwrap_or_default();
    let signals = state.get_mut("signals").and_then(Value::as_array_mut);
    for signal in signals.into_iter().flatten() {
        let index =
            signal.get("index").and_then(Value::as_u64).and_then(|it| u16::try_from(it).ok());
        let value = index.and_then(|index| look(shown).history.at(index, at));
        signal["value"] = value.filter(|it| it.is_finite()).into();
    }
    state.to_string().into()
}

/// One file, so that a page that is open works on while `rc10 live` begins anew.
pub(super) fn page() -> String {
    const SCRIPT: &str = concat!(
        include_str!("../show/plot.js"),
        include_str!("../show/field.js"),
        include_str!("../show/step.js"),
        include_str!("../show/bode.js"),
        include_str!("page/base.js"),
        include_str!("page/layout.js"),
        include_str!("page/signals.js"),
        include_str!("page/motors.js"),
        include_str!("page/parameters.js"),
        include_str!("page/kept.js"),
        include_str!("page/plots.js"),
        include_str!("page/time.js"),
        include_str!("page/field.js"),
        include_str!("page/drive.js"),
        include_str!("page/broken.js"),
        include_str!("page/tune.js"),
        include_str!("page/stop.js"),
        include_str!("page/main.js"),
    );
    const STYLE: &str = concat!(include_str!("../show/colours.css"), include_str!("page/page.css"));
    include_str!("page/page.html")
        .replace("/*STYLE*/", STYLE)
        .replace("/*SCRIPT*/", &(lang::script() + SCRIPT))
}

/// The robot's time, µs, as a 64-bit float; then for each signal the number of its points as 32
/// bits, and for each point the seconds since `from` and the value as 32-bit floats. Little endian.
fn data(plots: &Plots, shown: &Mutex<Shown>) -> Vec<u8> {
    let mut bytes = (look(shown).now.get() as f64).to_le_bytes().to_vec();
    let mut values = Vec::new();
    for signal in &plots.signals {
        values.clear();
        // The robot's samples wait for this lock, so each copy takes it anew.
        look(shown).history.copy(*signal, plots.span, plots.columns, &mut values);
        if plots.every > 0 {
            // Another page may watch it more often. A quarter behind whole multiples, where samples are.
            values.dedup_by_key(|(at, _)| (at.get() + plots.every / 4) / plots.every);
        }
        let points = thin(&values, plots.span, plots.columns);
        bytes.extend((points.len() as u32).to_le_bytes());
        for (at, value) in points {
            let seconds = (at.get() as f64 - plots.span[0].get() as f64) * 1e-6;
            bytes.extend((seconds as f32).to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}

fn read_request(body: &[u8]) -> Result<PageRequest, String> {
    let value: Value = serde_json::from_slice(body).map_err(|error| error.to_string())?;
    parse(&value).ok_or_else(|| format!("not understood: {value}"))
}

fn parse(value: &Value) -> Option<PageRequest> {
    let short = |value: &Value| u16::try_from(value.as_u64()?).ok();
    if let Some(signals) = value.get("watch") {
        let signals: Option<Vec<u16>> = signals.as_array()?.iter().map(short).collect();
        let page = value.get("page").and_then(Value::as_u64).unwrap_or_default() as u32;
        return Some(PageRequest::Watch(page, short(value.get("period")?)?, signals?));
    }
    if let Some(changes) = value.get("set") {
        let change = |change: &Value| {
            Some((change.get(0)?.as_str()?.to_owned(), change.get(1)?.as_f64()? as f32))
        };
        return Some(PageRequest::Set(
            changes.as_array()?.iter().map(change).collect::<Option<_>>()?,
        ));
    }
    if let Some(change) = value.get("advise") {
        let name = change.get(0)?.as_str()?.to_owned();
        return Some(PageRequest::Advise(name, change.get(1)?.as_f64()? as f32));
    }
    if value.get("table").is_some() {
        return Some(PageRequest::Table);
    }
    if let Some(action) = value.get("do") {
        // By its label: its number may change with the next firmware.
        let motor = value.get("motor").and_then(Value::as_str).unwrap_or_default();
        let speed = value.get("speed").and_then(Value::as_f64).unwrap_or_default() as f32;
        return Some(match action.as_str()? {
            "stop" => PageRequest::Urge(Urgent::Stop),
            "disarm" => PageRequest::Urge(Urgent::Disarm),
            action => PageRequest::Do(action.into(), motor.into(), speed),
        });
    }
    if let Some(words) = value.get("break").or_else(|| value.get("mend")) {
        return Some(PageRequest::Break(words.as_str()?.into(), value.get("break").is_some()));
    }
    let text = |name: &str| {
        let text = value.get(name).and_then(Value::as_str).unwrap_or_default();
        text.chars().filter(|it| !it.is_control()).take(TEXT).collect::<String>().trim().to_owned()
    };
    if value.get("mark").is_some() {
        return Some(PageRequest::Mark(text("mark")));
    }
    Some(PageRequest::Record(value.get("record")?.as_bool()?, ["name", "note"].map(text)))
}

fn forward(request: PageRequest, queue: &Sender<PendingRequest>) -> Result<Answered, String> {
    let (answer, answered) = channel();
    let is_urgent = matches!(request, PageRequest::Urge(_));
    queue.send((request, answer)).map_err(|_| "rc10 live has ended")?;
    // The thread that talks to the robot may be held up; a stop must not wait for it to say so.
    let (patience, why) = if is_urgent {
        (Duration::from_micros(NOT_HEARD.get()), "NOT HEARD by the robot yet: it is sent on and on")
    } else {
        (PATIENCE, "the robot did not answer")
    };
    Ok(Answered::Later(answered, patience, why))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_or_refused() {
        let read = |text: &str| parse(&serde_json::from_str(text).unwrap());
        let change = ("arm.speed_kp".to_owned(), 0.5);
        assert_eq!(read(r#"{"set":[["arm.speed_kp",0.5]]}"#), Some(PageRequest::Set(vec![change])));
        let watch = |page| Some(PageRequest::Watch(page, 5, vec![1, 2]));
        assert_eq!(read(r#"{"watch":[1,2],"period":5}"#), watch(0));
        assert_eq!(read(r#"{"watch":[1,2],"period":5,"page":7}"#), watch(7));
        let zero = PageRequest::Do("zero".into(), "arm".into(), 0.0);
        assert_eq!(read(r#"{"do":"zero","motor":"arm"}"#), Some(zero));
        assert_eq!(read(r#"{"do":"stop"}"#), Some(PageRequest::Urge(Urgent::Stop)));
        let record = |name: &str| Some(PageRequest::Record(true, [name.to_owned(), String::new()]));
        assert_eq!(read(r#"{"record":true}"#), record(""));
        assert_eq!(read(r#"{"record":true,"name":" a\n/../b "}"#), record("a/../b"));
        assert_eq!(read(r#"{"mark":"here"}"#), Some(PageRequest::Mark("here".into())));
        for bad in ["{}", "[]", r#"{"set":[[3,1]]}"#, r#"{"set":[[1,null]]}"#, r#"{"do":3}"#] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }
}
