//! The table of all instructions (A5), and a cache of those found in it.
//!
//! Almost every instruction of 16 bits is short for one of 32 bits, and is executed as that.

use super::arithmetic::*;
use super::dsp::*;
use super::exceptions::Fault;
use super::float::*;
use super::transfer::*;
use super::{Core, Done};

pub(super) type Run = fn(&mut Core, u32) -> Done;

/// Instructions whose decoding is kept.
pub(super) const SLOTS: usize = 1 << 18;

/// The three highest bits of a long instruction are set; here they say: it takes four bytes, ..
const LONG: u32 = 1 << 31;
/// .. and it is a short one that sets no flags in an IT block.
const FLAGS: u32 = 1 << 30;
/// Of an instruction that computes: whether it sets flags.
pub(super) const S: u32 = 1 << 20;

#[derive(Clone, Copy)]
pub(super) struct Decoded {
    pub address: u32,
    pub bits: u32,
    pub run: Run,
}

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
    pub(super) const fn bytes(&self) -> u32 {
        2 + (self.bits >> 31) * 2
    }

    /// The instruction as in an IT block.
    pub(super) const fn without_flags(mut self) -> Self {
        if self.bits & FLAGS != 0 {
            self.bits &= !S;
        }
        self
    }
}

impl Core {
    #[cold]
    pub(super) fn decode(&mut self, address: u32) -> Result<Decoded, Fault> {
        let first = self.fetch(address)?;
        let (bits, run) = if first >> 11 > 0b11100 {
            let bits = first << 16 | self.fetch(address.wrapping_add(2))?;
            (bits & !FLAGS, look_up(WIDE, bits).unwrap_or(undefined))
        } else if let Some(run) = look_up(NARROW, first) {
            (first | FLAGS | S, run)
        } else if let Some(bits) = widen(first) {
            (bits, look_up(WIDE, bits | LONG | FLAGS).unwrap_or(undefined))
        } else {
            (first, undefined as Run)
        };
        let decoded = Decoded { address, bits, run };
        self.slots[Decoded::slot(address)] = decoded;
        Ok(decoded)
    }

    /// Code was written, perhaps.
    pub(super) fn forget_code(&mut self) {
        for address in self.bus.memory.take_stale() {
            self.slots[Decoded::slot(address)].address = 1;
        }
    }
}

fn look_up(table: &[(u32, u32, Run)], bits: u32) -> Option<Run> {
    table.iter().find(|(mask, value, _)| bits & mask == *value).map(|&(.., run)| run)
}

/// The instruction of 32 bits that does what one of 16 bits does.
fn widen(half: u32) -> Option<u32> {
    let bits = |pattern: &'static str| pattern.bytes().filter(|letter| *letter != b' ');
    let is_set = |place: usize| half >> (15 - place) & 1 != 0;
    let fits =
        |short| bits(short).enumerate().all(|(at, bit)| bit > b'1' || is_set(at) == (bit == b'1'));
    let (short, long) = SHORT.iter().find(|(short, _)| fits(short))?;
    let (mut taken, mut flags) = ([0; 128], 0);
    let wide = bits(long).fold(0, |wide, letter| {
        let is_one = match letter {
            b'0' | b'1' => letter == b'1',
            b'S' => {
                flags = FLAGS;
                true
            }
            _ => {
                let mut places =
                    bits(short).enumerate().filter(|(_, other)| *other == letter).cycle();
                taken[usize::from(letter)] += 1;
                places.nth(taken[usize::from(letter)] - 1).is_some_and(|(at, _)| is_set(at))
            }
        };
        wide << 1 | u32::from(is_one)
    });
    Some(wide & !(LONG | FLAGS) | flags)
}

