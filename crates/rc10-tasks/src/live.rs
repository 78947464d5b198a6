//! Shows a robot to a PC while it runs, and lets a PC change its gains: the robot's end of
//! [`rc10_link`].
//!
//! Every motor, bus and line is shown by itself, under its name in the declaration. A team adds values
//! of its own with [`live!`](crate::live!): a line for each [`Signal`] and [`Parameter`].
//!
//! [`Link`] is the port. Until a PC says hello it is for text ([`Link::say`]), and so it is again when
//! the PC is gone. It takes no time of the buses: it runs in thread mode, samples what the ports of the
//! motors have, and sends as fast as the line is. What does not fit is not sampled, and counted. A PC that
//! says how much the line carries gets every sample of its first group, and all else in pieces between.
//!
//! **A PC never arms the robot.** It may stop and disarm the robot, and change what a
//! [`Parameter`] allows. A parameter has its value until power-off, or longer if it is [`Kept`].

mod auto;
mod kept;
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
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{Read, Write};
use heapless::Vec;
use rc10_app::Rpm;
#[cfg(feature = "black-box")]
pub use rc10_link::PIECE;
use rc10_link::frame::{AROUND, BODY, CARRIED, CARRIER_HEAD, Writer};
use rc10_link::samples::{HEAD, Head, VALUES};
use rc10_link::{
    AT_ONCE, Action, Ask, Bits, Declaration, GROUPS, JOG_AGE, Outcome, RIDES, SIGNALS, SILENCE,
    Tell, Urgent, VERSION,
};
use rc10_message::{Cycles, Latest};
use rc10_module::remote::{Remote, RemoteLink};
use rc10_module::{Reception, listen};
use rc10_motor::embassy::{BusPort, MotorPort, Rs485Port};
use rc10_motor::{ArmState, ArmSwitch, Names, Request, RequestError, Response, Slot};

use crate::arming::Axis;
use crate::common::{Changes, Common};

pub use auto::{Auto, AutoChannel, Commanded, LOST};
use kept::Order;
pub use kept::{Kept, KeptState};
pub use own::{Contact, Live, Mechanism, Parameter, Signal};
pub(crate) use parameters::changed;
pub use parameters::request_to_set;
use parameters::{Change, Refusal, parameter, parameters, set};
use signals::{sample, signal, signals, signals_of};

/// A frame to a PC.
type Frame = Writer<{ BODY + AROUND }>;

/// What is on its way to a PC.
struct Out {
    frame: Frame,
    /// How much of the frame was carried; all of it if it was sent by itself.
    sent: usize,
    carrier: Writer<{ CARRIED + AROUND }>,
}

/// Motors that a PC can tell apart.
const MOTORS: usize = SIGNALS / 32;

/// A robot as a PC may see it, whatever its declaration.
pub struct RobotView<'r> {
    slots: &'static [Slot],
    motors: Vec<MotorPort<'r>, MOTORS>,
    buses: &'r [BusPort],
    lines: &'r [Rs485Port],
    switch: &'r ArmSwitch,
    remote: &'r Latest<Remote, 1>,
    remote_reception: &'r Reception,
    remote_link: &'r Latest<RemoteLink, 1>,
    cycles: Option<&'r Cycles>,
    changes: &'r Changes,
    not_at_rest: &'r Latest<Option<Axis>, 1>,
    kept: Option<&'r Kept>,
    #[cfg(feature = "black-box")]
    black_box: Option<BlackBox>,
    kept_state: &'r Latest<KeptState, 1>,
    own: &'r dyn Live,
    declaration: Declaration,
}

