//! The table of all instructions (A5), and what has been found in it before.
//!
//! Almost every instruction of 16 bits is one of 32 bits in short: it is made that one, so that there
//! is one of each.

use super::arithmetic::*;
use super::dsp::*;
use super::exceptions::Fault;
use super::float::*;
use super::transfer::*;
use super::{Core, Done};

/// What executes an instruction.
pub(super) type Run = fn(&mut Core, u32) -> Done;

/// Instructions whose decoding is kept.
pub(super) const SLOTS: usize = 1 << 16;

/// The three highest bits of a long instruction are set; here they say: it takes four bytes, ..
const LONG: u32 = 1 << 31;
/// .. and it is a short one that sets no flags in an IT block.
const FLAGS: u32 = 1 << 30;
/// Of an instruction that computes: whether it sets flags.
pub(super) const S: u32 = 1 << 20;

/// An instruction, decoded.
#[derive(Clone, Copy)]
pub(super) struct Decoded {
    address: u32,
    bits: u32,
    run: Run,
}

/// Room for decoded instructions; no instruction has an odd address.
pub(super) fn no_slots() -> Box<[Decoded; SLOTS]> {
    let empty = Decoded { address: 1, bits: 0, run: undefined };
    let slots = vec![empty; SLOTS].into_boxed_slice();
    slots.try_into().unwrap_or_else(|_| unreachable!("as many as there are"))
}

impl Decoded {
    #[inline]
    pub(super) const fn slot(address: u32) -> usize {
        (address >> 1) as usize % SLOTS
    }

    #[inline]
    pub(super) const fn is_at(&self, address: u32) -> bool {
        self.address == address
    }

    #[inline]
    pub(super) const fn bytes(&self) -> u32 {
        2 + (self.bits >> 31) * 2
    }

    #[inline]
    pub(super) fn execute(&self, core: &mut Core) -> Done {
        (self.run)(core, self.bits)
    }

    /// As it is in an IT block.
    pub(super) const fn without_flags(mut self) -> Self {
        if self.bits & FLAGS != 0 {
            self.bits &= !S;
        }
        self
    }
}

impl Core {
    /// Fetches and decodes an instruction, and keeps it.
    #[cold]
    pub(super) fn decode(&mut self, address: u32) -> Result<Decoded, Fault> {
        let first = self.fetch(address)?;
        let (bits, run) = if first >> 11 > 0b11100 {
            let bits = first << 16 | self.fetch(address.wrapping_add(2))?;
            (bits & 0x1FFF_FFFF | LONG, look_up(WIDE, bits))
        } else if let Some((bits, flags)) = widen(first) {
            let flags = if flags { FLAGS } else { 0 };
            (bits & 0x1FFF_FFFF | flags, look_up(WIDE, bits))
        } else {
            (first | FLAGS | S, look_up(NARROW, first))
        };
        let decoded = Decoded { address, bits, run };
        self.slots[Decoded::slot(address)] = decoded;
        Ok(decoded)
    }

    /// Code was written, perhaps.
    pub(super) fn forget_code(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.address = 1);
        self.bus.memory.forget_code();
    }
}

fn look_up(table: &[(u32, u32, Run)], bits: u32) -> Run {
    let row = table.iter().find(|(mask, value, _)| bits & mask == *value);
    row.map_or(undefined, |&(.., run)| run)
}

