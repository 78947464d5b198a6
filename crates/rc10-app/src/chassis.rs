//! Chassis kinematics: twists, mecanum wheels, wheel speed limit, acceleration limit.
//!
//! A [`Twist`] is how the robot moves. The usual way from a driver's stick to four wheels:
//! [`TwistLimiter::update`] (no acceleration that makes wheels slip), [`Twist::into_frame`] if the
//! driver thinks in field coordinates, [`Mecanum::inverse`] (wheel speeds, never above the limit).

use core::f32::consts::PI;
use core::fmt;
use core::ops::{Add, Mul, Sub};

use crate::config::{ConfigError, positive};
use crate::maths;
use crate::transform::rotate;
use crate::units::{Radians, Rpm, Seconds};

/// Radians per second in one revolution per minute.
const RADIANS_PER_SECOND: f32 = PI / 30.0;

/// Motion in the plane: x forward, y left, yaw counter-clockwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Speed forward, in m/s.
    pub vx: f32,
    /// Speed to the left, in m/s.
    pub vy: f32,
    /// Yaw rate, counter-clockwise, in rad/s.
    pub wz: f32,
}

impl Twist {
    /// No motion.
    pub const STOP: Self = Self::new(0.0, 0.0, 0.0);

    /// m/s forward, m/s to the left, rad/s counter-clockwise.
    pub const fn new(vx: f32, vy: f32, wz: f32) -> Self {
        Self { vx, vy, wz }
    }

    /// Whether no component is infinite or NaN.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.vx.is_finite() && self.vy.is_finite() && self.wz.is_finite()
    }

    /// From the field's axes to those of a robot with this heading in the field: what the driver
    /// means by "away from me" becomes what the robot has to do.
    ///
    /// ```
    /// use core::f32::consts::FRAC_PI_2;
    /// use rc10_app::{Radians, chassis::Twist};
    /// // A robot that looks to the driver's left has to move to its own right.
    /// let robot = Twist::new(1.0, 0.0, 0.0).into_frame(Radians::new(FRAC_PI_2));
    /// assert!((robot.vy + 1.0).abs() < 1e-6 && robot.vx.abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn into_frame(self, heading: Radians) -> Self {
        self.out_of_frame(-heading)
    }

    /// From the axes of a robot with this heading to the field's: the inverse of
    /// [`into_frame`](Self::into_frame).
    #[must_use]
    pub fn out_of_frame(self, heading: Radians) -> Self {
        let (vx, vy) = rotate((self.vx, self.vy), heading);
        Self { vx, vy, ..self }
    }
}

impl Add for Twist {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.vx + other.vx, self.vy + other.vy, self.wz + other.wz)
    }
}

impl Sub for Twist {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.vx - other.vx, self.vy - other.vy, self.wz - other.wz)
    }
}

impl Mul<f32> for Twist {
    type Output = Self;
    fn mul(self, factor: f32) -> Self {
        Self::new(self.vx * factor, self.vy * factor, self.wz * factor)
    }
}

/// A twist with a component that is infinite, NaN, or too large to compute with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistNotFinite(
    /// The twist as it was given.
    pub Twist,
);

impl fmt::Display for TwistNotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Twist { vx, vy, wz } = self.0;
        write!(f, "not a usable twist: vx {vx} m/s, vy {vy} m/s, wz {wz} rad/s")
    }
}

impl core::error::Error for TwistNotFinite {}

/// A chassis on four mecanum wheels whose rollers form an X when seen from above.
///
/// Wheels are in the order front left, front right, rear left, rear right, and a positive speed
/// drives the robot forward. (Motors on the right are mirrored: turn their sign where the motor is
/// configured.)
///
/// ```
/// use rc10_app::Rpm;
/// use rc10_app::chassis::{Mecanum, Twist};
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
/// # Ok::<(), rc10_app::chassis::TwistNotFinite>(())
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
        let Twist { vx, vy, wz } = twist;
        let turn = self.lever() * wz;
        let wanted = [vx - vy - turn, vx + vy + turn, vx + vy - turn, vx - vy + turn]
            .map(|speed| speed / (self.wheel_radius * RADIANS_PER_SECOND));
        if !wanted.iter().all(|speed| speed.is_finite()) {
            return Err(TwistNotFinite(twist));
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

/// Largest accelerations of a [`TwistLimiter`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Largest change of the velocity vector (vx, vy), in m/s²; > 0. Rubber on a field gives
    /// the coefficient of friction times 9.81 m/s² in any direction.
    pub linear_acceleration: f32,
    /// Largest change of the yaw rate, in rad/s²; > 0.
    pub angular_acceleration: f32,
}

