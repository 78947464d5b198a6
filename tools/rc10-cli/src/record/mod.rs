//! Records: the looks at a robot in an [MCAP](https://mcap.dev) file, for any viewer of such files.
//!
//! Topics: `/motors/LABEL` every millisecond and `/motors/LABEL/health` every 10 ms for each motor;
//! one for each bus, line, part and signal; `/robot`, `/remote`, `/events`. Messages are those of
//! ROS 2: `ros2msg` schemas and CDR, all fields `float64`, NaN for a missing value. Times count
//! from power-on. [`fields`] has the fields; [`replay()`] makes a recording again.

pub mod fields;
pub(crate) mod file;
pub mod recorder;
pub mod replay;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use anyhow::{Context, Result, anyhow, bail, ensure};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, McapResult, WriteOptions, Writer};
use rc10_module::Counters;
use rc10_motor::Fault;
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_tasks::seen::{Seen, Whole};
use rc10_time::Micros;

use self::fields::{MOTOR, MOTOR_HEALTH, Single, schema};
use crate::recording::look::{BusLook, Moment, MotorLook, RemoteLook, RobotLook, Shaft};
use crate::recording::margin::Margins;
use crate::recording::origin::Origin;
use crate::recording::remote::Loss;
use crate::recording::sample::{Source, WireEnd};
use crate::robot::description::Description;
use crate::robot::script::Event;
use crate::robot::signal::Signal;

pub use crate::record::replay::{Kit, Replay, replay};

/// Name of the layout in the metadata, whose version readers check. New fields need no new version.
pub(crate) const LAYOUT: &str = "rc10";
pub(crate) const VERSION: &str = "2";
/// Name of the metadata at the end.
pub(crate) const END: &str = "rc10-end";

/// Bytes before the fields of a message: CDR, little endian.
pub(crate) const CDR: [u8; 4] = [0, 1, 0, 0];

/// The topic of what happens, and name and text of its schema.
pub(crate) const EVENTS: &str = "/events";
pub(crate) const EVENT: (&str, &str) = ("rc10/msg/Event", "string label\n");

/// The topic of what reached the ticks of its buses, and the schema: words of [`rc10_motor::record`].
pub(crate) const INPUTS: &str = "/inputs";

/// A message of a text.
pub(crate) fn text(label: &str) -> Vec<u8> {
    let mut bytes = CDR.to_vec();
    bytes.extend((label.len() as u32 + 1).to_le_bytes());
    bytes.extend(label.bytes().chain([0]));
    bytes
}

pub(crate) fn pack(values: impl Iterator<Item = f64>, bytes: &mut Vec<u8>) {
    bytes.clear();
    bytes.extend(CDR);
    values.for_each(|value| bytes.extend(value.to_le_bytes()));
}

/// Writes the looks at a run as a record.
pub struct RecordWriter {
    file: RecordFile,
    channels: BTreeMap<About, u16>,
    /// The bytes of the newest message.
    bytes: Vec<u8>,
}

/// A record that is being written. Its whole chunks stay in the file, whatever happens.
pub(crate) struct RecordFile {
    path: PathBuf,
    /// `None` after an error.
    writer: Option<Writer<BufWriter<Arc<File>>>>,
    file: Arc<File>,
    waiting: usize,
    /// Time of the newest message; time and file length at the last whole chunk.
    newest: Micros,
    whole: (Micros, u64),
    syncing: Option<JoinHandle<io::Result<()>>>,
    count: u32,
}

/// Size of a chunk in bytes: the loss of a run that is killed.
const CHUNK: usize = 256 * 1024;

