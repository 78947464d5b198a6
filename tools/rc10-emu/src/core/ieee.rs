//! Floating-point arithmetic with every way to round and every flag of FPSCR (A2.5): LLVM's in Rust,
//! and what Arm adds to it.
//!
//! Operations work on quadruple numbers, which hold every product exactly, and every result's
//! exponent. What they cannot hold is rounded to odd there: rounded again, it is as if rounded once.

use std::cmp::Ordering;

pub(super) use rustc_apfloat::Round;
use rustc_apfloat::ieee::{Double, Half, Quad, Single};
use rustc_apfloat::{Float as _, FloatConvert, Status, StatusAnd};

/// Bits of FPSCR: default NaN, flush to zero, rounding, ..
const DN: u32 = 1 << 25;
pub(super) const FZ: u32 = 1 << 24;
pub(super) const ROUNDING: u32 = 3 << 22;
/// .. and the flags, the first five as [`Status`] has them: invalid operation, division by zero,
/// overflow, underflow, inexact result; flushed operand.
const IOC: u32 = 1 << 0;
const DZC: u32 = 1 << 1;
const OFC: u32 = 1 << 2;
const UFC: u32 = 1 << 3;
pub(super) const IXC: u32 = 1 << 4;
const IDC: u32 = 1 << 7;

/// Ways to round, as FPSCR numbers them.
const ROUNDS: [Round; 4] =
    [Round::NearestTiesToEven, Round::TowardPositive, Round::TowardNegative, Round::TowardZero];

/// A format of numbers: all bits, and those of the fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Format {
    bits: u32,
    fraction: u32,
}

pub(super) const HALF: Format = Format { bits: 16, fraction: 10 };
pub(super) const SINGLE: Format = Format { bits: 32, fraction: 23 };
pub(super) const DOUBLE: Format = Format { bits: 64, fraction: 52 };

impl Format {
    const fn sign(self) -> u64 {
        1 << (self.bits - 1)
    }

    /// Exponent of the smallest normal number.
    const fn least(self) -> i32 {
        2 - (1 << (self.bits - self.fraction - 2))
    }

    pub(super) const fn negate(self, bits: u64) -> u64 {
        bits ^ self.sign()
    }

    pub(super) const fn absolute(self, bits: u64) -> u64 {
        bits & !self.sign()
    }

    /// Whether these are the bits of a number that no flag tells of, but that it is inexact.
    pub(super) const fn is_plain(self, bits: u64) -> bool {
        let exponent = self.absolute(bits) >> self.fraction;
        // The smallest normal number may have been rounded up to.
        exponent > 1 && exponent < (self.sign() >> self.fraction) - 1
    }
}

#[derive(Clone, Copy)]
struct Number {
    wide: Quad,
    is_denormal: bool,
    /// Whether this is a signalling NaN.
    signals: bool,
}

fn widened<F: FloatConvert<Quad>>(bits: u64) -> Number {
    let number = F::from_bits(bits.into());
    let (is_denormal, signals) = (number.is_denormal(), number.is_signaling());
    Number { wide: number.convert(&mut false).value, is_denormal, signals }
}

fn narrowed<F: rustc_apfloat::Float>(wide: Quad, round: Round) -> (u64, Status)
where
    Quad: FloatConvert<F>,
{
    let StatusAnd { status, value } = wide.convert_r(round, &mut false);
    (value.to_bits() as u64, status)
}

/// The conditions of a comparison, at their places in FPSCR.
const fn conditions(order: Option<Ordering>) -> u32 {
    match order {
        Some(Ordering::Less) => 8 << 28,
        Some(Ordering::Equal) => 6 << 28,
        Some(Ordering::Greater) => 2 << 28,
        None => 3 << 28,
    }
}

/// Arithmetic in one format, under the rules of a FPSCR, that keeps flags there.
pub(super) struct Float {
    pub(super) format: Format,
    pub(super) fpscr: u32,
    pub(super) rounding: Round,
}

impl Float {
    pub(super) const fn new(format: Format, fpscr: u32) -> Self {
        Self { format, fpscr, rounding: ROUNDS[((fpscr & ROUNDING) >> 22) as usize] }
    }

