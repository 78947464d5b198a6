//! The robot's own buses and motors, driven by a record instead of wires and tasks.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context as TaskContext, Poll, Waker};

use anyhow::{Context, Result, bail, ensure};
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, CanPort, Health, Submitted};
use rc10_motor::embassy::{BusPort, LineRunner, MotorPort, Rs485Port, Runner};
use rc10_motor::record::{
    ARM, BUS, BYTES, COMMAND, FAILED, FIRST_LINE, FRAME, HEALTH, KEYFRAME, LOST, OUTGOING, POLL,
    RECOVER, REQUEST, Recorded, SENT, START, STATE, TICK, TOOK, hash, print,
};
use rc10_motor::unitree::{Rs485Bus, Step};
use rc10_motor::{
    ArmSwitch, MotorBus, MotorId, MotorStatus, Request, RequestError, Response, Target, Withheld,
};
use rc10_time::Micros;

use super::difference::{Difference, What, fields};
use super::entries::{Entry, entries, name_of};
use crate::recording::sample::seconds;
use crate::robot::description::Description;
use crate::robot::motor::Place as On;
use crate::world::robot::Robot;

/// A robot that is replayed.
pub(crate) struct Engine<'r> {
    pub(crate) description: Description,
    switch: &'r ArmSwitch,
    places: Vec<Place<'r>>,
    /// What is set otherwise than in the record.
    changes: Vec<(u8, MotorId, Request)>,
    /// Nothing is compared.
    is_open: bool,
    pub(crate) told: Told,
}

/// What was replayed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Told {
    /// Ticks of all buses and lines.
    pub ticks: u64,
    /// Frames and commands of lines that are as in the record.
    pub frames: u64,
    /// Hashes of a bus's state that are as in the record.
    pub states: u64,
    /// Hash of all these hashes.
    pub hash: u64,
    /// Words that the record lacks.
    pub lost: u64,
    /// Ticks that came before the state was known: the record begins in the middle, or has a hole.
    pub unknown: u64,
    /// Time of the first tick, and of the last one.
    pub times: Option<[Micros; 2]>,
}

struct Place<'r> {
    number: u8,
    runs: Runs<'r>,
    motors: Vec<MotorId>,
    /// The state before the start, part by part, the bus's last.
    initial: Vec<Vec<u8>>,
    /// A bit for each part whose state is known.
    known: u32,
    /// Whether the state after each tick is in the record.
    is_proof: bool,
    /// Whether the changes have been asked for.
    is_changed: bool,
    /// The newest time.
    now: Micros,
    /// Requests that the next tick takes; whether each is a change.
    asked: Vec<(Asked<'r>, bool)>,
    /// Changes that have not been asked for yet.
    changes: Vec<(MotorId, Request)>,
}

type Asked<'r> = Pin<Box<dyn Future<Output = Result<Response, RequestError>> + 'r>>;

enum Runs<'r> {
    Bus(Box<Runner<'r, 'r, Port<'r>, MotorBus<'r>>>, &'r BusPort, Rc<RefCell<Feed>>),
    Line(Box<LineRunner<'r, 'r>>, &'r Rs485Port),
}

const DAMAGED: &str = "an entry cannot be read: it is damaged, or of another program";
/// How much later an earlier tick may be written.
const SKEW: Micros = Micros::from_millis(2);
/// The longest time without a tick.
const LONGEST_PAUSE: Micros = Micros::from_millis(10_000);

/// What a bus hears in a tick, and what it says.
#[derive(Default)]
struct Feed {
    frames: VecDeque<(CanFrame, Micros)>,
    health: Health,
    /// The switch's state after the bus has been looked after, if that is another one.
    arm: Option<u8>,
    /// What the port did with frames, in the record.
    outcomes: Vec<(CanFrame, u8)>,
    sent: Vec<CanFrame>,
}

/// The port to a recorded bus.
struct Port<'r>(Rc<RefCell<Feed>>, &'r ArmSwitch);

