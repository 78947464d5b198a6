//! The clock calibration unit in front of the three controllers (RM0399 and RM0468, FDCAN chapter).
//!
//! It makes the time quantum clock: from the kernel clock through a divider if bypassed, else from
//! received frames. "After device reset the CCU does not provide a valid clock signal [..] the CCU
//! must be initialized": until then controllers stay in restricted mode. Its registers are writable
//! only while FDCAN1 has INIT and CCE. Bits: `stm32h723xx.h`, `FDCAN_ClockCalibrationUnit_TypeDef`.
//!
//! The same chapter calls the bypass the default, and ST's HAL, which leaves the unit alone, works.
//! The model is stricter, unless
//! [`Options::calibration_needed`](crate::Options::calibration_needed) is off. Not modelled:
//! calibrating.

use crate::peripherals::registers::{Register, Registers, fixed, masked};
use crate::peripherals::{AccessKind, Answer, Width, Write};

/// Configuration and watchdog.
const CCFG: u32 = 0x04;
const CWD: u32 = 0x0C;

/// Core release; CCFG without SWR: 4 time quanta a bit, no bypass; CSTAT: not calibrated; CWD's WDC;
/// interrupt flags and enable.
const TABLE: &[Register] = &[
    fixed(0x00, 0x1114_1218),
    masked(CCFG, 0x4, 0x000F_FFDF),
    fixed(0x08, 0x0203_FFFF),
    masked(CWD, 0, 0xFFFF),
    fixed(0x10, 0),
    masked(0x14, 0, 0b11),
];

/// CCFG.BCC: the kernel clock is used as it is, but for the divider.
const BYPASS: u32 = 1 << 6;
pub(super) struct Calibration {
    pub registers: Registers,
    /// Whether the controllers need it to be bypassed or calibrated at all.
    pub is_needed: bool,
}

impl Calibration {
    pub fn new() -> Self {
        Self { registers: Registers::new(TABLE), is_needed: true }
    }

    pub fn is_valid(&self) -> bool {
        self.registers.value(CCFG) & BYPASS != 0 || !self.is_needed
    }

    /// Divider of the kernel clock: CDIV 0 is 1, 1 is 2, 2 is 4, .. 15 is 30.
    pub fn divider(&self) -> u64 {
        match self.registers.value(CCFG) >> 16 & 0xF {
            0 => 1,
            half => 2 * u64::from(half),
        }
    }

    /// `unlocked`: FDCAN1 has INIT and CCE.
    pub fn write(&mut self, offset: u32, value: u32, unlocked: bool) -> Answer {
        AccessKind::Protected.when(matches!(offset, CCFG | CWD) && !unlocked)?;
        self.registers.write(Write::new(offset, Width::Word, value))
    }
}
