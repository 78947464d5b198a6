//! Every encoding with random registers, beside the other core.

use super::super::{Core, EXCEPTION, IT};
use super::random::Random;
use super::witness::{Witness, registers};
use super::{CODE, DATA, STACK, memory, put, wide};
use crate::memory::Memory;

/// Both cores, before an instruction.
struct Pair {
    own: Core,
    witness: Witness,
    memory: Memory,
    compared: u64,
}

impl Pair {
    fn new() -> Self {
        let memory = memory();
        let (own, witness) = (super::super::bare(&memory), Witness::new(&memory));
        Self { own, witness, memory, compared: 0 }
    }

    /// Random registers; those of the stack hold addresses.
    fn shuffle(&mut self, random: &mut Random) {
        if self.own.psr & EXCEPTION != 0 || self.own.asleep || self.own.locked_up {
            self.own.reset();
            self.witness = Witness::new(&self.memory);
        }
        for register in 0..15 {
            self.own.r[register] = random.number();
        }
        self.own.r[13] = STACK - 4 * random.below(64);
        self.own.other_stack = DATA + 4 * random.below(64);
        self.own.r[15] = CODE;
        let flags = random.word() & 0xF80F_0000;
        self.own.psr = 1 << 24 | flags;
        (self.own.primask, self.own.faultmask, self.own.basepri) = (false, false, 0);
        self.own.event = false;
    }

    /// Executes an exclusive load on both, and goes back.
    fn reserve(&mut self, load: u32) {
        put(&self.memory, CODE, &wide(load & !0xF000));
        let first = self.own.r[0];
        self.compare("an exclusive load");
        if self.own.exception() == 0 {
            (self.own.r[0], self.own.r[15]) = (first, CODE);
        }
    }

    /// Executes an instruction on both.
    fn compare(&mut self, what: &str) {
        self.own.attention = true;
        self.witness.copy(&self.own);
        let before = registers(&self.own);
        let (step, clocks) = self.own.step();
        self.compared += 1;
        if let Err(difference) = self.witness.follow(&self.own, &before, step, clocks) {
            let mut code = [0; 4];
            self.memory.read(before.r[15], &mut code).unwrap();
            panic!("{what}: {code:02x?} with\n{before}, FPSCR {:x}:\n{difference}", self.own.fpscr);
        }
    }
}

/// Every instruction of 16 bits, in IT blocks and outside.
#[test]
fn short_instructions_do_what_they_do_elsewhere() {
    let (mut pair, mut random) = (Pair::new(), Random::new(1));
    for half in 0..0xE800_u32 {
        let is_it = half & 0xFF00 == 0xBF00 && half & 0xF != 0;
        // B with a condition, CBZ, CPS and IT have no place in an IT block.
        let outside_only =
            is_it || half >> 12 == 0xD || half & 0xF500 == 0xB100 || half & 0xFFE0 == 0xB660;
        for round in 0..6 {
            pair.shuffle(&mut random);
            for register in 0..8 {
                // Addresses, too.
                if random.below(2) == 0 {
                    pair.own.r[register] = DATA + random.below(1024);
                } else if random.below(3) == 0 {
                    pair.own.r[register] = random.below(256);
                }
            }
            if half >> 11 == 0b11001 {
                // Where a load of several words faults, rsemu has changed the base.
                pair.own.r[(half >> 8 & 7) as usize] = DATA;
            }
            put(&pair.memory, CODE, &[half as u16, 0xBF00, 0xBF00]);
            if round >= 3 && !outside_only {
                let state = random.below(0xE0) & 0xF0 | 1 << random.below(4);
                pair.own.set_it_state(state);
            }
            if is_empty_list(half) {
                continue;
            }
            pair.compare("short");
        }
    }
    println!("{} instructions of 16 bits compared", pair.compared);
}

/// No register in the list: not predictable.
const fn is_empty_list(half: u32) -> bool {
    half & 0xF0FF == 0xC000 || matches!(half, 0xB400 | 0xBC00)
}