impl CanPort for Port<'_> {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.0.borrow_mut().frames.pop_front()
    }

    fn submit_as(&mut self, frame: &CanFrame, _: u32) -> Submitted {
        let mut feed = self.0.borrow_mut();
        feed.sent.push(*frame);
        let known = feed.outcomes.iter().position(|(known, _)| known == frame);
        match known.map(|at| feed.outcomes.remove(at).1) {
            Some(1) => Submitted::Replaced,
            Some(2) => Submitted::Refused,
            _ => Submitted::Queued,
        }
    }

    fn cancel_pending(&mut self) -> u8 {
        0
    }

    fn health(&self) -> Health {
        let mut feed = self.0.borrow_mut();
        if let Some(arm) = feed.arm.take() {
            self.1.replay(arm);
        }
        feed.health
    }
}

impl<'r> Engine<'r> {
    /// The robot, before its start.
    ///
    /// # Errors
    /// It has no arm switch, or its buses are not as described.
    pub(crate) fn new(robot: Robot<'r>) -> Result<Self> {
        let ports = robot.ports();
        let switch = ports.switch.context("a robot without an arm switch cannot be replayed")?;
        let (description, buses, lines) = robot.into_buses()?;
        let mut places = Vec::new();
        for ((bus, port), number) in buses.into_iter().zip(ports.buses).zip(0..) {
            let motors = bus.ids().collect();
            let feed = Rc::default();
            let can = Port(Rc::clone(&feed), switch);
            let runner = Box::new(Runner::new(can, bus, port, Micros::ZERO));
            places.push(Place::new(number, Runs::Bus(runner, port, feed), motors));
        }
        for ((line, port), number) in lines.into_iter().zip(ports.lines).zip(FIRST_LINE..) {
            let motors = line.ids().collect();
            // Of a robot that is replayed there is one in a program, or a few in a test.
            let line: &'r mut Rs485Bus<'r> = Box::leak(Box::new(line));
            let runner = Box::new(LineRunner::new(line, port, Micros::ZERO));
            places.push(Place::new(number, Runs::Line(runner, port), motors));
        }
        Ok(Self {
            description,
            switch,
            places,
            changes: Vec::new(),
            is_open: false,
            told: Told::default(),
        })
    }

    /// The fingerprint of the program, as a black box has it.
    pub(crate) fn print(&self) -> u32 {
        self.places.iter().fold(0, |sum, it| sum ^ print(it.number, it.recorded()))
    }

    /// Begins anew with changes: requests to motors of the table, of each kind the last. Nothing is compared then.
    pub(crate) fn change(&mut self, changes: Vec<(usize, Request)>) {
        let placed = |(entry, request)| {
            let (on, motor) = self.placed(entry)?;
            Some((on, motor, request))
        };
        let all: Vec<_> = changes.into_iter().filter_map(placed).collect();
        let is_last = |at: usize| {
            let (on, motor, request) = &all[at];
            let kind = std::mem::discriminant::<Request>(request);
            let mut later = all[at + 1..].iter();
            later.all(|it| (it.0, it.1, std::mem::discriminant(&it.2)) != (*on, *motor, kind))
        };
        self.changes = (0..all.len()).filter(|at| is_last(*at)).map(|at| all[at]).collect();
        (self.told, self.is_open) = (Told::default(), true);
        for place in &mut self.places {
            place.start(Micros::ZERO);
            place.known = 0;
        }
    }

    /// The effort that the loops of a motor of the table command; `None` while none decide, or that is not known.
    pub(crate) fn effort(&self, entry: usize) -> Option<f32> {
        let (on, motor) = self.placed(entry)?;
        let place = self.places.iter().find(|place| place.number == on && place.is_known())?;
        place.port(motor).look(MotorStatus::effort)
    }

    /// The place of a motor of the table, and its number there.
    fn placed(&self, entry: usize) -> Option<(u8, MotorId)> {
        let on = match self.description.motors.get(entry)?.on {
            On::Bus(number) => number - 1,
            On::Line(number) => FIRST_LINE + number - 1,
        };
        Some((on, self.description.number(entry)?))
    }

