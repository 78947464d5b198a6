//! A record: what was seen of a robot, look by look, in an [MCAP](https://mcap.dev) file that any viewer
//! of such files opens.
//!
//! A topic for each motor (`/motors/LABEL` every millisecond, `/motors/LABEL/health` every 10 ms), and
//! for each bus, line, part and signal; `/robot`, `/remote`, `/events`. Messages are what ROS 2 writes:
//! `ros2msg` schemas and CDR, all fields `float64`, NaN where there is none. The times of a run count
//! from power-on. [`fields`] has what stands where; [`replay()`] makes a recording of it again.

pub mod fields;
mod replay;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use mcap::records::{MessageHeader, Metadata};
use mcap::{WriteOptions, Writer};
use rc10_can::Micros;
use rc10_motor::Fault;

use self::fields::{BUS, Field, LINE, LOSS, MOTOR, MOTOR_HEALTH, PART, REMOTE, ROBOT, STATES};
use crate::description::Description;
use crate::look::{Moment, MotorLook};
use crate::recorder::WireEnd;
use crate::recording::Source;
use crate::remote::Loss;
use crate::robot::Robot;
use crate::run::beside;
use crate::script::Event;
use crate::signal::Signal;

pub use replay::{CsvArgs, Kit, Replay, ReportArgs, csv, replay, report};

/// What the layout of a record is called in its metadata, and its version: readers of another one
/// refuse it. Fields may be added without a new one.
pub(crate) const LAYOUT: &str = "rc10";
pub(crate) const VERSION: &str = "1";
/// What is known when all is over, in the metadata too.
pub(crate) const END: &str = "rc10-end";

/// Bytes before the fields of a message: CDR, little endian.
pub(crate) const CDR: [u8; 4] = [0, 1, 0, 0];

/// Makes a message of numbers.
pub(crate) fn pack(values: impl Iterator<Item = f64>, bytes: &mut Vec<u8>) {
    bytes.clear();
    bytes.extend(CDR);
    values.for_each(|value| bytes.extend(value.to_le_bytes()));
}

/// Writes what was seen in a run as a record.
pub struct RecordWriter {
    file: RecordFile,
    topics: Topics,
}

/// A record that is being written. The file is there when it is finished, whole, and not before.
pub(crate) struct RecordFile {
    path: PathBuf,
    // Closed before it is removed.
    file: Writer<BufWriter<File>>,
    beside: Unfinished,
    count: u32,
    bytes: Vec<u8>,
}

impl RecordFile {
    /// Begins a record that will be at `path`; `head` are its metadata, but for the version.
    ///
    /// # Errors
    /// If no file can be written there.
    pub(crate) fn new(path: &Path, mut head: BTreeMap<String, String>) -> Result<Self> {
        ensure!(!path.is_dir(), "cannot write {}: it is a folder", path.display());
        let cannot = || format!("cannot write {}", path.display());
        let beside = Unfinished(beside(path));
        let file = File::create(&beside.0).with_context(cannot)?;
        let options = WriteOptions::new().compression(None).profile("ros2").library("rc10");
        let mut file = options.create(BufWriter::new(file)).with_context(cannot)?;
        head.insert("version".to_owned(), VERSION.to_owned());
        file.write_metadata(&metadata(LAYOUT, head)).with_context(cannot)?;
        Ok(Self { path: path.into(), file, beside, count: 0, bytes: Vec::new() })
    }

    /// Declares a channel of numbers, with a schema of its own.
    pub(crate) fn channel(
        &mut self,
        name: &str,
        schema: &str,
        topic: &str,
        map: &BTreeMap<String, String>,
    ) -> Result<u16> {
        let id = self.file.add_schema(name, "ros2msg", schema.as_bytes())?;
        Ok(self.file.add_channel(id, topic, "cdr", map)?)
    }

    /// Writes a message of numbers.
    fn put(
        &mut self,
        channel_id: u16,
        now: Micros,
        values: impl Iterator<Item = f64>,
    ) -> Result<()> {
        let mut bytes = std::mem::take(&mut self.bytes);
        pack(values, &mut bytes);
        let outcome = self.put_bytes(channel_id, now, &bytes);
        self.bytes = bytes;
        outcome
    }

    /// Writes a message.
    pub(crate) fn put_bytes(&mut self, channel_id: u16, now: Micros, bytes: &[u8]) -> Result<()> {
        self.count = self.count.wrapping_add(1);
        let time = now.get() * 1000;
        let header =
            MessageHeader { channel_id, sequence: self.count, log_time: time, publish_time: time };
        let cannot = || format!("cannot write {}", self.path.display());
        self.file.write_to_known_channel(&header, bytes).with_context(cannot)
    }