/// Encodings of 32 bits without loads and stores; see [`Random::instruction`].
const COMPUTING: &[&str] = &[
    // Data processing with constants: results, and tests.
    "11110x00000x nnnn 0xxx dddd xxxxxxxx",
    "11110x00001x nnnn 0xxx dddd xxxxxxxx",
    "11110x00010x nnnn 0xxx dddd xxxxxxxx",
    "11110x00011x nnnn 0xxx dddd xxxxxxxx",
    "11110x00100x nnnn 0xxx dddd xxxxxxxx",
    "11110x01000x nnnn 0xxx dddd xxxxxxxx",
    "11110x01010x nnnn 0xxx dddd xxxxxxxx",
    "11110x01011x nnnn 0xxx dddd xxxxxxxx",
    "11110x01101x nnnn 0xxx dddd xxxxxxxx",
    "11110x01110x nnnn 0xxx dddd xxxxxxxx",
    "11110x00010x 1111 0xxx dddd xxxxxxxx",
    "11110x00011x 1111 0xxx dddd xxxxxxxx",
    "11110x000001 nnnn 0xxx 1111 xxxxxxxx",
    "11110x001001 nnnn 0xxx 1111 xxxxxxxx",
    "11110x010001 nnnn 0xxx 1111 xxxxxxxx",
    "11110x011011 nnnn 0xxx 1111 xxxxxxxx",
    // With shifted registers.
    "11101010000x nnnn 0xxx dddd xxxx mmmm",
    "11101010001x nnnn 0xxx dddd xxxx mmmm",
    "11101010010x nnnn 0xxx dddd xxxx mmmm",
    "11101010011x nnnn 0xxx dddd xxxx mmmm",
    "11101010100x nnnn 0xxx dddd xxxx mmmm",
    "11101011000x nnnn 0xxx dddd xxxx mmmm",
    "11101011010x nnnn 0xxx dddd xxxx mmmm",
    "11101011011x nnnn 0xxx dddd xxxx mmmm",
    "11101011101x nnnn 0xxx dddd xxxx mmmm",
    "11101011110x nnnn 0xxx dddd xxxx mmmm",
    "11101010010x 1111 0xxx dddd xxxx mmmm",
    "11101010011x 1111 0xxx dddd xxxx mmmm",
    "111010101100 nnnn 0xxx dddd xx00 mmmm",
    "111010101100 nnnn 0xxx dddd xx10 mmmm",
    "111010100001 nnnn 0xxx 1111 xxxx mmmm",
    "111010101001 nnnn 0xxx 1111 xxxx mmmm",
    "111010110001 nnnn 0xxx 1111 xxxx mmmm",
    "111010111011 nnnn 0xxx 1111 xxxx mmmm",
    // Plain constants.
    "11110x100000 nnnn 0xxx dddd xxxxxxxx",
    "11110x101010 nnnn 0xxx dddd xxxxxxxx",
    "11110x100000 1111 0xxx dddd xxxxxxxx",
    "11110x101010 1111 0xxx dddd xxxxxxxx",
    "11110x100100 xxxx 0xxx dddd xxxxxxxx",
    "11110x101100 xxxx 0xxx dddd xxxxxxxx",
    "111100110000 nnnn 0xxx dddd xx0xxxxx",
    "111100111000 nnnn 0xxx dddd xx0xxxxx",
    "111100110010 nnnn 0xx1 dddd xx0xxxxx",
    "111100111010 nnnn 0xx1 dddd xx0xxxxx",
    "111100110010 nnnn 0000 dddd 0000xxxx",
    "111100111010 nnnn 0000 dddd 0000xxxx",
    // Fields that do not reach beyond bit 31.
    "111100110100 nnnn 00xx dddd xx00xxxx",
    "111100111100 nnnn 00xx dddd xx00xxxx",
    "111100110110 nnnn 00xx dddd xx01xxxx",
    "111100110110 1111 00xx dddd xx01xxxx",
    // Registers.
    "11111010000x nnnn 1111 dddd 0000 mmmm",
    "11111010001x nnnn 1111 dddd 0000 mmmm",
    "11111010010x nnnn 1111 dddd 0000 mmmm",
    "11111010011x nnnn 1111 dddd 0000 mmmm",
    "111110100000 nnnn 1111 dddd 10xx mmmm",
    "111110100001 nnnn 1111 dddd 10xx mmmm",
    "111110100010 nnnn 1111 dddd 10xx mmmm",
    "111110100011 nnnn 1111 dddd 10xx mmmm",
    "111110100100 nnnn 1111 dddd 10xx mmmm",
    "111110100101 nnnn 1111 dddd 10xx mmmm",
    "11111010000x 1111 1111 dddd 10xx mmmm",
    "11111010001x 1111 1111 dddd 10xx mmmm",
    "11111010010x 1111 1111 dddd 10xx mmmm",
    "111110101xxx nnnn 1111 dddd 00xx mmmm",
    "111110101xxx nnnn 1111 dddd 01xx mmmm",
    "111110101000 nnnn 1111 dddd 10xx mmmm",
    "111110101001 mmmm 1111 dddd 10xx mmmm",
    "111110101010 nnnn 1111 dddd 1000 mmmm",
    "111110101011 mmmm 1111 dddd 1000 mmmm",
    // Multiplications and divisions.
    "111110110000 nnnn aaaa dddd 0000 mmmm",
    "111110110000 nnnn 1111 dddd 0000 mmmm",
    "111110110000 nnnn aaaa dddd 0001 mmmm",
    "111110110001 nnnn aaaa dddd 00xx mmmm",
    "111110110001 nnnn 1111 dddd 00xx mmmm",
    "111110110010 nnnn aaaa dddd 000x mmmm",
    "111110110010 nnnn 1111 dddd 000x mmmm",
    "111110110011 nnnn aaaa dddd 000x mmmm",
    "111110110011 nnnn 1111 dddd 000x mmmm",
    "111110110100 nnnn aaaa dddd 000x mmmm",
    "111110110100 nnnn 1111 dddd 000x mmmm",
    "111110110101 nnnn aaaa dddd 000x mmmm",
    "111110110101 nnnn 1111 dddd 000x mmmm",
    "111110110110 nnnn aaaa dddd 000x mmmm",
    "111110110111 nnnn aaaa dddd 0000 mmmm",
    "111110110111 nnnn 1111 dddd 0000 mmmm",
    "111110111001 nnnn 1111 dddd 1111 mmmm",
    "111110111011 nnnn 1111 dddd 1111 mmmm",
    // Branches and control.
    "11110x0xxxxx xxxx 10x0 xxxx xxxx xxxx",
    "11110x10xxxx xxxx 10x0 xxxx xxxx xxxx",
    "11110x110xxx xxxx 10x0 xxxx xxxx xxxx",
    "11110xxxxxxx xxxx 10x1 xxxx xxxx xxxx",
    "11110xxxxxxx xxxx 11x1 xxxx xxxx xxxx",
    "111100111000 nnnn 1000 xx00 000000xx",
    "111100111000 nnnn 1000 1000 0000100x",
    "111100111000 nnnn 1000 1000 000100xx",
    "111100111110 1111 1000 dddd 000x0xxx",
    "111100111010 1111 1000 0000 0000 0xxx",
    "111100111011 1111 1000 1111 010x 1111",
    "111100111011 1111 1000 1111 0110 1111",
    "111100111011 1111 1000 1111 0010 1111",
    "1111011111110000 1010 xxxx xxxx xxxx",
    // Other coprocessors.
    "1110 1110 xxxx xxxx xxxx 0xxx xxxx xxxx",
];

