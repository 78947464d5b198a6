//! The rates at which signals are watched: motors often, all else ten times a second.

use rc10_motor::MotorStatus;
use rc10_tasks::seen::Seen;
use std::collections::BTreeMap;

use anyhow::Result;
use rc10_link::frame::{AROUND, CARRIED, CARRIER_HEAD};
use rc10_link::samples::{HEAD, VALUES};
use rc10_link::{GROUPS, RIDES};

use super::client::{Client, Sample, Signal};
use crate::record::fields::{MOTOR, about, line};
use crate::record::{pack, topic};

/// Group of the signals that pages chose.
pub const CHOSEN: usize = 0;
/// First group for topics.
pub const FIRST: usize = 1;
/// Period of signals that are not watched often, ms.
pub const SLOW: u16 = 100;

/// A topic of a record: some signals about one thing, in one group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Name of the topic: `/motors/lift_left`.
    pub name: String,
    /// Label of the subject.
    pub label: String,
    /// Folder of the subject: "motors".
    pub folder: String,
    /// Whether it is watched often.
    pub often: bool,
    /// Group of its signals.
    pub group: usize,
    /// Signals by number, with their names.
    pub signals: Vec<(u16, Signal)>,
}

impl Topic {
    /// The `ros2msg` schema of the messages.
    pub fn schema(&self) -> String {
        let one = |(_, signal): &(u16, Signal)| {
            let states = signal.states.iter().map(String::as_str);
            line(&signal.name, about(&signal.folder, &signal.name), &signal.unit, states)
        };
        self.signals.iter().map(one).collect()
    }

    /// Name of the schema.
    pub fn schema_name(&self) -> String {
        format!("rc10/msg{}", self.name.replace('/', "_"))
    }

    /// Names of the numbers in a message.
    pub fn columns(&self) -> Vec<String> {
        self.signals.iter().map(|(_, signal)| signal.name.clone()).collect()
    }
}

/// Passes the message of each topic of a sample to `take`, with the topic's index, and NaN for
/// missing values; fails if `take` does.
pub fn messages(
    topics: &[Topic],
    sample: &Sample,
    take: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    pass(topics, sample, |topic, _| topic.group == sample.group, take)
}

/// The same of signals that pages chose: each topic that has one of them.
pub fn chosen_messages(
    topics: &[Topic],
    sample: &Sample,
    take: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    let has_one = |topic: &Topic, known: &BTreeMap<u16, f32>| {
        topic.signals.iter().any(|(index, _)| known.contains_key(index))
    };
    pass(topics, sample, |topic, known| sample.group == CHOSEN && has_one(topic, known), take)
}

fn pass(
    topics: &[Topic],
    sample: &Sample,
    is_there: impl Fn(&Topic, &BTreeMap<u16, f32>) -> bool,
    mut take: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    let known: BTreeMap<u16, f32> = sample.values.iter().copied().collect();
    let mut bytes = Vec::new();
    for (at, topic) in topics.iter().enumerate().filter(|(_, it)| is_there(it, &known)) {
        let value = |(index, _): &(u16, _)| known.get(index).map_or(f64::NAN, |it| (*it).into());
        pack(topic.signals.iter().map(value), &mut bytes);
        take(at, &bytes)?;
    }
    Ok(())
}

/// The topics of a robot, and the signals without room.
pub fn plan(client: &Client) -> (Vec<Topic>, Vec<Signal>) {
    plan_of(client.signals())
}

