//! Data processing, branches, control (A5, A7.7).

use super::decode::S;
use super::exceptions::Fault;
use super::system::CCR;
use super::{C, Core, Done, N, Q, V, Z};

// Operations of data processing, as both forms encode them.
words! { pub(super)
    AND: 0, BIC: 1, ORR: 2, ORN: 3, EOR: 4, ADD: 8, ADC: 10, SBC: 11, SUB: 13, RSB: 14,
}

/// `CCR.DIV_0_TRP`.
const TRAPS_DIVISION: u32 = 1 << 4;

/// The registers where most instructions have them: first operand, result, second operand.
pub(super) const fn rn(i: u32) -> u32 {
    i >> 16 & 15
}
pub(super) const fn rd(i: u32) -> u32 {
    i >> 8 & 15
}
pub(super) const fn rm(i: u32) -> u32 {
    i & 15
}
/// Register that is loaded or stored, or added.
pub(super) const fn rt(i: u32) -> u32 {
    i >> 12 & 15
}

/// An amount to shift by, or the lowest bit of a field.
const fn amount(i: u32) -> u32 {
    i >> 10 & 0x1C | i >> 6 & 3
}

/// Twelve bits of a constant.
const fn twelve(i: u32) -> u32 {
    i >> 15 & 0x800 | i >> 4 & 0x700 | i & 0xFF
}

#[inline]
const fn add_with_carry(a: u32, b: u32, carry: bool) -> (u32, bool, bool) {
    let sum = a as u64 + b as u64 + carry as u64;
    let result = sum as u32;
    (result, sum >> 32 != 0, (a ^ result) & (b ^ result) >> 31 << 31 != 0)
}

/// Shifts by 1 to 255; also says the last bit that was shifted out.
const fn shifted(kind: u32, value: u32, amount: u32) -> (u32, bool) {
    let wide = value as u64;
    let signed = value as i32 as i64;
    let bounded = if amount > 33 { 33 } else { amount };
    match kind {
        0 => ((wide << bounded) as u32, wide << bounded >> 32 & 1 != 0),
        1 => ((wide >> bounded) as u32, wide >> (bounded - 1) & 1 != 0),
        2 => ((signed >> bounded) as u32, signed >> (bounded - 1) & 1 != 0),
        _ => {
            let result = value.rotate_right(amount & 31);
            (result, result >> 31 != 0)
        }
    }
}

/// The second operand, a register shifted by a constant (A7.4.2); also the carry.
#[inline]
fn shifted_operand(core: &Core, i: u32) -> (u32, bool) {
    let (value, carry) = (core.get(rm(i)), core.psr & C != 0);
    match (i >> 4 & 3, amount(i)) {
        (0, 0) => (value, carry),
        (3, 0) => (value >> 1 | u32::from(carry) << 31, value & 1 != 0),
        (kind, 0) => shifted(kind, value, 32),
        (kind, amount) => shifted(kind, value, amount),
    }
}

#[inline]
fn set_nz(core: &mut Core, result: u32) {
    core.psr = core.psr & !(N | Z) | result & N | if result == 0 { Z } else { 0 };
}

#[inline]
fn compute<const OP: u32>(core: &mut Core, i: u32, b: u32, shifter_carry: bool) -> Done {
    let (first, a) = (rn(i), core.get(rn(i)));
    let old = core.psr;
    let logical = |result| (result, shifter_carry, old & V != 0);
    let (result, carry, overflow) = match OP {
        AND => logical(a & b),
        BIC => logical(a & !b),
        // MOV and MVN.
        ORR => logical(if first == 15 { b } else { a | b }),
        ORN => logical(if first == 15 { !b } else { a | !b }),
        EOR => logical(a ^ b),
        ADC => add_with_carry(a, b, old & C != 0),
        SBC => add_with_carry(a, !b, old & C != 0),
        SUB => add_with_carry(a, !b, true),
        RSB => add_with_carry(!a, b, true),
        _ => add_with_carry(a, b, false),
    };
    let sets = i & S != 0;
    if sets {
        let carry = if carry { C } else { 0 };
        let overflow = if overflow { V } else { 0 };
        core.psr = old & !(C | V) | carry | overflow;
        set_nz(core, result);
    }
    match rd(i) {
        // TST, TEQ, CMN, CMP.
        15 if sets => {}
        15 => core.branch(result),
        to => core.set(to, result),
    }
    Ok(())
}

