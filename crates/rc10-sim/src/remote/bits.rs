//! What frames of DJI's remotes have in common.

/// Bit fields one after another, the lowest bit first.
pub(super) struct Bits<const LENGTH: usize> {
    bytes: [u8; LENGTH],
    at: usize,
}

impl<const LENGTH: usize> Bits<LENGTH> {
    pub(super) const fn new() -> Self {
        Self { bytes: [0; LENGTH], at: 0 }
    }

    pub(super) fn put(&mut self, value: u16, bits: usize) {
        for bit in 0..bits {
            self.bytes[self.at / 8] |= u8::from(value >> bit & 1 == 1) << (self.at % 8);
            self.at += 1;
        }
    }

    pub(super) const fn bytes(self) -> [u8; LENGTH] {
        self.bytes
    }
}

/// A stick's axis: 364 ..= 1684, 1024 in the middle.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "364 ..= 1684")]
pub(super) fn level(deflection: f64) -> u16 {
    (1024.0 + 660.0 * deflection.clamp(-1.0, 1.0)).round() as u16
}
