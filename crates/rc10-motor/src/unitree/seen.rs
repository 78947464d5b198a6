use rc10_app::Celsius;
use rc10_app::angle::nearest_movement;
use rc10_can::Micros;

use super::wire::{GEAR, RawMotion, Status};

/// What the newest answer told, and what was counted on from the first one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) at: Micros,
    pub(super) status: Status,
    /// As received, of the rotor, in its own direction.
    pub(super) raw: RawMotion,
    pub(super) temperature: Celsius,
    /// Rotor counts from the zero, in the direction of the output.
    pub(super) total: i64,
    /// The same in microdegrees of the output, and what is left of that within the turn.
    pub(super) microdegrees: i64,
    pub(super) within: i32,
}

/// Rotor counts in a turn of the rotor (data manual: 15-bit encoder).
pub(super) const ROTOR_TURN: i32 = 32_768;
/// Microdegrees in a turn of the output.
const TURN: i32 = 360_000_000;
/// Microdegrees of the output per rotor count, times 2³²: the error stays below a microdegree for
/// all turns that the device counts.
const MICRODEGREES_PER_COUNT: i128 = ((TURN as i128 * GEAR.output_turns() as i128) << 32)
    / (ROTOR_TURN as i128 * GEAR.rotor_turns() as i128);

impl Seen {
    pub(super) const START: Self = Self {
        at: Micros::ZERO,
        status: Status::LOCK,
        raw: RawMotion { torque: 0, speed: 0, angle: 0 },
        temperature: Celsius::ZERO,
        total: 0,
        microdegrees: 0,
        within: 0,
    };

    /// The first answer after a silence. `true` if its turns are estimated, because the device may
    /// have been without power.
    #[cold]
    pub(super) fn after_silence(self, raw: RawMotion, at: Micros, sign: i8) -> (Self, bool) {
        let step = i64::from(raw.angle) - i64::from(self.raw.angle);
        if raw.angle.unsigned_abs() > ROTOR_TURN.unsigned_abs() {
            // Who has just been switched on is within its first turn: this one has counted on.
            return (self.moved(step, sign), false);
        }
        // In 1/256 turns a second; 128 counts per such a turn.
        let mean = (i64::from(raw.speed) + i64::from(self.raw.speed)) / 2;
        let micros = i64::try_from(at.since(self.at).get()).unwrap_or(i64::MAX);
        let expected = mean.saturating_mul(micros).saturating_mul(128) / 1_000_000;
        (self.moved(nearest_movement(step, expected, ROTOR_TURN.into()), sign), true)
    }

    /// So many rotor counts further.
    pub(super) fn moved(self, counts: i64, sign: i8) -> Self {
        let total = self.total.saturating_add(counts * i64::from(sign));
        let microdegrees = microdegrees(total);
        let way = microdegrees.saturating_sub(self.microdegrees);
        let within = match i32::try_from(way) {
            Ok(way) => self.within.saturating_add(way),
            Err(_) => far(self.within, way),
        };
        let within = if (0..TURN).contains(&within) { within } else { within.rem_euclid(TURN) };
        Self { total, microdegrees, within, ..self }
    }
}

/// Further than an i32 of microdegrees: after a silence only.
#[cold]
#[expect(clippy::cast_possible_truncation, reason = "less than a turn")]
const fn far(within: i32, way: i64) -> i32 {
    (within as i64).saturating_add(way).rem_euclid(TURN as i64) as i32
}

/// Of the output.
fn microdegrees(rotor_counts: i64) -> i64 {
    let exact = i128::from(rotor_counts) * MICRODEGREES_PER_COUNT;
    i64::try_from(exact >> 32).unwrap_or(if rotor_counts < 0 { i64::MIN } else { i64::MAX })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unitree::wire::Shaft;
    use rc10_app::TotalAngle;

    #[test]
    fn microdegrees_are_exact_as_far_as_the_device_counts() {
        for counts in [0, 1, -1, 32_768, 207_421, -207_422, 2_147_479_307, -2_147_479_307] {
            let exact = TotalAngle::new(counts, Shaft::OUTPUT.scale()).microdegrees();
            assert!((microdegrees(counts) - exact).abs() <= 1, "{counts}");
        }
    }
}
