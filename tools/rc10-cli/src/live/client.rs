//! The PC's end of a link, without the port: bytes in, bytes out, and the time as an argument.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use rc10_link::commands;
use rc10_link::frame::{AROUND, ASK, FromRobot, Writer, carried};
use rc10_link::samples::{Head, VALUES};
use rc10_link::{
    AT_ONCE, Action, Ask, Bits, Change, Declaration, GROUPS, Outcome, SILENCE, Tell, Urgent,
    VERSION,
};
use rc10_module::Stream;
use rc10_time::Micros;

/// A signal that the robot describes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Signal {
    /// Folder of the signal's subject, such as "motors".
    pub folder: String,
    /// Label of the subject, such as "lift left".
    pub label: String,
    /// Name of the signal within its subject.
    pub name: String,
    /// Unit of the signal.
    pub unit: String,
    /// Names of the values of a state.
    pub states: Vec<String>,
}

/// A parameter that the robot describes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// Number of the parameter.
    pub index: u16,
    /// Folder of the parameter's subject.
    pub folder: String,
    /// Label of the subject.
    pub label: String,
    /// Name of the parameter within its subject.
    pub name: String,
    /// Unit of the parameter.
    pub unit: String,
    /// The lowest and highest value.
    pub range: [f32; 2],
    /// Current value.
    pub value: f32,
    /// Value in the robot's table.
    pub initial: f32,
}

impl Parameter {
    /// Whether it is not as the robot's table has it.
    pub const fn is_changed(&self) -> bool {
        self.value.to_bits() != self.initial.to_bits()
    }
}

/// A value that the robot keeps over a power-off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptValue {
    /// Tells it from the others.
    pub id: u32,
    /// The name of its parameter, or the end of it.
    pub text: String,
    /// The value.
    pub value: f32,
    /// The parameter with that name.
    pub parameter: Option<u16>,
    /// Whether unit and range are still those of the parameter.
    pub is_used: bool,
}

/// Values of a group at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The group.
    pub group: usize,
    /// Time since the robot's power-on.
    pub at: Micros,
    /// The values of the group's signals, by number.
    pub values: Vec<(u16, f32)>,
}

/// The answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The request was carried out.
    Done,
    /// Value of a register.
    Register(u32),
    /// Refused, for this reason.
    Refused(String),
}

/// Progress of a stop or a disarming.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// Sent again and again, and not confirmed yet.
    Sent,
    /// Not confirmed for [`NOT_HEARD`] or longer.
    NotHeard,
}

/// Time from which on a stop without an answer counts as not heard.
pub const NOT_HEARD: Micros = Micros::from_millis(150);

/// A stop or disarming that is sent until it is answered.
#[derive(Clone, Copy, Debug)]
struct UrgentRequest {
    what: Urgent,
    id: u16,
    since: Micros,
    sent: Option<Micros>,
}

/// Losses on the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Samples that the robot sent and that did not arrive.
    pub samples: u64,
    /// Samples that the robot did not take, because the line is too slow for them.
    pub skipped: u64,
    /// Damaged frames, here and at the robot.
    pub damaged: u64,
    /// Messages of a kind that this program does not know.
    pub unknown: u64,
}

#[derive(Clone, Debug, Default)]
struct Group {
    period: u16,
    signals: Bits,
    order: Vec<u16>,
    last: Option<Head>,
    skipped: u64,
}

/// The bodies in the robot's bytes: of its frames, and of those that ride on them.
pub(super) struct Frames([Stream<FromRobot>; 2]);

impl Default for Frames {
    fn default() -> Self {
        Self([Stream::new(FromRobot), Stream::new(FromRobot)])
    }
}

