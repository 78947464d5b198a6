use core::borrow::BorrowMut;
use core::marker::PhantomData;

use embassy_time::{Instant, Timer};
use heapless::Vec;
use rc10_app::Seconds;
use rc10_can::{BusOffPolicy, CanPort, Health, IdPattern, Submitted};
use rc10_time::Micros;

use super::clock::{Clock, PERIOD, now};
use super::motors::Server;
use super::port::{BusPort, BusStatus};
use super::recovery::Recovery;
use super::subscription::{Filter, Received};
use crate::arm::{ArmState, Seen};
use crate::batch::TxBatch;
use crate::bus::{Dispatch, MotorBus};
#[cfg(feature = "record")]
use crate::record::{BUS, OUTGOING, Recorded, SENT, save};
use crate::supervision::count;

/// Time by which a tick begins before its frames leave: more than the work takes on a full bus. The newest
/// feedback that a frame answers is older by this at most. Several buses lie behind each other by the same
/// time: as one sends, the next computes, so that one timer wakes both.
const LEAD: Micros = Micros::new(60);
/// Time between these ticks and tasks' of 5, 10 or 100 ms: commands are there, logs are written.
const APART: Micros = Micros::new(500);
/// Bit rate that load figures refer to.
const BITS_PER_SECOND: u32 = 1_000_000;
/// Frames taken in a tick: three times a saturated bus, to catch up, but bounded.
const RECEIVE_LIMIT: usize = 64;
/// Patterns that a port is told to let in. Where more are wanted, it lets in everything.
const ACCEPTED: usize = 48;

/// Runs a bus, back by itself after bus-off: a tick every millisecond, missed ones counted.
///
/// For another [`BusOffPolicy`]: [`Runner::with_bus_off`] and [`run_buses`].
pub fn run_bus<'m, P: CanPort, B: BorrowMut<MotorBus<'m>>>(
    port: P,
    bus: B,
    shared: &BusPort,
) -> impl Future<Output = ()> {
    run_buses([Runner::new(port, bus, shared, now())])
}

/// Runs the buses of a processor in one task, for ever: [`run_bus`], each 60 µs behind the other.
///
/// Not written `async fn`, which would keep a second copy of the runners: 2 KiB a bus.
pub fn run_buses<'m, P: CanPort, B: BorrowMut<MotorBus<'m>>, const N: usize>(
    runners: [Runner<'m, '_, P, B>; N],
) -> impl Future<Output = ()> {
    let mut runners = runners;
    async move {
        let mut first = now() + PERIOD + APART;
        for runner in &mut runners {
            runner.begin_at(first);
            first += LEAD;
        }
        while let Some(due) = runners.iter().map(|runner| runner.due).min() {
            Timer::at(Instant::from_micros(due.get())).await;
            // In this order what is to leave leaves before anything is computed.
            for runner in runners.iter_mut().filter(|runner| runner.due <= due) {
                runner.tick(now);
            }
            // When all have sent there is time.
            #[cfg(feature = "record")]
            if runners.iter().all(|runner| !runner.prepared) {
                runners.iter().for_each(|it| it.server.recorder.keyframe(it, it.clock.ticks, true));
            }
        }
    }
}

/// A bus, its CAN port and its shared port: the state of [`run_bus`], for loops of your own.
///
/// The bus is a [`MotorBus`] or a `&mut MotorBus`: it is large, and better stays where it was made.
pub struct Runner<'m, 'p, P, B = MotorBus<'m>> {
    port: P,
    bus: B,
    motors: PhantomData<MotorBus<'m>>,
    shared: &'p BusPort,
    /// The clock of the ticks: the times at which frames leave.
    clock: Clock,
    /// The time at which the next half of a tick is due.
    due: Micros,
    /// Whether the first half is done, and waits for its time to send.
    prepared: bool,
    health: Health,
    /// What the motors have seen of the switch in the first half.
    seen: Seen,
    /// Time that the first half took.
    took: Micros,
    last_start: Option<Micros>,
    tx: TxBatch,
    traffic: Traffic,
    recovery: Recovery,
    /// The subscriptions' state that the port knows.
    subscriptions: u32,
    listening: bool,
    server: Server<'p, BusStatus, { MotorBus::CAPACITY }>,
}

