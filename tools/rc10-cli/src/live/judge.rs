//! Problems of a robot that runs: those that a report of its last minute would have.

use std::collections::{BTreeSet, VecDeque};

use anyhow::Result;
use rc10_motor::Loops;
use rc10_time::Micros;

use super::client::Sample;
use super::plan::{Topic, messages};
use super::record::RESTART;
use crate::judge::happened::happened;
use crate::judge::problems;
use crate::record::recorder::margins;
use crate::record::replay::{Kit, Replay};
use crate::recording::margin::{self, Margins};
use crate::recording::problem::Problem;
use crate::recording::sample::Source;
use crate::world::environment::Environment;

/// Recordings overlap: the older of two covers at least this time, and less than twice as much.
const SPAN: Micros = Micros::from_millis(30_000);
/// Shortest recording that is judged: before, not everything has arrived once.
const LEAST: Micros = Micros::from_millis(1000);
const OFTEN: Micros = Micros::from_millis(500);

/// The effect of a gain before the robot gets it.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// The loop that becomes worst.
    pub name: &'static str,
    /// Its gain margin, a factor.
    pub margin: f64,
    /// Its gain margin with the gains of now.
    pub before: f64,
    /// Its phase margin, degrees.
    pub phase: Option<f64>,
    /// The required margin.
    pub least: f64,
    /// The value to ask for instead: the nearest that has the required margin; `None` if this one has it, or none
    /// has.
    pub ask: Option<f32>,
    /// The effect in words: a sentence without its subject, the gain.
    pub text: String,
}

impl Advice {
    fn of(name: &'static str, [margin, before]: [f64; 2], ask: Option<f32>) -> Self {
        let what = match margin {
            _ if margin < 1.0 => ": it will shake",
            _ if margin < margin::LEAST => ": it may shake",
            _ => "",
        };
        let text = format!(
            "gain margin of its {name} loop {margin:.1}, should be at least {}{what}",
            margin::LEAST
        );
        Self { name, margin, before, phase: None, least: margin::LEAST, ask, text }
    }
}

fn change(loops: &mut Loops, name: &str, value: f32) {
    match name {
        "speed_kp" => loops.cascade.speed.kp = value,
        "angle_kp" => loops.cascade.angle.kp = value,
        _ => {}
    }
}

/// Steps of 5 % that are looked for another gain, either way: up to 50 times.
const TRIES: i32 = 80;

/// The value nearest to this one, with two digits, that is good.
fn nearest(value: f32, is_good: impl Fn(f32) -> bool) -> Option<f32> {
    let tidy = |value: f32| {
        let unit = 10_f32.powf(value.log10().floor() - 1.0);
        // Of the decimal text, so that it is the number that a person would type.
        format!("{:.6}", (value / unit).round() * unit).parse().unwrap_or(value)
    };
    let tries = (1..=TRIES).flat_map(|step| [-step, step]);
    tries.map(|step| tidy(value * 1.05_f32.powi(step))).find(|it| *it > 0.0 && is_good(*it))
}

/// Judges a robot while it runs.
pub struct Judge<'k> {
    pub(super) kit: &'k Kit<'k>,
    /// The oldest first, with the robot's time at which it began.
    recordings: VecDeque<(Micros, Replay<'k>)>,
    before: Micros,
    /// When it was judged last, in the robot's time; `None`: not yet.
    pub judged: Option<Micros>,
    /// The last findings.
    pub found: Vec<Problem>,
    /// Events, in the robot's time.
    pub happened: Vec<(Micros, String)>,
}

impl<'k> Judge<'k> {
    /// Creates a judge before its first sample.
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

    /// Why this program cannot judge a robot with these topics; `None` if it is its own.
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