impl TwistLimits {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field that is not finite or not positive.
    pub fn validate(&self) -> Result<(), ConfigError> {
        positive("linear_acceleration", self.linear_acceleration)?;
        positive("angular_acceleration", self.angular_acceleration)
    }
}

/// State of an acceleration limiter for twists.
///
/// The linear acceleration is limited as a vector (the friction circle), so the velocity goes
/// straight to its target instead of finishing one axis first. Give it twists in the field's axes
/// where there is a heading: in the robot's axes the velocity of a robot that turns while it
/// drives stands still although the robot accelerates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwistLimiter {
    twist: Twist,
}

impl TwistLimiter {
    /// Standing still.
    pub const fn new() -> Self {
        Self { twist: Twist::STOP }
    }

    /// The last twist it gave.
    pub const fn twist(&self) -> Twist {
        self.twist
    }

    /// Goes on from a measured twist; one that is not finite is ignored.
    pub const fn reset(&mut self, measured: Twist) {
        if measured.is_finite() {
            self.twist = measured;
        }
    }

    /// Moves towards `target` for `dt` and returns the new twist. The last step lands exactly on
    /// the target. A `dt` that is not finite and positive changes nothing. To stop within the
    /// limits, give it [`Twist::STOP`].
    ///
    /// # Errors
    /// [`TwistNotFinite`] if the target is infinite, NaN, or too far away to compute with; the
    /// state stays unchanged.
    pub fn update(
        &mut self,
        limits: &TwistLimits,
        target: Twist,
        dt: Seconds,
    ) -> Result<Twist, TwistNotFinite> {
        let change = target - self.twist;
        let distance = maths::hypot(change.vx, change.vy);
        if !(change.is_finite() && distance.is_finite()) {
            return Err(TwistNotFinite(target));
        }
        if dt.is_step() {
            let linear = step_share(distance, limits.linear_acceleration * dt.get());
            let angular = step_share(change.wz.abs(), limits.angular_acceleration * dt.get());
            self.twist = Twist {
                vx: towards(self.twist.vx, target.vx, linear),
                vy: towards(self.twist.vy, target.vy, linear),
                wz: towards(self.twist.wz, target.wz, angular),
            };
        }
        Ok(self.twist)
    }
}

/// The share of `distance` that one step may go, 0 ..= 1. A step that is negative or not a number
/// is no step.
fn step_share(distance: f32, step: f32) -> f32 {
    let step = step.max(0.0);
    if distance <= step { 1.0 } else { step / distance }
}