impl RecordFile {
    /// Begins a record at `path` with the metadata `head`; an existing file is replaced only with
    /// `force`. Fails if the file cannot be written or exists.
    pub(crate) fn new(
        path: &Path,
        force: bool,
        mut head: BTreeMap<String, String>,
    ) -> Result<Self> {
        ensure!(!path.is_dir(), "cannot write {}: it is a folder", path.display());
        let mut options = File::options();
        options.write(true).create(force).truncate(force).create_new(!force);
        let file = options.open(path).with_context(|| match path.exists() && !force {
            true => format!("{} is there already: --force writes over it", path.display()),
            false => format!("cannot write {}", path.display()),
        })?;
        let file = Arc::new(file);
        let options = WriteOptions::new().compression(None).chunk_size(None).disable_seeking(true);
        let writer = options.profile("ros2").library("rc10");
        let cannot = || format!("cannot write {}", path.display());
        let writer = writer
            .create(BufWriter::with_capacity(CHUNK, Arc::clone(&file)))
            .with_context(cannot)?;
        let mut file = Self {
            path: path.into(),
            writer: Some(writer),
            file,
            waiting: 0,
            newest: Micros::ZERO,
            whole: (Micros::ZERO, 0),
            syncing: None,
            count: 0,
        };
        head.insert("version".to_owned(), VERSION.to_owned());
        file.write(|writer| writer.write_metadata(&metadata(LAYOUT, head)))?;
        file.flush()?;
        Ok(file)
    }

    pub(crate) fn channel(
        &mut self,
        name: &str,
        schema: &str,
        topic: &str,
        map: &BTreeMap<String, String>,
    ) -> Result<u16> {
        self.write(|writer| {
            let id = writer.add_schema(name, "ros2msg", schema.as_bytes())?;
            writer.add_channel(id, topic, "cdr", map)
        })
    }

    pub(crate) fn put_bytes(&mut self, channel_id: u16, now: Micros, bytes: &[u8]) -> Result<()> {
        self.count = self.count.wrapping_add(1);
        let time = now.get().saturating_mul(1000);
        let header =
            MessageHeader { channel_id, sequence: self.count, log_time: time, publish_time: time };
        self.write(|writer| writer.write_to_known_channel(&header, bytes))?;
        self.newest = self.newest.max(now);
        self.waiting += bytes.len();
        if self.waiting < CHUNK { Ok(()) } else { self.flush() }
    }

    fn write<T>(
        &mut self,
        write: impl FnOnce(&mut Writer<BufWriter<Arc<File>>>) -> McapResult<T>,
    ) -> Result<T> {
        let Some(writer) = &mut self.writer else {
            bail!("{}: it has ended", self.path.display());
        };
        write(writer).map_err(|error| self.keep(error))
    }

    fn flush(&mut self) -> Result<()> {
        self.waiting = 0;
        self.write(Writer::flush)?;
        // A file that is not on a disk has no length.
        self.whole = (self.newest, self.file.metadata().map_or(0, |file| file.len()));
        Ok(())
    }

    /// Starts a sync to the disk in the background, so that a power cut does not take the data.
    /// Fails if the record cannot be written, or the last sync failed.
    pub(crate) fn sync(&mut self) -> Result<()> {
        self.flush()?;
        if self.syncing.as_ref().is_some_and(|last| !last.is_finished()) {
            return Ok(());
        }
        if let Some(Ok(Err(error))) = self.syncing.take().map(JoinHandle::join) {
            return Err(self.keep(error.into()));
        }
        let file = Arc::clone(&self.file);
        self.syncing = thread::Builder::new().spawn(move || file.sync_data()).ok();
        Ok(())
    }

    /// Ends the record because of an error: whole chunks stay, half a chunk does not.
    fn keep(&mut self, error: McapError) -> anyhow::Error {
        self.writer = None;
        let (length, bytes) = self.whole;
        let _ = self.file.set_len(bytes);
        let why = match error {
            McapError::Io(error) if error.kind() == ErrorKind::StorageFull => {
                "the disk is full".into()
            }
            McapError::Io(error) => error.to_string(),
            error => error.to_string(),
        };
        anyhow!("{}; {why}", self.content(length))
    }

    fn content(&self, length: Micros) -> String {
        format!("{}: {} s are in it", self.path.display(), length.get() as f64 / 1e6)
    }