    /// The effect on a motor's loops if the parameter `name` of the motor `label` gets this value;
    /// `now` are its parameters. `None` if no margin depends on it, or the load is not described.
    pub fn advise<'n>(
        &self,
        label: &str,
        (name, value): (&'n str, f32),
        now: impl IntoIterator<Item = (&'n str, f32)>,
    ) -> Option<Advice> {
        let description = self.kit.description();
        let line = description.motors.iter().position(|motor| motor.label == label)?;
        let mut loops = (*self.kit.loops().get(line)?)?;
        for (name, value) in now {
            change(&mut loops, name, value);
        }
        let around = Environment::new(description, 1).ok()?;
        let twin = around.motors.get(line)?;
        let of = |loops| margins(loops, line, twin, description.base.as_ref());
        let with = |value| {
            let mut loops = loops;
            change(&mut loops, name, value);
            of(loops)
        };
        let (before, after) = (of(loops)?, with(value)?);
        let is_speed = match name {
            "speed_kp" => after.speed <= after.angle,
            "angle_kp" => false,
            _ => return None,
        };
        // The speed loop's gain matters to both.
        let worst =
            |it: Margins| if name == "speed_kp" { it.speed.min(it.angle) } else { it.angle };
        let is_good = |value| with(value).is_some_and(|it| worst(it) >= margin::LEAST);
        let ask = if is_good(value) { None } else { nearest(value, is_good) };
        let advice = match is_speed {
            true => Advice::of("speed", [after.speed, before.speed], ask),
            false => Advice::of("angle", [after.angle, before.angle], ask),
        };
        let phase = after.phases.map(|[speed, angle]| if is_speed { speed } else { angle });
        Some(Advice { phase, ..advice })
    }

    /// Takes a sample; fails if the robot cannot be simulated.
    pub fn take(&mut self, topics: &[Topic], sample: &Sample) -> Result<()> {
        if sample.at + RESTART < self.before || sample.at.since(self.before) >= SPAN {
            // The robot counts anew, or was not heard: the old recordings end.
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
                let time = |at| *begun + recording.robot_time(at);
                self.happened = happened.map(|(at, what)| (time(at), what)).collect();
                self.found = problems(&recording);
                for span in self.found.iter_mut().filter_map(|it| it.span.as_mut()) {
                    *span = (time(span.0), time(span.1));
                }
                self.judged = Some(self.before);
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::ArmState;
    use rc10_tasks::Common;

    use super::*;
    use crate::live::client::Signal;
    use crate::record::topic;
    use crate::recording::problem::Severity;
    use crate::{Description, Robot};

    /// Hands over a judge of the team's robot, and topics with which that tells of its motors' links and
    /// of its arming.
    fn with_judge(test: impl FnOnce(&mut Judge<'_>, Vec<Topic>)) {
        let ports = team::Ports::new();
        let (shared, mut motors) = (team::Shared::new(&ports), team::Motors::new());
        let buses = motors.start(&shared.switch).unwrap().buses;
        let world = Description { yaw: Some("heading"), ..crate::tests::description() };
        let robot = Robot::on(world, buses, [], &shared);
        let crane = Common::<_, Crane>::new(&ports);
        let kit = Kit::of(&robot.live(&crane));
        let motors = kit.description().motors.iter().map(|motor| motor.label);
        let mut topics: Vec<_> = motors.map(|label| made("motors", label, 1, "link")).collect();
        let health = topics.iter().map(|it| Topic {
            name: format!("{}/health", it.name),
            ..made("motors", &it.label, 2, "lost")
        });
        topics.extend(health.collect::<Vec<_>>());
        topics.push(Topic { name: "/robot".into(), ..made("robot", "", 2, "arm") });
        for (index, topic) in (0..).zip(&mut topics) {
            topic.signals[0].0 = index;
        }
        test(&mut Judge::new(&kit), topics);
    }

    rc10_tasks::live! {
        /// The parts of a test robot that differ from the team's.
        struct Crane {
            mechanisms {
                crane: "crane";
            }
            signals {}
            parameters {}
        }
    }

    fn made(folder: &str, label: &str, group: usize, name: &str) -> Topic {
        let signal = Signal { name: name.into(), ..Signal::default() };
        let (label, folder, name) = (label.into(), folder.into(), topic(folder, label));
        Topic { name, label, folder, often: group == 1, group, signals: vec![(0, signal)] }
    }

    /// All motors are heard at this millisecond, and were lost this number of times.
    fn tell(judge: &mut Judge<'_>, topics: &[Topic], at: u64, lost: u8, arm: ArmState) {
        let value = |name: &str| match name {
            "link" => 1.0,
            "lost" => lost.into(),
            _ => f32::from(arm as u8),
        };
        for group in [1, 2] {
            let signals = topics.iter().filter(|it| it.group == group).map(|it| &it.signals[0]);
            let values = signals.map(|(index, it)| (*index, value(&it.name))).collect();
            judge.take(topics, &Sample { group, at: Micros::from_millis(at), values }).unwrap();
        }
    }

    fn was_lost(judge: &Judge<'_>) -> bool {
        judge.found.iter().any(|problem| problem.kind == "was-lost")
    }

    #[test]
    fn a_robot_that_was_restarted_begins_with_a_clean_sheet() {
        with_judge(|judge, topics| {
            for at in (0..5000).step_by(100) {
                tell(judge, &topics, at, u8::from(at > 2000), ArmState::Disarmed);
            }
            assert!(was_lost(judge));
            for at in (0..3000).step_by(100) {
                tell(judge, &topics, at, 0, ArmState::Disarmed);
                assert!(!was_lost(judge), "{at} ms");
            }
        });
    }

    #[test]
    fn what_was_found_is_not_forgotten_as_a_recording_begins() {
        with_judge(|judge, topics| {
            for at in (0..33_000).step_by(100) {
                tell(judge, &topics, at, u8::from(at >= 29_500), ArmState::Disarmed);
                assert_eq!(was_lost(judge), at >= 30_000, "{at} ms");
            }
        });
    }

    #[test]
    fn events_have_the_robot_s_time() {
        with_judge(|judge, topics| {
            for at in (7000..69_000).step_by(100) {
                let arm = if at < 40_000 { ArmState::Armed } else { ArmState::EStopped };
                tell(judge, &topics, at, 0, arm);
                if at >= 41_100 {
                    let stop = judge.happened.iter().find(|(_, what)| what == "emergency stop");
                    let told = stop.unwrap().0.get() / 1000;
                    assert!((39_900..=40_000).contains(&told), "at {at} ms: {told} ms");
                }
            }
        });
    }

    /// Its heading and its mechanism are told, are declared and not told, or are nothing that its program knows.
    #[test]
    fn what_an_older_program_does_not_tell_is_not_known_and_no_problem() {
        for (is_declared, is_told, expected) in [
            (false, false, &["crane not-told", "heading not-told"][..]),
            (true, false, &["robot no-heading"]),
            (true, true, &["crane never-began"]),
        ] {
            with_judge(|judge, mut topics| {
                for label in ["crane", "heading"].into_iter().filter(|_| is_declared) {
                    let index = topics.len() as u16;
                    topics.push(made("signals", label, 3, "value"));
                    topics.last_mut().unwrap().signals[0].0 = index;
                }
                for at in (0..5000).step_by(100) {
                    tell(judge, &topics, at, 0, ArmState::Armed);
                    if is_told {
                        let of = |it: &&Topic| it.folder == "signals";
                        let values = topics.iter().filter(of).map(|it| (it.signals[0].0, 0.0));
                        let (at, values) = (Micros::from_millis(at), values.collect());
                        judge.take(&topics, &Sample { group: 3, at, values }).unwrap();
                    }
                }
                let about = |it: &Problem| format!("{} {}", it.about, it.kind);
                let ours = ["not-told", "no-heading", "never-began", "gave-up"];
                let found = judge.found.iter().filter(|it| ours.contains(&it.kind));
                let mut found: Vec<_> = found.map(about).collect();
                found.sort();
                assert_eq!(found, expected);
                let told = judge.found.iter().filter(|it| it.kind == "not-told");
                told.for_each(|it| assert_eq!(it.severity, Severity::Information));
            });
        }
    }

    #[test]
    fn a_robot_with_other_motors_is_a_stranger() {
        with_judge(|judge, mut topics| {
            assert_eq!(judge.stranger(&topics), None);
            let is_feeder = |it: &Topic| it.folder == "motors" && it.label == "feeder";
            let own = topics.clone();
            topics.retain(|it| !is_feeder(it));
            let told = judge.stranger(&topics).unwrap();
            assert!(told.contains("it has no motor `feeder`, which this program has"), "{told}");
            topics = own;
            topics.push(made("motors", "crane", 1, "link"));
            let told = judge.stranger(&topics).unwrap();
            assert!(told.contains("a motor `crane`, which this program does not have"), "{told}");
        });
    }

    #[test]
    fn a_gain_is_judged_before_it_is_sent() {
        with_judge(|judge, _| {
            let label = "wheel front left";
            let cascade = judge.kit.loops()[0].unwrap().cascade;
            let (speed, angle) = (cascade.speed.kp, cascade.angle.kp);
            let advise = |name, value| judge.advise(label, (name, value), [("angle_kp", angle)]);
            for (name, value) in [("speed_kp", speed), ("angle_kp", angle)] {
                let good = advise(name, value).unwrap();
                assert!((11.0..12.0).contains(&good.margin) && good.margin > good.least);
                assert!(!good.text.contains("shake"), "{}", good.text);
            }
            let bad = advise("speed_kp", 100.0 * speed).unwrap();
            let text = "gain margin of its speed loop 0.2, should be at least 5: it will shake";
            assert_eq!(bad.text, text);
            // Both margins say the same: as a loop begins to oscillate they are 1 and 0.
            for times in [1.0, 3.0, 10.0, 30.0, 100.0] {
                let it = advise("speed_kp", times * speed).unwrap();
                let phase = it.phase.unwrap();
                assert_eq!(it.margin > 1.0, phase > 0.0, "{it:?}");
                assert!(times > 1.0 || (40.0..90.0).contains(&phase), "{it:?}");
            }
            // What to ask for has the margin, and two steps more have it not.
            let ask = bad.ask.unwrap();
            assert!(advise("speed_kp", ask).unwrap().margin >= bad.least, "{ask}");
            assert!(advise("speed_kp", 1.2 * ask).unwrap().margin < bad.least, "{ask}");
            assert!((23.0..24.0).contains(&bad.before) && bad.name == "speed", "{bad:?}");
            assert_eq!(advise("speed_kp", speed).unwrap().ask, None);
            assert!(advise("angle_kp", 4.0 * angle).unwrap().text.ends_with(": it may shake"));
            // Those that the robot has now, beside the one that is typed.
            let slow = judge.advise(label, ("angle_kp", angle), [("speed_kp", 0.1 * speed)]);
            let way = slow.unwrap().margin - advise("angle_kp", angle).unwrap().margin;
            assert!(way.abs() > 0.1, "{way}");
            // Of each motor by its own loops and what it moves.
            let description = judge.kit.description();
            let around = Environment::new(description, 1).unwrap();
            let mut different = BTreeSet::new();
            for (line, motor) in description.motors.iter().enumerate() {
                let Some(mut loops) = judge.kit.loops()[line] else { continue };
                let kp = 3.0 * loops.cascade.angle.kp;
                loops.cascade.angle.kp = kp;
                let twin = around.motors.get(line).unwrap();
                let margins = margins(loops, line, twin, description.base.as_ref());
                let advice = judge.advise(motor.label, ("angle_kp", kp), []);
                let told = advice.map(|it| it.margin.to_bits());
                assert_eq!(told, margins.map(|it| it.angle.to_bits()), "{}", motor.label);
                different.extend(told);
            }
            assert!(different.len() > 1, "{different:?}");
            assert_eq!(advise("speed_ki", 1e3), None);
            assert_eq!(judge.advise("crane", ("speed_kp", 1.0), []), None);
        });
    }
}
