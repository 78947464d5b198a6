/// A small repeatable generator (`SplitMix64`).
pub struct Random(pub u64);

impl Random {
    /// A number within −`size` .. `size`.
    pub fn within(&mut self, size: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let top = u16::try_from((bits ^ (bits >> 31)) >> 48).unwrap();
        size * (f32::from(top) / 32768.0 - 1.0)
    }
}
