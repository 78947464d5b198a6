//! Offsets of the registers, existing bits, and when they are writable. Source: RM0468, FDCAN
//! register map; `stm32-metapac` (`can_fdcan_h7`).

use crate::peripherals::registers::{Register, fixed, locking, masked};

/// Offsets from a controller's base address.
pub(super) mod at {
    words! { pub
        TEST: 0x10, CCCR: 0x18, NBTP: 0x1C, TSCC: 0x20, TSCV: 0x24, TOCC: 0x28, TOCV: 0x2C,
        ECR: 0x40, PSR: 0x44, IR: 0x50, IE: 0x54, ILS: 0x58, ILE: 0x5C, GFC: 0x80, SIDFC: 0x84,
        XIDFC: 0x88, XIDAM: 0x90, HPMS: 0x94, NDAT1: 0x98, NDAT2: 0x9C, RXF0C: 0xA0, RXF0S: 0xA4,
        RXF0A: 0xA8, RXBC: 0xAC, RXF1C: 0xB0, RXF1S: 0xB4, RXF1A: 0xB8, RXESC: 0xBC, TXBC: 0xC0,
        TXFQS: 0xC4, TXESC: 0xC8, TXBRP: 0xCC, TXBAR: 0xD0, TXBCR: 0xD4, TXBTO: 0xD8, TXBCF: 0xDC,
        TXBTIE: 0xE0, TXBCIE: 0xE4, TXEFC: 0xF0, TXEFS: 0xF4, TXEFA: 0xF8,
    }
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
    bits! { pub INIT: 0, CCE: 1, ASM: 2, CSA: 3, CSR: 4, MON: 5, DAR: 6, TEST: 7, FDOE: 8 }
    /// Writable only during configuration: DAR, FDOE, BRSE, PXHD, EFBI, TXP, NISO.
    pub const PROTECTED: u32 = DAR | FDOE | 1 << 9 | 0b1111 << 12;
    /// May be set only during configuration, and cleared at any time.
    pub const SET_PROTECTED: u32 = ASM | MON | TEST;
}

/// Flags of IR; IE and ILS have the same bits.
pub(super) mod ir {
    // The first four are FIFO 0's; those of FIFO 1 and of the event FIFO are in the same order.
    bits! { pub
        RF0N: 0, RF0W: 1, RF0F: 2, RF0L: 3, HPM: 8, TC: 9, TCF: 10, TFE: 11, TSW: 16, DRX: 19,
        ELO: 22, EP: 23, EW: 24, BO: 25, PEA: 27, ARA: 29,
    }
}

/// TEST.LBCK: loop back.
pub(super) const TEST_LBCK: u32 = 1 << 4;
