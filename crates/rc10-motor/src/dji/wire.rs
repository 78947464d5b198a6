//! The bytes of feedback and commands.

use rc10_app::maths::{round_to_i16, within};

use super::config::Model;

pub(super) const ENCODER_COUNTS: u32 = 8192;

/// The bytes of a feedback frame, as numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawFeedback {
    /// Rotor angle, 0 ..= 8191 for one turn.
    pub angle: u16,
    /// Rotor speed, rpm.
    pub rpm: i16,
    /// Torque current, [`Model::amps_per_count`] each.
    pub current: i16,
    /// Temperature in degrees Celsius, where the model has one.
    pub temperature: u8,
}

impl RawFeedback {
    /// From the eight bytes of a frame; byte 7 means nothing.
    pub const fn unpack(bytes: &[u8; 8]) -> Self {
        // Two fields to a word: half the loads and byte swaps.
        let [a, b, c, d, e, f, temperature, _] = *bytes;
        let motion = u32::from_be_bytes([a, b, c, d]);
        #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
        let (angle, rpm) = ((motion >> 16) as u16, motion as i16);
        Self { angle, rpm, current: i16::from_be_bytes([e, f]), temperature }
    }
}

impl Model {
    /// The raw command for an effort: rounded to the nearest, limited to full scale; 0 for NaN.
    pub fn raw_command(&self, effort: f32) -> i16 {
        let full = f32::from(self.full_scale);
        round_to_i16(within(effort * (full / self.effort.full()), full))
    }
}
