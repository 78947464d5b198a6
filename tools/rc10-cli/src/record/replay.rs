//! Reads a record: `rc10 report` and `rc10 csv`.

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::iter::zip;
use std::rc::Rc;

use anyhow::{Context, Result, bail, ensure};
use rc10_module::Counters;
use rc10_motor::embassy::Rs485Status;
use rc10_motor::rc10_app::mechanism::Stage;
use rc10_motor::{Fault as MotorFault, Loops};
use rc10_time::Micros;

use super::fields::{Named, Single};
use super::file::{Channel, Item, label, walk};
use super::{About, CDR, END, EVENTS, LAYOUT, VERSION, topic, topics};
use crate::record::recorder::Recorder;
use crate::recording::look::{BusLook, Moment, MotorLook, Shaft};
use crate::recording::margin::Margins;
use crate::recording::origin::Origin;
use crate::recording::problem::Problem;
use crate::recording::remote::Loss;
use crate::recording::sample::{SAMPLE_PERIOD, Source, WireEnd};
use crate::recording::{Gap, Recording, problem};
use crate::robot::description::Description;
use crate::robot::remote::{Lost, Receiver};
use crate::robot::signal::Signal;
use crate::world::environment::Environment;
use crate::world::ports::Ports;
use crate::world::robot::Robot;

/// The numbers of a message; fewer if it is too short.
pub(crate) fn numbers(bytes: &[u8]) -> Result<impl Iterator<Item = f64>> {
    let body = bytes.strip_prefix(&CDR).context("a message is not little-endian CDR")?;
    ensure!(body.len().is_multiple_of(8), "a message of {} bytes", bytes.len());
    let (words, _) = body.as_chunks::<8>();
    Ok(words.iter().map(|word| f64::from_le_bytes(*word)))
}

/// A counter of a robot, counted from the begin of the record on.
#[derive(Clone, Copy, Default)]
struct Count {
    /// Value at the begin, or at the restart.
    first: Option<f64>,
    last: f64,
    /// Sum of its overflows.
    turned: f64,
    /// Count up to the last restart.
    before: f64,
}

/// Value at which a robot's counters begin again: their steps stay whole in 32 bits.
const TURN: f64 = (1 << 24) as f64;
/// Largest count from one sample to the next.
const NEAR: f64 = 65_536.0;

impl Count {
    fn since_begin(&mut self, value: f64) -> f64 {
        let mut first = *self.first.get_or_insert(value);
        // An overflow, as it is within one sample's count of the end.
        if self.last > TURN - NEAR && value < NEAR {
            self.turned += TURN;
        } else if value < self.last {
            // A restart; counts from there to now were not recorded, and are left out.
            self.before += self.turned + self.last - first;
            (first, self.first, self.turned) = (value, Some(value), 0.0);
        }
        self.last = value;
        self.before + self.turned + value - first
    }

    /// Leaves out what it counts until it is heard again.
    fn pause(&mut self) {
        if let Some(first) = self.first.take() {
            self.before += self.turned + self.last - first;
            (self.turned, self.last) = (0.0, 0.0);
        }
    }
}

/// Pause from which on a time counts as not recorded.
const GAP: Micros = Micros::from_millis(5000);
/// Limit of a recording, which takes half a gigabyte of memory an hour or more.
const LONGEST: Micros = Micros::from_millis(4 * 3_600_000);

/// A loss without effects, for one that is told.
const NO_LOSS: Loss = Loss::new(Lost { from: Micros::ZERO, until: None });

/// Makes the recording of a record of `robot`, as its run did; and why the file ends early, if so.
/// Fails if the file is no record, one of another robot, or of an unknown layout.
pub fn replay(
    file: &mut (impl Read + Seek),
    mut robot: Robot<'_>,
) -> Result<(Recording, Option<String>)> {
    replay_of(file, &mut robot, true)
}