/// Encodings whose registers are not the same: `l` and `h` are a pair, others are operands.
const LONG: &[&str] = &[
    "111110111000 nnnn llll hhhh 0000 mmmm",
    "111110111010 nnnn llll hhhh 0000 mmmm",
    "111110111100 nnnn llll hhhh 0000 mmmm",
    "111110111110 nnnn llll hhhh 0000 mmmm",
    "111110111110 nnnn llll hhhh 0110 mmmm",
    "111110111100 nnnn llll hhhh 10xx mmmm",
    "111110111100 nnnn llll hhhh 110x mmmm",
    "111110111101 nnnn llll hhhh 110x mmmm",
];

/// Loads and stores: `b` is a base, `o` an offset, `t` and `u` are loaded or stored.
const MOVING: &[&str] = &[
    "111110001001 bbbb tttt xxxxxxxxxxxx",
    "111110001011 bbbb tttt xxxxxxxxxxxx",
    "111110001101 bbbb tttt xxxxxxxxxxxx",
    "111110011001 bbbb tttt xxxxxxxxxxxx",
    "111110011011 bbbb tttt xxxxxxxxxxxx",
    "111110001000 bbbb tttt xxxxxxxxxxxx",
    "111110001010 bbbb tttt xxxxxxxxxxxx",
    "111110001100 bbbb tttt xxxxxxxxxxxx",
    "1111100x0001 bbbb tttt 000000xx oooo",
    "1111100x0011 bbbb tttt 000000xx oooo",
    "111110000101 bbbb tttt 000000xx oooo",
    "111110000000 bbbb tttt 000000xx oooo",
    "111110000010 bbbb tttt 000000xx oooo",
    "111110000100 bbbb tttt 000000xx oooo",
    "1111100x0001 bbbb tttt 11xx xxxxxxxx",
    "1111100x0011 bbbb tttt 11xx xxxxxxxx",
    "111110000101 bbbb tttt 11xx xxxxxxxx",
    "1111100x0001 bbbb tttt 10x1 xxxxxxxx",
    "1111100x0011 bbbb tttt 10x1 xxxxxxxx",
    "111110000101 bbbb tttt 10x1 xxxxxxxx",
    "111110000xx0 bbbb tttt 11xx xxxxxxxx",
    "111110000xx0 bbbb tttt 10x1 xxxxxxxx",
    "11111000x001 1111 tttt 0000xxxxxxxx",
    "11111000x011 1111 tttt 0000xxxxxxxx",
    "11111000x101 1111 tttt 0000xxxxxxxx",
    "11111001x001 1111 tttt 0000xxxxxxxx",
    "11111001x011 1111 tttt 0000xxxxxxxx",
    "111110000101 bbbb 1111 000000xx oooo",
    "1110100xx11x bbbb tttt uuuu xxxxxxxx",
    "1110 1001 x1xx bbbb tttt uuuu xxxxxxxx",
    "11101001x101 1111 tttt uuuu xxxxxxxx",
    "111010000101 bbbb tttt 1111 xxxxxxxx",
    "111010000100 bbbb tttt dddd xxxxxxxx",
    "111010001101 bbbb tttt 1111 010x 1111",
    "111010001100 bbbb tttt 1111 010x dddd",
    "111010001101 bbbb 1111 0000 0000 oooo",
    "111010001101 bbbb 1111 0000 0001 oooo",
    "111110010001 bbbb 1111 1100 xxxxxxxx",
];

