//! A port in memory: bytes that come in time, faults among them, and a task that is late.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;

use embassy_time::{Instant, Timer};
use embedded_io_async::{ErrorKind, ErrorType, Read};
use proptest::collection::vec;
use proptest::prelude::*;
use rc10_module::{Counters, Reception, listen};
use rc10_time::Micros;

use super::clock::{run_until, spend};
use super::observed::{Watched, Work};
use super::wire::Wire;

/// An answer of a port.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    Byte(u8),
    /// An overrun, a framing error: bytes are missing here.
    Error,
    /// A read of nothing, at once.
    Nothing,
}

/// The events on a line, each with its time from the beginning, ns.
#[derive(Clone, Debug, Default)]
pub struct Line {
    pub events: Vec<(u64, Event)>,
    now: u64,
}

impl Line {
    /// Sends bytes without a pause, after a silence in microseconds.
    pub fn send(&mut self, gap: u64, bytes: &[u8], byte_ns: u64) {
        self.now += gap * 1000;
        for &byte in bytes {
            self.now += byte_ns;
            self.events.push((self.now, Event::Byte(byte)));
        }
    }
}

/// How a task reads: how many bytes it gets at most, and how late it is, µs.
pub type Reading = (usize, u64);

/// The most a task is late, µs: what a robot of two priorities allows itself.
pub const LATE: u64 = 2000;

/// A task comes late, or gets little: not both, for it would never catch up.
pub fn readings() -> impl Strategy<Value = Vec<Reading>> {
    vec(prop_oneof![(1..=64_usize, Just(0)), (Just(64), 0..LATE)], 1..8)
}

struct Port {
    events: VecDeque<(Instant, Event)>,
    readings: Vec<Reading>,
    count: usize,
}

impl ErrorType for Port {
    type Error = ErrorKind;
}

impl Read for Port {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        let Some(&(at, event)) = self.events.front() else { std::future::pending().await };
        let waits = Instant::now() < at;
        Timer::at(at).await;
        let (most, late) = self.readings[self.count % self.readings.len()];
        self.count += 1;
        if waits {
            spend(Micros::new(late));
        }
        match event {
            Event::Error | Event::Nothing => {
                self.events.pop_front();
                if matches!(event, Event::Error) { Err(ErrorKind::Other) } else { Ok(0) }
            }
            Event::Byte(_) => {
                let (mut read, now) = (0, Instant::now());
                while let Some(&(at, Event::Byte(byte))) = self.events.front()
                    && at <= now
                    && read < most.min(buffer.len())
                {
                    self.events.pop_front();
                    buffer[read] = byte;
                    read += 1;
                }
                Ok(read)
            }
        }
    }
}

/// The outcome of `listen` on a line.
#[derive(Debug)]
pub struct Listened {
    /// The text of each message.
    pub heard: Vec<Vec<f64>>,
    pub counters: Counters,
    pub in_frames: u32,
}

/// Listens to a line, and for ten seconds more.
pub fn listened<W: Wire>(wire: W, line: &Line, readings: &[Reading]) -> Listened {
    let start = Instant::now().as_micros();
    let timed = |&(ns, event): &(u64, Event)| (Instant::from_micros(start + ns / 1000), event);
    let events = line.events.iter().map(timed).collect();
    let port = Port { events, readings: readings.to_vec(), count: 0 };
    let work = Cell::new(Work::default());
    let reception = Reception::new();
    let heard = RefCell::new(Vec::new());
    let watched = Watched { protocol: wire.protocol(), work: &work };
    let listening = listen(port, watched, &reception, |message, _| {
        heard.borrow_mut().push(wire.told(&message));
    });
    let (last, _) = line.events.last().unwrap();
    run_until(Micros::new(start + last / 1000 + 10_000_000), listening);
    let counters = reception.read();
    let in_frames = wire.in_frames(work.get().in_frames, counters.frames);
    Listened { heard: heard.into_inner(), counters, in_frames }
}
