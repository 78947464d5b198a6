//! Chassis kinematics: mecanum wheels and their speed limit.

use core::f32::consts::PI;

use crate::config::{ConfigError, positive};
use crate::twist::{Twist, TwistNotFinite};
use crate::units::Rpm;

/// Radians per second in one revolution per minute.
const RADIANS_PER_SECOND: f32 = PI / 30.0;

/// A chassis on four mecanum wheels whose rollers form an X when seen from above.
///
/// Wheels are in the order front left, front right, rear left, rear right, and a positive speed
/// drives the robot forward. (Motors on the right are mirrored: turn their sign where the motor is
/// configured.)
///
/// ```
/// use rc10_app::{Mecanum, Rpm, Twist};
/// let chassis = Mecanum {
///     wheel_radius: 0.076,
///     half_wheelbase: 0.20,
///     half_track: 0.25,
///     max_wheel_speed: Rpm::new(450.0),
/// };
/// assert_eq!(chassis.validate(), Ok(()));
/// let wheels = chassis.inverse(Twist::new(5.0, 0.0, 0.0))?;
/// assert_eq!(wheels.speeds, [Rpm::new(450.0); 4]); // 628 rpm would be needed
/// assert!((wheels.scale - 0.716).abs() < 1e-3);
/// # Ok::<(), rc10_app::TwistNotFinite>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mecanum {
    /// Radius of a wheel over its rollers, in metres; > 0.
    pub wheel_radius: f32,
    /// Half the distance between the front and the rear axle, in metres; > 0.
    pub half_wheelbase: f32,
    /// Half the distance between the left and the right wheels' centres, in metres; > 0.
    pub half_track: f32,
    /// No wheel is ever asked to turn faster than this; > 0.
    pub max_wheel_speed: Rpm,
}

/// Wheel speeds from [`Mecanum::inverse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSpeeds {
    /// Front left, front right, rear left, rear right; within ± `max_wheel_speed`.
    pub speeds: [Rpm; 4],
    /// The share of the twist that this is: 1 unless a wheel had to be limited, then 0 .. 1. The
    /// direction and the radius of the path are those asked for in any case.
    pub scale: f32,
}

impl Mecanum {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is not finite or not positive.
    pub fn validate(&self) -> Result<(), ConfigError> {
        positive("wheel_radius", self.wheel_radius)?;
        positive("half_wheelbase", self.half_wheelbase)?;
        positive("half_track", self.half_track)?;
        positive("max_wheel_speed", self.max_wheel_speed.get())
    }

    /// The wheel speeds that make the robot move with `twist` (in its own axes). If a wheel would
    /// have to turn faster than it may, all four are slowed down by one factor, so the robot still
    /// goes the way it was told, only slower.
    ///
    /// # Errors
    /// [`TwistNotFinite`] if the twist, or a wheel speed computed from it, is infinite or NaN.
    pub fn inverse(&self, twist: Twist) -> Result<WheelSpeeds, TwistNotFinite> {
        let Twist { vx, vy, wz, .. } = twist;
        let turn = self.lever() * wz;
        let wanted = [vx - vy - turn, vx + vy + turn, vx + vy - turn, vx - vy + turn]
            .map(|speed| speed / (self.wheel_radius * RADIANS_PER_SECOND));
        if !wanted.iter().all(|speed| speed.is_finite()) {
            return Err(TwistNotFinite::of(twist));
        }
        let fastest = wanted.iter().fold(0.0_f32, |fastest, speed| fastest.max(speed.abs()));
        // A limit that is negative or not a number becomes 0: the robot stands.
        let limit = self.max_wheel_speed.get().max(0.0);
        if fastest <= limit {
            return Ok(WheelSpeeds { speeds: wanted.map(Rpm::new), scale: 1.0 });
        }
        Ok(WheelSpeeds {
            // Divided first: the fastest wheel is then at exactly ± the limit, no rounding above.
            speeds: wanted.map(|speed| Rpm::new(speed / fastest * limit)),
            scale: limit / fastest,
        })
    }

    /// The motion of the robot (in its own axes) for given speeds of its wheels: the least-squares
    /// answer, because four wheels overdetermine three components. A speed that is not finite gives
    /// a twist that is not finite.
    pub fn forward(&self, speeds: [Rpm; 4]) -> Twist {
        let quarter = self.wheel_radius * RADIANS_PER_SECOND / 4.0;
        let [fl, fr, rl, rr] = speeds.map(|speed| speed.get() * quarter);
        Twist::new(fl + fr + rl + rr, -fl + fr + rl - rr, (-fl + fr - rl + rr) / self.lever())
    }