/// The same; a record that need not be the robot's own is read as far as its topics are those of this one, for
/// comparison. Fails as [`replay`] does.
pub(crate) fn replay_of(
    file: &mut (impl Read + Seek),
    robot: &mut Robot<'_>,
    is_own: bool,
) -> Result<(Recording, Option<String>)> {
    // The metadata come first, but for those of the end.
    let mut heading = None;
    let mut end = BTreeMap::new();
    let mut found = BTreeMap::new();
    walk(file, |item| {
        match item {
            Item::Metadata(name, map) if name == LAYOUT => heading = Some(map),
            Item::Metadata(name, map) if name == END => end = map,
            Item::Channel(_, channel) => drop(found.insert(channel.topic, channel.map)),
            _ => {}
        }
        Ok(())
    })?;
    let heading = heading.context("it is no record of a robot: it has no `rc10` metadata")?;
    let text = |key: &str| heading.get(key).map_or("", String::as_str);
    let version = text("version");
    ensure!(
        version == VERSION,
        "its layout has version {version}, and this rc10 reads version {VERSION}"
    );
    let seed = text("seed").parse().context("its seed is no number")?;
    if is_own {
        prepare(robot, &text)?;
        is_of(robot, &found)?;
    }

    let source = match (text("source"), text("emulated")) {
        ("robot", _) => Source::Robot,
        (_, "true") => Source::Emulation,
        _ => Source::Simulation,
    };
    let kit = Kit::of(robot);
    let mut state = Replay::new(&kit, seed, source)?;
    for (number, wire) in (1..).zip(&mut state.wires) {
        wire.log_hash = end.get(&format!("log_hash_{number}")).cloned().unwrap_or_default();
    }
    for (number, fault) in (1..).zip(&mut state.faults) {
        if let Some(text) = end.get(&format!("fault_{number}")) {
            // One for each motor in a fault, for the life of the program.
            *fault = String::leak(text.clone());
        }
    }
    let (mut events, mut marks) = (None, Vec::new());
    let cut = walk(file, |item| match item {
        Item::Channel(id, Channel { topic, columns, .. }) => {
            events = if topic == EVENTS { Some(id) } else { events };
            state.channel(id, &topic, columns.unwrap_or_default());
            Ok(())
        }
        Item::Message(id, _, bytes) if source == Source::Robot && Some(id) == events => {
            marks.push((state.at, label(bytes)));
            Ok(())
        }
        Item::Message(id, time, bytes) => state.take(id, Micros::new(time / 1000), bytes),
        Item::Metadata(..) => Ok(()),
    })?;
    let cut =
        cut.or_else(|| state.is_full.then(|| "a report is made of four hours at most".into()));
    let mut recording = state.finish()?;
    recording.faults.clone_from(&kit.description.faults);
    recording.mistakes = text("mistakes").lines().map(str::to_owned).collect();
    recording.origin = Origin::read(&text);
    for track in &mut recording.motors {
        let told = end.get(&format!("margin {}", track.motor.label));
        let told = told.and_then(|it| it.split_once(' '));
        let told = told.and_then(|(speed, angle)| Some((speed.parse().ok()?, angle.parse().ok()?)));
        if let (Some((speed, angle)), Some(effort)) = (told, &mut track.effort) {
            effort.margins = Some(Margins { speed, angle, phases: None });
        }
    }
    recording.no_logs = true;
    recording.marks = marks;
    recording.about =
        ["name", "note"].map(|key| end.get(key).or(heading.get(key)).cloned().unwrap_or_default());
    let cut = cut.or_else(|| end.is_empty().then(|| "its end is missing".into()));
    Ok((recording, cut))
}

/// Sets a robot up as that of the record was.
fn prepare<'t>(robot: &mut Robot<'_>, text: &impl Fn(&str) -> &'t str) -> Result<()> {
    if let Some(receiver) = Receiver::ALL.into_iter().find(|one| one.name() == text("receiver")) {
        robot.set_remote(receiver)?;
    }
    let faults: Result<Vec<_>, _> = text("faults").lines().map(str::parse).collect();
    robot.set_faults(&faults.context("its faults")?)?;
    let mistakes: Result<Vec<_>, _> = text("mistakes").lines().map(str::parse).collect();
    robot.set_mistakes(&mistakes.context("its mistakes")?)
}

