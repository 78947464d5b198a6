//! The DSP extension: several numbers in a register, and saturation (A5.3.12 to A5.3.17, A7.7).

use super::arithmetic::{rd, rm, rn, rt, saturated};
use super::exceptions::Fault;
use super::{Core, Done, GE, Q};

/// The two halves of a register, with their signs.
const fn halves(value: u32) -> [i64; 2] {
    [value as i16 as i64, (value >> 16) as i16 as i64]
}

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

/// QADD to QDSUB; REV to REVSH; SEL; CLZ: what bits 20, 21, 4 and 5 say.
pub(super) fn rearrange(core: &mut Core, i: u32) -> Done {
    let (n, m) = (core.get(rn(i)), core.get(rm(i)));
    let result = match (i >> 20 & 3, i >> 4 & 3) {
        (0, kind) => {
            let n = i64::from(n as i32);
            let n = if kind & 1 == 0 { n } else { saturated(core, 2 * n, 31, false) as i32 as i64 };
            let sum = i64::from(m as i32) + if kind & 2 == 0 { n } else { -n };
            saturated(core, sum, 31, false)
        }
        (1, 0) => m.swap_bytes(),
        (1, 1) => m.swap_bytes().rotate_left(16),
        (1, 2) => m.reverse_bits(),
        (1, _) => (m as i16).swap_bytes() as u32,
        (2, 0) => {
            let flags = core.psr >> 16;
            let mask = (0..4).map(|byte| (flags >> byte & 1) * (0xFF << (8 * byte))).sum::<u32>();
            n & mask | m & !mask
        }
        (3, 0) => m.leading_zeros(),
        _ => return Err(Fault::Undefined),
    };
    core.set(rd(i), result);
    Ok(())
}

/// The product of two halves that bits 5 and 4 name.
const fn product_of_halves(core: &Core, i: u32) -> i64 {
    half(core.get(rn(i)), i & 1 << 5 != 0) * half(core.get(rm(i)), i & 1 << 4 != 0)
}

/// The sum of the products of both halves, or the difference.
const fn products(core: &Core, i: u32, subtracts: bool) -> i64 {
    let a = halves(core.get(rn(i)));
    let b = halves(crossed(core.get(rm(i)), i & 1 << 4 != 0));
    if subtracts { a[0] * b[0] - a[1] * b[1] } else { a[0] * b[0] + a[1] * b[1] }
}

/// Multiplications of parts of registers, with an addend if there is one: SMULBB to SMLATT, SMUAD,
/// SMLAD, SMULWB to SMLAWT, SMUSD, SMLSD, SMMUL to SMMLS, USAD8.
pub(super) fn multiply_parts(core: &mut Core, i: u32) -> Done {
    let (n, m) = (core.get(rn(i)), core.get(rm(i)));
    let wide = i64::from(n as i32) * i64::from(m as i32);
    let addend = if rt(i) == 15 { 0 } else { i64::from(core.get(rt(i)) as i32) };
    let (upper, rounding) = (addend << 32, i64::from(i >> 4 & 1) << 31);
    let sum = match i >> 20 & 7 {
        1 => addend + product_of_halves(core, i),
        2 => addend + products(core, i, false),
        3 => addend + ((i64::from(n as i32) * half(m, i & 1 << 4 != 0)) >> 16),
        4 => addend + products(core, i, true),
        op @ (5 | 6) => {
            let wide = if op == 5 { wide } else { wide.wrapping_neg() };
            upper.wrapping_add(wide).wrapping_add(rounding) >> 32
        }
        7 => {
            let bytes = n.to_le_bytes().into_iter().zip(m.to_le_bytes());
            let differences = bytes.map(|(n, m)| u32::from(n.abs_diff(m))).sum::<u32>();
            core.set(rd(i), differences.wrapping_add(addend as u32));
            return Ok(());
        }
        _ => return Err(Fault::Undefined),
    };
    if sum != i64::from(sum as i32) {
        core.psr |= Q;
    }
    core.set(rd(i), sum as u32);
    core.clocks += 1;
    Ok(())
}

/// Multiplications with a result in two registers, to which it may be added.
pub(super) fn multiply_long(core: &mut Core, i: u32) -> Done {
    let (n, m) = (core.get(rn(i)), core.get(rm(i)));
    let (low, high) = (u64::from(core.get(rt(i))), u64::from(core.get(rd(i))));
    let signed = (i64::from(n as i32) * i64::from(m as i32)) as u64;
    let unsigned = u64::from(n) * u64::from(m);
    let pair = high << 32 | low;
    let result = match (i >> 20 & 7, i >> 4 & 15) {
        (0, 0) => signed,
        (2, 0) => unsigned,
        (4, 0) => pair.wrapping_add(signed),
        (4, 8..=11) => pair.wrapping_add(product_of_halves(core, i) as u64),
        (4, 12 | 13) => pair.wrapping_add(products(core, i, false) as u64),
        (5, 12 | 13) => pair.wrapping_add(products(core, i, true) as u64),
        (6, 0) => pair.wrapping_add(unsigned),
        // UMAAL.
        (6, 6) => unsigned + low + high,
        _ => return Err(Fault::Undefined),
    };
    core.set(rt(i), result as u32);
    core.set(rd(i), (result >> 32) as u32);
    core.clocks += 1;
    Ok(())
}