/// Instructions of 16 bits and the long ones that they are (A5.2), as the manual draws them: a
/// letter is a field, in the order of its bits, again and again; `S`: sets flags outside of an IT
/// block.
const SHORT: &[(&str, &str)] = &[
    // Shifts, additions, comparisons with constants.
    ("00000 iiiii mmm ddd", "11101010010S 1111 0iii 0ddd ii00 0mmm"),
    ("00001 iiiii mmm ddd", "11101010010S 1111 0iii 0ddd ii01 0mmm"),
    ("00010 iiiii mmm ddd", "11101010010S 1111 0iii 0ddd ii10 0mmm"),
    ("0001100 mmm nnn ddd", "11101011000S 0nnn 0000 0ddd 0000 0mmm"),
    ("0001101 mmm nnn ddd", "11101011101S 0nnn 0000 0ddd 0000 0mmm"),
    ("0001110 iii nnn ddd", "11110001000S 0nnn 0000 0ddd 00000iii"),
    ("0001111 iii nnn ddd", "11110001101S 0nnn 0000 0ddd 00000iii"),
    ("00100 ddd iiiiiiii", "11110000010S 1111 0000 0ddd iiiiiiii"),
    ("00101 nnn iiiiiiii", "111100011011 0nnn 0000 1111 iiiiiiii"),
    ("00110 ddd iiiiiiii", "11110001000S 0ddd 0000 0ddd iiiiiiii"),
    ("00111 ddd iiiiiiii", "11110001101S 0ddd 0000 0ddd iiiiiiii"),
    // Data processing.
    ("0100000000 mmm ddd", "11101010000S 0ddd 0000 0ddd 0000 0mmm"),
    ("0100000001 mmm ddd", "11101010100S 0ddd 0000 0ddd 0000 0mmm"),
    ("0100000010 mmm ddd", "11111010000S 0ddd 1111 0ddd 0000 0mmm"),
    ("0100000011 mmm ddd", "11111010001S 0ddd 1111 0ddd 0000 0mmm"),
    ("0100000100 mmm ddd", "11111010010S 0ddd 1111 0ddd 0000 0mmm"),
    ("0100000101 mmm ddd", "11101011010S 0ddd 0000 0ddd 0000 0mmm"),
    ("0100000110 mmm ddd", "11101011011S 0ddd 0000 0ddd 0000 0mmm"),
    ("0100000111 mmm ddd", "11111010011S 0ddd 1111 0ddd 0000 0mmm"),
    ("0100001000 mmm ddd", "111010100001 0ddd 0000 1111 0000 0mmm"),
    ("0100001001 nnn ddd", "11110001110S 0nnn 0000 0ddd 00000000"),
    ("0100001010 mmm ddd", "111010111011 0ddd 0000 1111 0000 0mmm"),
    ("0100001011 mmm ddd", "111010110001 0ddd 0000 1111 0000 0mmm"),
    ("0100001100 mmm ddd", "11101010010S 0ddd 0000 0ddd 0000 0mmm"),
    ("0100001110 mmm ddd", "11101010001S 0ddd 0000 0ddd 0000 0mmm"),
    ("0100001111 mmm ddd", "11101010011S 1111 0000 0ddd 0000 0mmm"),
    // With all registers.
    ("01000100 d mmmm ddd", "111010110000 dddd 0000 dddd 0000 mmmm"),
    ("01000101 d mmmm ddd", "111010111011 dddd 0000 1111 0000 mmmm"),
    ("01000110 d mmmm ddd", "111010100100 1111 0000 dddd 0000 mmmm"),
    // Loads and stores.
    ("01001 ttt iiiiiiii", "111110001101 1111 0ttt 00iiiiiiii00"),
    ("0101000 mmm nnn ttt", "111110000100 0nnn 0ttt 00000000 0mmm"),
    ("0101001 mmm nnn ttt", "111110000010 0nnn 0ttt 00000000 0mmm"),
    ("0101010 mmm nnn ttt", "111110000000 0nnn 0ttt 00000000 0mmm"),
    ("0101011 mmm nnn ttt", "111110010001 0nnn 0ttt 00000000 0mmm"),
    ("0101100 mmm nnn ttt", "111110000101 0nnn 0ttt 00000000 0mmm"),
    ("0101101 mmm nnn ttt", "111110000011 0nnn 0ttt 00000000 0mmm"),
    ("0101110 mmm nnn ttt", "111110000001 0nnn 0ttt 00000000 0mmm"),
    ("0101111 mmm nnn ttt", "111110010011 0nnn 0ttt 00000000 0mmm"),
    ("0110 l iiiii nnn ttt", "11111000110l 0nnn 0ttt 00000iiiii00"),
    ("0111 l iiiii nnn ttt", "11111000100l 0nnn 0ttt 0000000iiiii"),
    ("1000 l iiiii nnn ttt", "11111000101l 0nnn 0ttt 000000iiiii0"),
    ("1001 l ttt iiiiiiii", "11111000110l 1101 0ttt 00iiiiiiii00"),
    ("1011010 l rrrrrrrr", "111010010010 1101 0l00 0000 rrrrrrrr"),
    ("1011110 p rrrrrrrr", "111010001011 1101 p000 0000 rrrrrrrr"),
    ("1100 l nnn rrrrrrrr", "11101000101l 0nnn 0000 0000 rrrrrrrr"),
    // Addresses near the program counter and the stack pointer; the stack pointer itself.
    ("10100 ddd iiiiiiii", "111100100000 1111 00ii 0ddd iiiiii00"),
    ("10101 ddd iiiiiiii", "111100100000 1101 00ii 0ddd iiiiii00"),
    ("101100000 iiiiiii", "111100100000 1101 000i 1101 iiiiii00"),
    ("101100001 iiiiiii", "111100101010 1101 000i 1101 iiiiii00"),
    // Extensions, bytes in another order, branches.
    ("10110010 u b mmm ddd", "111110100 b 0 u 1111 1111 0ddd 1000 0mmm"),
    ("1011101000 mmm ddd", "111110101001 0mmm 1111 0ddd 1000 0mmm"),
    ("1011101001 mmm ddd", "111110101001 0mmm 1111 0ddd 1001 0mmm"),
    ("1011101011 mmm ddd", "111110101001 0mmm 1111 0ddd 1011 0mmm"),
    ("1101 cccc s iiiiiii", "11110 s cccc ssssss 10 s 0 s ssss iiiiiii"),
    ("11100 s iiiiiiiiii", "11110 s ssssssssss 10111 s iiiiiiiiii"),
];