    /// Ends it, and puts the file in its place; `end` are the metadata of its end.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn finish(self, end: BTreeMap<String, String>) -> Result<()> {
        let Self { path, mut file, beside, .. } = self;
        let cannot = || format!("cannot write {}", path.display());
        file.write_metadata(&metadata(END, end)).with_context(cannot)?;
        file.finish().with_context(cannot)?;
        file.into_inner().into_inner().map_err(|error| error.into_error()).with_context(cannot)?;
        fs::rename(&beside.0, &path).with_context(cannot)
    }
}

/// A file that is removed unless it was moved away.
struct Unfinished(PathBuf);

impl Drop for Unfinished {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Numbers of the channels.
struct Topics {
    motors: Vec<u16>,
    health: Vec<u16>,
    buses: Vec<u16>,
    windows: Vec<u16>,
    lines: Vec<u16>,
    parts: Vec<u16>,
    signals: Vec<u16>,
    robot: u16,
    remote: u16,
    losses: u16,
    events: u16,
}

/// What a record says of its run before the first look.
pub struct Heading<'a> {
    /// Seed of the world.
    pub seed: u64,
    /// Where its looks come from.
    pub source: Source,
    /// The robot, with the faults and mistakes of the run.
    pub description: &'a Description,
    /// Its own signals.
    pub signals: &'a [Signal<'a>],
}

impl<'a> Heading<'a> {
    /// Of a robot that is about to run in a simulation.
    #[must_use]
    pub fn of(robot: &'a Robot<'_>, seed: u64) -> Self {
        let (description, signals) = (robot.description(), robot.signals());
        Self { seed, source: Source::Simulation, description, signals }
    }
}

/// The name of a topic: labels are words, topics are paths.
pub(crate) fn topic(folder: &str, label: &str) -> String {
    let word = |letter: char| if letter.is_alphanumeric() { letter } else { '_' };
    format!("/{folder}/{}", label.chars().map(word).collect::<String>())
}

/// The schema of a table of fields.
fn schema<T>(fields: &[&[Field<T>]]) -> String {
    let line = |field: &Field<T>| format!("float64 {}  # {}\n", field.name, field.about);
    let mut text: String = fields.iter().copied().flatten().map(line).collect();
    for (state, names) in STATES {
        let says = |field: &Field<T>| field.about.split([' ', ':', ',']).next() == Some(*state);
        if fields.iter().copied().flatten().any(says) {
            let names = names.iter().enumerate().map(|(number, name)| format!("{number} {name}"));
            text += &format!("# {state}: {}\n", names.collect::<Vec<_>>().join(", "));
        }
    }
    text
}

impl RecordWriter {
    /// Begins a record that will be at `path`.
    ///
    /// # Errors
    /// If no file can be written there.
    pub fn new(path: &Path, heading: &Heading<'_>) -> Result<Self> {
        let mut file = RecordFile::new(path, heading_of(heading))?;
        let cannot = || format!("cannot write {}", path.display());
        let topics = Topics::new(&mut file.file, heading).with_context(cannot)?;
        Ok(Self { file, topics })
    }

    /// Writes the robot's own signals.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn signals(&mut self, now: Micros, values: &[Option<f64>]) -> Result<()> {
        for (at, value) in values.iter().enumerate() {
            let channel = self.topics.signals[at];
            self.write(channel, now, VALUE, &value.unwrap_or(f64::NAN))?;
        }
        Ok(())
    }

    /// Writes a look at each motor.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn motors(&mut self, now: Micros, looks: &[MotorLook]) -> Result<()> {
        for (at, look) in looks.iter().enumerate() {
            self.write(self.topics.motors[at], now, MOTOR, look)?;
        }
        Ok(())
    }

    /// Writes a sample.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn sample<'l>(
        &mut self,
        now: Micros,
        looks: impl Iterator<Item = &'l MotorLook>,
        moment: &Moment,
    ) -> Result<()> {
        for (at, look) in looks.enumerate() {
            self.write(self.topics.health[at], now, MOTOR_HEALTH, look)?;
        }
        for (at, look) in moment.buses.iter().enumerate() {
            self.write(self.topics.buses[at], now, BUS, look)?;
        }
        for (at, status) in moment.lines.iter().enumerate() {
            self.write(self.topics.lines[at], now, LINE, status)?;
        }
        for (at, counters) in moment.parts.iter().enumerate() {
            self.write(self.topics.parts[at], now, PART, counters)?;
        }
        if let Some(look) = &moment.remote {
            self.write(self.topics.remote, now, REMOTE, look)?;
        }
        self.write(self.topics.robot, now, ROBOT, &moment.robot)
    }

    fn write<T>(
        &mut self,
        channel_id: u16,
        now: Micros,
        fields: &[&[Field<T>]],
        it: &T,
    ) -> Result<()> {
        let values = fields.iter().copied().flatten().map(|field| (field.get)(it));
        self.file.put(channel_id, now, values)
    }

    /// Ends the record, and puts the file in its place.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn finish(
        mut self,
        length: Micros,
        wires: &[WireEnd],
        losses: &[Loss],
        events: &[Event],
        faults: impl Iterator<Item = Option<Fault>>,
    ) -> Result<()> {
        for (at, wire) in wires.iter().enumerate() {
            for (window, load) in (1..).zip(&wire.load_windows) {
                let end = Micros::from_millis(100 * window);
                self.write(self.topics.windows[at], end, VALUE, load)?;
            }
        }
        for loss in losses {
            self.write(self.topics.losses, loss.lost.from, LOSS, loss)?;
        }
        for event in events {
            let mut bytes = CDR.to_vec();
            bytes.extend((event.label.len() as u32 + 1).to_le_bytes());
            bytes.extend(event.label.bytes().chain([0]));
            self.file.put_bytes(self.topics.events, event.at, &bytes)?;
        }
        let mut end = BTreeMap::from([("length_us".to_owned(), length.get().to_string())]);
        for (number, wire) in (1..).zip(wires) {
            end.insert(format!("log_hash_{number}"), wire.log_hash.clone());
        }
        for (number, fault) in (1..).zip(faults) {
            if let Some(fault) = fault {
                end.insert(format!("fault_{number}"), fault.text.to_owned());
            }
        }
        self.file.finish(end)
    }
}

