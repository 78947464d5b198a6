//! A port of 16 pins (RM0468, GPIO chapter). Not modelled: the lock register, speeds, voltages.

use super::access::{Refusal, Write};

const OUTPUT: u32 = 1;
const ALTERNATE: u32 = 2;
const ANALOG: u32 = 3;

/// Number of pins of a port.
pub(super) const PINS: usize = 16;

/// Mode, speed and pull registers after a reset: port A's and B's debug pins work, all others are
/// analog. Source: RM0468, GPIO register descriptions.
const AFTER_RESET: [(u32, u32, u32); 2] =
    [(0xABFF_FFFF, 0x0C00_0000, 0x6400_0000), (0xFFFF_FEBF, 0x0000_00C0, 0x0000_0100)];

#[derive(Clone, Debug)]
pub(super) struct Port {
    index: usize,
    mode: u32,
    open_drain: u32,
    speed: u32,
    pull: u32,
    output: u32,
    alternate: [u32; 2],
    /// Pins that something outside drives, and to which level.
    driven: u32,
    levels: u32,
    /// Pins that do not lead outside.
    cut: u32,
}

impl Port {
    /// Port A is 0.
    pub(super) fn new(index: usize) -> Self {
        let (mode, speed, pull) = AFTER_RESET.get(index).copied().unwrap_or((u32::MAX, 0, 0));
        Self {
            index,
            mode,
            open_drain: 0,
            speed,
            pull,
            output: 0,
            alternate: [0; 2],
            driven: 0,
            levels: 0,
            cut: 0,
        }
    }

    /// The outside stays as it is.
    pub(super) fn reset(&mut self) {
        let Self { driven, levels, cut, .. } = *self;
        *self = Self { driven, levels, cut, ..Self::new(self.index) };
    }

    fn mode(&self, pin: usize) -> u32 {
        self.mode >> (2 * pin) & 3
    }

    /// Pins that do not lead outside from now on, a bit each.
    pub(super) const fn set_cut(&mut self, pins: u32) {
        self.cut = pins;
    }

    const fn is_cut(&self, pin: usize) -> bool {
        self.cut >> pin & 1 != 0
    }

    /// Pins that are outputs or have an alternate function, and do not lead outside, a bit each.
    pub(super) fn cut_in_use(&self) -> u32 {
        let is_used =
            |pin: &usize| self.is_cut(*pin) && matches!(self.mode(*pin), OUTPUT | ALTERNATE);
        (0..PINS).filter(is_used).map(|pin| 1 << pin).sum()
    }

    /// Alternate function in use at a pin that leads outside.
    pub(super) fn alternate(&self, pin: usize) -> Option<u32> {
        let function = self.alternate[pin / 8 % 2] >> (4 * (pin % 8)) & 0xF;
        (self.mode(pin) == ALTERNATE && !self.is_cut(pin)).then_some(function)
    }

    /// The level that the port itself drives outside, if it is a general-purpose output.
    pub(super) fn output(&self, pin: usize) -> Option<bool> {
        self.own_output(pin).filter(|_| !self.is_cut(pin))
    }

    fn own_output(&self, pin: usize) -> Option<bool> {
        let high = self.output >> pin & 1 != 0;
        let releases = high && self.open_drain >> pin & 1 != 0;
        (self.mode(pin) == OUTPUT && !releases).then_some(high)
    }

    /// The level that a pin reads. A floating one reads low. Our choice.
    pub(super) fn input(&self, pin: usize) -> bool {
        if self.mode(pin) == ANALOG {
            return false;
        }
        let outside = (self.driven >> pin & 1 != 0 && !self.is_cut(pin))
            .then_some(self.levels >> pin & 1 != 0);
        let pull_up = self.pull >> (2 * pin) & 3 == 1;
        self.own_output(pin).or(outside).unwrap_or(pull_up)
    }

    /// Something outside drives a pin, or lets go of it.
    pub(super) fn drive(&mut self, pin: usize, level: Option<bool>) {
        let bit = 1 << pin;
        self.driven = self.driven & !bit | if level.is_some() { bit } else { 0 };
        self.levels = self.levels & !bit | if level == Some(true) { bit } else { 0 };
    }

    pub(super) fn read(&self, offset: u32) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.mode,
            0x04 => self.open_drain,
            0x08 => self.speed,
            0x0C => self.pull,
            0x10 => (0..PINS).map(|pin| u32::from(self.input(pin)) << pin).sum(),
            0x14 => self.output,
            0x18 => 0,
            0x20 => self.alternate[0],
            0x24 => self.alternate[1],
            _ => return Err(Refusal::Unmodelled),
        })
    }

    pub(super) fn write(&mut self, write: Write) -> Result<(), Refusal> {
        match write.offset {
            0x00 => self.mode = write.over(self.mode),
            0x04 => self.open_drain = write.over(self.open_drain) & 0xFFFF,
            0x08 => self.speed = write.over(self.speed),
            0x0C => self.pull = write.over(self.pull),
            // IDR cannot be written.
            0x10 => {}
            0x14 => self.output = write.over(self.output) & 0xFFFF,
            0x18 => {
                // Setting wins over resetting.
                let (reset, set) = (write.ones() >> 16, write.ones() & 0xFFFF);
                self.output = self.output & !reset | set;
            }
            0x20 => self.alternate[0] = write.over(self.alternate[0]),
            0x24 => self.alternate[1] = write.over(self.alternate[1]),
            _ => return Err(Refusal::Unmodelled),
        }
        Ok(())
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
