use core::borrow::BorrowMut;
use core::marker::PhantomData;

use embassy_time::{Instant, Timer};
use heapless::Vec;
use rc10_app::Seconds;
use rc10_can::{BusOffPolicy, CanPort, Health, IdPattern, Micros, Schedule, Submitted};

use super::motors::Server;
use super::port::{BusPort, BusStatus};
use super::recovery::Recovery;
use super::subscription::{Filter, Received};
use crate::batch::TxBatch;
use crate::bus::{Dispatch, MotorBus};

/// Length of a tick.
pub(super) const PERIOD: Micros = Micros::from_millis(1);
/// Bit rate that load figures refer to.
const BITS_PER_SECOND: u32 = 1_000_000;
/// Frames taken from the port in one tick: three times what a saturated bus delivers, so that it
/// soon catches up after a pause. Bounds the work of a tick; the rest is taken in the next one.
const RECEIVE_LIMIT: usize = 64;
/// Patterns that a port is told to let in. Where more are wanted, it lets in everything.
const ACCEPTED: usize = 48;

/// Runs a bus that goes back by itself after bus-off; the future never ends. One tick every
/// millisecond, on the grid, without drift. Ticks whose time has gone by are skipped and counted.
///
/// For another [`BusOffPolicy`]: [`Runner::with_bus_off`] and [`Runner::run`].
pub fn run_bus<'m, P: CanPort, B: BorrowMut<MotorBus<'m>>>(
    port: P,
    bus: B,
    shared: &BusPort,
) -> impl Future<Output = ()> {
    Runner::new(port, bus, shared, now()).run()
}

fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}

/// What [`run_bus`] runs, for loops of your own: a bus, its CAN port, and the port it shares with
/// other tasks.
///
/// The bus is a [`MotorBus`] or a `&mut MotorBus`: on a chip a bus better stands where it was made,
/// for it is large.
pub struct Runner<'m, 'p, P, B = MotorBus<'m>> {
    port: P,
    bus: B,
    motors: PhantomData<MotorBus<'m>>,
    shared: &'p BusPort,
    schedule: Schedule,
    last_start: Option<Micros>,
    tx: TxBatch,
    traffic: Traffic,
    recovery: Recovery,
    /// The subscriptions' state that the port knows.
    subscriptions: u32,
    /// Whether there are any.
    listening: bool,
    requests: Server<'p, { MotorBus::CAPACITY }>,
}