    /// Ends the record with the metadata `end`; `outcome` is that of the work before. Fails if the
    /// record cannot be written, or with the outcome's error.
    pub(crate) fn finish(
        mut self,
        outcome: Result<()>,
        end: BTreeMap<String, String>,
    ) -> Result<()> {
        if self.writer.is_none() {
            return outcome;
        }
        self.flush()?;
        self.write(|writer| writer.write_metadata(&metadata(END, end)))?;
        self.write(|writer| writer.finish().map(drop))?;
        let writer = self.writer.take().map(|writer| writer.into_inner().into_inner());
        if let Some(Err(error)) = writer {
            return Err(self.keep(error.into_error().into()));
        }
        if let Some(last) = self.syncing.take() {
            let _ = last.join();
            self.file.sync_data().map_err(|error| self.keep(error.into()))?;
        }
        let content = self.content(self.newest);
        outcome.map_err(|error| anyhow!("{content}; {error:#}"))
    }
}

/// The begin of a record, before the first look.
pub struct Heading<'a> {
    /// Seed of the world.
    pub seed: u64,
    /// Source of the looks.
    pub source: Source,
    /// The robot, with the faults and mistakes of the run.
    pub description: &'a Description,
    /// The robot's own signals.
    pub signals: &'a [Signal<'a>],
}

/// The name of a topic for a folder and a label.
pub(crate) fn topic(folder: &str, label: &str) -> String {
    let word = |letter: char| if letter.is_alphanumeric() { letter } else { '_' };
    format!("/{folder}/{}", label.chars().map(word).collect::<String>())
}

impl RecordWriter {
    /// Begins a record at `path`, over an existing file only with `force`; fails if it cannot be
    /// written.
    pub fn new(path: &Path, force: bool, heading: &Heading<'_>) -> Result<Self> {
        let cannot = || format!("cannot write {}", path.display());
        // Errors in the topics are found before there is a file.
        let topics = topics(heading.description, heading.signals).with_context(cannot)?;
        let mut file = RecordFile::new(path, force, heading_of(heading))?;
        let mut channels = BTreeMap::new();
        for (name, (about, map)) in topics {
            let (_, schema_name, schema) = about.form();
            let schema_name = format!("rc10/msg/{schema_name}");
            channels.insert(about, file.channel(&schema_name, &schema, &name, &map)?);
        }
        Ok(Self { file, channels, bytes: Vec::new() })
    }

    /// Writes the robot's own signals; fails if the file cannot be written.
    pub(crate) fn signals(&mut self, now: Micros, values: &[Option<f64>]) -> Result<()> {
        for (at, value) in values.iter().enumerate() {
            let told = Single { value: value.unwrap_or(f64::NAN) };
            self.write(About::Signal(at), now, &told)?;
        }
        Ok(())
    }

    /// Writes a look at each motor; fails if the file cannot be written.
    pub(crate) fn motors(&mut self, now: Micros, looks: &[MotorLook]) -> Result<()> {
        for (at, look) in looks.iter().enumerate() {
            self.write_some(About::Motor(at), now, MOTOR, look)?;
            self.write(About::Shaft(at), now, &look.shaft)?;
        }
        Ok(())
    }