impl<'r> RobotView<'r> {
    /// With the signals and parameters of its own.
    #[must_use]
    pub fn new<N: Names>(shared: &'r Common<'_, N, impl Live>) -> Self {
        let own: &dyn Live = &shared.own;
        const {
            let signals = signals_of(N::ALL.len(), N::BUSES.len(), N::LINES as usize);
            assert!(signals <= SIGNALS, "the robot has more signals than a link can tell apart");
            assert!(N::ALL.len() <= MOTORS);
        }
        Self {
            slots: N::SLOTS,
            motors: N::ALL.iter().map(|name| shared.motor(*name)).collect(),
            buses: shared.ports.buses,
            lines: shared.ports.lines,
            switch: &shared.switch,
            remote: &shared.remote,
            remote_reception: &shared.remote_reception,
            remote_link: &shared.remote_link,
            cycles: shared.bus_cycles,
            changes: &shared.changes,
            not_at_rest: &shared.not_at_rest,
            kept: None,
            #[cfg(feature = "black-box")]
            black_box: None,
            kept_state: &shared.kept_state,
            own,
            declaration: declaration(N::SLOTS, [N::BUSES.len(), N::LINES.into()], own),
        }
    }

    /// With a place where parameters are kept.
    #[must_use]
    pub fn with_kept(self, kept: &'r Kept) -> Self {
        Self { kept: Some(kept), ..self }
    }

    /// With a black box.
    #[cfg(feature = "black-box")]
    #[must_use]
    pub fn with_black_box(self, black_box: BlackBox) -> Self {
        Self { black_box: Some(black_box), ..self }
    }

    fn motor(&self, number: usize) -> Option<MotorPort<'r>> {
        self.motors.get(number).copied()
    }
}

/// The memory of a black box: its length in bytes, and what copies some of them, from a word on; none while it is busy.
#[cfg(feature = "black-box")]
pub type BlackBox = (usize, fn(usize, &mut [u8]) -> usize);

/// Returns the identity of a robot, by which a PC tells it from others.
fn declaration(slots: &[Slot], counts: [usize; 2], own: &dyn Live) -> Declaration {
    let mut sum = Declaration::default();
    for Slot { label, on, .. } in slots {
        sum = sum.with(label.as_bytes()).with(&[on.bus().unwrap_or(0), on.line().unwrap_or(0)]);
    }
    sum = counts.iter().fold(sum, |sum, count| sum.with(&count.to_le_bytes()[..1]));
    own.signals(&mut |it| sum = sum.with(it.label.as_bytes()));
    own.parameters(&mut |it| sum = sum.with(it.label.as_bytes()));
    sum
}

/// A port to a PC.
pub struct Link<W> {
    writer: Mutex<NoopRawMutex, W>,
    state: State,
}

/// All of a link but its port: so it is compiled once, and for size.
struct State {
    reception: Reception,
    /// When a PC said hello last.
    heard: Cell<Option<Instant>>,
    groups: RefCell<[Group; GROUPS]>,
    /// Bytes that the line carries in a millisecond; 0: unknown.
    line: Cell<u16>,
    /// Bytes that ride on each sample of the first group; 0: all is sent by itself.
    rides: Cell<u16>,
    /// There may be something to tell beside samples.
    is_asked: Cell<bool>,
    /// Whether a greeting has arrived and is not answered yet.
    is_greeted: Cell<bool>,
    /// The signals, the parameters, and the kept values, that are still to be told of.
    signals: Cell<Range>,
    parameters: Cell<Range>,
    kept: Cell<Range>,
    #[cfg(feature = "black-box")]
    pieces: Cell<Range>,
    jobs: Channel<NoopRawMutex, (u16, Job), WAITING>,
    answers: Channel<NoopRawMutex, (u16, Answer), WAITING>,
    /// The newest jog: the time in it, and its number.
    jogged: Cell<(u64, u16)>,
    wake: Wake<NoopRawMutex, ()>,
}

/// From one number up to another.
type Range = (u16, u16);

/// Requests, and answers, that may wait.
const WAITING: usize = 4;

