//! The page of `rc10 live`, and the data on it: a web server for this PC alone.

use std::io::{Cursor, Read as _};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use rc10_can::Micros;
use serde_json::{Value, json};
use tiny_http::{Header, Method, Request, Response, Server};

use super::history::History;

/// What a page wants.
#[derive(Clone, Debug, PartialEq)]
pub enum Wish {
    /// To see these signals often: the period in ms, and their numbers.
    Watch(u16, Vec<u16>),
    /// To change parameters.
    Set(Vec<(u16, f32)>),
    /// Something done: its name, the motor's number, and a speed in rpm.
    Do(String, u8, f32),
    /// A record to begin, or to end.
    Record(bool),
}

/// A wish, and where its answer goes.
pub type Asked = (Wish, Sender<Result<Value, String>>);

/// What pages see: written by the one that speaks with the robot.
#[derive(Default)]
pub struct Shown {
    /// The newest values, and those before.
    pub history: History,
    /// The robot's time.
    pub now: Micros,
    /// All but the values.
    pub state: Value,
}

/// A server that runs.
pub struct Pages {
    /// Where pages see what there is.
    pub shown: Arc<Mutex<Shown>>,
    /// What pages want.
    pub wishes: Receiver<Asked>,
    /// Where it is, for a browser.
    pub address: String,
}

/// Pages that are served at once.
const WORKERS: usize = 4;
/// Bytes of a wish.
const LONGEST: u64 = 64 * 1024;
/// How long a wish may take.
const PATIENCE: Duration = Duration::from_secs(5);

impl Pages {
    /// Begins to serve, on this PC only; port 0 is any that is free.
    ///
    /// # Errors
    /// If the port is taken.
    pub fn serve(port: u16) -> Result<Self> {
        let server = Server::http(("127.0.0.1", port)).map_err(|error| anyhow!("{error}"));
        let server = server.with_context(|| format!("no page at port {port} of this PC"))?;
        let address = server.server_addr().to_ip().context("no address")?;
        let server = Arc::new(server);
        let shown = Arc::new(Mutex::new(Shown::default()));
        let (tell, wishes) = channel();
        for _ in 0..WORKERS {
            let (server, shown, tell) = (Arc::clone(&server), Arc::clone(&shown), tell.clone());
            thread::spawn(move || {
                for request in server.incoming_requests() {
                    answer(request, &shown, &tell, address.port());
                }
            });
        }
        Ok(Self { shown, wishes, address: format!("http://{address}/") })
    }
}

/// What is shown; a thread that panicked left it whole.
pub fn look(shown: &Mutex<Shown>) -> MutexGuard<'_, Shown> {
    shown.lock().unwrap_or_else(PoisonError::into_inner)
}

fn answer(mut request: Request, shown: &Mutex<Shown>, tell: &Sender<Asked>, port: u16) {
    let response = match refusal(&request, port) {
        Some(why) => text(403, why.into(), "text/plain"),
        None => respond(&mut request, shown, tell),
    };
    // A page that has gone.
    let _ = request.respond(response);
}

type Bytes = Response<Cursor<Vec<u8>>>;

fn text(status: u16, body: Vec<u8>, kind: &str) -> Bytes {
    let headers = [
        ("Content-Type", kind),
        ("Cache-Control", "no-store"),
        ("X-Content-Type-Options", "nosniff"),
        ("Content-Security-Policy", "default-src 'self' 'unsafe-inline'; frame-ancestors 'none'"),
    ];
    // Its length is known.
    let response =
        Response::from_data(body).with_status_code(status).with_chunked_threshold(usize::MAX);
    headers.iter().fold(response, |response, (name, value)| {
        match Header::from_bytes(name.as_bytes(), value.as_bytes()) {
            Ok(header) => response.with_header(header),
            Err(()) => response,
        }
    })
}

/// A page of another site that is open in the same browser must not drive the robot: neither by its own
/// name for this PC, nor by a form.
fn refusal(request: &Request, port: u16) -> Option<&'static str> {
    let header = |name: &'static str| {
        let mut headers = request.headers().iter();
        headers.find(|header| header.field.equiv(name)).map(|header| header.value.as_str())
    };
    let ours = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !header("Host").is_some_and(|host| ours.iter().any(|our| our == host)) {
        return Some("not under this name");
    }
    if let Some(origin) = header("Origin")
        && !ours.iter().any(|our| origin == format!("http://{our}"))
    {
        return Some("not from another site");
    }
    let is_json = header("Content-Type").is_some_and(|kind| kind.starts_with("application/json"));
    (*request.method() == Method::Post && !is_json).then_some("only JSON")
}

