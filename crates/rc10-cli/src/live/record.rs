//! A record of a robot that runs: the file that `--record` writes of a simulated one, as far as the robot
//! can tell it.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use rc10_can::Micros;

use super::client::Sample;
use super::plan::{Topic, messages};
use crate::description::Description;
use crate::record::RecordFile;

/// A robot whose time goes back by so much was restarted.
pub const RESTART: Micros = Micros::from_millis(200);

/// A record that is being written. The file is there when it is finished.
pub struct LiveRecord {
    file: RecordFile,
    topics: Vec<Topic>,
    /// The channel of each.
    channels: Vec<u16>,
    /// The robot's time when the record began, or the robot anew; and that of the newest sample.
    first: Option<Micros>,
    before: Micros,
    /// The record's: of the newest sample, and when the robot began to count.
    last: Micros,
    shift: Micros,
    /// Samples that it holds.
    pub samples: u64,
}

impl LiveRecord {
    /// Begins a record that will be at `path`. Motors that `description` has too are told with their
    /// model and place: so `rc10 report` knows the robot again.
    ///
    /// # Errors
    /// If no file can be written there.
    pub fn new(path: &Path, topics: &[Topic], description: &Description) -> Result<Self> {
        let head = BTreeMap::from([
            ("seed".to_owned(), "1".to_owned()),
            ("source".to_owned(), "robot".to_owned()),
        ]);
        let mut file = RecordFile::new(path, head)?;
        let mut channels = Vec::new();
        for topic in topics {
            let mut map = BTreeMap::from([("label".to_owned(), topic.label.clone())]);
            let motor = description.motors.iter().find(|motor| motor.label == topic.label);
            if let Some(motor) = motor.filter(|_| topic.folder == "motors") {
                map.insert("model".to_owned(), motor.name().to_string());
                map.insert("on".to_owned(), motor.on.to_string());
            }
            let (name, schema) = (topic.schema_name(), topic.schema());
            channels.push(file.channel(&name, &schema, &topic.name, &map)?);
        }
        let (before, last) = (Micros::ZERO, Micros::ZERO);
        Ok(Self {
            file,
            topics: topics.to_vec(),
            channels,
            first: None,
            before,
            last,
            shift: Micros::ZERO,
            samples: 0,
        })
    }

    /// Writes a sample. Those of signals that belong to no topic are left out.
    ///
    /// # Errors
    /// If the file cannot be written.
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
        let Self { file, topics, channels, samples, .. } = self;
        messages(topics, sample, |topic, bytes| {
            *samples += 1;
            file.put_bytes(channels[topic], at, bytes)
        })
    }

    /// The time that it covers.
    #[must_use]
    pub fn length(&self) -> Micros {
        self.last
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> Result<()> {
        let length = self.length().get().to_string();
        self.file.finish(BTreeMap::from([("length_us".to_owned(), length)]))
    }
}