impl Frames {
    /// Takes received bytes; returns the bodies that are whole now.
    pub(super) fn take(&mut self, bytes: &[u8], now: Micros) -> Vec<Vec<u8>> {
        let (mut bodies, [line, riders]) = (Vec::new(), &mut self.0);
        if bytes.is_empty() {
            return bodies;
        }
        line.receive(bytes, now, |body| match carried(&body) {
            None => bodies.push(body.to_vec()),
            Some((pieces, sample)) => {
                if !pieces.is_empty() {
                    riders.receive(pieces, now, |body| bodies.push(body.to_vec()));
                }
                if !sample.is_empty() {
                    bodies.push(sample.to_vec());
                }
            }
        });
        bodies
    }

    fn damaged(&self) -> u64 {
        self.0.iter().map(|it| u64::from(it.counters().damaged)).sum()
    }
}

/// The PC's end of a link.
#[derive(Default)]
pub struct Client {
    frames: Frames,
    out: Vec<u8>,
    /// Sent before `out`.
    first: Vec<u8>,
    urgent: Vec<UrgentRequest>,
    greeted: Option<Micros>,
    hellos: u32,
    heard: Option<Micros>,
    version: u16,
    at: Option<Micros>,
    signals: Table<Signal>,
    parameters: Table<Parameter>,
    kept: Table<KeptValue>,
    /// Pieces of the black box, once it was asked for; and the number of the last question.
    pieces: Option<(Table<Vec<u8>>, u16)>,
    changes: Option<u32>,
    groups: [Group; GROUPS],
    declaration: Declaration,
    asked: BTreeSet<u16>,
    answers: BTreeMap<u16, Answer>,
    /// Numbers of the newest commands, and why some were refused.
    commanded: VecDeque<u16>,
    refusals: Vec<String>,
    next_id: u16,
    samples: Vec<Sample>,
    losses: Losses,
    damaged_there: u32,
    /// Bytes that the line carries in a millisecond; 0: unknown.
    line: u16,
}

/// A table of descriptions that arrive page by page.
#[derive(Default)]
struct Table<T> {
    rows: Vec<Option<T>>,
    /// Number of rows, from the first on, that are current.
    fresh: usize,
    asked: Option<Micros>,
}

impl<T: Clone> Table<T> {
    fn size(&mut self, size: u16) {
        self.rows.resize(size.into(), None);
        self.fresh = self.fresh.min(self.rows.len());
    }

    /// Asks for all rows again; the old ones stay until then.
    const fn renew(&mut self) {
        (self.fresh, self.asked) = (0, None);
    }

    /// Stores the next row in order; others are asked for again.
    fn put(&mut self, index: u16, row: T) {
        let index = usize::from(index);
        if index != self.fresh {
            return;
        }
        if let Some(place) = self.rows.get_mut(index) {
            *place = Some(row);
            self.fresh += 1;
            if self.fresh.is_multiple_of(AT_ONCE.into()) {
                self.asked = None;
            }
        }
    }

    /// The first missing row, if it is time to ask for it.
    fn next(&mut self, now: Micros) -> Option<u16> {
        let waits = self.asked.is_some_and(|asked| now.since(asked) < AGAIN);
        if waits || self.is_whole() {
            return None;
        }
        self.asked = Some(now);
        // Always whole pages, so that the end of one is known.
        u16::try_from(self.fresh - self.fresh % usize::from(AT_ONCE)).ok()
    }

    const fn is_whole(&self) -> bool {
        self.fresh == self.rows.len()
    }
}

/// Period of hellos: a jog needs a recent time of the robot.
const GREET: Micros = Micros::from_millis(100);
/// Period at which an urgent request is sent.
const URGE: Micros = Micros::from_millis(20);
/// Limit of requests that wait for an answer.
const ASKED: usize = 256;
/// The same of commands.
const COMMANDED: usize = 256;
/// Largest step back of the robot's time without a restart: a sample overtakes a greeting, which may ride on
/// many of them.
const LATE: Micros = Micros::from_millis(200);
/// The first version of the messages in which values are kept.
const KEPT: u16 = 3;
/// Time after which a request without an answer is repeated.
const AGAIN: Micros = Micros::from_millis(150);

