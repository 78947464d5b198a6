//! The chip's serial ports and pins on the lines of a world.

use std::cell::RefCell;
use std::rc::Rc;

use rc10_sim::{Contact, Line, Nanos, PulseEnd, Serial, SerialEnd, UartFault};

use crate::peripherals::{Character, Format, Outgoing, Sampled, Sampling, Soc, Wire};

const FEMTOS_OF_SECOND: u64 = 1_000_000_000_000_000;

/// Bytes and faults from the world, until the chip has caught up with them.
#[derive(Default)]
struct Ear(Vec<(Nanos, Result<u8, UartFault>)>);

impl SerialEnd for Ear {
    fn hear(&mut self, byte: u8, start: Nanos, _end: Nanos) {
        self.0.push((start, Ok(byte)));
    }

    fn disturb(&mut self, fault: UartFault, at: Nanos) {
        self.0.push((at, Err(fault)));
    }
}

enum Far {
    Serial(Serial),
    Line(Line),
}

struct SerialLink {
    uart: u8,
    far: Far,
    ear: Rc<RefCell<Ear>>,
    /// Settings of the far end.
    how: Sampling,
    garbled: u64,
}

impl SerialLink {
    fn new(uart: u8, far: Far, format: Format, baud: u32, inverted: bool) -> Self {
        let bit_fs = FEMTOS_OF_SECOND / u64::from(baud.max(1));
        let how = Sampling { format, bit_fs, inverted, by_8: false, one_sample: false };
        Self { uart, far, ear: Rc::default(), how, garbled: 0 }
    }

    /// Whether it is a line that the chip drives now.
    fn is_driven(&self, soc: &Soc) -> bool {
        matches!(self.far, Far::Line(_)) && soc.driver_enable(self.uart) == Some(true)
    }

    fn hear(&self, soc: &mut Soc) {
        let (uart, Sampling { format, bit_fs, inverted, .. }) = (self.uart, self.how);
        for (start, coming) in self.ear.borrow_mut().0.drain(..) {
            // A transceiver that sends does not listen.
            if self.is_driven(soc) {
                continue;
            }
            let value = coming.unwrap_or(0).into();
            let character = Character { value, format, start, bit_fs, inverted, fault: None };
            match coming {
                Ok(_) => soc.feed_character(uart, character),
                Err(fault) => soc.disturb_serial(uart, fault, start, character),
            };
        }
    }

    fn speak(&mut self, soc: &mut Soc) {
        for Outgoing { character, end, has_ended } in soc.take_outgoing(self.uart) {
            let begins_on_line = matches!(self.far, Far::Line(_));
            // No node drives the line unless the chip does.
            if has_ended == begins_on_line || begins_on_line && !self.is_driven(soc) {
                continue;
            }
            match (self.understood(character), &self.far) {
                (None, _) => self.garbled += 1,
                (Some(byte), Far::Serial(serial)) => serial.deliver(byte, end),
                (Some(byte), Far::Line(line)) => line.deliver(byte, character.start),
            }
        }
    }

    /// A character as the far end samples it; `None` if it finds no character there.
    fn understood(&self, character: Character) -> Option<u8> {
        if character.inverted != self.how.inverted {
            return None;
        }
        let mut wire = Wire::default();
        wire.set_idle(!self.how.inverted);
        wire.draw(character);
        let sampled = wire.sample(character.start, &self.how).filter(Sampled::is_good)?;
        u8::try_from(sampled.word & 0xFF).ok()
    }
}

#[derive(Default)]
struct PulseEar(Vec<(bool, Nanos)>);

impl PulseEnd for PulseEar {
    fn level(&mut self, high: bool, at: Nanos) {
        self.0.push((high, at));
    }
}

struct PulseLink {
    pin: (char, usize),
    ear: Rc<RefCell<PulseEar>>,
}

struct ContactLink {
    pin: (char, usize),
    contact: Contact,
    was_closed: bool,
}

