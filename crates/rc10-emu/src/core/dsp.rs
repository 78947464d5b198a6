//! The DSP extension: several numbers in a register, and saturation (A6.5, A7.7).

use super::arithmetic::{long, rd, rm, rn, rt, saturated, set_long};
use super::exceptions::Fault;
use super::{Core, Done, GE, Q};

/// The two halves of a register, with their signs.
const fn halves(value: u32) -> [i64; 2] {
    [value as i16 as i64, (value >> 16) as i16 as i64]
}

/// Half of a register.
const fn half(value: u32, upper: bool) -> i64 {
    halves(value)[upper as usize]
}

/// The upper half of a register goes with the lower one of the other, if so.
const fn crossed(value: u32, crosses: bool) -> u32 {
    if crosses { value.rotate_left(16) } else { value }
}

/// Additions and subtractions of halves or bytes: SADD16 to UHSUB8.
pub(super) fn parallel(core: &mut Core, i: u32) -> Done {
    let kind = i >> 4 & 7;
    // Bits of a lane, whether halves cross, lanes that are subtracted.
    let (bits, crosses, subtracted) = match i >> 20 & 7 {
        0 => (8, false, 0),
        4 => (8, false, 0b1111),
        1 => (16, false, 0),
        2 => (16, true, 0b01),
        6 => (16, true, 0b10),
        5 => (16, false, 0b11),
        _ => return Err(Fault::Undefined),
    };
    let unsigned = kind & 4 != 0;
    let (a, b) = (core.get(rn(i)), crossed(core.get(rm(i)), crosses));
    let mask = (1 << bits) - 1;
    let number = |of: u32, lane: u32| {
        let number = (of >> (lane * bits) & mask) as i32;
        if unsigned { number } else { number << (32 - bits) >> (32 - bits) }
    };
    let (low, high) =
        if unsigned { (0, mask as i32) } else { (-(1 << (bits - 1)), mask as i32 >> 1) };
    let (mut result, mut greater) = (0, 0);
    for lane in 0..32 / bits {
        let subtracts = subtracted >> lane & 1 != 0;
        let second = number(b, lane);
        let sum = number(a, lane) + if subtracts { -second } else { second };
        let carries = if unsigned && !subtracts { sum > high } else { sum >= 0 };
        let of_lane = (1 << (bits / 8)) - 1;
        greater |= if carries { of_lane << (lane * bits / 8) } else { 0 };
        let sum = match kind & 3 {
            0 => sum,
            1 => sum.clamp(low, high),
            2 => sum >> 1,
            _ => return Err(Fault::Undefined),
        };
        result |= (sum as u32 & mask) << (lane * bits);
    }
    if kind & 3 == 0 {
        core.psr = core.psr & !GE | greater << 16;
    }
    core.set(rd(i), result);
    Ok(())
}

/// SXTAH to UXTB.
pub(super) fn extend(core: &mut Core, i: u32) -> Done {
    let value = core.get(rm(i)).rotate_right(8 * (i >> 4 & 3));
    let addend = if rn(i) == 15 { 0 } else { core.get(rn(i)) };
    let add = |value: u32| addend.wrapping_add(value);
    let of_halves = |value: u32| {
        addend.wrapping_add(value) & 0xFFFF | (addend >> 16).wrapping_add(value >> 16) << 16
    };
    let signed = |value: u32| value as i8 as u32 & 0xFFFF;
    let result = match i >> 20 & 7 {
        0 => add(value as i16 as u32),
        1 => add(value & 0xFFFF),
        2 => of_halves(signed(value) | signed(value >> 16) << 16),
        3 => of_halves(value & 0x00FF_00FF),
        4 => add(value as i8 as u32),
        5 => add(value & 0xFF),
        _ => return Err(Fault::Undefined),
    };
    core.set(rd(i), result);
    Ok(())
}

/// QADD, QDADD, QSUB, QDSUB.
pub(super) fn add_saturating(core: &mut Core, i: u32) -> Done {
    let (n, m) = (core.get(rn(i)) as i32, core.get(rm(i)) as i32);
    let mut n = i64::from(n);
    if i & 1 << 4 != 0 {
        n = (saturated(core, 2 * n, 31, false) as i32).into();
    }
    let sum = i64::from(m) + if i & 1 << 5 == 0 { n } else { -n };
    let result = saturated(core, sum, 31, false);
    core.set(rd(i), result);
    Ok(())
}

