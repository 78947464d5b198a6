//! A serial link in full duplex: a UART of the host's at one end, a device at the other, and bytes
//! that take their time.

use std::any::Any;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt;
use std::rc::Rc;
use std::task::Waker;

use crate::Nanos;

/// Configuration of a serial link, at both ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialConfig {
    /// Bits a second.
    pub baud: u32,
    /// Bits of a character: start, data, parity, stop. It lasts whole nanoseconds, rounded down.
    pub bits: u8,
    /// Bytes that the host's receive buffer holds; what comes while it is full is lost.
    pub receive_capacity: usize,
}

impl Default for SerialConfig {
    /// 115200 baud, 8N1, 256 bytes.
    fn default() -> Self {
        Self { baud: 115_200, bits: 10, receive_capacity: 256 }
    }
}

impl SerialConfig {
    /// Duration of a character.
    #[must_use]
    pub const fn character(&self) -> Nanos {
        let baud = if self.baud == 0 { 1 } else { self.baud };
        Nanos::new(self.bits as u64 * 1_000_000_000 / baud as u64)
    }
}

/// The electronics at the device's end of a serial link.
///
/// Write it from the vendor's manual and with code of its own, never with that of the library it is
/// a witness for.
pub trait SerialDevice: Any {
    /// Power has come: everything volatile starts afresh.
    fn power_on(&mut self, now: Nanos);

    /// The time of its next event without the link's doing. In the past means now.
    fn next_event(&self) -> Option<Nanos>;

    /// Lets that happen. What it puts into `send` goes over the link, without a pause, after what
    /// waits there already.
    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>);

    /// A byte from the host has just ended on the link.
    fn receive(&mut self, byte: u8, now: Nanos);
}

/// The receiver of an emulated chip, in place of the host's port.
pub trait SerialEnd {
    /// A character begins on the wire: the first edge of its start bit, and the end of its last
    /// stop bit.
    fn hear(&mut self, byte: u8, start: Nanos, end: Nanos);

    /// Something damages the character that is on the wire, or, if none is, looks like one that is
    /// damaged.
    fn disturb(&mut self, _fault: UartFault, _at: Nanos) {}
}

/// Errors that a UART tells of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UartFault {
    /// It found the receive register full.
    Overrun,
    /// No stop bit.
    Framing,
    /// The parity bit is wrong.
    Parity,
    /// The samples of a bit differ.
    Noise,
    /// The line was low for longer than a character.
    Break,
}

impl UartFault {
    /// Each of them.
    pub const ALL: [Self; 5] =
        [Self::Overrun, Self::Framing, Self::Parity, Self::Noise, Self::Break];
}

impl fmt::Display for UartFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Overrun => "overrun: bytes were not taken in time",
            Self::Framing => "framing error: no stop bit",
            Self::Parity => "parity error",
            Self::Noise => "noise within a bit",
            Self::Break => "break: the line was held low",
        })
    }
}

impl std::error::Error for UartFault {}

impl embedded_io_async::Error for UartFault {
    fn kind(&self) -> embedded_io_async::ErrorKind {
        match self {
            Self::Overrun => embedded_io_async::ErrorKind::Other,
            _ => embedded_io_async::ErrorKind::InvalidData,
        }
    }
}

/// Counters of a serial link since the world began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SerialCounters {
    /// Bytes that the host sent.
    pub from_host: u64,
    /// Bytes that the device sent.
    pub from_device: u64,
    /// Bytes that found the host's receive buffer full.
    pub overrun: u64,
    /// Faults that were injected.
    pub injected: u64,
    /// Bytes in either direction that were lost, because the link was cut or there was no power.
    pub unheard: u64,
}

/// A byte on the wire.
#[derive(Debug)]
struct Flight {
    byte: u8,
    end: Nanos,
    cut: bool,
    fault: Option<UartFault>,
}

/// The host's end: what it received and has not taken, and what it has to send.
#[derive(Default)]
pub(crate) struct HostEnd {
    received: VecDeque<Result<u8, UartFault>>,
    pub(crate) waiting: VecDeque<u8>,
    pub(crate) reader: Option<Waker>,
    pub(crate) flusher: Option<Waker>,
}

impl HostEnd {
    /// Takes what there is up to the next fault, or that fault; `None` if there is nothing.
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> Option<Result<usize, UartFault>> {
        if buffer.is_empty() {
            return Some(Ok(0));
        }
        if let Err(fault) = *self.received.front()? {
            self.received.pop_front();
            return Some(Err(fault));
        }
        let mut count = 0;
        for (to, byte) in buffer.iter_mut().zip(self.received.iter().map_while(|heard| heard.ok()))
        {
            *to = byte;
            count += 1;
        }
        self.received.drain(..count);
        Some(Ok(count))
    }

    /// A run of lost bytes is one fault.
    fn hear(&mut self, heard: Result<u8, UartFault>) {
        if heard.is_ok() || self.received.back() != Some(&heard) {
            self.received.push_back(heard);
        }
    }
}

