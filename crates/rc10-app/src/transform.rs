//! Planar rigid transforms, SE(2), whose frames do not mix.
//!
//! Frames are right-handed: x forward, y left, heading counter-clockwise from x. A [`Pose`] of a
//! frame B in a frame A takes coordinates in B to coordinates in A. Frames are types, so a pose of
//! B in A composes with a pose of something in B and with nothing else, and a point on the field
//! is not taken for a point that the robot sees. They cost nothing at run time.
//!
//! ```
//! use rc10_app::{Frame, Point, Pose, Radians, RobotFrame};
//! /// A camera on the robot: a frame is a type with nothing in it.
//! #[derive(Clone, Copy, Debug, Default, PartialEq)]
//! struct Camera;
//! impl Frame for Camera {}
//!
//! let robot: Pose = Pose::new(2.0, 1.0, Radians::new(0.0)); // of the robot in the field
//! let camera: Pose<Camera, RobotFrame> = Pose::new(0.3, 0.0, Radians::new(0.0));
//! let ball: Point<Camera> = Point::new(1.0, 0.0);
//! let on_field = robot.compose(camera).apply(ball); // a Point<FieldFrame>
//! assert!((on_field.x - 3.3).abs() < 1e-6);
//! ```
//!
//! Composed the wrong way round, they do not compile:
//!
//! ```compile_fail,E0308
//! # use rc10_app::{Frame, Pose, Radians, RobotFrame};
//! # #[derive(Clone, Copy, Debug, Default, PartialEq)]
//! # struct Camera;
//! # impl Frame for Camera {}
//! let robot: Pose = Pose::new(2.0, 1.0, Radians::new(0.0));
//! let camera: Pose<Camera, RobotFrame> = Pose::new(0.3, 0.0, Radians::new(0.0));
//! camera.compose(robot);
//! ```
//!
//! Nor does a point of the field where the robot's are wanted:
//!
//! ```compile_fail,E0308
//! # use rc10_app::{FieldFrame, Point, Pose, Radians};
//! let robot: Pose = Pose::new(2.0, 1.0, Radians::new(0.0));
//! let goal: Point<FieldFrame> = Point::new(5.0, 0.0);
//! robot.apply(goal);
//! ```

use core::fmt;
use core::marker::PhantomData;

use crate::angle::shortest_way_f32;
use crate::config::{ConfigError, within_robot};
use crate::maths;
use crate::ok;
use crate::units::Radians;

/// A frame of reference, as a type: its origin and its axes.
pub trait Frame: Copy + fmt::Debug + Default + PartialEq {}

/// The field's frame, which stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FieldFrame;

/// The robot's frame: x is where it looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RobotFrame;

impl Frame for FieldFrame {}
impl Frame for RobotFrame {}

/// A point in the coordinates of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct Point<F: Frame = FieldFrame> {
    /// Along x, in metres.
    pub x: f32,
    /// Along y, in metres.
    pub y: f32,
    frame: PhantomData<F>,
}

impl<F: Frame> Point<F> {
    /// Metres along x and y.
    pub const fn new(x: f32, y: f32) -> Self {
        Self { x, y, frame: PhantomData }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(within_robot("x", self.x), in "place");
        ok!(within_robot("y", self.y), in "place");
        Ok(())
    }
}

/// Position and heading of the frame `Of` in the frame `In`; by default the robot in the field.
///
/// ```
/// use core::f32::consts::FRAC_PI_2;
/// use rc10_app::{Point, Pose, Radians};
/// // The robot stands at (2, 1) and looks along the field's y axis; a ball lies 3 m ahead of it.
/// let robot: Pose = Pose::new(2.0, 1.0, Radians::new(FRAC_PI_2));
/// let ball = robot.apply(Point::new(3.0, 0.0));
/// assert!((ball.x - 2.0).abs() < 1e-6 && (ball.y - 4.0).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct Pose<Of: Frame = RobotFrame, In: Frame = FieldFrame> {
    /// Position along x, in metres.
    pub x: f32,
    /// Position along y, in metres.
    pub y: f32,
    /// Heading, counter-clockwise from the x axis. What this file computes is within −π ..= π.
    pub heading: Radians,
    frames: PhantomData<(Of, In)>,
}

impl<Of: Frame, In: Frame> Pose<Of, In> {
    /// A frame that coincides with the one it is given in.
    pub const IDENTITY: Self = Self::new(0.0, 0.0, Radians::new(0.0));

    /// A position in metres and a heading.
    pub const fn new(x: f32, y: f32, heading: Radians) -> Self {
        Self { x, y, heading, frames: PhantomData }
    }

    /// The origin of the frame, which is its position.
    pub const fn origin(self) -> Point<In> {
        Point::new(self.x, self.y)
    }

    /// The pose in A of what has the pose `inner` in B, if `self` is the pose of B in A.
    /// [`IDENTITY`](Self::IDENTITY) on either side changes nothing, not even a bit.
    pub fn compose<Inner: Frame>(self, inner: Pose<Inner, Of>) -> Pose<Inner, In> {
        let Point { x, y, .. } = self.apply(inner.origin());
        Pose::new(x, y, wrapped(self.heading + inner.heading))
    }

    /// The pose of A in B, if `self` is the pose of B in A.
    pub fn inverse(self) -> Pose<In, Of> {
        let (x, y) = rotate((-self.x, -self.y), -self.heading);
        Pose::new(x, y, wrapped(-self.heading))
    }

