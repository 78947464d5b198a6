//! Swerve bases: wheels that are steered, each by a motor of its own.
//!
//! A module turns the shorter way, a quarter turn at most where it is endless: its wheel then rolls
//! the other way. Until it is there the wheel rolls by the cosine of the remaining angle. Modules
//! of a standing robot stay as they are.

use core::f32::consts::PI;

use crate::angle::TotalAngle;
use crate::base::{BaseError, BaseMotion, Body};
use crate::config::{self, ConfigError, positive};
use crate::maths;
use crate::ok;
use crate::transform::{Point, RobotFrame};
use crate::twist::{Twist, TwistNotFinite};
use crate::units::{NewtonMetres, Rpm, RpmPerSecond};

/// Radians per second in one revolution per minute.
const RADIANS_PER_SECOND: f64 = core::f64::consts::PI / 30.0;
/// Millionths of a degree in a radian.
const MICRODEGREES: f32 = 180e6 / PI;
/// Revolutions per minute in 1 rad/s.
const RPM: f32 = 30.0 / PI;
/// Below this speed over the floor, m/s, the rate of its direction is not a module's to follow.
const SLOW: f32 = 0.3;
/// A slower rim, in m/s, stands and does not steer: a stick at rest gives less.
const STANDING: f32 = 1e-3;
const HALF_TURN: i64 = 180_000_000;

/// How far a module may be steered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steering {
    /// Any number of turns: a slip ring, or a motor inside.
    Endless,
    /// From one total angle to another, half a turn or more above it: its cables would tear.
    Between(TotalAngle, TotalAngle),
}

/// A swerve base of `N` modules of one kind.
///
/// Steering angles are total, counter-clockwise from above; at whole turns a wheel drives forward.
///
/// ```
/// use rc10_app::{Point, Rpm, Steering, Swerve, SwerveState, TotalAngle, Twist};
/// const BASE: Swerve<4> = Swerve::sound(
///     [Point::new(0.2, 0.2), Point::new(-0.2, 0.2), Point::new(-0.2, -0.2), Point::new(0.2, -0.2)],
///     0.05,
///     Rpm::new(450.0),
///     Steering::Endless,
/// );
/// let mut state = SwerveState::new();
/// let measured = [TotalAngle::from_degrees(350); 4];
/// let modules = state.update(&BASE, Twist::new(-1.0, 0.0, 0.0), measured)?;
/// // Not round to 180 degrees: ahead, and backwards.
/// let module = modules.modules[0];
/// assert!((module.angle.degrees().get() - 360.0).abs() < 1e-3 && module.speed < Rpm::ZERO);
/// # Ok::<(), rc10_app::TwistNotFinite>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swerve<const N: usize> {
    places: [Point<RobotFrame>; N],
    radius: f32,
    max_wheel_speed: Rpm,
    steering: Steering,
    /// rpm for 1 m/s at the rim, and the inverse.
    rpm: f32,
    rim: f32,
    /// The modules' middle, and 1 / sum of squares of their distances from it.
    middle: Point<RobotFrame>,
    inertia: f32,
}

/// Speed and angle that one module shall have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Module {
    /// Speed of its wheel.
    pub speed: Rpm,
    /// Steering angle, near the measured one.
    pub angle: TotalAngle,
}

/// Speeds and angles that all modules shall have, from [`SwerveState::update`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modules<const N: usize> {
    /// In the order of the places.
    pub modules: [Module; N],
    /// The share of the twist once all are steered: 1 unless a wheel had to be limited.
    pub scale: f32,
}

/// The motion that one module shall have now, from [`SwerveState::motions`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModuleMotion {
    /// The speed and the angle of the wheel.
    pub module: Module,
    /// Rate of its steering angle.
    pub turning: Rpm,
    /// Acceleration of its wheel.
    pub acceleration: RpmPerSecond,
    /// Torque of its wheel that accelerates the robot's body.
    pub torque: NewtonMetres,
}

