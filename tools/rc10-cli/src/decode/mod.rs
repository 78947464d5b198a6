//! The meaning of the frames in a candump log: each goes through the robot's own buses and motors,
//! so what is printed is what the robot would have understood.

pub(crate) mod filter;
pub(crate) mod heard;
pub(crate) mod print;

use std::collections::BTreeMap;
use std::str::FromStr;

use anyhow::ensure;
use rc10_can::CanFrame;
use rc10_can::embedded_can::Id;
use rc10_motor::dji::{Model, RawFeedback};
use rc10_motor::signals::{Marks, Message};
use rc10_motor::{Dispatch, Feedback, FrameError, MotorBus, MotorId, MotorStatus, dji};
use rc10_time::Micros;

use crate::formats::candump::CandumpLine;
use crate::robot::description::Description;
use crate::robot::motor::Motor;

/// `can0=1`: the interface `can0` is the robot's bus 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusOfChannel {
    /// The interface, as the log calls it.
    pub channel: String,
    /// The first one is 1.
    pub bus: u8,
}

impl FromStr for BusOfChannel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').filter(|(channel, _)| !channel.is_empty());
        let (channel, bus) = parts.ok_or("write it as CHANNEL=NUMBER, such as can0=2")?;
        match bus.parse() {
            Ok(number @ 1..) => Ok(Self { channel: channel.to_owned(), bus: number }),
            _ => Err(format!("the robot's buses have numbers from 1 on, not {bus:?}")),
        }
    }
}

/// The beginning of a line, without control characters.
pub(crate) fn excerpt(text: &str) -> String {
    const LONGEST: usize = 60;
    let more = if text.chars().nth(LONGEST).is_some() { ".." } else { "" };
    format!("\"{}\"{more}", text.chars().take(LONGEST).collect::<String>().escape_debug())
}

/// The messages of a bus's motors, in order; a message to several motors comes once.
pub(crate) fn known_on(robot: &Description, bus: u8) -> Vec<Known<'_>> {
    let mut all: Vec<Known<'_>> = Vec::new();
    for motor in robot.on_bus(bus) {
        for message in motor.messages() {
            match all.iter_mut().find(|(_, known)| *known == message && !message.from_device) {
                Some((whose, _)) => *whose = None,
                None => all.push((Some(motor), message)),
            }
        }
    }
    all
}

/// A message and its motor; `None` if it is for several motors.
pub(crate) type Known<'d> = (Option<&'d Motor>, Message);

pub(crate) struct Decoder<'d, 'm> {
    pub(crate) robot: &'d Description,
    pub(crate) messages: Vec<Vec<Known<'d>>>,
    pub(crate) buses: Vec<MotorBus<'m>>,
    /// The newest time in the log, for frames without a time.
    pub(crate) newest: Micros,
}

pub(crate) enum Meaning<'d> {
    Feedback {
        motor: &'d Motor,
        raw: Option<RawFeedback>,
        feedback: Feedback,
    },
    Message {
        /// `None` if it is for several motors.
        motor: Option<&'d Motor>,
        message: Message,
    },
    /// A motor's answer to a request that its tables do not describe.
    Unasked {
        motor: &'d Motor,
    },
    Command(Vec<Lane<'d>>),
    Malformed {
        motor: Option<&'d Motor>,
        error: FrameError,
    },
    Unknown,
}

pub(crate) struct Lane<'d> {
    number: u8,
    raw: i16,
    motor: Option<&'d Motor>,
}

impl Meaning<'_> {
    /// Whether it concerns a motor that `is_it`.
    pub(crate) fn concerns(&self, is_it: impl Fn(&Motor) -> bool) -> bool {
        match self {
            Self::Feedback { motor, .. } | Self::Unasked { motor } => is_it(motor),
            Self::Message { motor, .. } | Self::Malformed { motor, .. } => motor.is_some_and(is_it),
            Self::Command(lanes) => lanes.iter().any(|lane| lane.motor.is_some_and(&is_it)),
            Self::Unknown => false,
        }
    }
}

/// All DJI models: their command frames are known also on a bus where the robot has none.
const MODELS: [&Model; 4] = [&dji::M3508, &dji::M2006, &dji::GM6020_CURRENT, &dji::GM6020_VOLTAGE];

