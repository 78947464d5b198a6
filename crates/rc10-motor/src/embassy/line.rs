use core::borrow::BorrowMut;
use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Instant, Timer, with_deadline, with_timeout};
use embedded_io_async::{Read, Write};
use rc10_app::Seconds;
use rc10_can::{Micros, Schedule, Timing};
use rc10_message::Calls;

use super::motors::{MotorPort, MotorPorts, Server};
use super::runner::PERIOD;
use crate::arm::ArmState;
use crate::bus::MotorId;
use crate::unitree::{Rs485Bus, Rs485Counters, Step};

/// What a line and all other tasks share: a mailbox and a status per motor, and a status. One per
/// line; every method works from any task or interrupt.
pub struct Rs485Port {
    motors: MotorPorts<{ Rs485Bus::CAPACITY }>,
    status: Mutex<CriticalSectionRawMutex, RefCell<LineStatus>>,
}

/// How a line is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LineStatus {
    /// Ticks so far; starts over after 2³² (49 days).
    pub ticks: u32,
    /// Ticks that did not happen because the one before ended too late, or the processor was busy.
    pub overruns: u32,
    /// Time from one tick's start to the next one's.
    pub period: Timing,
    /// What the traffic amounted to.
    pub traffic: Rs485Counters,
    /// Times the serial port said that it could not read or write.
    pub port_errors: u32,
    /// Whether the robot is armed.
    pub arm: ArmState,
}

impl LineStatus {
    const NEW: Self = Self {
        ticks: 0,
        overruns: 0,
        period: Timing::new(),
        traffic: Rs485Counters::NEW,
        port_errors: 0,
        arm: ArmState::Disarmed,
    };
}

impl Rs485Port {
    /// The port of a line that does not run yet: it refuses all targets until it does.
    #[must_use]
    pub const fn new() -> Self {
        Self { motors: MotorPorts::new(), status: Mutex::new(RefCell::new(LineStatus::NEW)) }
    }

    /// The port of one motor. A motor the line does not have refuses everything.
    #[must_use]
    pub fn motor(&self, motor: MotorId) -> MotorPort<'_> {
        self.motors.motor(motor)
    }

    /// How the line is doing, as of its last tick.
    #[must_use]
    pub fn status(&self) -> LineStatus {
        self.status.lock(|status| *status.borrow())
    }

    /// What became of the requests to its motors.
    #[must_use]
    pub fn requests(&self) -> Calls {
        self.motors.requests().calls()
    }
}

impl Default for Rs485Port {
    fn default() -> Self {
        Self::new()
    }
}

/// Runs a line; the future never ends. One tick every millisecond, on the grid, without drift;
/// between ticks one motor after the other is asked.
///
/// `io` is the serial port: 4 Mbit/s, 8N1, with a transceiver whose direction the hardware sets
/// (driver enable). It must read as soon as there are bytes, not only when its buffer is full, and
/// keep what it received when a read is dropped: `BufferedUart` and `RingBufferedUartRx` of
/// `embassy-stm32` do. A transceiver that hears its own commands is no harm, but each counts as 17
/// bytes of garbage. Errors of the port are counted, and the line goes on.
pub async fn run_rs485<'m, P: Read + Write, L: BorrowMut<Rs485Bus<'m>>>(
    mut io: P,
    mut line: L,
    shared: &Rs485Port,
) {
    let mut runner = Runner::new(line.borrow_mut(), shared, now());
    let mut received = [0; RECEIVE];
    loop {
        if now() >= runner.schedule.next() {
            runner.tick(now());
        }
        let until = match runner.line.poll(now()) {
            Step::Send(command) => {
                let sent =
                    async { (io.write_all(&command).await.is_ok(), io.flush().await.is_ok()) };
                // Whoever takes longer for 17 bytes does not send them.
                if with_timeout(WRITE_LIMIT, sent).await != Ok((true, true)) {
                    runner.port_errors = runner.port_errors.saturating_add(1);
                }
                continue;
            }
            Step::Wait(until) => until.min(runner.schedule.next()),
        };
        let until = Instant::from_micros(until.get());
        match with_deadline(until, io.read(&mut received)).await {
            Ok(Ok(len)) if len > 0 => {
                runner.line.on_bytes(received.get(..len).unwrap_or_default(), now());
            }
            // The end of something that has none is an error, too.
            Ok(_) => {
                runner.port_errors = runner.port_errors.saturating_add(1);
                Timer::after(ERROR_PAUSE).await;
            }
            Err(_) => (),
        }
    }
}

/// Bytes taken from the port at once: more than two answers.
const RECEIVE: usize = 64;
/// A write may take so long: many times the 42.5 µs of a command.
const WRITE_LIMIT: Duration = Duration::from_millis(1);
/// A port that always fails at once must not keep the processor busy.
const ERROR_PAUSE: Duration = Duration::from_micros(100);

fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}

/// A line and its clock.
struct Runner<'r, 'm> {
    line: &'r mut Rs485Bus<'m>,
    shared: &'r Rs485Port,
    schedule: Schedule,
    last_start: Option<Micros>,
    port_errors: u32,
    requests: Server<'r, { Rs485Bus::CAPACITY }>,
}

impl<'r, 'm> Runner<'r, 'm> {
    /// The first tick is due one period after `now`.
    fn new(line: &'r mut Rs485Bus<'m>, shared: &'r Rs485Port, now: Micros) -> Self {
        for motor in line.ids() {
            shared.motors.open(motor, line.supports(motor));
        }
        shared.status.lock(|status| *status.borrow_mut() = LineStatus::NEW);
        let schedule = Schedule::new(now + PERIOD, PERIOD);
        Self {
            line,
            shared,
            schedule,
            last_start: None,
            port_errors: 0,
            requests: Server::new(&shared.motors),
        }
    }

    /// Commands in, motors, status out. Never waits.
    fn tick(&mut self, now: Micros) {
        let start = self.schedule.start(now);
        let elapsed = self.last_start.replace(now).map(|last| now.since(last));
        let dt = Seconds::from_micros(elapsed.unwrap_or(PERIOD).get());
        let motors = &self.shared.motors;
        for motor in self.line.ids() {
            if let Some(target) = motors.take_command(motor) {
                // The port has checked it; what the motor refuses all the same is counted.
                let _ = self.line.command(motor, target, now);
            }
        }
        self.requests.tick(|motor, request| match request {
            Some(request) => Some(self.line.request(motor, request)),
            None => self.line.answer(motor),
        });
        self.line.tick(now, dt);
        for motor in self.line.ids() {
            motors.publish(motor, |status| self.line.write_status(motor, now, status));
        }
        let (traffic, arm) = (self.line.counters(), self.line.switch().state());
        self.shared.status.lock(|status| {
            let status = &mut *status.borrow_mut();
            // It tells a watchdog that the line ticks: it must not stand still at the largest value.
            status.ticks = status.ticks.wrapping_add(1);
            status.overruns = status.overruns.saturating_add(start.missed);
            if let Some(elapsed) = elapsed {
                status.period.add(elapsed);
            }
            (status.traffic, status.port_errors, status.arm) = (traffic, self.port_errors, arm);
        });
    }
}
