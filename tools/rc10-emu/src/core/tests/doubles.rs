//! Double precision, beside this computer's own.

use super::super::ieee::{DOUBLE, Float, HALF, Round, SINGLE};
use super::random::Random;
use super::{Core, wide, with_code};

/// Operands: special ones, near ones, small whole ones, any.
fn double(random: &mut Random) -> u64 {
    const SPECIAL: [u64; 12] = [
        0,
        1 << 63,
        0x3FF0_0000_0000_0000,
        0x7FF0_0000_0000_0000,
        0xFFF0_0000_0000_0000,
        0x7FF8_0000_0000_0000,
        1,
        0x000F_FFFF_FFFF_FFFF,
        0x0010_0000_0000_0000,
        0x7FEF_FFFF_FFFF_FFFF,
        0x4340_0000_0000_0000,
        0xC1E0_0000_0000_0000,
    ];
    let long = random.long();
    match random.below(5) {
        0 => random.one_of(&SPECIAL),
        1 => long & 0x800F_FFFF_FFFF_FFFF | 0x3FF0_0000_0000_0000,
        2 => f64::from(long as i16).to_bits(),
        3 => long & 0x803F_FFFF_FFFF_FFFF,
        _ => long,
    }
}

/// Whether both are the same number, or no number at all.
fn is_same(bits: u64, own: f64) -> bool {
    bits == own.to_bits() || f64::from_bits(bits).is_nan() && own.is_nan()
}

#[test]
fn doubles_are_what_this_computer_makes_of_them() {
    let mut random = Random::new(8);
    for _ in 0..200_000 {
        let [a, b, c] = std::array::from_fn(|_| double(&mut random));
        let [x, y, z] = [a, b, c].map(f64::from_bits);
        let mut float = Float::new(DOUBLE, 0);
        let results = [
            (float.add(a, b, false), x + y, "+"),
            (float.add(a, b, true), x - y, "-"),
            (float.multiply(a, b), x * y, "*"),
            (float.divide(a, b), x / y, "/"),
            (float.square_root(a), x.sqrt(), "sqrt"),
            (float.multiply_add(c, a, b), x.mul_add(y, z), "fma"),
            (float.whole(a, false), x.round_ties_even(), "rint"),
            (float.of_integer(a.cast_signed(), 0), a.cast_signed() as f64, "of"),
        ];
        for (bits, own, name) in results {
            assert!(is_same(bits, own), "{x:e} {name} {y:e} {z:e}: {bits:x}, here {own:e}");
        }
        float.rounding = Round::TowardZero;
        assert_eq!(float.integer(a, 32, true, 0) as i32, x as i32, "{x:e}");
        assert_eq!(float.integer(a, 32, false, 0) as u32, x as u32, "{x:e}");
        let mut float = Float::new(DOUBLE, 0);
        let single = float.convert(a, SINGLE);
        assert!(x.is_nan() || single == u64::from((x as f32).to_bits()), "{x:e}: {single:x}");
        let mut float = Float::new(SINGLE, 0);
        let small = u64::from(a as u32);
        let wide = f64::from(f32::from_bits(a as u32));
        assert!(is_same(float.convert(small, DOUBLE), wide), "{wide:e}");
    }
}

/// Rounding twice where the manual rounds once would show here, and a half that lies between.
#[test]
fn halves_round_once() {
    for (single, half) in [(1.0_f32, 0x3C00), (65504.0, 0x7BFF), (65520.0, 0x7C00), (6.0e-8, 1)] {
        let mut float = Float::new(SINGLE, 0);
        assert_eq!(float.convert(single.to_bits().into(), HALF), half, "{single}");
    }
    for half in 0..0x7C00 {
        let mut float = Float::new(HALF, 0);
        let single = float.convert(half, SINGLE);
        let mut float = Float::new(SINGLE, 0);
        assert_eq!(float.convert(single, HALF), half);
    }
}

