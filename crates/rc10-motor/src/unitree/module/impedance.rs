use core::f32::consts::PI;

use rc10_app::maths::{round_to_i32, within};
use rc10_app::{Seconds, TotalAngle};

use super::GoModule;
use crate::motor::{Impedance, TargetError, TargetKind};
use crate::unitree::wire::RawMotion;

/// Largest stiffness in N m/rad and damping in N m s/rad: 25.599 at the rotor.
const LARGEST_GAIN: f32 = 25.599 * 6.33 * 6.33;
/// Largest angle, degrees: 411,774 rad at the rotor.
const LARGEST_ANGLE: f32 = 411_774.0 / 6.33 * 180.0 / PI;
/// An impedance starts with this share of the torque limit per second: all of it after 20 ms.
const SOFT_SLOPE: f32 = 50.0;

/// Rotor steps per degree of the output.
const STEPS_PER_DEGREE: f32 = 32768.0 * 6.33 / 360.0;
const RPM_PER_RADIAN_PER_SECOND: f32 = 30.0 / PI;

impl GoModule {
    /// The motion that makes the module's stiffness and damping give what `impedance` asks for, and
    /// never more than the torque limit at the angle and speed measured last.
    pub(super) fn pull(&mut self, impedance: &Impedance, dt: Seconds) -> RawMotion {
        self.share = (self.share + SOFT_SLOPE * dt.get()).min(1.0);
        let most = self.servo.cascade().speed.output_limit * self.share;
        let way = self.spring.saturating_sub(self.turns.microdegrees());
        // Six turns away, some more or less do not matter.
        let far = if way < 0 { i32::MIN } else { i32::MAX };
        #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of the way to go")]
        let way = i32::try_from(way).unwrap_or(far) as f32 * 1e-6;

        let Impedance { kp, kd, .. } = *impedance;
        // Degrees and rpm at which spring and damper give all there is.
        let (furthest, fastest) = (most / kp * (180.0 / PI), most / kd * RPM_PER_RADIAN_PER_SECOND);
        let way = if kp > 0.0 { within(way, furthest) } else { 0.0 };
        let faster = impedance.speed.get() - self.seen.rpm;
        let faster = if kd > 0.0 { within(faster, fastest) } else { 0.0 };
        let given = kp * way * (PI / 180.0) + kd * faster * (1.0 / RPM_PER_RADIAN_PER_SECOND);
        let torque = within(given + impedance.torque.get(), most) - given;

        let steps = round_to_i32(way * STEPS_PER_DEGREE).saturating_mul(self.sign.into());
        let angle = self.seen.raw.angle.saturating_add(steps);
        self.motion(torque, self.seen.rpm + faster, angle)
    }

    /// What a good impedance can be.
    pub(super) fn check(impedance: &Impedance) -> Result<i64, TargetError> {
        let is_gain = |gain: f32| (0.0..=LARGEST_GAIN).contains(&gain);
        let good = is_gain(impedance.kp)
            && is_gain(impedance.kd)
            && impedance.angle.get().abs() <= LARGEST_ANGLE;
        let angle = TotalAngle::try_from_degrees(impedance.angle).filter(|_| good);
        angle.map(TotalAngle::microdegrees).ok_or(TargetError::OutOfRange(TargetKind::Impedance))
    }
}
