//! Floating-point arithmetic in integers: exact, every way to round, every flag of FPSCR (A2.5).

/// Bits of FPSCR: default NaN, flush to zero, rounding, ..
const DN: u32 = 1 << 25;
pub(super) const FZ: u32 = 1 << 24;
pub(super) const ROUNDING: u32 = 3 << 22;
/// .. and what has happened: invalid operation, division by zero, overflow, underflow, inexact
/// result, flushed operand.
const IOC: u32 = 1 << 0;
const DZC: u32 = 1 << 1;
const OFC: u32 = 1 << 2;
const UFC: u32 = 1 << 3;
pub(super) const IXC: u32 = 1 << 4;
const IDC: u32 = 1 << 7;

/// Ways to round, as FPSCR has them: to the nearest, up, down, to zero; ..
pub(super) const NEAREST: u32 = 0;
pub(super) const UP: u32 = 1;
pub(super) const DOWN: u32 = 2;
pub(super) const TO_ZERO: u32 = 3;
/// .. and to the nearest, away from zero between two.
pub(super) const AWAY: u32 = 4;

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

    pub(super) const fn infinity(self) -> u64 {
        self.sign() - (1 << self.fraction)
    }

    const fn quiet(self) -> u64 {
        1 << (self.fraction - 1)
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
        exponent > 1 && self.absolute(bits) < self.infinity()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Finite,
    Infinite,
    Quiet,
    Signalling,
}

/// A number, taken apart: if it is finite, it is mantissa x 2^exponent.
#[derive(Clone, Copy, Debug)]
struct Number {
    bits: u64,
    negative: bool,
    kind: Kind,
    mantissa: u128,
    exponent: i32,
}

impl Number {
    const fn is_infinite(&self) -> bool {
        matches!(self.kind, Kind::Infinite)
    }

    const fn is_zero(&self) -> bool {
        matches!(self.kind, Kind::Finite) && self.mantissa == 0
    }

    /// The same number with its leading bit at 124: room for a sum, and for what is shifted out.
    const fn normal(mut self) -> Self {
        if self.mantissa != 0 {
            let shift = self.mantissa.leading_zeros() - 3;
            self.mantissa <<= shift;
            self.exponent -= shift as i32;
        }
        self
    }
}

/// Shifts right; what is left of all that falls out is that it was not zero.
const fn shift_right(mantissa: u128, by: u32) -> u128 {
    match by {
        0 => mantissa,
        1..128 => mantissa >> by | (mantissa << (128 - by) != 0) as u128,
        _ => (mantissa != 0) as u128,
    }
}

/// Arithmetic in one format, under the rules of a FPSCR, that keeps flags there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Float {
    pub(super) format: Format,
    pub(super) fpscr: u32,
    pub(super) rounding: u32,
}

impl Float {
    pub(super) const fn new(format: Format, fpscr: u32) -> Self {
        Self { format, fpscr, rounding: (fpscr & ROUNDING) >> 22 }
    }

    const fn flag(&mut self, flag: u32, result: u64) -> u64 {
        self.fpscr |= flag;
        result
    }

    const fn default_nan(&self) -> u64 {
        self.format.infinity() | self.format.quiet()
    }

    const fn invalid(&mut self) -> u64 {
        self.flag(IOC, self.default_nan())
    }

    const fn signed(&self, negative: bool, bits: u64) -> u64 {
        if negative { bits | self.format.sign() } else { bits }
    }

    const fn flushes(&self) -> bool {
        self.fpscr & FZ != 0 && self.format.bits != HALF.bits
    }

    fn take(&mut self, bits: u64) -> Number {
        let format = self.format;
        let (magnitude, fraction) = (format.absolute(bits), bits & ((1 << format.fraction) - 1));
        let exponent = (magnitude >> format.fraction) as i32;
        let kind = match magnitude {
            _ if magnitude < format.infinity() => Kind::Finite,
            _ if magnitude == format.infinity() => Kind::Infinite,
            _ if magnitude & format.quiet() != 0 => Kind::Quiet,
            _ => Kind::Signalling,
        };
        let hidden = u64::from(exponent != 0) << format.fraction;
        let mut mantissa = u128::from(fraction | hidden);
        if exponent == 0 && fraction != 0 && self.flushes() {
            self.fpscr |= IDC;
            mantissa = 0;
        }
        let exponent = exponent.max(1) - 1 + format.least() - format.fraction as i32;
        Number { bits, negative: magnitude != bits, kind, mantissa, exponent }
    }

