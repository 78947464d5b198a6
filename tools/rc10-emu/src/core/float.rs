//! Instructions of the FPU (A6.4 to A6.7, A7.7): `FPv5` in both precisions.

use super::arithmetic::{rn, rt};
use super::exceptions::{FPSCR, Fault, places};
use super::ieee::{DOUBLE, FZ, Float, Format, HALF, IXC, ROUNDING, Round, SINGLE};
use super::transfer::{BACK, UP, align, offset};
use super::{C, Core, Done, N, V, Z};

const fn is_double(i: u32) -> bool {
    i & 1 << 8 != 0
}

const fn format(double: bool) -> Format {
    if double { DOUBLE } else { SINGLE }
}

/// Index of the single register that is a register, or its lower half: four bits and one more.
const fn index(double: bool, four: u32, one: u32) -> usize {
    (if double { four << 1 | one << 5 } else { four << 1 | one }) as usize & 31
}
const fn d(i: u32, double: bool) -> usize {
    index(double, i >> 12 & 15, i >> 22 & 1)
}
const fn n(i: u32, double: bool) -> usize {
    index(double, i >> 16 & 15, i >> 7 & 1)
}
const fn m(i: u32, double: bool) -> usize {
    index(double, i & 15, i >> 5 & 1)
}

/// An operation with two operands: in this computer's arithmetic, and in our own.
type Operation = (fn(f32, f32) -> f32, fn(f64, f64) -> f64, fn(&mut Float, u64, u64) -> u64);
const ADD: Operation = (|a, b| a + b, |a, b| a + b, |float, a, b| float.add(a, b, false));
const SUBTRACT: Operation = (|a, b| a - b, |a, b| a - b, |float, a, b| float.add(a, b, true));
const MULTIPLY: Operation = (|a, b| a * b, |a, b| a * b, Float::multiply);
const DIVIDE: Operation = (|a, b| a / b, |a, b| a / b, Float::divide);
const SQUARE_ROOT: Operation =
    (|a, _| a.sqrt(), |a, _| a.sqrt(), |float, a, _| float.square_root(a));

impl Core {
    #[inline]
    const fn number(&self, index: usize, double: bool) -> u64 {
        let low = self.s[index] as u64;
        if double { (self.s[index | 1] as u64) << 32 | low } else { low }
    }

    #[inline]
    fn set_number(&mut self, index: usize, double: bool, bits: u64) {
        self.s[index] = bits as u32;
        if double {
            self.s[index | 1] = (bits >> 32) as u32;
        }
    }

    fn with_float(
        &mut self,
        format: Format,
        rounding: Option<Round>,
        does: impl FnOnce(&mut Float) -> u64,
    ) -> u64 {
        let mut float = Float::new(format, self.fpscr);
        float.rounding = rounding.unwrap_or(float.rounding);
        let result = does(&mut float);
        self.fpscr = float.fpscr;
        result
    }

    /// This computer's own arithmetic, where it differs in nothing but flags that are set already.
    #[inline]
    fn arithmetic(&mut self, double: bool, (single, long, own): Operation, a: u64, b: u64) -> u64 {
        let format = format(double);
        if self.fpscr & (ROUNDING | FZ | IXC) == IXC {
            let result = if double {
                long(f64::from_bits(a), f64::from_bits(b)).to_bits()
            } else {
                single(f32::from_bits(a as u32), f32::from_bits(b as u32)).to_bits().into()
            };
            if format.is_plain(result) {
                return result;
            }
        }
        self.with_float(format, None, |float| own(float, a, b))
    }
}

fn set_d(core: &mut Core, i: u32, bits: u64) -> Done {
    core.set_number(d(i, is_double(i)), is_double(i), bits);
    Ok(())
}

/// The second and the third operand.
const fn operands(core: &Core, i: u32) -> (u64, u64) {
    let double = is_double(i);
    (core.number(n(i, double), double), core.number(m(i, double), double))
}

/// Whether bit 6 names the other instruction of two.
const fn is_other(i: u32) -> bool {
    i & 1 << 6 != 0
}

/// A number with the other sign, if so.
const fn signed(i: u32, bits: u64, negates: bool) -> u64 {
    if negates { format(is_double(i)).negate(bits) } else { bits }
}

/// VADD and VSUB, VMUL and VNMUL, VDIV; VMLA, VMLS, VNMLA, VNMLS, which round twice.
pub(super) fn float_basic(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (double, (a, b)) = (is_double(i), operands(core, i));
    let result = match i >> 20 & 0b1011 {
        0b0011 if is_other(i) => core.arithmetic(double, SUBTRACT, a, b),
        0b0011 => core.arithmetic(double, ADD, a, b),
        0b1000 => {
            core.clocks += 13;
            core.arithmetic(double, DIVIDE, a, b)
        }
        kind => {
            let product = core.arithmetic(double, MULTIPLY, a, b);
            let product = signed(i, product, is_other(i));
            if kind == 0b0010 {
                return set_d(core, i, product);
            }
            core.clocks += 2;
            let addend = signed(i, core.number(d(i, double), double), kind == 1);
            core.arithmetic(double, ADD, addend, product)
        }
    };
    set_d(core, i, result)
}