/// The instruction of 32 bits that does what one of 16 bits does, and whether it sets flags only
/// outside of an IT block.
fn widen(half: u32) -> Option<(u32, bool)> {
    let field = |low: u32, bits: u32| half >> low & ((1 << bits) - 1);
    // Registers at the usual places, and immediates.
    let (low, middle, high) = (field(0, 3), field(3, 3), field(6, 3));
    let (eight, imm8, imm5) = (field(8, 3), field(0, 8), field(6, 5));
    let rd = |register: u32| register << 8;
    let rn = |register: u32| register << 16;
    let rt = |register: u32| register << 12;
    // Operation, sets flags: with an immediate, with registers.
    let immediate = |op: u32, rn: u32, rd: u32| 0xF010_0000 | op << 21 | rn << 16 | rd << 8;
    let registers = |op: u32, rn: u32, rd: u32| 0xEA10_0000 | op << 21 | rn << 16 | rd << 8;
    let wide = match half >> 11 {
        // LSL, LSR, ASR with an immediate; by 32 is 0.
        op @ 0..=2 => {
            registers(2, 15, low) | (imm5 & 0x1C) << 10 | (imm5 & 3) << 6 | op << 4 | middle
        }
        3 => match field(9, 2) {
            0 => registers(8, middle, low) | high,
            1 => registers(13, middle, low) | high,
            2 => immediate(8, middle, low) | high,
            _ => immediate(13, middle, low) | high,
        },
        4 => immediate(2, 15, eight) | imm8,
        5 => return Some((immediate(13, eight, 15) | imm8, false)),
        6 => immediate(8, eight, eight) | imm8,
        7 => immediate(13, eight, eight) | imm8,
        8 if half & 1 << 10 == 0 => return widen_registers(field(6, 4), low, middle),
        8 => {
            let (to, from) = (low | field(7, 1) << 3, field(3, 4));
            let wide = match field(8, 2) {
                0 => registers(8, to, to) & !S,
                1 => registers(13, to, 15),
                2 => registers(2, 15, to) & !S,
                _ => return None,
            };
            return Some((wide | from, false));
        }
        9 => return Some((0xF8DF_0000 | rt(eight) | imm8 << 2, false)),
        10 | 11 => {
            // Stores, loads with a sign, loads: STR, STRH, STRB, LDRSB, LDR, LDRH, LDRB, LDRSH.
            const OPS: [u32; 8] = [0xF84, 0xF82, 0xF80, 0xF91, 0xF85, 0xF83, 0xF81, 0xF93];
            let wide = OPS[field(9, 3) as usize] << 20;
            return Some((wide | rn(middle) | rt(low) | high, false));
        }
        op @ 12..=17 => {
            // Words, bytes, halves; store, load.
            let (base, shift) = [(0xF8C, 2), (0xF88, 0), (0xF8A, 1)][(op as usize - 12) / 2];
            let wide = base << 20 | (op & 1) << 20;
            return Some((wide | rn(middle) | rt(low) | imm5 << shift, false));
        }
        op @ 18..=19 => {
            let wide = 0xF8C0_0000 | (op & 1) << 20 | rn(13);
            return Some((wide | rt(eight) | imm8 << 2, false));
        }
        // The address of something near the program counter, or the stack pointer.
        op @ 20..=21 => {
            let base = if op == 20 { 15 } else { 13 };
            let imm = imm8 << 2;
            let wide = 0xF200_0000 | rn(base) | rd(eight) | (imm & 0x300) << 4 | imm & 0xFF;
            return Some((wide, false));
        }
        22 | 23 => return widen_various(half),
        24 => return Some((0xE8A0_0000 | rn(eight) | imm8, false)),
        25 => {
            let back = if imm8 >> eight & 1 == 0 { 1 << 21 } else { 0 };
            return Some((0xE890_0000 | back | rn(eight) | imm8, false));
        }
        26 | 27 if field(8, 4) < 14 => {
            let offset = ((imm8 as i8 as i32) << 1) as u32;
            let sign = offset >> 31;
            let wide = 0xF000_8000 | sign << 26 | sign << 13 | sign << 11 | field(8, 4) << 22;
            return Some((wide | (offset >> 12 & 0x3F) << 16 | offset >> 1 & 0x7FF, false));
        }
        28 => {
            let offset = (field(0, 11) << 21) as i32 >> 20;
            // With J1 and J2 set, what they stand for is the sign.
            let sign = offset as u32 >> 31;
            let wide = 0xF000_9000 | sign << 26 | 1 << 13 | 1 << 11;
            return Some((
                wide | (offset as u32 >> 12 & 0x3FF) << 16 | offset as u32 >> 1 & 0x7FF,
                false,
            ));
        }
        _ => return None,
    };
    Some((wide, true))
}

