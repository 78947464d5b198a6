use core::borrow::BorrowMut;

use embassy_time::{Duration, Instant, Timer, with_deadline, with_timeout};
use embedded_io_async::{Read, Write};
use rc10_app::Seconds;
use rc10_time::{Micros, Timing};

use super::clock::{Clock, PERIOD, now};
use super::motors::{MotorPorts, Server};
use crate::arm::ArmState;
#[cfg(feature = "record")]
use crate::record::{BUS, Recorded, save};
use crate::supervision::count;
use crate::unitree::{Rs485Bus, Rs485Counters, Step};

/// The shared side of an RS-485 bus, for all other tasks.
pub type Rs485Port = MotorPorts<Rs485Status, { Rs485Bus::CAPACITY }>;

/// The state of an RS-485 bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Rs485Status {
    /// Ticks so far; starts over after 2³² (49 days).
    pub ticks: u32,
    /// Ticks that did not happen because the one before ended too late, or the processor was busy.
    pub overruns: u32,
    /// Time from one tick's start to the next one's.
    pub period: Timing,
    /// Exchanges and errors.
    pub traffic: Rs485Counters,
    /// Times the serial port said that it could not read or write.
    pub port_errors: u32,
    /// Whether the robot is armed.
    pub arm: ArmState,
}

impl Rs485Status {
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
    /// The port of a bus that does not run yet: it refuses all targets until it does.
    pub const fn new() -> Self {
        Self::with_status(Rs485Status::NEW)
    }

    /// Number of ticks so far, as of the bus's last one: [`Rs485Status::ticks`] alone.
    pub fn ticks(&self) -> u32 {
        self.look(|status| status.ticks)
    }
}

impl Default for Rs485Port {
    fn default() -> Self {
        Self::new()
    }
}

/// Runs an RS-485 bus, for ever: a tick every millisecond without drift, and polls in between.
///
/// `io` is the serial port: 4 Mbit/s, 8N1, with driver enable by hardware. It reads as soon as
/// there are bytes, keeps what it received when a read is dropped, and sends without a flush:
/// `BufferedUart` and `RingBufferedUartRx` of `embassy-stm32` do, and `Serial` of `rc10-bsp`.
/// Commands that it hears itself are no harm, but count as 17 bytes of garbage. Errors of the port
/// are counted, and the bus goes on.
///
/// The time from a reply to the next command decides how many motors a millisecond has room for:
/// run it on an executor of its own, below the buses', with its port's interrupts at its priority.
pub async fn run_rs485<'m, P: Read + Write, B: BorrowMut<Rs485Bus<'m>>>(
    mut io: P,
    mut bus: B,
    shared: &Rs485Port,
) {
    let mut runner = Runner::new(bus.borrow_mut(), shared, now());
    let mut received = [0; RECEIVE];
    loop {
        if now() >= runner.clock.next() {
            runner.tick(now());
        }
        let until = match runner.poll(now()) {
            Step::Send(command) => {
                // A port that takes longer for 17 bytes does not send them. Their end is not waited for:
                // the reply tells, and each wake costs the next command's time.
                let sent = with_timeout(WRITE_LIMIT, io.write_all(&command)).await;
                if !matches!(sent, Ok(Ok(()))) {
                    runner.failed();
                }
                continue;
            }
            Step::Wait(until) => until.min(runner.clock.next()),
        };
        let until = Instant::from_micros(until.get());
        match with_deadline(until, io.read(&mut received)).await {
            Ok(Ok(len)) if len > 0 => {
                runner.hear(received.get(..len).unwrap_or_default(), now());
            }
            // The end of something that has none is an error, too.
            Ok(_) => {
                runner.failed();
                Timer::after(ERROR_PAUSE).await;
            }
            Err(_) => (),
        }
    }
}

/// Bytes taken from the port at once: more than two replies.
const RECEIVE: usize = 64;
/// The longest time a write may take: many times the 42.5 µs of a command.
const WRITE_LIMIT: Duration = Duration::from_millis(1);
/// A port that always fails at once must not keep the processor busy.
const ERROR_PAUSE: Duration = Duration::from_micros(100);