/// Fixed point, which the other core does step by step: against doubles, which are exact here.
#[test]
fn fixed_point_is_a_scaled_integer() {
    let mut random = Random::new(9);
    for _ in 0..50_000 {
        let (bits, fraction) = (random.one_of(&[16, 32]), random.below(17));
        let scale = f64::from(1 << fraction);
        let value = random.single();
        let exact = f64::from(f32::from_bits(value)) * scale;
        let mut float = Float::new(SINGLE, 3 << 22);
        let fixed = float.integer(value.into(), bits, true, fraction);
        let expected = if bits == 16 { i64::from(exact as i16) } else { i64::from(exact as i32) };
        assert_eq!(fixed.cast_signed(), expected, "{exact:e}");
        let integer = random.number() as i32;
        let mut float = Float::new(SINGLE, 0);
        let expected = (f64::from(integer) / scale) as f32;
        assert_eq!(float.of_integer(integer.into(), fraction), u64::from(expected.to_bits()));
    }
    // VCVT.S16.F32 S0, S0, #8: the sign fills the register.
    let (mut core, _) = with_code(&wide(0xEEBE_0A44));
    *core.system.word_mut(0xD88 / 4) = 0xF << 20;
    core.s[0] = (-1.5_f32).to_bits();
    core.step();
    assert_eq!(core.s[0], (-384_i32).cast_unsigned());
}

/// The instructions themselves: which registers, which operation.
#[test]
fn double_instructions_use_pairs_of_registers() {
    let run = |bits: u32, check: &dyn Fn(&Core) -> f64, expected: f64| {
        let (mut core, _) = with_code(&wide(bits));
        *core.system.word_mut(0xD88 / 4) = 0xF << 20;
        for (register, value) in [(1, 6.0_f64), (2, 1.5), (3, 0.25)] {
            let bits = value.to_bits();
            core.s[2 * register] = bits as u32;
            core.s[2 * register + 1] = (bits >> 32) as u32;
        }
        core.step();
        assert_eq!((core.exception(), check(&core).to_bits()), (0, expected.to_bits()), "{bits:x}");
    };
    let first = |core: &Core| f64::from_bits(u64::from(core.s[1]) << 32 | u64::from(core.s[0]));
    // VADD, VSUB, VMUL, VDIV.F64 D0, D1, D2.
    run(0xEE31_0B02, &first, 7.5);
    run(0xEE31_0B42, &first, 4.5);
    run(0xEE21_0B02, &first, 9.0);
    run(0xEE81_0B02, &first, 4.0);
    // VSQRT.F64 D0, D3; VNEG; VABS; VMOV; VMOV.F64 D0, #1.0.
    run(0xEEB1_0BC3, &first, 0.5);
    run(0xEEB1_0B43, &first, -0.25);
    run(0xEEB0_0BC3, &first, 0.25);
    run(0xEEB0_0B43, &first, 0.25);
    run(0xEEB7_0B00, &first, 1.0);
    // VCVT.F32.F64 S0, D2; VCVT.S32.F64 S0, D1; VCVT.F64.S32 D0, S5 (the upper half of 1.5).
    run(0xEEB7_0BC2, &|core| f32::from_bits(core.s[0]).into(), 1.5);
    run(0xEEBD_0BC1, &|core| core.s[0].into(), 6.0);
    run(0xEEB8_0BE2, &first, f64::from(0x3FF8_0000));
    // VMINNM and VMAXNM.F64 D0, D1, D2; VRINTA.F64 D0, D2; VFMA.F64 D3, D1, D2.
    run(0xFE81_0B02, &first, 6.0);
    run(0xFE81_0B42, &first, 1.5);
    run(0xFEB8_0B42, &first, 2.0);
    run(
        0xEEA1_3B02,
        &|core| f64::from_bits(u64::from(core.s[7]) << 32 | u64::from(core.s[6])),
        9.25,
    );
}
