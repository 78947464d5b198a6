//! Motion in the plane: the twist of a base, and a limit of its acceleration.
//!
//! From a driver's stick to wheels: [`TwistLimiter::update`] (wheels do not slip),
//! [`Twist::into_frame`] for the field's axes, then the base's inverse kinematics.

use core::marker::PhantomData;
use core::ops::{Add, Mul, Sub};

use crate::config::{ConfigError, positive};
use crate::maths;
use crate::ok;
use crate::transform::{FieldFrame, Frame, RobotFrame, rotate};
use crate::units::{Radians, Seconds};

/// Motion of a base in the axes of the frame `F`: the robot's own, if nothing else is said.
///
/// A twist in the field's axes does not compile where one in the robot's is wanted:
///
/// ```compile_fail,E0308
/// use rc10_app::{FieldFrame, Twist};
/// let away_from_the_driver: Twist<FieldFrame> = Twist::new(1.0, 0.0, 0.0);
/// let robot: Twist = away_from_the_driver; // without its heading?
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct Twist<F: Frame = RobotFrame> {
    /// Speed along x, in m/s; the robot's x is forward.
    pub vx: f32,
    /// Speed along y, in m/s; the robot's y is to its left.
    pub vy: f32,
    /// Yaw rate, counter-clockwise, in rad/s; the same on the field and on the robot.
    pub wz: f32,
    frame: PhantomData<F>,
}

impl<F: Frame> Twist<F> {
    /// No motion.
    pub const STOP: Self = Self::new(0.0, 0.0, 0.0);

    /// m/s along x and y, rad/s counter-clockwise.
    pub const fn new(vx: f32, vy: f32, wz: f32) -> Self {
        Self { vx, vy, wz, frame: PhantomData }
    }

    /// Whether no component is infinite or NaN.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.vx.is_finite() && self.vy.is_finite() && self.wz.is_finite()
    }
}

impl Twist<FieldFrame> {
    /// From the field's axes to a robot's with this heading: "away from me" becomes its own motion.
    ///
    /// ```
    /// use core::f32::consts::FRAC_PI_2;
    /// use rc10_app::{FieldFrame, Radians, Twist};
    /// // A robot that looks to the driver's left has to move to its own right.
    /// let wish: Twist<FieldFrame> = Twist::new(1.0, 0.0, 0.0);
    /// let robot = wish.into_frame(Radians::new(FRAC_PI_2));
    /// assert!((robot.vy + 1.0).abs() < 1e-6 && robot.vx.abs() < 1e-6);
    /// ```
    pub fn into_frame(self, heading: Radians) -> Twist<RobotFrame> {
        let (vx, vy) = rotate((self.vx, self.vy), -heading);
        Twist::new(vx, vy, self.wz)
    }
}

impl Twist<RobotFrame> {
    /// From a robot's axes to the field's: the inverse of [`into_frame`](Twist::into_frame).
    pub fn out_of_frame(self, heading: Radians) -> Twist<FieldFrame> {
        let (vx, vy) = rotate((self.vx, self.vy), heading);
        Twist::new(vx, vy, self.wz)
    }
}

impl<F: Frame> Add for Twist<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.vx + other.vx, self.vy + other.vy, self.wz + other.wz)
    }
}

impl<F: Frame> Sub for Twist<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.vx - other.vx, self.vy - other.vy, self.wz - other.wz)
    }
}

impl<F: Frame> Mul<f32> for Twist<F> {
    type Output = Self;
    fn mul(self, factor: f32) -> Self {
        Self::new(self.vx * factor, self.vy * factor, self.wz * factor)
    }
}

/// A twist with a component that is infinite, NaN, or too large to compute with, as it was given.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("not a usable twist: vx {vx} m/s, vy {vy} m/s, wz {wz} rad/s")]
pub struct TwistNotFinite {
    /// Speed along x, in m/s.
    pub vx: f32,
    /// Speed along y, in m/s.
    pub vy: f32,
    /// Yaw rate, in rad/s.
    pub wz: f32,
}

impl TwistNotFinite {
    pub(crate) const fn of<F: Frame>(twist: Twist<F>) -> Self {
        Self { vx: twist.vx, vy: twist.vy, wz: twist.wz }
    }
}

/// Largest accelerations of a [`TwistLimiter`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Largest change of (vx, vy), m/s²; > 0: on rubber, friction times 9.81.
    pub linear_m_s2: f32,
    /// Largest change of the yaw rate, rad/s²; > 0.
    pub angular_rad_s2: f32,
}

impl TwistLimits {
    /// Checks every field; the error names the first that is not finite or not positive.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(positive("linear_m_s2", self.linear_m_s2));
        positive("angular_rad_s2", self.angular_rad_s2)
    }
}