/// A request whose answer takes time.
enum Job {
    Set(Change),
    Ask(u8, Request),
    /// Asked for at this time.
    Jog(u8, Rpm, Instant),
    Keep(Order),
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
        let state = State {
            reception: Reception::new(),
            heard: Cell::new(None),
            groups: RefCell::new([Group::OFF; GROUPS]),
            line: Cell::new(0),
            rides: Cell::new(0),
            is_asked: Cell::new(false),
            is_greeted: Cell::new(false),
            signals: Cell::new((0, 0)),
            parameters: Cell::new((0, 0)),
            kept: Cell::new((0, 0)),
            #[cfg(feature = "black-box")]
            pieces: Cell::new((0, 0)),
            jobs: Channel::new(),
            answers: Channel::new(),
            jogged: Cell::new((0, 0)),
            wake: Wake::new(),
        };
        Self { writer: Mutex::new(writer), state }
    }

    /// Whether a PC is there.
    pub fn is_up(&self) -> bool {
        self.state.is_up()
    }

    /// Writes a text, unless a PC is there. A port that fails loses it; the next text is a new chance.
    pub async fn say(&self, text: &[u8]) {
        if !self.is_up() {
            self.put(text).await;
        }
    }

    /// Serves the PC, for ever. Samples are taken on whole multiples of their period after `grid`: half
    /// way between two ticks of the buses none of these is delayed. `auto` takes the PC's commands: `()` takes none.
    pub async fn serve<A: Commanded>(
        &self,
        robot: &RobotView<'_>,
        reader: impl Read,
        grid: Instant,
        auto: A,
    ) {
        let Self { state, .. } = self;
        let send = async {
            let mut out = Out { frame: Frame::new(), sent: 0, carrier: Writer::new() };
            loop {
                state.wait(grid).await;
                while let Some(bytes) = state.next(&mut out, robot, grid) {
                    self.put(bytes).await;
                }
            }
        };
        // By these references: then it is no larger where there are no commands.
        let (to, from) = (&robot, &grid);
        let hear = move |said, _| {
            auto.hear(said, to, |ask| state.hear(ask, to, *from), |id, why| state.refuse(id, why));
        };
        join3(listen(reader, A::PROTOCOL, &state.reception, hear), state.work(robot, grid), send)
            .await;
    }

    async fn put(&self, bytes: &[u8]) {
        // A port that fails loses a frame, and the PC sees that one is missing.
        let _ = self.writer.lock().await.write_all(bytes).await;
    }
}

impl State {
    fn is_up(&self) -> bool {
        self.is_up_at(Instant::now())
    }

    #[inline]
    fn is_up_at(&self, now: Instant) -> bool {
        let age = |heard: Instant| now.saturating_duration_since(heard).as_micros();
        self.heard.get().is_some_and(|heard| age(heard) < SILENCE)
    }

    /// Takes what the PC asks. Stopping and disarming is done before anything else is sent.
    #[inline(never)]
    fn hear(&self, ask: Ask, robot: &RobotView<'_>, grid: Instant) {
        let was_up = self.is_up();
        // Who stops or disarms is to be answered, too.
        if let Ask::Hello { .. } | Ask::Urge { .. } = ask {
            if !was_up {
                *self.groups.borrow_mut() = [Group::OFF; GROUPS];
                self.line.set(0);
                self.rides.set(0);
            }
            self.heard.set(Some(Instant::now()));
            self.is_greeted.set(true);
        } else if !was_up {
            return;
        }
        match ask {
            Ask::Signals { first } => self.signals.set(page(first, signals(robot))),
            Ask::Parameters { first } => self.parameters.set(page(first, parameters(robot))),
            Ask::Kept { first } => {
                let count = robot.kept.and_then(Kept::count).unwrap_or(0);
                self.kept.set(page(first, count.max(1)));
            }
            Ask::Watch { group, period, signals } => {
                let now = Instant::now().saturating_duration_since(grid);
                self.watch(group, period, signals, now.as_micros());
            }
            Ask::Line { bytes } => self.set_line(bytes),
            Ask::Set { id, declaration, .. } | Ask::Act { id, declaration, .. }
                if declaration != robot.declaration =>
            {
                self.answer(id, Answer::Refused(Refusal::ANOTHER));
            }
            #[cfg(feature = "black-box")]
            Ask::Act { action: Action::BlackBox(first), .. } if robot.black_box.is_some() => {
                self.pieces.set(page(first, pieces(robot)));
            }
            Ask::Set { id, changes, .. } => self.queue(id, Job::Set(changes)),
            Ask::Urge { id, what } => {
                match what {
                    Urgent::Disarm => robot.switch.disarm(),
                    _ => robot.switch.emergency_stop(),
                }
                self.answer(id, Answer::Done);
            }
            Ask::Act { id, heard, action, .. } => match self.job(id, heard, action, robot) {
                Ok(job) => self.queue(id, job),
                Err(why) => self.answer(id, Answer::Refused(why)),
            },
            _ => {}
        }
        self.is_asked.set(true);
        self.wake.signal(());
    }