    /// Runs all of a record, up to the first difference. `look` is told the time of each half of a tick before it begins,
    /// and whether to go on.
    ///
    /// # Errors
    /// The record has a place that the robot does not have, or something of `look`.
    pub(crate) fn run(
        &mut self,
        words: &[u32],
        mut look: impl FnMut(&Self, Micros) -> Result<bool>,
    ) -> Result<Option<Difference>> {
        let mut groups: Vec<Vec<Entry<'_>>> = vec![Vec::new(); self.places.len()];
        let mut first: Option<Difference> = None;
        let mut newest = Micros::ZERO;
        for entry in entries(words) {
            if entry.kind == LOST {
                self.told.lost += u64::from(entry.word(0));
                groups.iter_mut().for_each(Vec::clear);
                self.places.iter_mut().for_each(|it| (it.known, it.is_changed) = (0, false));
                continue;
            }
            let at = self.places.iter().position(|place| place.number == entry.place);
            let name = || name_of(entry.place);
            let Some(at) = at.filter(|_| entry.is_well_formed()) else {
                let (now, kind, name) = (seconds(newest), entry.kind, name());
                bail!(
                    "behind {now} s: an entry of kind {kind} of {name}: it is damaged, or of another robot"
                );
            };
            if entry.kind == START {
                newest = Micros::ZERO;
            }
            if entry.kind == TICK {
                let time = Micros::new(entry.long(0));
                // A line's tick may have been interrupted before it was written.
                let follows = newest - newest.min(SKEW)..=newest + LONGEST_PAUSE;
                let (now, then) = (seconds(newest), seconds(time));
                ensure!(
                    newest == Micros::ZERO || follows.contains(&time),
                    "behind {now} s: the next tick is at {then} s: it is damaged"
                );
                newest = time;
            }
            if !matches!(entry.kind, START | TICK | POLL | BYTES | FAILED) {
                // What comes before the first begin is the end of something that is not there.
                if !groups[at].is_empty() {
                    groups[at].push(entry);
                }
                continue;
            }
            let group = std::mem::replace(&mut groups[at], vec![entry]);
            // A restart: what it interrupted may not be whole, and is no more.
            if let Some(&begin) = group.first().filter(|it| entry.kind != START || it.kind == START)
            {
                if begin.kind == TICK && !look(self, Micros::new(begin.long(0)))? {
                    return Ok(first);
                }
                let now = self.places[at].now;
                let done = self.group(at, &group, &mut first);
                done.with_context(|| format!("behind {} s", seconds(now)))?;
                if first.as_ref().is_some_and(Difference::is_settled) {
                    return Ok(first);
                }
            }
        }
        for (at, group) in groups.iter().enumerate() {
            // The last one may not be whole: of a crash there is only its begin.
            let has = |kinds: &[u8]| group.iter().any(|it| kinds.contains(&it.kind));
            let is_whole = has(&[STATE, KEYFRAME]) || has(&[TOOK]) && !has(&[SENT]);
            if is_whole || group.first().is_some_and(|it| it.kind != TICK) {
                self.group(at, group, &mut first)?;
            }
        }
        Ok(first)
    }