#[test]
fn long_instructions_do_what_they_do_elsewhere() {
    let (mut pair, mut random) = (Pair::new(), Random::new(2));
    for (encodings, distinct) in [(COMPUTING, false), (LONG, true)] {
        for encoding in encodings {
            for _ in 0..3000 {
                pair.shuffle(&mut random);
                let (bits, _) = random.instruction(encoding, distinct);
                if encoding.ends_with("000100xx") {
                    // rsemu keeps bits of BASEPRI that do not exist.
                    pair.own.r[..15].iter_mut().for_each(|register| *register &= !0xF);
                }
                if is_left_out(bits) {
                    continue;
                }
                put(&pair.memory, CODE, &wide(bits));
                if random.below(4) == 0 && !encoding.contains(" 10x") {
                    pair.own.set_it_state(random.below(0xE0) & 0xF0 | 1 << random.below(4));
                }
                pair.compare(encoding);
            }
        }
    }
    println!("{} instructions of 32 bits compared", pair.compared);
}

/// Parallel additions that do not exist.
const fn is_left_out(bits: u32) -> bool {
    let is_parallel = bits & 0xFF80_F080 == 0xFA80_F000;
    is_parallel && (bits >> 4 & 3 == 3 || matches!(bits >> 20 & 7, 3 | 7))
}

