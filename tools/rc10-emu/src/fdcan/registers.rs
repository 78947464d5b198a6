//! Offsets of the registers, existing bits, and when they are writable. Source: RM0468, FDCAN
//! register map; `stm32-metapac` (`can_fdcan_h7`).

/// Offsets from a controller's base address.
pub(super) mod at {
    pub const CREL: u32 = 0x00;
    pub const ENDN: u32 = 0x04;
    pub const DBTP: u32 = 0x0C;
    pub const TEST: u32 = 0x10;
    pub const RWD: u32 = 0x14;
    pub const CCCR: u32 = 0x18;
    pub const NBTP: u32 = 0x1C;
    pub const TSCC: u32 = 0x20;
    pub const TSCV: u32 = 0x24;
    pub const TOCC: u32 = 0x28;
    pub const TOCV: u32 = 0x2C;
    pub const ECR: u32 = 0x40;
    pub const PSR: u32 = 0x44;
    pub const TDCR: u32 = 0x48;
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
    /// The first four are FIFO 0's; FIFO 1's are four bits higher.
    pub const RF0N: u32 = 1 << 0;
    pub const RF0W: u32 = 1 << 1;
    pub const RF0F: u32 = 1 << 2;
    pub const RF0L: u32 = 1 << 3;
    pub const HPM: u32 = 1 << 8;
    pub const TC: u32 = 1 << 9;
    pub const TCF: u32 = 1 << 10;
    pub const TFE: u32 = 1 << 11;
    pub const TEFN: u32 = 1 << 12;
    pub const TEFW: u32 = 1 << 13;
    pub const TEFF: u32 = 1 << 14;
    pub const TEFL: u32 = 1 << 15;
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

pub(super) struct Register {
    offset: u32,
    reset: u32,
    /// The bits that exist.
    mask: u32,
    pub access: Access,
}

const fn register(offset: u32, access: Access, reset: u32, mask: u32) -> Register {
    Register { offset, reset, mask, access }
}

const fn active(offset: u32) -> Register {
    register(offset, Access::Active, 0, 0)
}

const INTERRUPTS: u32 = 0x3FFF_FFFF;

static MAP: [Register; 46] = [
    register(at::CREL, Access::Constant, 0x3214_1218, 0),
    register(at::ENDN, Access::Constant, 0x8765_4321, 0),
    register(at::DBTP, Access::Protected, 0x0000_0A33, 0x009F_1FFF),
    register(at::TEST, Access::Active, 0, 0x70),
    register(at::RWD, Access::Protected, 0, 0xFF),
    register(at::CCCR, Access::Active, cccr::INIT, 0),
    register(at::NBTP, Access::Protected, 0x0600_0A03, 0xFFFF_FF7F),
    register(at::TSCC, Access::Protected, 0, 0x000F_0003),
    active(at::TSCV),
    register(at::TOCC, Access::Protected, 0xFFFF_0000, 0xFFFF_0007),
    active(at::TOCV),
    active(at::ECR),
    active(at::PSR),
    register(at::TDCR, Access::Protected, 0, 0x7F7F),
    active(at::IR),
    register(at::IE, Access::Open, 0, INTERRUPTS),
    register(at::ILS, Access::Open, 0, INTERRUPTS),
    register(at::ILE, Access::Open, 0, 0b11),
    register(at::GFC, Access::Protected, 0, 0x3F),
    register(at::SIDFC, Access::Protected, 0, 0x00FF_FFFC),
    register(at::XIDFC, Access::Protected, 0, 0x007F_FFFC),
    register(at::XIDAM, Access::Protected, 0x1FFF_FFFF, 0x1FFF_FFFF),
    active(at::HPMS),
    active(at::NDAT1),
    active(at::NDAT2),
    register(at::RXF0C, Access::Protected, 0, 0xFF7F_FFFC),
    active(at::RXF0S),
    active(at::RXF0A),
    register(at::RXBC, Access::Protected, 0, 0xFFFC),
    register(at::RXF1C, Access::Protected, 0, 0xFF7F_FFFC),
    active(at::RXF1S),
    active(at::RXF1A),
    register(at::RXESC, Access::Protected, 0, 0x777),
    register(at::TXBC, Access::Protected, 0, 0x7F3F_FFFC),
    active(at::TXFQS),
    register(at::TXESC, Access::Protected, 0, 0x7),
    active(at::TXBRP),
    active(at::TXBAR),
    active(at::TXBCR),
    active(at::TXBTO),
    active(at::TXBCF),
    register(at::TXBTIE, Access::Open, 0, u32::MAX),
    register(at::TXBCIE, Access::Open, 0, u32::MAX),
    register(at::TXEFC, Access::Protected, 0, 0x3F3F_FFFC),
    active(at::TXEFS),
    active(at::TXEFA),
];

/// Register at an offset, if there is one.
pub(super) fn find(offset: u32) -> Option<&'static Register> {
    MAP.iter().find(|register| register.offset == offset)
}

/// The registers that hold a written value.
pub(super) struct Registers([u32; 64]);

impl Registers {
    pub fn new() -> Self {
        let mut values = [0; 64];
        for register in &MAP {
            values[(register.offset / 4) as usize & 63] = register.reset;
        }
        Self(values)
    }

    /// The value at an offset below 0x100.
    pub fn at(&self, offset: u32) -> u32 {
        self.0[(offset / 4) as usize & 63]
    }

    /// A field: `width` bits from bit `low` on.
    pub fn field(&self, offset: u32, low: u32, width: u32) -> u32 {
        field(self.at(offset), low, width)
    }

    /// Whether all these bits are set.
    pub fn has(&self, offset: u32, bits: u32) -> bool {
        self.at(offset) & bits == bits
    }

    /// The first word in the message RAM: bits 15:2 of every start address.
    pub fn start_word(&self, offset: u32) -> u32 {
        self.field(offset, 2, 14)
    }

    /// Writes the bits that exist; whether that changed anything.
    pub fn store(&mut self, register: &Register, value: u32) -> bool {
        self.set(register.offset, value & register.mask)
    }

    /// Whether a write of this value would change anything.
    pub fn would_change(&self, register: &Register, value: u32) -> bool {
        self.at(register.offset) != value & register.mask
    }

    pub fn set(&mut self, offset: u32, value: u32) -> bool {
        let slot = &mut self.0[(offset / 4) as usize & 63];
        std::mem::replace(slot, value) != value
    }
}

/// `width` (below 32) bits of a word from bit `low` on.
pub(super) const fn field(word: u32, low: u32, width: u32) -> u32 {
    word >> low & ((1 << width) - 1)
}
