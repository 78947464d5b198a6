//! The chip's serial ports and pins on the lines of a world.

use std::cell::RefCell;
use std::rc::Rc;

use anyhow::{Result, ensure};
use rc10_sim::{
    Contact, Line, Nanos, PulseEnd, Pulses, Serial, SerialEnd, Servo, UartFault, Voltage,
};

use crate::board::Pin;
use crate::machine::Machine;
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

/// Two periods of a servo's pulses.
const NO_PULSES: Nanos = Nanos::new(40_000_000);

/// Moves data of a pin between the world and the chip, up to a time.
type PinLink = Box<dyn FnMut(&mut Soc, Nanos)>;

#[derive(Default)]
pub(crate) struct Links {
    serials: Vec<SerialLink>,
    inputs: Vec<PinLink>,
    outputs: Vec<PinLink>,
}

impl Links {
    pub fn is_empty(&self) -> bool {
        self.serials.is_empty() && self.inputs.is_empty() && self.outputs.is_empty()
    }

    /// Moves data of the world, which is at `now`, to the chip, which is not later.
    pub fn hear(&mut self, soc: &mut Soc, now: Nanos) {
        self.serials.iter().for_each(|link| link.hear(soc));
        self.inputs.iter_mut().for_each(|link| link(soc, now));
    }

    pub fn speak(&mut self, soc: &mut Soc, now: Nanos) {
        self.serials.iter_mut().for_each(|link| link.speak(soc));
        self.outputs.iter_mut().for_each(|link| link(soc, now));
    }
}

impl Machine {
    /// Puts a UART (1 for USART1 ..= 10) on a serial link: levels of the link's rate, with
    /// characters of 10 bits as 8N1, of 11 as 8E1, of 12 as 8E2. `inverted`: the line idles low, as
    /// for SBUS. Fails if the chip has no such UART, or the link's characters have another length.
    pub fn connect_serial(&mut self, uart: u8, link: &Serial, inverted: bool) -> Result<()> {
        let config = link.config();
        let connected = Format::of_length(config.bits.into()).is_some_and(|format| {
            let far = Far::Serial(link.clone());
            let own = SerialLink::new(uart, far, format, config.baud, inverted);
            self.connect_uart(own, |ear| link.attach(ear))
        });
        let bits = config.bits;
        ensure!(connected, "there is no UART {uart} (1 to 10), or characters of {bits} bits");
        Ok(())
    }

    /// Puts a UART on an RS-485 line, behind a transceiver whose driver it enables itself (`DEM`):
    /// only then nodes hear it, and meanwhile it hears no node. Fails if the chip has no such UART.
    pub fn connect_line(&mut self, uart: u8, line: &Line) -> Result<()> {
        let far = Far::Line(line.clone());
        let own = SerialLink::new(uart, far, Format::EIGHT_N_1, line.baud(), false);
        let connected = self.connect_uart(own, |ear| line.attach(ear));
        ensure!(connected, "there is no UART {uart}; they are 1 to 10");
        Ok(())
    }

    fn connect_uart(&mut self, link: SerialLink, attach: impl FnOnce(Rc<RefCell<Ear>>)) -> bool {
        let is_there = self.soc().link_serial(link.uart);
        if is_there {
            self.soc().set_serial_idle(link.uart, !link.how.inverted);
            attach(Rc::clone(&link.ear));
            self.links.serials.push(link);
        }
        is_there
    }

    /// Puts a pin on a line of pulses. Fails if the chip has no such pin.
    pub fn connect_pulses(&mut self, pin: Pin, pulses: &Pulses) -> Result<()> {
        let is_there = self.soc().drive_pin(pin.0, pin.1, Some(false), self.now());
        ensure!(is_there, "there is no pin P{}{}", pin.0, pin.1);
        let ear = Rc::<RefCell<PulseEar>>::default();
        pulses.attach(Rc::clone(&ear) as Rc<RefCell<dyn PulseEnd>>);
        self.links.inputs.push(Box::new(move |soc, _| {
            for (high, at) in ear.borrow_mut().0.drain(..) {
                soc.drive_pin(pin.0, pin.1, Some(high), at);
            }
        }));
        Ok(())
    }

    /// Puts a contact to ground at a pin (port 'A' ..= 'K', 0 ..= 15): while it does not pull it low, nothing
    /// drives it. Fails if the pin does not lead outside.
    pub fn connect_contact(&mut self, pin: Pin, contact: &Contact) -> Result<()> {
        let (contact, mut was_low) = (contact.clone(), contact.pulls_low());
        let leads_outside = self.board().package.bonds(pin.0, pin.1);
        ensure!(leads_outside, "no pin P{}{} leads outside", pin.0, pin.1);
        self.soc().drive_pin(pin.0, pin.1, was_low.then_some(false), self.now());
        self.links.inputs.push(Box::new(move |soc, now| {
            let is_low = contact.pulls_low();
            if std::mem::replace(&mut was_low, is_low) != is_low {
                soc.drive_pin(pin.0, pin.1, is_low.then_some(false), now);
            }
        }));
        Ok(())
    }

    /// Puts a voltage behind a divider at a pin (port 'A' ..= 'K', 0 ..= 15): at most 3.3 V times that can be told.
    /// Fails if no converter that is modelled measures there.
    pub fn connect_voltage(&mut self, pin: Pin, voltage: &Voltage, divider: f64) -> Result<()> {
        self.set_voltage(pin.0, pin.1, 0)?;
        let (voltage, mut microvolts) = (voltage.clone(), 0);
        self.links.inputs.push(Box::new(move |soc, now| {
            #[expect(clippy::cast_possible_truncation, reason = "the converter reads 0 below 0 V")]
            let now_there = (voltage.volts() / divider * 1e6) as u32;
            if std::mem::replace(&mut microvolts, now_there) != now_there {
                soc.set_voltage(pin.0, pin.1, now_there, now);
            }
        }));
        Ok(())
    }

    /// Puts a servo at a pin (port 'A' ..= 'K', 0 ..= 15), which is told each pulse when it ends.
    /// Fails if the chip has no such pin.
    pub fn connect_servo(&mut self, pin: Pin, servo: &Servo) -> Result<()> {
        self.record_pin(pin.0, pin.1)?;
        let (servo, mut rose) = (servo.clone(), Nanos::ZERO);
        self.links.outputs.push(Box::new(move |soc, now| {
            for edge in soc.take_edges(pin.0, pin.1) {
                if edge.high {
                    rose = edge.at;
                } else {
                    servo.tell(Some(edge.at.since(rose).get() as f64 / 1e3));
                }
            }
            if servo.pulse().is_some() && now.since(rose) > NO_PULSES {
                servo.tell(None);
            }
        }));
        Ok(())
    }

    /// Characters that a UART has sent and its far end could not read.
    pub fn garbled(&self, uart: u8) -> u64 {
        let links = self.links.serials.iter().filter(|link| link.uart == uart);
        links.map(|link| link.garbled).sum()
    }
}