    /// Returns the job of an action on a motor, if that is allowed.
    fn job(
        &self,
        id: u16,
        heard: u64,
        action: Action,
        robot: &RobotView<'_>,
    ) -> Result<Job, Refusal> {
        Ok(match action {
            // The motor's bus sees to it again, in the tick that does it.
            Action::Zero(_) if robot.switch.state() != ArmState::Disarmed => {
                return Err(Refusal::of(None, RequestError::NotWhileArmed));
            }
            Action::Zero(motor) => Job::Ask(motor, Request::SetZero),
            Action::ClearFault(motor) => Job::Ask(motor, Request::ClearFault),
            Action::ReadRegister(motor, register) => {
                Job::Ask(motor, Request::ReadRegister(register))
            }
            Action::WriteRegister(motor, register, bits) => {
                Job::Ask(motor, Request::WriteRegister(register, bits))
            }
            Action::SaveRegisters(motor) => Job::Ask(motor, Request::SaveRegisters),
            Action::Jog(motor, tenths) => {
                self.is_news(id, heard, tenths)?;
                Job::Jog(motor, jog(robot, motor, tenths)?, Instant::now())
            }
            Action::Save => Job::Keep(Order::Save),
            Action::Forget(id) => Job::Keep(Order::Forget(id)),
            Action::ForgetAll => Job::Keep(Order::ForgetAll),
            _ => return Err(Refusal::UNKNOWN),
        })
    }

    /// Whether a jog was asked for just now, and only once. One to zero turns nothing.
    fn is_news(&self, id: u16, heard: u64, tenths: i16) -> Result<(), Refusal> {
        let (before, number) = self.jogged.get();
        let age = Instant::now().as_micros().wrapping_sub(heard);
        let is_again = heard < before || (heard == before && id == number);
        let is_recent = age <= JOG_AGE;
        if tenths != 0 && (!is_recent || is_again) {
            return Err(Refusal::because(None, "it was asked for too long ago"));
        }
        // One from the future would make all later ones old.
        if is_recent {
            self.jogged.set((before.max(heard), id));
        }
        Ok(())
    }

    fn watch(&self, group: u8, period: u16, signals: Bits, now: u64) {
        let mut groups = self.groups.borrow_mut();
        let Some(place) = groups.get_mut(usize::from(group)) else { return };
        // Nothing is not sampled.
        let period = if signals.is_empty() { 0 } else { u64::from(period.min(1000)) * 1000 };
        // Said again and again, in case it was lost.
        if place.period == period && place.signals == signals {
            return;
        }
        let next = now.div_ceil(period.max(1)) * period;
        *place = Group { period, signals, next, head: Head { group, ..Head::default() } };
        drop(groups);
        self.make_room();
    }

    fn set_line(&self, bytes: u16) {
        if self.line.replace(bytes) != bytes {
            self.make_room();
        }
    }

    /// Finds out how much rides on a sample of the first group: a line that has no room for it carries some
    /// all the same, so that the PC is answered.
    fn make_room(&self) {
        let groups = self.groups.borrow();
        let Group { period, signals, .. } = &groups[0];
        let (millis, own) = (period / 1000, 4 * signals.count() + CARRIER_HEAD + HEAD);
        let is_for_riders = self.line.get() > 0 && (1..=RIDES.into()).contains(&millis);
        let line = u64::from(self.line.get()) * millis;
        let most = usize::try_from(line).unwrap_or(usize::MAX).min(CARRIED + AROUND);
        let rides = most.saturating_sub(own + AROUND).max(LEAST_RIDES);
        let rides = if is_for_riders && own + rides <= CARRIED { rides } else { 0 };
        self.rides.set(rides.try_into().unwrap_or_default());
    }

