//! One wheel of a base: where it stands, and how it touches the ground.

use crate::transform::{Point, RobotFrame};
use crate::units::{Degrees, Direction};

/// The part of a wheel that touches the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tread {
    /// Rubber all round: the wheel rolls where it points, and does not slip sideways.
    Plain,
    /// Rollers that turn freely. The angle goes from the wheel's axle to the axis of the roller
    /// that touches the ground, seen from above, counter-clockwise positive: [`OMNI`](Self::OMNI)
    /// has 90 degrees, a mecanum wheel 45 or −45.
    ///
    /// The roller on the ground lies across the one on top, which is the one that is seen from
    /// above.
    Rollers(Degrees),
}

impl Tread {
    /// Rollers across the axle: the wheel pushes where it points, and slides freely along its axle.
    pub const OMNI: Self = Self::Rollers(Degrees::new(90.0));
}

/// A wheel of a [`Base`](super::Base).
///
/// ```
/// use rc10_app::{Degrees, Direction, Point, base::{Tread, Wheel}};
/// let front_left = Wheel {
///     place: Point::new(0.2, 0.25),
///     direction: Degrees::new(0.0),
///     tread: Tread::Rollers(Degrees::new(45.0)),
///     radius: 0.076,
///     turns: Direction::Forward,
/// };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheel {
    /// The point of contact, in metres.
    pub place: Point<RobotFrame>,
    /// Where it rolls forward, counter-clockwise from the robot's x axis.
    pub direction: Degrees,
    /// How it touches the ground.
    pub tread: Tread,
    /// Radius over its rollers, in metres; > 0.
    pub radius: f32,
    /// [`Direction::Reversed`] for a mirrored motor that is not reversed in its own configuration.
    pub turns: Direction,
}

/// A unit vector and the one a quarter of a turn counter-clockwise of it.
type Axes = ([f64; 2], [f64; 2]);

impl Wheel {
    /// Where it rolls, and its axle.
    pub(super) const fn axes(&self) -> Axes {
        let (sin, cos) = sin_cos_degrees(self.direction.get() as f64);
        ([cos, sin], [-sin, cos])
    }

    /// Sine of the angle between its rollers and its axle; 1 without rollers.
    pub(super) const fn grip(&self) -> f64 {
        match self.tread {
            Tread::Plain => 1.0,
            Tread::Rollers(angle) => sin_cos_degrees(angle.get() as f64).0.abs(),
        }
    }

    /// Speed of its rim, in m/s, by a twist (vx, vy, wz): the row of the base's matrix.
    ///
    /// The roller rolls across its axis `a`: along `a` the wheel's centre `v` moves as the rim,
    /// along `d`: `v · a = rim d · a`. (Lynch and Park, Modern Robotics, 2017, 13.2.1.)
    pub(super) const fn rim_row(&self) -> [f64; 3] {
        let ([x, y], _) = self.axes();
        let [x, y] = match self.tread {
            Tread::Plain => [x, y],
            Tread::Rollers(angle) => {
                let turned = self.direction.get() as f64 + angle.get() as f64 + 90.0;
                let (sin, cos) = sin_cos_degrees(turned);
                let along = x * cos + y * sin;
                [cos / along, sin / along]
            }
        };
        let sign = self.turns.sign() as f64;
        self.with_lever([sign * x, sign * y])
    }

    /// The row of the speed of its centre along `axis`.
    pub(super) const fn with_lever(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        [x, y, y * self.place.x as f64 - x * self.place.y as f64]
    }
}

/// Four mecanum wheels: front left, front right, rear left, rear right, rollers an X from above.
pub(super) const fn mecanum(radius: f32, half_wheelbase: f32, half_track: f32) -> [Wheel; 4] {
    let wheel = Wheel {
        place: Point::new(0.0, 0.0),
        direction: Degrees::ZERO,
        tread: Tread::Rollers(Degrees::new(45.0)),
        radius,
        turns: Direction::Forward,
    };
    let other = Wheel { tread: Tread::Rollers(Degrees::new(-45.0)), ..wheel };
    let (x, y) = (half_wheelbase, half_track);
    [
        Wheel { place: Point::new(x, y), ..wheel },
        Wheel { place: Point::new(x, -y), ..other },
        Wheel { place: Point::new(-x, y), ..other },
        Wheel { place: Point::new(-x, -y), ..wheel },
    ]
}

/// Omni wheels evenly on a circle, the first at `first`; each turns the base counter-clockwise.
pub(super) const fn ring<const N: usize>(radius: f32, distance: f32, first: Degrees) -> [Wheel; N] {
    let wheel = Wheel {
        place: Point::new(0.0, 0.0),
        direction: Degrees::ZERO,
        tread: Tread::OMNI,
        radius,
        turns: Direction::Forward,
    };
    let mut wheels = [wheel; N];
    let mut at = 0;
    while at < N {
        let angle = first.get() as f64 + 360.0 * at as f64 / N as f64;
        let (sin, cos) = sin_cos_degrees(angle);
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let (x, y) = ((distance as f64 * cos) as f32, (distance as f64 * sin) as f32);
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let direction = Degrees::new((angle + 90.0) as f32);
        wheels[at] = Wheel { place: Point::new(x, y), direction, ..wheel };
        at += 1;
    }
    wheels
}

/// A plain wheel on the left and one on the right that roll forward.
pub(super) const fn pair(radius: f32, half_track: f32) -> [Wheel; 2] {
    let left = Wheel {
        place: Point::new(0.0, half_track),
        direction: Degrees::ZERO,
        tread: Tread::Plain,
        radius,
        turns: Direction::Forward,
    };
    [left, Wheel { place: Point::new(0.0, -half_track), ..left }]
}

/// Sine and cosine of degrees, within 1e-15 for few turns; exact at quarter turns and opposites.
pub(super) const fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let mut rest = degrees % 360.0;
    let mut quarters = 0;
    while rest > 45.0 {
        (rest, quarters) = (rest - 90.0, quarters + 1);
    }
    while rest < -45.0 {
        (rest, quarters) = (rest + 90.0, quarters + 3);
    }
    let x = rest * (core::f64::consts::PI / 180.0);
    // Taylor's series: at π/4 the term of x^18 is 2e-18.
    let (mut sin, mut cos, mut n) = (1.0, 1.0, 18.0);
    while n > 0.0 {
        cos = 1.0 - x * x / (n * (n - 1.0)) * cos;
        sin = 1.0 - x * x / (n * (n + 1.0)) * sin;
        n -= 2.0;
    }
    sin *= x;
    match quarters % 4 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}