    /// The NaN that comes of these operands, if one of them is one: the first signalling one is
    /// first.
    fn nan(&mut self, operands: &[Number]) -> Option<u64> {
        let find = |kind| operands.iter().find(|operand| operand.kind == kind);
        let signalling = find(Kind::Signalling);
        if signalling.is_some() {
            self.fpscr |= IOC;
        }
        let nan = signalling.or_else(|| find(Kind::Quiet))?;
        let is_default = self.fpscr & DN != 0;
        Some(if is_default { self.default_nan() } else { nan.bits | self.format.quiet() })
    }

    /// Shifts right by so many bits, and rounds; also says whether that changed the value.
    const fn rounded(&self, negative: bool, mantissa: u128, by: u32) -> (u128, bool) {
        let (kept, rest) = match by {
            0 => (mantissa, 0),
            1..128 => (mantissa >> by, mantissa << (128 - by)),
            _ => (0, (mantissa != 0) as u128),
        };
        let half = 1 << 127;
        let up = match self.rounding {
            NEAREST => rest > half || rest == half && kept & 1 == 1,
            UP => rest != 0 && !negative,
            DOWN => rest != 0 && negative,
            AWAY => rest >= half,
            _ => false,
        };
        (kept + up as u128, rest != 0)
    }

    /// The nearest number in the format, by the way to round.
    fn round(&mut self, negative: bool, mantissa: u128, exponent: i32) -> u64 {
        if mantissa == 0 {
            return self.signed(negative, 0);
        }
        let (format, least) = (self.format, self.format.least());
        let top = exponent + 127 - mantissa.leading_zeros() as i32;
        let is_tiny = top < least;
        if is_tiny && self.flushes() {
            return self.flag(UFC, self.signed(negative, 0));
        }
        let of_unit = top.max(least) - format.fraction as i32;
        let (kept, is_inexact) = if of_unit <= exponent {
            (mantissa << (exponent - of_unit), false)
        } else {
            self.rounded(negative, mantissa, (of_unit - exponent) as u32)
        };
        // The hidden bit counts one up in the exponent.
        let scale = (top.max(least) - least).min(1 << 11) as u128;
        let bits = (scale << format.fraction) + kept;
        if bits >= u128::from(format.infinity()) {
            let to_infinity = match self.rounding {
                UP => !negative,
                DOWN => negative,
                rounding => rounding != TO_ZERO,
            };
            let bits = format.infinity() - u64::from(!to_infinity);
            return self.flag(OFC | IXC, self.signed(negative, bits));
        }
        self.fpscr |= if is_inexact { IXC } else { 0 };
        self.fpscr |= if is_inexact && is_tiny { UFC } else { 0 };
        self.signed(negative, bits as u64)
    }

    /// The sum of two finite numbers.
    fn sum(&mut self, a: Number, b: Number) -> u64 {
        let zeros = a.mantissa == 0 && b.mantissa == 0;
        let (a, b) = (a.normal(), b.normal());
        let a_first = b.mantissa == 0 || a.mantissa != 0 && a.exponent >= b.exponent;
        let (large, small) = if a_first { (a, b) } else { (b, a) };
        let apart = large.exponent.wrapping_sub(small.exponent).unsigned_abs();
        let other = if small.mantissa == 0 { 0 } else { shift_right(small.mantissa, apart) };
        if large.negative == small.negative {
            return self.round(large.negative, large.mantissa + other, large.exponent);
        }
        if zeros || large.mantissa == other {
            return self.signed(self.rounding == DOWN, 0);
        }
        let negative = large.negative == (large.mantissa > other);
        self.round(negative, large.mantissa.abs_diff(other), large.exponent)
    }

    pub(super) fn add(&mut self, a: u64, b: u64, subtracts: bool) -> u64 {
        let (a, mut b) = (self.take(a), self.take(b));
        if let Some(nan) = self.nan(&[a, b]) {
            return nan;
        }
        b.negative ^= subtracts;
        match (a.is_infinite(), b.is_infinite()) {
            (true, true) if a.negative != b.negative => self.invalid(),
            (true, _) => self.signed(a.negative, self.format.infinity()),
            (_, true) => self.signed(b.negative, self.format.infinity()),
            _ => self.sum(a, b),
        }
    }