pub(super) fn immediate<const OP: u32>(core: &mut Core, i: u32) -> Done {
    // A5.3.2: repeated, or rotated.
    let (twelve, byte) = (twelve(i), i & 0xFF);
    let value = match twelve >> 8 {
        0 => byte,
        1 => byte * 0x0001_0001,
        2 => byte * 0x0100_0100,
        3 => byte * 0x0101_0101,
        _ => (0x80 | byte).rotate_right(twelve >> 7),
    };
    let carry = if twelve >> 10 == 0 { core.psr & C != 0 } else { value >> 31 != 0 };
    compute::<OP>(core, i, value, carry)
}

pub(super) fn register<const OP: u32>(core: &mut Core, i: u32) -> Done {
    let (value, carry) = shifted_operand(core, i);
    compute::<OP>(core, i, value, carry)
}

pub(super) fn shift(core: &mut Core, i: u32) -> Done {
    let (value, amount) = (core.get(rn(i)), core.get(rm(i)) & 0xFF);
    let (result, carry) =
        if amount == 0 { (value, core.psr & C != 0) } else { shifted(i >> 21 & 3, value, amount) };
    core.set(rd(i), result);
    if i & S != 0 {
        core.psr = core.psr & !C | if carry { C } else { 0 };
        set_nz(core, result);
    }
    Ok(())
}

/// PKHBT, PKHTB.
pub(super) fn pack(core: &mut Core, i: u32) -> Done {
    let (a, (b, _)) = (core.get(rn(i)), shifted_operand(core, i));
    let low = if i & 1 << 5 == 0 { 0xFFFF } else { 0xFFFF_0000 };
    core.set(rd(i), a & low | b & !low);
    Ok(())
}

/// ADDW, SUBW, ADR.
pub(super) fn add_plain<const SUBTRACTS: bool>(core: &mut Core, i: u32) -> Done {
    let base = if rn(i) == 15 { core.r[15] & !3 } else { core.get(rn(i)) };
    let offset = twelve(i);
    core.set(rd(i), if SUBTRACTS { base.wrapping_sub(offset) } else { base.wrapping_add(offset) });
    Ok(())
}

/// MOVW, MOVT.
pub(super) fn move_half<const TOP: bool>(core: &mut Core, i: u32) -> Done {
    let half = i >> 4 & 0xF000 | twelve(i);
    let to = rd(i);
    core.set(to, if TOP { core.get(to) & 0xFFFF | half << 16 } else { half });
    Ok(())
}

/// UBFX, SBFX.
pub(super) fn extract_field<const SIGNED: bool>(core: &mut Core, i: u32) -> Done {
    let field = core.get(rn(i)) >> amount(i);
    let above = 31 - (i & 31);
    let field = field << above;
    core.set(rd(i), if SIGNED { (field as i32 >> above) as u32 } else { field >> above });
    Ok(())
}

/// BFI, BFC.
pub(super) fn insert_field(core: &mut Core, i: u32) -> Done {
    let (low, high) = (amount(i), i & 31);
    let mask = (u32::MAX >> (31 - high)) & u32::MAX << low;
    let field = if rn(i) == 15 { 0 } else { core.get(rn(i)) << low };
    core.set(rd(i), core.get(rd(i)) & !mask | field & mask);
    Ok(())
}

/// SSAT, USAT; by 0 to the right: of both halves.
pub(super) fn saturate<const UNSIGNED: bool>(core: &mut Core, i: u32) -> Done {
    let value = core.get(rn(i)) as i32;
    let result = match (i >> 21 & 1, amount(i)) {
        (0, amount) => saturated(core, (value << amount).into(), i & 31, UNSIGNED),
        (_, 0) => {
            let [low, high] = [value as i16, (value >> 16) as i16]
                .map(|half| saturated(core, half.into(), i & 15, UNSIGNED) & 0xFFFF);
            high << 16 | low
        }
        (_, amount) => saturated(core, (value >> amount).into(), i & 31, UNSIGNED),
    };
    core.set(rd(i), result);
    Ok(())
}

/// A value in the range that SSAT and USAT encode as `bits`; Q, if it was not in it.
pub(super) fn saturated(core: &mut Core, value: i64, bits: u32, unsigned: bool) -> u32 {
    let (low, high) = if unsigned { (0, (1 << bits) - 1) } else { (-(1 << bits), (1 << bits) - 1) };
    let result = value.clamp(low, high);
    if result != value {
        core.psr |= Q;
    }
    result as u32
}

