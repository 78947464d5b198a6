//! Two boards of one robot on one CAN bus or one UART: topics between them, and one arm state.
//!
//! [`Boards`] is declared once for both: the bus on each board, and the topics. When it is compiled, the identifiers are
//! chosen by the response times of all frames on that bus: as late in the arbitration as they may be. Over a UART the bytes
//! are counted instead ([`Boards::over_uart`]). One board [leads](Role::Leads): it has the remote. The other one follows its arm state, and stops, suspended and disarmed, when it no
//! longer hears it. A stop of one stops both.
//!
//! ```
//! use rc10_tasks::boards::{Boards, Peer, Role, Topic};
//! use rc10_time::Micros;
//!
//! /// Twist of the base: m/s forward, m/s to the left, rad/s.
//! const DRIVE: Topic<[f32; 3]> = Topic::new(1, Role::Leads, Micros::from_millis(10));
//! /// Yaw rate of the chassis, rad/s.
//! const YAW_RATE: Topic<f32> = Topic::new(2, Role::Follows, Micros::from_millis(5));
//! const BOARDS: Boards = Boards::new([(&[], 2), (&[], 1)], &[DRIVE.entry(), YAW_RATE.entry()]);
//!
//! let chassis = Peer::new();
//! chassis.tell(&DRIVE, &[0.5, 0.0, 0.0]).unwrap();
//! ```

#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of seven topics, of 28 bytes, of periods, and counts modulo 256"
)]

use core::cell::RefCell;
use core::marker::PhantomData;

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Ticker, with_timeout};
use embedded_io_async::{Read, Write};
use rc10_can::embedded_can::{Id, StandardId};
use rc10_can::{CanFrame, IdPattern};
use rc10_link::frame::{self, AROUND, FromBoard};
use rc10_message::{Stamped, now};
use rc10_module::remote::RemoteLink;
use rc10_module::{Reception, Stream};
use rc10_motor::__declaration::late;
use rc10_motor::embassy::{Filter, Received};
use rc10_motor::plan::{Extra, Plan};
use rc10_motor::{CanIds, Device, Entry, Frames, Names, Place, Rate, Wiring};
use rc10_time::Micros;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::common::Common;

mod bond;
mod parts;

pub use bond::{BEAT, LOST, Link, SILENCE};
use bond::{Beat, Bond};
pub use parts::LONGEST;
use parts::{Incoming, Outgoing};

/// Most topics between two boards, both ways together; they are numbered from 1 on.
pub const MOST: usize = 7;
/// Identifiers that they take: four for each topic, and those of the arm states.
const IDS: u16 = 4 * (MOST as u16 + 1);
/// The latest end of a frame between the boards, µs: with a millisecond until it is noticed, one until it leaves and one until
/// it is taken a change of the arm state is there within five.
const LATEST: u32 = 2000;
/// The same over a UART: a board that sends as much itself takes it as much later.
const LATEST_OVER_UART: u64 = 1500;
/// A UART takes what a board tells at once within this time.
const TAKES: Duration = Duration::from_millis(2);
/// Bits of a byte on a UART.
const BITS: u64 = 10;
/// Bytes of a topic's frame on a UART: its place and eight of data.
const PART: usize = 2 + parts::BYTES + AROUND;
/// Data bytes of a frame with an arm state.
const BEAT_LEN: usize = 7;
/// Most frames of one board's topics: with its arm state they have room in the outbox of a bus at once.
const FRAMES: usize = 12;

/// What a board is to the other one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Role {
    /// It has the remote, and arms.
    Leads,
    /// It has the arm state of the other one.
    Follows,
}

/// A value that one board tells the other: a number, an array, or what else [serde](https://serde.rs) knows.
#[derive(Clone, Copy, Debug)]
pub struct Topic<T> {
    entry: TopicEntry,
    of: PhantomData<fn() -> T>,
}