    fn queue(&self, id: u16, job: Job) {
        if self.jobs.try_send((id, job)).is_err() {
            self.answer(id, Answer::Refused(Refusal::BUSY));
        }
    }

    fn refuse(&self, id: u16, why: &'static str) {
        if !self.is_up() {
            return;
        }
        self.answer(id, Answer::Refused(Refusal::because(None, why)));
        self.wake.signal(());
    }

    fn answer(&self, id: u16, answer: Answer) {
        // A PC that asks without waiting for its answers loses some.
        let _ = self.answers.try_send((id, answer));
        self.is_asked.set(true);
    }

    /// Does one after the other what takes its time, first of all what is kept.
    async fn work(&self, robot: &RobotView<'_>, grid: Instant) {
        if let Some(kept) = robot.kept {
            kept.apply(robot).await;
        }
        loop {
            let (id, job) = self.jobs.receive().await;
            let outcome = match job {
                Job::Set(change) => set(&change, robot).await.map(|()| Answer::Done),
                Job::Ask(motor, request) => ask(robot, motor, request).await,
                // It waited behind something slow: the button may have been let go long ago.
                Job::Jog(_, speed, at) if speed.get() != 0.0 && at.elapsed() > JOG_WAITS => {
                    Err(Refusal::BUSY)
                }
                Job::Jog(motor, speed, _) => ask(robot, motor, Request::Jog(speed)).await,
                Job::Keep(order) => match robot.kept {
                    Some(kept) => kept.carry_out(order, robot, grid).await.map(|()| Answer::Done),
                    None => Err(Refusal::NOWHERE),
                },
            };
            self.answer(id, outcome.unwrap_or_else(Answer::Refused));
            self.wake.signal(());
        }
    }

    /// Waits until there may be something to send.
    async fn wait(&self, grid: Instant) {
        let due = {
            let (groups, count) =
                (self.groups.borrow(), if self.rides.get() > 0 { 1 } else { GROUPS });
            groups.iter().take(count).filter(|it| it.period > 0).map(|it| it.next).min()
        };
        match due.filter(|_| self.is_up()) {
            Some(due) => {
                let due = grid + Duration::from_micros(due);
                select(self.wake.wait(), Timer::at(due)).await;
            }
            None => self.wake.wait().await,
        }
    }

    /// The next bytes that are to be sent now.
    #[inline(never)]
    fn next<'o>(&self, out: &'o mut Out, robot: &RobotView<'_>, grid: Instant) -> Option<&'o [u8]> {
        let Out { frame, sent, carrier } = out;
        let now = Instant::now();
        if !self.is_up_at(now) {
            *sent = frame.bytes().len();
            return None;
        }
        let now = (now.as_micros(), now.saturating_duration_since(grid).as_micros());
        let rides = usize::from(self.rides.get());
        if rides == 0 && *sent >= frame.bytes().len() {
            if !self.fill(frame, robot, now, 0) {
                return None;
            }
            *sent = frame.bytes().len();
            return Some(frame.bytes());
        }
        if rides > 0 && self.groups.borrow()[0].next > now.1 {
            return None;
        }
        // What was begun when the first group was switched off goes on without it.
        let (most, has_sample) = if rides > 0 { (rides, true) } else { (CARRIED, false) };
        carrier.carrier();
        loop {
            *sent += carrier.carry(&frame.bytes()[*sent..], most);
            if *sent < frame.bytes().len() || !has_sample || !self.fill(frame, robot, now, 1) {
                break;
            }
            *sent = 0;
        }
        if has_sample {
            Self::take(&mut self.groups.borrow_mut()[0], carrier, robot, now);
        } else {
            carrier.end_carrier();
        }
        Some(carrier.bytes())
    }

