//! A record on the page of `rc10 live`: the same plots and tables, at the time that the page asks for.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{Context, Result};
use rc10_time::Micros;
use serde_json::{Value, json};

use super::client::Signal;
use super::connection::look;
use super::history::History;
use super::record::CHOSEN_TOPIC;
use super::server::{PageRequest, Pages};
use crate::files::open;
use crate::judge::{happened::happened, problems};
use crate::live::session::stop;
use crate::record::EVENTS;
use crate::record::file::{Channel, Item, label, walk};
use crate::record::replay::{numbers, replay};
use crate::recording::problem::Problem;
use crate::recording::sample::Source;
use crate::show::figures::Figures;
use crate::show::report::report;
use crate::world::robot::Robot;

/// What a page shows of a record beside its values.
#[derive(Default)]
struct Tape {
    signals: Vec<Signal>,
    /// The first of each topic.
    topics: BTreeMap<String, u16>,
    /// The first of each channel, and whether they were chosen: what is NaN was not, then. `None` for texts.
    channels: BTreeMap<u16, Option<(u16, bool)>>,
    /// The channel of the events, whose texts alone are for people.
    events_at: Option<u16>,
    events: Vec<(Micros, String)>,
    /// Its metadata: name and note among them.
    about: BTreeMap<String, String>,
    end: Micros,
    cut: Option<String>,
}

impl Tape {
    /// Reads a record, once. Fails if it is none.
    fn read(path: &Path, history: &mut History) -> Result<Self> {
        let mut tape = Self::default();
        let cut = walk(&mut open(path)?, |item| tape.take(item, history));
        tape.cut = cut.with_context(|| path.display().to_string())?;
        Ok(tape)
    }

    fn take(&mut self, item: Item<'_>, history: &mut History) -> Result<()> {
        match item {
            Item::Channel(id, channel) => {
                // What was chosen of a thing beside that thing, if it is there.
                let chosen = channel.topic.strip_prefix(CHOSEN_TOPIC);
                let topic = chosen.unwrap_or(&channel.topic);
                let first = match self.topics.get(topic) {
                    Some(first) => *first,
                    None => u16::try_from(self.signals.len()).context("too many signals")?,
                };
                let has_numbers = channel.columns.is_some();
                if channel.topic == EVENTS {
                    self.events_at = Some(id);
                }
                if self.topics.insert(topic.to_owned(), first).is_none() {
                    self.signals.extend(signals(&channel));
                }
                self.channels.insert(id, has_numbers.then_some((first, chosen.is_some())));
            }
            Item::Message(id, time, bytes) => {
                let (at, first) = (Micros::new(time / 1000), self.channels.get(&id));
                self.end = self.end.max(at);
                match first.context("a message of a channel that is not declared")? {
                    Some((first, chosen)) => (*first..)
                        .zip(numbers(bytes)?)
                        .filter(|(_, value)| !(*chosen && value.is_nan()))
                        .for_each(|(signal, value)| history.push(signal, at, value as f32)),
                    None if self.events_at == Some(id) => self.events.push((at, label(bytes))),
                    None => {}
                }
            }
            Item::Metadata(_, map) => self.about.extend(map),
        }
        Ok(())
    }

    /// What the page asks a robot for, else.
    fn state(&self, path: &Path, found: &Found, history: &History) -> Value {
        let seconds = |at: Micros| at.get() as f64 * 1e-6;
        let signal = |(index, it): (u16, &Signal)| {
            json!({
                "index": index, "folder": it.folder, "label": it.label, "name": it.name, "unit": it.unit,
                "states": it.states, "value": null,
            })
        };
        let events = self.events.iter().chain(&found.happened);
        let mut events: Vec<_> = events.map(|(at, what)| json!([seconds(*at), what])).collect();
        events.sort_by(|one, other| {
            one[0].as_f64().unwrap_or_default().total_cmp(&other[0].as_f64().unwrap_or_default())
        });
        let name = path.file_name().map(|it| it.to_string_lossy().into_owned());
        let about = |key: &str| self.about.get(key).map(String::as_str);
        json!({
            "file": { "name": name, "title": about("name"), "note": about("note"), "judged": found.is_done },
            "name": about("name").filter(|it| !it.is_empty()).map_or(name.clone(), |it| Some(it.to_owned())),
            "problems": found.problems, "happened": events, "trouble": found.trouble.as_ref().or(self.cut.as_ref()),
            "now": self.end.get(), "begin": history.begin(None).map(Micros::get), "whole": true,
            "declaration": path.display().to_string(), "losses": {}, "record": null, "report": found.is_done.then_some("ready"),
            "signals": (0..).zip(&self.signals).map(signal).collect::<Vec<_>>(), "parameters": [], "topics": self.channels.len(),
        })
    }
}

