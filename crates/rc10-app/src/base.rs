//! Bases on wheels: mecanum, omni, differential, and any other list, by the same mathematics.
//!
//! Each [`Wheel`] makes one row of a matrix: the speed of its rim for a [`Twist`]. [`Base::inverse`]
//! multiplies by that matrix, [`Base::forward`] by its least-squares inverse. Both are solved where
//! the base is declared; on the chip there are only products and sums.

mod error;
mod solve;
mod wheel;

pub use error::BaseError;
pub use wheel::{Tread, Wheel};

use core::f64::consts::PI;

use crate::config::{ConfigError, positive};
use crate::ok;
use crate::twist::{Twist, TwistLimits, TwistNotFinite};
use crate::units::{Degrees, NewtonMetres, Rpm, RpmPerSecond};

/// Radians per second in one revolution per minute.
const RADIANS_PER_SECOND: f64 = PI / 30.0;

/// A base on `N` wheels.
///
/// In a robot's table it is a constant, and one that cannot work does not compile:
///
/// ```
/// use rc10_app::{Base, Rpm, Twist};
/// pub const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
///
/// let wheels = BASE.inverse(Twist::new(5.0, 0.0, 0.0))?;
/// assert!((wheels.speeds[0].get() - 450.0).abs() < 1e-3); // 628 rpm would be needed
/// assert!((wheels.scale - 0.716).abs() < 1e-3);
///
/// let motion = BASE.forward([Rpm::new(100.0); 4]);
/// assert!((motion.twist.vx - 0.796).abs() < 1e-3 && motion.slip() < 1e-6);
/// # Ok::<(), rc10_app::TwistNotFinite>(())
/// ```
///
/// ```compile_fail,E0080
/// # use rc10_app::{Base, Degrees, Rpm, base::{Tread, Wheel}};
/// # const WHEEL: Wheel = *Base::differential(0.05, 0.2, Rpm::new(400.0)).wheels().first().unwrap();
/// const ACROSS: Wheel = Wheel { direction: Degrees::new(90.0), ..WHEEL };
/// // wheels 0 and 1 have no rollers and do not roll in parallel: they drag each other sideways
/// const BASE: Base<2> = Base::sound([WHEEL, ACROSS], Rpm::new(400.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Base<const N: usize> {
    wheels: [Wheel; N],
    max_wheel_speed: Rpm,
    /// rpm of each wheel for (vx, vy, wz).
    inverse: [[f32; 3]; N],
    /// (vx, vy, wz) of 1 rpm of each wheel.
    forward: [[f32; 3]; N],
    /// m/s at the rim for 1 rpm.
    rim: [f32; N],
    /// The row of the sideways speed that plain wheels refuse; zero without any.
    sideways: [f32; 3],
}

/// The body of a robot, all that moves with it included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass_kg: f32,
    /// Inertia about the vertical axis through the middle, kg m²; of a box mass · (`l`² + `w`²) / 12.
    pub yaw_inertia_kg_m2: f32,
}

/// Wheel speeds from [`Base::inverse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSpeeds<const N: usize> {
    /// Each within ± the base's limit.
    pub speeds: [Rpm; N],
    /// The share of the twist: 1 unless a wheel had to be limited. Direction and radius are kept.
    pub scale: f32,
}

/// A motion measured by its wheels, from [`Base::forward`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseMotion<const N: usize> {
    /// The motion that explains the wheels' speeds best.
    pub twist: Twist,
    /// Each rim's speed that the motion does not explain, in m/s: measured less explained.
    pub residual: [f32; N],
}

impl<const N: usize> BaseMotion<N> {
    /// The largest residual, in m/s: 0 if the wheels agree. NaN if a speed was not finite.
    ///
    /// It shows a wheel that is reversed, dead or slips, if the base has more wheels than ways to
    /// move: **not** with three omni wheels or a differential base, where a gyro tells, as
    /// [`Odometry`](crate::Odometry) has it. Nor while the wrong speeds make a motion: a dead wheel
    /// at rest.
    #[must_use]
    pub fn slip(&self) -> f32 {
        self.residual.iter().fold(0.0, |most, one| {
            // The comparison is false for NaN on either side.
            if one.abs() <= most { most } else { most + (one.abs() - most) }
        })
    }
}

impl Base<4> {
    /// Four mecanum wheels: front left, front right, rear left, rear right, their rollers an X from
    /// above. A positive speed drives forward. (Reverse mirrored motors where they are configured.)
    ///
    /// Radius over the rollers, half the wheelbase, half the distance of left and right: metres.
    /// Panics like [`sound`](Base::sound).
    pub const fn mecanum(
        radius: f32,
        half_wheelbase: f32,
        half_track: f32,
        max_wheel_speed: Rpm,
    ) -> Self {
        Self::sound(wheel::mecanum(radius, half_wheelbase, half_track), max_wheel_speed)
    }