    /// Writes the next frame that is due now, of the groups from `first` on; whether there is one.
    fn fill(
        &self,
        frame: &mut Frame,
        robot: &RobotView<'_>,
        now: (u64, u64),
        first: usize,
    ) -> bool {
        if self.is_asked.get() {
            if let Some(tell) = self.tell(robot) {
                frame.message(&tell);
                return true;
            }
            if let Some(index) = pop(&self.kept) {
                kept::tell(index, robot, |tell| frame.message(tell));
                return true;
            }
            #[cfg(feature = "black-box")]
            if let (Some(index), Some((_, copy))) = (pop(&self.pieces), robot.black_box) {
                let mut bytes = [0; PIECE];
                let count = copy(usize::from(index) * PIECE / 4, &mut bytes);
                frame.message(&Tell::BlackBox { index, of: pieces(robot), bytes: &bytes[..count] });
                return true;
            }
            self.is_asked.set(false);
        }
        let mut groups = self.groups.borrow_mut();
        // The one that waits longest: on a line that is too slow each has its turn.
        let due = groups.iter_mut().skip(first).filter(|it| it.period > 0 && it.next <= now.1);
        let Some(group) = due.min_by_key(|it| it.next) else {
            return false;
        };
        Self::take(group, frame, robot, now);
        true
    }

    /// Samples a group that is due: at this time, and since the grid, in µs.
    fn take<const N: usize>(
        group: &mut Group,
        frame: &mut Writer<N>,
        robot: &RobotView<'_>,
        (now, since): (u64, u64),
    ) {
        group.next += group.period;
        let head = &mut group.head;
        if group.next <= since {
            let late = (since - group.next) / group.period + 1;
            group.next += late * group.period;
            head.skipped = head.skipped.wrapping_add(u32::try_from(late).unwrap_or(u32::MAX));
        }
        head.count = head.count.wrapping_add(1);
        head.at = now;
        let values = frame.sample(*head);
        let count = sample(&group.signals, robot, values);
        frame.end_sample(count);
    }

    /// The next thing that was asked for.
    fn tell<'r>(&self, robot: &RobotView<'r>) -> Option<Tell<'r>> {
        if self.is_greeted.take() {
            let counters = self.reception.read();
            let groups = self.groups.borrow();
            return Some(Tell::Welcome {
                version: VERSION,
                signals: signals(robot),
                parameters: parameters(robot),
                at: Instant::now().as_micros(),
                changes: robot.changes.read(),
                damaged: [counters.damaged, counters.skipped, counters.port_errors],
                skipped: groups.iter().fold(0, |sum, it| it.head.skipped.wrapping_add(sum)),
                declaration: robot.declaration,
            });
        }
        if let Ok((id, answer)) = self.answers.try_receive() {
            let outcome = match answer {
                Answer::Done => Outcome::Done,
                Answer::Register(value) => Outcome::Register(value),
                Answer::Refused(Refusal { parameter, why, detail }) => {
                    Outcome::Refused { parameter, why, detail }
                }
            };
            return Some(Tell::Answer { id, outcome });
        }
        if let Some(index) = pop(&self.signals) {
            return Some(signal(index, robot));
        }
        pop(&self.parameters).and_then(|index| parameter(index, robot))
    }
}

/// Bytes that ride on a sample at least.
const LEAST_RIDES: usize = 8;

/// How long a jog may wait: it ends 80 ms later, and so within 100 ms after the last word.
const JOG_WAITS: Duration = Duration::from_millis(15);

/// Asks something of a motor.
async fn ask(robot: &RobotView<'_>, motor: u8, request: Request) -> Result<Answer, Refusal> {
    let port = robot.motor(motor.into()).ok_or(Refusal::NO_MOTOR)?;
    match port.request(request).await {
        Ok(Response::Register(value)) => Ok(Answer::Register(value)),
        Ok(_) => Ok(Answer::Done),
        Err(why) => Err(Refusal::of(None, why)),
    }
}