impl<const N: usize> Swerve<N> {
    /// Modules at these places, with wheels of this radius in metres and at most `max_wheel_speed`.
    ///
    /// # Errors
    /// A bad number; modules in one place; a range of steering below half a turn.
    pub const fn new(
        places: [Point<RobotFrame>; N],
        radius: f32,
        max_wheel_speed: Rpm,
        steering: Steering,
    ) -> Result<Self, BaseError> {
        if let Err(error) = check(radius, max_wheel_speed, steering) {
            return Err(BaseError::Config(error));
        }
        let (mut x, mut y, mut at) = (0.0, 0.0, 0);
        while at < N {
            if let Err(error) = places[at].check() {
                return Err(BaseError::Wheel { wheel: at, error });
            }
            (x, y) = (x + places[at].x as f64 / N as f64, y + places[at].y as f64 / N as f64);
            at += 1;
        }
        let mut squares = 0.0;
        at = 0;
        while at < N {
            let (across, along) = (places[at].x as f64 - x, places[at].y as f64 - y);
            (squares, at) = (squares + across * across + along * along, at + 1);
        }
        let rim = radius as f64 * RADIANS_PER_SECOND;
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let (middle, inertia, rpm, rim) = (
            Point::new(x as f32, y as f32),
            (1.0 / squares) as f32,
            (1.0 / rim) as f32,
            rim as f32,
        );
        // A millimetre from the middle or less: the wheels' contacts are wider.
        if N < 2 || squares < 1e-6 * N as f64 {
            return Err(BaseError::CannotTurn { about: middle });
        }
        Ok(Self { places, radius, max_wheel_speed, steering, rpm, rim, middle, inertia })
    }

    /// Like [`new`](Self::new), but panics: in a constant, an unsound base does not compile.
    #[must_use]
    pub const fn sound(
        places: [Point<RobotFrame>; N],
        radius: f32,
        max_wheel_speed: Rpm,
        steering: Steering,
    ) -> Self {
        match Self::new(places, radius, max_wheel_speed, steering) {
            Ok(base) => base,
            Err(error) => panic!("{}", error.text().as_str()),
        }
    }

    /// Where the modules stand.
    pub const fn places(&self) -> &[Point<RobotFrame>; N] {
        &self.places
    }

    /// Radius of the wheels, in metres.
    #[must_use]
    pub const fn radius(&self) -> f32 {
        self.radius
    }

    /// The motion for measured speeds and steering angles, by least squares, and for each module
    /// the length of the velocity that it does not explain, in m/s: a wheel that is reversed, dead
    /// or slips, or a wrong angle. Speeds that are not finite give such a twist.
    #[must_use]
    pub fn forward(&self, measured: [Module; N]) -> BaseMotion<N> {
        let velocities = measured.map(|module| {
            let speed = module.speed.get() * self.rim;
            let (sin, cos) = direction(module.angle);
            [speed * cos, speed * sin]
        });
        // The mean is the velocity of the middle; the moments about it give the turn.
        let (mut vx, mut vy, mut moment) = (0.0, 0.0, 0.0);
        for ([x, y], place) in velocities.into_iter().zip(&self.places) {
            (vx, vy) = (vx + x, vy + y);
            moment += y * (place.x - self.middle.x) - x * (place.y - self.middle.y);
        }
        #[expect(clippy::cast_precision_loss, reason = "a handful")]
        let count = N as f32;
        let wz = moment * self.inertia;
        let (vx, vy) = (vx / count + wz * self.middle.y, vy / count - wz * self.middle.x);
        let twist = Twist::new(vx, vy, wz);
        let mut residual = [0.0; N];
        for (at, [x, y]) in velocities.into_iter().enumerate() {
            let [explained_x, explained_y] = at_place(twist, self.places[at]);
            residual[at] = maths::hypot(x - explained_x, y - explained_y);
        }
        BaseMotion { twist, residual }
    }

