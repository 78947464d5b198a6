//! Follows a plan by the measured pose.

use super::plan::{Cursor, Plan, Track};
use crate::angle::shortest_way_f32;
use crate::config::{ConfigError, not_negative, positive};
use crate::maths;
use crate::ok;
use crate::transform::{FieldFrame, Pose};
use crate::twist::{Twist, TwistLimits};
use crate::units::{Radians, Seconds};
use core::f32::consts::TAU;

/// Gains and bounds of a [`Follower`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowerConfig {
    /// Speed per error along the path, 1/s; ≥ 0. With a delay of T s, 0.3 / T does not overshoot.
    pub along: f32,
    /// The same for the error across the path.
    pub across: f32,
    /// Yaw rate per error of the heading: rad/s per rad, so 1/s; ≥ 0.
    pub heading: f32,
    /// Highest speed for going back to the path, in m/s; > 0. It comes on top of the plan's.
    pub max_correction_m_s: f32,
    /// Highest yaw rate for turning back to the planned heading, in rad/s; > 0.
    pub max_turn_correction_rad_s: f32,
    /// How far behind, in metres; > 0: from half of it the path is slower, at all it stands.
    pub max_lag_m: f32,
    /// Farther from where it shall be than this, in metres, it gives up; > `max_lag_m`.
    pub max_deviation_m: f32,
    /// At the end it has arrived within this, in metres; > 0.
    pub arrived_m: f32,
    /// At the end it has arrived within this heading, in rad; > 0.
    pub arrived_heading: Radians,
}

impl FollowerConfig {
    /// A start, to be measured on the robot: for a base that answers within 60 ms.
    pub const DEFAULT: Self = Self {
        along: 5.0,
        across: 5.0,
        heading: 5.0,
        max_correction_m_s: 0.5,
        max_turn_correction_rad_s: 1.5,
        max_lag_m: 0.2,
        max_deviation_m: 0.5,
        arrived_m: 0.01,
        arrived_heading: Radians::new(0.02),
    };

    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(not_negative("along", self.along));
        ok!(not_negative("across", self.across));
        ok!(not_negative("heading", self.heading));
        ok!(positive("max_correction_m_s", self.max_correction_m_s));
        ok!(positive("max_turn_correction_rad_s", self.max_turn_correction_rad_s));
        ok!(positive("max_lag_m", self.max_lag_m));
        ok!(positive("max_deviation_m", self.max_deviation_m));
        let is_farther = self.max_deviation_m > self.max_lag_m;
        let must_be = "more than max_lag_m";
        ok!(ConfigError::check(is_farther, "max_deviation_m", self.max_deviation_m, must_be));
        ok!(positive("arrived_m", self.arrived_m));
        positive("arrived_heading", self.arrived_heading.get())
    }
}

/// How a base gets on with its path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathStatus {
    /// On its way.
    #[default]
    Following,
    /// Too far behind, so the path's time goes slower or stands. It goes on by itself.
    Waiting,
    /// At the end, within the tolerances. It keeps being held there.
    Done,
    /// Farther from the path than allowed: the twist is zero until a new [`Follower`].
    GaveUp,
}

/// The motion that the base shall make, from [`Follower::update`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowerOutput {
    /// The plan's twist and the correction, for [`Base::inverse`](crate::Base::inverse).
    pub twist: Twist,
    /// For [`Base::accelerations`](crate::Base::accelerations): how the plan's twist changes in a
    /// second. The correction has no part in it, so the noise of the pose has not either.
    pub acceleration: Twist,
    /// Where the base shall be now.
    pub target: Pose,
    /// How far it is behind, along the path, in metres; negative if it is ahead.
    pub along: f32,
    /// How far it is to the right of the path, in metres; negative to the left.
    pub across: f32,
    /// How far it has still to turn, −π ..= π.
    pub turn: Radians,
    /// How it gets on.
    pub status: PathStatus,
}

/// A measured pose with a component that is infinite or NaN, as it was given.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("not a usable pose: x {} m, y {} m, heading {}", .0.x, .0.y, .0.heading)]
pub struct PoseNotFinite(pub Pose);

/// State of a base that follows a [`Plan`]. [The module](super) has an example.
///
/// The twist is the plan's, plus gains times the error. The plan waits for a base that lags, never
/// by more than [`max_lag_m`](FollowerConfig::max_lag_m) to catch up, and speeds up again within its
/// limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follower {
    cursor: Cursor,
    /// Share of the clock at which the path's time goes.
    rate: f32,
    /// The path's last direction.
    direction: [f32; 2],
    gave_up: bool,
}

impl Default for Follower {
    fn default() -> Self {
        Self::new()
    }
}

impl Follower {
    /// At the beginning of a plan.
    #[must_use]
    pub const fn new() -> Self {
        Self { cursor: Cursor::START, rate: 1.0, direction: [1.0, 0.0], gave_up: false }
    }