/// The field of a message that is one number.
pub(crate) const VALUE: &[&[Field<f64>]] = &[&[Field {
    name: "value",
    about: "NaN while there is none",
    get: |value| *value,
    set: |value, number| *value = number,
    counts: false,
}]];

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
    if let Some(remote) = &description.remote {
        map.insert("receiver".to_owned(), remote.receiver.to_string());
    }
    map
}

impl Topics {
    fn new<W: std::io::Write + std::io::Seek>(
        file: &mut Writer<W>,
        heading: &Heading<'_>,
    ) -> Result<Self> {
        let Heading { description, signals, .. } = heading;
        let mut taken = BTreeMap::new();
        let mut add = |name: &str,
                       schema: &str,
                       topics: Vec<(String, BTreeMap<String, String>)>|
         -> Result<Vec<u16>> {
            for (topic, map) in &topics {
                let label = map.get("label").cloned().unwrap_or_default();
                if let Some(other) = taken.insert(topic.clone(), label.clone()) {
                    bail!("`{other}` and `{label}` are one topic, {topic}: rename one");
                }
            }
            let id = file.add_schema(&format!("rc10/msg/{name}"), "ros2msg", schema.as_bytes())?;
            let add = |(topic, map): &(String, _)| file.add_channel(id, topic, "cdr", map);
            Ok(topics.iter().map(add).collect::<Result<Vec<u16>, _>>()?)
        };
        let named = |folder: &str, label: &str, extra: &[(&str, String)]| {
            let own = [("label".to_owned(), label.to_owned())].into_iter();
            let extra = extra.iter().map(|(key, value)| ((*key).to_owned(), value.clone()));
            (topic(folder, label), own.chain(extra).collect::<BTreeMap<_, _>>())
        };
        let numbered = |folder: &str, count: usize| {
            (1..=count).map(|number| named(folder, &number.to_string(), &[])).collect::<Vec<_>>()
        };
        let below = |topics: &[(String, BTreeMap<String, String>)], name: &str| {
            let below = |(topic, map): &(String, _)| (format!("{topic}/{name}"), Clone::clone(map));
            topics.iter().map(below).collect::<Vec<(String, BTreeMap<String, String>)>>()
        };
        let motor = |motor: &crate::Motor| {
            let extra = [("model", motor.name().to_string()), ("on", motor.on.to_string())];
            named("motors", motor.label, &extra)
        };
        let motors: Vec<_> = description.motors.iter().map(motor).collect();
        let buses = numbered("buses", description.buses.into());
        let parts = description.serials.iter().map(|part| named("parts", part.label, &[]));
        let signals = signals
            .iter()
            .map(|signal| named("signals", signal.label, &[("unit", signal.unit.to_owned())]));
        let mut values = below(&buses, "window_load");
        let windows = values.len();
        values.extend(signals);
        let one = |topic: &str| vec![(topic.to_owned(), BTreeMap::new())];
        let mut values = add("Value", &schema(VALUE), values)?;
        Ok(Self {
            signals: values.split_off(windows),
            windows: values,
            health: add("MotorHealth", &schema(MOTOR_HEALTH), below(&motors, "health"))?,
            motors: add("Motor", &schema(MOTOR), motors)?,
            buses: add("Bus", &schema(BUS), buses)?,
            lines: add("Line", &schema(LINE), numbered("lines", description.lines.len()))?,
            parts: add("Part", &schema(PART), parts.collect())?,
            robot: add("Robot", &schema(ROBOT), one("/robot"))?[0],
            remote: add("Remote", &schema(REMOTE), one("/remote"))?[0],
            losses: add("Loss", &schema(LOSS), one("/remote/losses"))?[0],
            events: add("Event", "string label\n", one("/events"))?[0],
        })
    }
}