/// State of an acceleration limiter for twists.
///
/// The linear acceleration is limited as a vector (the friction circle), in the axes of one frame:
/// the field's where there is a heading, because a turning robot that drives straight accelerates
/// in no robot axis.
///
/// ```
/// use rc10_app::{Seconds, Twist, TwistLimiter, TwistLimits};
/// let limits = TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 };
/// let mut limiter: TwistLimiter = TwistLimiter::new();
/// let twist = limiter.update(&limits, Twist::new(1.5, 2.0, 0.0), Seconds::new(0.01))?;
/// assert!((twist.vx - 0.018).abs() < 1e-6 && (twist.vy - 0.024).abs() < 1e-6); // 3 m/s²
/// # Ok::<(), rc10_app::TwistNotFinite>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwistLimiter<F: Frame = RobotFrame> {
    twist: Twist<F>,
}

impl<F: Frame> TwistLimiter<F> {
    /// Standing still.
    pub const fn new() -> Self {
        Self { twist: Twist::STOP }
    }

    /// The last twist it gave.
    pub const fn twist(&self) -> Twist<F> {
        self.twist
    }

    /// Goes on from a measured twist; one that is not finite is ignored.
    pub const fn reset(&mut self, measured: Twist<F>) {
        if measured.is_finite() {
            self.twist = measured;
        }
    }

    /// Moves towards `target` for `dt`; the last step lands exactly on it. A `dt` that is not
    /// finite and positive changes nothing. [`Twist::STOP`] stops within the limits.
    ///
    /// # Errors
    /// [`TwistNotFinite`] if infinite, NaN or too far away; the state stays unchanged.
    pub fn update(
        &mut self,
        limits: &TwistLimits,
        target: Twist<F>,
        dt: Seconds,
    ) -> Result<Twist<F>, TwistNotFinite> {
        let change = target - self.twist;
        let distance = maths::hypot(change.vx, change.vy);
        if !(change.is_finite() && distance.is_finite()) {
            return Err(TwistNotFinite::of(target));
        }
        if dt.is_step() {
            let linear = step_share(distance, limits.linear_m_s2 * dt.get());
            let angular = step_share(change.wz.abs(), limits.angular_rad_s2 * dt.get());
            self.twist = Twist::new(
                towards(self.twist.vx, target.vx, linear),
                towards(self.twist.vy, target.vy, linear),
                towards(self.twist.wz, target.wz, angular),
            );
        }
        Ok(self.twist)
    }
}

/// The share of `distance` in one step, 0 ..= 1; 0 for a negative or NaN step.
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
    use super::*;
    use crate::transform::tests::Random;
    use core::f32::consts::FRAC_PI_2;

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

    #[test]
    fn field_and_robot_axes() {
        // The robot looks along the field's y axis: the field's x is to its right.
        let heading = Radians::new(FRAC_PI_2);
        let field: Twist<FieldFrame> = Twist::new(1.0, 0.0, 0.7);
        near(field.into_frame(heading), Twist::new(0.0, -1.0, 0.7), 1e-6);
        let mut random = Random(12);
        for _ in 0..1000 {
            let (twist, heading) =
                (random_twist(&mut random, 3.0), Radians::new(random.within(7.0)));
            near(twist.out_of_frame(heading).into_frame(heading), twist, 1e-5);
        }
    }

    #[test]
    fn the_acceleration_is_never_exceeded_and_the_change_is_straight() {
        let limits = TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 };
        let (mut random, mut limiter) = (Random(13), TwistLimiter::<RobotFrame>::new());
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
        let limits = TwistLimits { linear_m_s2: 5.0, angular_rad_s2: 10.0 };
        let mut limiter = TwistLimiter::<FieldFrame>::new();
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
        let limits = TwistLimits { linear_m_s2: 5.0, angular_rad_s2: 10.0 };
        let mut limiter = TwistLimiter::<RobotFrame>::new();
        let measured = Twist::new(1.0, 0.5, -1.0);
        limiter.reset(measured);
        assert_eq!(limiter.twist(), measured);
        let before = limiter;
        for bad in [f32::NAN, f32::INFINITY] {
            assert!(limiter.update(&limits, Twist::new(bad, 0.0, 0.0), DT).is_err());
            assert!(limiter.update(&limits, Twist::new(0.0, 0.0, bad), DT).is_err());
            limiter.reset(Twist::new(0.0, bad, 0.0));
            limiter.reset(Twist::new(bad, 0.0, 0.0));
            limiter.reset(Twist::new(0.0, 0.0, bad));
        }
        assert!(limiter.update(&limits, Twist::new(f32::MAX, f32::MAX, 0.0), DT).is_err());
        for dt in [0.0, -0.001, f32::NAN, f32::INFINITY] {
            assert_eq!(limiter.update(&limits, Twist::STOP, Seconds::new(dt)), Ok(before.twist()));
        }
        let broken = TwistLimits { linear_m_s2: f32::NAN, angular_rad_s2: -1.0 };
        assert_eq!(limiter.update(&broken, Twist::STOP, DT), Ok(before.twist()));
        assert_eq!(limiter, before);
    }

    #[test]
    fn limits_are_checked() {
        let limits =
            |linear_m_s2, angular_rad_s2| TwistLimits { linear_m_s2, angular_rad_s2 }.validate();
        assert_eq!(limits(3.0, 10.0), Ok(()));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(limits(bad, 1.0).unwrap_err().field, "linear_m_s2");
            assert_eq!(limits(1.0, bad).unwrap_err().field, "angular_rad_s2");
        }
    }
}
