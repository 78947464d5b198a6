//! Shows a robot to a PC while it runs, and lets a PC change its gains: the robot's end of
//! [`rc10_link`].
//!
//! Every motor, bus and line is shown by itself, under its name in the declaration. A team adds values
//! of its own with [`live!`](crate::live!): a line for each [`Signal`] and [`Parameter`].
//!
//! [`Link`] is the port. Until a PC says hello it is for text ([`Link::say`]), and so it is again when
//! the PC is gone. It takes no time of the buses: it runs in thread mode, samples what the ports of the
//! motors have, and sends as fast as the line is. What does not fit is not sampled, and counted.
//!
//! **From a PC no motor is armed.** It may stop and disarm the robot, and change what a
//! [`Parameter`] allows. A parameter has its value until power-off.

mod own;
mod parameters;
mod signals;

use core::cell::{Cell, RefCell};

use embassy_futures::join::join3;
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal as Wake;
use embassy_time::{Instant, Timer};
use embedded_io_async::{Read, Write};
use rc10_link::frame::{AROUND, BODY, FromPc, Writer};
use rc10_link::samples::{HEAD, Head, VALUES};
use rc10_link::{AT_ONCE, Action, Ask, Bits, GROUPS, Outcome, SILENCE, Tell, VERSION};
use rc10_module::{Reception, listen};
use rc10_motor::{Names, Request, Response};

use crate::common::Common;

pub use own::{Live, Parameter, Signal};
use parameters::{Change, Refusal, parameter, parameters, set};
use signals::{sample, signal, signals};

/// A port to a PC.
pub struct Link<W> {
    writer: Mutex<NoopRawMutex, W>,
    reception: Reception,
    /// When a PC said hello last.
    heard: Cell<Option<Instant>>,
    groups: RefCell<[Group; GROUPS]>,
    /// It was said hello to, and has not answered.
    is_greeted: Cell<bool>,
    /// The next signal, and the next parameter, to be told of.
    next_signal: Cell<Option<u16>>,
    next_parameter: Cell<Option<u16>>,
    jobs: Channel<NoopRawMutex, (u16, Job), WAITING>,
    answers: Channel<NoopRawMutex, (u16, Answer), WAITING>,
    wake: Wake<NoopRawMutex, ()>,
}

/// Requests, and answers, that may wait.
const WAITING: usize = 4;

/// What takes its time.
enum Job {
    Set(Change),
    Ask(u8, Request),
}

#[derive(Clone, Copy)]
enum Answer {
    Done,
    Register(u32),
    Refused(Refusal),
}

/// Signals that are sampled together.
struct Group {
    /// µs; 0: it is off.
    period: u64,
    signals: Bits,
    /// When it is sampled next.
    next: u64,
    head: Head,
}

impl Group {
    const OFF: Self = Self {
        period: 0,
        signals: Bits::new(),
        next: 0,
        head: Head { group: 0, count: 0, skipped: 0, at: 0 },
    };
}

impl<W: Write> Link<W> {
    /// One that has heard no PC.
    #[must_use]
    pub const fn new(writer: W) -> Self {
        Self {
            writer: Mutex::new(writer),
            reception: Reception::new(),
            heard: Cell::new(None),
            groups: RefCell::new([Group::OFF; GROUPS]),
            is_greeted: Cell::new(false),
            next_signal: Cell::new(None),
            next_parameter: Cell::new(None),
            jobs: Channel::new(),
            answers: Channel::new(),
            wake: Wake::new(),
        }
    }

    /// Whether a PC is there.
    pub fn is_up(&self) -> bool {
        self.heard.get().is_some_and(|heard| heard.elapsed().as_micros() < SILENCE)
    }

    /// Writes a text, unless a PC is there. A port that fails loses it; the next text is a new chance.
    pub async fn say(&self, text: &[u8]) {
        if !self.is_up() {
            let _ = self.writer.lock().await.write_all(text).await;
        }
    }

