//! A record of a robot that runs: like a simulated one's, as far as the robot tells it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Result;
use rc10_time::Micros;

use super::client::Sample;
use super::plan::{Topic, chosen_messages, messages};
use crate::record::file::leftovers;
use crate::record::{EVENT, EVENTS, RecordFile, text};
use crate::recording::origin::Origin;
use crate::robot::description::Description;
use crate::terminal::tell;

/// Step back of a robot's time from which on it was restarted.
pub const RESTART: Micros = Micros::from_millis(200);

/// Longest time that a power cut takes from a record.
const SYNC: Micros = Micros::from_millis(5000);

/// Bytes of an hour, with the motors every 10 ms.
#[cfg(unix)]
const HOUR: f64 = 0.6e9;

/// The longest record that fits on the disk of this folder, in words; `None` if that is unknown.
#[cfg(unix)]
pub(super) fn room(folder: &Path, period: u16) -> Option<String> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(room_of(disk.f_bavail as f64 * disk.f_frsize as f64, period))
}

#[cfg(unix)]
fn room_of(free: f64, period: u16) -> String {
    let hours = free / (HOUR * (10.0 / f64::from(period)).max(1.0));
    if hours < 1.0 / 6.0 {
        format!("WARNING: the disk has room for some {:.0} min of the record only", hours * 60.0)
    } else {
        format!("the disk has room for some {hours:.1} h of the record")
    }
}

#[cfg(not(unix))]
pub(super) const fn room(_: &Path, _: u16) -> Option<String> {
    None
}

/// Names the records of a folder that have no end.
pub(super) fn tell_leftovers(folder: &Path) {
    let found = leftovers(folder);
    if !found.is_empty() {
        let names = names(&found);
        tell(format_args!(
            "not finished, or still being written: {names}; rc10 report reads such a file"
        ));
    }
}

/// The first of them, and how many more there are.
fn names(found: &[PathBuf]) -> String {
    let names: Vec<_> = found.iter().take(5).map(|path| path.display().to_string()).collect();
    let (names, more) = (names.join(", "), found.len() - names.len());
    if more == 0 { names } else { format!("{names} and {more} more") }
}

/// A name and a note as metadata.
fn about([name, note]: &[String; 2]) -> BTreeMap<String, String> {
    let both = [("name".to_owned(), name.clone()), ("note".to_owned(), note.clone())];
    both.into_iter().filter(|it| !it.1.is_empty()).collect()
}

/// The file of a record that got a name, renamed by it; the same file where that cannot be.
pub(super) fn named(path: PathBuf, name: &str) -> PathBuf {
    let safe = |letter: char| if letter.is_alphanumeric() || letter == '-' { letter } else { '_' };
    let name: String = name.chars().take(60).map(safe).collect();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let to = path.with_file_name(format!("{stem}-{name}.mcap"));
    if name.is_empty() || to.exists() || std::fs::rename(&path, &to).is_err() { path } else { to }
}

/// Stands before the topic of a thing where it is what pages chose of it, as often as they did; all else of it is NaN.
pub(super) const CHOSEN_TOPIC: &str = "/chosen";

fn channel(
    file: &mut RecordFile,
    topic: &Topic,
    before: &str,
    map: &BTreeMap<String, String>,
) -> Result<u16> {
    file.channel(&topic.schema_name(), &topic.schema(), &format!("{before}{}", topic.name), map)
}

/// A record that is being written.
pub struct LiveRecord {
    file: RecordFile,
    topics: Vec<Topic>,
    channels: Vec<u16>,
    /// Those of signals that were chosen, by topic: begun with the first of them.
    chosen: BTreeMap<usize, u16>,
    /// The channel of what happens, once a moment was marked.
    events: Option<u16>,
    /// Its name and note.
    words: [String; 2],
    /// The robot's time when the record began, or the robot anew.
    first: Option<Micros>,
    before: Micros,
    /// The record's time of the newest sample; `shift` is where the robot began to count.
    last: Micros,
    shift: Micros,
    /// The record's time of the last sync to the disk.
    synced: Micros,
    /// Number of samples.
    pub samples: u64,
}

