//! Offsets of the registers, existing bits, and when they are writable. Source: RM0468, FDCAN
//! register map; `stm32-metapac` (`can_fdcan_h7`).

use crate::peripherals::registers::{Register, fixed, locking, masked};

/// Offsets from a controller's base address.
pub(super) mod at {
    pub const TEST: u32 = 0x10;
    pub const CCCR: u32 = 0x18;
    pub const NBTP: u32 = 0x1C;
    pub const TSCC: u32 = 0x20;
    pub const TSCV: u32 = 0x24;
    pub const TOCC: u32 = 0x28;
    pub const TOCV: u32 = 0x2C;
    pub const ECR: u32 = 0x40;
    pub const PSR: u32 = 0x44;
    pub const IR: u32 = 0x50;
    pub const IE: u32 = 0x54;
    pub const ILS: u32 = 0x58;
    pub const ILE: u32 = 0x5C;
    pub const GFC: u32 = 0x80;
    pub const SIDFC: u32 = 0x84;
    pub const XIDFC: u32 = 0x88;
    pub const XIDAM: u32 = 0x90;
    pub const HPMS: u32 = 0x94;
    pub const NDAT1: u32 = 0x98;
    pub const NDAT2: u32 = 0x9C;
    pub const RXF0C: u32 = 0xA0;
    pub const RXF0S: u32 = 0xA4;
    pub const RXF0A: u32 = 0xA8;
    pub const RXBC: u32 = 0xAC;
    pub const RXF1C: u32 = 0xB0;
    pub const RXF1S: u32 = 0xB4;
    pub const RXF1A: u32 = 0xB8;
    pub const RXESC: u32 = 0xBC;
    pub const TXBC: u32 = 0xC0;
    pub const TXFQS: u32 = 0xC4;
    pub const TXESC: u32 = 0xC8;
    pub const TXBRP: u32 = 0xCC;
    pub const TXBAR: u32 = 0xD0;
    pub const TXBCR: u32 = 0xD4;
    pub const TXBTO: u32 = 0xD8;
    pub const TXBCF: u32 = 0xDC;
    pub const TXBTIE: u32 = 0xE0;
    pub const TXBCIE: u32 = 0xE4;
    pub const TXEFC: u32 = 0xF0;
    pub const TXEFS: u32 = 0xF4;
    pub const TXEFA: u32 = 0xF8;
}

const INTERRUPTS: u32 = 0x3FFF_FFFF;

/// All registers. Those that lock are writable only while CCCR.INIT and CCCR.CCE are set; reading or
/// writing others that are fixed here may do something.
#[rustfmt::skip]
pub(super) const TABLE: &[Register] = &[
    fixed(0x00, 0x3214_1218), fixed(0x04, 0x8765_4321), locking(0x0C, 0x0000_0A33, 0x009F_1FFF),
    locking(at::TEST, 0, 0x70), locking(0x14, 0, 0xFF), fixed(at::CCCR, cccr::INIT),
    locking(at::NBTP, 0x0600_0A03, 0xFFFF_FF7F), locking(at::TSCC, 0, 0x000F_0003),
    fixed(at::TSCV, 0), locking(at::TOCC, 0xFFFF_0000, 0xFFFF_0007), fixed(at::TOCV, 0),
    fixed(at::ECR, 0), fixed(at::PSR, 0), locking(0x48, 0, 0x7F7F), fixed(at::IR, 0),
    masked(at::IE, 0, INTERRUPTS), masked(at::ILS, 0, INTERRUPTS), masked(at::ILE, 0, 0b11),
    locking(at::GFC, 0, 0x3F), locking(at::SIDFC, 0, 0x00FF_FFFC),
    locking(at::XIDFC, 0, 0x007F_FFFC), locking(at::XIDAM, 0x1FFF_FFFF, 0x1FFF_FFFF),
    fixed(at::HPMS, 0), fixed(at::NDAT1, 0), fixed(at::NDAT2, 0),
    locking(at::RXF0C, 0, 0xFF7F_FFFC), fixed(at::RXF0S, 0), fixed(at::RXF0A, 0),
    locking(at::RXBC, 0, 0xFFFC), locking(at::RXF1C, 0, 0xFF7F_FFFC), fixed(at::RXF1S, 0),
    fixed(at::RXF1A, 0), locking(at::RXESC, 0, 0x777), locking(at::TXBC, 0, 0x7F3F_FFFC),
    fixed(at::TXFQS, 0), locking(at::TXESC, 0, 0x7), fixed(at::TXBRP, 0), fixed(at::TXBAR, 0),
    fixed(at::TXBCR, 0), fixed(at::TXBTO, 0), fixed(at::TXBCF, 0), masked(at::TXBTIE, 0, u32::MAX),
    masked(at::TXBCIE, 0, u32::MAX), locking(at::TXEFC, 0, 0x3F3F_FFFC), fixed(at::TXEFS, 0),
    fixed(at::TXEFA, 0),
];

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