#[test]
fn loads_and_stores_do_what_they_do_elsewhere() {
    let (mut pair, mut random) = (Pair::new(), Random::new(3));
    for encoding in MOVING {
        for _ in 0..2000 {
            pair.shuffle(&mut random);
            let (bits, letters) = random.instruction(encoding, true);
            for (letter, register) in letters {
                let aligned = !random.below(4).min(1).wrapping_mul(3);
                match letter {
                    'b' => {
                        pair.own.r[register as usize] =
                            DATA + 0x1000 + (random.below(0x800) & aligned);
                    }
                    'o' => pair.own.r[register as usize] = random.below(0x100) & aligned,
                    _ => {}
                }
            }
            put(&pair.memory, CODE, &wide(bits));
            // Every other exclusive store follows a load.
            if bits & 0xFF70_0000 == 0xE840_0000 && random.below(2) == 0 {
                let load = bits & 0xFFFF_00FF | 1 << 20 | 0xF00;
                let load = if bits >> 23 & 1 != 0 { load | 0xF } else { load };
                pair.reserve(load);
                put(&pair.memory, CODE, &wide(bits));
            }
            pair.compare(encoding);
        }
    }
    println!("{} loads and stores compared", pair.compared);
}

#[test]
fn several_words_move_as_they_do_elsewhere() {
    let (mut pair, mut random) = (Pair::new(), Random::new(4));
    for _ in 0..20_000 {
        pair.shuffle(&mut random);
        let encoding = random_multiple(&mut random);
        let (bits, letters) = random.instruction(encoding, true);
        let base = letters[0].1;
        let loads = bits & 1 << 20 != 0;
        // No base in the list, no stack pointer, no program counter, more than one register.
        let list = bits & 0x5FFF & !(1 << base);
        if list.count_ones() < 2 {
            continue;
        }
        let bits = bits & 0xFFFF_0000 | list;
        pair.own.r[base as usize] =
            DATA + 0x1000 + (random.below(0x800) & if random.below(16) == 0 { !0 } else { !3 });
        put(&pair.memory, CODE, &wide(bits));
        pair.compare(if loads { "LDM" } else { "STM" });
    }
    println!("{} compared", pair.compared);
}

fn random_multiple(random: &mut Random) -> &'static str {
    random.one_of(&["1110100010xx bbbb 0x0xxxxxxxxxxxxx", "1110100100xx bbbb 0x0xxxxxxxxxxxxx"])
}

/// Instructions of the FPU, with single precision.
const FLOAT: &[&str] = &[
    "111011100x00 xxxx xxxx 1010 xx x0 xxxx",
    "111011100x01 xxxx xxxx 1010 xx x0 xxxx",
    "111011100x10 xxxx xxxx 1010 xx x0 xxxx",
    "111011100x11 xxxx xxxx 1010 xx x0 xxxx",
    "111011101x00 xxxx xxxx 1010 x0 x0 xxxx",
    "111011101x01 xxxx xxxx 1010 xx x0 xxxx",
    "111011101x10 xxxx xxxx 1010 xx x0 xxxx",
    "111011101x11 xxxx xxxx 1010 00 00 xxxx",
    "111011101x11 000x xxxx 1010 x1 x0 xxxx",
    "111011101x11 001x xxxx 1010 x1 x0 xxxx",
    "111011101x11 0100 xxxx 1010 x1 x0 xxxx",
    "111011101x11 0101 xxxx 1010 x1 00 0000",
    "111011101x11 0110 xxxx 1010 x1 x0 xxxx",
    "111011101x11 0111 xxxx 1010 01 x0 xxxx",
    "111011101x11 1000 xxxx 1010 x1 x0 xxxx",
    "111011101x11 110x xxxx 1010 x1 x0 xxxx",
    "111011101x11 1010 xxxx 1010 11 x0 xxxx",
    "111011101x11 1011 xxxx 1010 11 x0 xxxx",
    "111011101x11 1111 xxxx 1010 11 x0 xxxx",
    "111011101x11 1110 xxxx 1010 11 x0 xxxx",
    "111111100xxx xxxx xxxx 1010 x0 x0 xxxx",
    "111111101x00 xxxx xxxx 1010 xx x0 xxxx",
    "111111101x11 10xx xxxx 1010 01 x0 xxxx",
    "111111101x11 11xx xxxx 1010 x1 x0 xxxx",
    "11101110000x xxxx tttt 1010 x001 0000",
    "111011100001 xxxx tttt 1010 x001 0000",
    "111011101110 0001 tttt 1010 0001 0000",
    "111011101111 0001 tttt 1010 0001 0000",
    "111011101111 0001 1111 1010 0001 0000",
    "11101100010x uuuu tttt 1010 00x1 xxx0",
    "11101100010x uuuu tttt 1011 0001 0xxx",
    "11101101xx0x bbbb xxxx 1010 xxxxxxxx",
    "11101101x00x bbbb 0xxx 1011 xxxxxxxx",
    "11101101xx01 1111 xxxx 1010 0000xxxx",
    "111011001x1x bbbb 0xxx 1010 00000xx1",
    "111011001x0x bbbb 0xxx 1010 00000xx1",
    "111011010x1x bbbb 0xxx 1010 00000xx1",
    "11101100101x bbbb 0xxx 1011 0000xx10",
];