/// SSAT16, USAT16.
pub(super) fn saturate_halves<const UNSIGNED: bool>(core: &mut Core, i: u32) -> Done {
    let [low, high] =
        halves(core.get(rn(i))).map(|half| saturated(core, half, i & 15, UNSIGNED) & 0xFFFF);
    core.set(rd(i), high << 16 | low);
    Ok(())
}

pub(super) fn select(core: &mut Core, i: u32) -> Done {
    let flags = core.psr >> 16;
    let mask = (0..4).map(|byte| (flags >> byte & 1) * (0xFF << (8 * byte))).sum::<u32>();
    core.set(rd(i), core.get(rn(i)) & mask | core.get(rm(i)) & !mask);
    Ok(())
}

/// USAD8, USADA8.
pub(super) fn sum_differences(core: &mut Core, i: u32) -> Done {
    let [a, b] = [rn(i), rm(i)].map(|register| core.get(register).to_le_bytes());
    let differences = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)));
    let addend = if rt(i) == 15 { 0 } else { core.get(rt(i)) };
    core.set(rd(i), differences.sum::<u32>().wrapping_add(addend));
    Ok(())
}

/// Ends a multiplication with an addition that sets Q if it overflows; register 15 stands for none.
fn accumulate(core: &mut Core, i: u32, product: i64) {
    let addend = if rt(i) == 15 { 0 } else { core.get(rt(i)) as i32 };
    let sum = product + i64::from(addend);
    if sum != i64::from(sum as i32) {
        core.psr |= Q;
    }
    core.set(rd(i), sum as u32);
    core.clocks += 1;
}

/// SMULBB to SMLATT.
pub(super) fn multiply_halves(core: &mut Core, i: u32) -> Done {
    accumulate(core, i, product_of_halves(core, i));
    Ok(())
}

const fn product_of_halves(core: &Core, i: u32) -> i64 {
    half(core.get(rn(i)), i & 1 << 5 != 0) * half(core.get(rm(i)), i & 1 << 4 != 0)
}

/// SMULWB to SMLAWT.
pub(super) fn multiply_half(core: &mut Core, i: u32) -> Done {
    let second = half(core.get(rm(i)), i & 1 << 4 != 0);
    accumulate(core, i, i64::from(core.get(rn(i)) as i32) * second >> 16);
    Ok(())
}

/// The sum of the products of both halves, or the difference.
const fn products<const SUBTRACTS: bool>(core: &Core, i: u32) -> i64 {
    let a = halves(core.get(rn(i)));
    let b = halves(crossed(core.get(rm(i)), i & 1 << 4 != 0));
    if SUBTRACTS { a[0] * b[0] - a[1] * b[1] } else { a[0] * b[0] + a[1] * b[1] }
}

/// SMUAD, SMLAD, SMUSD, SMLSD.
pub(super) fn multiply_dual<const SUBTRACTS: bool>(core: &mut Core, i: u32) -> Done {
    accumulate(core, i, products::<SUBTRACTS>(core, i));
    Ok(())
}

/// SMLALD, SMLSLD.
pub(super) fn multiply_dual_long<const SUBTRACTS: bool>(core: &mut Core, i: u32) -> Done {
    let sum = long(core, i).wrapping_add(products::<SUBTRACTS>(core, i) as u64);
    set_long(core, i, sum);
    Ok(())
}

/// SMLALBB to SMLALTT.
pub(super) fn multiply_halves_long(core: &mut Core, i: u32) -> Done {
    let sum = long(core, i).wrapping_add(product_of_halves(core, i) as u64);
    set_long(core, i, sum);
    Ok(())
}

/// SMMUL, SMMLA, SMMLS: the upper word of the product, rounded if so.
pub(super) fn multiply_upper<const SUBTRACTS: bool>(core: &mut Core, i: u32) -> Done {
    let product = i64::from(core.get(rn(i)) as i32) * i64::from(core.get(rm(i)) as i32);
    let addend = if rt(i) == 15 { 0 } else { i64::from(core.get(rt(i))) << 32 };
    let sum = if SUBTRACTS { addend.wrapping_sub(product) } else { addend.wrapping_add(product) };
    let rounding = if i & 1 << 4 == 0 { 0 } else { 1 << 31 };
    core.set(rd(i), (sum.wrapping_add(rounding) >> 32) as u32);
    core.clocks += 1;
    Ok(())
}