/// Whether a record's topics are those of a robot; the error says what is not.
pub(crate) fn is_of(
    robot: &Robot<'_>,
    found: &BTreeMap<String, BTreeMap<String, String>>,
) -> Result<()> {
    let own = &robot.description().motors;
    for motor in own {
        let Some(map) = found.get(&topic("motors", motor.label)) else {
            bail!("it is of another robot: it has no motor `{}`", motor.label);
        };
        for (key, own) in [("model", motor.name().to_string()), ("on", motor.on.to_string())] {
            let theirs = map.get(key).map_or("", String::as_str);
            let label = motor.label;
            ensure!(
                theirs == own,
                "it is of another robot: its `{label}` is {theirs}, and this robot's is {own}"
            );
        }
    }
    let is_motor =
        |topic: &&String| topic.matches('/').count() == 2 && topic.starts_with("/motors/");
    let known = |name: &String| own.iter().any(|motor| topic("motors", motor.label) == **name);
    match found.keys().filter(is_motor).find(|name| !known(name)) {
        Some(name) => bail!("it is of another robot: this one has no motor {name}"),
        None => Ok(()),
    }
}

#[derive(Clone)]
struct Messages {
    /// The subject, if it is known.
    about: Option<About>,
    columns: Rc<[String]>,
    /// A counter for each column, for those of a real robot that count since power-on.
    counts: Vec<Count>,
}

/// The robot by which records are judged.
pub struct Kit<'r> {
    description: Description,
    loops: Vec<Option<Loops>>,
    signals: Vec<Signal<'r>>,
    /// Label of the signal that is its heading.
    heading: Option<&'static str>,
}

impl<'r> Kit<'r> {
    /// The kit of this robot.
    pub fn of(robot: &Robot<'r>) -> Self {
        let Ports { signals, yaw, .. } = robot.ports();
        let (description, loops) = (robot.description().clone(), robot.loops());
        Self { description, loops, signals, heading: yaw.map(|(label, _)| label) }
    }

    /// Description of the robot.
    pub const fn description(&self) -> &Description {
        &self.description
    }

    /// Loops of the motors, in the order of the description; `None` where they run in the device.
    pub fn loops(&self) -> &[Option<Loops>] {
        &self.loops
    }
}

/// A recording in the making, from the messages of a record or of a robot that runs.
#[derive(Clone)]
pub struct Replay<'d> {
    recorder: Recorder<'d>,
    /// The subjects of the topics that are read.
    names: BTreeMap<String, About>,
    channels: BTreeMap<u16, Messages>,
    /// Time of the recording, and of the messages: gaps are left out of the first.
    at: Micros,
    told_at: Micros,
    gaps: Vec<Gap>,
    /// Whether it has its longest length.
    is_full: bool,
    /// Whether a real robot told it: seldom, and not at the times of a run.
    is_robot: bool,
    /// Index of the signal that is the heading of a real robot.
    heading: Option<usize>,
    /// Next sample of a real robot, and whether its motors, and all else, have been told.
    next_sample: Micros,
    has_told: [bool; 2],
    looks: Vec<MotorLook>,
    has_looks: bool,
    signals: Vec<Option<f64>>,
    has_signals: bool,
    /// Which own signals the record or the robot declares.
    declares: Vec<bool>,
    moment: Moment,
    has_moment: bool,
    wires: Vec<WireEnd>,
    losses: Vec<Loss>,
    /// The newest message of one number, and of a loss.
    single: Single,
    loss: Loss,
    faults: Vec<&'static str>,
}

