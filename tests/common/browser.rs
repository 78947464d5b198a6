//! A browser that a test drives.

use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::served::{JSON, Started, http, start};

/// A browser under remote control.
pub struct Browser {
    pub port: u16,
    pub session: String,
    _driver: Started,
}

impl Browser {
    /// Opens a page.
    pub fn open(url: &str) -> Self {
        let (driver, line) =
            start(Command::new("chromedriver").arg("--port=0"), "started successfully on port");
        let port = line.trim_end_matches('.').rsplit(' ').next().unwrap().parse().unwrap();
        let options = json!({ "args": [
            "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
            "--window-size=1500,950",
        ]});
        let wanted = json!({ "capabilities": { "alwaysMatch": { "goog:chromeOptions": options, "timeouts": { "script": 600_000 } } } });
        let (_, body) = http(port, "POST", "/session", JSON, &wanted.to_string());
        let answer: Value = serde_json::from_str(&body).unwrap();
        let session = answer["value"]["sessionId"].as_str().unwrap_or_else(|| panic!("{answer}"));
        let browser = Self { port, session: session.to_owned(), _driver: driver };
        browser.tell("url", &json!({ "url": url }));
        browser
    }

    /// Gives the driver a command.
    pub fn tell(&self, command: &str, body: &Value) -> Value {
        let path = format!("/session/{}/{command}", self.session);
        let (status, body) = http(self.port, "POST", &path, JSON, &body.to_string());
        assert_eq!(status, 200, "{body}");
        serde_json::from_str::<Value>(&body).unwrap()["value"].clone()
    }

    /// The value of a script on the page.
    pub fn look(&self, script: &str) -> Value {
        self.tell("execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// Types.
    pub fn keys(&self, text: &str) {
        let both = |key: char| {
            ["keyDown", "keyUp"].map(|kind| json!({ "type": kind, "value": key.to_string() }))
        };
        let keys: Vec<_> = text.chars().flat_map(both).collect();
        let keys = json!({ "actions": [{ "type": "key", "id": "k", "actions": keys }] });
        self.tell("actions", &keys);
    }

    /// Presses a key and holds it (`keyDown`), or lets it go (`keyUp`).
    pub fn hold(&self, key: &str, kind: &str) {
        let action = json!({ "type": kind, "value": key });
        let keys = json!({ "actions": [{ "type": "key", "id": "k", "actions": [action] }] });
        self.tell("actions", &keys);
    }

    /// Lets so many seconds of the robot's own time pass, which is slower than the clock on a busy machine.
    pub fn pass(&self, seconds: f64) {
        // What the page shows is older.
        let ask = "const done = arguments[0]; fetch('state').then((it) => it.json()).then((it) => done(it.now))";
        let now = self.tell("execute/async", &json!({ "script": ask, "args": [] }));
        let end = now.as_f64().unwrap() + seconds * 1e6;
        self.until(&format!("return state.now > {end}"));
    }

    /// Waits until a script says true.
    pub fn until(&self, script: &str) {
        let begin = Instant::now();
        while self.look(script) != json!(true) {
            assert!(begin.elapsed() < Duration::from_secs(600), "never: {script}");
            sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = http(self.port, "DELETE", &format!("/session/{}", self.session), "", "");
    }
}

/// Whether there is a browser here.
pub fn has_browser() -> bool {
    let is_there = |name: &str| Command::new(name).arg("--version").output().is_ok();
    let both = is_there("chromium") && is_there("chromedriver");
    if !both {
        eprintln!("SKIPPED: no chromium and chromedriver on this machine: the page is not tested");
    }
    both
}
