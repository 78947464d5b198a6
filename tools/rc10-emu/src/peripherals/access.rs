//! Accesses to the bus, and the reasons for which some are reported.

use std::fmt;

use super::adc::AdcFault;
use super::clocks::TooFast;
use crate::board::{Package, Pin};

/// Width of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// 8 bit.
    Byte = 1,
    /// 16 bit.
    Half = 2,
    /// 32 bit.
    Word = 4,
}

impl Width {
    pub(crate) const fn of(bytes: u32) -> Self {
        match bytes {
            1 => Self::Byte,
            2 => Self::Half,
            _ => Self::Word,
        }
    }

    pub(super) const fn bytes(self) -> u32 {
        self as u32
    }

    pub(super) const fn mask(self) -> u32 {
        u32::MAX >> (32 - 8 * self.bytes())
    }
}

/// Reason for which an access is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccessKind {
    /// There is no device at that address, or the access is not aligned: a bus fault.
    Unowned,
    /// The peripheral has no clock, or is held in reset: reads 0, ignores writes.
    Gated,
    /// The chip has it, this model does not: reads 0, ignores writes.
    Unmodelled,
    /// The register is locked, or the value is not allowed: ignored.
    Protected,
    /// The flash has too few wait states for the clock it now has at its voltage.
    WaitStates,
    /// A DMA does not reach the memory, or cannot write it: a transfer error.
    OutOfReach,
    /// A DMA stream that serves a UART without `CR.TRBUFF` has locked: it moves nothing more.
    Locked,
    /// RAM is written before the supply is configured (`PWR_CSR1.ACTVOSRDY`), which RM0468 forbids.
    /// Reported once, and only if [`Options`](crate::Options) ask for it.
    BeforeSupply,
    /// The written value makes a clock faster than its consumers can be.
    TooFast(TooFast),
    /// A pin in use as an output or for an alternate function does not lead outside. Reported once
    /// for each pin and reason.
    Pin(PinFault),
    /// ADC1 is used against the manual.
    Adc(AdcFault),
}

/// What an access gives, or why it is refused.
pub(crate) type Answer<T = ()> = Result<T, AccessKind>;

impl AccessKind {
    /// Refuses an access for this reason, if it is so.
    pub(crate) fn when(self, is_so: bool) -> Answer {
        if is_so { Err(self) } else { Ok(()) }
    }
}

/// A pin that does not lead outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinFault {
    /// Port and number.
    pub pin: Pin,
    /// The chip.
    pub chip: &'static str,
    /// The case.
    pub package: Package,
    /// Whether the package bonds it out, behind a switch that is open now.
    pub is_switch_open: bool,
}

impl fmt::Display for PinFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pin: (port, pin), chip, package, is_switch_open } = self;
        if *is_switch_open {
            return write!(
                f,
                "P{port}{pin} is used while its switch to P{port}{pin}_C is open \
                 (SYSCFG_PMCR.P{port}{pin}SO)"
            );
        }
        write!(f, "P{port}{pin} is not bonded out on the {chip} ({})", package.name())
    }
}

/// A reported access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access {
    /// Address.
    pub address: u32,
    /// Whether it was a write.
    pub write: bool,
    /// Reason.
    pub kind: AccessKind,
}

impl fmt::Display for Access {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (at, verb) = (self.address, if self.write { "write to" } else { "read of" });
        let name = match at {
            0x3000_0000..0x3000_4000 => "SRAM1",
            0x3000_4000..0x3000_8000 => "SRAM2",
            _ if self.kind == AccessKind::BeforeSupply => "RAM",
            _ => super::map::row_of(at).map_or("no device", |(_, row)| row.name),
        };
        let what = match self.kind {
            AccessKind::Unowned => "unowned or unaligned",
            AccessKind::Gated => "without clock or in reset",
            AccessKind::Unmodelled => "not modelled",
            AccessKind::Protected => "locked",
            AccessKind::WaitStates => "too few wait states",
            AccessKind::OutOfReach => "out of the DMA's reach",
            AccessKind::Locked => {
                let stream = format_args!("DMA stream at {at:#010x} ({name})");
                return write!(f, "{stream} serves a UART without TRBUFF, and has locked");
            }
            AccessKind::BeforeSupply => "before the supply is configured (PWR_CSR1.ACTVOSRDY)",
            AccessKind::Pin(pin) => return write!(f, "{pin}"),
            AccessKind::Adc(fault) => return write!(f, "{fault}"),
            AccessKind::TooFast(clock) => return write!(f, "{verb} {at:#010x} ({name}): {clock}"),
        };
        write!(f, "{verb} {at:#010x} ({name}): {what}")
    }
}

/// The bus answers with an error: a `BusFault` of the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusFault;

/// A write to a register, or to some bytes of it: the others do nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Write {
    /// The whole word's offset.
    pub offset: u32,
    value: u32,
    lanes: u32,
}

impl Write {
    /// `offset` as accessed; the value in its lowest bytes.
    pub(crate) const fn new(offset: u32, width: Width, value: u32) -> Self {
        let shift = 8 * (offset & 3);
        let lanes = width.mask() << shift;
        Self { offset: offset & !3, value: (value << shift) & lanes, lanes }
    }

    /// The same write to another register.
    pub(super) const fn at(self, offset: u32) -> Self {
        Self { offset, ..self }
    }

    /// The write behind an AHB-to-APB bridge, which repeats what is narrower than a word (RM0468).
    pub(super) const fn repeated(self) -> Self {
        // As often as it fits into a word.
        let copies = u32::MAX / self.width().mask();
        let value = (self.value >> self.lanes.trailing_zeros()) * copies;
        Self { value, lanes: u32::MAX, ..self }
    }

    /// Width of the write.
    pub(super) const fn width(self) -> Width {
        Width::of(self.lanes.count_ones() / 8)
    }

    /// The register's new value, if it simply stores.
    pub(super) const fn over(self, old: u32) -> u32 {
        old & !self.lanes | self.value
    }

    /// Bits written as one.
    pub(super) const fn ones(self) -> u32 {
        self.value
    }

    /// Bits written as zero.
    pub(super) const fn zeros(self) -> u32 {
        !self.value & self.lanes
    }
}