/// MUL, MLA, MLS.
pub(super) fn multiply(core: &mut Core, i: u32) -> Done {
    let product = core.get(rn(i)).wrapping_mul(core.get(rm(i)));
    let addend = core.get(rt(i));
    let result = match rt(i) {
        _ if i & 1 << 4 != 0 => addend.wrapping_sub(product),
        15 => product,
        _ => addend.wrapping_add(product),
    };
    core.set(rd(i), result);
    Ok(())
}

/// MULS.
pub(super) fn multiply_flags(core: &mut Core, i: u32) -> Done {
    let result = core.get(i & 7).wrapping_mul(core.get(i >> 3 & 7));
    core.set(i & 7, result);
    if i & S != 0 {
        set_nz(core, result);
    }
    Ok(())
}

/// SDIV, UDIV.
pub(super) fn divide(core: &mut Core, i: u32) -> Done {
    core.clocks += 2;
    let (a, b) = (core.get(rn(i)), core.get(rm(i)));
    if b == 0 && core.system.word(CCR) & TRAPS_DIVISION != 0 {
        return Err(Fault::DivideByZero);
    }
    let quotient = match b {
        0 => 0,
        _ if i & 1 << 21 == 0 => (a as i32).wrapping_div(b as i32) as u32,
        _ => a / b,
    };
    core.set(rd(i), quotient);
    Ok(())
}

/// Distance of a branch: its sign, and the two bits that depend on it, then the rest.
const fn distance(i: u32, sign_inverts: bool, rest_bits: u32) -> u32 {
    let sign = i >> 26 & 1;
    let [first, second] = [i >> 13 & 1, i >> 11 & 1];
    let upper = if sign_inverts {
        sign << 2 | (first ^ sign ^ 1) << 1 | second ^ sign ^ 1
    } else {
        sign << 2 | second << 1 | first
    };
    let rest = (i >> 16 & ((1 << rest_bits) - 1)) << 12 | (i & 0x7FF) << 1;
    let bits = upper << (12 + rest_bits) | rest;
    ((bits << (17 - rest_bits)) as i32 >> (17 - rest_bits)) as u32
}

pub(super) fn branch_if(core: &mut Core, i: u32) -> Done {
    if core.holds(i >> 22 & 15) {
        core.branch(core.r[15].wrapping_add(distance(i, false, 6)));
    }
    Ok(())
}

pub(super) fn branch_far(core: &mut Core, i: u32) -> Done {
    core.branch(core.r[15].wrapping_add(distance(i, true, 10)));
    Ok(())
}

pub(super) fn branch_link(core: &mut Core, i: u32) -> Done {
    core.r[14] = core.next | 1;
    branch_far(core, i)
}

pub(super) fn branch_link_exchange(core: &mut Core, i: u32) -> Done {
    let to = core.get(i >> 3);
    core.r[14] = core.next | 1;
    core.branch_exchange(to)
}

/// CBZ, CBNZ.
pub(super) fn compare_branch(core: &mut Core, i: u32) -> Done {
    if (core.get(i & 7) != 0) == (i & 1 << 11 != 0) {
        core.branch(core.r[15].wrapping_add(i >> 3 & 0x40 | i >> 2 & 0x3E));
    }
    Ok(())
}

/// IT, and hints.
pub(super) fn if_then(core: &mut Core, i: u32) -> Done {
    if i & 15 == 0 {
        return hint(core, i >> 4 & 15);
    }
    core.set_it_state(i & 0xFF);
    Ok(())
}

/// CPS.
pub(super) fn change_state(core: &mut Core, i: u32) -> Done {
    let masks = i & 1 << 4 != 0;
    if core.is_privileged() {
        if i & 2 != 0 {
            core.primask = masks;
        }
        if i & 1 != 0 {
            core.set_faultmask(masks);
            core.protect();
        }
        core.attention = true;
    }
    Ok(())
}

/// WFE, WFI, SEV; others say nothing to this core.
pub(super) fn hint(core: &mut Core, i: u32) -> Done {
    match i & 0xFF {
        2 => core.wait_for(true),
        3 => core.wait_for(false),
        4 => core.event = true,
        _ => {}
    }
    Ok(())
}

pub(super) fn undefined(_: &mut Core, _: u32) -> Done {
    Err(Fault::Undefined)
}
