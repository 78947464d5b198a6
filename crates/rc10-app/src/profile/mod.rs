//! Motion profiles: setpoints to a target, within limits of velocity, acceleration and jerk.
//!
//! A **profile** turns targets, which may change at any time, into position, velocity and
//! acceleration for every tick, in the shortest time that the limits allow, from any state. With a
//! jerk limit the velocity is an S-curve, else a trapezoid.
//!
//! A new target makes a **plan** of at most seven pieces of constant jerk, in bounded work (`cargo
//! xtask count`). A tick evaluates one: nothing drifts, and the last setpoint is the target.
//!
//! Precision: a setpoint is off by at most a millionth of the plan's distances. Positions are two
//! f32: neither many turns nor many targets add to that.
//!
//! ```
//! use rc10_app::{Profile, ProfileLimits, Seconds};
//! // Metres: 2 m/s, 5 m/s², 50 m/s³.
//! let limits = ProfileLimits { velocity: 2.0, acceleration: 5.0, jerk: 50.0 };
//! let mut lift = Profile::at(0.1);
//! lift.set_target(&limits, 1.5, 0.0)?;
//! while !lift.has_arrived() {
//!     let setpoint = lift.update(Seconds::new(0.001));
//!     assert!(setpoint.velocity <= 2.0);
//! }
//! assert_eq!(lift.setpoint().position, 1.5);
//! # Ok::<(), rc10_app::ConfigError>(())
//! ```

mod angle;
mod course;
mod double;
mod plan;
mod transition;

use crate::config::{ConfigError, finite, positive, positive_or_unlimited};
use crate::ok;
use crate::units::Seconds;
pub use angle::{AngleLimits, AngleProfile, AngleSetpoint};
use course::Motion;
use double::Double;
use plan::{Plan, Planned};
use transition::Bounds;

/// Limits of an axis, the same both ways, in the axis's own unit: metres, a share of the way. Those of a
/// shaft are [`AngleLimits`], which have units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileLimits {
    /// Largest velocity, in units per second.
    pub velocity: f32,
    /// Largest acceleration, in units per second².
    pub acceleration: f32,
    /// Largest jerk, in units per second³; infinite: the acceleration may jump.
    pub jerk: f32,
}

impl ProfileLimits {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(positive("velocity", self.velocity));
        ok!(positive("acceleration", self.acceleration));
        positive_or_unlimited("jerk", self.jerk)
    }

    fn bounds(&self) -> Bounds {
        let Self { acceleration, jerk, .. } = *self;
        Bounds { acceleration, jerk, per_jerk: 1.0 / jerk }
    }
}

/// Position, velocity and acceleration that an axis shall have now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// In units of the axis.
    pub position: f32,
    /// In units per second.
    pub velocity: f32,
    /// In units per second²: for feed-forward.
    pub acceleration: f32,
}

/// Where a profile goes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    /// To this place, and to have this velocity there.
    Place(Double, f32),
    /// To something that was at this place when the plan began, and has this velocity.
    Moving(Double, f32),
    /// To this velocity.
    Velocity(f32),
}

impl Goal {
    const fn velocity(self) -> f32 {
        match self {
            Self::Place(_, velocity) | Self::Moving(_, velocity) | Self::Velocity(velocity) => {
                velocity
            }
        }
    }
}

/// State of a motion profile: the setpoint, and the plan to the target.
///
/// A profile of a linear axis: the [module](self) has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    position: Double,
    velocity: f32,
    acceleration: f32,
    goal: Goal,
    /// Those of the plan; `None` before the first.
    limits: Option<ProfileLimits>,
    plan: Plan,
    /// Position where the plan began, and where it ends.
    begin: Double,
    end: Double,
}

impl Profile {
    /// At rest at a position, in units of the axis.
    pub const fn at(position: f32) -> Self {
        Self::from_setpoint(Setpoint { position, velocity: 0.0, acceleration: 0.0 })
    }

    /// In any state, to take over a moving axis at its velocity.
    pub const fn from_setpoint(setpoint: Setpoint) -> Self {
        let Setpoint { position, velocity, acceleration } = setpoint;
        let position = Double::new(position);
        Self {
            position,
            velocity,
            acceleration,
            goal: Goal::Velocity(velocity),
            limits: None,
            plan: Plan::DONE,
            begin: position,
            end: position,
        }
    }

    /// Goes to `position`, with `velocity` there (usually 0). The same target again costs nothing.
    ///
    /// # Errors
    /// A bad limit, position, velocity or distance. The profile goes on as it was.
    pub fn set_target(
        &mut self,
        limits: &ProfileLimits,
        position: f32,
        velocity: f32,
    ) -> Result<(), ConfigError> {
        finite("position", position)?;
        self.set(limits, Goal::Place(Double::new(position), velocity))
    }

    /// Catches up with something that is at `position` now and moves with `velocity`, and goes
    /// along with it: for a target that comes anew in every tick or every message.
    ///
    /// # Errors
    /// As [`set_target`](Self::set_target); `velocity` must be below the limit.
    pub fn follow(
        &mut self,
        limits: &ProfileLimits,
        position: f32,
        velocity: f32,
    ) -> Result<(), ConfigError> {
        finite("position", position)?;
        self.set(limits, Goal::Moving(Double::new(position), velocity))
    }

    /// Changes to a velocity, in units per second, wherever the axis is.
    ///
    /// # Errors
    /// The same errors as [`set_target`](Self::set_target).
    pub fn set_velocity(
        &mut self,
        limits: &ProfileLimits,
        velocity: f32,
    ) -> Result<(), ConfigError> {
        self.set(limits, Goal::Velocity(velocity))
    }

