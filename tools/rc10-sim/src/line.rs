//! A serial line in half duplex: bytes that take their time, collide, and are heard by all
//! others.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use crate::Nanos;
use crate::device::{Device, Place, Unit};
use crate::handles::Esc;
use crate::plant::Plant;
use crate::random::Random;
use crate::uart::{HostEnd, Hosted, Medium, SerialEnd, UartFault, UartPort};
use crate::world::Inner;

/// Configuration of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineConfig {
    /// Bits a second. A byte is ten of them: start, eight, stop; it lasts whole nanoseconds, rounded
    /// down.
    pub baud: u32,
    /// Whether the host hears its own bytes, as with a transceiver whose receiver stays on.
    pub echo: bool,
    /// Bytes that the host's receive buffer holds; what comes while it is full is lost.
    pub receive_capacity: usize,
}

impl Default for LineConfig {
    /// 4 Mbit/s, no echo, 256 bytes.
    fn default() -> Self {
        Self { baud: 4_000_000, echo: false, receive_capacity: 256 }
    }
}

/// A byte that was on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineEntry {
    /// The first edge of its start bit.
    pub start: Nanos,
    /// The end of its stop bit.
    pub end: Nanos,
    /// The byte as it was heard: one that met another is something else.
    pub byte: u8,
    /// Whether the host sent it.
    pub from_host: bool,
}

/// Counters of a line since the world began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LineCounters {
    /// Bytes that the host sent.
    pub from_host: u64,
    /// Bytes that devices sent.
    pub from_devices: u64,
    /// Bytes that met others and came out as something else.
    pub collided: u64,
    /// Bytes that found the host's receive buffer full.
    pub overrun: u64,
    /// Time with a byte on the line, ns; bytes that collide count each.
    pub busy_ns: u64,
}

/// Effect of a byte on a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Nothing for it, or nothing yet.
    Nothing,
    /// The byte ended a command for all devices.
    Command,
    /// The byte ended a command that these bytes answer, the first of them after this delay.
    Question(Vec<u8>, Nanos),
    /// The byte ended something with the device's address that is not a command.
    Malformed,
}

/// A node's transmitter.
#[derive(Debug, Default)]
struct Sender {
    /// Which of the world's units, if it is a device's.
    unit: Option<usize>,
    waiting: VecDeque<u8>,
    /// The time at which the first of those may start.
    from: Nanos,
    flight: Option<Flight>,
    /// Whether it has sent a byte, and not stopped since.
    in_frame: bool,
    /// Bytes until one of this frame that noise changes.
    noise_in: Option<u32>,
    cut: bool,
}

/// A byte on the line.
#[derive(Debug)]
struct Flight {
    byte: u8,
    end: Nanos,
    collided: bool,
}

impl Sender {
    fn next_event(&self, now: Nanos) -> Option<Nanos> {
        let start = (!self.waiting.is_empty()).then(|| self.from.max(now));
        self.flight.as_ref().map(|flight| flight.end).or(start)
    }

    fn is_silent(&self) -> bool {
        self.flight.is_none() && self.waiting.is_empty()
    }

    /// Sends bytes after those that wait, not before `now`.
    fn send(&mut self, bytes: &[u8], now: Nanos) {
        if self.is_silent() {
            self.from = now;
        }
        self.waiting.extend(bytes);
    }
}

/// The place of the host among the senders, and that of a foreign node; behind them are the devices.
const HOST: usize = 0;
const NOISE: usize = 1;

/// One line and everything on it.
#[derive(Default)]
pub(crate) struct LineWire {
    config: LineConfig,
    byte_ns: u64,
    host: HostEnd,
    senders: Vec<Sender>,
    /// Frames that are to be damaged yet: the host's, and the devices'.
    damage: [u32; 2],
    trace: Option<Vec<LineEntry>>,
    counters: LineCounters,
}

/// Which byte of a frame noise hits, counted from its first: within the payload of anything.
const NOISE_AT: u32 = 5;

impl LineWire {
    pub(crate) fn new(config: LineConfig) -> Self {
        let byte_ns = 10_000_000_000 / u64::from(config.baud.max(1));
        Self {
            config,
            byte_ns,
            senders: vec![Sender::default(), Sender::default()],
            ..Self::default()
        }
    }

    /// Gives a unit a place on the line; its number.
    pub(crate) fn join(&mut self, unit: usize) -> usize {
        self.senders.push(Sender { unit: Some(unit), ..Sender::default() });
        self.senders.len() - 1
    }