/// The speed at which a PC may turn a motor now, if it may.
fn jog(robot: &RobotView<'_>, motor: u8, tenths: i16) -> Result<Rpm, Refusal> {
    let refused = |why| Err(Refusal::because(None, why));
    let Some(slot) = robot.slots.get(usize::from(motor)) else { return Err(Refusal::NO_MOTOR) };
    let Some(fastest) = slot.jog else {
        return refused("the robot's table does not allow to turn this motor");
    };
    let speed = Rpm::new(f32::from(tenths) / 10.0);
    if speed.get().abs() > fastest.get() {
        return refused("faster than the robot's table allows");
    }
    if robot.switch.unfit().is_some() {
        return refused("the robot is not fit to be armed");
    }
    if !robot.changes.may_jog(motor, tenths != 0, rc10_message::now()) {
        return refused("another motor turns");
    }
    Ok(speed)
}

/// Pieces of the black box.
#[cfg(feature = "black-box")]
fn pieces(robot: &RobotView<'_>) -> u16 {
    let bytes = robot.black_box.map_or(0, |(bytes, _)| bytes);
    bytes.div_ceil(PIECE).try_into().unwrap_or(u16::MAX)
}

/// Those that are told at once: then samples have their turn.
fn page(first: u16, count: u16) -> Range {
    (first, (first / AT_ONCE + 1).saturating_mul(AT_ONCE).min(count))
}

/// The next number of a range.
fn pop(range: &Cell<Range>) -> Option<u16> {
    let (next, end) = range.get();
    range.set((next.saturating_add(1), end));
    (next < end).then_some(next)
}

const _: () = assert!(HEAD + 4 * VALUES <= BODY);

#[cfg(test)]
mod tests {
    use rc10_app::mechanism::Stage;
    use rc10_motor::{Place, numbers};

    use super::*;

    struct Own(Option<Signal>, Option<Parameter>);

    impl Live for Own {
        fn auto(&self) -> impl Commanded {}
        fn signals<'l>(&'l self, see: &mut dyn FnMut(&'l Signal)) {
            self.0.iter().for_each(see);
        }
        fn parameters<'l>(&'l self, see: &mut dyn FnMut(&'l Parameter)) {
            self.1.iter().for_each(see);
        }
    }

    #[test]
    fn a_mechanism_may_give_up_and_no_other_number_does() {
        let (mechanism, number) = (Mechanism::new("lift"), Signal::new("jams", ""));
        for stage in Stage::ALL {
            mechanism.tell(*stage);
            number.set(f32::from(*stage as u8));
            let failure = stage.gave_up().then_some(*stage);
            assert_eq!((mechanism.signal().failure(), number.failure()), (failure, None));
        }
    }

    #[test]
    fn robots_differ_by_motors_places_buses_lines_signals_and_parameters() {
        let motor = numbers([Place::Bus(1)]).next().unwrap();
        let slot = |label, on| Slot { label, on, motor, jog: None, most_gain: 10.0 };
        let [left, right] = ["left", "right"].map(|label| slot(label, Place::Bus(1)));
        let signal = |label| Some(Signal::new(label, ""));
        let parameter = |label| Some(Parameter::new(label, "", 0.0, [0.0, 1.0]));
        let none = Own(None, None);
        let all = [
            declaration(&[left, right], [1, 0], &none),
            declaration(&[right, left], [1, 0], &none),
            declaration(&[left], [1, 0], &none),
            declaration(&[left, slot("right", Place::Bus(2))], [1, 0], &none),
            declaration(&[left, slot("right", Place::Line(1))], [1, 0], &none),
            declaration(&[left, right], [2, 0], &none),
            declaration(&[left, right], [1, 1], &none),
            declaration(&[left, right], [0, 1], &none),
            declaration(&[left, right], [1, 0], &Own(signal("tilt"), None)),
            declaration(&[left, right], [1, 0], &Own(signal("roll"), None)),
            declaration(&[left, right], [1, 0], &Own(None, parameter("speed"))),
            declaration(&[left, right], [1, 0], &Own(signal("tilt"), parameter("speed"))),
        ];
        for (at, one) in all.iter().enumerate() {
            assert!(all.iter().skip(at + 1).all(|other| other != one), "{at}");
        }
        // What of a motor may be changed does not make it another one.
        let same = Slot { jog: Some(Rpm::new(5.0)), most_gain: 2.0, ..left };
        assert_eq!(declaration(&[same, right], [1, 0], &none), all[0]);
    }
}