    fn set(&mut self, limits: &ProfileLimits, goal: Goal) -> Result<(), ConfigError> {
        // The same place again is another one for a target that moves: it is there now.
        let stays = !matches!(goal, Goal::Moving(..));
        if stays && self.goal == goal && self.limits == Some(*limits) {
            return Ok(());
        }
        limits.validate()?;
        let (size, limit) = (goal.velocity().abs(), limits.velocity);
        let is_reachable = size < limit || size <= limit && stays;
        ConfigError::check(is_reachable, "velocity", goal.velocity(), "within the limit")?;
        self.start(limits, goal, None).map(|_| ())
    }

    /// Makes a plan from the present state and begins it; its duration. One that lasts `duration`,
    /// which is at least that of the fastest, or none if there is no such plan.
    fn start(
        &mut self,
        limits: &ProfileLimits,
        goal: Goal,
        duration: Option<f32>,
    ) -> Result<Option<f32>, ConfigError> {
        let (target, frame, to) = match goal {
            Goal::Place(place, velocity) => (Some(place), 0.0, velocity),
            Goal::Moving(place, velocity) => (Some(place), velocity, 0.0),
            Goal::Velocity(velocity) => (None, 0.0, velocity),
        };
        let way = target.map(|target| target.minus(self.position));
        let motion = Motion {
            bounds: limits.bounds(),
            slowest: -limits.velocity - frame,
            fastest: limits.velocity - frame,
            velocity: self.velocity - frame,
            acceleration: self.acceleration,
            way: way.unwrap_or(0.0),
            to,
        };
        let (mut course, is_mirrored) =
            if way.is_some() { motion.fastest() } else { (motion.direct(), false) };
        let mut takes = course.duration();
        if let Some(duration) = duration
            && takes < duration
        {
            let Some(lasting) = motion.lasting(duration, &course, is_mirrored) else {
                return Ok(None);
            };
            (course, takes) = (lasting, duration);
        }
        ConfigError::check(
            takes.is_finite() && course.way().is_finite(),
            "position",
            target.map_or(0.0, Double::rounded),
            "near enough for an f32",
        )?;
        self.plan.lay(&course, is_mirrored, limits.jerk, takes, way, frame);
        self.begin = self.position;
        self.end = match target {
            Some(target) => target.plus(frame * takes),
            None => self.begin.plus(course.way()),
        };
        (self.goal, self.limits) = (goal, Some(*limits));
        if takes <= 0.0 {
            self.arrive(0.0);
        }
        Ok(Some(takes))
    }

    /// The setpoint a time `dt` later. A `dt` that is not finite and positive changes nothing.
    pub fn update(&mut self, dt: Seconds) -> Setpoint {
        if dt.is_step() {
            let dt = dt.get();
            if self.plan.is_over() {
                self.position = self.position.plus(self.velocity * dt);
                self.acceleration = 0.0;
            } else {
                self.plan.advance(dt);
                let remaining = self.plan.remaining();
                if remaining > 0.0 {
                    let Planned { way, velocity, acceleration } = self.plan.now();
                    self.position = self.begin.plus(way);
                    self.velocity = velocity;
                    self.acceleration = acceleration;
                } else {
                    self.arrive(-remaining);
                }
            }
        }
        self.setpoint()
    }

    /// The plan ended `ago`, in seconds.
    #[cold]
    fn arrive(&mut self, ago: f32) {
        self.velocity = self.goal.velocity();
        self.acceleration = 0.0;
        self.position = self.end.plus(self.velocity * ago);
    }

    /// The newest setpoint.
    #[must_use]
    pub const fn setpoint(&self) -> Setpoint {
        let Self { velocity, acceleration, .. } = *self;
        Setpoint { position: self.position.rounded(), velocity, acceleration }
    }

    /// Whether the target, or the velocity, is reached.
    #[must_use]
    pub const fn has_arrived(&self) -> bool {
        self.plan.is_over()
    }

    /// Time until then; 0 afterwards.
    #[must_use]
    pub const fn remaining(&self) -> Seconds {
        Seconds::new(self.plan.remaining().max(0.0))
    }
}

/// Lets all profiles arrive with the slowest, by lower velocities; returns the time until then.
/// Call it with all targets set, and update all with the same times; a new target ends it. One that
/// has arrived, or has no position to reach, stays.
///
/// One that brakes, and would start again to come later, makes all slower by a quarter.
pub fn synchronise(profiles: &mut [&mut Profile]) -> Seconds {
    /// Longer times that are tried: 1.25 to this power is more than braking and starting take.
    const TRIES: u32 = 16;
    let mut duration = 0.0_f32;
    for profile in &mut *profiles {
        if let Ok(Some(takes)) = profile.restart(None) {
            duration = duration.max(takes);
        }
    }
    for _ in 0..TRIES {
        let mut all = true;
        for profile in &mut *profiles {
            all &= matches!(profile.restart(Some(duration)), Ok(Some(_)));
        }
        if all {
            break;
        }
        duration *= 1.25;
    }
    Seconds::new(duration)
}

impl Profile {
    /// Begins a new plan to the same target, like [`start`](Self::start); not if it is there.
    fn restart(&mut self, duration: Option<f32>) -> Result<Option<f32>, ConfigError> {
        let goal = match self.goal {
            Goal::Moving(place, velocity) => {
                Goal::Moving(place.plus(velocity * self.plan.elapsed()), velocity)
            }
            other => other,
        };
        match self.limits {
            Some(limits) if !self.has_arrived() && !matches!(goal, Goal::Velocity(_)) => {
                self.start(&limits, goal, duration)
            }
            _ => Ok(Some(0.0)),
        }
    }
}