/// A topic in the declaration.
#[derive(Clone, Copy, Debug)]
pub struct TopicEntry {
    number: u8,
    from: Role,
    period: Micros,
    size: usize,
}

impl<T> Topic<T> {
    /// A topic with its number, the board that tells it, and the shortest time from one value to the next, whole
    /// milliseconds: what is told more often is told as its newest.
    pub const fn new(number: u8, from: Role, period: Micros) -> Self {
        assert!(
            number >= 1 && number as usize <= MOST,
            "topics of two boards are numbered from 1 to 7"
        );
        assert!(
            size_of::<T>() <= LONGEST,
            "a value of a topic has at most 28 bytes: make two topics of it"
        );
        let entry = TopicEntry { number, from, period, size: size_of::<T>() };
        Self { entry, of: PhantomData }
    }

    /// Its line of the declaration.
    #[must_use]
    pub const fn entry(&self) -> TopicEntry {
        self.entry
    }
}

impl TopicEntry {
    /// Frames of a value.
    const fn parts(&self) -> usize {
        let parts = self.size.div_ceil(parts::BYTES);
        if parts == 0 { 1 } else { parts }
    }
}

/// The declaration of two boards on one bus or UART, the same on both.
#[derive(Clone, Copy, Debug)]
pub struct Boards {
    /// The first identifier.
    first: u16,
    /// The bus of each, of the leading one first.
    buses: [u8; 2],
    /// Bits a second of the UART, if it is one.
    baud: Option<u32>,
    topics: &'static [TopicEntry],
    declaration: u16,
}

/// First identifiers, the least urgent first: behind all motors of standard identifiers, between, before DJI's feedback and
/// commands, before most.
const FIRSTS: [u16; 5] = [0x7C0, 0x6C0, 0x3C0, 0x1C0, 0x0C0];

impl Boards {
    /// Two boards: motors and bus number of the leading one and of the following one, as `(Name::ENTRIES, 2)`, and all topics.
    ///
    /// # Panics
    /// In a `const` a compile error: topics are not numbered 1 to 7, each once, or their periods are no whole
    /// milliseconds; the motors of both clash on the bus; or there are no identifiers by which the arm state arrives within two
    /// milliseconds, each topic within its period, and each motor's command within its tick.
    pub const fn new(motors: [(&[Entry<Device>], u8); 2], topics: &'static [TopicEntry]) -> Self {
        let declaration = checked(topics);
        let [(leader, leaders), (follower, followers)] = motors;
        assert!(leaders >= 1 && followers >= 1, "buses count from 1");
        let both = [(leader, Place::Bus(leaders)), (follower, Place::Bus(followers))];
        let Some(plan) = Plan::of_both(both, Extra { errors: 0, set_up: false }) else {
            panic!("a motor of each board has the same identifier on the bus that both are on");
        };
        let mut at = 0;
        while at < FIRSTS.len() {
            if is_in_time(plan, [leader, follower], FIRSTS[at], topics) {
                let (first, buses) = (FIRSTS[at], [leaders, followers]);
                return Self { first, buses, baud: None, topics, declaration };
            }
            at += 1;
        }
        panic!(
            "the topics do not fit on the bus of both boards: at their identifiers they or a motor's command come too late"
        )
    }

    /// Two boards on a UART of each, 8N1 of these bits a second.
    ///
    /// # Panics
    /// In a `const` a compile error: topics as in [`new`](Self::new); or an arm state arrives later than 1.5 milliseconds,
    /// behind all that its board tells.
    pub const fn over_uart(baud: u32, topics: &'static [TopicEntry]) -> Self {
        let declaration = checked(topics);
        assert!(
            is_in_time_over_uart(baud, topics, Role::Leads)
                && is_in_time_over_uart(baud, topics, Role::Follows),
            "the topics do not fit on the UART of both boards: at this baud rate an arm state comes later than 1.5 ms"
        );
        Self { first: FIRSTS[0], buses: [0; 2], baud: Some(baud), topics, declaration }
    }

