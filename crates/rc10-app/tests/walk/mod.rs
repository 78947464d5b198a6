//! Walks through all of rc10-app that give the same bits on a PC and on the chip: `cargo xtask count` takes
//! them on both, and compares. Nothing of `std` is used here, and no f64.

#![allow(clippy::cast_possible_truncation, reason = "numbers by chance")]

pub mod bases;
pub mod control;
pub mod mechanisms;
pub mod paths;
pub mod power;
pub mod profiles;

/// A walk gives every result that it sees to a function.
pub type Walk = fn(&mut dyn FnMut(f32));

/// All walks, by their names.
pub const WALKS: &[(&str, Walk)] = &[
    ("control", control::walk),
    ("bases", bases::walk),
    ("mechanisms", mechanisms::walk),
    ("profiles", profiles::walk),
    ("paths", paths::walk),
    ("power", power::walk),
];

/// The hash of everything that a walk sees: FNV-1a over the bits.
#[must_use]
pub fn hash(walk: Walk) -> u64 {
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    walk(&mut |value| {
        // NaN has many forms, and which one comes out of a sum is the processor's.
        let bits = if value.is_nan() { 0x7FC0_0000 } else { value.to_bits() };
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        }
    });
    hash
}

/// Numbers by chance, the same everywhere (`SplitMix64`).
pub struct Chance(pub u64);

impl Chance {
    /// Within -`size` .. `size`.
    pub fn within(&mut self, size: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let top = ((bits ^ (bits >> 31)) >> 48) as u16;
        size * (f32::from(top) / 32768.0 - 1.0)
    }

    /// Within 0 .. `size`.
    pub fn up_to(&mut self, size: f32) -> f32 {
        0.5 * (self.within(size) + size)
    }
}