impl<'d> Replay<'d> {
    /// Creates a replay before its first message; fails if the robot cannot be simulated.
    pub fn new(kit: &'d Kit<'_>, seed: u64, source: Source) -> Result<Self> {
        let Kit { description, loops, signals, heading } = kit;
        let around = Environment::new(description, seed)?;
        // An emulated chip's memory is not looked into.
        let own = if source.is_told() { signals } else { &[][..] };
        let topics = topics(description, own)?.into_iter();
        let names = topics.map(|(name, (about, _))| (name, about));
        let names = names.filter(|(_, it)| ![About::Event, About::Inputs].contains(it)).collect();
        Ok(Self {
            recorder: Recorder::new(description, seed, loops, &around.motors, source)
                .with_own(own, source.is_told() && heading.is_some()),
            names,
            channels: BTreeMap::new(),
            at: Micros::ZERO,
            told_at: Micros::ZERO,
            gaps: Vec::new(),
            is_full: false,
            is_robot: source == Source::Robot,
            heading: own.iter().position(|signal| Some(signal.label) == *heading),
            next_sample: Micros::ZERO,
            has_told: [false; 2],
            looks: vec![MotorLook::NEW; description.motors.len()],
            has_looks: false,
            signals: vec![None; own.len()],
            has_signals: false,
            declares: vec![false; own.len()],
            moment: Moment {
                buses: vec![BusLook::default(); description.buses.into()],
                lines: vec![Rs485Status::default(); description.lines.len()],
                ..Moment::default()
            },
            has_moment: false,
            wires: vec![WireEnd::default(); description.buses.into()],
            losses: Vec::new(),
            single: Single::default(),
            loss: NO_LOSS,
            faults: vec![""; description.motors.len()],
        })
    }

    /// Declares a channel: messages of this number have this topic and these numbers.
    pub fn channel(&mut self, id: u16, topic: &str, columns: Vec<String>) {
        let about = self.names.get(topic).copied();
        if let Some(About::Signal(at)) = about {
            self.declares[at] = true;
        }
        let counts = vec![Count::default(); columns.len()];
        self.channels.insert(id, Messages { about, columns: columns.into(), counts });
    }

    /// Ends the recording; no error is possible so far, for no record is written.
    pub fn finish(mut self) -> Result<Recording> {
        self.flush()?;
        let Self { recorder, at, wires, losses, gaps, declares, heading, is_robot, .. } = self;
        let mut recording = Recording { gaps, ..recorder.finish_with(at, wires, losses)? };
        // A robot's firmware may be older than this program.
        let untold = zip(0.., &declares).filter(|(_, declares)| is_robot && !**declares);
        for (signal, track) in untold.filter_map(|(at, _)| Some((at, recording.signals.get(at)?))) {
            let is_heading = heading == Some(signal);
            if !is_heading && track.states != Stage::NAMES {
                continue;
            }
            let about = problem::About::Part(track.label);
            let text =
                "not known: the program on the robot does not tell it; is it older than this one?";
            recording.found.push(Problem::information(about, "not-told", text.to_owned()));
            if is_heading {
                recording.headings.clear();
            }
        }
        Ok(recording)
    }

    /// Advances to the time of a message, and leaves gaps out.
    fn go_on(&mut self, told: Micros) -> Result<()> {
        let (forth, back) = (told.since(self.told_at), self.told_at.since(told));
        self.told_at = told;
        if forth <= GAP && back <= GAP {
            let at = self.at + forth - back;
            if at != self.at {
                self.flush()?;
                (self.at, self.is_full) = (at, at > LONGEST);
            }
            return Ok(());
        }
        self.flush()?;
        self.gaps.push(Gap { at: self.at, length: forth.max(back), is_back: back > forth });
        self.at += SAMPLE_PERIOD;
        let counts = self.channels.values_mut().flat_map(|channel| &mut channel.counts);
        counts.for_each(Count::pause);
        Ok(())
    }

