//! What a base is made of: a body, and wheels of any kind.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The body and its wheels, in SI units. x is forward, y is left, yaw is counter-clockwise.
///
/// ```
/// use rc10_sim::Chassis;
/// // Three omni wheels of 127 mm, 0.25 m from the middle, under 12 kg.
/// let base = Chassis::omni(3, 0.0635, 0.25).with_mass(12.0);
/// assert_eq!(base.wheels.len(), 3);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct Chassis {
    /// kg, all included.
    pub mass: f64,
    /// kg·m² about the vertical axis through the middle, where the centre of mass is.
    pub yaw_inertia: f64,
    /// Largest force of a wheel along its rolling direction, as a fraction of its load: the
    /// coefficient of friction between its tread and the floor. (Of a mecanum wheel the coefficient as
    /// measured that way: between its rollers and the floor it is higher, by the slant of their axes.)
    pub grip: f64,
    /// Force per slip speed of a wheel that does not slide, N·s/m. Reduced where the physics step
    /// is too long for it.
    pub stiffness: f64,
    /// Rolling resistance as a fraction of the wheel's load.
    pub rolling_resistance: f64,
    /// The wheels, of which each carries the same load.
    pub wheels: Vec<Wheel>,
    /// Castors, which carry as much each, and make no force.
    pub castors: usize,
}

/// A wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheel {
    /// From the middle of the base to it, forward, m.
    pub x: f64,
    /// The same to the left, m.
    pub y: f64,
    /// The direction in which it rolls when it turns forward, rad counter-clockwise from ahead; of a
    /// steered wheel at the angle at which its motor starts.
    pub direction: f64,
    /// The tread, which grips.
    pub tread: Tread,
    /// m.
    pub radius: f64,
    /// About its axle, kg·m².
    pub inertia: f64,
    /// The gear that steers it, if a second motor does.
    pub steering: Option<Steering>,
}

/// Treads of wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tread {
    /// A plain wheel: along its rolling direction and across it, together never more than its grip.
    Plain,
    /// Rollers, which roll freely: only along their axes.
    Rollers {
        /// Tangent of the angle from the wheel's rolling direction to the axis of the roller on the
        /// floor, counter-clockwise: 0 of an omni wheel, 1 or -1 of a mecanum wheel's 45 degrees.
        slant: f64,
    },
}

/// The gear that turns a wheel about its vertical axis, above the point where it stands. What it does
/// to the body, by its acceleration and its friction on the floor, is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steering {
    /// Turns of the motor's output shaft per turn of the wheel about its vertical axis; negative if it
    /// turns the other way.
    pub gear: f64,
    /// Inertia of the fork with its wheel about that axis, kg·m².
    pub inertia: f64,
    /// Radius of the patch that stands on the floor, m. It scrubs with `2/3 · grip · load · radius`, a
    /// disc under even pressure; also while the wheel rolls, which is more than a real one does.
    pub patch: f64,
}

impl Default for Steering {
    /// One to one; our estimates.
    fn default() -> Self {
        Self { gear: 1.0, inertia: 2e-3, patch: 0.008 }
    }
}

impl Wheel {
    /// A plain wheel that rolls ahead; inertia as of the wheels of [`Chassis::default`].
    pub const fn plain(x: f64, y: f64, radius: f64) -> Self {
        let (direction, tread, inertia) = (0.0, Tread::Plain, 1.5e-3);
        Self { x, y, direction, tread, radius, inertia, steering: None }
    }

    /// The rolling direction, and the way to its left, for a wheel that is steered by an angle, rad.
    pub(crate) fn axes(&self, steered: f64) -> [[f64; 2]; 2] {
        let (sin, cos) = (self.direction + steered).sin_cos();
        [[cos, sin], [-sin, cos]]
    }
}

impl Default for Chassis {
    /// A Robocon base of 20 kg on four mecanum wheels of 152 mm: our estimate.
    fn default() -> Self {
        Self::mecanum(0.076, 0.20, 0.22)
    }
}

impl Chassis {
    /// The body of [`Chassis::default`] on these wheels.
    pub const fn on(wheels: Vec<Wheel>) -> Self {
        Self {
            mass: 20.0,
            yaw_inertia: 1.2,
            grip: 0.6,
            stiffness: 1000.0,
            rolling_resistance: 0.015,
            wheels,
            castors: 0,
        }
    }

    /// On four mecanum wheels whose rollers form an X when seen from above: front left, front right,
    /// rear left, rear right. `half_length` and `half_width` are from the middle to an axle and to a
    /// wheel, m.
    pub fn mecanum(radius: f64, half_length: f64, half_width: f64) -> Self {
        let slants = [-1.0, 1.0, 1.0, -1.0];
        let places = corners(half_length, half_width).into_iter().zip(slants);
        let wheel = |([x, y], slant): ([f64; 2], f64)| Wheel {
            tread: Tread::Rollers { slant },
            ..Wheel::plain(x, y, radius)
        };
        Self::on(places.map(wheel).collect())
    }

    /// On `count` omni wheels, `distance` m from the middle, evenly around it: the first is half a step
    /// to the left of ahead, the others follow counter-clockwise. Turning forward, each of them turns
    /// the base counter-clockwise.
    pub fn omni(count: u8, radius: f64, distance: f64) -> Self {
        let wheel = |index: u8| {
            let at = PI / f64::from(count) + TAU * f64::from(index) / f64::from(count);
            Wheel {
                direction: at + FRAC_PI_2,
                tread: Tread::Rollers { slant: 0.0 },
                ..Wheel::plain(distance * at.cos(), distance * at.sin(), radius)
            }
        };
        Self::on((0..count).map(wheel).collect())
    }

    /// On two plain wheels, left and right, `track` m apart, and two castors.
    pub fn differential(radius: f64, track: f64) -> Self {
        let wheels = [0.5, -0.5].map(|side| Wheel::plain(0.0, side * track, radius));
        Self { castors: 2, ..Self::on(wheels.into()) }
    }

    /// On four plain wheels, each steered by a second motor: front left, front right, rear left, rear
    /// right. They look ahead at first.
    pub fn swerve(radius: f64, half_length: f64, half_width: f64, steering: Steering) -> Self {
        let wheel =
            |[x, y]: [f64; 2]| Wheel { steering: Some(steering), ..Wheel::plain(x, y, radius) };
        Self::on(corners(half_length, half_width).map(wheel).into())
    }

    /// The same with another mass, kg, which is spread as before: the yaw inertia grows with it.
    pub fn with_mass(self, mass: f64) -> Self {
        Self { mass, yaw_inertia: self.yaw_inertia * mass / self.mass, ..self }
    }

    /// Load of one wheel, N.
    pub(crate) fn wheel_load(&self) -> f64 {
        self.mass * super::GRAVITY / (self.wheels.len() + self.castors) as f64
    }
}

/// Front left, front right, rear left, rear right.
const fn corners(half_length: f64, half_width: f64) -> [[f64; 2]; 4] {
    let (x, y) = (half_length, half_width);
    [[x, y], [x, -y], [-x, y], [-x, -y]]
}