#[test]
fn the_fpu_does_what_it_does_elsewhere() {
    let (mut pair, mut random) = (Pair::new(), Random::new(5));
    let mut left_out = 0;
    for encoding in FLOAT {
        for round in 0..6000 {
            pair.shuffle(&mut random);
            *pair.own.system.word_mut(0xD88 / 4) = 0xF << 20;
            pair.witness.core.with_sys(|system| system.cpacr = 0xF << 20);
            let (bits, letters) = random.instruction(encoding, true);
            for (letter, register) in letters {
                if letter == 'b' {
                    pair.own.r[register as usize] = DATA + 0x1000 + 4 * random.below(0x100);
                }
            }
            for register in &mut pair.own.s {
                *register = random.single();
            }
            // To the nearest, and the other modes; sometimes with all flags.
            pair.own.fpscr = if round % 2 == 0 { 0 } else { random.word() & 0x03C0_0000 };
            pair.own.fpscr |= random.one_of(&[0, 0x9F, 0x10]) | random.word() & 0xF000_0000;
            if is_other_in_the_manual(bits, &pair.own) {
                left_out += 1;
                continue;
            }
            put(&pair.memory, CODE, &wide(bits));
            pair.compare(encoding);
        }
    }
    println!("{} instructions of the FPU compared, {left_out} left out", pair.compared);
}

/// Where rsemu 0.0.7 does not do what the manual says.
fn is_other_in_the_manual(bits: u32, core: &Core) -> bool {
    let is_fixed = bits & 0xFFBA_0E50 == 0xEEBA_0A40;
    let is_half = bits & 0xFFBE_0E50 == 0xEEB2_0A40;
    let flushes = core.fpscr & 1 << 24 != 0;
    let is_fused = bits & 0xFFB0_0E10 == 0xEE90_0A00 || bits & 0xFFB0_0E10 == 0xEEA0_0A00;
    let subtracts = bits & 0xFFB0_0E50 == 0xEE30_0A40;
    let second = core.s[(bits << 1 & 0x1E | bits >> 5 & 1) as usize];
    // It scales step by step, with the flags of each; and leaves 16 bits without their sign.
    is_fixed
        // It changes the sign of a NaN that is subtracted.
        || subtracts && second & 0x7FFF_FFFF > 0x7F80_0000
        // It tells of no flushed operand beside a NaN.
        || is_fused && flushes && core.s.iter().any(|&bits| bits & 0x7FFF_FFFF > 0x7F80_0000)
        // It does not flush singles on their way to half precision.
        || is_half && flushes
}

/// Interrupts and faults in a block are in `exceptions`.
#[test]
fn blocks_go_on_after_each_instruction() {
    let (mut pair, mut random) = (Pair::new(), Random::new(6));
    for _ in 0..3000 {
        pair.shuffle(&mut random);
        let it = 0xBF00 | random.below(14) << 4 | (1 + random.below(15));
        // ADDS, MOVS, CMP, LSLS, MULS, AND.W with S.
        let mut code = vec![it as u16];
        for _ in 0..5 {
            code.extend(match random.below(6) {
                0 => vec![0x1840 | random.below(0x200) as u16 & 0x1F],
                1 => vec![0x2000 | random.below(0x700) as u16],
                2 => vec![0x4280 | random.below(0x40) as u16],
                3 => vec![0x4080 | random.below(0x40) as u16],
                4 => vec![0x4340 | random.below(0x40) as u16],
                _ => wide(0xEA10_0000 | random.below(8) << 16 | random.below(8) << 8).to_vec(),
            });
        }
        put(&pair.memory, CODE, &code);
        for _ in 0..6 {
            pair.compare("block");
        }
        assert_eq!((pair.own.psr & IT, pair.own.exception()), (0, 0));
    }
}
