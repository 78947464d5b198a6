//! A serial line in half duplex: bytes that take their time, collide, and are heard by all
//! others.

use std::any::Any;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::task::Waker;

use crate::Nanos;
use crate::device::{EscFault, Shaft, Unit, Winding};
use crate::random::Random;
use crate::serial::{SerialEnd, UartFault};

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

/// The electronics of a device on a serial line: what it takes from the line, what it answers, what
/// it does to the winding. As [`Device`](crate::Device), for bytes.
///
/// Write it from the vendor's manual and with code of its own, never with that of the motor library
/// it is a witness for.
pub trait LineDevice: Any {
    /// Power has come: everything volatile starts afresh.
    fn power_on(&mut self, shaft: &Shaft<'_>, now: Nanos);

    /// A byte has just ended on the line.
    fn receive(&mut self, byte: u8, shaft: &Shaft<'_>, now: Nanos) -> Heard;

    /// Its effect on the winding for the next 100 µs. Its control loops and time-outs run here.
    fn drive(&mut self, shaft: &Shaft<'_>, now: Nanos) -> Winding;

    /// Has it find something wrong with itself, until power-off. Whether it knows such a fault.
    fn inject(&mut self, _fault: EscFault) -> bool {
        false
    }

    /// Sets another identifier on it. `false`: it can have no such one, and nothing happened.
    fn set_id(&mut self, _id: u8) -> bool {
        false
    }
}

/// Effect of a byte on a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Nothing for it, or nothing yet.
    Nothing,
    /// It ended a command for all devices.
    Command,
    /// It ended a command that these bytes answer, the first of them after this delay.
    Question(Vec<u8>, Nanos),
    /// It ended something that has the device's address but is no command.
    Malformed,
}

/// A node's transmitter.
#[derive(Debug, Default)]
struct Sender {
    waiting: VecDeque<u8>,
    /// The time at which the first of those may start.
    from: Nanos,
    flight: Option<Flight>,
    /// It has sent a byte, and not stopped since.
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
        match &self.flight {
            Some(flight) => Some(flight.end),
            None if !self.waiting.is_empty() => Some(self.from.max(now)),
            None => None,
        }
    }

    fn is_silent(&self) -> bool {
        self.flight.is_none() && self.waiting.is_empty()
    }
}

/// A device's place on the line.
struct Station {
    /// Which of the world's units.
    unit: usize,
    sender: Sender,
}

/// The host's end: what it received and has not taken.
#[derive(Default)]
pub(crate) struct HostEnd {
    pub(crate) received: VecDeque<u8>,
    pub(crate) reader: Option<Waker>,
    pub(crate) flusher: Option<Waker>,
    sender: Sender,
    /// An emulated chip's receiver, in place of the port.
    pub(crate) chip: Option<Rc<RefCell<dyn SerialEnd>>>,
}

impl HostEnd {
    pub(crate) fn send(&mut self, bytes: &[u8], now: Nanos) {
        if self.sender.is_silent() {
            self.sender.from = now;
        }
        self.sender.waiting.extend(bytes);
    }

    pub(crate) fn has_sent_all(&self) -> bool {
        self.sender.is_silent()
    }
}

/// One line and everything on it.
pub(crate) struct Line {
    pub(crate) config: LineConfig,
    byte_ns: u64,
    pub(crate) host: HostEnd,
    /// A foreign node.
    noise: Sender,
    stations: Vec<Station>,
    /// Frames that are to be damaged yet: the host's, and the devices'.
    damage: [u32; 2],
    trace: Option<Vec<LineEntry>>,
    pub(crate) counters: LineCounters,
}

/// Which byte of a frame noise hits, counted from its first: within the payload of anything.
const NOISE_AT: u32 = 5;

impl Line {
    pub(crate) fn new(config: LineConfig) -> Self {
        let byte_ns = 10_000_000_000 / u64::from(config.baud.max(1));
        Self {
            config,
            byte_ns,
            host: HostEnd::default(),
            noise: Sender::default(),
            stations: Vec::new(),
            damage: [0; 2],
            trace: None,
            counters: LineCounters::default(),
        }
    }

    /// Gives a unit a place on the line; its number.
    pub(crate) fn join(&mut self, unit: usize) -> usize {
        self.stations.push(Station { unit, sender: Sender::default() });
        self.stations.len() - 1
    }

    /// Drops the bytes that a device was about to send.
    pub(crate) fn silence(&mut self, station: usize) {
        self.stations[station].sender.waiting.clear();
    }

    pub(crate) fn set_station_cut(&mut self, station: usize, cut: bool) {
        self.stations[station].sender.cut = cut;
    }

    pub(crate) const fn set_cut(&mut self, cut: bool) {
        self.host.sender.cut = cut;
    }

    pub(crate) fn inject(&mut self, bytes: &[u8], now: Nanos) {
        if self.noise.is_silent() {
            self.noise.from = now;
        }
        self.noise.waiting.extend(bytes);
    }

    pub(crate) fn keep_trace(&mut self) {
        self.trace.get_or_insert_default();
    }

