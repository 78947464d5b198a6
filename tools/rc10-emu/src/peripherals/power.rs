//! Power control, and the flash's wait states, which depend on it (RM0468, PWR and FLASH).
//!
//! Only stored: voltage detectors, low-power modes, wake-up pins.

use rc10_sim::Nanos;

use super::access::{Answer, Write};
use super::registers::{Register, Registers, masked, plain};

const CR1: u32 = 0x00;
pub(super) const CSR1: u32 = 0x04;
/// ACTVOSRDY.
pub(super) const READY: u32 = 1 << 13;
const CR3: u32 = 0x0C;
const D3CR: u32 = 0x18;

const TABLE: &[Register] = &[
    plain(0x00, 0xF000_C000),
    masked(0x04, 0, 0),
    masked(0x08, 0, 0x11),
    masked(0x0C, 0x6, 0x0300_033F),
    plain(0x10, 0),
    masked(0x18, 0x4000, 0xC000),
    masked(0x20, 0, 0),
    masked(0x24, 0, 0),
    plain(0x28, 0),
];

/// Duration of a change of the core voltage. Our estimate.
const SCALING: Nanos = Nanos::new(20_000);
/// Bits of CR3 that are written once after power-on.
const SUPPLY: u32 = 0x3F;

#[derive(Debug, Default)]
pub(super) struct Power {
    registers: Registers,
    supply_written: bool,
    /// The voltage scale in force (VOS bits), and when the wanted one is.
    scale: u32,
    scaled_at: Nanos,
}

impl Power {
    pub(super) fn new() -> Self {
        Self { registers: Registers::new(TABLE), scale: 1, ..Self::default() }
    }

    /// A reset that power survives: the supply stays as it was set.
    pub(super) fn reset_but_supply(&mut self) {
        let (supply, written) = (self.registers.value(CR3), self.supply_written);
        *self = Self::new();
        self.registers.set(CR3, supply);
        self.supply_written = written;
    }

    /// Whether the backup domain may be written (CR1.DBP).
    pub(super) fn backup_unlocked(&self) -> bool {
        self.registers.value(CR1) & 1 << 8 != 0
    }

    /// The voltage scale in force: 0 is the highest, 3 the lowest.
    pub(super) fn scale(&mut self, now: Nanos) -> u32 {
        if now >= self.scaled_at {
            self.scale = self.registers.value(D3CR) >> 14 & 3;
        }
        // VOS: 0b00 scale 0, 0b01 scale 3, 0b10 scale 2, 0b11 scale 1.
        (4 - self.scale) % 4
    }

    /// ACTVOSRDY: the supply is configured. Before that the RAMs must not be written.
    pub(super) fn is_supplied(&self) -> bool {
        let supply = self.registers.value(CR3);
        // The LDO, or an external supply; not both.
        self.supply_written && (supply & 1 != 0) != (supply & 2 != 0)
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Answer<u32> {
        let stored = self.registers.read(offset)?;
        self.scale(now);
        Ok(match offset {
            CSR1 => self.scale << 14 | if self.is_supplied() { READY } else { 0 },
            D3CR => stored | u32::from(now >= self.scaled_at) << 13,
            _ => stored,
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        match write.offset {
            CR3 => {
                let unlocked = if self.supply_written { !SUPPLY } else { u32::MAX };
                self.supply_written = true;
                self.registers.write_only(write, unlocked)
            }
            D3CR => {
                self.scale(now);
                let before = self.registers.value(D3CR);
                self.registers.write(write)?;
                if self.registers.value(D3CR) != before {
                    self.scaled_at = now + SCALING;
                }
                Ok(())
            }
            _ => self.registers.write(write),
        }
    }
}

/// Highest AXI clock in MHz by wait states and voltage scale. Source: RM0468, flash wait states.
const LIMITS: [&[u64]; 4] = [&[70, 140, 210, 275], &[67, 133, 200], &[50, 100, 150], &[35, 70, 85]];

/// Whether the flash can be read at this bus clock.
pub(super) fn flash_keeps_up(scale: u32, bus_hz: u64, wait_states: u32) -> bool {
    let limits = LIMITS[scale as usize % LIMITS.len()];
    let needed = limits.iter().position(|&limit| bus_hz <= limit * 1_000_000);
    needed.is_some_and(|needed| needed <= wait_states as usize)
}

#[cfg(test)]
mod tests {
    use super::super::access::Width;
    use super::*;

    fn write(power: &mut Power, offset: u32, value: u32, now: u64) {
        power.write(Write::new(offset, Width::Word, value), Nanos::new(now)).unwrap();
    }

    #[test]
    fn the_supply_is_written_once() {
        let mut power = Power::new();
        let supplied = |power: &mut Power| power.read(CSR1, Nanos::ZERO).unwrap() & 1 << 13 != 0;
        assert!(!supplied(&mut power));
        write(&mut power, CR3, 0b010, 0);
        assert!(supplied(&mut power));
        write(&mut power, CR3, 0b011, 0);
        assert_eq!(power.read(CR3, Nanos::ZERO), Ok(0b010));
        power.reset_but_supply();
        assert!(supplied(&mut power));
    }

    #[test]
    fn voltage_takes_time() {
        let mut power = Power::new();
        let ready = |power: &mut Power, now| power.read(D3CR, Nanos::new(now)).unwrap() >> 13 & 1;
        assert_eq!((power.scale(Nanos::ZERO), ready(&mut power, 0)), (3, 1));
        write(&mut power, D3CR, 0, 1_000);
        assert_eq!((power.scale(Nanos::new(20_999)), ready(&mut power, 20_999)), (3, 0));
        assert_eq!((power.scale(Nanos::new(21_000)), ready(&mut power, 21_000)), (0, 1));
    }

    #[test]
    fn faster_flash_needs_wait_states() {
        assert!(flash_keeps_up(0, 240_000_000, 3));
        assert!(!flash_keeps_up(0, 240_000_000, 2));
        assert!(!flash_keeps_up(3, 240_000_000, 7));
    }
}