/// What is found by a look at the whole record.
#[derive(Default)]
struct Found {
    is_done: bool,
    problems: Vec<Value>,
    happened: Vec<(Micros, String)>,
    trouble: Option<String>,
}

/// The signals of a channel, with what its schema says of them.
fn signals(Channel { topic, map, columns, notes }: &Channel) -> Vec<Signal> {
    let words: Vec<_> = topic.trim_start_matches('/').split('/').collect();
    let folder = words.first().copied().unwrap_or_default();
    let named = words.get(1).map(|it| it.replace('_', " ")).unwrap_or_default();
    let label = map.get("label").cloned().unwrap_or(named);
    let more =
        words.get(2).filter(|it| **it != "health").map_or(String::new(), |it| format!("{it} "));
    let signal = |(name, note): (&String, &String)| {
        let mut notes: Vec<_> = note.split("; ").collect();
        let states = notes.pop_if(|it| it.starts_with("0 "));
        let states = states.map(|it| {
            it.split(", ").filter_map(|one| Some(one.split_once(' ')?.1.to_owned())).collect()
        });
        let unit = notes.get(1).map_or("", |it| it).to_owned();
        let unit = map.get("unit").cloned().unwrap_or(unit);
        Signal {
            folder: folder.into(),
            label: label.clone(),
            name: format!("{more}{name}"),
            unit,
            states: states.unwrap_or_default(),
        }
    };
    columns.iter().flatten().zip(notes).map(signal).collect()
}

/// Serves the page of a record at a port until Ctrl-C. Fails if it cannot be read, or the port is taken.
pub fn play(path: &Path, port: u16, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let stop = stop()?;
    let (mut history, mut found) = (History::default(), Found::default());
    let tape = Tape::read(path, &mut history)?;
    let pages = Pages::serve(port)?;
    let shown = Arc::clone(&pages.shown);
    let show = |found: &Found, history: Option<History>| {
        let mut shown = look(&shown);
        shown.history = history.unwrap_or_else(|| std::mem::take(&mut shown.history));
        shown.now = tape.end;
        shown.state = tape.state(path, found, &shown.history).to_string().into();
    };
    show(&found, Some(history));
    writeln!(
        out,
        "live  {}\n{}, {} s; Ctrl-C ends it",
        pages.address,
        path.display(),
        tape.end.get() as f64 * 1e-6
    )?;
    out.flush()?;
    let Pages { requests, .. } = pages;
    std::thread::spawn(move || {
        for (request, tell) in requests {
            // The page may have gone.
            let _ = tell.send(match request {
                PageRequest::Watch(..) => Ok(Value::Null),
                _ => Err("this is a record, and no robot".into()),
            });
        }
    });
    // The values are there at once; what is wrong takes a while to be found.
    match replay(&mut open(path)?, robot) {
        Ok((recording, _)) => {
            let figures = Figures::of(&recording);
            found.problems = problems(&recording).iter().map(Problem::to_json).collect();
            if recording.source == Source::Robot {
                let told = happened(&recording).into_iter();
                found.happened = told.map(|(at, what)| (recording.robot_time(at), what)).collect();
            }
            look(&shown).report = Some(report(&recording, &figures).into());
        }
        Err(why) => found.trouble = Some(format!("its problems are not looked for: {why:#}")),
    }
    found.is_done = true;
    show(&found, None);
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}
