use embassy_time::{Instant, Timer};
use rc10_app::Seconds;
use rc10_can::{CanPort, Micros, Schedule, Submitted};

use super::port::{BusPort, BusStatus};
use super::subscription::Received;
use crate::batch::TxBatch;
use crate::bus::{Dispatch, MotorBus};

/// Length of a tick.
pub(super) const PERIOD: Micros = Micros::from_millis(1);
/// Bit rate that load figures refer to.
const BITS_PER_SECOND: u32 = 1_000_000;
/// Frames taken from the port in one tick: twice what a saturated bus delivers. Bounds the work of
/// a tick after an outage; the rest is taken in the next one.
const RECEIVE_LIMIT: usize = 42;

/// Runs a bus; the future never ends. One tick every millisecond, on the grid, without drift. Ticks whose time
/// has gone by are skipped and counted.
///
/// Not written `async fn`, which would keep a second copy of its arguments: 2 KiB a bus.
pub fn run_bus<P: CanPort>(
    port: P,
    bus: MotorBus<'_>,
    shared: &BusPort,
) -> impl Future<Output = ()> {
    let mut runner = Runner::new(port, bus, shared, now());
    async move {
        loop {
            Timer::at(Instant::from_micros(runner.next().get())).await;
            runner.tick(now);
        }
    }
}

fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}

/// What [`run_bus`] runs, for loops of your own: a bus, its CAN port, and the port it shares with
/// other tasks.
pub struct Runner<'m, 'p, P> {
    port: P,
    bus: MotorBus<'m>,
    shared: &'p BusPort,
    schedule: Schedule,
    last_start: Option<Micros>,
    tx: TxBatch,
    status: BusStatus,
}

impl<'m, 'p, P: CanPort> Runner<'m, 'p, P> {
    /// The first tick is due one period after `now`.
    pub fn new(port: P, bus: MotorBus<'m>, shared: &'p BusPort, now: Micros) -> Self {
        shared.open(&bus);
        let mut status = BusStatus::NEW;
        status.load = bus.load(BITS_PER_SECOND);
        shared.publish_bus(status);
        Self {
            port,
            bus,
            shared,
            schedule: Schedule::new(now + PERIOD, PERIOD),
            last_start: None,
            tx: TxBatch::new(),
            status,
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
        self.status.overruns = self.status.overruns.saturating_add(start.missed);
        let elapsed = self.last_start.replace(now).map(|last| now.since(last));
        if let Some(elapsed) = elapsed {
            self.status.period.add(elapsed);
        }
        let dt = Seconds::from_micros(elapsed.unwrap_or(PERIOD).get());

        self.receive();
        self.take_commands(now);
        self.tx.clear();
        if self.bus.tick(now, dt, &mut self.tx).is_err() {
            // The batch was full; the frame that found no room counts as refused.
            self.status.refused = self.status.refused.saturating_add(1);
        }
        let submitted = self.tx.frames().iter().map(|frame| self.port.submit(frame));
        submitted.for_each(|submitted| self.status.count(submitted));
        self.send_outbox();
        self.publish(now, clock);
    }

    fn receive(&mut self) {
        for _ in 0..RECEIVE_LIMIT {
            let Some((frame, at)) = self.port.receive() else {
                break;
            };
            let claimed = self.bus.on_frame(&frame, at) != Dispatch::Unclaimed;
            self.shared.deliver(Received { frame, at }, claimed);
        }
    }

    fn take_commands(&mut self, now: Micros) {
        for motor in self.bus.ids() {
            let (target, request) = self.shared.take_mail(motor);
            if let Some(target) = target {
                // The port has checked it; what the motor refuses all the same is counted.
                let _ = self.bus.command(motor, target, now);
            }
            if let Some(request) = request {
                self.shared.answer(motor, self.bus.request(motor, request));
            }
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
            self.status.count(submitted);
        }
    }

    fn publish(&mut self, now: Micros, clock: impl Fn() -> Micros) {
        for motor in self.bus.ids() {
            if let Some(status) = self.bus.status(motor, now) {
                self.shared.publish(motor, status);
            }
        }
        // It tells a watchdog that the bus ticks: it must not stand still at the largest value.
        self.status.ticks = self.status.ticks.wrapping_add(1);
        self.status.received = self.bus.counters();
        self.status.health = self.port.health();
        self.status.arm = self.bus.switch().state();
        self.status.execution.add(clock().since(now));
        self.shared.publish_bus(self.status);
    }
}

impl BusStatus {
    fn count(&mut self, submitted: Submitted) {
        let counter = match submitted {
            Submitted::Queued => &mut self.submitted,
            Submitted::Replaced => {
                self.submitted = self.submitted.saturating_add(1);
                &mut self.replaced
            }
            Submitted::Refused => &mut self.refused,
        };
        *counter = counter.saturating_add(1);
    }
}