    /// Bits a second of the UART between them, unless they are on a bus.
    #[must_use]
    pub const fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// The first of their identifiers, of 32.
    #[must_use]
    pub const fn first(&self) -> u16 {
        self.first
    }

    /// The bus that both are on, as the board in a role counts, and as the other one does; `None` on a UART.
    #[must_use]
    pub const fn buses(&self, role: Role) -> Option<[u8; 2]> {
        let [leader, follower] = self.buses;
        match (self.baud, role) {
            (Some(_), _) => None,
            (None, Role::Leads) => Some([leader, follower]),
            (None, Role::Follows) => Some([follower, leader]),
        }
    }

    /// A plan of that bus with the frames between the boards, if they are on one.
    pub const fn in_plan(&self, motors: Plan) -> Plan {
        if self.baud.is_some() {
            return motors;
        }
        with_frames(motors, self.first, self.topics)
    }

    fn pattern(&self) -> IdPattern {
        IdPattern::standard(self.first).under(!u32::from(IDS - 1))
    }

    fn frame(&self, place: u8, data: &[u8]) -> Option<CanFrame> {
        let id = StandardId::new(self.first + u16::from(place))?;
        CanFrame::data_frame(id, data).ok()
    }
}

/// Checks topics, and makes their hash.
const fn checked(topics: &[TopicEntry]) -> u16 {
    assert!(topics.len() <= MOST, "two boards have at most 7 topics");
    let (mut at, mut frames) = (0, [0; 2]);
    let mut declaration = 0x811C_9DC5_u32;
    while at < topics.len() {
        let TopicEntry { number, from, period, size } = topics[at];
        assert!(
            period.get() >= 1000 && period.get().is_multiple_of(1000),
            "the period of a topic is at least 1 ms, and whole milliseconds"
        );
        frames[from as usize] += topics[at].parts();
        assert!(
            frames[from as usize] <= FRAMES,
            "the topics of one board have at most 12 frames together, each of 7 bytes"
        );
        let mut other = 0;
        while other < at {
            assert!(topics[other].number != number, "two topics have the same number");
            other += 1;
        }
        let numbers = [number as u32, from as u32, (period.get() / 1000) as u32, size as u32];
        let mut byte = 0;
        while byte < numbers.len() {
            declaration = (declaration ^ numbers[byte]).wrapping_mul(0x0100_0193);
            byte += 1;
        }
        at += 1;
    }
    (declaration ^ declaration >> 16) as u16
}

/// Whether all that a board has to tell leaves a UART in time. What has come in some milliseconds, less what has left
/// meanwhile, is before the frame that comes at their end; a topic may be one millisecond early, an arm state four.
const fn is_in_time_over_uart(baud: u32, topics: &[TopicEntry], role: Role) -> bool {
    let mut millis = 0_u64;
    while millis < 1000 {
        let mut bytes = (millis.div_ceil(BEAT.get() / 1000) + 1) * (1 + BEAT_LEN + AROUND) as u64;
        let mut at = 0;
        while at < topics.len() {
            if topics[at].from as usize == role as usize {
                let values = (millis + 1) / (topics[at].period.get() / 1000) + 1;
                bytes += values * (topics[at].parts() * PART) as u64;
            }
            at += 1;
        }
        let (needed, gone) = (bytes * BITS * 1_000_000, millis * 1000 * baud as u64);
        if needed <= gone {
            return true;
        }
        if needed > gone + LATEST_OVER_UART * baud as u64 {
            return false;
        }
        millis += 1;
    }
    false
}