    /// Drops the bytes that a device was about to send.
    pub(crate) fn silence(&mut self, station: usize) {
        self.senders[station].waiting.clear();
    }

    pub(crate) fn set_station_cut(&mut self, station: usize, cut: bool) {
        self.senders[station].cut = cut;
    }

    pub(crate) fn next_event(&self, now: Nanos) -> Option<Nanos> {
        self.senders.iter().filter_map(|sender| sender.next_event(now)).min()
    }

    /// Whether the host hears what a sender says.
    fn is_heard(&self, who: usize) -> bool {
        if who == HOST {
            self.config.echo
        } else {
            !self.senders[who].cut && !self.senders[HOST].cut
        }
    }

    /// Bytes that end now are heard.
    pub(crate) fn process(&mut self, now: Nanos, random: &mut Random, units: &mut [Unit]) {
        for who in 0..self.senders.len() {
            let sender = &mut self.senders[who];
            if let Some(flight) = sender.flight.take_if(|flight| flight.end <= now) {
                let cut = sender.cut;
                let byte = self.end(who, &flight, cut, random);
                if !cut {
                    self.tell(who, byte, now, units);
                }
            }
        }
    }

    /// A byte has ended: what it came out as.
    fn end(&mut self, who: usize, flight: &Flight, cut: bool, random: &mut Random) -> u8 {
        self.counters.busy_ns += self.byte_ns;
        match who {
            HOST => self.counters.from_host += 1,
            NOISE => (),
            _ => self.counters.from_devices += 1,
        }
        let byte = if flight.collided {
            self.counters.collided += 1;
            u8::try_from(random.below(256)).unwrap_or(0)
        } else {
            flight.byte
        };
        if let Some(trace) = self.trace.as_mut().filter(|_| !cut) {
            let start = Nanos::new(flight.end.get() - self.byte_ns);
            let from_host = who == HOST;
            trace.push(LineEntry { start, end: flight.end, byte, from_host });
        }
        if self.is_heard(who) && self.host.chip.is_none() {
            if self.host.has_room(self.config.receive_capacity) {
                self.host.hear(Ok(byte));
            } else {
                self.counters.overrun += 1;
            }
        }
        byte
    }

    /// The devices hear a byte.
    fn tell(&mut self, who: usize, byte: u8, now: Nanos, units: &mut [Unit]) {
        for (index, sender) in self.senders.iter_mut().enumerate() {
            if let Some(unit) = sender.unit.filter(|_| index != who)
                && units[unit].is_present()
                && let Some((answer, after)) = units[unit].hear(byte, now)
            {
                (sender.waiting, sender.from) = (answer.into(), now + after);
            }
        }
    }

    /// Starts the nodes that have something to send, whatever others do.
    pub(crate) fn start(&mut self, now: Nanos) {
        for who in 0..self.senders.len() {
            let sender = &mut self.senders[who];
            if sender.flight.is_some() {
                continue;
            }
            let due = if sender.from <= now { sender.waiting.pop_front() } else { None };
            let Some(byte) = due else {
                sender.in_frame = false;
                continue;
            };
            let (begins, cut) = (!std::mem::replace(&mut sender.in_frame, true), sender.cut);
            let noise_in = if begins { self.noise_in_frame(who) } else { sender.noise_in };
            let end = now + Nanos::new(self.byte_ns);
            let byte = byte ^ u8::from(noise_in == Some(0));
            let sender = &mut self.senders[who];
            sender.noise_in = noise_in.and_then(|bytes| bytes.checked_sub(1));
            sender.flight = Some(Flight { byte, end, collided: false });
            if let Some(chip) = self.host.chip.as_ref().filter(|_| self.is_heard(who)) {
                chip.borrow_mut().hear(byte, now, end);
            }
            if !cut {
                self.collide(who, now);
            }
        }
    }

    /// After how many bytes of a frame that begins now noise hits it.
    fn noise_in_frame(&mut self, who: usize) -> Option<u32> {
        let left = match who {
            HOST => &mut self.damage[0],
            NOISE => return None,
            _ => &mut self.damage[1],
        };
        *left = left.checked_sub(1)?;
        Some(NOISE_AT)
    }

