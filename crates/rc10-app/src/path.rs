//! Paths of a base: waypoints, the speed along them within what the wheels can do, and a follower.
//!
//! A [`Path`] is waypoints, a constant in a robot's table. A [`Plan`] is made of it: straight
//! lines, arcs, the heading along the way, and the highest speed that every limit allows. A
//! [`Follower`] makes a twist of the plan and the measured pose, once a tick.
//!
//! ```
//! use core::f32::consts::FRAC_PI_2;
//! use rc10_app::path::{Follower, FollowerConfig, Path, PathLimits, PathStatus, Plan, Waypoint};
//! use rc10_app::{Base, Pose, Radians, Rpm, Seconds, TwistLimits};
//!
//! const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
//! // 2 m ahead, round a corner, 1 m to the left; at the end it looks to the left.
//! const PATH: Path<3> = Path::sound([
//!     Waypoint::new(0.0, 0.0, Radians::new(0.0)),
//!     Waypoint::new(2.0, 0.0, Radians::new(0.0)).rounded(0.4),
//!     Waypoint::new(2.0, 1.0, Radians::new(FRAC_PI_2)),
//! ]);
//! const LIMITS: PathLimits = PathLimits {
//!     twist: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
//!     max_speed_m_s: 2.0,
//!     wheel_share: 0.9, // the rest is for the follower
//! };
//!
//! let plan = Plan::new(&PATH, &BASE, &LIMITS, 0.0)?;
//! let mut follower = Follower::new();
//! let mut pose: Pose = Pose::IDENTITY;
//! let dt = Seconds::new(0.005);
//! for _ in 0..1000 {
//!     let step = follower.update(&FollowerConfig::DEFAULT, &plan, pose, dt)?;
//!     if step.status == PathStatus::Done {
//!         break;
//!     }
//!     let wheels = BASE.inverse(step.twist)?;
//!     // Here the wheels would turn. In this example they do exactly what they are told.
//!     let moved = BASE.forward(wheels.speeds).twist * dt.get();
//!     pose = pose.compose(Pose::new(moved.vx, moved.vy, Radians::new(moved.wz)));
//! }
//! assert!((pose.x - 2.0).abs() < 0.01 && (pose.y - 1.0).abs() < 0.01);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

mod error;
mod follower;
mod leg;
mod plan;
mod speed;

pub use error::{PathError, PlanError};
pub use follower::{Follower, FollowerConfig, FollowerOutput, PathStatus, PoseNotFinite};
pub use plan::{PathLimits, Plan, PlannedMotion, Planner};

use crate::config::{ConfigError, not_negative};
use crate::ok;
use crate::transform::Pose;
use crate::units::Radians;
use leg::Turn;

/// Largest metres from the field's origin, and radians: an f32 has a tenth of a millimetre left.
const FARTHEST: f32 = 1000.0;
/// Waypoints that are nearer to each other than this, in metres, are at the same place.
const SAME_PLACE: f32 = 1e-3;

/// A pose on a path, and how the path passes there.
///
/// ```
/// use rc10_app::{Radians, path::Waypoint};
/// let corner = Waypoint::new(2.0, 0.0, Radians::new(0.0)).rounded(0.4).at_most(1.0);
/// let shelf = Waypoint::new(2.0, 3.0, Radians::new(1.57)).at_most(0.0); // stops
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Waypoint {
    /// The place, and the robot's heading there; in between it turns the shorter way.
    pub pose: Pose,
    /// Radius of the arc that rounds the corner off, in metres; ≥ 0. The path then passes the
    /// waypoint on the inside, and the heading is reached in the arc's middle. With 0 it passes
    /// exactly through it, and stops there if it is a corner. 0 at both ends of the path.
    pub radius_m: f32,
    /// Highest speed here, in m/s; ≥ 0, infinite for no limit. With 0 the robot stops here.
    pub max_speed_m_s: f32,
}

impl Waypoint {
    /// Exactly through this place in metres, with this heading.
    pub const fn new(x: f32, y: f32, heading: Radians) -> Self {
        Self { pose: Pose::new(x, y, heading), radius_m: 0.0, max_speed_m_s: f32::INFINITY }
    }

    /// The same, with an arc of this radius in metres in place of the corner.
    pub const fn rounded(self, radius_m: f32) -> Self {
        Self { radius_m, ..self }
    }