/// Data processing of 16 bits: the first operand is the result, too.
fn widen_registers(op: u32, low: u32, middle: u32) -> Option<(u32, bool)> {
    let registers = |op: u32, rn: u32, rd: u32| 0xEA10_0000 | op << 21 | rn << 16 | rd << 8;
    let shift = |kind: u32| 0xFA10_F000 | kind << 21 | low << 16 | low << 8;
    let wide = match op {
        0 => registers(0, low, low),
        1 => registers(4, low, low),
        2 => shift(0),
        3 => shift(1),
        4 => shift(2),
        5 => registers(10, low, low),
        6 => registers(11, low, low),
        7 => shift(3),
        8 => return Some((registers(0, low, 15) | middle, false)),
        9 => return Some((0xF1D0_0000 | middle << 16 | low << 8, true)),
        10 => return Some((registers(13, low, 15) | middle, false)),
        11 => return Some((registers(8, low, 15) | middle, false)),
        12 => registers(2, low, low),
        14 => registers(1, low, low),
        15 => registers(3, 15, low),
        _ => return None,
    };
    Some((wide | middle, true))
}

/// Miscellaneous instructions of 16 bits (A5.2.5).
fn widen_various(half: u32) -> Option<(u32, bool)> {
    let (low, middle) = (half & 7, half >> 3 & 7);
    let wide = match half >> 6 & 0x3F {
        // ADD and SUB of the stack pointer.
        op @ (0..=3) => {
            let imm = (half & 0x7F) << 2;
            let sub = if op < 2 { 0xF200_0000 } else { 0xF2A0_0000 };
            sub | 13 << 16 | 13 << 8 | (imm & 0x100) << 4 | imm & 0xFF
        }
        // SXTH, SXTB, UXTH, UXTB.
        op @ 8..=11 => {
            const OPS: [u32; 4] = [0xFA0F, 0xFA4F, 0xFA1F, 0xFA5F];
            OPS[op as usize - 8] << 16 | 0xF080 | low << 8 | middle
        }
        // REV, REV16, REVSH.
        op @ (0x28 | 0x29 | 0x2B) => 0xFA90_F080 | middle << 16 | low << 8 | (op & 3) << 4 | middle,
        // PUSH, with LR; POP, with PC.
        0x10..=0x17 => 0xE92D_0000 | half & 0xFF | (half & 0x100) << 6,
        0x30..=0x37 => 0xE8BD_0000 | half & 0xFF | (half & 0x100) << 7,
        // Hints.
        0x3C..=0x3F if half & 0xF == 0 => 0xF3AF_8000 | half >> 4 & 0xF,
        _ => return None,
    };
    Some((wide, false))
}

/// Instructions of 16 bits that are no others in short.
const NARROW: &[(u32, u32, Run)] = &[
    (0xFF80, 0x4700, branch_exchange),
    (0xFF80, 0x4780, branch_link_exchange),
    (0xFFC0, 0x4340, multiply_flags),
    (0xF500, 0xB100, compare_branch),
    (0xFFE0, 0xB660, change_state),
    (0xFF00, 0xBE00, break_point),
    (0xFF00, 0xBF00, if_then),
    (0xFF00, 0xDF00, supervisor_call),
];

