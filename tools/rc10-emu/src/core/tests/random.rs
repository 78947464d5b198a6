//! Random instructions by their encodings, and random numbers for them.

/// The same numbers for the same seed.
pub(super) struct Random(Box<dyn Iterator<Item = u64>>);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(Box::new(crate::memory::noise(seed)))
    }

    pub(super) fn word(&mut self) -> u32 {
        (self.0.next().unwrap() >> 13) as u32
    }

    pub(super) fn long(&mut self) -> u64 {
        self.0.next().unwrap()
    }

    pub(super) fn below(&mut self, bound: u32) -> u32 {
        self.word() % bound
    }

    pub(super) fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(u32::try_from(of.len()).unwrap()) as usize]
    }

    /// A number as registers have them: often near a bound.
    pub(super) fn number(&mut self) -> u32 {
        let word = self.word();
        match self.below(8) {
            0 => word & 0xF,
            1 => !(word & 0xF),
            2 => 0x8000_0000_u32.wrapping_add(word & 7).wrapping_sub(4),
            3 => (word & 0xFFFF) | self.one_of(&[0, 0x7FFF_0000, 0x8000_0000, 0xFFFF_0000]),
            4 => self.one_of(&[
                0,
                1,
                0x7FFF_FFFF,
                0xFFFF_FFFF,
                0x8000_8000,
                0x7FFF_7FFF,
                0x8080_8080,
            ]),
            _ => word,
        }
    }

    /// Bits of a single: often of a special one.
    pub(super) fn single(&mut self) -> u32 {
        const SPECIAL: [u32; 22] = [
            0,
            0x8000_0000,
            0x3F80_0000,
            0xBF80_0000,
            0x7F80_0000,
            0xFF80_0000,
            0x7FC0_0000,
            0xFFC1_2345,
            0x7F80_0001,
            0xFFA0_0000,
            1,
            0x8000_0001,
            0x007F_FFFF,
            0x0080_0000,
            0x8080_0001,
            0x7F7F_FFFF,
            0xFF7F_FFFF,
            0x4F00_0000,
            0xCF00_0000,
            0x4F80_0000,
            0x3F00_0000,
            0x3400_0000,
        ];
        let word = self.word();
        match self.below(6) {
            0 | 1 => self.one_of(&SPECIAL),
            2 => word,
            // Around one, and whole numbers with halves.
            3 => word & 0x803F_FFFF | 0x3F80_0000,
            4 => ((word as i16) as f32 / 2.0).to_bits(),
            _ => word & 0x8FFF_FFFF | self.one_of(&[0, 0x3000_0000, 0x4000_0000, 0x7000_0000]),
        }
    }

    /// An instruction of an encoding: fixed bits, random ones (`x`), and letters for registers. With
    /// `distinct`, different letters are different registers. Also says which letter became which.
    pub(super) fn instruction(
        &mut self,
        encoding: &str,
        distinct: bool,
    ) -> (u32, Vec<(char, u32)>) {
        let mut bits = 0;
        let mut letters: Vec<(char, u32)> = Vec::new();
        let mut places: Vec<(char, u32)> = Vec::new();
        for letter in encoding.chars().filter(|letter| *letter != ' ') {
            bits = bits << 1
                | match letter {
                    '0' => 0,
                    '1' => 1,
                    'x' => self.below(2),
                    _ => {
                        let place = places.iter_mut().find(|(of, _)| *of == letter);
                        let place = match place {
                            Some((_, place)) => {
                                *place += 1;
                                *place
                            }
                            None => {
                                places.push((letter, 0));
                                0
                            }
                        };
                        if !letters.iter().any(|(of, _)| *of == letter) {
                            let register = loop {
                                // Not the stack pointer, and not the program counter.
                                let register =
                                    self.one_of(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14]);
                                if !distinct || letters.iter().all(|(_, other)| *other != register)
                                {
                                    break register;
                                }
                            };
                            letters.push((letter, register));
                        }
                        let register = letters.iter().find(|(of, _)| *of == letter).unwrap().1;
                        register >> (3 - place % 4) & 1
                    }
                };
        }
        (bits, letters)
    }
}