impl LiveRecord {
    /// Begins a record at `path`; an existing file is replaced only with `force`. Motors of
    /// `description` get model and place for `rc10 report`. Fails if the file cannot be written or
    /// exists.
    pub fn new(
        path: &Path,
        force: bool,
        topics: &[Topic],
        description: &Description,
        words: [String; 2],
    ) -> Result<Self> {
        let mut head = about(&words);
        head.extend([
            ("seed".to_owned(), "1".to_owned()),
            ("source".to_owned(), "robot".to_owned()),
        ]);
        head.extend(Origin::now(&description.name).entries());
        let mut file = RecordFile::new(path, force, head)?;
        let mut channels = Vec::new();
        for topic in topics {
            let mut map = BTreeMap::from([("label".to_owned(), topic.label.clone())]);
            let motor = description.motors.iter().find(|motor| motor.label == topic.label);
            if let Some(motor) = motor.filter(|_| topic.folder == "motors") {
                map.insert("model".to_owned(), motor.name().to_string());
                map.insert("on".to_owned(), motor.on.to_string());
            }
            channels.push(channel(&mut file, topic, "", &map)?);
        }
        file.sync()?;
        let (before, last) = (Micros::ZERO, Micros::ZERO);
        Ok(Self {
            file,
            topics: topics.to_vec(),
            channels,
            chosen: BTreeMap::new(),
            events: None,
            words,
            first: None,
            before,
            last,
            shift: Micros::ZERO,
            synced: Micros::ZERO,
            samples: 0,
        })
    }

    /// Writes a sample, without signals of no topic; fails if the file cannot be written.
    pub fn take(&mut self, sample: &Sample) -> Result<()> {
        if sample.at + RESTART < self.before {
            // The robot counts anew: its record goes on.
            (self.first, self.shift) = (Some(sample.at), self.last);
        }
        let first = *self.first.get_or_insert(sample.at);
        self.before = sample.at;
        // The record begins with its first sample.
        let at = self.shift + sample.at.since(first);
        self.last = self.last.max(at);
        let Self { file, topics, channels, chosen, samples, .. } = self;
        messages(topics, sample, |topic, bytes| {
            *samples += 1;
            file.put_bytes(channels[topic], at, bytes)
        })?;
        chosen_messages(topics, sample, |topic, bytes| {
            *samples += 1;
            let id = match chosen.get(&topic) {
                Some(id) => *id,
                None => {
                    let map = [("label".to_owned(), topics[topic].label.clone())].into();
                    channel(file, &topics[topic], CHOSEN_TOPIC, &map)?
                }
            };
            chosen.insert(topic, id);
            file.put_bytes(id, at, bytes)
        })?;
        if self.last.since(self.synced) >= SYNC {
            self.synced = self.last;
            self.file.sync()?;
        }
        Ok(())
    }

    /// Marks the newest moment; fails if the file cannot be written.
    pub fn mark(&mut self, words: &str) -> Result<()> {
        let channel = match self.events {
            Some(channel) => channel,
            None => self.file.channel(EVENT.0, EVENT.1, EVENTS, &BTreeMap::new())?,
        };
        self.events = Some(channel);
        self.file.put_bytes(channel, self.last, &text(words))
    }

    /// Gives it this name and note, if they are not empty.
    pub fn name(&mut self, words: [String; 2]) {
        for (known, word) in self.words.iter_mut().zip(words) {
            if !word.is_empty() {
                *known = word;
            }
        }
    }

    /// Its name and note.
    pub const fn words(&self) -> &[String; 2] {
        &self.words
    }

    /// Length of the record.
    pub fn length(&self) -> Micros {
        self.last
    }

    /// Ends the record, also after an error. Fails if it cannot be written, or with the outcome's
    /// error.
    pub fn finish(self, outcome: Result<()>) -> Result<()> {
        let mut end = about(&self.words);
        end.insert("length_us".to_owned(), self.length().get().to_string());
        self.file.finish(outcome, end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn little_room_is_given_in_minutes() {
        let minutes = |minutes: f64| minutes / 60.0 * HOUR;
        for (free, period, text) in [
            (minutes(150.0), 10, "the disk has room for some 2.5 h of the record"),
            (minutes(150.0), 100, "the disk has room for some 2.5 h of the record"),
            (minutes(150.0), 2, "the disk has room for some 0.5 h of the record"),
            (minutes(12.0), 10, "the disk has room for some 0.2 h of the record"),
            (minutes(9.0), 10, "WARNING: the disk has room for some 9 min of the record only"),
            (minutes(90.0), 1, "WARNING: the disk has room for some 9 min of the record only"),
        ] {
            assert_eq!(room_of(free, period), text);
        }
    }

    #[test]
    fn five_records_are_named_and_the_others_counted() {
        let of = |count| names(&(1..=count).map(|at| at.to_string().into()).collect::<Vec<_>>());
        assert_eq!(of(2), "1, 2");
        assert_eq!(of(5), "1, 2, 3, 4, 5");
        assert_eq!(of(7), "1, 2, 3, 4, 5 and 2 more");
    }
}