    /// Four omni wheels counter-clockwise, the first 45 degrees to the left of ahead, at this
    /// `distance` from the middle. A positive speed of all turns the base counter-clockwise. Radius
    /// and distance in metres. Panics like [`sound`](Base::sound).
    pub const fn omni_4(radius: f32, distance: f32, max_wheel_speed: Rpm) -> Self {
        Self::sound(wheel::ring(radius, distance, Degrees::new(45.0)), max_wheel_speed)
    }
}

impl Base<3> {
    /// Three omni wheels counter-clockwise, the first 60 degrees to the left of ahead, so that the
    /// second is at the rear. Arguments and panics as those of [`omni_4`](Base::omni_4).
    pub const fn omni_3(radius: f32, distance: f32, max_wheel_speed: Rpm) -> Self {
        Self::sound(wheel::ring(radius, distance, Degrees::new(60.0)), max_wheel_speed)
    }
}

impl Base<2> {
    /// Two plain wheels on one axle through the origin. Radius and half their distance in metres.
    /// Panics like [`sound`](Base::sound).
    pub const fn differential(radius: f32, half_track: f32, max_wheel_speed: Rpm) -> Self {
        Self::sound(wheel::pair(radius, half_track), max_wheel_speed)
    }
}

impl<const N: usize> Base<N> {
    /// A base on these wheels, none of which is ever asked to turn faster than `max_wheel_speed`.
    ///
    /// # Errors
    /// Wheels that make no base: a bad number, plain wheels not in parallel, a free motion.
    pub const fn new(wheels: [Wheel; N], max_wheel_speed: Rpm) -> Result<Self, BaseError> {
        if let Err(error) = positive("max_wheel_speed", max_wheel_speed.get()) {
            return Err(BaseError::Config(error));
        }
        let solution = ok!(solve::solve(&wheels));
        let mut base = Self {
            wheels,
            max_wheel_speed,
            inverse: [[0.0; 3]; N],
            forward: [[0.0; 3]; N],
            rim: [0.0; N],
            sideways: narrow(solution.refused.0, 1.0),
        };
        let mut at = 0;
        while at < N {
            let rim = wheels[at].radius as f64 * RADIANS_PER_SECOND;
            base.inverse[at] = narrow(solution.inverse[at], 1.0 / rim);
            base.forward[at] = narrow(solution.forward[at], rim);
            #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
            let rim = rim as f32;
            base.rim[at] = rim;
            at += 1;
        }
        Ok(base)
    }

    /// Like [`new`](Self::new), but panics: in a constant, an unsound base does not compile.
    pub const fn sound(wheels: [Wheel; N], max_wheel_speed: Rpm) -> Self {
        match Self::new(wheels, max_wheel_speed) {
            Ok(base) => base,
            Err(error) => panic!("{}", error.text().as_str()),
        }
    }

    /// The wheels, as they were given.
    #[must_use]
    pub const fn wheels(&self) -> &[Wheel; N] {
        &self.wheels
    }

    /// No wheel is ever asked to turn faster than this.
    #[must_use]
    pub const fn max_wheel_speed(&self) -> Rpm {
        self.max_wheel_speed
    }

    /// rpm of each wheel for (vx, vy, wz).
    pub(crate) const fn rows(&self) -> &[[f32; 3]; N] {
        &self.inverse
    }

    /// The wheel speeds for `twist`. If a wheel would be too fast, all are slowed down by one
    /// factor: the way stays. Plain wheels leave the part out that [`sideways`](Self::sideways)
    /// tells.
    ///
    /// # Errors
    /// [`TwistNotFinite`] if the twist, or a wheel speed computed from it, is infinite or NaN.
    pub fn inverse(&self, twist: Twist) -> Result<WheelSpeeds<N>, TwistNotFinite> {
        let mut speeds = [Rpm::ZERO; N];
        let limit = self.max_wheel_speed.get();
        let scale = match (self.inverse.as_slice().try_into(), speeds.as_mut_slice().try_into()) {
            (Ok(rows), Ok(speeds)) => four(rows, limit, twist, speeds),
            _ => limited(&self.inverse, limit, twist, &mut speeds),
        };
        let wheels = scale.map(|scale| WheelSpeeds { speeds, scale });
        wheels.ok_or(TwistNotFinite::of(twist))
    }

    /// The part of `twist` that plain wheels cannot do and [`inverse`](Self::inverse) leaves out:
    /// m/s to the left of the first one's rolling; 0 without plain wheels.
    #[must_use]
    pub fn sideways(&self, twist: Twist) -> f32 {
        product(self.sideways, twist)
    }

    /// The accelerations of the wheels while the twist in the robot's axes changes by `change` a
    /// second: a constant twist in the field's axes changes too while the robot turns.
    #[must_use]
    pub fn accelerations(&self, change: Twist) -> [RpmPerSecond; N] {
        self.inverse.map(|row| RpmPerSecond::new(product(row, change)))
    }