    /// Others that are sending, and are plugged in, spoil the byte and their own.
    fn collide(&mut self, who: usize, now: Nanos) {
        let mut met = false;
        let others = self.senders.iter_mut().enumerate().filter(|(other, _)| *other != who);
        for (_, other) in others {
            if let Some(flight) = other.flight.as_mut().filter(|_| !other.cut) {
                (flight.collided, met) = (true, true);
            }
        }
        if met && let Some(flight) = &mut self.senders[who].flight {
            flight.collided = true;
        }
        if let Some(chip) = self.host.chip.as_ref().filter(|_| met && !self.senders[HOST].cut) {
            chip.borrow_mut().disturb(UartFault::Framing, now);
        }
    }
}

impl Hosted for LineWire {
    fn host(&mut self) -> &mut HostEnd {
        &mut self.host
    }

    fn send(&mut self, bytes: &[u8], now: Nanos) {
        self.senders[HOST].send(bytes, now);
    }

    fn has_sent_all(&self) -> bool {
        self.senders[HOST].is_silent()
    }
}

/// A serial line in half duplex (RS-485) of a [`World`](crate::World), with one host.
#[derive(Clone)]
pub struct Line {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Line {
    /// Puts a device with its motor on the line, powered, at rest.
    pub fn add(&self, device: impl Device, plant: Plant) -> Esc {
        let line = self.index;
        Esc::plug_in(&self.inner, device, plant, |inner, _| Place::Line {
            line,
            station: inner.lines[line].join(inner.units.len()),
        })
    }

    /// The host's serial port; all of them share one buffer.
    pub fn port(&self) -> UartPort {
        UartPort { inner: Rc::clone(&self.inner), medium: Medium::Line(self.index) }
    }

    /// Bits a second.
    pub fn baud(&self) -> u32 {
        self.with(|line, _| line.config.baud)
    }

    /// Puts the receiver of an emulated chip in the place of the host's port, whose buffer stays
    /// empty from then on. It is told of characters as they begin; one that collides is a framing
    /// error to it. What the chip sends comes by [`deliver`](Self::deliver).
    pub fn attach(&self, chip: Rc<RefCell<dyn SerialEnd>>) {
        self.with(|line, _| line.host.chip = Some(chip));
    }

    /// The attached chip begins to send a character: now, or as soon as its last one has ended.
    pub fn deliver(&self, byte: u8, start: Nanos) {
        self.with(|line, _| line.send(&[byte], start));
    }

    /// Unplugs the host, or plugs it in again. Unplugged it is not heard, and hears nothing.
    pub fn set_cut(&self, cut: bool) {
        self.with(|line, _| line.senders[HOST].cut = cut);
    }

    /// Switches the power of all devices on the line: as [`Esc::set_power`] each.
    pub fn set_power(&self, powered: bool) {
        let is_here = |place| matches!(place, Place::Line { line, .. } if line == self.index);
        Esc::set_power_of(&self.inner, is_here, powered);
    }

    /// A foreign node sends bytes, from now on and after those it was given before. A device that
    /// sends at the same time collides with it.
    pub fn inject(&self, bytes: &[u8]) {
        self.with(|line, now| line.senders[NOISE].send(bytes, now));
    }

    /// Damages one bit in each of the host's next frames. A frame is what a node sends without a
    /// pause. Replaces the number given before.
    pub fn damage_commands(&self, frames: u32) {
        self.with(|line, _| line.damage[0] = frames);
    }

    /// Damages one bit in each of the devices' next frames.
    pub fn damage_answers(&self, frames: u32) {
        self.with(|line, _| line.damage[1] = frames);
    }

    /// Keeps the bytes from now on for [`take_trace`](Self::take_trace).
    pub fn keep_trace(&self) {
        self.with(|line, _| {
            line.trace.get_or_insert_default();
        });
    }

    /// The bytes on the line since the last call, in the order of their ends: what a node in the
    /// middle would hear. Those of an end that is unplugged are not on it.
    #[must_use]
    pub fn take_trace(&self) -> Vec<LineEntry> {
        self.with(|line, _| line.trace.as_mut().map(std::mem::take).unwrap_or_default())
    }

    /// Counters since the world began.
    pub fn counters(&self) -> LineCounters {
        self.with(|line, _| line.counters)
    }

    fn with<T>(&self, f: impl FnOnce(&mut LineWire, Nanos) -> T) -> T {
        Inner::with(&self.inner, |inner, now| f(&mut inner.lines[self.index], now))
    }
}