    /// Serves the PC, for ever. Samples are taken on whole multiples of their period after `grid`: half
    /// way between two ticks of the buses none of these is delayed.
    pub async fn serve<N: Names, const BUSES: usize, const LINES: usize>(
        &self,
        shared: &Common<'_, N, BUSES, LINES>,
        own: &impl Live,
        reader: impl Read,
        grid: Instant,
    ) {
        let hear = |ask, _| self.hear(ask, shared, grid);
        join3(
            listen(reader, FromPc, &self.reception, hear),
            self.work(shared, own),
            self.send(shared, own, grid),
        )
        .await;
    }

    /// Takes what the PC asks. Stopping and disarming is done before anything else is sent.
    fn hear<N: Names, const BUSES: usize, const LINES: usize>(
        &self,
        ask: Ask,
        shared: &Common<'_, N, BUSES, LINES>,
        grid: Instant,
    ) {
        let was_up = self.is_up();
        if let Ask::Hello { .. } = ask {
            if !was_up {
                *self.groups.borrow_mut() = [Group::OFF; GROUPS];
            }
            self.heard.set(Some(Instant::now()));
            self.is_greeted.set(true);
        } else if !was_up && !matches!(ask, Ask::Do { action: Action::Stop, .. }) {
            return;
        }
        match ask {
            Ask::Signals { first } => self.next_signal.set(Some(first)),
            Ask::Parameters { first } => self.next_parameter.set(Some(first)),
            Ask::Watch { group, period, signals } => {
                self.watch(group, period, signals, Instant::now() - grid);
            }
            Ask::Set { id, changes } => self.queue(id, Job::Set(changes)),
            Ask::Do { id, action } => match action {
                Action::Stop => {
                    shared.switch.emergency_stop();
                    self.answer(id, Answer::Done);
                }
                Action::Disarm => {
                    shared.switch.disarm();
                    self.answer(id, Answer::Done);
                }
                Action::Zero(motor) => self.queue(id, Job::Ask(motor, Request::SetZero)),
                Action::ClearFault(motor) => self.queue(id, Job::Ask(motor, Request::ClearFault)),
                Action::ReadRegister(motor, register) => {
                    self.queue(id, Job::Ask(motor, Request::ReadRegister(register)));
                }
                _ => self.answer(id, Answer::Refused(Refusal::UNKNOWN)),
            },
            _ => {}
        }
        self.wake.signal(());
    }

    fn watch(&self, group: u8, period: u16, signals: Bits, now: embassy_time::Duration) {
        let mut groups = self.groups.borrow_mut();
        let Some(place) = groups.get_mut(usize::from(group)) else { return };
        let period = u64::from(period.min(1000)) * 1000;
        // Said again and again, in case it was lost.
        if place.period == period && place.signals == signals {
            return;
        }
        let next = now.as_micros().div_ceil(period.max(1)) * period;
        *place = Group { period, signals, next, head: Head { group, ..Head::default() } };
    }

    fn queue(&self, id: u16, job: Job) {
        if self.jobs.try_send((id, job)).is_err() {
            self.answer(id, Answer::Refused(Refusal::BUSY));
        }
    }

    fn answer(&self, id: u16, answer: Answer) {
        // A PC that asks without waiting for its answers loses some.
        let _ = self.answers.try_send((id, answer));
    }

    /// Does one after the other what takes its time.
    async fn work<N: Names, const BUSES: usize, const LINES: usize>(
        &self,
        shared: &Common<'_, N, BUSES, LINES>,
        own: &impl Live,
    ) {
        loop {
            let (id, job) = self.jobs.receive().await;
            let outcome = match job {
                Job::Set(change) => set(&change, shared, own).await.map(|()| Answer::Done),
                Job::Ask(motor, request) => match N::ALL.get(usize::from(motor)) {
                    None => Err(Refusal::NO_MOTOR),
                    Some(name) => match shared.motor(*name).request(request).await {
                        Ok(Response::Register(value)) => Ok(Answer::Register(value)),
                        Ok(_) => Ok(Answer::Done),
                        Err(why) => Err(Refusal::of(None, why)),
                    },
                },
            };
            self.answer(id, outcome.unwrap_or_else(Answer::Refused));
            self.wake.signal(());
        }
    }