impl<'d> Decoder<'d, '_> {
    /// The meaning of a frame on a bus; the first bus is 1.
    pub(crate) fn decode(&mut self, bus: u8, line: &CandumpLine<'_>) -> Meaning<'d> {
        let frame = &line.frame;
        let at = line.at.unwrap_or(self.newest);
        self.newest = at;
        if let Id::Standard(id) = frame.id()
            && !frame.is_remote()
            && MODELS.iter().any(|model| model.command_ids.contains(&id.as_raw()))
            && self.robot.on_bus(bus).any(|motor| motor.dji().is_some())
        {
            return command(self.robot, bus, frame);
        }
        // An LK drive takes commands at the identifier of its answers: this is no feedback.
        if let Some(message) = self.message(bus, frame, |_, message| !message.from_device) {
            return message;
        }
        let described = |id: MotorId| self.robot.on_bus(bus).nth(id.index());
        let Some(motors) = self.buses.get_mut(usize::from(bus) - 1) else {
            return Meaning::Unknown;
        };
        let dispatch = motors.on_frame(frame, at);
        let message = match dispatch {
            Dispatch::Malformed(id, error) => {
                return Meaning::Malformed { motor: described(id), error };
            }
            Dispatch::Unclaimed => self.message(bus, frame, |_, message| message.from_device),
            Dispatch::Unasked(id) => {
                let whose = described(id);
                self.message(bus, frame, |motor, message| message.from_device && is(motor, whose))
            }
            // The motor takes it for feedback, and no mark in it says otherwise.
            Dispatch::Motor(id) => {
                let whose = described(id).filter(|motor| motor.dji().is_none());
                self.message(bus, frame, |motor, message| {
                    let is_marked = message.marks != Marks::NONE;
                    message.from_device && !is_marked && is(motor, whose)
                })
            }
        };
        let (None, Dispatch::Motor(id) | Dispatch::Unasked(id)) = (&message, dispatch) else {
            return message.unwrap_or(Meaning::Unknown);
        };
        let status = self.buses.get(usize::from(bus) - 1).and_then(|motors| motors.status(id, at));
        let (Some(motor), Some(status)) = (described(id), status) else {
            return Meaning::Unknown;
        };
        if let Dispatch::Unasked(_) = dispatch {
            return Meaning::Unasked { motor };
        }
        // DJI's motors tell more themselves than their tables do: the angle behind the gearbox.
        let raw = motor.dji().and_then(|_| frame.all_eight()).map(RawFeedback::unpack);
        Meaning::Feedback { motor, raw, feedback: status.feedback }
    }

    /// The most specific wanted message of a bus's motors that matches a frame.
    fn message(
        &self,
        bus: u8,
        frame: &CanFrame,
        wanted: impl Fn(Option<&'d Motor>, &Message) -> bool,
    ) -> Option<Meaning<'d>> {
        let mut messages = self.messages.get(usize::from(bus) - 1)?.iter().rev();
        let &(motor, message) =
            messages.find(|(motor, message)| message.matches(frame) && wanted(*motor, message))?;
        Some(Meaning::Message { motor, message })
    }

    pub(crate) fn motors(&self, bus: u8) -> impl Iterator<Item = (&'d Motor, MotorStatus)> {
        let motors = self.buses.get(usize::from(bus) - 1).into_iter();
        let status = |motors: &MotorBus<'_>, id| motors.status(id, self.newest);
        let statuses =
            motors.flat_map(move |motors| motors.ids().filter_map(move |id| status(motors, id)));
        self.robot.on_bus(bus).zip(statuses)
    }
}

fn is(one: Option<&Motor>, other: Option<&Motor>) -> bool {
    one.zip(other).is_some_and(|(one, other)| std::ptr::eq(one, other))
}

/// The lanes of a command frame: those of a motor, and others that are not zero.
fn command<'d>(robot: &'d Description, bus: u8, frame: &CanFrame) -> Meaning<'d> {
    let Some(bytes) = frame.all_eight() else {
        return Meaning::Malformed { motor: None, error: FrameError::Length };
    };
    let commands = |motor: &Motor, lane: usize| {
        let place = motor.dji().and_then(|(model, id)| model.command_lane(id).ok());
        place.is_some_and(|(id, byte)| Id::Standard(id) == frame.id() && byte == lane * 2)
    };
    let lanes = (1..).zip(bytes.chunks_exact(2)).enumerate().map(|(index, (number, pair))| Lane {
        number,
        raw: i16::from_be_bytes([pair[0], pair[1]]),
        motor: robot.on_bus(bus).find(|motor| commands(motor, index)),
    });
    Meaning::Command(lanes.filter(|lane| lane.motor.is_some() || lane.raw != 0).collect())
}

