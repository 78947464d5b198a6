//! The memory protection unit (`PMSAv7`, B3.5).

use super::bus::Access;

const REGIONS: usize = 16;

// Bits of `MPU_CTRL`: on, also in handlers of faults, and what is in no region is as without it
// for code with privileges.
bits! { ENABLE: 0, IN_FAULTS: 1, BACKGROUND: 2 }
/// Attribute of a region: no instruction comes from it.
const NEVER_EXECUTE: u32 = 1 << 28;

#[derive(Default)]
pub(super) struct Mpu {
    pub(super) control: u32,
    number: u32,
    /// Base and attributes of each, as their registers have them.
    regions: [(u32, u32); REGIONS],
}

impl Mpu {
    /// A register, by its offset from `MPU_TYPE`.
    pub(super) fn read(&self, offset: u32) -> u32 {
        let (base, attributes) = self.regions[self.number as usize % REGIONS];
        match offset {
            0 => (REGIONS as u32) << 8,
            4 => self.control,
            8 => self.number,
            // The first pair, and its aliases.
            _ if offset & 4 == 0 => attributes,
            _ => base,
        }
    }

    pub(super) fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0 => {}
            4 => self.control = value & 7,
            8 => self.number = value & 0xFF,
            _ if offset & 4 == 0 => self.regions[self.number as usize % REGIONS].1 = value,
            _ => {
                // VALID: it says its region itself.
                if value & 1 << 4 != 0 {
                    self.number = value & 0xF;
                }
                let region = self.number as usize % REGIONS;
                self.regions[region].0 = value & !0x1F | region as u32;
            }
        }
    }

    /// State that all verdicts depend on besides the registers; 0 while everything is permitted.
    /// `negative`: in NMI or `HardFault`, or with FAULTMASK.
    pub(super) const fn context(&self, privileged: bool, negative: bool) -> u8 {
        let is_off = self.control & ENABLE == 0 || negative && self.control & IN_FAULTS == 0;
        if is_off { 0 } else { 1 + privileged as u8 }
    }

    /// Whether an access is permitted, and from where to where the same holds.
    pub(super) fn verdict(
        &self,
        address: u32,
        access: Access,
        privileged: bool,
        negative: bool,
    ) -> (bool, (u32, u32)) {
        if self.context(privileged, negative) == 0 {
            return (true, (0, u32::MAX));
        }
        let (mut first, mut last) = (0, u32::MAX);
        let mut attributes = None;
        // The last region that holds the address decides; the others bound where it does.
        for &(base, region) in &self.regions {
            for (start, end) in parts(base, region) {
                if start <= address && address <= end {
                    (first, last) = (start.max(first), end.min(last));
                    attributes = Some(region);
                } else if end < address {
                    first = first.max(end + 1);
                } else {
                    last = last.min(start - 1);
                }
            }
        }
        let permitted = attributes.map_or(privileged && self.control & BACKGROUND != 0, |region| {
            permits(region, access, privileged)
        });
        (permitted, (first, last))
    }
}

/// First and last address of each part of a region that is not disabled.
fn parts(base: u32, attributes: u32) -> impl Iterator<Item = (u32, u32)> {
    let bits = (attributes >> 1 & 0x1F) + 1;
    let enabled = attributes & 1 != 0 && bits >= 5;
    let start = u64::from(base) >> bits << bits;
    // Eighths, in a region that is large enough for them.
    let (count, bits) = if bits >= 8 { (8, bits - 3) } else { (1, bits) };
    let parts = 0..if enabled { count } else { 0 };
    parts.filter(move |part| count == 1 || attributes >> (8 + part) & 1 == 0).map(move |part| {
        let first = start + (part << bits);
        (first as u32, (first + (1 << bits) - 1) as u32)
    })
}

/// Whether a region's attributes permit an access (B3.5).
const fn permits(attributes: u32, access: Access, privileged: bool) -> bool {
    let writes = matches!(access, Access::Write);
    if matches!(access, Access::Fetch) && attributes & NEVER_EXECUTE != 0 {
        return false;
    }
    match attributes >> 24 & 7 {
        1 => privileged,
        2 => privileged || !writes,
        3 => true,
        5 => privileged && !writes,
        6 | 7 => !writes,
        _ => false,
    }
}