#[derive(Default)]
pub(crate) struct Links {
    serials: Vec<SerialLink>,
    pulses: Vec<PulseLink>,
    contacts: Vec<ContactLink>,
}

impl Links {
    pub fn is_empty(&self) -> bool {
        self.serials.is_empty() && self.pulses.is_empty() && self.contacts.is_empty()
    }

    /// Puts a UART on a serial link. `false`: no such UART, or no characters of the link's length.
    pub fn connect_serial(
        &mut self,
        soc: &mut Soc,
        uart: u8,
        serial: &Serial,
        inverted: bool,
    ) -> bool {
        let config = serial.config();
        let Some(format) = Format::of_length(config.bits.into()) else { return false };
        let far = Far::Serial(serial.clone());
        let link = SerialLink::new(uart, far, format, config.baud, inverted);
        self.connect(soc, link, |ear| serial.attach(ear))
    }

    /// Puts a UART with driver enable on a line. `false`: there is no such UART.
    pub fn connect_line(&mut self, soc: &mut Soc, uart: u8, line: &Line) -> bool {
        let far = Far::Line(line.clone());
        let link = SerialLink::new(uart, far, Format::EIGHT_N_1, line.baud(), false);
        self.connect(soc, link, |ear| line.attach(ear))
    }

    fn connect(
        &mut self,
        soc: &mut Soc,
        link: SerialLink,
        attach: impl FnOnce(Rc<RefCell<Ear>>),
    ) -> bool {
        if !soc.link_serial(link.uart) {
            return false;
        }
        soc.set_serial_idle(link.uart, !link.how.inverted);
        attach(Rc::clone(&link.ear));
        self.serials.push(link);
        true
    }

    /// Puts a pin on a line of pulses. `false`: there is no such pin.
    pub fn connect_pulses(
        &mut self,
        soc: &mut Soc,
        pin: (char, usize),
        pulses: &rc10_sim::Pulses,
        now: Nanos,
    ) -> bool {
        if !soc.drive_pin(pin.0, pin.1, Some(false), now) {
            return false;
        }
        let ear = Rc::<RefCell<PulseEar>>::default();
        pulses.attach(Rc::clone(&ear) as Rc<RefCell<dyn PulseEnd>>);
        self.pulses.push(PulseLink { pin, ear });
        true
    }

    /// Puts a pin at a contact to ground. `false`: there is no such pin.
    pub fn connect_contact(
        &mut self,
        soc: &mut Soc,
        pin: (char, usize),
        contact: &Contact,
        now: Nanos,
    ) -> bool {
        let was_closed = contact.is_closed();
        let connected = soc.drive_pin(pin.0, pin.1, was_closed.then_some(false), now);
        if connected {
            self.contacts.push(ContactLink { pin, contact: contact.clone(), was_closed });
        }
        connected
    }

    /// Moves data of the world, which is at `now`, to the chip, which is not later.
    pub fn hear(&mut self, soc: &mut Soc, now: Nanos) {
        self.serials.iter().for_each(|link| link.hear(soc));
        for PulseLink { pin: (port, pin), ear } in &self.pulses {
            for (high, at) in ear.borrow_mut().0.drain(..) {
                soc.drive_pin(*port, *pin, Some(high), at);
            }
        }
        for ContactLink { pin: (port, pin), contact, was_closed } in &mut self.contacts {
            let closed = contact.is_closed();
            if std::mem::replace(was_closed, closed) != closed {
                soc.drive_pin(*port, *pin, closed.then_some(false), now);
            }
        }
    }

    pub fn speak(&mut self, soc: &mut Soc) {
        self.serials.iter_mut().for_each(|link| link.speak(soc));
    }

    pub fn garbled(&self, uart: u8) -> u64 {
        self.serials.iter().filter(|link| link.uart == uart).map(|link| link.garbled).sum()
    }
}