/// VFMA, VFMS, VFNMA, VFNMS: rounded once.
pub(super) fn float_fused(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (double, (a, b)) = (is_double(i), operands(core, i));
    let addend = signed(i, core.number(d(i, double), double), i & 1 << 20 != 0);
    let a = signed(i, a, is_other(i));
    core.clocks += 2;
    let sum = core.with_float(format(double), None, |float| float.multiply_add(addend, a, b));
    set_d(core, i, sum)
}

/// Operations with one operand, or two of different formats: VMOV, VABS, VNEG, VSQRT; VRINTR,
/// VRINTZ, VRINTX; VCVT between single and double, and to and from integers.
pub(super) fn float_unary(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (double, is_second) = (is_double(i), i & 1 << 7 != 0);
    let format = format(double);
    let (_, value) = operands(core, i);
    let to_zero = is_second.then_some(Round::TowardZero);
    let result = match (i >> 16 & 15, is_second) {
        (0, false) => value,
        (0, true) => format.absolute(value),
        (1, false) => format.negate(value),
        (1, true) => {
            core.clocks += 13;
            core.arithmetic(double, SQUARE_ROOT, value, 0)
        }
        (6, _) => core.with_float(format, to_zero, |float| float.whole(value, false)),
        (7, false) => core.with_float(format, None, |float| float.whole(value, true)),
        (7, true) => {
            let other = self::format(!double);
            let result = core.with_float(format, None, |float| float.convert(value, other));
            core.set_number(d(i, !double), !double, result);
            return Ok(());
        }
        (8, _) => {
            let value = core.s[m(i, false)];
            let value = if is_second { (value as i32).into() } else { value.into() };
            core.with_float(format, None, |float| float.of_integer(value, 0))
        }
        (kind @ (12 | 13), _) => return to_integer(core, i, kind == 13, to_zero),
        _ => return Err(Fault::Undefined),
    };
    set_d(core, i, result)
}

/// VRINT and VCVT with a letter that says how to round.
pub(super) fn float_round(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let rounding = Some(match i >> 16 & 3 {
        0 => Round::NearestTiesToAway,
        1 => Round::NearestTiesToEven,
        2 => Round::TowardPositive,
        _ => Round::TowardNegative,
    });
    if i & 1 << 18 != 0 {
        return to_integer(core, i, i & 1 << 7 != 0, rounding);
    }
    let (_, value) = operands(core, i);
    let whole = core.with_float(format(is_double(i)), rounding, |float| float.whole(value, false));
    set_d(core, i, whole)
}

fn to_integer(core: &mut Core, i: u32, signed: bool, rounding: Option<Round>) -> Done {
    let (_, value) = operands(core, i);
    let to_integer = |float: &mut Float| float.integer(value, 32, signed, 0);
    core.s[d(i, false)] = core.with_float(format(is_double(i)), rounding, to_integer) as u32;
    Ok(())
}

/// VMOV of a constant: sign, three bits of exponent, four of fraction.
pub(super) fn float_constant(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let byte = u64::from(i >> 12 & 0xF0 | i & 0xF);
    let (sign, small, rest) = (byte >> 7, byte >> 6 & 1, byte & 0x3F);
    let bits = if is_double(i) {
        sign << 63 | (small ^ 1) << 62 | (small * 0xFF) << 54 | rest << 48
    } else {
        sign << 31 | (small ^ 1) << 30 | (small * 0x1F) << 25 | rest << 19
    };
    set_d(core, i, bits)
}

/// VCMP, VCMPE.
pub(super) fn float_compare(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let double = is_double(i);
    let a = core.number(d(i, double), double);
    let b = if i & 1 << 16 == 0 { core.number(m(i, double), double) } else { 0 };
    let mut conditions = 0;
    core.with_float(format(double), None, |float| {
        conditions = float.compare(a, b, i & 1 << 7 != 0);
        0
    });
    core.fpscr = core.fpscr & !(N | Z | C | V) | conditions;
    Ok(())
}

/// VCVTB, VCVTT: between half precision, in one half of a register, and another.
pub(super) fn float_half(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (double, shift) = (is_double(i), i >> 3 & 16);
    if i & 1 << 16 == 0 {
        let half = u64::from(core.s[m(i, false)] >> shift & 0xFFFF);
        let result = core.with_float(HALF, None, |float| float.convert(half, format(double)));
        return set_d(core, i, result);
    }
    let value = core.number(m(i, double), double);
    let half = core.with_float(format(double), None, |float| float.convert(value, HALF));
    let to = &mut core.s[d(i, false)];
    *to = *to & !(0xFFFF << shift) | (half as u32) << shift;
    Ok(())
}