fn plan_of<'s>(signals: impl Iterator<Item = (u16, &'s Signal)>) -> (Vec<Topic>, Vec<Signal>) {
    let often = &MotorStatus::FIELDS[MOTOR];
    let mut topics: BTreeMap<(bool, String), Topic> = BTreeMap::new();
    for (index, signal) in signals {
        let is_motor = signal.folder == "motors";
        let is_often = if is_motor {
            often.iter().any(|it| it.name == signal.name)
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

/// Watches topics, the frequent ones every `period` ms.
pub fn watch(client: &mut Client, topics: &[Topic], period: u16) {
    watch_at(client, topics, [period, SLOW]);
}

/// Watches topics, the frequent ones and the others at these periods, ms.
pub fn watch_at(client: &mut Client, topics: &[Topic], [frequent, other]: [u16; 2]) {
    for group in FIRST..GROUPS {
        let of_group = || topics.iter().filter(|topic| topic.group == group);
        let often = of_group().any(|topic| topic.often);
        let signals = of_group().flat_map(|topic| topic.signals.iter().map(|(index, _)| *index));
        client.watch(group, if often { frequent } else { other }, signals);
    }
}

/// What a line carries while signals of the first group are watched, and all else rides on their samples.
#[derive(Clone, Debug)]
pub struct Line {
    /// Bytes in a millisecond: a little less than the bit rate says, for the pauses between frames.
    pub bytes: u16,
    /// Bytes of a sample of all frequent topics, and of all others.
    rest: [f64; 2],
}

/// Bytes in a millisecond that are kept for greetings and answers.
const ANSWERS: f64 = 1.0;
/// Bytes in a millisecond that ride at least: the longest frame takes 130 ms then.
const RIDE: f64 = 8.0;
/// Longest period of frequent topics beside chosen signals, ms.
const SLOWEST: u16 = 200;

impl Line {
    /// That of a bit rate, for a robot with these topics.
    pub fn new(baud: u32, topics: &[Topic]) -> Self {
        let bytes = u64::from(baud) * 97 / 1_000_000;
        let mut rest = [0.0; 2];
        for group in FIRST..GROUPS {
            let of_group = || topics.iter().filter(|topic| topic.group == group);
            let count: usize = of_group().map(|topic| topic.signals.len()).sum();
            if count > 0 {
                let place = usize::from(!of_group().any(|topic| topic.often));
                rest[place] += (AROUND + HEAD + 4 * count) as f64;
            }
        }
        Self { bytes: bytes.try_into().unwrap_or(u16::MAX), rest }
    }

    /// Periods of the frequent topics and of the others, ms, beside `signals` that are watched every `period` ms;
    /// `None` if the line does not carry that.
    pub fn beside(&self, signals: usize, period: u16) -> Option<[u16; 2]> {
        let own = AROUND + CARRIER_HEAD + HEAD + 4 * signals;
        let whole = (usize::from(self.bytes) * usize::from(period)).min(AROUND + CARRIED);
        let rides = whole.checked_sub(own)? as f64 / f64::from(period);
        if rides < RIDE || period == 0 || period > RIDES {
            return None;
        }
        [SLOW, SLOWEST].into_iter().find_map(|other| {
            let left = rides - ANSWERS - self.rest[1] / f64::from(other);
            let frequent = (self.rest[0] / left.max(0.1)).ceil();
            (frequent <= f64::from(other)).then_some([(frequent as u16).max(RIDES), other])
        })
    }

    /// The most signals that may be watched every `period` ms.
    pub fn most(&self, period: u16) -> usize {
        (1..CARRIED / 4).take_while(|count| self.beside(*count, period).is_some()).count()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The signals of a robot with this number of motors.
    fn signals(motors: usize) -> Vec<(u16, Signal)> {
        let one = |folder: &str, label: String, name: &str| Signal {
            folder: folder.into(),
            label,
            name: name.into(),
            ..Signal::default()
        };
        let of_motor = |at: usize| {
            let all = MotorStatus::FIELDS.iter();
            all.map(move |it| one("motors", format!("motor {at}"), it.name))
        };
        let own = (0..5).map(|at| one("signals", format!("own {at}"), "value"));
        let buses = (1..=3).map(|at| one("buses", at.to_string(), "ticks"));
        let all = (0..motors).flat_map(of_motor).chain(own).chain(buses);
        (0..).zip(all.chain([one("robot", String::new(), "arm")])).collect()
    }

    #[test]
    fn each_signal_is_in_one_group_of_its_pace_or_left() {
        for motors in [1, 5, 11, 20, 21, 25, 40, 90] {
            let all = signals(motors);
            let (planned, left) = plan_of(all.iter().map(|(index, it)| (*index, it)));
            let count: usize = planned.iter().map(|topic| topic.signals.len()).sum();
            assert_eq!(count + left.len(), all.len(), "{motors} motors");
            let numbers = planned.iter().flat_map(|it| it.signals.iter().map(|(index, _)| index));
            assert_eq!(numbers.collect::<BTreeSet<_>>().len(), count, "{motors} motors");
            assert_eq!(left.is_empty(), motors <= 21, "{motors} motors: {} left", left.len());
            for group in FIRST..GROUPS {
                let of_group = || planned.iter().filter(|topic| topic.group == group);
                let paces: BTreeSet<_> = of_group().map(|topic| topic.often).collect();
                assert!(paces.len() <= 1, "{motors} motors: group {group} has two paces");
                assert!(of_group().map(|topic| topic.signals.len()).sum::<usize>() <= VALUES);
            }
            assert!(planned.iter().all(|topic| (FIRST..GROUPS).contains(&topic.group)));
        }
    }

    #[test]
    fn motors_and_own_signals_are_watched_often() {
        let all = signals(2);
        let (planned, _) = plan_of(all.iter().map(|(index, it)| (*index, it)));
        let often = |name: &str| planned.iter().find(|topic| topic.name == name).unwrap().often;
        assert!(often("/motors/motor_0") && often("/signals/own_4"));
        assert!(!often("/motors/motor_0/health") && !often("/buses/1") && !often("/robot"));
    }
}
