//! Planar rigid transforms, SE(2): where something is on the field and which way it looks.
//!
//! Frames are right-handed: x forward, y left, heading counter-clockwise from x. A [`Pose`] of a
//! frame B in a frame A takes coordinates in B to coordinates in A.

use crate::angle::shortest_way_f32;
use crate::maths;
use crate::units::Radians;

/// Position and heading of one frame in another.
///
/// ```
/// use core::f32::consts::FRAC_PI_2;
/// use rc10_app::{Radians, transform::Pose};
/// // The robot stands at (2, 1) and looks along the field's y axis; a ball lies 3 m ahead of it.
/// let robot = Pose::new(2.0, 1.0, Radians::new(FRAC_PI_2));
/// let (x, y) = robot.apply((3.0, 0.0));
/// assert!((x - 2.0).abs() < 1e-6 && (y - 4.0).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position along x, in metres.
    pub x: f32,
    /// Position along y, in metres.
    pub y: f32,
    /// Heading, counter-clockwise from the x axis. What this file computes is within −π ..= π.
    pub heading: Radians,
}

impl Pose {
    /// A frame that coincides with the one it is given in.
    pub const IDENTITY: Self = Self::new(0.0, 0.0, Radians::new(0.0));

    /// A position in metres and a heading.
    pub const fn new(x: f32, y: f32, heading: Radians) -> Self {
        Self { x, y, heading }
    }

    /// The pose in A of what has the pose `inner` in B, if `self` is the pose of B in A.
    /// [`IDENTITY`](Self::IDENTITY) on either side changes nothing, not even a bit.
    #[must_use]
    pub fn compose(self, inner: Self) -> Self {
        let (x, y) = self.apply((inner.x, inner.y));
        Self::new(x, y, wrapped(self.heading + inner.heading))
    }

    /// The pose of A in B, if `self` is the pose of B in A.
    #[must_use]
    pub fn inverse(self) -> Self {
        let (x, y) = rotate((-self.x, -self.y), -self.heading);
        Self::new(x, y, wrapped(-self.heading))
    }

    /// The pose of `other` as seen from here, both given in one common frame:
    /// `self.compose(result)` is `other`.
    #[must_use]
    pub fn between(self, other: Self) -> Self {
        // Not inverse().compose(): the difference first keeps the digits when both are far away.
        let (x, y) = rotate((other.x - self.x, other.y - self.y), -self.heading);
        Self::new(x, y, wrapped(other.heading - self.heading))
    }

    /// Takes a point, in metres, from this frame to the one the pose is given in.
    #[must_use]
    pub fn apply(self, point: (f32, f32)) -> (f32, f32) {
        let (x, y) = rotate(point, self.heading);
        (self.x + x, self.y + y)
    }
}

/// Turns a vector (x, y) counter-clockwise.
pub fn rotate((x, y): (f32, f32), by: Radians) -> (f32, f32) {
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

        fn pose(&mut self) -> Pose {
            Pose::new(self.within(12.0), self.within(12.0), Radians::new(self.within(PI)))
        }
    }

    #[track_caller]
    fn near(actual: Pose, expected: Pose) {
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
            assert_eq!(Pose::IDENTITY.apply((pose.x, pose.y)), (pose.x, pose.y));
        }
        assert_eq!(Pose::IDENTITY.inverse(), Pose::IDENTITY);
        assert_eq!(Pose::default(), Pose::IDENTITY);
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
            let (p, q) = ((b.x, b.y), (c.x, c.y));
            let (at_once, in_turn) = (a.compose(b).apply(q), a.apply(b.apply(q)));
            assert!(maths::hypot(at_once.0 - in_turn.0, at_once.1 - in_turn.1) < 2e-5);
            let (moved_p, moved_q) = (a.apply(p), a.apply(q));
            let before = maths::hypot(p.0 - q.0, p.1 - q.1);
            let after = maths::hypot(moved_p.0 - moved_q.0, moved_p.1 - moved_q.1);
            assert!((before - after).abs() < 2e-5);
        }
    }

    #[test]
    fn a_quarter_turn_is_counter_clockwise() {
        let robot = Pose::new(1.0, 2.0, Radians::new(FRAC_PI_2));
        let (x, y) = robot.apply((1.0, 0.0));
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
        let (a, b) =
            (Pose::new(0.0, 0.0, Radians::new(-3.0)), Pose::new(0.0, 0.0, Radians::new(3.0)));
        near(a.between(b), Pose::new(0.0, 0.0, Radians::new(6.0 - 2.0 * PI)));
        assert!(a.between(b).heading.get().abs() <= PI);
        assert!(Pose::new(0.0, 0.0, Radians::new(4.0)).inverse().heading.get().abs() <= PI);
    }
}