/// Instructions of 32 bits: bits that decide, their values, and what executes it. The first row that
/// fits is meant.
const WIDE: &[(u32, u32, Run)] = &[
    // Data processing with a constant, and with a shifted register (A5.3.1, A5.3.11).
    (0xFBE0_8000, 0xF000_0000, immediate::<AND>),
    (0xFBE0_8000, 0xF020_0000, immediate::<BIC>),
    (0xFBE0_8000, 0xF040_0000, immediate::<ORR>),
    (0xFBE0_8000, 0xF060_0000, immediate::<ORN>),
    (0xFBE0_8000, 0xF080_0000, immediate::<EOR>),
    (0xFBE0_8000, 0xF100_0000, immediate::<ADD>),
    (0xFBE0_8000, 0xF140_0000, immediate::<ADC>),
    (0xFBE0_8000, 0xF160_0000, immediate::<SBC>),
    (0xFBE0_8000, 0xF1A0_0000, immediate::<SUB>),
    (0xFBE0_8000, 0xF1C0_0000, immediate::<RSB>),
    (0xFFE0_8000, 0xEA00_0000, register::<AND>),
    (0xFFE0_8000, 0xEA20_0000, register::<BIC>),
    (0xFFE0_8000, 0xEA40_0000, register::<ORR>),
    (0xFFE0_8000, 0xEA60_0000, register::<ORN>),
    (0xFFE0_8000, 0xEA80_0000, register::<EOR>),
    (0xFFF0_8010, 0xEAC0_0000, pack),
    (0xFFE0_8000, 0xEB00_0000, register::<ADD>),
    (0xFFE0_8000, 0xEB40_0000, register::<ADC>),
    (0xFFE0_8000, 0xEB60_0000, register::<SBC>),
    (0xFFE0_8000, 0xEBA0_0000, register::<SUB>),
    (0xFFE0_8000, 0xEBC0_0000, register::<RSB>),
    // With a plain constant (A5.3.3).
    (0xFBF0_8000, 0xF200_0000, add_plain::<false>),
    (0xFBF0_8000, 0xF2A0_0000, add_plain::<true>),
    (0xFBF0_8000, 0xF240_0000, move_half::<false>),
    (0xFBF0_8000, 0xF2C0_0000, move_half::<true>),
    (0xFFF0_F0E0, 0xF320_0000, saturate_halves::<false>),
    (0xFFF0_F0E0, 0xF3A0_0000, saturate_halves::<true>),
    (0xFFD0_8020, 0xF300_0000, saturate::<false>),
    (0xFFD0_8020, 0xF380_0000, saturate::<true>),
    (0xFFF0_8020, 0xF340_0000, extract_field::<true>),
    (0xFFF0_8020, 0xF3C0_0000, extract_field::<false>),
    (0xFFF0_8020, 0xF360_0000, insert_field),
    // Branches and control (A5.3.4).
    (0xF800_D000, 0xF000_9000, branch_far),
    (0xF800_D000, 0xF000_D000, branch_link),
    (0xFFE0_D000, 0xF380_8000, write_special),
    (0xFFF0_D000, 0xF3E0_8000, read_special),
    (0xFFF0_D0FF, 0xF3A0_8002, wait_for_event),
    (0xFFF0_D0FF, 0xF3A0_8003, wait_for_interrupt),
    (0xFFF0_D0FF, 0xF3A0_8004, send_event),
    (0xFFF0_D700, 0xF3A0_8000, nothing),
    (0xFFF0_D0F0, 0xF3B0_8020, clear_exclusive),
    (0xFFF0_D0E0, 0xF3B0_8040, nothing),
    (0xFFF0_D0F0, 0xF3B0_8060, nothing),
    (0xFB80_D000, 0xF380_8000, undefined),
    (0xF800_D000, 0xF000_8000, branch_if),
    // Loads and stores of several words (A5.3.5), of two, exclusive ones, and branches by a table
    // (A5.3.6).
    (0xFFD0_0000, 0xE880_0000, store_multiple::<false>),
    (0xFFD0_0000, 0xE900_0000, store_multiple::<true>),
    (0xFFD0_0000, 0xE890_0000, load_multiple::<false>),
    (0xFFD0_0000, 0xE910_0000, load_multiple::<true>),
    (0xFFF0_0000, 0xE840_0000, store_exclusive::<4>),
    (0xFFF0_0000, 0xE850_0000, load_exclusive::<4>),
    (0xFFF0_00F0, 0xE8C0_0040, store_exclusive::<1>),
    (0xFFF0_00F0, 0xE8C0_0050, store_exclusive::<2>),
    (0xFFF0_00F0, 0xE8D0_0040, load_exclusive::<1>),
    (0xFFF0_00F0, 0xE8D0_0050, load_exclusive::<2>),
    (0xFFF0_00F0, 0xE8D0_0000, branch_table::<1>),
    (0xFFF0_00F0, 0xE8D0_0010, branch_table::<2>),
    (0xFF70_0000, 0xE860_0000, store_dual),
    (0xFF70_0000, 0xE870_0000, load_dual),
    (0xFF50_0000, 0xE940_0000, store_dual),
    (0xFF50_0000, 0xE950_0000, load_dual),
    // Loads: from near the program counter, with twelve bits, a register, eight bits (A5.3.7 to
    // A5.3.9).
    (0xFF7F_0000, 0xF81F_0000, load::<1, false, LITERAL>),
    (0xFF7F_0000, 0xF83F_0000, load::<2, false, LITERAL>),
    (0xFF7F_0000, 0xF85F_0000, load::<4, false, LITERAL>),
    (0xFF7F_0000, 0xF91F_0000, load::<1, true, LITERAL>),
    (0xFF7F_0000, 0xF93F_0000, load::<2, true, LITERAL>),
    (0xFFF0_0000, 0xF890_0000, load::<1, false, TWELVE>),
    (0xFFF0_0000, 0xF8B0_0000, load::<2, false, TWELVE>),
    (0xFFF0_0000, 0xF8D0_0000, load::<4, false, TWELVE>),
    (0xFFF0_0000, 0xF990_0000, load::<1, true, TWELVE>),
    (0xFFF0_0000, 0xF9B0_0000, load::<2, true, TWELVE>),
    (0xFFF0_0FC0, 0xF810_0000, load::<1, false, REGISTER>),
    (0xFFF0_0FC0, 0xF830_0000, load::<2, false, REGISTER>),
    (0xFFF0_0FC0, 0xF850_0000, load::<4, false, REGISTER>),
    (0xFFF0_0FC0, 0xF910_0000, load::<1, true, REGISTER>),
    (0xFFF0_0FC0, 0xF930_0000, load::<2, true, REGISTER>),
    (0xFFF0_0800, 0xF810_0800, load::<1, false, EIGHT>),
    (0xFFF0_0800, 0xF830_0800, load::<2, false, EIGHT>),
    (0xFFF0_0800, 0xF850_0800, load::<4, false, EIGHT>),
    (0xFFF0_0800, 0xF910_0800, load::<1, true, EIGHT>),
    (0xFFF0_0800, 0xF930_0800, load::<2, true, EIGHT>),
    // Stores (A5.3.10).
    (0xFFF0_0000, 0xF880_0000, store::<1, TWELVE>),
    (0xFFF0_0000, 0xF8A0_0000, store::<2, TWELVE>),
    (0xFFF0_0000, 0xF8C0_0000, store::<4, TWELVE>),
    (0xFFF0_0FC0, 0xF800_0000, store::<1, REGISTER>),
    (0xFFF0_0FC0, 0xF820_0000, store::<2, REGISTER>),
    (0xFFF0_0FC0, 0xF840_0000, store::<4, REGISTER>),
    (0xFFF0_0800, 0xF800_0800, store::<1, EIGHT>),
    (0xFFF0_0800, 0xF820_0800, store::<2, EIGHT>),
    (0xFFF0_0800, 0xF840_0800, store::<4, EIGHT>),
    // With registers (A5.3.12 to A5.3.15).
    (0xFF80_F0F0, 0xFA00_F000, shift),
    (0xFF80_F080, 0xFA00_F080, extend),
    (0xFF80_F080, 0xFA80_F000, parallel),
    (0xFFF0_F0C0, 0xFA80_F080, add_saturating),
    (0xFFF0_F0F0, 0xFA90_F080, reverse_bytes),
    (0xFFF0_F0F0, 0xFA90_F090, reverse_halves),
    (0xFFF0_F0F0, 0xFA90_F0A0, reverse_bits),
    (0xFFF0_F0F0, 0xFA90_F0B0, reverse_signed),
    (0xFFF0_F0F0, 0xFAA0_F080, select),
    (0xFFF0_F0F0, 0xFAB0_F080, leading_zeros),
    // Multiplications (A5.3.16, A5.3.17).
    (0xFFF0_00F0, 0xFB00_0000, multiply::<false>),
    (0xFFF0_00F0, 0xFB00_0010, multiply::<true>),
    (0xFFF0_00C0, 0xFB10_0000, multiply_halves),
    (0xFFF0_00E0, 0xFB20_0000, multiply_dual::<false>),
    (0xFFF0_00E0, 0xFB40_0000, multiply_dual::<true>),
    (0xFFF0_00E0, 0xFB30_0000, multiply_half),
    (0xFFF0_00E0, 0xFB50_0000, multiply_upper::<false>),
    (0xFFF0_00E0, 0xFB60_0000, multiply_upper::<true>),
    (0xFFF0_00F0, 0xFB70_0000, sum_differences),
    (0xFFF0_00F0, 0xFB80_0000, multiply_long::<true, false>),
    (0xFFF0_00F0, 0xFB90_00F0, divide::<true>),
    (0xFFF0_00F0, 0xFBA0_0000, multiply_long::<false, false>),
    (0xFFF0_00F0, 0xFBB0_00F0, divide::<false>),
    (0xFFF0_00F0, 0xFBC0_0000, multiply_long::<true, true>),
    (0xFFF0_00C0, 0xFBC0_0080, multiply_halves_long),
    (0xFFF0_00E0, 0xFBC0_00C0, multiply_dual_long::<false>),
    (0xFFF0_00E0, 0xFBD0_00C0, multiply_dual_long::<true>),
    (0xFFF0_00F0, 0xFBE0_0000, multiply_long::<false, true>),
    (0xFFF0_00F0, 0xFBE0_0060, multiply_add_long),
    // The FPU (A6.4 to A6.7).
    (0xFFB0_0E10, 0xEE00_0A00, float_accumulate),
    (0xFFB0_0E10, 0xEE10_0A00, float_accumulate),
    (0xFFB0_0E10, 0xEE20_0A00, float_multiply),
    (0xFFB0_0E10, 0xEE30_0A00, float_add),
    (0xFFB0_0E50, 0xEE80_0A00, float_divide),
    (0xFFB0_0E10, 0xEE90_0A00, float_fused),
    (0xFFB0_0E10, 0xEEA0_0A00, float_fused),
    (0xFFB0_0E50, 0xEEB0_0A00, float_constant),
    (0xFFBE_0E50, 0xEEB0_0A40, float_unary),
    (0xFFBE_0E50, 0xEEB2_0A40, float_half),
    (0xFFBE_0E50, 0xEEB4_0A40, float_compare),
    (0xFFBF_0E50, 0xEEB6_0A40, float_round),
    (0xFFBF_0ED0, 0xEEB7_0A40, float_round),
    (0xFFBF_0ED0, 0xEEB7_0AC0, float_convert),
    (0xFFBF_0E50, 0xEEB8_0A40, float_from_integer),
    (0xFFBE_0E50, 0xEEBC_0A40, float_to_integer),
    (0xFFBA_0E50, 0xEEBA_0A40, float_fixed),
    (0xFF80_0E50, 0xFE00_0A00, float_select),
    (0xFFB0_0E10, 0xFE80_0A00, float_extreme),
    (0xFFBC_0ED0, 0xFEB8_0A40, float_round_mode),
    (0xFFBC_0E50, 0xFEBC_0A40, float_to_integer_mode),
    (0xFFE0_0F10, 0xEE00_0A10, float_move),
    (0xFFC0_0F70, 0xEE00_0B10, float_move_part),
    (0xFFF0_0F10, 0xEEE0_0A10, float_write_status),
    (0xFFF0_0F10, 0xEEF0_0A10, float_read_status),
    (0xFFE0_0ED0, 0xEC40_0A10, float_move_two),
    (0xFF20_0E00, 0xED00_0A00, float_transfer),
    (0xFF80_0E00, 0xEC80_0A00, float_transfer_multiple),
    (0xFFA0_0E00, 0xED20_0A00, float_transfer_multiple),
    (0xEC00_0E00, 0xEC00_0A00, float_undefined),
    (0xEC00_0000, 0xEC00_0000, no_coprocessor),
];