    /// The torques of the wheels that accelerate the robot's body while its `twist`, in its own axes,
    /// changes by `change` a second. They come on top of what the wheels' own inertia takes. Where more
    /// wheels push than there are ways to move, none pushes against another.
    ///
    /// By virtual work: the power of the torques at the wheels is that of the forces on the body.
    #[must_use]
    pub fn torques(&self, body: &Body, twist: Twist, change: Twist) -> [NewtonMetres; N] {
        // The axes turn with the robot.
        let x = body.mass_kg * (change.vx - twist.wz * twist.vy);
        let y = body.mass_kg * (change.vy + twist.wz * twist.vx);
        let turn = body.yaw_inertia_kg_m2 * change.wz;
        #[expect(clippy::cast_possible_truncation, reason = "a constant")]
        const RPM: f32 = (1.0 / RADIANS_PER_SECOND) as f32;
        self.forward.map(|row| NewtonMetres::new(product(row, Twist::new(x, y, turn)) * RPM))
    }

    /// The motion for measured speeds of the wheels, by least squares in m/s at the rims, and what
    /// it leaves unexplained. Speeds that are not finite give such a twist.
    ///
    /// **Which wheel** is wrong, the residual of four does not tell. A reversed wheel is the one
    /// that, turned round, leaves no residual for any motion; a dead or slipping one differs from
    /// its speed asked for.
    #[must_use]
    pub fn forward(&self, speeds: [Rpm; N]) -> BaseMotion<N> {
        let mut twist = Twist::STOP;
        for ([vx, vy, wz], speed) in self.forward.into_iter().zip(speeds) {
            twist = twist + Twist::new(vx, vy, wz) * speed.get();
        }
        let mut residual = [0.0; N];
        for (at, residual) in residual.iter_mut().enumerate() {
            *residual = (speeds[at].get() - product(self.inverse[at], twist)) * self.rim[at];
        }
        BaseMotion { twist, residual }
    }

    /// Whether wheels accelerating by `most` keep these limits in every direction, both at once.
    ///
    /// # Errors
    /// The acceleration that a wheel would need, if it is more; or the limit that cannot be used.
    pub const fn validate_limits(
        &self,
        limits: &TwistLimits,
        most: RpmPerSecond,
    ) -> Result<(), ConfigError> {
        ok!(limits.validate());
        let mut at = 0;
        while at < N {
            let [x, y, turn] = self.inverse[at];
            let along = solve::sqrt(x as f64 * x as f64 + y as f64 * y as f64);
            let linear = along * limits.linear_m_s2 as f64;
            let angular = turn.abs() as f64 * limits.angular_rad_s2 as f64;
            #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
            let needed = (linear + angular) as f32;
            let is_kept = needed <= most.get();
            let must_be = "within what the wheels accelerate by";
            ok!(ConfigError::check(is_kept, "wheel acceleration, rpm/s", needed, must_be));
            at += 1;
        }
        Ok(())
    }
}

/// Below one by four roundings, so that the fastest wheel does not exceed its limit.
const BELOW_ONE: f32 = 1.0 - 2.0 * f32::EPSILON;

/// Wheel speeds for `twist` within `limit`, and their share; `None` if they are not finite.
#[inline(always)]
fn limited<const N: usize>(
    rows: &[[f32; 3]; N],
    limit: f32,
    twist: Twist,
    speeds: &mut [Rpm; N],
) -> Option<f32> {
    let wanted = rows.map(|row| product(row, twist));
    // Sizes are ordered as their bits are; infinity and NaN are above all finite ones.
    let mut fastest = 0;
    for size in wanted.map(|speed| speed.abs().to_bits()) {
        fastest = if size > fastest { size } else { fastest };
    }
    if fastest <= limit.to_bits() {
        *speeds = wanted.map(Rpm::new);
        return Some(1.0);
    }
    if fastest >= f32::INFINITY.to_bits() {
        return None;
    }
    let scale = limit / f32::from_bits(fastest) * BELOW_ONE;
    *speeds = wanted.map(|speed| Rpm::new(speed * scale));
    Some(scale)
}

/// [`limited`] for four wheels: not generic, so compiled for speed with this crate.
fn four(rows: &[[f32; 3]; 4], limit: f32, twist: Twist, speeds: &mut [Rpm; 4]) -> Option<f32> {
    limited(rows, limit, twist, speeds)
}

fn product([x, y, turn]: [f32; 3], twist: Twist) -> f32 {
    x * twist.vx + y * twist.vy + turn * twist.wz
}

const fn narrow([x, y, turn]: [f64; 3], factor: f64) -> [f32; 3] {
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
    return [(x * factor) as f32, (y * factor) as f32, (turn * factor) as f32];
}
