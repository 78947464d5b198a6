/// Chance of a story.
pub struct Random(rc10_sim::Random);

impl Random {
    pub const fn new(seed: u64) -> Self {
        Self(rc10_sim::Random::new(seed.wrapping_mul(0xD134_2543_DE82_EF95)))
    }

    pub const fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// A number in 0 .. `end`.
    pub fn below(&mut self, end: u32) -> u32 {
        u32::try_from(self.0.below(end.into())).unwrap()
    }

    /// A number in -1 .. 1.
    #[expect(clippy::cast_precision_loss, reason = "24 bits are exact")]
    pub fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1_u32 << 23) as f32 - 1.0
    }

    pub fn one_in(&mut self, n: u32) -> bool {
        self.below(n) == 0
    }

    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(u32::try_from(of.len()).unwrap()) as usize]
    }
}