impl Client {
    /// Creates a client before its first byte.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a client with this first request number: random if another program may use the line.
    pub fn with_first_id(next_id: u16) -> Self {
        Self { next_id, ..Self::default() }
    }

    /// Whether the robot answers.
    pub fn is_up(&self, now: Micros) -> bool {
        self.heard.is_some_and(|heard| now.since(heard).get() < SILENCE)
    }

    /// Whether all signals and parameters are known.
    pub fn is_described(&self) -> bool {
        self.heard.is_some() && self.signals.is_whole() && self.parameters.is_whole()
    }

    /// Version of the robot's messages.
    pub const fn version(&self) -> u16 {
        self.version
    }

    /// The robot's signals by number, as far as they are known.
    pub fn signals(&self) -> impl Iterator<Item = (u16, &Signal)> {
        let known = (0..).zip(&self.signals.rows);
        let known = known.filter_map(|(index, row)| Some((index, row.as_ref()?)));
        known.filter(|(_, row): &(u16, &Signal)| !row.name.is_empty())
    }

    /// A signal by its number, if it is known.
    pub fn signal(&self, index: u16) -> Option<&Signal> {
        self.signals.rows.get(usize::from(index))?.as_ref()
    }

    /// The robot's parameters, as far as they are known.
    pub fn parameters(&self) -> impl Iterator<Item = &Parameter> {
        self.parameters.rows.iter().flatten().filter(|row| !row.name.is_empty())
    }

    /// The values that the robot keeps; `None` as long as that is not known.
    pub fn kept(&self) -> Option<impl Iterator<Item = &KeptValue>> {
        let is_known = self.heard.is_some() && self.version >= KEPT && self.kept.is_whole();
        is_known.then(|| self.kept.rows.iter().flatten())
    }

    /// The identity of the robot.
    pub const fn declaration(&self) -> Declaration {
        self.declaration
    }

    /// The number of the motor with this label.
    pub fn motor(&self, label: &str) -> Option<u8> {
        let mut labels: Vec<&str> = Vec::new();
        for (_, signal) in self.signals().filter(|(_, it)| it.folder == "motors") {
            if labels.last() != Some(&signal.label.as_str()) {
                labels.push(&signal.label);
            }
        }
        u8::try_from(labels.iter().position(|it| *it == label)?).ok()
    }

    /// A counter that differs whenever a parameter has changed.
    pub const fn changes(&self) -> Option<u32> {
        self.changes
    }

    /// Losses so far.
    pub fn losses(&self) -> Losses {
        Losses {
            skipped: self.groups.iter().map(|group| group.skipped).sum(),
            damaged: self.frames.damaged() + u64::from(self.damaged_there),
            ..self.losses
        }
    }

    /// Tells the robot how much its line carries, by its bit rate: from then on samples of group 0 are whole.
    pub fn set_line(&mut self, bytes_per_milli: u16) {
        self.line = bytes_per_milli;
    }

    /// Watches signals in one group, every `period` ms; returns how many fit, the rest is left out.
    pub fn watch(
        &mut self,
        group: usize,
        period: u16,
        signals: impl Iterator<Item = u16>,
    ) -> usize {
        let Some(place) = self.groups.get_mut(group) else { return 0 };
        let mut order: Vec<u16> = signals.collect();
        order.sort_unstable();
        order.dedup();
        order.truncate(VALUES);
        let signals: Bits = order.iter().copied().collect();
        if place.period != period || place.signals != signals {
            *place = Group { period, signals, order, last: None, skipped: place.skipped };
            self.greeted = None;
        }
        self.groups[group].order.len()
    }

    /// Changes parameters, all or none; returns the number for [`answer`](Self::answer), or `None`
    /// for too many.
    pub fn set(&mut self, changes: &[(u16, f32)]) -> Option<u16> {
        let mut all = heapless::Vec::new();
        for &(parameter, value) in changes {
            all.push(Change { parameter, value }).ok()?;
        }
        let (id, declaration) = (self.id(), self.declaration);
        self.ask(&Ask::Set { id, changes: all, declaration });
        Some(id)
    }

