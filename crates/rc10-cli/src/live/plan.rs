//! What of a robot is watched how often: its motors often, all else ten times a second.

use std::collections::BTreeMap;

use rc10_link::GROUPS;
use rc10_link::samples::VALUES;

use super::client::{Client, Signal};
use crate::record::fields::{MOTOR, names};
use crate::record::topic;

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