impl<'m, 'p, P: CanPort, B: BorrowMut<MotorBus<'m>>> Runner<'m, 'p, P, B> {
    /// The first frames leave one period after `now`. If the motors do not fit on a bus of 1 Mbit/s,
    /// the robot cannot be armed: [`Unfit::Overload`](crate::Unfit::Overload).
    pub fn new(port: P, bus: B, shared: &'p BusPort, now: Micros) -> Self {
        shared.claim(bus.borrow());
        let server = Server::new(shared, bus.borrow());
        let load = bus.borrow().check_load(BITS_PER_SECOND);
        shared.publish(|status| *status = BusStatus { load, ..BusStatus::NEW });
        let mut runner = Self {
            port,
            bus,
            motors: PhantomData,
            shared,
            clock: Clock::new(now + PERIOD),
            due: now + (PERIOD - LEAD),
            prepared: false,
            health: Health::NEW,
            seen: Seen::default(),
            took: Micros::ZERO,
            last_start: None,
            tx: TxBatch::new(),
            traffic: Traffic::default(),
            recovery: Recovery::new(BusOffPolicy::default()),
            subscriptions: 0,
            listening: false,
            server,
        };
        runner.accept(shared.subscriptions().changes());
        runner
    }

    /// The same, with another policy for what happens after bus-off.
    #[must_use]
    pub fn with_bus_off(mut self, policy: BusOffPolicy) -> Self {
        self.recovery = Recovery::new(policy);
        self
    }

    fn begin_at(&mut self, first: Micros) {
        (self.clock, self.due) = (Clock::new(first), first - LEAD);
        #[cfg(feature = "record")]
        self.server.recorder.start(self, first);
    }

    /// The health of its port, as of the last tick.
    #[cfg(feature = "record")]
    pub const fn health(&self) -> Health {
        self.health
    }

    /// When [`tick`](Self::tick) is due: 60 µs before frames are to leave, and then as they are to.
    #[inline]
    pub const fn next(&self) -> Micros {
        self.due
    }

    /// Does what is due: half a tick of frames in and motors, half of frames and status out, so
    /// that work does not shift the frames; both at once in a slow loop. Never waits. `clock` is
    /// read at the start, and for the first half's time.
    pub fn tick(&mut self, clock: impl Fn() -> Micros) {
        let now = clock();
        let leave = self.clock.next();
        let seen = self.bus.borrow().switch().seen();
        #[cfg(feature = "record")]
        self.server.recorder.tick(now, seen.0);
        if !self.prepared || !self.holds(now, seen) {
            self.prepare(now);
            self.took = clock().since(now);
            #[cfg(feature = "record")]
            self.server.recorder.took(self.took);
            if now < leave {
                (self.prepared, self.due) = (true, leave);
                return;
            }
        }
        self.send(now, seen);
    }

    /// Whether the prepared may leave: nothing as old as a tick, and no torque after a stop.
    fn holds(&self, now: Micros, seen: Seen) -> bool {
        let is_stopped = self.seen.state() == ArmState::Armed
            && matches!(seen.state(), ArmState::EStopped | ArmState::Disarmed);
        !is_stopped && now.since(self.clock.next()) < PERIOD - LEAD
    }

    fn prepare(&mut self, now: Micros) {
        let elapsed = self.last_start.replace(now).map_or(PERIOD, |last| now.since(last));
        let subscriptions = self.shared.subscriptions().changes();
        if subscriptions != self.subscriptions {
            self.accept(subscriptions);
        }
        self.receive();
        self.look_after_bus(now);
        self.seen = self.bus.borrow().switch().seen();
        #[cfg(feature = "record")]
        self.server.recorder.arm(self.seen.0);
        self.server.take(
            self.bus.borrow_mut(),
            self.seen,
            // What lies in the mail may be as old as the tick is late.
            if elapsed > PERIOD { now - (elapsed - PERIOD) } else { now },
        );
        self.tx.clear();
        let dt = Seconds::from_micros(elapsed.get());
        if self.bus.borrow_mut().tick_as(self.seen, now, dt, &mut self.tx).is_err() {
            // The batch was full; the frame that found no room counts as refused.
            count(&mut self.traffic.refused);
        }
        self.server.publish(self.bus.borrow(), now);
    }

    fn send(&mut self, now: Micros, seen: Seen) {
        for (frame, stream) in self.tx.entries() {
            let submitted = self.port.submit_as(frame, stream);
            #[cfg(feature = "record")]
            self.server.recorder.sent(SENT, frame, submitted as u8);
            self.traffic.count(submitted);
        }
        self.send_outbox();

        self.prepared = false;
        self.clock.tick(now);
        self.due = self.clock.next() - LEAD;
        let bus = self.bus.borrow();
        let (received, arm) = (bus.counters(), seen.state());
        let Self { clock, traffic, health, took, .. } = self;
        self.shared.publish(|status| {
            (status.ticks, status.overruns) = (clock.ticks, clock.overruns);
            status.period = clock.period;
            status.execution.add(*took);
            (status.submitted, status.replaced) = (traffic.submitted, traffic.replaced);
            status.refused = traffic.refused;
            (status.received, status.health, status.arm) = (received, *health, arm);
        });
        #[cfg(feature = "record")]
        {
            let ticks = self.clock.ticks;
            self.server.recorder.state(self, ticks);
        }
    }

    /// Tells the port which frames the motors and the subscriptions want.
    fn accept(&mut self, subscriptions: u32) {
        self.subscriptions = subscriptions;
        let mut patterns: Vec<IdPattern, ACCEPTED> = Vec::new();
        let mut all = false;
        let mut want = |pattern| {
            // Devices that share an identifier repeat it.
            all |= !patterns.contains(&pattern) && patterns.push(pattern).is_err();
        };
        // The motors first, and always in the same order: their filters stay where they are.
        self.bus.borrow().for_each_can_ids(|ids| {
            ids.received().iter().for_each(|received| want(received.pattern));
        });
        self.listening = false;
        for filter in self.shared.subscriptions().filters() {
            self.listening = true;
            match filter {
                Filter::Pattern(pattern) => want(pattern),
                Filter::Unclaimed => {
                    want(IdPattern::any_standard());
                    want(IdPattern::any_extended());
                }
            }
        }
        if all {
            self.port.accept(&[IdPattern::any_standard(), IdPattern::any_extended()]);
        } else {
            self.port.accept(&patterns);
        }
    }

    fn receive(&mut self) {
        for _ in 0..RECEIVE_LIMIT {
            let Some((frame, at)) = self.port.receive() else {
                break;
            };
            #[cfg(feature = "record")]
            self.server.recorder.frame(&frame, at);
            let dispatch = self.bus.borrow_mut().on_frame(&frame, at);
            if self.listening {
                let claimed = dispatch != Dispatch::Unclaimed;
                self.shared.subscriptions().deliver(Received { frame, at }, claimed);
            }
        }
    }

    /// Before anything is sent: a bus that is off goes back as its policy says.
    fn look_after_bus(&mut self, now: Micros) {
        self.health = self.port.health();
        let asked = self.shared.take_recover();
        #[cfg(feature = "record")]
        self.server.recorder.health(&self.health, asked);
        let steps = self.recovery.step(&self.health, asked, now);
        if steps.emergency_stop {
            self.bus.borrow().switch().emergency_stop();
        }
        if steps.recover {
            self.port.recover();
        }
    }

    fn send_outbox(&mut self) {
        while let Some(frame) = self.shared.take_outgoing() {
            // It may have been put in before the bus ran, and knew its motors.
            let submitted = if self.shared.is_claimed(frame.id()) {
                Submitted::Refused
            } else {
                self.port.submit(&frame)
            };
            #[cfg(feature = "record")]
            self.server.recorder.sent(OUTGOING, &frame, submitted as u8);
            self.traffic.count(submitted);
        }
    }
}