/// A plan with the frames between two boards behind those of its motors: two arm states, then topics.
const fn with_frames(plan: Plan, first: u16, topics: &[TopicEntry]) -> Plan {
    // An arm state that changes is told at once: two within a period.
    let (mut plan, beat) = (plan, BEAT.get() as u32);
    let mut at = 0;
    while at < 2 {
        let frames = Frames::new(IdPattern::standard(first + at), BEAT_LEN as u8, Rate::Rare);
        plan = plan.and(frames, beat, beat - 1000);
        at += 1;
    }
    let mut topic = 0;
    while topic < topics.len() {
        let mut part = 0;
        while part < topics[topic].parts() {
            let id = first + 4 * topics[topic].number as u16 + part as u16;
            let frames = Frames::new(IdPattern::standard(id), 8, Rate::Rare);
            plan = plan.and(frames, topics[topic].period.get() as u32, 1000);
            part += 1;
        }
        topic += 1;
    }
    plan.settled()
}

/// Whether all is in time with topics at these identifiers, and no motor has one of them.
const fn is_in_time(
    motors: Plan,
    [leader, follower]: [&[Entry<Device>]; 2],
    first: u16,
    topics: &[TopicEntry],
) -> bool {
    let ids = IdPattern::standard(first).under(!(IDS as u32 - 1));
    let between = CanIds::new().receives(Frames::new(ids, 8, Rate::Rare));
    let mut at = 0;
    while at < leader.len() + follower.len() {
        let entry = if at < leader.len() { &leader[at] } else { &follower[at - leader.len()] };
        // Also of another bus: one candidate less does no harm.
        if let Wiring::Can(motor) = entry.config.wiring()
            && motor.clash(&between).is_some()
        {
            return false;
        }
        at += 1;
    }
    let of_motors = motors.sorts().len();
    let (plan, mut sort) = (with_frames(motors, first, topics), 0);
    while sort < plan.sorts().len() {
        let is_late = if sort < of_motors {
            let motor = plan.sorts()[sort].motor;
            let entry =
                if motor < leader.len() { &leader[motor] } else { &follower[motor - leader.len()] };
            late(&plan, sort, entry.most_age).is_some()
        } else {
            // From when it was due: an arm state that changes counts as one that is four milliseconds early.
            match plan.response(sort) {
                Some(time) => time > plan.period(sort) - 1000 + LATEST,
                None => true,
            }
        };
        if is_late {
            return false;
        }
        sort += 1;
    }
    true
}

/// Why a value is not told. Of whole numbers the form on the wire is up to an eighth longer than their size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TellError {
    /// Its form on the wire is longer than its size said.
    #[error("the value takes more bytes than its topic has frames for")]
    TooLong,
    /// The other board tells this topic.
    #[error("the other board tells this topic")]
    NotOurs,
}

/// The other board, as a robot's tasks see it: a field of what they share.
pub struct Peer(Mutex<CriticalSectionRawMutex, RefCell<State>>);

struct State {
    role: Option<Role>,
    outgoing: [Outgoing; MOST],
    incoming: [Incoming; MOST],
    link: Link,
    other: Option<Beat>,
    unsent: u32,
}

impl Default for Peer {
    fn default() -> Self {
        Self::new()
    }
}