    pub(crate) fn take_trace(&mut self) -> Vec<LineEntry> {
        self.trace.as_mut().map(std::mem::take).unwrap_or_default()
    }

    pub(crate) const fn damage_commands(&mut self, frames: u32) {
        self.damage[0] = frames;
    }

    pub(crate) const fn damage_answers(&mut self, frames: u32) {
        self.damage[1] = frames;
    }

    pub(crate) fn next_event(&self, now: Nanos) -> Option<Nanos> {
        self.senders().filter_map(|sender| sender.next_event(now)).min()
    }

    fn senders(&self) -> impl Iterator<Item = &Sender> {
        [&self.host.sender, &self.noise]
            .into_iter()
            .chain(self.stations.iter().map(|station| &station.sender))
    }

    fn sender(&mut self, who: Who) -> &mut Sender {
        match who {
            Who::Host => &mut self.host.sender,
            Who::Noise => &mut self.noise,
            Who::Device(index) => &mut self.stations[index].sender,
        }
    }

    fn everybody(&self) -> impl Iterator<Item = Who> + use<> {
        [Who::Host, Who::Noise].into_iter().chain((0..self.stations.len()).map(Who::Device))
    }

    /// Bytes that end now are heard.
    pub(crate) fn process(&mut self, now: Nanos, random: &mut Random, units: &mut [Unit]) {
        for who in self.everybody() {
            let sender = self.sender(who);
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
    fn end(&mut self, who: Who, flight: &Flight, cut: bool, random: &mut Random) -> u8 {
        self.counters.busy_ns += self.byte_ns;
        match who {
            Who::Host => self.counters.from_host += 1,
            Who::Device(_) => self.counters.from_devices += 1,
            Who::Noise => (),
        }
        let byte = if flight.collided {
            self.counters.collided += 1;
            u8::try_from(random.below(256)).unwrap_or(0)
        } else {
            flight.byte
        };
        if let Some(trace) = self.trace.as_mut().filter(|_| !cut) {
            let start = Nanos::new(flight.end.get() - self.byte_ns);
            let from_host = who == Who::Host;
            trace.push(LineEntry { start, end: flight.end, byte, from_host });
        }
        let host_hears = match who {
            Who::Host => self.config.echo,
            _ => !cut && !self.host.sender.cut,
        };
        if host_hears && self.host.chip.is_none() {
            if self.host.received.len() < self.config.receive_capacity {
                self.host.received.push_back(byte);
            } else {
                self.counters.overrun += 1;
            }
        }
        byte
    }

    /// The devices hear a byte.
    fn tell(&mut self, who: Who, byte: u8, now: Nanos, units: &mut [Unit]) {
        for (index, Station { unit, sender }) in self.stations.iter_mut().enumerate() {
            let unit = &mut units[*unit];
            if who == Who::Device(index) || !unit.is_present() {
                continue;
            }
            if let Some((answer, after)) = unit.hear(byte, now) {
                (sender.waiting, sender.from) = (answer.into(), now + after);
            }
        }
    }

    /// Starts the nodes that have something to send, whatever others do.
    pub(crate) fn start(&mut self, now: Nanos) {
        for who in self.everybody() {
            let sender = self.sender(who);
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
            let sender = self.sender(who);
            sender.noise_in = noise_in.and_then(|bytes| bytes.checked_sub(1));
            sender.flight = Some(Flight { byte, end, collided: false });
            let host_hears =
                if who == Who::Host { self.config.echo } else { !cut && !self.host.sender.cut };
            if let Some(chip) = self.host.chip.as_ref().filter(|_| host_hears) {
                chip.borrow_mut().hear(byte, now, end);
            }
            if !cut {
                self.collide(who, now);
            }
        }
    }

    /// After how many bytes of a frame that begins now noise hits it.
    fn noise_in_frame(&mut self, who: Who) -> Option<u32> {
        let left = match who {
            Who::Host => &mut self.damage[0],
            Who::Device(_) => &mut self.damage[1],
            Who::Noise => return None,
        };
        *left = left.checked_sub(1)?;
        Some(NOISE_AT)
    }

    /// Others that are sending, and are plugged in, spoil the byte and their own.
    fn collide(&mut self, who: Who, now: Nanos) {
        let mut met = false;
        for other in self.everybody().filter(|other| *other != who) {
            let other = self.sender(other);
            if let Some(flight) = other.flight.as_mut().filter(|_| !other.cut) {
                (flight.collided, met) = (true, true);
            }
        }
        if met && let Some(flight) = &mut self.sender(who).flight {
            flight.collided = true;
        }
        if let Some(chip) = self.host.chip.as_ref().filter(|_| met && !self.host.sender.cut) {
            chip.borrow_mut().disturb(UartFault::Framing, now);
        }
    }

    /// Takes the tasks that wait for what is there now.
    pub(crate) fn take_wakers(&mut self) -> [Option<Waker>; 2] {
        let host = &mut self.host;
        let reader = if host.received.is_empty() { None } else { host.reader.take() };
        [reader, if host.has_sent_all() { host.flusher.take() } else { None }]
    }
}

/// A node of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Who {
    Host,
    Noise,
    Device(usize),
}