/// One link and its device.
pub(crate) struct Link {
    pub(crate) config: SerialConfig,
    character: Nanos,
    device: Box<dyn SerialDevice>,
    powered: bool,
    cut: bool,
    waiting: VecDeque<u8>,
    to_host: Option<Flight>,
    to_device: Option<Flight>,
    pub(crate) host: HostEnd,
    chip: Option<Rc<RefCell<dyn SerialEnd>>>,
    /// The bytes that the chip has sent, and the time at which each has ended.
    delivered: VecDeque<(u8, Nanos)>,
    pub(crate) counters: SerialCounters,
}

impl Link {
    pub(crate) fn new(config: SerialConfig, mut device: Box<dyn SerialDevice>, now: Nanos) -> Self {
        device.power_on(now);
        Self {
            config,
            character: config.character(),
            device,
            powered: true,
            cut: false,
            waiting: VecDeque::new(),
            to_host: None,
            to_device: None,
            host: HostEnd::default(),
            chip: None,
            delivered: VecDeque::new(),
            counters: SerialCounters::default(),
        }
    }

    pub(crate) fn device(&mut self) -> &mut dyn Any {
        &mut *self.device
    }

    pub(crate) fn attach(&mut self, chip: Rc<RefCell<dyn SerialEnd>>) {
        self.chip = Some(chip);
    }

    pub(crate) fn deliver(&mut self, byte: u8, at: Nanos) {
        self.delivered.push_back((byte, at));
    }

    pub(crate) const fn set_cut(&mut self, cut: bool) {
        self.cut = cut;
    }

    pub(crate) fn set_power(&mut self, powered: bool, now: Nanos) {
        if self.powered != powered {
            self.powered = powered;
            // What it was about to say it says no more.
            self.waiting.clear();
            if powered {
                self.device.power_on(now);
            }
        }
    }

    pub(crate) fn inject(&mut self, fault: UartFault, now: Nanos) {
        self.counters.injected += 1;
        if let Some(chip) = &self.chip {
            chip.borrow_mut().disturb(fault, now);
        } else if let Some(flight) = self.to_host.as_mut().filter(|flight| !flight.cut) {
            flight.fault = Some(fault);
        } else {
            self.host.hear(Err(fault));
        }
    }

    pub(crate) fn has_sent_all(&self) -> bool {
        self.host.waiting.is_empty() && self.to_device.is_none()
    }

    pub(crate) fn next_event(&self, now: Nanos) -> Option<Nanos> {
        let flights = [&self.to_host, &self.to_device].into_iter().flatten();
        let device = if self.powered { self.device.next_event() } else { None };
        let delivered = self.delivered.front().map(|&(_, at)| at);
        let soon = device.into_iter().chain(delivered).map(|at| at.max(now));
        flights.map(|flight| flight.end).chain(soon).min()
    }

    /// Bytes that end now are heard; then the device does what it does now.
    pub(crate) fn process(&mut self, now: Nanos) {
        if let Some(flight) = self.to_host.take_if(|flight| flight.end <= now) {
            self.counters.from_device += 1;
            self.end_at_host(&flight);
        }
        if let Some(flight) = self.to_device.take_if(|flight| flight.end <= now) {
            self.end_at_device(flight.byte, flight.cut, now);
        }
        while let Some((byte, _)) = self.delivered.front().copied().filter(|&(_, at)| at <= now) {
            self.delivered.pop_front();
            self.end_at_device(byte, self.cut, now);
        }
        if self.powered && self.device.next_event().is_some_and(|at| at <= now) {
            self.device.advance(now, &mut self.waiting);
        }
    }

    fn end_at_host(&mut self, flight: &Flight) {
        if flight.cut {
            self.counters.unheard += 1;
        } else if self.chip.is_some() {
            // It has heard the character begin.
        } else if let Some(fault) = flight.fault {
            self.host.hear(Err(fault));
        } else if self.host.received.iter().filter(|heard| heard.is_ok()).count()
            < self.config.receive_capacity
        {
            self.host.hear(Ok(flight.byte));
        } else {
            self.counters.overrun += 1;
            self.host.hear(Err(UartFault::Overrun));
        }
    }

    fn end_at_device(&mut self, byte: u8, cut: bool, now: Nanos) {
        self.counters.from_host += 1;
        if cut || !self.powered {
            self.counters.unheard += 1;
        } else {
            self.device.receive(byte, now);
        }
    }

    /// Starts a byte on each side that is silent and has one to send.
    pub(crate) fn start(&mut self, now: Nanos) {
        let (end, cut) = (now + self.character, self.cut);
        let flight = |byte| Flight { byte, end, cut, fault: None };
        if self.to_device.is_none() {
            self.to_device = self.host.waiting.pop_front().map(flight);
        }
        if self.to_host.is_none()
            && let Some(byte) = self.waiting.pop_front()
        {
            if let Some(chip) = self.chip.as_ref().filter(|_| !cut) {
                chip.borrow_mut().hear(byte, now, end);
            }
            self.to_host = Some(flight(byte));
        }
    }

    /// Takes the tasks that wait for what is there now.
    pub(crate) fn take_wakers(&mut self) -> [Option<Waker>; 2] {
        let has_sent_all = self.has_sent_all();
        let host = &mut self.host;
        let reader = if host.received.is_empty() { None } else { host.reader.take() };
        [reader, if has_sent_all { host.flusher.take() } else { None }]
    }
}