/// Instructions of 16 bits that are no others in short.
const NARROW: &[(u32, u32, Run)] = &[
    (0xFF80, 0x4700, |core, i| core.branch_exchange(core.get(i >> 3))),
    (0xFF80, 0x4780, branch_link_exchange),
    (0xFFC0, 0x4340, multiply_flags),
    (0xF500, 0xB100, compare_branch),
    (0xFFE0, 0xB660, change_state),
    (0xFF00, 0xBE00, |core, _| core.break_point()),
    (0xFF00, 0xBF00, if_then),
    (0xFF00, 0xDE00, undefined),
    (0xFF00, 0xDF00, |core, _| core.call_supervisor()),
];

/// Instructions of 32 bits: bits that decide, their values, and the function. The first row that
/// fits counts.
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
    (0xFFD0_8020, 0xF300_0000, saturate::<false>),
    (0xFFD0_8020, 0xF380_0000, saturate::<true>),
    (0xFFF0_8020, 0xF340_0000, extract_field::<true>),
    (0xFFF0_8020, 0xF3C0_0000, extract_field::<false>),
    (0xFFF0_8020, 0xF360_0000, insert_field),
    // Branches and control (A5.3.4).
    (0xF800_D000, 0xF000_9000, branch_far),
    (0xF800_D000, 0xF000_D000, branch_link),
    (0xFFE0_D000, 0xF380_8000, |core, i| core.write_special(i & 0xFF, i >> 10 & 3, i >> 16)),
    (0xFFF0_D000, 0xF3E0_8000, |core, i| core.read_special(i & 0xFF, i >> 8)),
    (0xFFF0_D700, 0xF3A0_8000, hint),
    (0xFFF0_D0F0, 0xF3B0_8020, clear_exclusive),
    // Barriers: accesses come one after another anyway.
    (0xFFF0_D0E0, 0xF3B0_8040, |_, _| Ok(())),
    (0xFFF0_D0F0, 0xF3B0_8060, |_, _| Ok(())),
    (0xFB80_D000, 0xF380_8000, undefined),
    (0xF800_D000, 0xF000_8000, branch_if),
    // Loads and stores of several words, of two, exclusive ones, table branches (A5.3.5, A5.3.6).
    (0xFFC0_0000, 0xE880_0000, transfer_multiple),
    (0xFFC0_0000, 0xE900_0000, transfer_multiple),
    (0xFFF0_0000, 0xE840_0000, store_exclusive),
    (0xFFF0_0000, 0xE850_0000, load_exclusive),
    (0xFFF0_00E0, 0xE8C0_0040, store_exclusive),
    (0xFFF0_00E0, 0xE8D0_0040, load_exclusive),
    (0xFFF0_00E0, 0xE8D0_0000, branch_table),
    (0xFF60_0000, 0xE860_0000, transfer_two),
    (0xFF40_0000, 0xE940_0000, transfer_two),
    // Loads and stores: literal, twelve bits, register, eight bits (A5.3.7 to A5.3.10).
    (0xFE60_0000, 0xF860_0000, undefined),
    (0xFE1F_0000, 0xF81F_0000, load::<LITERAL>),
    (0xFE90_0000, 0xF890_0000, load::<TWELVE>),
    (0xFE90_0FC0, 0xF810_0000, load::<REGISTER>),
    (0xFE90_0800, 0xF810_0800, load::<EIGHT>),
    (0xFF90_0000, 0xF880_0000, store::<TWELVE>),
    (0xFF90_0FC0, 0xF800_0000, store::<REGISTER>),
    (0xFF90_0800, 0xF800_0800, store::<EIGHT>),
    // With registers (A5.3.12 to A5.3.15).
    (0xFF80_F0F0, 0xFA00_F000, shift),
    (0xFF80_F080, 0xFA00_F080, extend),
    (0xFF80_F080, 0xFA80_F000, parallel),
    (0xFFC0_F0C0, 0xFA80_F080, rearrange),
    // Multiplications (A5.3.16, A5.3.17).
    (0xFFF0_00E0, 0xFB00_0000, multiply),
    (0xFF80_00C0, 0xFB00_0000, multiply_parts),
    (0xFFD0_00F0, 0xFB90_00F0, divide),
    (0xFF80_0000, 0xFB80_0000, multiply_long),
    // The FPU (A6.4 to A6.7).
    (0xFF80_0E10, 0xEE00_0A00, float_basic),
    (0xFFB0_0E50, 0xEE80_0A00, float_basic),
    (0xFFB0_0E10, 0xEE90_0A00, float_fused),
    (0xFFB0_0E10, 0xEEA0_0A00, float_fused),
    (0xFFB0_0E50, 0xEEB0_0A00, float_constant),
    (0xFFBE_0E50, 0xEEB2_0A40, float_half),
    (0xFFBE_0E50, 0xEEB4_0A40, float_compare),
    (0xFFBA_0E50, 0xEEBA_0A40, float_fixed),
    (0xFFB0_0E50, 0xEEB0_0A40, float_unary),
    (0xFF80_0E50, 0xFE00_0A00, float_select),
    (0xFFB0_0E10, 0xFE80_0A00, float_extreme),
    (0xFFB8_0E50, 0xFEB8_0A40, float_round),
    (0xFFE0_0F10, 0xEE00_0A10, float_move),
    (0xFFC0_0F70, 0xEE00_0B10, float_move),
    (0xFFE0_0F10, 0xEEE0_0A10, float_status),
    (0xFFE0_0ED0, 0xEC40_0A10, float_move_two),
    (0xFF20_0E00, 0xED00_0A00, float_transfer),
    (0xFF80_0E00, 0xEC80_0A00, float_transfer_multiple),
    (0xFFA0_0E00, 0xED20_0A00, float_transfer_multiple),
    (0xEC00_0E00, 0xEC00_0A00, float_undefined),
    (0xEC00_0000, 0xEC00_0000, |_, _| Err(Fault::NoCoprocessor)),
];