    /// Requests an action, once.
    pub fn act(&mut self, action: Action) -> u16 {
        let (id, declaration) = (self.id(), self.declaration);
        let heard = self.at.unwrap_or_default().get();
        self.ask(&Ask::Act { id, declaration, heard, action });
        id
    }

    /// Commands channels from `head.first` on, once, as who commands and counts in `head`, of this age. Only a
    /// [refusal](Self::take_refusals) is answered.
    pub fn command(&mut self, head: commands::Head, values: &[f32]) {
        let id = self.next_id();
        self.commanded.push_back(id);
        if self.commanded.len() > COMMANDED {
            self.commanded.pop_front();
        }
        let heard = self.at.unwrap_or_default().get();
        let head = commands::Head { id, declaration: self.declaration, heard, ..head };
        let values = values.iter().flat_map(|value| value.to_le_bytes());
        let body: Vec<u8> = head.bytes().into_iter().chain(values).collect();
        let mut frame = Writer::<{ ASK + AROUND }>::new();
        frame.body(&body);
        self.out.extend(frame.bytes());
    }

    /// Why commands were refused since the last call.
    pub fn take_refusals(&mut self) -> Vec<String> {
        std::mem::take(&mut self.refusals)
    }

    /// Requests a stop or disarming of any robot, known or not: sent every 20 ms, before everything
    /// else, until it is confirmed. Returns the number for [`answer`](Self::answer).
    pub fn urge(&mut self, what: Urgent, now: Micros) -> u16 {
        if let Some(urgent) = self.urgent.iter().find(|it| it.what == what) {
            return urgent.id;
        }
        let id = self.id();
        self.urgent.push(UrgentRequest { what, id, since: now, sent: None });
        id
    }

    /// Progress of a stop or disarming; `None` if it was not requested or is done.
    pub fn urgency(&self, what: Urgent, now: Micros) -> Option<Urgency> {
        let age = now.since(self.urgent.iter().find(|it| it.what == what)?.since);
        Some(if age < NOT_HEARD { Urgency::Sent } else { Urgency::NotHeard })
    }

    /// The answer to a request, once.
    pub fn answer(&mut self, id: u16) -> Option<Answer> {
        self.answers.remove(&id)
    }

    /// The samples since the last call.
    pub fn take_samples(&mut self) -> Vec<Sample> {
        std::mem::take(&mut self.samples)
    }

    /// The bytes to be sent now.
    pub fn take_out(&mut self) -> Vec<u8> {
        let mut bytes = std::mem::take(&mut self.first);
        bytes.append(&mut self.out);
        bytes
    }

    /// Asks for what is missing, if it is time.
    pub fn step(&mut self, now: Micros) {
        for UrgentRequest { what, id, sent, .. } in &mut self.urgent {
            if sent.is_none_or(|sent| now.since(sent) >= URGE) {
                *sent = Some(now);
                self.first.extend(frame(&Ask::Urge { id: *id, what: *what }));
            }
        }
        if self.greeted.is_none_or(|greeted| now.since(greeted) >= GREET) {
            let is_new = self.greeted.replace(now).is_none();
            self.ask(&Ask::Hello { version: VERSION });
            self.hellos = self.hellos.wrapping_add(1);
            // Repeated, in case the robot has not heard it or was restarted.
            let repeats = is_new || self.hellos.is_multiple_of(2);
            if repeats && self.line > 0 {
                self.ask(&Ask::Line { bytes: self.line });
            }
            for group in (0..GROUPS).filter(|_| repeats) {
                let Group { period, signals, .. } = self.groups[group].clone();
                let group = group as u8;
                self.ask(&Ask::Watch { group, period, signals });
            }
        }
        if !self.is_up(now) {
            return;
        }
        if let Some(first) = self.signals.next(now) {
            self.ask(&Ask::Signals { first });
        }
        if let Some(first) = self.parameters.next(now) {
            self.ask(&Ask::Parameters { first });
        }
        if self.version >= KEPT
            && self.is_described()
            && let Some(first) = self.kept.next(now)
        {
            self.ask(&Ask::Kept { first });
        }
        if let Some(first) = self.pieces.as_mut().and_then(|it| it.0.next(now)) {
            let id = self.act(Action::BlackBox(first));
            self.pieces.as_mut().iter_mut().for_each(|it| it.1 = id);
        }
    }