    /// Metres of rim per radian of yaw.
    fn lever(&self) -> f32 {
        self.half_wheelbase + self.half_track
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::transform::tests::Random;
    use std::string::ToString;

    const CHASSIS: Mecanum = Mecanum {
        wheel_radius: 0.076,
        half_wheelbase: 0.20,
        half_track: 0.25,
        max_wheel_speed: Rpm::new(450.0),
    };

    fn random_twist(random: &mut Random, size: f32) -> Twist {
        Twist::new(random.within(size), random.within(size), random.within(2.0 * size))
    }

    #[track_caller]
    fn near(actual: Twist, expected: Twist, tolerance: f32) {
        let off = actual - expected;
        let worst = off.vx.abs().max(off.vy.abs()).max(off.wz.abs());
        assert!(worst < tolerance, "{actual:?} is not {expected:?}");
    }

    fn signs(twist: Twist) -> [i8; 4] {
        CHASSIS.inverse(twist).unwrap().speeds.map(|speed| match speed.get() {
            speed if speed > 1e-3 => 1,
            speed if speed < -1e-3 => -1,
            _ => 0,
        })
    }

    #[test]
    fn each_motion_turns_the_wheels_the_right_way() {
        assert_eq!(signs(Twist::new(1.0, 0.0, 0.0)), [1, 1, 1, 1]);
        assert_eq!(signs(Twist::new(0.0, 1.0, 0.0)), [-1, 1, 1, -1]);
        assert_eq!(signs(Twist::new(0.0, 0.0, 1.0)), [-1, 1, -1, 1]);
        assert_eq!(signs(Twist::new(1.0, 1.0, 0.0)), [0, 1, 1, 0]);
        assert_eq!(signs(Twist::STOP), [0; 4]);
    }

    #[test]
    fn wheel_speeds_have_the_right_size() {
        // One wheel circumference per second forward is 60 rpm.
        let rim = core::f32::consts::TAU * CHASSIS.wheel_radius;
        for speed in CHASSIS.inverse(Twist::new(rim, 0.0, 0.0)).unwrap().speeds {
            assert!((speed.get() - 60.0).abs() < 1e-4, "{speed}");
        }
        let spin = CHASSIS.inverse(Twist::new(0.0, 0.0, 2.0)).unwrap().speeds;
        // 2 rad/s · 0.45 m / 0.076 m = 11.842 rad/s = 113.08 rpm.
        assert!((spin[1].get() - 113.085).abs() < 1e-2, "{spin:?}");
    }

    #[test]
    fn forward_undoes_inverse() {
        let mut random = Random(10);
        for _ in 0..1000 {
            let twist = random_twist(&mut random, 1.0);
            let wheels = CHASSIS.inverse(twist).unwrap();
            assert!((wheels.scale - 1.0).abs() < f32::EPSILON, "meant to be within the limit");
            near(CHASSIS.forward(wheels.speeds), twist, 1e-5);
        }
    }

    #[test]
    fn forward_ignores_what_no_motion_explains() {
        // Front wheels against rear wheels: pure slip.
        let slip = [10.0, 10.0, -10.0, -10.0].map(Rpm::new);
        near(CHASSIS.forward(slip), Twist::STOP, 1e-6);
        let twist = Twist::new(0.5, -0.3, 1.0);
        let mut speeds = CHASSIS.inverse(twist).unwrap().speeds;
        for (speed, slip) in speeds.iter_mut().zip(slip) {
            *speed = *speed + slip;
        }
        near(CHASSIS.forward(speeds), twist, 1e-5);
    }

    #[test]
    fn r13_the_limit_is_kept_and_so_is_the_direction() {
        let (mut random, mut limited) = (Random(11), 0);
        for _ in 0..2000 {
            let twist = random_twist(&mut random, 6.0);
            let wheels = CHASSIS.inverse(twist).unwrap();
            let fastest = wheels.speeds.iter().fold(0.0_f32, |a, b| a.max(b.get().abs()));
            assert!(fastest <= 450.0, "{fastest}");
            assert!(wheels.scale > 0.0 && wheels.scale <= 1.0);
            if wheels.scale < 1.0 {
                limited += 1;
                assert_eq!(fastest.to_bits(), 450.0_f32.to_bits());
            }
            near(CHASSIS.forward(wheels.speeds), twist * wheels.scale, 1e-5);
        }
        assert!(limited > 500 && limited < 1990, "{limited} of 2000 limited");
    }

    #[test]
    fn a_twist_that_is_not_finite_is_an_error() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            for twist in
                [Twist::new(bad, 0.0, 0.0), Twist::new(0.0, bad, 0.0), Twist::new(0.0, 0.0, bad)]
            {
                let named = CHASSIS.inverse(twist).unwrap_err();
                assert_eq!(named.vx.to_bits(), twist.vx.to_bits());
            }
        }
        let message = TwistNotFinite { vx: f32::NAN, vy: 0.5, wz: 1.0 }.to_string();
        assert_eq!(message, "not a usable twist: vx NaN m/s, vy 0.5 m/s, wz 1 rad/s");
    }

    #[test]
    fn a_broken_limit_means_standing_still() {
        for limit in [f32::NAN, -100.0, 0.0] {
            let chassis = Mecanum { max_wheel_speed: Rpm::new(limit), ..CHASSIS };
            let wheels = chassis.inverse(Twist::new(1.0, 0.0, 0.0)).unwrap();
            assert_eq!(wheels.speeds, [Rpm::ZERO; 4]);
        }
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CHASSIS.validate(), Ok(()));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let field = |chassis: Mecanum| chassis.validate().unwrap_err().field;
            assert_eq!(field(Mecanum { wheel_radius: bad, ..CHASSIS }), "wheel_radius");
            assert_eq!(field(Mecanum { half_wheelbase: bad, ..CHASSIS }), "half_wheelbase");
            assert_eq!(field(Mecanum { half_track: bad, ..CHASSIS }), "half_track");
            let speed = Mecanum { max_wheel_speed: Rpm::new(bad), ..CHASSIS };
            assert_eq!(field(speed), "max_wheel_speed");
        }
    }
}
