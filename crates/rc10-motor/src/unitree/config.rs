//! Properties of the motor, and its stock gains.

use core::fmt;

use rc10_app::{Cascade, ConfigError, NewtonMetres, PidConfig, Rpm, RpmPerSecond};

use crate::servo::{Servo, SpringRange};
use crate::target::TargetKind;

use super::wire::{GAIN_LIMIT, GEAR, SPEED_LIMIT};

/// Largest torque at the output shaft (data manual).
pub const LARGEST_TORQUE: NewtonMetres = NewtonMetres::new(23.7);

/// Gains for both links, in N m at the output shaft, from a bare shaft to a load of 0.02 kg m²,
/// give or take 30 %. Our choice, tuned in simulation only.
pub const CASCADE: Cascade = Cascade {
    speed: PidConfig::new(0.12, 0.8, 0.0, LARGEST_TORQUE.get()),
    angle: PidConfig::new(1.1, 0.0, 0.0, 200.0),
    outer_divider: 1,
    acceleration: RpmPerSecond::new(800.0),
    feed_forward: 0.0,
};

/// The springs that the controller makes at the output shaft.
#[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
const SPRINGS: SpringRange = {
    let ratio = GEAR.rotor_turns() as f64 / GEAR.output_turns() as f64;
    let gain = (GAIN_LIMIT * ratio * ratio) as f32;
    let rpm = SPEED_LIMIT * 60.0 / (core::f64::consts::TAU * ratio);
    SpringRange { kp: gain, kd: gain, speed: Rpm::new(rpm as f32) }
};

/// The servo with the stock gains.
pub(super) const STOCK_SERVO: Servo = Servo::of(TargetKind::Torque, CASCADE).with_springs(SPRINGS);

/// The same with gains of your own.
pub(super) fn servo(cascade: Cascade) -> Result<Servo, ConfigError> {
    let limit = cascade.speed.output_limit;
    ConfigError::check(limit <= LARGEST_TORQUE.get(), "output_limit", limit, "at most 23.7 N m")
        .map_err(|error| error.in_part("speed"))?;
    Ok(Servo::new(TargetKind::Torque, cascade)?.with_springs(SPRINGS))
}

/// An identifier that no motor on RS-485 has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IdOutOfRange {
    /// The id.
    pub id: u8,
}

impl fmt::Display for IdOutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "GO-M8010-6 id {}: its ids are 0 to 14", self.id)
    }
}

impl core::error::Error for IdOutOfRange {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stock_gains_are_good_and_more_torque_than_the_motor_has_is_refused() {
        assert!(servo(CASCADE).is_ok());
        let mut cascade = CASCADE;
        cascade.speed.output_limit = 24.0;
        let error = servo(cascade).unwrap_err();
        let ConfigError { part, field, must_be, .. } = error;
        assert_eq!((part, field, must_be), ("speed", "output_limit", "at most 23.7 N m"));
        cascade.speed.output_limit = f32::NAN;
        assert!(servo(cascade).is_err());
    }
}