    /// Asks for the chip's black box, from a piece on.
    pub fn fetch_black_box(&mut self, first: usize) {
        // How many pieces there are comes with the first one.
        let pieces = Table { rows: vec![None; first + 1], fresh: first, asked: None };
        self.pieces = Some((pieces, self.next_id));
    }

    /// Pieces of the black box that have come, how many there are, and why it is refused.
    pub fn black_box(&mut self) -> (&[Option<Vec<u8>>], usize, Option<String>) {
        let Some((pieces, id)) = &self.pieces else { return (&[], 0, None) };
        let refused = match self.answers.remove(id) {
            Some(Answer::Refused(why)) => Some(why),
            _ => None,
        };
        (&pieces.rows[..pieces.fresh], pieces.rows.len(), refused)
    }

    /// Asks for all parameters and kept values again.
    fn renew_parameters(&mut self) {
        self.parameters.renew();
        // How many there are comes with the first one.
        self.kept.size(self.kept.rows.len().max(1) as u16);
        self.kept.renew();
    }

    /// Takes received bytes.
    pub fn hear(&mut self, bytes: &[u8], now: Micros) {
        for body in self.frames.take(bytes, now) {
            if body.first() == Some(&0) {
                self.sample(&body);
            } else if let Ok((tell, _)) = postcard::take_from_bytes::<Tell<'_>>(&body) {
                self.on_message(tell, now);
            } else {
                self.losses.unknown += 1;
            }
        }
    }

    fn sample(&mut self, body: &[u8]) {
        let Some((head, words)) = Head::of(body) else {
            self.losses.unknown += 1;
            return;
        };
        let Some(group) = self.groups.get_mut(usize::from(head.group)) else { return };
        if words.len() != group.order.len() {
            // A sample of the signals that were watched before.
            return;
        }
        if let Some(last) = group.last {
            self.losses.samples += u64::from(head.count.wrapping_sub(last.count).wrapping_sub(1));
            group.skipped += u64::from(head.skipped.wrapping_sub(last.skipped));
        }
        group.last = Some(head);
        self.at = self.at.max(Some(Micros::new(head.at)));
        let values = words.iter().map(|word| f32::from_le_bytes(*word));
        self.samples.push(Sample {
            group: head.group.into(),
            at: Micros::new(head.at),
            values: group.order.iter().copied().zip(values).collect(),
        });
    }

    fn on_message(&mut self, tell: Tell<'_>, now: Micros) {
        match tell {
            Tell::Welcome {
                version,
                signals,
                parameters,
                at,
                changes,
                damaged,
                declaration,
                ..
            } => {
                let at = Micros::new(at);
                let before = std::mem::replace(&mut self.declaration, declaration);
                let is_anew = self.at.is_some_and(|before| at + LATE < before)
                    || before != declaration
                    || !self.is_up(now);
                if is_anew {
                    // A restarted robot, or another one.
                    self.signals.renew();
                    self.renew_parameters();
                    self.groups.iter_mut().for_each(|group| group.last = None);
                }
                self.at = if is_anew { Some(at) } else { self.at.max(Some(at)) };
                (self.heard, self.version) = (Some(now), version);
                self.damaged_there = damaged[0];
                self.signals.size(signals);
                self.parameters.size(parameters);
                if self.changes.replace(changes).is_some_and(|before| before != changes) {
                    // Changed by this PC or another one.
                    self.renew_parameters();
                }
            }
            Tell::Signal { index, topic, name, unit, states } => {
                let states = states.split(',').filter(|name| !name.is_empty());
                let signal = Signal {
                    folder: topic.folder.into(),
                    label: topic.label.into(),
                    name: name.into(),
                    unit: unit.into(),
                    states: states.map(Into::into).collect(),
                };
                self.signals.put(index, signal);
            }
            Tell::Parameter { index, topic, name, unit, range, value, initial } => {
                let parameter = Parameter {
                    index,
                    folder: topic.folder.into(),
                    label: topic.label.into(),
                    name: name.into(),
                    unit: unit.into(),
                    range,
                    value,
                    initial,
                };
                self.parameters.put(index, parameter);
            }
            Tell::Kept { index, of, id, text, value, parameter, is_used } => {
                self.kept.size(of);
                self.kept
                    .put(index, KeptValue { id, text: text.into(), value, parameter, is_used });
            }
            Tell::BlackBox { index, of, bytes } => {
                if let Some((pieces, _)) = &mut self.pieces {
                    pieces.size(of.max(1));
                    // Without bytes the memory is busy.
                    if !bytes.is_empty() {
                        pieces.put(index, bytes.to_vec());
                    }
                }
            }
            Tell::Answer { id, outcome } => {
                let answer = match outcome {
                    Outcome::Done => Answer::Done,
                    Outcome::Register(value) => Answer::Register(value),
                    Outcome::Refused { parameter, why, detail } => {
                        Answer::Refused(self.reason(parameter, why, detail))
                    }
                    _ => Answer::Refused("for a reason that this program does not know".into()),
                };
                self.urgent.retain(|it| it.id != id || answer != Answer::Done);
                if let (true, Answer::Refused(why)) = (self.commanded.contains(&id), &answer) {
                    self.refusals.push(why.clone());
                }
                // Other answers are for another program on the same line.
                if self.asked.remove(&id) {
                    self.answers.insert(id, answer);
                }
            }
            _ => self.losses.unknown += 1,
        }
    }

    /// A refusal in words, with the parameter's name.
    fn reason(&self, parameter: Option<u16>, why: &str, detail: &str) -> String {
        let row =
            parameter.and_then(|index| self.parameters.rows.get(usize::from(index))?.as_ref());
        let mut text = row.map_or_else(String::new, |row| {
            let [least, most] = row.range;
            format!("{} {} ({least} to {most}): ", row.label, row.name)
        });
        text += why;
        if !detail.is_empty() {
            text += &format!(" must be {detail}");
        }
        text
    }

    const fn next_id(&mut self) -> u16 {
        self.next_id = self.next_id.wrapping_add(1);
        self.next_id
    }

    fn id(&mut self) -> u16 {
        self.next_id();
        if self.asked.len() >= ASKED {
            self.asked.clear();
        }
        self.asked.insert(self.next_id);
        self.next_id
    }

    fn ask(&mut self, ask: &Ask) {
        self.out.extend(frame(ask));
    }
}