    /// Writes a sample; fails if the file cannot be written.
    pub(crate) fn sample<'l>(
        &mut self,
        now: Micros,
        looks: impl Iterator<Item = &'l MotorLook>,
        moment: &Moment,
    ) -> Result<()> {
        for (at, look) in looks.enumerate() {
            self.write_some(About::Health(at), now, MOTOR_HEALTH, look)?;
        }
        for (at, look) in moment.buses.iter().enumerate() {
            self.write(About::Bus(at), now, &look.status)?;
            self.write(About::Wire(at), now, look)?;
        }
        for (at, status) in moment.lines.iter().enumerate() {
            self.write(About::Line(at), now, status)?;
        }
        for (at, counters) in moment.parts.iter().enumerate() {
            self.write(About::Part(at), now, counters)?;
        }
        if let Some(look) = &moment.remote {
            self.write(About::Remote, now, look)?;
        }
        self.write(About::Robot, now, &moment.robot.whole)?;
        self.write(About::Pose, now, &moment.robot)
    }

    /// Writes what reached the ticks; fails if the file cannot be written.
    pub(crate) fn inputs(&mut self, now: Micros, words: &[u32]) -> Result<()> {
        self.bytes.clear();
        self.bytes.extend(CDR);
        self.bytes.extend((words.len() as u32).to_le_bytes());
        self.bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        self.file.put_bytes(self.channels[&About::Inputs], now, &self.bytes)
    }

    fn write<T: Seen>(&mut self, about: About, now: Micros, it: &T) -> Result<()> {
        self.write_some(about, now, 0..T::FIELDS.len(), it)
    }

    fn write_some(
        &mut self,
        about: About,
        now: Micros,
        range: Range<usize>,
        it: &impl Seen,
    ) -> Result<()> {
        pack(range.map(|at| it.exact(at)), &mut self.bytes);
        self.file.put_bytes(self.channels[&about], now, &self.bytes)
    }

    /// Ends the record; fails if it cannot be written.
    pub(crate) fn finish(
        mut self,
        length: Micros,
        wires: &[WireEnd],
        losses: &[Loss],
        events: &[Event],
        faults: impl Iterator<Item = Option<Fault>>,
        margins: impl Iterator<Item = (&'static str, Margins)>,
    ) -> Result<()> {
        for (at, wire) in wires.iter().enumerate() {
            for (window, load) in (1..).zip(&wire.load_windows) {
                let end = Micros::from_millis(100 * window);
                self.write(About::Window(at), end, &Single { value: *load })?;
            }
        }
        for loss in losses {
            self.write(About::Loss, loss.lost.from, loss)?;
        }
        for event in events {
            self.file.put_bytes(self.channels[&About::Event], event.at, &text(event.label))?;
        }
        let mut end = BTreeMap::from([("length_us".to_owned(), length.get().to_string())]);
        for (number, wire) in (1..).zip(wires) {
            end.insert(format!("log_hash_{number}"), wire.log_hash.clone());
        }
        for (number, fault) in (1..).zip(faults) {
            if let Some(fault) = fault {
                end.insert(format!("fault_{number}"), fault.to_string());
            }
        }
        // Of the gains of this run: a later program may have others.
        for (label, Margins { speed, angle, .. }) in margins {
            end.insert(format!("margin {label}"), format!("{speed} {angle}"));
        }
        self.file.finish(Ok(()), end)
    }
}

fn metadata(name: &str, metadata: BTreeMap<String, String>) -> Metadata {
    Metadata { name: name.to_owned(), metadata }
}

fn heading_of(heading: &Heading<'_>) -> BTreeMap<String, String> {
    let Heading { seed, source, description, .. } = heading;
    let faults: Vec<_> = description.faults.iter().map(ToString::to_string).collect();
    let mistakes: Vec<_> = description.mistakes.iter().map(ToString::to_string).collect();
    let mut map = BTreeMap::from([
        ("seed".to_owned(), seed.to_string()),
        ("emulated".to_owned(), (*source == Source::Emulation).to_string()),
        ("faults".to_owned(), faults.join("\n")),
        ("mistakes".to_owned(), mistakes.join("\n")),
    ]);
    map.extend(Origin::now(&description.name).entries());
    if let Some(remote) = &description.remote {
        map.insert("receiver".to_owned(), remote.receiver.to_string());
    }
    map
}

fn all<T: Seen>() -> String {
    schema::<T>(0..T::FIELDS.len())
}

/// The subject of the messages of a topic; of each kind the first has index 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum About {
    /// The frequent values of a motor: all motors' belong to one moment.
    Motor(usize),
    /// The other values of a motor.
    Health(usize),
    Shaft(usize),
    Bus(usize),
    Wire(usize),
    Window(usize),
    Line(usize),
    Part(usize),
    Signal(usize),
    Robot,
    Pose,
    Remote,
    Loss,
    Event,
    Inputs,
}