#[cfg(feature = "record")]
impl<'m, P: CanPort, B: BorrowMut<MotorBus<'m>>> Recorded for Runner<'m, '_, P, B> {
    fn motors(&self) -> u8 {
        self.bus.borrow().recorded()
    }

    fn start_at(&mut self, first: Micros) {
        self.begin_at(first);
    }

    fn save(&self, part: u8, to: &mut dyn FnMut(&[u8])) {
        let bus = self.bus.borrow();
        bus.save_part(part, to);
        if part == BUS {
            let Self { clock, traffic, recovery, last_start, health, took, .. } = self;
            save(&(&bus.counters(), clock, traffic, recovery, last_start, health, took), to);
        }
    }

    fn load(&mut self, part: u8, from: &[u8]) -> bool {
        let bus = self.bus.borrow_mut();
        let Some(rest) = bus.load_part(part, from) else { return false };
        if part != BUS {
            return true;
        }
        postcard::take_from_bytes(rest).is_ok_and(|(of, _)| {
            let (counters, last_start, health, took);
            (counters, self.clock, self.traffic, self.recovery, last_start, health, took) = of;
            bus.set_counters(counters);
            (self.last_start, self.health, self.took) = (last_start, health, took);
            (self.prepared, self.due) = (false, self.clock.next() - LEAD);
            true
        })
    }

    #[cfg(not(target_os = "none"))]
    fn show(&self, part: u8, to: &mut dyn core::fmt::Write) -> core::fmt::Result {
        let bus = self.bus.borrow();
        bus.show_part(part, to)?;
        if part == BUS {
            let Self { clock, traffic, recovery, last_start, health, took, .. } = self;
            let own = (bus.counters(), clock, traffic, recovery, last_start, health, took);
            write!(to, "{own:#?}")?;
        }
        Ok(())
    }
}

/// Frames handed to the port so far, by what it did with them.
#[derive(Debug, Default)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
struct Traffic {
    submitted: u32,
    replaced: u32,
    refused: u32,
}

impl Traffic {
    fn count(&mut self, submitted: Submitted) {
        match submitted {
            Submitted::Queued => count(&mut self.submitted),
            Submitted::Replaced => {
                count(&mut self.submitted);
                count(&mut self.replaced);
            }
            Submitted::Refused => count(&mut self.refused),
        }
    }
}
