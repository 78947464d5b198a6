//! Offsets of the registers, existing bits, and when they are writable. Source: RM0468, FDCAN
//! register map; `stm32-metapac` (`can_fdcan_h7`).

pub(super) use crate::peripherals::registers::field;

/// The registers.
pub(super) mod at {
    use super::{Access, Register, active, cccr, open, protected, register};

    const INTERRUPTS: u32 = 0x3FFF_FFFF;

    pub const CREL: Register = register(0x00, Access::Constant, 0x3214_1218, 0);
    pub const ENDN: Register = register(0x04, Access::Constant, 0x8765_4321, 0);
    pub const DBTP: Register = protected(0x0C, 0x0000_0A33, 0x009F_1FFF);
    pub const TEST: Register = register(0x10, Access::Active, 0, 0x70);
    pub const RWD: Register = protected(0x14, 0, 0xFF);
    pub const CCCR: Register = register(0x18, Access::Active, cccr::INIT, 0);
    pub const NBTP: Register = protected(0x1C, 0x0600_0A03, 0xFFFF_FF7F);
    pub const TSCC: Register = protected(0x20, 0, 0x000F_0003);
    pub const TSCV: Register = active(0x24);
    pub const TOCC: Register = protected(0x28, 0xFFFF_0000, 0xFFFF_0007);
    pub const TOCV: Register = active(0x2C);
    pub const ECR: Register = active(0x40);
    pub const PSR: Register = active(0x44);
    pub const TDCR: Register = protected(0x48, 0, 0x7F7F);
    pub const IR: Register = active(0x50);
    pub const IE: Register = open(0x54, INTERRUPTS);
    pub const ILS: Register = open(0x58, INTERRUPTS);
    pub const ILE: Register = open(0x5C, 0b11);
    pub const GFC: Register = protected(0x80, 0, 0x3F);
    pub const SIDFC: Register = protected(0x84, 0, 0x00FF_FFFC);
    pub const XIDFC: Register = protected(0x88, 0, 0x007F_FFFC);
    pub const XIDAM: Register = protected(0x90, 0x1FFF_FFFF, 0x1FFF_FFFF);
    pub const HPMS: Register = active(0x94);
    pub const NDAT1: Register = active(0x98);
    pub const NDAT2: Register = active(0x9C);
    pub const RXF0C: Register = protected(0xA0, 0, 0xFF7F_FFFC);
    pub const RXF0S: Register = active(0xA4);
    pub const RXF0A: Register = active(0xA8);
    pub const RXBC: Register = protected(0xAC, 0, 0xFFFC);
    pub const RXF1C: Register = protected(0xB0, 0, 0xFF7F_FFFC);
    pub const RXF1S: Register = active(0xB4);
    pub const RXF1A: Register = active(0xB8);
    pub const RXESC: Register = protected(0xBC, 0, 0x777);
    pub const TXBC: Register = protected(0xC0, 0, 0x7F3F_FFFC);
    pub const TXFQS: Register = active(0xC4);
    pub const TXESC: Register = protected(0xC8, 0, 0x7);
    pub const TXBRP: Register = active(0xCC);
    pub const TXBAR: Register = active(0xD0);
    pub const TXBCR: Register = active(0xD4);
    pub const TXBTO: Register = active(0xD8);
    pub const TXBCF: Register = active(0xDC);
    pub const TXBTIE: Register = open(0xE0, u32::MAX);
    pub const TXBCIE: Register = open(0xE4, u32::MAX);
    pub const TXEFC: Register = protected(0xF0, 0, 0x3F3F_FFFC);
    pub const TXEFS: Register = active(0xF4);
    pub const TXEFA: Register = active(0xF8);

    pub const ALL: [Register; 46] = [
        CREL, ENDN, DBTP, TEST, RWD, CCCR, NBTP, TSCC, TSCV, TOCC, TOCV, ECR, PSR, TDCR, IR, IE,
        ILS, ILE, GFC, SIDFC, XIDFC, XIDAM, HPMS, NDAT1, NDAT2, RXF0C, RXF0S, RXF0A, RXBC, RXF1C,
        RXF1S, RXF1A, RXESC, TXBC, TXFQS, TXESC, TXBRP, TXBAR, TXBCR, TXBTO, TXBCF, TXBTIE, TXBCIE,
        TXEFC, TXEFS, TXEFA,
    ];
}

