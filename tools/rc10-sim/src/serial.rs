//! A serial link in full duplex: a UART of the host's at one end, a device at the other, and bytes
//! that take their time.

use std::any::Any;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use crate::Nanos;
use crate::uart::{HostEnd, Hosted, Medium, SerialEnd, UartFault, UartPort};
use crate::world::Inner;

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

    /// The time of its next event without the link's doing. In the past means now. Asked after other calls, and as time begins to pass.
    fn next_event(&self) -> Option<Nanos>;

    /// Lets that happen. What it puts into `send` goes over the link, without a pause, after what
    /// waits there already.
    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>);

    /// A byte from the host has just ended on the link. Without this it has no receive line.
    fn receive(&mut self, _byte: u8, _now: Nanos) {}
}

/// A repeater between two links: what it hears at one it sends at the other, a character later.
#[derive(Default)]
pub(crate) struct Repeater {
    pub(crate) from: Rc<RefCell<VecDeque<u8>>>,
    pub(crate) to: Rc<RefCell<VecDeque<u8>>>,
}

impl SerialDevice for Repeater {
    fn power_on(&mut self, _: Nanos) {
        self.from.borrow_mut().clear();
    }

    fn next_event(&self) -> Option<Nanos> {
        (!self.from.borrow().is_empty()).then_some(Nanos::ZERO)
    }

    fn advance(&mut self, _: Nanos, send: &mut VecDeque<u8>) {
        send.append(&mut self.from.borrow_mut());
    }