/// The bytes of a request.
pub fn frame(ask: &Ask) -> Vec<u8> {
    let mut frame = Writer::<{ ASK + AROUND }>::new();
    frame.message(ask);
    frame.bytes().to_vec()
}

#[cfg(test)]
mod tests {
    use rc10_link::Topic;
    use rc10_link::frame::{BEGIN, crc};

    use super::*;

    /// A frame of any body, by what its page says.
    fn raw(body: &[u8]) -> Vec<u8> {
        let [low, high] = u16::try_from(body.len()).unwrap().to_le_bytes();
        let head = [BEGIN, low, high, BEGIN ^ low ^ high ^ 0xFF];
        [&head[..], body, &crc(body).to_le_bytes()].concat()
    }

    fn encoded(tell: &Tell<'_>, more: &[u8]) -> Vec<u8> {
        let mut body = postcard::to_slice(tell, &mut [0; 256]).unwrap().to_vec();
        body.extend(more);
        raw(&body)
    }

    const fn welcome(version: u16, signals: u16, at: u64) -> Tell<'static> {
        let (parameters, changes, damaged, skipped) = (0, 0, [0; 3], 0);
        let declaration = Declaration(7);
        Tell::Welcome { version, signals, parameters, at, changes, damaged, skipped, declaration }
    }

    /// Messages and fields are only ever added: what is new is skipped, and counted.
    #[test]
    fn a_tool_of_today_reads_a_robot_of_tomorrow() {
        let (mut client, now) = (Client::new(), Micros::from_millis(10));
        client.step(now);
        client.hear(&encoded(&welcome(VERSION + 1, 1, 7), &[1, 2, 3]), now);
        assert!(client.is_up(now) && client.version() == VERSION + 1);
        let topic = Topic { folder: "motors", label: "arm" };
        let signal = Tell::Signal { index: 0, topic, name: "flux", unit: "Wb", states: "" };
        client.hear(&encoded(&signal, b"a field of tomorrow"), now);
        assert!(client.is_described());
        assert_eq!(client.signals().next().unwrap().1.name, "flux");
        // A message of tomorrow, and a sample of a shape that there is not.
        client.hear(&raw(&[200, 1, 2, 3]), now);
        client.hear(&raw(&[0, 1, 2]), now);
        assert_eq!(client.losses().unknown, 2);
        // Garbage, a damaged frame, and text around a good one.
        let mut bytes = b"armed, 11 of 11 motors online\r\n".to_vec();
        let mut damaged = encoded(&signal, &[]);
        damaged[9] ^= 0x40;
        bytes.extend(damaged);
        bytes.extend(encoded(&welcome(VERSION, 1, 8), &[]));
        client.hear(&bytes, now);
        assert_eq!((client.version(), client.losses().damaged), (VERSION, 1));
    }

    /// What is watched is said again with every second hello: a hello that is lost costs nothing, and a
    /// slow line has its peace.
    #[test]
    fn what_is_watched_is_said_again_with_every_second_hello() {
        let mut client = Client::new();
        client.watch(0, 10, [0].into_iter());
        let _ = client.take_out();
        let lengths = (1..=6).map(|at| {
            client.step(Micros::new(at * GREET.get()));
            client.take_out().len()
        });
        let hello = frame(&Ask::Hello { version: VERSION }).len();
        let is_long: Vec<_> = lengths.map(|length| length > hello).collect();
        assert_eq!(is_long, [true, true, false, true, false, true]);
    }

    #[test]
    fn an_answer_that_comes_after_hundreds_of_questions_is_no_longer_awaited() {
        let mut client = Client::new();
        let ids: Vec<_> = (0..=ASKED).map(|_| client.act(Action::Zero(0))).collect();
        for id in [ids[0], ids[ASKED]] {
            client.hear(&encoded(&Tell::Answer { id, outcome: Outcome::Done }, &[]), Micros::ZERO);
        }
        assert_eq!([ids[0], ids[ASKED]].map(|id| client.answer(id).is_some()), [false, true]);
    }

    #[test]
    fn a_robot_that_restarts_is_asked_for_everything_again() {
        let (mut client, now) = (Client::new(), Micros::from_millis(10));
        client.hear(&encoded(&welcome(VERSION, 1, 5_000_000), &[]), now);
        let topic = Topic { folder: "motors", label: "arm" };
        let signal = Tell::Signal { index: 0, topic, name: "speed", unit: "rpm", states: "" };
        client.hear(&encoded(&signal, &[]), now);
        assert!(client.is_described());
        client.hear(&encoded(&welcome(VERSION, 1, 3_000), &[]), now);
        assert!(!client.is_described());
        // What it was stays until it says otherwise.
        assert_eq!(client.signals().count(), 1);
        client.hear(&encoded(&signal, &[]), now);
        assert!(client.is_described());
        // One that is silent is gone.
        assert!(!client.is_up(Micros::from_millis(1100)));
    }
}