/// VCVT between fixed point and floating point, in one register.
pub(super) fn float_fixed(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (double, signed) = (is_double(i), i & 1 << 16 == 0);
    let bits = if i & 1 << 7 == 0 { 16 } else { 32 };
    let fraction = bits - ((i & 15) << 1 | i >> 5 & 1).min(bits);
    let value = core.number(d(i, double), double);
    let result = if i & 1 << 18 == 0 {
        let above = 64 - bits;
        let integer = (value << above) as i64;
        let integer = if signed { integer >> above } else { (integer as u64 >> above) as i64 };
        core.with_float(format(double), Some(Round::NearestTiesToEven), |float| {
            float.of_integer(integer, fraction)
        })
    } else {
        core.with_float(format(double), Some(Round::TowardZero), |float| {
            float.integer(value, bits, signed, fraction)
        })
    };
    set_d(core, i, result)
}

pub(super) fn float_select(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let double = is_double(i);
    // EQ, VS, GE, GT.
    let condition = [0, 6, 10, 12][(i >> 20 & 3) as usize];
    let from = if core.holds(condition) { n(i, double) } else { m(i, double) };
    set_d(core, i, core.number(from, double))
}

/// VMAXNM, VMINNM.
pub(super) fn float_extreme(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (double, (a, b)) = (is_double(i), operands(core, i));
    let result = core.with_float(format(double), None, |float| float.extreme(a, b, is_other(i)));
    set_d(core, i, result)
}

/// VMOV between a register of the core and one of the FPU, or half of a double one.
pub(super) fn float_move(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let half = if is_double(i) { i >> 21 & 1 } else { 0 };
    let index = n(i, is_double(i)) | half as usize;
    if i & 1 << 20 == 0 {
        core.s[index] = core.get(rt(i));
    } else {
        core.set(rt(i), core.s[index]);
    }
    Ok(())
}

/// VMOV between two registers of the core and a double one, or two single ones.
pub(super) fn float_move_two(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let first = m(i, is_double(i));
    for (register, index) in [(rt(i), first), (rn(i), (first + 1) & 31)] {
        if i & 1 << 20 == 0 {
            core.s[index] = core.get(register);
        } else {
            core.set(register, core.s[index]);
        }
    }
    core.clocks += 1;
    Ok(())
}

/// VMSR, VMRS.
pub(super) fn float_status(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    match (i >> 20 & 1, rn(i), rt(i)) {
        (0, 1, from) => core.fpscr = core.get(from) & FPSCR,
        (1, 1, 15) => core.psr = core.psr & !(N | Z | C | V) | core.fpscr & (N | Z | C | V),
        (1, 1, to) => core.set(to, core.fpscr),
        // What the FPU has: MVFR2, MVFR1, MVFR0.
        (1, register @ 5..=7, to) => {
            let features = core.read_system(0xE000_EF40 + 4 * (7 - register), false);
            core.set(to, features);
        }
        _ => return Err(Fault::Undefined),
    }
    Ok(())
}

/// VLDR, VSTR.
pub(super) fn float_transfer(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let base = if rn(i) == 15 { core.r[15] & !3 } else { core.get(rn(i)) };
    let at = offset(base, (i & 0xFF) << 2, i & UP != 0);
    transfer_words(core, i, at, if is_double(i) { 2 } else { 1 })
}

/// VLDM, VSTM, VPUSH, VPOP.
pub(super) fn float_transfer_multiple(core: &mut Core, i: u32) -> Done {
    core.claim_fpu()?;
    let (base, count) = (core.get(rn(i)), i & 0xFF);
    let end = offset(base, 4 * count, i & UP != 0);
    transfer_words(core, i, if i & UP == 0 { end } else { base }, count.min(32))?;
    if i & BACK != 0 {
        core.set(rn(i), end);
    }
    Ok(())
}

/// Loads or stores registers one after another. After a fault none of them has changed.
fn transfer_words(core: &mut Core, i: u32, at: u32, count: u32) -> Done {
    align(core, at, 4, true)?;
    let first = d(i, is_double(i));
    let mut registers = core.s;
    for (index, at) in (first..first + count as usize).zip(places(at)) {
        let register = &mut registers[index & 31];
        if i & 1 << 20 == 0 {
            core.store(at, 4, *register)?;
        } else {
            *register = core.load(at, 4)?;
        }
    }
    core.s = registers;
    Ok(())
}

/// An instruction that the FPU does not have.
pub(super) fn float_undefined(core: &mut Core, _: u32) -> Done {
    core.claim_fpu()?;
    Err(Fault::Undefined)
}
