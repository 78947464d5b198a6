//! What of a robot is watched how often: its motors often, all else ten times a second.

use std::collections::BTreeMap;

use anyhow::Result;
use rc10_link::GROUPS;
use rc10_link::samples::VALUES;

use super::client::{Client, Sample, Signal};
use crate::record::fields::{MOTOR, names};
use crate::record::{pack, topic};

/// A group of signals that a page or a record is made of. The first group is for what a page asks for
/// beside.
pub const FIRST: usize = 1;
/// From one sample of what is not watched often to the next, ms.
pub const SLOW: u16 = 100;

/// A topic of a record: some signals about one thing, in one group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name: `/motors/lift_left`.
    pub name: String,
    /// The label of the thing.
    pub label: String,
    /// Folder of the thing: "motors".
    pub folder: String,
    /// Whether it is watched often.
    pub often: bool,
    /// The group that it is in.
    pub group: usize,
    /// Its signals with their names, by number.
    pub signals: Vec<(u16, Signal)>,
}

impl Topic {
    /// What its messages are made of, as a `ros2msg` schema.
    #[must_use]
    pub fn schema(&self) -> String {
        let line = |(_, signal): &(u16, Signal)| {
            let mut about = vec![signal.unit.clone(), signal.states.join(", ")];
            about.retain(|text| !text.is_empty());
            format!("float64 {}  # {}\n", signal.name, about.join(", "))
        };
        self.signals.iter().map(line).collect()
    }

    /// The name of that schema.
    #[must_use]
    pub fn schema_name(&self) -> String {
        format!("rc10/msg{}", self.name.replace('/', "_"))
    }

    /// The names of its numbers.
    #[must_use]
    pub fn columns(&self) -> Vec<String> {
        self.signals.iter().map(|(_, signal)| signal.name.clone()).collect()
    }
}

/// Makes a message of each topic that a sample is of; NaN stands for what it does not have.
///
/// # Errors
/// Those of `take`, which gets the topic's place and its message.
pub fn messages(
    topics: &[Topic],
    sample: &Sample,
    mut take: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    let known: BTreeMap<u16, f32> = sample.values.iter().copied().collect();
    let mut bytes = Vec::new();
    for (at, topic) in topics.iter().enumerate().filter(|(_, it)| it.group == sample.group) {
        let value = |(index, _): &(u16, _)| known.get(index).map_or(f64::NAN, |it| (*it).into());
        pack(topic.signals.iter().map(value), &mut bytes);
        take(at, &bytes)?;
    }
    Ok(())
}

/// The topics of a robot, and the signals for which there is no room.
#[must_use]
pub fn plan(client: &Client) -> (Vec<Topic>, Vec<Signal>) {
    let often: Vec<_> = names(MOTOR).collect();
    let mut topics: BTreeMap<(bool, String), Topic> = BTreeMap::new();
    for (index, signal) in client.signals() {
        let is_motor = signal.folder == "motors";
        let is_often = if is_motor {
            often.contains(&signal.name.as_str())
        } else {
            signal.folder == "signals"
        };
        let mut name = match signal.label.as_str() {
            "" => format!("/{}", signal.folder),
            label => topic(&signal.folder, label),
        };
        if is_motor && !is_often {
            name += "/health";
        }
        let new = || Topic {
            name: name.clone(),
            label: signal.label.clone(),
            folder: signal.folder.clone(),
            often: is_often,
            group: 0,
            signals: Vec::new(),
        };
        let entry = topics.entry((!is_often, name.clone())).or_insert_with(new);
        entry.signals.push((index, signal.clone()));
    }
    let (mut group, mut room, mut before) = (FIRST, VALUES, true);
    let (mut planned, mut left) = (Vec::new(), Vec::new());
    for mut topic in topics.into_values() {
        if topic.signals.len() > room || topic.often != before {
            let is_used = room < VALUES;
            (group, room) = (group + usize::from(is_used), VALUES);
        }
        before = topic.often;
        if group >= GROUPS || topic.signals.len() > room {
            left.extend(topic.signals.into_iter().map(|(_, signal)| signal));
            continue;
        }
        room -= topic.signals.len();
        topic.group = group;
        planned.push(topic);
    }
    (planned, left)
}

/// Has a client watch topics: what is watched often every `period` ms.
pub fn watch(client: &mut Client, topics: &[Topic], period: u16) {
    for group in FIRST..GROUPS {
        let of_group = || topics.iter().filter(|topic| topic.group == group);
        let often = of_group().any(|topic| topic.often);
        let signals = of_group().flat_map(|topic| topic.signals.iter().map(|(index, _)| *index));
        client.watch(group, if often { period } else { SLOW }, signals);
    }
}