    /// The force, N, of a module at a place on a body whose twist changes: by least squares, no module pushes
    /// against another.
    fn forces(
        &self,
        body: &Body,
        twist: Twist,
        change: Twist,
    ) -> impl Fn(Point<RobotFrame>) -> [f32; 2] {
        #[expect(clippy::cast_precision_loss, reason = "a handful")]
        let share = body.mass_kg / N as f32;
        // The axes turn with the robot.
        let (x, y) = (change.vx - twist.wz * twist.vy, change.vy + twist.wz * twist.vx);
        let Point { x: middle_x, y: middle_y, .. } = self.middle;
        let moment =
            body.yaw_inertia_kg_m2 * change.wz - body.mass_kg * (middle_x * y - middle_y * x);
        let turn = moment * self.inertia;
        move |place| {
            [share * x - turn * (place.y - middle_y), share * y + turn * (place.x - middle_x)]
        }
    }
}

const fn check(radius: f32, max_wheel_speed: Rpm, steering: Steering) -> Result<(), ConfigError> {
    ok!(config::radius(radius));
    ok!(positive("max_wheel_speed", max_wheel_speed.get()));
    if let Steering::Between(least, most) = steering {
        let range = most.minus(least);
        let must_be = "half a turn or more, 180 degrees";
        let is_enough = range.microdegrees() >= HALF_TURN;
        ok!(ConfigError::check(is_enough, "steering range", range.degrees().get(), must_be));
    }
    Ok(())
}

/// State of a swerve base: the newest steering angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwerveState<const N: usize> {
    steered: [Option<TotalAngle>; N],
}

impl<const N: usize> Default for SwerveState<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> SwerveState<N> {
    /// No module has been steered.
    #[must_use]
    pub const fn new() -> Self {
        Self { steered: [None; N] }
    }

    /// Speeds and steering angles that make the robot move with `twist`, from the measured steering
    /// angles. If a wheel would have to turn faster than it may, all are slowed down by one factor.
    /// A module whose wheel shall stand keeps its last steering angle; before the first, where it is.
    ///
    /// # Errors
    /// [`TwistNotFinite`] if the twist or a speed is infinite or NaN; the state stays unchanged.
    pub fn update(
        &mut self,
        base: &Swerve<N>,
        twist: Twist,
        measured: [TotalAngle; N],
    ) -> Result<Modules<N>, TwistNotFinite> {
        let velocities = base.places.map(|place| at_place(twist, place));
        let (mut fastest, mut sum) = (0.0, 0.0);
        for [x, y] in velocities {
            let square = x * x + y * y;
            fastest = if square > fastest { square } else { fastest };
            sum += square;
        }
        if !sum.is_finite() {
            return Err(TwistNotFinite::of(twist));
        }
        let limit = base.max_wheel_speed.get();
        let fastest = maths::fast_sqrt(fastest) * base.rpm;
        let scale = if fastest <= limit { 1.0 } else { limit / fastest };
        let mut modules = [Module::default(); N];
        for at in 0..N {
            modules[at] = steered(base, velocities[at], measured[at], &mut self.steered[at], scale);
        }
        Ok(Modules { modules, scale })
    }