/// A line and its shared port: the state of [`run_rs485`].
pub struct Runner<'r, 'm> {
    bus: &'r mut Rs485Bus<'m>,
    shared: &'r Rs485Port,
    clock: Clock,
    port_errors: u32,
    server: Server<'r, Rs485Status, { Rs485Bus::CAPACITY }>,
}

impl<'r, 'm> Runner<'r, 'm> {
    /// Its first tick is due one period after `now`.
    pub fn new(bus: &'r mut Rs485Bus<'m>, shared: &'r Rs485Port, now: Micros) -> Self {
        let server = Server::new(shared, bus);
        shared.publish(|status| *status = Rs485Status::NEW);
        let runner = Self { bus, shared, clock: Clock::new(now + PERIOD), port_errors: 0, server };
        #[cfg(feature = "record")]
        runner.server.recorder.start(&runner, now + PERIOD);
        runner
    }

    /// Commands in, motors, status out. Never waits.
    pub fn tick(&mut self, now: Micros) {
        let elapsed = self.clock.tick(now).unwrap_or(PERIOD);
        let seen = self.bus.switch().seen();
        #[cfg(feature = "record")]
        self.server.recorder.tick(now, seen.0);
        // As old as the tick is late, perhaps.
        let as_of = if elapsed > PERIOD { now - (elapsed - PERIOD) } else { now };
        self.server.take(self.bus, seen, as_of);
        self.bus.tick_as(seen, now, Seconds::from_micros(elapsed.get()));
        self.server.publish(self.bus, now);
        let Self { bus, clock, .. } = self;
        self.shared.publish(|status| {
            (status.ticks, status.overruns) = (clock.ticks, clock.overruns);
            (status.period, status.traffic) = (clock.period, bus.counters());
            (status.port_errors, status.arm) = (self.port_errors, seen.state());
        });
        #[cfg(feature = "record")]
        {
            let ticks = self.clock.ticks;
            self.server.recorder.state(self, ticks);
        }
    }

    /// The next step on the line.
    pub fn poll(&mut self, now: Micros) -> Step {
        let step = self.bus.poll(now);
        #[cfg(feature = "record")]
        self.server
            .recorder
            .polled(now, if let Step::Send(command) = &step { command } else { &[] });
        step
    }

    /// Takes bytes.
    pub fn hear(&mut self, bytes: &[u8], now: Micros) {
        #[cfg(feature = "record")]
        self.server.recorder.bytes(bytes, now);
        self.bus.on_bytes(bytes, now);
    }

    /// The port has failed.
    pub fn failed(&mut self) {
        #[cfg(feature = "record")]
        self.server.recorder.failed();
        count(&mut self.port_errors);
    }
}

#[cfg(feature = "record")]
impl Recorded for Runner<'_, '_> {
    fn motors(&self) -> u8 {
        self.bus.recorded()
    }

    fn start_at(&mut self, first: Micros) {
        self.clock = Clock::new(first);
    }

    fn save(&self, part: u8, to: &mut dyn FnMut(&[u8])) {
        self.bus.save_part(part, to);
        if part == BUS {
            save(&(&self.bus.line, &self.clock, self.port_errors), to);
        }
    }

    fn load(&mut self, part: u8, from: &[u8]) -> bool {
        let Some(rest) = self.bus.load_part(part, from) else { return false };
        if part != BUS {
            return true;
        }
        let own = postcard::take_from_bytes(rest);
        own.is_ok_and(|(own, _)| {
            (self.bus.line, self.clock, self.port_errors) = own;
            true
        })
    }

    #[cfg(not(target_os = "none"))]
    fn show(&self, part: u8, to: &mut dyn core::fmt::Write) -> core::fmt::Result {
        self.bus.show_part(part, to)?;
        if part == BUS {
            write!(to, "{:#?}", (&self.bus.line, &self.clock, self.port_errors))?;
        }
        Ok(())
    }
}
