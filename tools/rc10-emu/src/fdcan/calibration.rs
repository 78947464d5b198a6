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

/// Core release, configuration, status, watchdog, interrupt flags and enable.
const CREL: u32 = 0x00;
const CCFG: u32 = 0x04;
const CSTAT: u32 = 0x08;
const CWD: u32 = 0x0C;
const IR: u32 = 0x10;
const IE: u32 = 0x14;

/// CCFG.BCC: the kernel clock is used as it is, but for the divider.
const BYPASS: u32 = 1 << 6;
/// CCFG: TQBT, BCC, CFL, OCPM, CDIV. SWR is not kept.
const CCFG_BITS: u32 = 0x000F_FFDF;
/// 4 time quanta a bit, no bypass.
const CCFG_RESET: u32 = 0x4;

pub(super) struct Calibration {
    configuration: u32,
    watchdog: u32,
    enabled: u32,
    /// Whether the controllers need it to be bypassed or calibrated at all.
    pub is_needed: bool,
}

impl Calibration {
    pub const fn new() -> Self {
        Self { configuration: CCFG_RESET, watchdog: 0, enabled: 0, is_needed: true }
    }

    pub const fn reset(&mut self) {
        *self = Self { is_needed: self.is_needed, ..Self::new() };
    }

    pub const fn is_valid(&self) -> bool {
        self.configuration & BYPASS != 0 || !self.is_needed
    }

    /// Divider of the kernel clock: CDIV 0 is 1, 1 is 2, 2 is 4, .. 15 is 30.
    pub const fn divider(&self) -> u64 {
        match self.configuration >> 16 & 0xF {
            0 => 1,
            half => 2 * half as u64,
        }
    }

    pub const fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            CREL => 0x1114_1218,
            CCFG => self.configuration,
            // Not calibrated.
            CSTAT => 0x0203_FFFF,
            CWD => self.watchdog,
            IR => 0,
            IE => self.enabled,
            _ => return None,
        })
    }

    /// `unlocked`: FDCAN1 has INIT and CCE. `None`: there is no such register; `false`: locked.
    pub const fn write(&mut self, offset: u32, value: u32, unlocked: bool) -> Option<bool> {
        match offset {
            CREL | CSTAT | IR => {}
            IE => self.enabled = value & 0b11,
            CCFG | CWD if !unlocked => return Some(false),
            CCFG => self.configuration = value & CCFG_BITS,
            // WDC; WDV counts, and does not here.
            CWD => self.watchdog = value & 0xFFFF,
            _ => return None,
        }
        Some(true)
    }
}