    /// The motion of each module while the robot's `twist`, in its own axes, changes by `change` a second,
    /// from the measured steering angles. A wheel has to do only with what is along it; what is across turns
    /// its module.
    ///
    /// # Errors
    /// The errors of [`update`](Self::update).
    pub fn motions(
        &mut self,
        base: &Swerve<N>,
        body: &Body,
        [twist, change]: [Twist; 2],
        measured: [TotalAngle; N],
    ) -> Result<[ModuleMotion; N], TwistNotFinite> {
        let modules = self.update(base, twist, measured)?.modules;
        let force = base.forces(body, twist, change);
        let mut motions = modules.map(|module| ModuleMotion {
            module,
            turning: Rpm::ZERO,
            acceleration: RpmPerSecond::ZERO,
            torque: NewtonMetres::ZERO,
        });
        for (at, motion) in motions.iter_mut().enumerate() {
            let (sin, cos) = direction(measured[at]);
            let [x, y] = at_place(twist, base.places[at]);
            let [add_x, add_y] = at_place(change, base.places[at]);
            let [push_x, push_y] = force(base.places[at]);
            let square = x * x + y * y;
            if square > SLOW * SLOW {
                motion.turning = Rpm::new((x * add_y - y * add_x) / square * RPM);
            }
            motion.acceleration = RpmPerSecond::new((add_x * cos + add_y * sin) * base.rpm);
            motion.torque = NewtonMetres::new((push_x * cos + push_y * sin) * base.radius);
        }
        Ok(motions)
    }
}

/// One module. Not generic: compiled for speed with this crate.
fn steered_within(
    steering: Steering,
    [x, y]: [f32; 2],
    measured: TotalAngle,
    last: &mut Option<TotalAngle>,
) -> (f32, TotalAngle) {
    if x * x + y * y < STANDING * STANDING {
        return (0.0, *last.get_or_insert(measured));
    }
    // The velocity as the module sees it: along its wheel, and across.
    let (sin, cos) = direction(measured);
    let (along, across) = (x * cos + y * sin, y * cos - x * sin);
    // Within a quarter turn of the wheel, whichever way it then rolls.
    let across = if along < 0.0 { -across } else { across };
    let turn = maths::usual_atan2(across, along.abs());
    #[expect(clippy::cast_possible_truncation, reason = "at most 90 million")]
    let turn = (turn * MICRODEGREES) as i32;
    let angle = measured.plus(TotalAngle::from_microdegrees(turn.into()));
    let angle = match steering {
        Steering::Endless => angle,
        Steering::Between(least, most) => within(angle, least, most),
    };
    *last = Some(angle);
    (along, angle)
}

fn steered<const N: usize>(
    base: &Swerve<N>,
    velocity: [f32; 2],
    measured: TotalAngle,
    last: &mut Option<TotalAngle>,
    scale: f32,
) -> Module {
    let (along, angle) = steered_within(base.steering, velocity, measured, last);
    // Rounding must not put it above the limit.
    let speed = maths::within(along * base.rpm * scale, base.max_wheel_speed.get());
    Module { speed: Rpm::new(speed), angle }
}

/// The nearest angle within the range that differs by whole half turns.
fn within(angle: TotalAngle, least: TotalAngle, most: TotalAngle) -> TotalAngle {
    const HALF_TURN: TotalAngle = TotalAngle::from_degrees(180);
    // One is enough for a module that is within its range, for it turns by a quarter at most.
    let inside = if angle < least {
        angle.plus(HALF_TURN)
    } else if angle > most {
        angle.minus(HALF_TURN)
    } else {
        return angle;
    };
    if least <= inside && inside <= most { inside } else { far(angle, least, most) }
}

/// Turned out of its range by hand, or counted from another zero.
#[cold]
fn far(angle: TotalAngle, least: TotalAngle, most: TotalAngle) -> TotalAngle {
    let (angle, least, most) = (angle.microdegrees(), least.microdegrees(), most.microdegrees());
    let inside = if angle < least {
        least.saturating_add(angle.saturating_sub(least).rem_euclid(HALF_TURN))
    } else {
        most.saturating_sub(most.saturating_sub(angle).rem_euclid(HALF_TURN))
    };
    TotalAngle::from_microdegrees(inside)
}

fn direction(angle: TotalAngle) -> (f32, f32) {
    maths::near_sin_cos(angle.within_turn().get() * (PI / 180.0))
}

/// Velocity of a place on the robot.
fn at_place(twist: Twist, place: Point<RobotFrame>) -> [f32; 2] {
    [twist.vx - twist.wz * place.y, twist.vy + twist.wz * place.x]
}