impl About {
    /// The end of the topic's name, and name and text of its schema.
    fn form(self) -> (&'static str, &'static str, String) {
        match self {
            Self::Motor(_) => ("", "Motor", schema::<MotorLook>(MOTOR)),
            Self::Health(_) => ("/health", "MotorHealth", schema::<MotorLook>(MOTOR_HEALTH)),
            Self::Shaft(_) => ("/shaft", "Shaft", all::<Shaft>()),
            Self::Bus(_) => ("", "Bus", all::<BusStatus>()),
            Self::Wire(_) => ("/wire", "Wire", all::<BusLook>()),
            Self::Window(_) => ("/window_load", "Value", all::<Single>()),
            Self::Line(_) => ("", "Line", all::<Rs485Status>()),
            Self::Part(_) => ("", "Part", all::<Counters>()),
            Self::Signal(_) => ("", "Value", all::<Single>()),
            Self::Robot => ("/robot", "Robot", all::<Whole>()),
            Self::Pose => ("/robot/pose", "Pose", all::<RobotLook>()),
            Self::Remote => ("/remote", "Remote", all::<RemoteLook>()),
            Self::Loss => ("/remote/losses", "Loss", all::<Loss>()),
            Self::Event => (EVENTS, "Event", EVENT.1.into()),
            Self::Inputs => (INPUTS, "Inputs", "uint32[] words\n".into()),
        }
    }
}

/// A topic of a robot: its name, its subject, and its metadata.
type Topic = (String, (About, BTreeMap<String, String>));

/// The topics of a robot, in the order of a record; fails if two have one name.
pub(crate) fn topics(description: &Description, signals: &[Signal<'_>]) -> Result<Vec<Topic>> {
    let Description { motors, buses, lines, serials, .. } = description;
    let each = |count: usize, about: fn(usize) -> About| (0..count).map(about);
    let abouts = each((*buses).into(), About::Window)
        .chain(each(signals.len(), About::Signal))
        .chain(each(motors.len(), About::Health))
        .chain(each(motors.len(), About::Shaft))
        .chain(each(motors.len(), About::Motor))
        .chain(each((*buses).into(), About::Wire))
        .chain(each((*buses).into(), About::Bus))
        .chain(each(lines.len(), About::Line))
        .chain(each(serials.len(), About::Part))
        .chain([About::Robot, About::Pose, About::Remote, About::Loss, About::Event])
        .chain([About::Inputs]);
    let mut all: Vec<Topic> = Vec::new();
    for about in abouts {
        let number = |at: usize| (at + 1).to_string();
        let (folder, label, more) = match about {
            About::Motor(at) | About::Health(at) | About::Shaft(at) => {
                let motor = &motors[at];
                let more = vec![("model", motor.name().to_string()), ("on", motor.on.to_string())];
                ("motors", motor.label.to_owned(), more)
            }
            About::Bus(at) | About::Wire(at) | About::Window(at) => ("buses", number(at), vec![]),
            About::Line(at) => ("lines", number(at), vec![]),
            About::Part(at) => ("parts", serials[at].label.to_owned(), vec![]),
            About::Signal(at) => {
                let Signal { label, unit, .. } = signals[at];
                ("signals", label.to_owned(), vec![("unit", unit.to_owned())])
            }
            _ => ("", String::new(), vec![]),
        };
        let (end, ..) = about.form();
        let (name, map) = if folder.is_empty() {
            (end.to_owned(), BTreeMap::new())
        } else {
            let map = [("label", label.clone())].into_iter().chain(more);
            let map = map.map(|(key, value)| (key.to_owned(), value)).collect();
            (topic(folder, &label) + end, map)
        };
        if let Some((_, (_, other))) = all.iter().find(|(known, _)| *known == name) {
            let other = other.get("label").map_or("", String::as_str);
            bail!("`{other}` and `{label}` are one topic, {name}: rename one");
        }
        all.push((name, (about, map)));
    }
    Ok(all)
}