    async fn send<N: Names, const BUSES: usize, const LINES: usize>(
        &self,
        shared: &Common<'_, N, BUSES, LINES>,
        own: &impl Live,
        grid: Instant,
    ) {
        let mut frame = Writer::<{ BODY + AROUND }>::new();
        loop {
            let groups =
                self.groups.borrow().each_ref().map(|it| (it.period > 0).then_some(it.next));
            match groups.into_iter().flatten().min().filter(|_| self.is_up()) {
                Some(next) => {
                    let due = grid + embassy_time::Duration::from_micros(next);
                    select(self.wake.wait(), Timer::at(due)).await;
                }
                None => self.wake.wait().await,
            }
            if !self.is_up() {
                continue;
            }
            self.tell(&mut frame, shared, own).await;
            for group in 0..GROUPS {
                if self.take(group, &mut frame, shared, own, grid) {
                    self.put(frame.end()).await;
                }
            }
        }
    }

    /// Takes a sample of a group into a frame, if it is time.
    fn take<N: Names, const BUSES: usize, const LINES: usize>(
        &self,
        group: usize,
        frame: &mut Writer<{ BODY + AROUND }>,
        shared: &Common<'_, N, BUSES, LINES>,
        own: &impl Live,
        grid: Instant,
    ) -> bool {
        let now = Instant::now();
        let since = now.saturating_duration_since(grid).as_micros();
        let mut groups = self.groups.borrow_mut();
        let Some(group) = groups.get_mut(group).filter(|it| it.period > 0 && it.next <= since)
        else {
            return false;
        };
        let late = (since - group.next) / group.period;
        group.next += (late + 1) * group.period;
        let head = &mut group.head;
        head.skipped = head.skipped.wrapping_add(u32::try_from(late).unwrap_or(u32::MAX));
        head.count = head.count.wrapping_add(1);
        head.at = now.as_micros();
        let body = frame.begin();
        let _ = body.extend_from_slice(&head.bytes());
        sample(&group.signals, shared, own, body);
        true
    }

    /// Tells what was asked for.
    async fn tell<N: Names, const BUSES: usize, const LINES: usize>(
        &self,
        frame: &mut Writer<{ BODY + AROUND }>,
        shared: &Common<'_, N, BUSES, LINES>,
        own: &impl Live,
    ) {
        if self.is_greeted.take() {
            let counters = self.reception.read();
            let skipped =
                self.groups.borrow().iter().map(|it| it.head.skipped).fold(0, u32::wrapping_add);
            let welcome = Tell::Welcome {
                version: VERSION,
                signals: signals::<N, BUSES, LINES>(own),
                parameters: parameters::<N>(own),
                at: Instant::now().as_micros(),
                changes: shared.changes.read(),
                damaged: [counters.damaged, counters.skipped, counters.port_errors],
                skipped,
            };
            self.put(frame.message(&welcome)).await;
        }
        while let Ok((id, answer)) = self.answers.try_receive() {
            let outcome = match answer {
                Answer::Done => Outcome::Done,
                Answer::Register(value) => Outcome::Register(value),
                Answer::Refused(Refusal { parameter, why, detail }) => {
                    Outcome::Refused { parameter, why, detail }
                }
            };
            self.put(frame.message(&Tell::Answer { id, outcome })).await;
        }
        if let Some(first) = self.next_signal.take() {
            for index in page(first) {
                let Some(told) = signal::<N, BUSES, LINES>(index, own) else { break };
                self.put(frame.message(&told)).await;
            }
        }
        if let Some(first) = self.next_parameter.take() {
            for index in page(first) {
                let Some(told) = parameter(index, shared, own) else { break };
                self.put(frame.message(&told)).await;
            }
        }
    }

    async fn put(&self, bytes: &[u8]) {
        // A port that fails loses a frame, and the PC sees that one is missing.
        let _ = self.writer.lock().await.write_all(bytes).await;
    }
}

/// Those that are told at once: then samples have their turn.
const fn page(first: u16) -> core::ops::Range<u16> {
    first..(first / AT_ONCE + 1).saturating_mul(AT_ONCE)
}

const _: () = assert!(HEAD + 4 * VALUES <= BODY);