    /// The exact product of two numbers; `None`: of infinity and zero.
    fn product(a: Number, b: Number) -> Option<Number> {
        let infinite = a.is_infinite() || b.is_infinite();
        (!infinite || !a.is_zero() && !b.is_zero()).then(|| Number {
            bits: 0,
            negative: a.negative != b.negative,
            kind: if infinite { Kind::Infinite } else { Kind::Finite },
            mantissa: a.mantissa * b.mantissa,
            exponent: a.exponent + b.exponent,
        })
    }

    pub(super) fn multiply(&mut self, a: u64, b: u64) -> u64 {
        let (a, b) = (self.take(a), self.take(b));
        if let Some(nan) = self.nan(&[a, b]) {
            return nan;
        }
        match Self::product(a, b) {
            None => self.invalid(),
            Some(product) if product.is_infinite() => {
                self.signed(product.negative, self.format.infinity())
            }
            Some(product) => self.round(product.negative, product.mantissa, product.exponent),
        }
    }

    /// A sum of a number and a product, rounded once.
    pub(super) fn multiply_add(&mut self, addend: u64, a: u64, b: u64) -> u64 {
        let (addend, a, b) = (self.take(addend), self.take(a), self.take(b));
        let product = Self::product(a, b);
        let factors_are_numbers =
            [a, b].iter().all(|factor| matches!(factor.kind, Kind::Finite | Kind::Infinite));
        if addend.kind == Kind::Quiet && product.is_none() && factors_are_numbers {
            return self.invalid();
        }
        if let Some(nan) = self.nan(&[addend, a, b]) {
            return nan;
        }
        let Some(product) = product else { return self.invalid() };
        match (addend.is_infinite(), product.is_infinite()) {
            (true, true) if addend.negative != product.negative => self.invalid(),
            (true, _) => self.signed(addend.negative, self.format.infinity()),
            (_, true) => self.signed(product.negative, self.format.infinity()),
            _ => self.sum(addend, product),
        }
    }

    pub(super) fn divide(&mut self, a: u64, b: u64) -> u64 {
        let (a, b) = (self.take(a), self.take(b));
        if let Some(nan) = self.nan(&[a, b]) {
            return nan;
        }
        let negative = a.negative != b.negative;
        match (a, b) {
            _ if a.is_infinite() && b.is_infinite() || a.is_zero() && b.is_zero() => self.invalid(),
            _ if a.is_infinite() => self.signed(negative, self.format.infinity()),
            _ if b.is_zero() => self.flag(DZC, self.signed(negative, self.format.infinity())),
            _ if a.is_zero() || b.is_infinite() => self.signed(negative, 0),
            _ => {
                let (a, divisor) = (a.normal(), b.mantissa);
                let (quotient, rest) = (a.mantissa / divisor, a.mantissa % divisor);
                let mantissa = quotient << 1 | u128::from(rest != 0);
                self.round(negative, mantissa, a.exponent - b.exponent - 1)
            }
        }
    }

    pub(super) fn square_root(&mut self, a: u64) -> u64 {
        let a = self.take(a);
        if let Some(nan) = self.nan(&[a]) {
            return nan;
        }
        match a {
            _ if a.is_zero() => self.signed(a.negative, 0),
            _ if a.negative => self.invalid(),
            _ if a.is_infinite() => a.bits,
            _ => {
                let a = a.normal();
                let odd = a.exponent & 1;
                let mantissa = a.mantissa << odd;
                let root = mantissa.isqrt();
                let rest = u128::from(root * root != mantissa);
                self.round(false, root << 1 | rest, (a.exponent - odd) / 2 - 1)
            }
        }
    }

    /// The nearest whole number; `tells`: whether it is another one.
    pub(super) fn whole(&mut self, a: u64, tells: bool) -> u64 {
        let a = self.take(a);
        if let Some(nan) = self.nan(&[a]) {
            return nan;
        }
        if a.is_zero() {
            return self.signed(a.negative, 0);
        }
        if a.is_infinite() || a.exponent >= 0 {
            return a.bits;
        }
        let (whole, is_inexact) = self.rounded(a.negative, a.mantissa, a.exponent.unsigned_abs());
        self.fpscr |= if is_inexact && tells { IXC } else { 0 };
        self.round(a.negative, whole, 0)
    }