    /// Takes a message; fails if its channel is unknown, or it does not consist of numbers.
    pub fn take(&mut self, id: u16, now: Micros, bytes: &[u8]) -> Result<()> {
        let about = self.channels.get(&id).map(|channel| channel.about);
        let about = about.context("a message of a channel that is not declared")?;
        let Some(about) = about.filter(|_| !self.is_full) else { return Ok(()) };
        // Some were written at the end, and belong to no moment.
        if !matches!(about, About::Window(_) | About::Loss) {
            self.go_on(now)?;
        }
        let Some(mut channel) = self.channels.remove(&id) else { return Ok(()) };
        (self.single, self.loss) = (Single { value: f64::NAN }, NO_LOSS);
        let is_robot = self.is_robot;
        let it = self.subject(about);
        let named = channel.columns.iter().zip(&mut channel.counts);
        for ((name, count), mut value) in named.zip(numbers(bytes)?) {
            if is_robot && value.is_finite() && it.counts(name) {
                value = count.since_begin(value);
            }
            it.put_named(name, value);
        }
        self.channels.insert(id, channel);
        match about {
            About::Window(at) => self.wires[at].load_windows.push(self.single.value),
            About::Loss => self.losses.push(self.loss),
            About::Motor(at) | About::Health(at) => {
                let is_often = matches!(about, About::Motor(_));
                *(if is_often { &mut self.has_looks } else { &mut self.has_moment }) = true;
                let fault = &mut self.looks[at].status.fault;
                *fault = fault.map(|fault| MotorFault::new(fault.code, self.faults[at]));
            }
            About::Shaft(_) => {}
            About::Signal(at) => {
                self.has_signals = true;
                self.signals[at] = Some(self.single.value).filter(|value| !value.is_nan());
                if self.is_robot && self.heading == Some(at) {
                    self.moment.robot.yaw = self.signals[at];
                }
            }
            _ => self.has_moment = true,
        }
        Ok(())
    }

    /// The place for the numbers of a message.
    fn subject(&mut self, about: About) -> &mut dyn Named {
        let Moment { robot, buses, lines, parts, remote } = &mut self.moment;
        match about {
            About::Motor(at) | About::Health(at) => &mut self.looks[at],
            About::Shaft(at) => &mut self.looks[at].shaft,
            About::Bus(at) => &mut buses[at].status,
            About::Wire(at) => &mut buses[at],
            About::Line(at) => &mut lines[at],
            About::Part(at) => {
                parts.resize(parts.len().max(at + 1), Counters::default());
                &mut parts[at]
            }
            About::Robot => &mut robot.whole,
            About::Pose => robot,
            About::Remote => remote.get_or_insert_default(),
            About::Loss => &mut self.loss,
            About::Window(_) | About::Signal(_) | About::Event | About::Inputs => &mut self.single,
        }
    }

    /// Gives the recorder the moment that is complete.
    fn flush(&mut self) -> Result<()> {
        if self.is_robot {
            return self.flush_robot();
        }
        if std::mem::take(&mut self.has_signals) {
            self.recorder.signals(self.at, &self.signals)?;
        }
        if std::mem::take(&mut self.has_looks) {
            self.recorder.take_look(self.at, &self.looks)?;
        }
        if std::mem::take(&mut self.has_moment) {
            self.recorder.take_sample(self.at, self.moment.clone())?;
        }
        Ok(())
    }
}