impl<'m, 'p, P: CanPort, B: BorrowMut<MotorBus<'m>>> Runner<'m, 'p, P, B> {
    /// The first tick is due one period after `now`. If the motors do not fit on a bus of 1 Mbit/s,
    /// the robot cannot be armed: [`Unfit::Overload`](crate::Unfit::Overload).
    pub fn new(port: P, bus: B, shared: &'p BusPort, now: Micros) -> Self {
        shared.open(bus.borrow());
        let load = bus.borrow().check_load(BITS_PER_SECOND);
        shared.publish_bus(|status| *status = BusStatus { load, ..BusStatus::NEW });
        let mut runner = Self {
            port,
            bus,
            motors: PhantomData,
            shared,
            schedule: Schedule::new(now + PERIOD, PERIOD),
            last_start: None,
            tx: TxBatch::new(),
            traffic: Traffic::NONE,
            recovery: Recovery::new(BusOffPolicy::default()),
            subscriptions: 0,
            listening: false,
            requests: Server::new(shared.motors()),
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

    /// Ticks every millisecond for ever.
    ///
    /// Not written `async fn`, which would keep a second copy of the runner: 2 KiB a bus.
    pub fn run(self) -> impl Future<Output = ()> {
        let mut runner = self;
        async move {
            loop {
                Timer::at(Instant::from_micros(runner.next().get())).await;
                runner.tick(now);
            }
        }
    }

    /// When the next tick is due.
    #[must_use]
    pub const fn next(&self) -> Micros {
        self.schedule.next()
    }

    /// One tick: frames in, commands in, motors, frames out, status out. Never waits. `clock` is
    /// read at the start and at the end.
    pub fn tick(&mut self, clock: impl Fn() -> Micros) {
        let now = clock();
        let start = self.schedule.start(now);
        let elapsed = self.last_start.replace(now).map(|last| now.since(last));
        let dt = Seconds::from_micros(elapsed.unwrap_or(PERIOD).get());

        let subscriptions = self.shared.subscriptions().changes();
        if subscriptions != self.subscriptions {
            self.accept(subscriptions);
        }
        self.receive();
        let health = self.look_after_bus(now);
        self.take_commands(now);
        self.tx.clear();
        if self.bus.borrow_mut().tick(now, dt, &mut self.tx).is_err() {
            // The batch was full; the frame that found no room counts as refused.
            self.traffic.refused += 1;
        }
        for (frame, stream) in self.tx.entries() {
            self.traffic.count(self.port.submit_as(frame, stream));
        }
        self.send_outbox();
        self.publish_motors(now);

        let traffic = core::mem::replace(&mut self.traffic, Traffic::NONE);
        let bus = self.bus.borrow();
        let (received, arm) = (bus.counters(), bus.switch().state());
        let execution = clock().since(now);
        self.shared.publish_bus(|status| {
            // It tells a watchdog that the bus ticks: it must not stand still at the largest value.
            status.ticks = status.ticks.wrapping_add(1);
            status.overruns = status.overruns.saturating_add(start.missed);
            if let Some(elapsed) = elapsed {
                status.period.add(elapsed);
            }
            status.execution.add(execution);
            traffic.add_to(status);
            (status.received, status.health, status.arm) = (received, health, arm);
        });
    }

    /// Tells the port which frames the motors and the subscriptions want.
    #[cold]
    fn accept(&mut self, subscriptions: u32) {
        self.subscriptions = subscriptions;
        let mut patterns: Vec<IdPattern, ACCEPTED> = Vec::new();
        let mut all = false;
        let mut want = |pattern| {
            // Devices that share an identifier repeat it.
            all |= !patterns.contains(&pattern) && patterns.push(pattern).is_err();
        };
        // The motors first, and always in the same order: their filters stay where they are.
        self.bus.borrow().for_each_wiring(|wiring| {
            wiring.received().iter().for_each(|received| want(received.pattern));
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
            let dispatch = self.bus.borrow_mut().on_frame(&frame, at);
            if self.listening {
                let claimed = dispatch != Dispatch::Unclaimed;
                self.shared.subscriptions().deliver(Received { frame, at }, claimed);
            }
        }
    }

    /// Before anything is sent: a bus that is off goes back as its policy says.
    fn look_after_bus(&mut self, now: Micros) -> Health {
        let health = self.port.health();
        let asked = self.shared.take_recover();
        let steps = self.recovery.step(&health, asked, now);
        if steps.emergency_stop {
            self.bus.borrow().switch().emergency_stop();
        }
        if steps.recover {
            self.port.recover();
        }
        health
    }

    fn take_commands(&mut self, now: Micros) {
        let motors = self.shared.motors();
        for motor in self.bus.borrow().ids() {
            if let Some(target) = motors.take_command(motor) {
                // The port has checked it; what the motor refuses all the same is counted.
                let _ = self.bus.borrow_mut().command(motor, target, now);
            }
        }
        let bus = self.bus.borrow_mut();
        self.requests.tick(|motor, request| match request {
            Some(request) => Some(bus.request(motor, request)),
            None => bus.answer(motor),
        });
    }

    fn send_outbox(&mut self) {
        while let Some(frame) = self.shared.take_outgoing() {
            // It may have been put in before the bus ran, and knew its motors.
            let submitted = if self.shared.is_claimed(frame.id()) {
                Submitted::Refused
            } else {
                self.port.submit(&frame)
            };
            self.traffic.count(submitted);
        }
    }

    fn publish_motors(&self, now: Micros) {
        let bus = self.bus.borrow();
        for motor in bus.ids() {
            self.shared.motors().publish(motor, |status| bus.write_status(motor, now, status));
        }
    }
}

/// What became of the frames of one tick.
struct Traffic {
    submitted: u32,
    replaced: u32,
    refused: u32,
}

impl Traffic {
    const NONE: Self = Self { submitted: 0, replaced: 0, refused: 0 };

    fn count(&mut self, submitted: Submitted) {
        // A tick has few frames.
        match submitted {
            Submitted::Queued => self.submitted += 1,
            Submitted::Replaced => {
                self.submitted += 1;
                self.replaced += 1;
            }
            Submitted::Refused => self.refused += 1,
        }
    }

    fn add_to(&self, status: &mut BusStatus) {
        status.submitted = status.submitted.saturating_add(self.submitted);
        status.replaced = status.replaced.saturating_add(self.replaced);
        status.refused = status.refused.saturating_add(self.refused);
    }
}