impl Peer {
    /// One that has heard nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(RefCell::new(State {
            role: None,
            outgoing: [const { Outgoing::NEW }; MOST],
            incoming: [const { Incoming::NEW }; MOST],
            link: Link::Lost,
            other: None,
            unsent: 0,
        })))
    }

    fn with<R>(&self, work: impl FnOnce(&mut State) -> R) -> R {
        self.0.lock(|state| work(&mut state.borrow_mut()))
    }

    /// Tells the other board a value, in place of one that has not left yet: within a millisecond, if the topic's period
    /// is over.
    ///
    /// # Errors
    /// [`TellError`]; the value before stays.
    pub fn tell<T: Serialize>(&self, topic: &Topic<T>, value: &T) -> Result<(), TellError> {
        let mut bytes = [0; LONGEST];
        let most = (topic.entry.parts() * parts::BYTES).min(LONGEST);
        let used = postcard::to_slice(value, &mut bytes[..most]);
        let used = used.map_err(|_| TellError::TooLong)?.len();
        self.with(|state| {
            if state.role.is_some_and(|role| role != topic.entry.from) {
                return Err(TellError::NotOurs);
            }
            let place = state.outgoing.get_mut(usize::from(topic.entry.number) - 1);
            place.ok_or(TellError::NotOurs)?.set(&bytes[..used]);
            Ok(())
        })
    }

    /// The newest value that the other board told, and when its last frame came.
    pub fn read<T: DeserializeOwned>(&self, topic: &Topic<T>) -> Option<Stamped<T>> {
        let place = usize::from(topic.entry.number) - 1;
        let incoming = self.with(|state| state.incoming.get(place).copied())?;
        let (bytes, at) = incoming.newest()?;
        Some(Stamped { value: postcard::from_bytes(bytes).ok()?, at })
    }

    /// The newest value, if it is not older.
    pub fn newer_than<T: DeserializeOwned>(
        &self,
        topic: &Topic<T>,
        age: Micros,
        now: Micros,
    ) -> Option<T> {
        let Stamped { value, at } = self.read(topic)?;
        (now.since(at) <= age).then_some(value)
    }

    /// Values of a topic that did not come, or not whole.
    pub fn lost<T>(&self, topic: &Topic<T>) -> u32 {
        self.with(|state| {
            state.incoming.get(usize::from(topic.entry.number) - 1).map_or(0, Incoming::lost)
        })
    }

    /// Frames that found no room in the outbox of the bus, and times that the UART took none.
    pub fn unsent(&self) -> u32 {
        self.with(|state| state.unsent)
    }

    /// Whether the other board is heard.
    pub fn link(&self) -> Link {
        self.with(|state| state.link)
    }

    /// The other board's arm state, as long as it is heard.
    pub fn arm(&self) -> Option<rc10_motor::ArmState> {
        self.with(|state| state.other.filter(|_| state.link == Link::Online)).map(|beat| beat.state)
    }

    /// Speaks with the other board over their bus, for ever: a task of the robot. That of the following board is the board's
    /// hand at the arm switch, in place of a remote's.
    ///
    /// # Panics
    /// All subscriptions of the bus are taken, the robot does not have it, or the boards are on a UART.
    pub async fn run<N: Names, OWN>(
        &self,
        shared: &Common<'_, N, OWN>,
        boards: &Boards,
        role: Role,
    ) -> ! {
        let buses = boards.buses(role).expect("boards on a UART speak by `run_over`");
        let bus = &shared.ports.buses[usize::from(buses[0]) - 1];
        let frames = bus.subscribe(Filter::Pattern(boards.pattern()));
        let mut frames = frames.expect("a bus has four subscriptions, and all are taken");
        let mut bond = self.begin(boards, role, shared);
        let mut ticker = Ticker::every(Duration::from_millis(1));
        loop {
            let heard = select(frames.next(), ticker.next()).await;
            if let Either::First(Received { frame, at }) = heard
                && let Id::Standard(id) = frame.id()
                && let Ok(place) = u8::try_from(id.as_raw().wrapping_sub(boards.first))
            {
                self.hear(boards, &mut bond, place, frame.bytes(), at);
            }
            self.turn(boards, &mut bond, shared, |place, data| {
                boards.frame(place, data).is_some_and(|frame| bus.send(&frame).is_ok())
            });
        }
    }

    /// The same over a UART: a `serial` of the declaration is listened to by it. Damaged frames, bytes between frames and
    /// errors of the port are counted in `reception`; what the port does not take within two milliseconds, in
    /// [`unsent`](Self::unsent).
    ///
    /// # Panics
    /// If they are declared for a bus.
    pub async fn run_over<N: Names, OWN>(
        &self,
        shared: &Common<'_, N, OWN>,
        boards: &Boards,
        role: Role,
        reception: &Reception,
        port: impl Read + Write,
    ) -> ! {
        assert!(boards.baud.is_some(), "boards on a bus speak by `run`");
        let mut port = port;
        let mut bond = self.begin(boards, role, shared);
        let (mut stream, mut bytes) = (Stream::new(FromBoard), [0; 64]);
        let mut ticker = Ticker::every(Duration::from_millis(1));
        loop {
            match select(port.read(&mut bytes), ticker.next()).await {
                Either::First(Ok(count)) if count > 0 => {
                    let at = now();
                    stream.receive(&bytes[..count], at, |(place, data)| {
                        self.hear(boards, &mut bond, place, &data, at);
                    });
                }
                Either::First(_) => {
                    stream.interrupt();
                    // A port that always fails does not keep the processor busy.
                    ticker.next().await;
                }
                Either::Second(()) => {}
            }
            reception.write(stream.counters());
            let mut told = heapless::Vec::<u8, { (FRAMES + 1) * PART }>::new();
            self.turn(boards, &mut bond, shared, |place, data| {
                told.extend_from_slice(frame::of_board(place, data).bytes()).is_ok()
            });
            // A port that does not take it keeps no stop from being heard.
            let took = with_timeout(TAKES, port.write_all(&told)).await;
            if !matches!(took, Ok(Ok(()))) {
                self.with(|state| state.unsent = state.unsent.saturating_add(1));
            }
        }
    }

    fn begin<N: Names, OWN>(
        &self,
        boards: &Boards,
        role: Role,
        shared: &Common<'_, N, OWN>,
    ) -> Bond {
        self.with(|state| state.role = Some(role));
        Bond::new(role, boards.declaration, &shared.switch)
    }

    /// At least every millisecond: obeys, and tells what is due.
    fn turn<N: Names, OWN>(
        &self,
        boards: &Boards,
        bond: &mut Bond,
        shared: &Common<'_, N, OWN>,
        mut send: impl FnMut(u8, &[u8]) -> bool,
    ) {
        let (now, role) = (now(), bond.role);
        let (link, beat) = bond.step(&shared.switch, now);
        self.with(|state| (state.link, state.other) = (link, bond.other()));
        if role == Role::Follows {
            let link = match link {
                Link::Online => RemoteLink::Online,
                Link::Interrupted => RemoteLink::Interrupted,
                Link::Lost | Link::Different => RemoteLink::Lost,
            };
            shared.remote_link.set(link, now);
        }
        let mut send = |place, data: &[u8]| {
            if !send(place, data) {
                self.with(|state| state.unsent = state.unsent.saturating_add(1));
            }
        };
        if let Some(beat) = beat {
            send(role as u8, &beat);
        }
        for TopicEntry { number, from, period, .. } in boards.topics {
            let place = usize::from(*number) - 1;
            let due = |state: &mut State| state.outgoing[place].due(*period, now);
            if *from == role
                && let Some(value) = self.with(due)
            {
                value.frames().for_each(|(part, data)| send(4 * number + part, &data));
            }
        }
    }

    fn hear(&self, boards: &Boards, bond: &mut Bond, place: u8, data: &[u8], at: Micros) {
        let (number, part) = (place / 4, place % 4);
        if number == 0 {
            if let Some(may_be_new) = bond.hear(part, data, at) {
                self.with(|state| {
                    for TopicEntry { number, period, .. } in boards.topics {
                        state.incoming[usize::from(*number) - 1].start(may_be_new, *period, at);
                    }
                });
            }
        } else if bond.is_heard(at)
            && let Some(topic) = boards.topics.iter().find(|it| it.number == number)
            && topic.from != bond.role
        {
            let place = usize::from(topic.number) - 1;
            self.with(|state| state.incoming[place].take(part, data, at));
        }
    }
}

#[cfg(test)]
mod tests;