    /// The motion for the coming `dt` at `pose`. A bad `dt` does not move the path's time.
    ///
    /// # Errors
    /// [`PoseNotFinite`]; the state stays unchanged.
    pub fn update<const N: usize>(
        &mut self,
        config: &FollowerConfig,
        plan: &Plan<N>,
        pose: Pose,
        dt: Seconds,
    ) -> Result<FollowerOutput, PoseNotFinite> {
        if !(pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite()) {
            return Err(PoseNotFinite(pose));
        }
        Ok(self.step(config, plan.track(), pose, if dt.is_step() { dt.get() } else { 0.0 }))
    }

    /// [`update`](Self::update) for any size of plan: compiled for speed, with this crate.
    fn step(
        &mut self,
        config: &FollowerConfig,
        track: Track<'_>,
        pose: Pose,
        dt: f32,
    ) -> FollowerOutput {
        let motion = self.cursor.motion(track, &mut self.direction);
        let (target, [x, y]) = (motion.pose, self.direction);
        let (off_x, off_y) = (target.x - pose.x, target.y - pose.y);
        let (along, across) = (off_x * x + off_y * y, off_y * x - off_x * y);
        let turn = shortest_way_f32(pose.heading.get(), target.heading.get(), TAU);
        let mut output = FollowerOutput {
            target,
            along,
            across,
            turn: Radians::new(turn),
            ..FollowerOutput::default()
        };
        let off_squared = off_x * off_x + off_y * off_y;
        if self.gave_up || off_squared > config.max_deviation_m * config.max_deviation_m {
            self.gave_up = true;
            output.status = PathStatus::GaveUp;
            return output;
        }
        self.keep_pace(config, &track.limits, motion.twist, along, dt);

        let (forward, left) = (config.along * along, config.across * across);
        let speed = maths::fast_sqrt(forward * forward + left * left);
        let share =
            if speed > config.max_correction_m_s { config.max_correction_m_s / speed } else { 1.0 };
        let (forward, left) = (forward * share, left * share);
        let turning = maths::within(config.heading * turn, config.max_turn_correction_rad_s);
        let correction = Twist::new(forward * x - left * y, forward * y + left * x, turning);

        let acceleration = motion.acceleration * (self.rate * self.rate);
        // In the middle of the step, so that a step ends where the plan does.
        let planned = motion.twist * self.rate + acceleration * (0.5 * dt);
        let twist = planned + correction;
        let heading = pose.heading + Radians::new(0.5 * dt * twist.wz);
        let (sin, cos) = maths::sin_cos(heading.get());
        output.twist = into_robot(twist, sin, cos);
        // In the axes of a robot that turns, a velocity that is kept changes.
        let (planned, change) = (into_robot(planned, sin, cos), into_robot(acceleration, sin, cos));
        output.acceleration =
            change + Twist::new(planned.wz * planned.vy, -planned.wz * planned.vx, 0.0);

        self.cursor.advance(track, self.rate * dt);
        let is_there = off_squared <= config.arrived_m * config.arrived_m
            && turn.abs() <= config.arrived_heading.get();
        output.status = if self.rate < 1.0 {
            PathStatus::Waiting
        } else if is_there && self.cursor.is_at_end(track) {
            PathStatus::Done
        } else {
            PathStatus::Following
        };
        output
    }

    /// Lets the path's time go slower while the base is behind.
    fn keep_pace(
        &mut self,
        config: &FollowerConfig,
        limits: &TwistLimits,
        twist: Twist<FieldFrame>,
        along: f32,
        dt: f32,
    ) {
        let left = 2.0 - 2.0 * along / config.max_lag_m;
        // NaN, of a configuration that is not valid, counts as zero.
        let wanted = if left > 0.0 { left.min(1.0) } else { 0.0 };
        if wanted >= self.rate && self.rate < 1.0 {
            // Speeding up takes of the acceleration what it does along the path.
            let speed = maths::fast_sqrt(twist.vx * twist.vx + twist.vy * twist.vy);
            let (linear, angular) = (limits.linear_m_s2 * dt, limits.angular_rad_s2 * dt);
            let mut rise = wanted - self.rate;
            if rise * speed > linear {
                rise = linear / speed;
            }
            if rise * twist.wz.abs() > angular {
                rise = angular / twist.wz.abs();
            }
            self.rate = (self.rate + rise).min(1.0);
        } else {
            self.rate = wanted;
        }
    }
}

/// Like [`Twist::into_frame`], where the sine and cosine of the heading are known.
fn into_robot(twist: Twist<FieldFrame>, sin: f32, cos: f32) -> Twist {
    Twist::new(twist.vx * cos + twist.vy * sin, twist.vy * cos - twist.vx * sin, twist.wz)
}