#[derive(Default)]
pub(crate) struct Summary {
    buses: u8,
    given: Vec<BusOfChannel>,
    pub(crate) lines: u64,
    pub(crate) broken_lines: u64,
    frames: u64,
    feedback: u64,
    commands: u64,
    malformed: u64,
    unknown: u64,
    channels: BTreeMap<String, Channel>,
}

#[derive(Default)]
pub(crate) struct Channel {
    bus: Option<u8>,
    frames: u64,
    /// Frames without a meaning, by identifier and whether it is a remote request.
    unknown: BTreeMap<(Id, bool), u64>,
    /// Such frames that came when [`MOST_IDS`] other identifiers were in `unknown`.
    unknown_further: u64,
}

/// Limit of kept identifiers: some devices put data into extended ones.
pub(crate) const MOST_IDS: usize = 1000;

impl Summary {
    pub(crate) fn new(given: &[BusOfChannel], buses: u8) -> anyhow::Result<Self> {
        for (index, BusOfChannel { channel, bus }) in given.iter().enumerate() {
            let is_there = (1..=buses).contains(bus);
            ensure!(is_there, "--bus {channel}={bus}: the robot has buses 1 to {buses}");
            for BusOfChannel { channel: other, bus: its } in &given[..index] {
                ensure!(channel != other, "--bus: {channel} is given twice");
                ensure!(bus != its, "--bus: {other} and {channel} cannot both be bus {bus}");
            }
        }
        Ok(Self { buses, given: given.to_vec(), ..Self::default() })
    }

    /// The bus of an interface: as given, else canN is bus N+1 if that is free.
    pub(crate) fn bus_of(&self, channel: &str) -> Option<u8> {
        if let Some(given) = self.given.iter().find(|given| given.channel == channel) {
            return Some(given.bus);
        }
        let stock = (1..=self.buses).find(|bus| channel == format!("can{}", bus - 1));
        stock.filter(|bus| self.given.iter().all(|given| given.bus != *bus))
    }

    /// Registers an interface; returns a hint if it is no bus.
    pub(crate) fn greet(&mut self, name: &str) -> Option<String> {
        if self.channels.contains_key(name) {
            return None;
        }
        let (bus, buses) = (self.bus_of(name), self.buses);
        self.channels.insert(name.to_owned(), Channel { bus, ..Channel::default() });
        if bus.is_some() {
            return None;
        }
        let is_free = |bus: &u8| {
            let taken = self.channels.values().any(|channel| channel.bus == Some(*bus));
            !taken && self.given.iter().all(|given| given.bus != *bus)
        };
        let free = (1..=buses).find(is_free).unwrap_or(1);
        Some(format!(
            "{name}: no bus of the robot (1 to {buses}), its frames are not decoded; --bus \
             {name}={free} makes it one"
        ))
    }

    /// Remarks on interfaces that were given, but did not occur.
    pub(crate) fn silent(&self) -> impl Iterator<Item = String> {
        let came: Vec<&str> = self.channels.keys().map(String::as_str).collect();
        let came = if came.is_empty() { "no frames".to_owned() } else { came.join(", ") };
        let silent = self.given.iter().filter(|given| !self.channels.contains_key(&given.channel));
        silent.map(move |BusOfChannel { channel, bus }| {
            format!("--bus {channel}={bus}: no frame came on {channel}; the log has {came}")
        })
    }

    pub(crate) fn count<'d>(
        &mut self,
        decoder: &mut Decoder<'d, '_>,
        line: &CandumpLine<'_>,
    ) -> Option<(u8, Meaning<'d>)> {
        let channel = self.channels.get_mut(line.channel)?;
        self.frames += 1;
        channel.frames += 1;
        let meaning = channel.bus.map(|bus| (bus, decoder.decode(bus, line)));
        *match meaning.as_ref().map(|(_, meaning)| meaning) {
            None | Some(Meaning::Unknown) => {
                self.unknown += 1;
                channel.note_unknown(&line.frame);
                return None;
            }
            Some(Meaning::Malformed { .. }) => &mut self.malformed,
            Some(Meaning::Command(_)) => &mut self.commands,
            Some(Meaning::Message { message, .. }) if !message.from_device => &mut self.commands,
            Some(_) => &mut self.feedback,
        } += 1;
        meaning
    }
}

impl Channel {
    fn note_unknown(&mut self, frame: &CanFrame) {
        let key = (frame.id(), frame.is_remote());
        if self.unknown.len() < MOST_IDS || self.unknown.contains_key(&key) {
            *self.unknown.entry(key).or_default() += 1;
        } else {
            self.unknown_further += 1;
        }
    }
}