    /// The same, passed no faster than this, in m/s.
    pub const fn at_most(self, max_speed_m_s: f32) -> Self {
        Self { max_speed_m_s, ..self }
    }

    const fn validate(&self) -> Result<(), ConfigError> {
        let Pose { x, y, heading, .. } = self.pose;
        ok!(near("x", x), in "pose");
        ok!(near("y", y), in "pose");
        ok!(near("heading", heading.get()), in "pose");
        ok!(not_negative("radius_m", self.radius_m));
        let must_be = "0 or more (infinite: no limit)";
        ConfigError::check(self.max_speed_m_s >= 0.0, "max_speed_m_s", self.max_speed_m_s, must_be)
    }
}

/// `Ok` for a number within ±[`FARTHEST`].
const fn near(field: &'static str, value: f32) -> Result<(), ConfigError> {
    ConfigError::check(value.abs() <= FARTHEST, field, value, "within -1000 .. 1000")
}

/// A path through `N` waypoints: lines, and arcs at [rounded](Waypoint::rounded) corners.
///
/// One that cannot be driven does not compile:
///
/// ```compile_fail,E0080
/// use rc10_app::{Radians, path::{Path, Waypoint}};
/// const AHEAD: Radians = Radians::new(0.0);
/// // waypoint 1: its arc takes 1.5 m of a leg of 1 m
/// const PATH: Path<3> = Path::sound([
///     Waypoint::new(0.0, 0.0, AHEAD),
///     Waypoint::new(1.0, 0.0, AHEAD).rounded(1.5),
///     Waypoint::new(1.0, 2.0, AHEAD),
/// ]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path<const N: usize> {
    waypoints: [Waypoint; N],
}

impl<const N: usize> Path<N> {
    /// A path through these waypoints, in this order.
    ///
    /// # Errors
    /// Fewer than two waypoints; a number that cannot be used; a waypoint at the place of the one
    /// before; an arc that is too wide for the legs on its sides, or that turns back.
    pub const fn new(waypoints: [Waypoint; N]) -> Result<Self, PathError> {
        if N < 2 {
            return Err(PathError::TooFewWaypoints);
        }
        let mut at = 0;
        while at < N {
            if let Err(error) = waypoints[at].validate() {
                return Err(PathError::Waypoint { waypoint: at, error });
            }
            let radius = waypoints[at].radius_m;
            if (at == 0 || at + 1 == N) && radius > 0.0 {
                let error = ConfigError::new("radius_m", radius, "0 at an end of the path");
                return Err(PathError::Waypoint { waypoint: at, error });
            }
            at += 1;
        }
        // What the arc at the leg's beginning takes of it.
        let mut taken = 0.0;
        let mut leg = 0;
        while leg + 1 < N {
            let (from, to) = (&waypoints[leg], &waypoints[leg + 1]);
            let (_, length) = leg::between(from, to);
            if length < SAME_PLACE {
                return Err(PathError::SamePlace { waypoint: leg + 1 });
            }
            let mut takes = 0.0;
            if leg + 2 < N {
                let turn = Turn::at(from, to, &waypoints[leg + 2]);
                if to.radius_m > 0.0 && turn.is_back() {
                    return Err(PathError::TurnsBack { waypoint: leg + 1 });
                }
                takes = turn.takes(to.radius_m);
                // The leg after it is checked in the next round, together with the next arc.
                let (_, next) = leg::between(to, &waypoints[leg + 2]);
                if takes > next {
                    return Err(PathError::ArcTooWide { waypoint: leg + 1, takes, length: next });
                }
            }
            if taken + takes > length {
                // The wider of both arcs is named.
                let waypoint = if takes >= taken { leg + 1 } else { leg };
                return Err(PathError::ArcTooWide { waypoint, takes: taken + takes, length });
            }
            taken = takes;
            leg += 1;
        }
        Ok(Self { waypoints })
    }

    /// Like [`new`](Self::new), but panics: in a constant, a bad path does not compile.
    #[must_use]
    pub const fn sound(waypoints: [Waypoint; N]) -> Self {
        match Self::new(waypoints) {
            Ok(path) => path,
            Err(error) => panic!("{}", error.text().as_str()),
        }
    }

    /// The waypoints, as they were given.
    pub const fn waypoints(&self) -> &[Waypoint; N] {
        &self.waypoints
    }
}