    fn flushes(&self) -> bool {
        self.fpscr & FZ != 0 && self.format != HALF
    }

    fn flag(&mut self, flag: u32, is_set: bool) {
        self.fpscr |= if is_set { flag } else { 0 };
    }

    /// This computer's own number of the same value, if that raises no flag: the fast way.
    fn own(&self, bits: u64) -> Option<f64> {
        let number = match self.format {
            SINGLE => f32::from_bits(bits as u32).into(),
            DOUBLE => f64::from_bits(bits),
            _ => return None,
        };
        (self.fpscr & FZ == 0 && !number.is_nan()).then_some(number)
    }

    fn take(&mut self, bits: u64) -> Number {
        let mut number = match self.format {
            HALF => widened::<Half>(bits),
            SINGLE => widened::<Single>(bits),
            _ => widened::<Double>(bits),
        };
        if number.is_denormal && self.flushes() {
            self.fpscr |= IDC;
            number.wide = Quad::ZERO.copy_sign(number.wide);
        }
        number
    }

    /// The nearest number in the format, by the way to round.
    fn round(&mut self, wide: Quad) -> u64 {
        let (is_number, least) = (wide.is_finite_non_zero(), self.format.least());
        let is_tiny = is_number && wide.ilogb() < least;
        if is_tiny && self.flushes() {
            self.fpscr |= UFC;
            return if wide.is_negative() { self.format.sign() } else { 0 };
        }
        let (bits, status) = match self.format {
            HALF => narrowed::<Half>(wide, self.rounding),
            SINGLE => narrowed::<Single>(wide, self.rounding),
            _ => narrowed::<Double>(wide, self.rounding),
        };
        // Arm looks for tiny numbers before it rounds, and for large ones that come down, too.
        self.fpscr |= u32::from((status - Status::UNDERFLOW).bits());
        self.flag(UFC, is_tiny && status.contains(Status::INEXACT));
        self.flag(OFC, is_number && wide.ilogb() > 1 - least);
        bits
    }

    /// The NaN that comes of these operands, if there is one: the first signalling one, or the
    /// first.
    fn nan(&mut self, operands: &[Number]) -> Option<u64> {
        let signalling = operands.iter().find(|operand| operand.signals);
        self.flag(IOC, signalling.is_some());
        let nan = signalling.or_else(|| operands.iter().find(|operand| operand.wide.is_nan()))?;
        Some(self.round(if self.fpscr & DN == 0 { nan.wide } else { Quad::NAN }))
    }

    /// The result of an operation with these operands, rounded once.
    fn compute<const N: usize>(
        &mut self,
        operands: [Number; N],
        operation: impl Fn([Quad; N], Round) -> StatusAnd<Quad>,
    ) -> u64 {
        if let Some(nan) = self.nan(&operands) {
            return nan;
        }
        let operands = operands.map(|operand| operand.wide);
        let StatusAnd { status, mut value } = operation(operands, self.rounding);
        if status.contains(Status::INEXACT) {
            value = Quad::from_bits(operation(operands, Round::TowardZero).value.to_bits() | 1);
        }
        self.fpscr |= u32::from(status.bits()) & (IOC | DZC);
        self.round(value)
    }

    pub(super) fn add(&mut self, a: u64, b: u64, subtracts: bool) -> u64 {
        let operands = [a, b].map(|bits| self.take(bits));
        self.compute(operands, |[a, b], round| a.add_r(if subtracts { -b } else { b }, round))
    }

    pub(super) fn multiply(&mut self, a: u64, b: u64) -> u64 {
        let operands = [a, b].map(|bits| self.take(bits));
        self.compute(operands, |[a, b], round| a.mul_r(b, round))
    }

    pub(super) fn multiply_add(&mut self, addend: u64, a: u64, b: u64) -> u64 {
        let mut numbers = [addend, a, b].map(|bits| self.take(bits));
        let [addend, a, b] = &mut numbers;
        let factors = [a.wide, b.wide];
        let is_invalid = factors.iter().any(|factor| factor.is_zero())
            && factors.iter().any(|factor| factor.is_infinite());
        if is_invalid && !addend.signals {
            // A quiet NaN does not hide it.
            addend.wide = Quad::ZERO;
        }
        self.compute(numbers, |[addend, a, b], round| a.mul_add_r(b, addend, round))
    }