    /// The status of a motor, as its port has it.
    pub(crate) fn port(&self, entry: usize) -> Option<MotorPort<'r>> {
        let (on, motor) = self.placed(entry)?;
        self.places.iter().find(|place| place.number == on).map(|place| place.port(motor))
    }

    fn group(
        &mut self,
        at: usize,
        group: &[Entry<'_>],
        first: &mut Option<Difference>,
    ) -> Result<()> {
        let Self { places, switch, changes, told, is_open, .. } = self;
        let is_open = *is_open;
        let place = &mut places[at];
        let Some(begin) = group.first() else { return Ok(()) };
        let number = place.number;
        let own = changes.iter().filter(|it| it.0 == number);
        if begin.kind == START {
            place.start(Micros::new(begin.long(0)));
            return Ok(());
        }
        let is_known = place.is_known();
        if is_known && begin.kind == TICK && !std::mem::replace(&mut place.is_changed, true) {
            place.changes = own.clone().map(|it| (it.1, it.2)).collect();
        }
        let before = place.ticks();
        let found = match begin.kind {
            TICK => {
                let now = Micros::new(begin.long(0));
                place.now = now;
                let times = told.times.get_or_insert([now; 2]);
                times[1] = times[1].max(now);
                switch.replay(begin.more);
                let is_set_otherwise = |motor: MotorId, request: &Request| {
                    own.clone().any(|(_, other, change)| {
                        let is_same_kind =
                            std::mem::discriminant(change) == std::mem::discriminant(request);
                        *other == motor && is_same_kind
                    })
                };
                // Its clock is not known either: a half of a tick that takes is the first one.
                if !place.knows(BUS) && group.iter().any(|it| it.kind == TOOK) {
                    place.recorded_mut().start_at(now + Micros::new(60));
                }
                place.given(group, is_set_otherwise)?;
                place.tick(group, told)?
            }
            POLL => place.poll(begin, told),
            BYTES => {
                let bytes = begin.bytes(1);
                let now = place.time(begin.word(0));
                if let Runs::Line(runner, _) = &mut place.runs {
                    runner.hear(&bytes[..usize::from(begin.more).min(bytes.len())], now);
                }
                None
            }
            _ => {
                if let Runs::Line(runner, _) = &mut place.runs {
                    runner.failed();
                }
                None
            }
        };
        if place.ticks() != before {
            told.ticks += 1;
            told.unknown += u64::from(!is_known);
        }
        let mut found: Vec<What> = found.into_iter().filter(|_| !is_open).collect();
        let has_state = group.iter().any(|it| it.kind == STATE);
        if place.is_proof && place.ticks() != before && !has_state {
            found.push(What::Untold);
        }
        place.is_proof |= has_state;
        for entry in group {
            match entry.kind {
                STATE if is_known && !is_open => {
                    let mut motors = Vec::new();
                    let state = place.recorded();
                    let own = hash(state, |motor, own| {
                        if own != entry.word(usize::from(motor) + 2) {
                            motors.push(motor);
                        }
                    });
                    if own == entry.long(0) && motors.is_empty() {
                        told.states += 1;
                        told.hash = (told.hash ^ own).wrapping_mul(0x0100_0000_01B3);
                    } else {
                        if motors.is_empty() {
                            motors.push(BUS);
                        }
                        found.push(What::State(motors));
                    }
                }
                KEYFRAME if !(is_open && place.knows(entry.more)) => {
                    let (bytes, part) = (entry.bytes(0), entry.more);
                    // What is not known yet sends what it likes, and the bus counts it.
                    let is_compared = !place.know(part) && (part != BUS || is_known);
                    let state = place.recorded_mut();
                    let own = saved(state, part);
                    let is_same = |rest: &[u8]| rest.iter().all(|byte| *byte == 0);
                    if bytes.strip_prefix(own.as_slice()).is_some_and(is_same) {
                        told.states += u64::from(is_compared);
                        continue;
                    }
                    let before = shown(state, part);
                    ensure!(
                        state.load(part, &bytes),
                        "a state of {} in it cannot be read: it is of another program",
                        name_of(place.number)
                    );
                    let differs = fields(&shown(state, part), &before);
                    if part == BUS
                        && let Runs::Bus(runner, _, feed) = &place.runs
                    {
                        feed.borrow_mut().health = runner.health();
                    }
                    if !is_compared {
                        continue;
                    }
                    let news = Difference::new(place.now, place.ticks(), place.number, found);
                    found = Vec::new();
                    let first = first.get_or_insert(news);
                    if first.found.is_empty() {
                        first.found.push(What::State(vec![part]));
                    }
                    if first.place == place.number {
                        first.explain(part, differs);
                    }
                }
                _ => {}
            }
        }
        if !found.is_empty() && first.is_none() {
            *first = Some(Difference::new(place.now, place.ticks(), place.number, found));
        }
        Ok(())
    }
}

/// A part's state as a text.
fn shown(state: &dyn Recorded, part: u8) -> String {
    let mut text = String::new();
    let _ = state.show(part, &mut text);
    text
}

/// The frame of three words.
fn frame(words: [u32; 3], len: u8) -> Option<CanFrame> {
    let [key, low, high] = words;
    let mut data = [0; 8];
    data[..4].copy_from_slice(&low.to_le_bytes());
    data[4..].copy_from_slice(&high.to_le_bytes());
    let number = key & 0x3FFF_FFFF;
    let id = if key >> 31 != 0 {
        Id::Extended(ExtendedId::new(number)?)
    } else {
        Id::Standard(StandardId::new(number.try_into().ok()?)?)
    };
    let len = usize::from(len & 0xF);
    if key >> 30 & 1 != 0 {
        CanFrame::remote_frame(id, len).ok()
    } else {
        CanFrame::data_frame(id, data.get(..len)?).ok()
    }
}