    fn receive(&mut self, byte: u8, _: Nanos) {
        self.to.borrow_mut().push_back(byte);
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

/// One link and its device.
pub(crate) struct Link {
    config: SerialConfig,
    character: Nanos,
    device: Box<dyn SerialDevice>,
    powered: bool,
    cut: bool,
    /// Bytes that the device and the host have to send.
    from_device: VecDeque<u8>,
    from_host: VecDeque<u8>,
    to_host: Option<Flight>,
    to_device: Option<Flight>,
    host: HostEnd,
    /// The bytes that the chip has sent, and the time at which each has ended.
    delivered: VecDeque<(u8, Nanos)>,
    counters: SerialCounters,
    /// The time of the next event here, and whether something was done since that was asked.
    pub(crate) due: Nanos,
    pub(crate) touched: bool,
    /// Whether what it has heard another one hands on.
    pub(crate) repeats: bool,
}

impl Link {
    pub(crate) fn new(config: SerialConfig, mut device: Box<dyn SerialDevice>, now: Nanos) -> Self {
        device.power_on(now);
        let repeats = (&*device as &dyn Any).is::<Repeater>();
        Self {
            config,
            character: config.character(),
            device,
            powered: true,
            cut: false,
            from_device: VecDeque::new(),
            from_host: VecDeque::new(),
            to_host: None,
            to_device: None,
            host: HostEnd::default(),
            delivered: VecDeque::new(),
            counters: SerialCounters::default(),
            due: Nanos::ZERO,
            touched: true,
            repeats,
        }
    }

    fn set_power(&mut self, powered: bool, now: Nanos) {
        if self.powered != powered {
            self.powered = powered;
            // What it was about to say it says no more.
            self.from_device.clear();
            if powered {
                self.device.power_on(now);
            }
        }
    }

    fn inject(&mut self, fault: UartFault, now: Nanos) {
        self.counters.injected += 1;
        if let Some(chip) = &self.host.chip {
            chip.borrow_mut().disturb(fault, now);
        } else if let Some(flight) = self.to_host.as_mut().filter(|flight| !flight.cut) {
            flight.fault = Some(fault);
        } else {
            self.host.hear(Err(fault));
        }
    }

    /// Asks when the next event happens here by itself.
    pub(crate) fn ask(&mut self) {
        let flights = [&self.to_host, &self.to_device].map(|it| it.as_ref().map(|it| it.end));
        let device = if self.powered { self.device.next_event() } else { None };
        let soon = [device, self.delivered.front().map(|&(_, at)| at)];
        self.due = flights.into_iter().chain(soon).flatten().fold(Nanos::NEVER, Nanos::min);
    }

    /// Bytes that end now are heard; then the device does what it does now.
    pub(crate) fn process(&mut self, now: Nanos) {
        self.touched = true;
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
            self.device.advance(now, &mut self.from_device);
        }
    }

    fn end_at_host(&mut self, flight: &Flight) {
        if flight.cut {
            self.counters.unheard += 1;
        } else if self.host.chip.is_some() {
            // It has heard the character begin.
        } else if let Some(fault) = flight.fault {
            self.host.hear(Err(fault));
        } else if self.host.has_room(self.config.receive_capacity) {
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
        self.touched = false;
        let (end, cut) = (now + self.character, self.cut);
        let flight = |byte| Flight { byte, end, cut, fault: None };
        if self.to_device.is_none() {
            self.to_device = self.from_host.pop_front().map(flight);
        }
        if self.to_host.is_none()
            && let Some(byte) = self.from_device.pop_front()
        {
            if let Some(chip) = self.host.chip.as_ref().filter(|_| !cut) {
                chip.borrow_mut().hear(byte, now, end);
            }
            self.to_host = Some(flight(byte));
        }
        self.ask();
    }
}

impl Hosted for Link {
    fn host(&mut self) -> &mut HostEnd {
        &mut self.host
    }

    fn send(&mut self, bytes: &[u8], _now: Nanos) {
        self.from_host.extend(bytes);
    }

    fn has_sent_all(&self) -> bool {
        self.from_host.is_empty() && self.to_device.is_none()
    }
}

/// A serial link in full duplex of a [`World`](crate::World): a UART of the host's, and a device.
#[derive(Clone)]
pub struct Serial {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Serial {
    /// The host's port; all of them share one buffer.
    pub fn port(&self) -> UartPort {
        UartPort { inner: Rc::clone(&self.inner), medium: Medium::Serial(self.index) }
    }

    /// The configuration.
    pub fn config(&self) -> SerialConfig {
        self.link(|link, _| link.config)
    }

    /// Puts the receiver of an emulated chip in the place of the host's port, whose buffer stays
    /// empty from then on. What the chip sends comes by [`deliver`](Self::deliver).
    pub fn attach(&self, chip: Rc<RefCell<dyn SerialEnd>>) {
        self.link(|link, _| link.host.chip = Some(chip));
    }

    /// The attached chip sends a byte whose last stop bit ends at this time, now or later; those of
    /// several calls in the order of time.
    pub fn deliver(&self, byte: u8, at: Nanos) {
        self.link(|link, _| link.delivered.push_back((byte, at)));
    }

    /// Damages the character that is on its way to the host: it is lost, and the port's next read
    /// that gets there fails so, once. If none is on its way, noise looks like one.
    pub fn inject(&self, fault: UartFault) {
        self.link(|link, now| link.inject(fault, now));
    }

    /// Cuts the link in both directions, or connects it again. Characters count as they begin.
    pub fn set_cut(&self, cut: bool) {
        self.link(|link, _| link.cut = cut);
    }

    /// Switches the device's power; it has it at first.
    pub fn set_power(&self, powered: bool) {
        self.link(|link, now| link.set_power(powered, now));
    }

    /// A look into the device, or a hand: `None` if it is not a `D`.
    pub fn with<D: SerialDevice, T>(&self, look: impl FnOnce(&mut D) -> T) -> Option<T> {
        self.link(|link, _| {
            let device: &mut dyn Any = &mut *link.device;
            device.downcast_mut().map(look)
        })
    }

    /// Counters since the world began.
    pub fn counters(&self) -> SerialCounters {
        self.link(|link, _| link.counters)
    }

    fn link<T>(&self, f: impl FnOnce(&mut Link, Nanos) -> T) -> T {
        Inner::with(&self.inner, |inner, now| f(&mut inner.serials[self.index], now))
    }
}
