//! The chip's serial ports and pins on the lines of a world.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use rc10_sim::{Contact, Line, Nanos, PulseEnd, Serial, SerialEnd, UartFault};

use crate::peripherals::{Character, Format, Outgoing, Sampling, Soc, Wire};

const FEMTOS_OF_SECOND: u64 = 1_000_000_000_000_000;

/// Data from the world, until the chip has caught up with it.
#[derive(Clone, Copy, Debug)]
enum Coming {
    Character { byte: u8, start: Nanos },
    Fault { fault: UartFault, at: Nanos },
}

#[derive(Default)]
struct Ear(VecDeque<Coming>);

impl SerialEnd for Ear {
    fn hear(&mut self, byte: u8, start: Nanos, _end: Nanos) {
        self.0.push_back(Coming::Character { byte, start });
    }

    fn disturb(&mut self, fault: UartFault, at: Nanos) {
        self.0.push_back(Coming::Fault { fault, at });
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
    format: Format,
    bit_fs: u64,
    inverted: bool,
    garbled: u64,
}

impl SerialLink {
    fn new(uart: u8, far: Far, format: Format, baud: u32) -> Self {
        let bit_fs = FEMTOS_OF_SECOND / u64::from(baud.max(1));
        Self { uart, far, ear: Rc::default(), format, bit_fs, inverted: false, garbled: 0 }
    }

    fn hear(&self, soc: &mut Soc) {
        let Self { uart, format, bit_fs, inverted, .. } = *self;
        let mut ear = self.ear.borrow_mut();
        for coming in ear.0.drain(..) {
            let character = |value: u8, start| {
                let value = value.into();
                Character { value, format, start, bit_fs, inverted, fault: None }
            };
            match coming {
                // A transceiver that sends does not listen.
                Coming::Character { .. } | Coming::Fault { .. }
                    if matches!(self.far, Far::Line(_))
                        && soc.driver_enable(uart) == Some(true) => {}
                Coming::Character { byte, start } => {
                    soc.feed_character(uart, character(byte, start));
                }
                Coming::Fault { fault, at } => {
                    soc.disturb_serial(uart, fault, at, character(0, at));
                }
            }
        }
    }

    fn speak(&mut self, soc: &mut Soc) {
        for outgoing in soc.take_outgoing(self.uart) {
            let Outgoing { character, end, has_ended } = outgoing;
            let begins_on_line = matches!(self.far, Far::Line(_));
            if has_ended == begins_on_line {
                continue;
            }
            let is_driven = !begins_on_line || soc.driver_enable(self.uart) == Some(true);
            match self.understood(character) {
                // No node drives the line.
                _ if !is_driven => {}
                None => self.garbled += 1,
                Some(byte) => match &self.far {
                    Far::Serial(serial) => serial.deliver(byte, end),
                    Far::Line(line) => line.deliver(byte, character.start),
                },
            }
        }
    }

    /// A character as the far end samples it; `None` if it finds no character there.
    fn understood(&self, character: Character) -> Option<u8> {
        if character.inverted != self.inverted {
            return None;
        }
        let mut wire = Wire::default();
        wire.set_idle(!self.inverted);
        wire.draw(character);
        let how = Sampling {
            format: self.format,
            bit_fs: self.bit_fs,
            inverted: self.inverted,
            by_8: false,
            one_sample: false,
        };
        let sampled = wire.sample(character.start, &how).filter(|sampled| sampled.is_good())?;
        u8::try_from(sampled.word & 0xFF).ok()
    }
}

#[derive(Default)]
struct PulseEar(VecDeque<(bool, Nanos)>);

impl PulseEnd for PulseEar {
    fn level(&mut self, high: bool, at: Nanos) {
        self.0.push_back((high, at));
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
        let link = SerialLink::new(uart, Far::Serial(serial.clone()), format, config.baud);
        self.connect(soc, SerialLink { inverted, ..link }, |ear| serial.attach(ear))
    }

    /// Puts a UART with driver enable on a line. `false`: there is no such UART.
    pub fn connect_line(&mut self, soc: &mut Soc, uart: u8, line: &Line) -> bool {
        let link = SerialLink::new(uart, Far::Line(line.clone()), Format::EIGHT_N_1, line.baud());
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
        soc.set_serial_idle(link.uart, !link.inverted);
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