    /// A whole number of so many bits, of which some stand for a fraction; as near as there is one.
    pub(super) fn integer(&mut self, a: u64, bits: u32, signed: bool, fraction: u32) -> u64 {
        let a = self.take(a);
        let exponent = a.exponent + fraction as i32;
        let (low, high) = match signed {
            true => (1_u128 << (bits - 1), (1_u128 << (bits - 1)) - 1),
            false => (0, (1_u128 << bits) - 1),
        };
        let bound = if a.negative { low } else { high };
        let (magnitude, is_inexact) = match a.kind {
            Kind::Quiet | Kind::Signalling => return self.flag(IOC, 0),
            Kind::Infinite => (u128::MAX, false),
            Kind::Finite if exponent < 0 => {
                self.rounded(a.negative, a.mantissa, exponent.unsigned_abs())
            }
            Kind::Finite if a.mantissa != 0 && exponent > 64 => (u128::MAX, false),
            Kind::Finite => (a.mantissa << exponent.min(64), false),
        };
        self.fpscr |= match magnitude > bound {
            true => IOC,
            false if is_inexact => IXC,
            false => 0,
        };
        let magnitude = magnitude.min(bound) as u64;
        if a.negative { magnitude.wrapping_neg() } else { magnitude }
    }

    pub(super) fn of_integer(&mut self, value: i64, fraction: u32) -> u64 {
        self.round(value < 0, value.unsigned_abs().into(), -(fraction as i32))
    }

    /// The same number in another format.
    pub(super) fn convert(&mut self, a: u64, to: Format) -> u64 {
        let from = self.format;
        let a = self.take(a);
        let nan = self.nan(&[a]);
        self.format = to;
        if let Some(nan) = nan {
            if self.fpscr & DN != 0 {
                return self.default_nan();
            }
            let payload = nan & ((1 << from.fraction) - 1);
            let payload = payload << (64 - from.fraction) >> (64 - to.fraction);
            return self.signed(a.negative, to.infinity() | payload);
        }
        if a.is_infinite() {
            return self.signed(a.negative, to.infinity());
        }
        self.round(a.negative, a.mantissa, a.exponent)
    }

    /// The conditions of a comparison, at their places in FPSCR; `signals`: any NaN is invalid.
    pub(super) fn compare(&mut self, a: u64, b: u64, signals: bool) -> u32 {
        let (a, b) = (self.take(a), self.take(b));
        let is_nan = |number: Number| matches!(number.kind, Kind::Quiet | Kind::Signalling);
        if is_nan(a) || is_nan(b) {
            let is_invalid = signals || a.kind == Kind::Signalling || b.kind == Kind::Signalling;
            self.fpscr |= if is_invalid { IOC } else { 0 };
            return 3 << 28;
        }
        match self.order(a).cmp(&self.order(b)) {
            std::cmp::Ordering::Less => 8 << 28,
            std::cmp::Ordering::Equal => 6 << 28,
            std::cmp::Ordering::Greater => 2 << 28,
        }
    }

    /// A whole number that is in the same order to others as this number.
    const fn order(&self, number: Number) -> i128 {
        let magnitude =
            if number.is_zero() { 0 } else { self.format.absolute(number.bits) as i128 };
        if number.negative { -magnitude } else { magnitude }
    }

    /// The larger one, or the smaller one; a quiet NaN is neither.
    pub(super) fn extreme(&mut self, a: u64, b: u64, smallest: bool) -> u64 {
        let numbers = [self.take(a), self.take(b)];
        match numbers.map(|number| number.kind) {
            [Kind::Quiet, Kind::Finite | Kind::Infinite] => return self.flushed(numbers[1]),
            [Kind::Finite | Kind::Infinite, Kind::Quiet] => return self.flushed(numbers[0]),
            _ => {}
        }
        if let Some(nan) = self.nan(&numbers) {
            return nan;
        }
        // Of two zeros the sign decides.
        let rank = |number: Number| (self.order(number), !number.negative);
        let first_is_less = rank(numbers[0]) < rank(numbers[1]);
        self.flushed(numbers[usize::from(first_is_less != smallest)])
    }

    const fn flushed(&self, number: Number) -> u64 {
        if number.is_zero() { self.signed(number.negative, 0) } else { number.bits }
    }
}