/// The point `share` of the way; exactly the end if the share is 1.
fn towards(from: f32, to: f32, share: f32) -> f32 {
    if share < 1.0 { from + (to - from) * share } else { to }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::transform::tests::Random;
    use core::f32::consts::FRAC_PI_2;
    use std::string::ToString;

    const CHASSIS: Mecanum = Mecanum {
        wheel_radius: 0.076,
        half_wheelbase: 0.20,
        half_track: 0.25,
        max_wheel_speed: Rpm::new(450.0),
    };
    const DT: Seconds = Seconds::new(0.001);

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
                let TwistNotFinite(named) = CHASSIS.inverse(twist).unwrap_err();
                assert_eq!(named.vx.to_bits(), twist.vx.to_bits());
            }
        }
        let message = TwistNotFinite(Twist::new(f32::NAN, 0.5, 1.0)).to_string();
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
            assert!(
                TwistLimits { linear_acceleration: bad, angular_acceleration: 1.0 }
                    .validate()
                    .is_err()
            );
            assert!(
                TwistLimits { linear_acceleration: 1.0, angular_acceleration: bad }
                    .validate()
                    .is_err()
            );
        }
        assert_eq!(
            TwistLimits { linear_acceleration: 3.0, angular_acceleration: 10.0 }.validate(),
            Ok(())
        );
    }

    #[test]
    fn field_and_robot_axes() {
        // The robot looks along the field's y axis: the field's x is to its right.
        let heading = Radians::new(FRAC_PI_2);
        let field = Twist::new(1.0, 0.0, 0.7);
        near(field.into_frame(heading), Twist::new(0.0, -1.0, 0.7), 1e-6);
        let mut random = Random(12);
        for _ in 0..1000 {
            let (twist, heading) =
                (random_twist(&mut random, 3.0), Radians::new(random.within(7.0)));
            near(twist.into_frame(heading).out_of_frame(heading), twist, 1e-5);
        }
    }

    #[test]
    fn the_acceleration_is_never_exceeded_and_the_change_is_straight() {
        let limits = TwistLimits { linear_acceleration: 3.0, angular_acceleration: 12.0 };
        let (mut random, mut limiter) = (Random(13), TwistLimiter::new());
        let mut target = Twist::STOP;
        for step in 0..20_000 {
            if step % 500 == 0 {
                target = random_twist(&mut random, 2.0);
            }
            let seconds = 0.001 + random.within(0.000_5);
            let before = limiter.twist();
            let after = limiter.update(&limits, target, Seconds::new(seconds)).unwrap();
            let (change, way) = (after - before, target - before);
            let linear = maths::hypot(change.vx, change.vy);
            assert!(linear <= 3.0 * seconds + 1e-6, "{linear} m/s in {seconds} s");
            assert!(change.wz.abs() <= 12.0 * seconds + 1e-6, "{change:?} in {seconds} s");
            // Parallel to the way: no cross product.
            assert!((change.vx * way.vy - change.vy * way.vx).abs() < 2e-6, "{change:?} {way:?}");
        }
    }

    #[test]
    fn the_limiter_takes_the_shortest_time_and_arrives_exactly() {
        let limits = TwistLimits { linear_acceleration: 5.0, angular_acceleration: 10.0 };
        let mut limiter = TwistLimiter::new();
        let target = Twist::new(3.0, -4.0, 2.0);
        let mut step = 0;
        while limiter.update(&limits, target, DT).unwrap() != target {
            step += 1;
            assert!(step < 1010, "{limiter:?}");
        }
        assert!(step > 990, "{step} ms for 5 m/s at 5 m/s²");
        assert_eq!(limiter.update(&limits, target, DT), Ok(target));
        // Next to nothing: adding the rounded difference would end at 0.
        let creep = Twist::new(1e-9, 0.0, -1e-9);
        assert_eq!(limiter.update(&limits, creep, Seconds::new(10.0)), Ok(creep));
    }

    #[test]
    fn a_bad_target_or_time_leaves_the_limiter_unchanged() {
        let limits = TwistLimits { linear_acceleration: 5.0, angular_acceleration: 10.0 };
        let mut limiter = TwistLimiter::new();
        limiter.reset(Twist::new(1.0, 0.5, -1.0));
        let before = limiter;
        for bad in [f32::NAN, f32::INFINITY] {
            assert!(limiter.update(&limits, Twist::new(bad, 0.0, 0.0), DT).is_err());
            assert!(limiter.update(&limits, Twist::new(0.0, 0.0, bad), DT).is_err());
            limiter.reset(Twist::new(0.0, bad, 0.0));
        }
        assert!(limiter.update(&limits, Twist::new(f32::MAX, f32::MAX, 0.0), DT).is_err());
        for dt in [0.0, -0.001, f32::NAN, f32::INFINITY] {
            assert_eq!(limiter.update(&limits, Twist::STOP, Seconds::new(dt)), Ok(before.twist()));
        }
        let broken = TwistLimits { linear_acceleration: f32::NAN, angular_acceleration: -1.0 };
        assert_eq!(limiter.update(&broken, Twist::STOP, DT), Ok(before.twist()));
        assert_eq!(limiter, before);
    }
}
