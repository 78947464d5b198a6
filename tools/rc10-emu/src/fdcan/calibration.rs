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

use super::Fdcans;
use crate::peripherals::registers::{Register, fixed, masked};
use crate::peripherals::{AccessKind, Answer, Width, Write};

/// Configuration and watchdog.
const CCFG: u32 = 0x04;
const CWD: u32 = 0x0C;

/// Core release; CCFG without SWR: 4 time quanta a bit, no bypass; CSTAT: not calibrated; CWD's WDC;
/// interrupt flags and enable.
pub(super) const TABLE: &[Register] = &[
    fixed(0x00, 0x1114_1218),
    masked(CCFG, 0x4, 0x000F_FFDF),
    fixed(0x08, 0x0203_FFFF),
    masked(CWD, 0, 0xFFFF),
    fixed(0x10, 0),
    masked(0x14, 0, 0b11),
];

/// CCFG.BCC: the kernel clock is used as it is, but for the divider.
const BYPASS: u32 = 1 << 6;

impl Fdcans {
    /// Reads a register of the clock calibration unit. Fails if there is no such register.
    pub fn read_calibration(&self, offset: u32) -> Answer<u32> {
        self.calibration.read(offset)
    }

    /// Writes a register of the clock calibration unit. Fails if there is no such register, or it
    /// is locked: FDCAN1 has not both INIT and CCE.
    pub fn write_calibration(&mut self, offset: u32, value: u32) -> Answer {
        let is_locked = !self.controllers[0].may_configure();
        AccessKind::Protected.when(matches!(offset, CCFG | CWD) && is_locked)?;
        self.calibration.write(Write::new(offset, Width::Word, value))?;
        self.apply_clock();
        Ok(())
    }

    pub(super) fn is_clock_valid(&self) -> bool {
        self.calibration.has(CCFG, BYPASS) || !self.calibration_needed
    }

    /// A kernel clock behind the unit's divider, hertz: CDIV 0 is 1, 1 is 2, 2 is 4, .. 15 is 30.
    pub(crate) fn time_quantum_of(&self, kernel_hz: u64) -> u64 {
        match self.calibration.field(CCFG, 16, 4) {
            0 => kernel_hz,
            half => kernel_hz / (2 * u64::from(half)),
        }
    }
}