impl<'r> Place<'r> {
    fn new(number: u8, runs: Runs<'r>, motors: Vec<MotorId>) -> Self {
        let mut place = Self {
            number,
            runs,
            motors,
            initial: Vec::new(),
            known: 0,
            is_proof: false,
            is_changed: false,
            now: Micros::ZERO,
            asked: Vec::new(),
            changes: Vec::new(),
        };
        place.initial = place.parts().map(|part| saved(place.recorded(), part)).collect();
        place
    }

    /// The numbers of its parts, the bus's last.
    fn parts(&self) -> impl Iterator<Item = u8> + use<> {
        (0..self.motors.len() as u8).chain([BUS])
    }

    fn recorded(&self) -> &dyn Recorded {
        match &self.runs {
            Runs::Bus(runner, ..) => &**runner,
            Runs::Line(runner, _) => &**runner,
        }
    }

    fn recorded_mut(&mut self) -> &mut dyn Recorded {
        match &mut self.runs {
            Runs::Bus(runner, ..) => &mut **runner,
            Runs::Line(runner, _) => &mut **runner,
        }
    }

    fn port(&self, motor: MotorId) -> MotorPort<'r> {
        match &self.runs {
            Runs::Bus(_, port, _) => port.motor(motor),
            Runs::Line(_, port) => port.motor(motor),
        }
    }

    fn ticks(&self) -> u32 {
        match &self.runs {
            Runs::Bus(_, port, _) => port.ticks(),
            Runs::Line(_, port) => port.ticks(),
        }
    }

    fn is_known(&self) -> bool {
        self.known == (1 << (self.motors.len() + 1)) - 1
    }

    fn knows(&self, part: u8) -> bool {
        self.known >> usize::from(part).min(self.motors.len()) & 1 != 0
    }

    /// A part's state is known from here on; whether it was not before.
    fn know(&mut self, part: u8) -> bool {
        let bit = 1 << usize::from(part).min(self.motors.len());
        let is_new = self.known & bit == 0;
        self.known |= bit;
        is_new
    }

    /// Begins, as at power-on.
    fn start(&mut self, first: Micros) {
        let initial = std::mem::take(&mut self.initial);
        for (part, state) in self.parts().zip(&initial) {
            self.recorded_mut().load(part, state);
            self.know(part);
        }
        self.initial = initial;
        (self.now, self.is_changed, self.is_proof) = (first, false, false);
        self.recorded_mut().start_at(first);
        if let Runs::Bus(.., feed) = &self.runs {
            feed.take();
        }
    }

    /// The time of a low word.
    fn time(&self, low: u32) -> Micros {
        let ahead = low.wrapping_sub(self.now.get() as u32).cast_signed();
        Micros::new(self.now.get().saturating_add_signed(ahead.into()))
    }

    /// Makes a request, as a task does, and keeps it until the bus has taken it.
    fn ask(&mut self, motor: MotorId, request: Request, is_change: bool) {
        let port = self.port(motor);
        let mut asked: Asked<'r> = Box::pin(async move { port.request(request).await });
        if asked.as_mut().poll(&mut TaskContext::from_waker(Waker::noop())).is_pending() {
            self.asked.push((asked, is_change));
        }
    }

    /// What was asked for has been taken; fails if a change was refused.
    fn settle(&mut self) -> Result<()> {
        let mut context = TaskContext::from_waker(Waker::noop());
        for (mut asked, is_change) in self.asked.drain(..) {
            if let (Poll::Ready(Err(error)), true) = (asked.as_mut().poll(&mut context), is_change)
            {
                bail!("what is to be set is refused: {error}");
            }
        }
        // A bus takes four at once, and may have been given some.
        if self.asked.is_empty()
            && let Some((motor, request)) = self.changes.pop()
        {
            self.ask(motor, request, true);
        }
        Ok(())
    }

    /// Puts into the mail what tasks had put there.
    fn given(
        &mut self,
        group: &[Entry<'_>],
        is_set_otherwise: impl Fn(MotorId, &Request) -> bool,
    ) -> Result<()> {
        for entry in group {
            let Some(&motor) = self.motors.get(usize::from(entry.more)) else { continue };
            let bytes = entry.bytes(0);
            match entry.kind {
                COMMAND => {
                    let ((target, withheld), _): ((Target, Withheld), _) =
                        postcard::take_from_bytes(&bytes).context(DAMAGED)?;
                    // It was taken when it was recorded; what the motor refuses it counts again.
                    let _ = self.port(motor).command_within(target, withheld);
                }
                REQUEST => {
                    let (request, _) = postcard::take_from_bytes(&bytes).context(DAMAGED)?;
                    if !is_set_otherwise(motor, &request) {
                        self.ask(motor, request, false);
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A half of a tick; what it sends otherwise than in the record.
    fn tick(&mut self, group: &[Entry<'_>], told: &mut Told) -> Result<Option<What>> {
        let now = self.now;
        let took = group.iter().find(|it| it.kind == TOOK).map_or(0, |it| it.word(0));
        let feed = match &mut self.runs {
            Runs::Line(runner, _) => {
                runner.tick(now);
                return self.settle().map(|()| None);
            }
            Runs::Bus(_, _, feed) => Rc::clone(feed),
        };
        let (mut expected, mut outgoing) = (Vec::new(), Vec::new());
        {
            let mut feed = feed.borrow_mut();
            (feed.arm, feed.sent) = (None, Vec::new());
            feed.outcomes.clear();
            feed.frames.clear();
            for entry in group {
                let words = |at: usize| [entry.word(at), entry.word(at + 1), entry.word(at + 2)];
                match entry.kind {
                    FRAME => {
                        let at = self.time(entry.word(0));
                        feed.frames.push_back((frame(words(1), entry.more).context(DAMAGED)?, at));
                    }
                    HEALTH => {
                        let bytes = entry.bytes(0);
                        (feed.health, _) = postcard::take_from_bytes(&bytes).context(DAMAGED)?;
                    }
                    ARM => feed.arm = Some(entry.more),
                    SENT | OUTGOING => {
                        let frame = frame(words(0), entry.more).context(DAMAGED)?;
                        feed.outcomes.push((frame, entry.more >> 4));
                        if entry.kind == SENT {
                            expected.push(frame);
                        } else {
                            outgoing.push(frame);
                        }
                    }
                    _ => {}
                }
            }
        }
        let Runs::Bus(runner, port, _) = &mut self.runs else { return Ok(None) };
        if group.iter().any(|it| it.kind == RECOVER) {
            port.recover();
        }
        for frame in &outgoing {
            let _ = port.send(frame);
        }
        // The first look is at the begin, the other one behind the work.
        let looks = Cell::new(0);
        runner.tick(|| {
            let is_first = looks.replace(looks.get() + 1) == 0;
            if is_first { now } else { now + Micros::new(took.into()) }
        });
        // A half that only sends takes none.
        if group.iter().any(|it| it.kind == TOOK) {
            self.settle()?;
        }
        if !self.is_known() || !self.is_proof {
            return Ok(None);
        }
        let sent = std::mem::take(&mut feed.borrow_mut().sent);
        let own = sent.get(..expected.len().min(sent.len())).unwrap_or_default();
        Ok(match expected.iter().zip(own).find(|(theirs, own)| theirs != own) {
            Some((theirs, own)) => Some(What::Frame(*theirs, *own)),
            None if own.len() < expected.len() => Some(What::Missing(expected[own.len()])),
            None => {
                told.frames += expected.len() as u64;
                None
            }
        })
    }

    /// A poll of a line.
    fn poll(&mut self, begin: &Entry<'_>, told: &mut Told) -> Option<What> {
        let (now, is_known) = (self.time(begin.word(0)), self.is_known());
        let Runs::Line(runner, _) = &mut self.runs else { return None };
        let own = match runner.poll(now) {
            Step::Send(command) => command.to_vec(),
            Step::Wait(_) => Vec::new(),
        };
        let theirs = begin.bytes(1);
        let is_same = theirs.len() == own.len().next_multiple_of(4) && theirs.starts_with(&own);
        told.frames += u64::from(is_same && !own.is_empty());
        (is_known && !is_same).then_some(What::Command(theirs, own))
    }
}

fn saved(state: &dyn Recorded, part: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    state.save(part, &mut |piece| bytes.extend(piece));
    bytes
}