fn respond(request: &mut Request, shown: &Mutex<Shown>, tell: &Sender<Asked>) -> Bytes {
    let url = request.url().to_owned();
    let (path, query) = url.split_once('?').unwrap_or((&url, ""));
    match (request.method(), path) {
        (Method::Get, "/") => text(200, page().into(), "text/html; charset=utf-8"),
        (Method::Get, "/state") => {
            let shown = look(shown);
            text(200, shown.state.to_string().into(), "application/json")
        }
        (Method::Get, "/data") => match data(query, &look(shown)) {
            Some(bytes) => text(200, bytes, "application/octet-stream"),
            None => text(400, "signals=1,2&from=US&to=US&columns=N".into(), "text/plain"),
        },
        (Method::Post, "/wish") => {
            let outcome = wish(request).and_then(|wish| grant(wish, tell));
            let (status, body) = match outcome {
                Ok(value) => (200, json!({ "ok": value })),
                Err(why) => (409, json!({ "refused": why })),
            };
            text(status, body.to_string().into(), "application/json")
        }
        _ => text(404, "there is no such page".into(), "text/plain"),
    }
}

fn page() -> String {
    include_str!("page.html")
        .replace("/*STYLE*/", include_str!("page.css"))
        .replace("/*SCRIPT*/", include_str!("page.js"))
}

/// Points, for each signal asked for: their count, and for each the seconds since `from` and the value, in
/// 32 bits, little endian. Before all that the robot's time, µs, in 64 bits as a float.
fn data(query: &str, shown: &Shown) -> Option<Vec<u8>> {
    let value = |name: &str| {
        query.split('&').find_map(|pair| pair.split_once('=').filter(|pair| pair.0 == name))
    };
    let number = |name: &str| value(name)?.1.parse::<u64>().ok();
    let (from, to) = (Micros::new(number("from")?), Micros::new(number("to")?));
    let columns = u32::try_from(number("columns")?).ok()?.clamp(1, 10_000);
    let signals: Option<Vec<u16>> = value("signals")?
        .1
        .split(',')
        .filter(|it| !it.is_empty())
        .map(|it| it.parse().ok())
        .collect();
    let mut bytes = (shown.now.get() as f64).to_le_bytes().to_vec();
    for signal in signals? {
        let points = shown.history.points(signal, [from, to], columns);
        bytes.extend((points.len() as u32).to_le_bytes());
        for (at, value) in points {
            let seconds = (at.get() as f64 - from.get() as f64) * 1e-6;
            bytes.extend((seconds as f32).to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
    }
    Some(bytes)
}

/// Reads a wish.
fn wish(request: &mut Request) -> Result<Wish, String> {
    let mut body = String::new();
    let read = request.as_reader().take(LONGEST).read_to_string(&mut body);
    read.map_err(|error| error.to_string())?;
    let value: Value = serde_json::from_str(&body).map_err(|error| error.to_string())?;
    parse(&value).ok_or_else(|| format!("not understood: {value}"))
}

fn parse(value: &Value) -> Option<Wish> {
    let short = |value: &Value| u16::try_from(value.as_u64()?).ok();
    if let Some(signals) = value.get("watch") {
        let signals: Option<Vec<u16>> = signals.as_array()?.iter().map(short).collect();
        return Some(Wish::Watch(short(value.get("period")?)?, signals?));
    }
    if let Some(changes) = value.get("set") {
        let change =
            |change: &Value| Some((short(change.get(0)?)?, change.get(1)?.as_f64()? as f32));
        return Some(Wish::Set(changes.as_array()?.iter().map(change).collect::<Option<_>>()?));
    }
    if let Some(action) = value.get("do") {
        let motor = value.get("motor").and_then(Value::as_u64).unwrap_or_default();
        let speed = value.get("speed").and_then(Value::as_f64).unwrap_or_default() as f32;
        return Some(Wish::Do(action.as_str()?.into(), u8::try_from(motor).ok()?, speed));
    }
    Some(Wish::Record(value.get("record")?.as_bool()?))
}

fn grant(wish: Wish, tell: &Sender<Asked>) -> Result<Value, String> {
    let (answer, answered) = channel();
    tell.send((wish, answer)).map_err(|_| "rc10 live has ended")?;
    answered.recv_timeout(PATIENCE).map_err(|_| "the robot did not answer")?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_are_read_or_refused() {
        let read = |text: &str| parse(&serde_json::from_str(text).unwrap());
        assert_eq!(read(r#"{"set":[[3,0.5]]}"#), Some(Wish::Set(vec![(3, 0.5)])));
        assert_eq!(read(r#"{"watch":[1,2],"period":5}"#), Some(Wish::Watch(5, vec![1, 2])));
        assert_eq!(read(r#"{"do":"zero","motor":2}"#), Some(Wish::Do("zero".into(), 2, 0.0)));
        assert_eq!(read(r#"{"record":true}"#), Some(Wish::Record(true)));
        for bad in ["{}", "[]", r#"{"set":[[70000,1]]}"#, r#"{"set":[[1,null]]}"#, r#"{"do":3}"#] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }
}
