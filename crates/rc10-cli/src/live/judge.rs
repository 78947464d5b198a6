//! Problems of a robot that runs: those that a report of its last minute would have.

use std::collections::{BTreeSet, VecDeque};

use anyhow::Result;
use rc10_can::Micros;

use super::client::Sample;
use super::plan::{Topic, messages};
use super::record::RESTART;
use crate::happened::happened;
use crate::problems::{Problem, problems};
use crate::record::{Kit, Replay};
use crate::recording::Source;

/// Recordings overlap: the older of two covers this time at least, and less than twice as much.
const SPAN: Micros = Micros::from_millis(30_000);
/// A recording that is shorter is not judged: not everything has been told once.
const LEAST: Micros = Micros::from_millis(1000);
/// From one judgement to the next.
const OFTEN: Micros = Micros::from_millis(1000);

/// Judges a robot while it runs.
pub struct Judge<'k> {
    kit: &'k Kit<'k>,
    /// The oldest first, with the robot's time at which it began.
    recordings: VecDeque<(Micros, Replay<'k>)>,
    before: Micros,
    judged: Option<Micros>,
    /// What was found last.
    pub found: Vec<Problem>,
    /// What happened meanwhile, in the robot's time.
    pub happened: Vec<(Micros, String)>,
}

impl<'k> Judge<'k> {
    /// One that has heard nothing.
    #[must_use]
    pub const fn new(kit: &'k Kit<'k>) -> Self {
        Self {
            kit,
            recordings: VecDeque::new(),
            before: Micros::ZERO,
            judged: None,
            found: Vec::new(),
            happened: Vec::new(),
        }
    }

    /// Why the robot that describes itself so is none that this program can judge; `None` if it is its own.
    #[must_use]
    pub fn stranger(&self, topics: &[Topic]) -> Option<String> {
        let theirs = topics.iter().filter(|topic| topic.folder == "motors");
        let theirs: BTreeSet<&str> = theirs.map(|topic| topic.label.as_str()).collect();
        let own = self.kit.description().motors.iter().map(|motor| motor.label).collect();
        let mut foreign = theirs.difference(&own);
        let mut missing = own.difference(&theirs);
        let what = match (foreign.next(), missing.next()) {
            (Some(label), _) => {
                format!("it has a motor `{label}`, which this program does not have")
            }
            (None, Some(label)) => format!("it has no motor `{label}`, which this program has"),
            (None, None) => return None,
        };
        Some(format!("another robot is heard, and its problems are not looked for: {what}"))
    }

    /// Takes a sample.
    ///
    /// # Errors
    /// If the robot cannot be simulated.
    pub fn take(&mut self, topics: &[Topic], sample: &Sample) -> Result<()> {
        if sample.at + RESTART < self.before || sample.at.since(self.before) >= SPAN {
            // The robot counts anew, or was unheard: what was is no more.
            *self = Self::new(self.kit);
        }
        self.before = sample.at;
        if self.recordings.back().is_none_or(|(begun, _)| sample.at.since(*begun) >= SPAN) {
            let mut replay = Replay::new(self.kit, 1, Source::Robot)?;
            for (id, topic) in (0..).zip(topics) {
                replay.channel(id, &topic.name, topic.columns());
            }
            self.recordings.push_back((sample.at, replay));
            if self.recordings.len() > 2 {
                self.recordings.pop_front();
            }
        }
        messages(topics, sample, |topic, bytes| {
            self.recordings.iter_mut().try_for_each(|(begun, replay)| {
                replay.take(topic as u16, sample.at.since(*begun), bytes)
            })
        })?;
        let is_due = self.judged.is_none_or(|judged| self.before.since(judged) >= OFTEN);
        match self.recordings.front() {
            Some((begun, replay)) if is_due && self.before.since(*begun) >= LEAST => {
                let recording = replay.clone().finish()?;
                let happened = happened(&recording).into_iter();
                let told = |(at, what)| (*begun + recording.told(at), what);
                self.happened = happened.map(told).collect();
                self.found = problems(&recording);
                self.judged = Some(self.before);
            }
            _ => {}
        }
        Ok(())
    }
}