    pub(super) fn divide(&mut self, a: u64, b: u64) -> u64 {
        let operands = [a, b].map(|bits| self.take(bits));
        self.compute(operands, |[a, b], round| a.div_r(b, round))
    }

    pub(super) fn square_root(&mut self, a: u64) -> u64 {
        let operands = [a].map(|bits| self.take(bits));
        self.compute(operands, |[a], _| {
            if a.is_zero() || a.is_pos_infinity() {
                return Status::OK.and(a);
            }
            if a.is_negative() {
                return Status::INVALID_OP.and(Quad::NAN);
            }
            let exponent = a.ilogb() & !1;
            let square = a.scalbn(124 - exponent).to_u128(128).value;
            let root = square.isqrt();
            let rest = u128::from(root * root != square);
            Status::OK.and(Quad::from_u128(root << 1 | rest).value.scalbn(exponent / 2 - 63))
        })
    }

    /// The nearest whole number; `tells`: whether it is another one.
    pub(super) fn whole(&mut self, a: u64, tells: bool) -> u64 {
        let a = self.take(a);
        if let Some(nan) = self.nan(&[a]) {
            return nan;
        }
        let StatusAnd { status, value } = a.wide.round_to_integral(self.rounding);
        self.flag(IXC, tells && status.contains(Status::INEXACT));
        self.round(value)
    }

    /// The nearest whole number of `bits` bits, of which the lowest `fraction` are a fraction.
    pub(super) fn integer(&mut self, a: u64, bits: u32, signed: bool, fraction: u32) -> u64 {
        let a = self.take(a).wide.scalbn(fraction as i32);
        let (bits, round) = (bits as usize, self.rounding);
        let StatusAnd { status, value } = if signed {
            a.to_i128_r(bits, round, &mut false)
        } else {
            a.to_u128_r(bits, round, &mut false).map(u128::cast_signed)
        };
        self.fpscr |= u32::from(status.bits());
        value as u64
    }

    pub(super) fn of_integer(&mut self, value: i64, fraction: u32) -> u64 {
        let is_exact = fraction == 0 && value.unsigned_abs() >> self.format.fraction == 0;
        match self.format {
            SINGLE if is_exact => (value as f32).to_bits().into(),
            DOUBLE if is_exact => (value as f64).to_bits(),
            _ => self.round(Quad::from_i128(value.into()).value.scalbn(-(fraction as i32))),
        }
    }

    pub(super) fn convert(&mut self, a: u64, to: Format) -> u64 {
        let a = self.take(a);
        self.format = to;
        self.nan(&[a]).unwrap_or_else(|| self.round(a.wide))
    }

    /// The conditions of a comparison; `signals`: any NaN is invalid.
    pub(super) fn compare(&mut self, a: u64, b: u64, signals: bool) -> u32 {
        if let (Some(a), Some(b)) = (self.own(a), self.own(b)) {
            return conditions(a.partial_cmp(&b));
        }
        let (a, b) = (self.take(a), self.take(b));
        let is_nan = a.wide.is_nan() || b.wide.is_nan();
        self.flag(IOC, is_nan && (signals || a.signals || b.signals));
        conditions(a.wide.partial_cmp(&b.wide))
    }

    /// The larger one, or the smaller one; a quiet NaN is neither.
    pub(super) fn extreme(&mut self, a: u64, b: u64, smallest: bool) -> u64 {
        let (a, b) = (self.take(a), self.take(b));
        let extreme = match (a.wide.is_nan(), b.wide.is_nan()) {
            (true, false) if !a.signals => b.wide,
            (false, true) if !b.signals => a.wide,
            _ if smallest => a.wide.minimum(b.wide),
            _ => a.wide.maximum(b.wide),
        };
        if extreme.is_nan()
            && let Some(nan) = self.nan(&[a, b])
        {
            return nan;
        }
        self.round(extreme)
    }
}