impl Replay<'_> {
    /// Gives the recorder a real robot's moments, in samples at the times of a run.
    fn flush_robot(&mut self) -> Result<()> {
        if !(self.has_signals || self.has_looks || self.has_moment) {
            return Ok(());
        }
        // There is no look before everything was told once.
        self.has_told = [self.has_told[0] || self.has_looks, self.has_told[1] || self.has_moment];
        (self.has_signals, self.has_looks, self.has_moment) = (false, false, false);
        if self.has_told != [true; 2] {
            return Ok(());
        }
        let told = |it: &MotorLook| MotorLook { shaft: Shaft::told(&it.status.feedback), ..*it };
        let looks: Vec<_> = self.looks.iter().map(told).collect();
        self.recorder.signals(self.at, &self.signals)?;
        self.recorder.take_look(self.at, &looks)?;
        while self.next_sample <= self.at {
            // Values that were not told stay as they were.
            self.recorder.take_look(self.next_sample, &looks)?;
            self.recorder.take_sample(self.next_sample, self.moment.clone())?;
            self.next_sample += SAMPLE_PERIOD;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_motor::DriveMode;
    use rc10_motor::TargetKind;

    #[test]
    fn counters_count_from_the_begin_of_a_record() {
        let mut count = Count::default();
        let counted = |count: &mut Count, values: &[f64]| -> Vec<f64> {
            values.iter().map(|value| count.since_begin(*value)).collect()
        };
        assert_eq!(counted(&mut count, &[5000.0, 5000.0, 5010.0]), [0.0, 0.0, 10.0]);
        // Restarted, and heard again when it had counted 300.
        assert_eq!(counted(&mut count, &[300.0, 350.0]), [10.0, 60.0]);
        // Over its end, and restarted once more.
        let mut count = Count::default();
        let near = TURN - 10.0;
        assert_eq!(
            counted(&mut count, &[near, 5.0, 20.0, 3.0, 4.0]),
            [0.0, 15.0, 30.0, 30.0, 31.0]
        );
        // Not heard for a while: what it counted meanwhile is left out.
        let mut count = Count::default();
        assert_eq!(counted(&mut count, &[100.0, 110.0]), [0.0, 10.0]);
        count.pause();
        count.pause();
        assert_eq!(counted(&mut count, &[36_000_110.0, 36_000_111.0]), [10.0, 11.0]);
    }

    /// The recording of what the team's robot tells of a motor and of itself: the names of the motor's
    /// numbers, then its numbers, or none for the robot, by milliseconds.
    fn recorded(names: &[&str], told: &[(u64, Option<&[f64]>)]) -> Recording {
        let ports = team::Ports::new();
        let (shared, mut motors) = (team::Shared::new(&ports), team::Motors::new());
        let buses = motors.start(&shared.switch).unwrap().buses;
        let kit = Kit::of(&crate::tests::robot(&shared, buses));
        let mut replay = Replay::new(&kit, 1, Source::Robot).unwrap();
        let names = names.iter().map(|name| (*name).to_owned());
        replay.channel(0, "/motors/wheel_front_left", names.collect());
        replay.channel(1, "/robot", vec!["arm".to_owned()]);
        let mut bytes = Vec::new();
        for (at, values) in told {
            let values = values.unwrap_or(&[1.0]).iter().copied();
            super::super::pack(values, &mut bytes);
            let id = u16::from(told.iter().any(|it| it.0 == *at && it.1.is_none()));
            replay.take(id, Micros::from_millis(*at), &bytes).unwrap();
        }
        replay.finish().unwrap()
    }

    #[test]
    fn figures_begin_when_all_was_told() {
        let told = [f64::from(TargetKind::Speed as u8), 100.0];
        let names = ["target_kind", "measured"];
        let run = recorded(&names, &[(0, None), (300, Some(&told)), (350, None)]);
        let samples = &run.motors[0].samples;
        let measured: Vec<f32> = samples.iter().map(|sample| sample.measured_cell.mean).collect();
        assert!(!measured.is_empty() && measured.iter().all(|it| (it - 100.0).abs() < 1e-9));
    }

    #[test]
    fn a_target_that_is_not_followed_counts_nowhere() {
        let names = ["target_kind", "target", "measured", "drive"];
        for (kind, drive, follows) in [
            (TargetKind::Speed, DriveMode::Run, true),
            (TargetKind::Speed, DriveMode::Coast, false),
            (TargetKind::Angle, DriveMode::Hold, false),
            (TargetKind::Current, DriveMode::Run, false),
        ] {
            let told = [f64::from(kind as u8), 100.0, 90.0, f64::from(drive as u8)];
            let run =
                recorded(&names, &[(0, Some(&told)), (5, None), (200, Some(&told)), (205, None)]);
            let track = &run.motors[0];
            let targets: Vec<_> = track.samples.iter().map(|sample| sample.target).collect();
            let wanted = follows.then_some(100.0);
            assert!(!targets.is_empty() && targets.iter().all(|it| *it == wanted), "{targets:?}");
            assert_eq!(track.tracking.len(), usize::from(follows), "{kind:?} {drive:?}");
        }
    }
}
