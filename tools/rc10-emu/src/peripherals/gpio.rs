//! A port of 16 pins (RM0468, GPIO chapter). Not modelled: the lock register, speeds, voltages.

use super::access::{Answer, Write};
use super::registers::{Register, Registers, fixed, masked, plain};

words! { OUTPUT: 1, ALTERNATE: 2, ANALOG: 3 }

pub(super) const PINS: usize = 16;

words! { MODER: 0x00, OTYPER: 0x04, PUPDR: 0x0C, ODR: 0x14 }
const AFR: [u32; 2] = [0x20, 0x24];

/// The registers of a port whose mode, speed and pull registers have these values after a reset.
/// `IDR` and `BSRR` read otherwise than they store.
const fn table(mode: u32, speed: u32, pull: u32) -> [Register; 9] {
    [
        plain(MODER, mode),
        masked(OTYPER, 0, 0xFFFF),
        plain(0x08, speed),
        plain(PUPDR, pull),
        fixed(0x10, 0),
        masked(ODR, 0, 0xFFFF),
        fixed(0x18, 0),
        plain(AFR[0], 0),
        plain(AFR[1], 0),
    ]
}

/// The pins of which something is so, a bit each.
pub(super) fn pins_where(is_so: impl Fn(usize) -> bool) -> u32 {
    (0..PINS).map(|pin| u32::from(is_so(pin)) << pin).sum()
}

/// Ports A, B, and the others: the debug pins of the first two work, all others are analog. Source:
/// RM0468, GPIO register descriptions.
static TABLES: [[Register; 9]; 3] = [
    table(0xABFF_FFFF, 0x0C00_0000, 0x6400_0000),
    table(0xFFFF_FEBF, 0x0000_00C0, 0x0000_0100),
    table(u32::MAX, 0, 0),
];

#[derive(Debug)]
pub(super) struct Port {
    pub(super) registers: Registers,
    /// Pins that something outside drives, and to which level.
    driven: u32,
    levels: u32,
    /// Pins that do not lead outside.
    pub(super) cut: u32,
}

impl Port {
    /// Port A is 0.
    pub(super) fn new(index: usize) -> Self {
        let registers = Registers::new(&TABLES[index.min(2)]);
        Self { registers, driven: 0, levels: 0, cut: 0 }
    }

    fn mode(&self, pin: usize) -> u32 {
        self.registers.value(MODER) >> (2 * pin) & 3
    }

    const fn is_cut(&self, pin: usize) -> bool {
        self.cut >> pin & 1 != 0
    }

    /// Pins that are outputs or have an alternate function, and do not lead outside, a bit each.
    pub(super) fn cut_in_use(&self) -> u32 {
        self.cut & pins_where(|pin| matches!(self.mode(pin), OUTPUT | ALTERNATE))
    }

    /// Alternate function in use at a pin that leads outside.
    pub(super) fn alternate(&self, pin: usize) -> Option<u32> {
        let function = self.registers.value(AFR[pin / 8 % 2]) >> (4 * (pin % 8)) & 0xF;
        (self.mode(pin) == ALTERNATE && !self.is_cut(pin)).then_some(function)
    }

    /// The level that the port itself drives outside, if it is a general-purpose output.
    pub(super) fn output(&self, pin: usize) -> Option<bool> {
        self.own_output(pin).filter(|_| !self.is_cut(pin))
    }

    fn own_output(&self, pin: usize) -> Option<bool> {
        let high = self.registers.value(ODR) >> pin & 1 != 0;
        let releases = high && self.registers.value(OTYPER) >> pin & 1 != 0;
        (self.mode(pin) == OUTPUT && !releases).then_some(high)
    }

    /// The level that a pin reads. A floating one reads low. Our choice.
    pub(super) fn input(&self, pin: usize) -> bool {
        if self.mode(pin) == ANALOG {
            return false;
        }
        let outside = (self.driven >> pin & 1 != 0 && !self.is_cut(pin))
            .then_some(self.levels >> pin & 1 != 0);
        let pull_up = self.registers.value(PUPDR) >> (2 * pin) & 3 == 1;
        self.own_output(pin).or(outside).unwrap_or(pull_up)
    }

    pub(super) fn drive(&mut self, pin: usize, level: Option<bool>) {
        let bit = 1 << pin;
        self.driven = self.driven & !bit | if level.is_some() { bit } else { 0 };
        self.levels = self.levels & !bit | if level == Some(true) { bit } else { 0 };
    }

    pub(super) fn read(&self, offset: u32) -> Answer<u32> {
        match offset {
            0x10 => Ok(pins_where(|pin| self.input(pin))),
            _ => self.registers.read(offset),
        }
    }

    pub(super) fn write(&mut self, write: Write) -> Answer {
        if write.offset == 0x18 {
            // Setting wins over resetting.
            let (reset, set) = (write.ones() >> 16, write.ones() & 0xFFFF);
            self.registers.set(ODR, self.registers.value(ODR) & !reset | set);
        }
        self.registers.write(write)
    }
}

#[cfg(test)]
mod tests {
    use super::super::access::Width;
    use super::*;

    fn write(port: &mut Port, offset: u32, value: u32) {
        port.write(Write::new(offset, Width::Word, value)).unwrap();
    }

    #[test]
    fn set_wins_over_reset_and_a_byte_touches_only_its_pins() {
        let mut port = Port::new(2);
        write(&mut port, 0x18, 0x0001_0003);
        assert_eq!(port.read(0x14), Ok(3));
        write(&mut port, 0x18, 0x0002_0000);
        assert_eq!(port.read(0x14), Ok(1));
        port.write(Write::new(0x15, Width::Byte, 0x80)).unwrap();
        assert_eq!(port.read(0x14), Ok(0x8001));
    }

    #[test]
    fn a_pin_reads_what_drives_it() {
        let mut port = Port::new(2);
        port.drive(3, Some(true));
        assert_eq!(port.read(0x10), Ok(0), "analog");
        write(&mut port, 0x00, 0);
        assert_eq!(port.read(0x10), Ok(8));
        port.drive(3, None);
        assert_eq!(port.read(0x10), Ok(0));
        write(&mut port, 0x0C, 1 << 6);
        assert_eq!(port.read(0x10), Ok(8), "pulled up");
        write(&mut port, 0x00, OUTPUT << 6);
        assert_eq!((port.read(0x10), port.output(3)), (Ok(0), Some(false)));
        // An open drain that is high lets go.
        write(&mut port, 0x04, 8);
        write(&mut port, 0x14, 8);
        assert_eq!((port.read(0x10), port.output(3)), (Ok(8), None));
    }
}