    /// The pose of `other` as seen from here, both in one frame: `self.compose(result)` is `other`.
    pub fn between<Other: Frame>(self, other: Pose<Other, In>) -> Pose<Other, Of> {
        // Not inverse().compose(): the difference first keeps the digits when both are far away.
        let (x, y) = rotate((other.x - self.x, other.y - self.y), -self.heading);
        Pose::new(x, y, wrapped(other.heading - self.heading))
    }

    /// Takes a point from this frame to the one the pose is given in.
    pub fn apply(self, point: Point<Of>) -> Point<In> {
        let (x, y) = rotate((point.x, point.y), self.heading);
        Point::new(self.x + x, self.y + y)
    }
}

/// Turns a vector (x, y) counter-clockwise.
pub(crate) fn rotate((x, y): (f32, f32), by: Radians) -> (f32, f32) {
    let (sin, cos) = maths::sin_cos(by.get());
    (x * cos - y * sin, x * sin + y * cos)
}

/// The same direction within −π ..= π.
fn wrapped(angle: Radians) -> Radians {
    Radians::new(shortest_way_f32(0.0, angle.get(), core::f32::consts::TAU))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use core::f32::consts::{FRAC_PI_2, PI};

    /// A small repeatable generator (`SplitMix64`).
    pub(crate) struct Random(pub(crate) u64);

    impl Random {
        /// A number within −`size` .. `size`.
        pub(crate) fn within(&mut self, size: f32) -> f32 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut bits = self.0;
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            let top = u16::try_from((bits ^ (bits >> 31)) >> 48).unwrap();
            size * (f32::from(top) / 32768.0 - 1.0)
        }

        fn pose(&mut self) -> Pose<FieldFrame> {
            Pose::new(self.within(12.0), self.within(12.0), Radians::new(self.within(PI)))
        }
    }

    #[track_caller]
    fn near(actual: Pose<FieldFrame>, expected: Pose<FieldFrame>) {
        let angle = wrapped(actual.heading - expected.heading).get();
        let distance = maths::hypot(actual.x - expected.x, actual.y - expected.y);
        assert!(distance < 2e-5 && angle.abs() < 2e-6, "{actual:?} is not {expected:?}");
    }

    #[test]
    fn identity_laws_are_exact() {
        let mut random = Random(1);
        for _ in 0..1000 {
            let pose = random.pose();
            assert_eq!(Pose::IDENTITY.compose(pose), pose);
            assert_eq!(pose.compose(Pose::IDENTITY), pose);
            assert_eq!(Pose::IDENTITY.between(pose), pose);
            assert_eq!(pose.between(pose), Pose::IDENTITY);
            assert_eq!(Pose::IDENTITY.apply(pose.origin()), pose.origin());
        }
        assert_eq!(Pose::<RobotFrame>::IDENTITY.inverse(), Pose::IDENTITY);
        assert_eq!(Pose::<RobotFrame>::default(), Pose::IDENTITY);
    }

    #[test]
    fn group_laws_hold_for_random_poses() {
        let mut random = Random(2);
        for _ in 0..1000 {
            let (a, b, c) = (random.pose(), random.pose(), random.pose());
            near(a.compose(b).compose(c), a.compose(b.compose(c)));
            near(a.compose(a.inverse()), Pose::IDENTITY);
            near(a.inverse().compose(a), Pose::IDENTITY);
            near(a.inverse().inverse(), a);
            near(a.compose(a.between(b)), b);
            near(a.between(b), a.inverse().compose(b));
            near(a.compose(b).inverse(), b.inverse().compose(a.inverse()));
        }
    }

    #[test]
    fn composing_is_applying_one_after_the_other_and_keeps_distances() {
        let mut random = Random(3);
        for _ in 0..1000 {
            let (a, b, c) = (random.pose(), random.pose(), random.pose());
            let (p, q) = (b.origin(), c.origin());
            let distance = |p: Point, q: Point| maths::hypot(p.x - q.x, p.y - q.y);
            assert!(distance(a.compose(b).apply(q), a.apply(b.apply(q))) < 2e-5);
            assert!((distance(p, q) - distance(a.apply(p), a.apply(q))).abs() < 2e-5);
        }
    }

    #[test]
    fn a_quarter_turn_is_counter_clockwise() {
        let robot = Pose::<FieldFrame>::new(1.0, 2.0, Radians::new(FRAC_PI_2));
        let Point { x, y, .. } = robot.apply(Point::new(1.0, 0.0));
        assert!((x - 1.0).abs() < 1e-6 && (y - 3.0).abs() < 1e-6);
        // What is on the field at (0, 2) is 1 m to its left.
        near(
            robot.between(Pose::new(0.0, 2.0, Radians::new(0.0))),
            Pose::new(0.0, 1.0, Radians::new(-FRAC_PI_2)),
        );
    }

    #[test]
    fn headings_stay_within_half_a_turn() {
        let quarter = Pose::new(0.0, 0.0, Radians::new(FRAC_PI_2));
        let mut pose = Pose::IDENTITY;
        for _ in 0..1000 {
            pose = pose.compose(quarter);
            assert!(pose.heading.get().abs() <= PI);
        }
        near(pose, Pose::IDENTITY);
        let turned = |heading| Pose::<FieldFrame>::new(0.0, 0.0, Radians::new(heading));
        let (a, b) = (turned(-3.0), turned(3.0));
        near(a.between(b), Pose::new(0.0, 0.0, Radians::new(6.0 - 2.0 * PI)));
        assert!(a.between(b).heading.get().abs() <= PI);
        assert!(turned(4.0).inverse().heading.get().abs() <= PI);
    }
}
