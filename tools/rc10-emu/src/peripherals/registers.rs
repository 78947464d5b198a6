//! A block's registers as a table.

use super::access::{AccessKind, Answer, Write};

/// A register: offset, value after a reset, the bits that can be written, and whether only while
/// the block is unlocked.
#[derive(Debug)]
pub(crate) struct Register {
    pub offset: u32,
    pub reset: u32,
    pub writable: u32,
    pub locks: bool,
}

/// A register whose bits all keep a written value.
pub(crate) const fn plain(offset: u32, reset: u32) -> Register {
    masked(offset, reset, u32::MAX)
}

/// A register of which some bits keep a written value.
pub(crate) const fn masked(offset: u32, reset: u32, writable: u32) -> Register {
    Register { offset, reset, writable, locks: false }
}

/// The same, if they can be written only while the block is unlocked.
pub(crate) const fn locking(offset: u32, reset: u32, writable: u32) -> Register {
    Register { offset, reset, writable, locks: true }
}

/// A register that cannot be written.
pub(crate) const fn fixed(offset: u32, value: u32) -> Register {
    masked(offset, value, 0)
}

/// `width` (below 32) bits of a word from bit `low` on.
pub(crate) const fn field(word: u32, low: u32, width: u32) -> u32 {
    word >> low & ((1 << width) - 1)
}

/// The registers of one block, and their values by offset; others are not modelled.
#[derive(Debug, Default)]
pub(crate) struct Registers {
    table: &'static [Register],
    values: Vec<u32>,
}

impl Registers {
    pub(crate) fn new(table: &'static [Register]) -> Self {
        let end = table.iter().map(|register| register.offset as usize / 4 + 1).max();
        let mut registers = Self { table, values: vec![0; end.unwrap_or(0)] };
        registers.reset();
        registers
    }

    pub(crate) fn reset(&mut self) {
        self.table.iter().for_each(|register| self.set(register.offset, register.reset));
    }

    fn find(&self, offset: u32) -> Answer<&'static Register> {
        let mut table = self.table.iter();
        table.find(|register| register.offset == offset).ok_or(AccessKind::Unmodelled)
    }

    pub(crate) fn read(&self, offset: u32) -> Answer<u32> {
        self.find(offset).map(|register| self.value(register.offset))
    }

    /// Like [`read`](Self::read), for a register that the table is known to have.
    #[inline]
    pub(crate) fn value(&self, offset: u32) -> u32 {
        self.values[offset as usize / 4]
    }

    /// `width` (below 32) bits of a register from bit `low` on.
    pub(crate) fn field(&self, offset: u32, low: u32, width: u32) -> u32 {
        field(self.value(offset), low, width)
    }

    /// Whether all these bits of a register are set.
    pub(crate) fn has(&self, offset: u32, bits: u32) -> bool {
        self.value(offset) & bits == bits
    }

    pub(crate) fn write(&mut self, write: Write) -> Answer {
        self.write_only(write, u32::MAX)
    }

    /// Writes, but changes no register that locks while the block is locked.
    pub(crate) fn write_if(&mut self, is_unlocked: bool, write: Write) -> Answer {
        let register = self.find(write.offset)?;
        let old = self.value(write.offset);
        let changes = (write.over(old) ^ old) & register.writable != 0;
        AccessKind::Protected.when(register.locks && !is_unlocked && changes)?;
        self.write(write)
    }

    /// Writes those bits that are both writable and `unlocked`.
    pub(super) fn write_only(&mut self, write: Write, unlocked: u32) -> Answer {
        let writable = self.find(write.offset)?.writable & unlocked;
        let old = self.value(write.offset);
        self.set(write.offset, old & !writable | write.over(old) & writable);
        Ok(())
    }

    pub(crate) fn set(&mut self, offset: u32, value: u32) {
        self.values[offset as usize / 4] = value;
    }
}

/// Debug unit: it only stores, as there is no debugger. `IDC`: device 0x483, revision Z (RM0468).
pub(super) const DEBUG: &[Register] = &[
    fixed(0x00, 0x1001_6483),
    masked(0x04, 0, 0x1070_0007),
    plain(0x34, 0),
    plain(0x3C, 0),
    plain(0x40, 0),
    plain(0x4C, 0),
    plain(0x54, 0),
];

/// The OCTOSPIs' I/O manager: which of them is at port 1 (`P1CR`), and at port 2. After a reset each is at its own.
pub(super) const OCTOSPIM: &[Register] =
    &[plain(0x00, 0), plain(P1CR, P1CR_RESET), plain(0x08, 0x0705_0333)];
pub(super) const P1CR: u32 = 0x04;
const P1CR_RESET: u32 = 0x0301_0111;
/// Whether port 1 has OCTOSPI1's clock, select and lower data lines: `CLKEN`, `NCSEN`, `IOLEN`, and their sources 0
/// (RM0468, `OCTOSPIM_PnCR`). The upper data lines and DQS have no pin at this memory.
pub(super) const fn is_octospi_1(p1cr: u32) -> bool {
    p1cr & 0x0007_0303 == 0x0001_0101
}

/// SYSCFG's `PMCR`: the switch of PC2 is bit 26, of PC3 bit 27; 0 is closed (RM0468, `PCxSO`).
pub(super) const PMCR: u32 = 0x04;
pub(super) const SWITCHES: u32 = 3 << 26;
/// SYSCFG's `EXTICR1` to 4, with the ports of four lines of EXTI each.
pub(super) const EXTICR: [u32; 4] = [0x08, 0x0C, 0x10, 0x14];

/// System configuration: `EXTICR` routes pins to EXTI, the rest only stores.
///
/// `PMCR` after a reset: the switches of PC2 and PC3, which both packages bond out as analog pads
/// only, are closed (0), the others open. An assumption, as RM0468 leaves it to the package:
/// `Soc::set_switches_closed` has the other.
pub(super) const SYSCFG: &[Register] = &[
    masked(PMCR, 0x0300_0000, 0x0FE0_03FF),
    masked(EXTICR[0], 0, 0xFFFF),
    masked(EXTICR[1], 0, 0xFFFF),
    masked(EXTICR[2], 0, 0xFFFF),
    masked(EXTICR[3], 0, 0xFFFF),
    plain(0x18, 0),
    masked(0x20, 0, 0x0001_0003),
    fixed(0x24, 0),
    masked(0x28, 0, 0xFF),
    fixed(0x348, 0),
];