/// Bits of CCCR.
pub(super) mod cccr {
    pub const INIT: u32 = 1 << 0;
    pub const CCE: u32 = 1 << 1;
    pub const ASM: u32 = 1 << 2;
    pub const CSA: u32 = 1 << 3;
    pub const CSR: u32 = 1 << 4;
    pub const MON: u32 = 1 << 5;
    pub const DAR: u32 = 1 << 6;
    pub const TEST: u32 = 1 << 7;
    pub const FDOE: u32 = 1 << 8;
    /// Writable only during configuration: DAR, FDOE, BRSE, PXHD, EFBI, TXP, NISO.
    pub const PROTECTED: u32 = DAR | FDOE | 1 << 9 | 0b1111 << 12;
    /// May be set only during configuration, and cleared at any time.
    pub const SET_PROTECTED: u32 = ASM | MON | TEST;
}

/// Flags of IR; IE and ILS have the same bits.
pub(super) mod ir {
    /// The first four are FIFO 0's; those of FIFO 1 and of the event FIFO are in the same order.
    pub const RF0N: u32 = 1 << 0;
    pub const RF0W: u32 = 1 << 1;
    pub const RF0F: u32 = 1 << 2;
    pub const RF0L: u32 = 1 << 3;
    pub const HPM: u32 = 1 << 8;
    pub const TC: u32 = 1 << 9;
    pub const TCF: u32 = 1 << 10;
    pub const TFE: u32 = 1 << 11;
    pub const TSW: u32 = 1 << 16;
    pub const DRX: u32 = 1 << 19;
    pub const ELO: u32 = 1 << 22;
    pub const EP: u32 = 1 << 23;
    pub const EW: u32 = 1 << 24;
    pub const BO: u32 = 1 << 25;
    pub const PEA: u32 = 1 << 27;
    pub const ARA: u32 = 1 << 29;
}

/// TEST.LBCK: loop back.
pub(super) const TEST_LBCK: u32 = 1 << 4;

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Access {
    /// A constant.
    Constant,
    /// Holds a written value; writable only while CCCR.INIT and CCCR.CCE are set.
    Protected,
    /// Holds a written value.
    Open,
    /// Reading or writing it does something.
    Active,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Register {
    /// From a controller's base address.
    offset: u32,
    reset: u32,
    /// The bits that exist.
    mask: u32,
    pub access: Access,
}

const fn register(offset: u32, access: Access, reset: u32, mask: u32) -> Register {
    Register { offset, reset, mask, access }
}

const fn protected(offset: u32, reset: u32, mask: u32) -> Register {
    register(offset, Access::Protected, reset, mask)
}

const fn open(offset: u32, mask: u32) -> Register {
    register(offset, Access::Open, 0, mask)
}

const fn active(offset: u32) -> Register {
    register(offset, Access::Active, 0, 0)
}

/// Register at an offset, if there is one.
pub(super) fn find(offset: u32) -> Option<Register> {
    at::ALL.iter().copied().find(|register| register.offset == offset)
}

/// The registers that hold a written value.
pub(super) struct Registers([u32; 64]);

impl Default for Registers {
    fn default() -> Self {
        let mut registers = Self([0; 64]);
        for register in at::ALL {
            registers.set(register, register.reset);
        }
        registers
    }
}

impl Registers {
    pub const fn at(&self, register: Register) -> u32 {
        self.0[(register.offset / 4) as usize]
    }

    /// A field: `width` bits from bit `low` on.
    pub fn field(&self, register: Register, low: u32, width: u32) -> u32 {
        field(self.at(register), low, width)
    }

    /// Whether all these bits are set.
    pub const fn has(&self, register: Register, bits: u32) -> bool {
        self.at(register) & bits == bits
    }

    /// The first word in the message RAM: bits 15:2 of every start address.
    pub fn start_word(&self, register: Register) -> u32 {
        self.field(register, 2, 14)
    }

    /// Writes the bits that exist; whether that changed anything.
    pub fn store(&mut self, register: Register, value: u32) -> bool {
        self.set(register, value & register.mask)
    }

    /// Whether a write of this value would change anything.
    pub const fn would_change(&self, register: Register, value: u32) -> bool {
        self.at(register) != value & register.mask
    }

    pub fn set(&mut self, register: Register, value: u32) -> bool {
        let slot = &mut self.0[(register.offset / 4) as usize];
        std::mem::replace(slot, value) != value
    }
}
