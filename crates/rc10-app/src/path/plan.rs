//! A path with its time.

use core::f32::consts::TAU;

use super::error::PlanError;
use super::leg::{self, CELLS, Leg};
use super::speed::{self, Bounds, Squares};
use super::{Path, Waypoint};
use crate::angle::shortest_way_f32;
use crate::base::Base;
use crate::config::{ConfigError, not_negative, positive, positive_or_unlimited};
use crate::maths;
use crate::ok;
use crate::transform::{FieldFrame, Pose};
use crate::twist::{Twist, TwistLimits};
use crate::units::{Radians, Seconds};

/// The limits of the speed along a path, besides the wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLimits {
    /// Largest accelerations, the linear one of the vector along and across the path.
    pub twist: TwistLimits,
    /// Highest speed, in m/s; > 0, infinite for no limit.
    pub max_speed_m_s: f32,
    /// The plan's share of the wheels' highest speed; > 0, ≤ 1: the rest is for catching up.
    pub wheel_share: f32,
}

impl PathLimits {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(self.twist.validate(), in "twist");
        ok!(positive_or_unlimited("max_speed_m_s", self.max_speed_m_s));
        ok!(positive("wheel_share", self.wheel_share));
        ConfigError::check(self.wheel_share <= 1.0, "wheel_share", self.wheel_share, "at most 1")
    }
}

/// A path with the speed at each place of it: where a base shall be at each time, how fast it then
/// moves, and with which acceleration. [The module](super) has an example.
///
/// The speed is the highest that all limits allow, but for less than 2 % of the time, which a grid
/// of 24 cells in each leg costs. It takes 164 bytes a waypoint. Made by [`new`](Self::new), or in portions by a [`Planner`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan<const N: usize> {
    /// The last is not used, nor are its speeds.
    legs: [Leg; N],
    /// In m/s, at the beginnings of the cells.
    speeds: [Squares; N],
    end: Pose,
    limits: TwistLimits,
    duration: f32,
}

/// The motion that a plan has at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedMotion {
    /// Where the base shall be.
    pub pose: Pose,
    /// How it shall move.
    pub twist: Twist<FieldFrame>,
    /// How that changes in a second, in m/s² and rad/s².
    pub acceleration: Twist<FieldFrame>,
}

impl<const N: usize> Plan<N> {
    /// The plan of this path and base, from `start_speed` in m/s along it (0 at a stand) to rest.
    ///
    /// About 21,000 instructions a leg on a Cortex-M7; a [`Planner`] spreads them over ticks.
    ///
    /// # Errors
    /// A limit that cannot be used, a base that cannot move sideways, or a start that is too fast.
    pub fn new<const WHEELS: usize>(
        path: &Path<N>,
        base: &Base<WHEELS>,
        limits: &PathLimits,
        start_speed: f32,
    ) -> Result<Self, PlanError> {
        let mut planner = Planner::new(path, base, limits, start_speed)?;
        loop {
            if let Some(plan) = planner.step()? {
                return Ok(plan);
            }
        }
    }

    /// The time that the path takes.
    #[must_use]
    pub const fn duration(&self) -> Seconds {
        Seconds::new(self.duration)
    }

    /// The last waypoint.
    pub const fn end(&self) -> Pose {
        self.end
    }

    /// The motion at a time from the beginning; after the [`duration`](Self::duration) a stand at
    /// the last waypoint. It searches all cells; a [`Follower`](super::Follower) does not.
    #[must_use]
    pub fn at(&self, time: Seconds) -> PlannedMotion {
        let mut cursor = Cursor::START;
        cursor.advance(self.track(), time.get());
        cursor.motion(self.track(), &mut [0.0; 2])
    }

    pub(super) fn track(&self) -> Track<'_> {
        let legs = N.saturating_sub(1);
        let (legs, speeds) = (&self.legs[..legs], &self.speeds[..legs]);
        Track { legs, speeds, end: self.end, limits: self.limits }
    }
}

/// Makes a [`Plan`] in portions, one leg at a time, twice.
///
/// ```
/// # mod table { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/docs/path.rs")); }
/// # use table::{BASE, LIMITS, PATH};
/// use rc10_app::path::Planner;
///
/// let mut planner = Planner::new(&PATH, &BASE, &LIMITS, 0.0)?;
/// let mut ticks = 0;
/// let plan = loop {
///     ticks += 1; // one step a tick
///     if let Some(plan) = planner.step()? {
///         break plan;
///     }
/// };
/// assert_eq!(ticks, 4);
/// assert!((plan.duration().get() - 2.45).abs() < 0.01);
/// # Ok::<(), rc10_app::path::PlanError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Planner<'a, const N: usize> {
    plan: Plan<N>,
    bounds: Bounds<'a>,
    waypoints: &'a [Waypoint],
    /// Squares of the speeds at the start, and where the pass has come to.
    start: f32,
    pass: Pass,
    square: f32,
}

/// The leg that is next in one of both passes.
#[derive(Clone, Copy, Debug)]
enum Pass {
    Backward(usize),
    Forward(usize),
}

impl<'a, const N: usize> Planner<'a, N> {
    /// Begins a plan, by the geometry of the path. Arguments and errors as those of [`Plan::new`].
    ///
    /// # Errors
    /// A limit that cannot be used, or a base that cannot move sideways.
    pub fn new<const WHEELS: usize>(
        path: &'a Path<N>,
        base: &'a Base<WHEELS>,
        limits: &PathLimits,
        start_speed: f32,
    ) -> Result<Self, PlanError> {
        limits.validate().map_err(PlanError::Limits)?;
        not_negative("start_speed", start_speed).map_err(PlanError::Limits)?;
        let across = [Twist::new(1.0, 0.0, 0.0), Twist::new(0.0, 1.0, 0.0)];
        if across.iter().any(|&across| base.sideways(across).abs() > 0.0) {
            return Err(PlanError::CannotMoveSideways);
        }
        let waypoints = path.waypoints();
        let mut plan = Plan {
            legs: [Leg::default(); N],
            speeds: [[0.0; CELLS]; N],
            end: waypoints.last().map_or(Pose::IDENTITY, |last| last.pose),
            limits: limits.twist,
            duration: 0.0,
        };
        let legs = &mut plan.legs[..N.saturating_sub(1)];
        leg::lay(waypoints, legs);
        Ok(Self {
            bounds: Bounds {
                rows: base.rows(),
                wheel_speed: base.max_wheel_speed().get() * limits.wheel_share,
                speed_squared: limits.max_speed_m_s * limits.max_speed_m_s,
                acceleration: limits.twist.linear_m_s2,
                angular_acceleration: limits.twist.angular_rad_s2,
            },
            pass: Pass::Backward(legs.len().saturating_sub(1)),
            plan,
            waypoints,
            start: start_speed * start_speed,
            square: 0.0,
        })
    }

    /// Does one leg more, 15,000 instructions at most; `Some` with the plan after the last.
    ///
    /// # Errors
    /// A start that is too fast, once it is known.
    pub fn step(&mut self) -> Result<Option<Plan<N>>, PlanError> {
        let Plan { legs, speeds, duration, .. } = &mut self.plan;
        match self.pass {
            Pass::Backward(leg) => {
                let mut end = self.square.min(leg::speed_squared(self.waypoints, leg + 1));
                speed::backward(&self.bounds, &legs[leg], &mut speeds[leg], &mut end);
                // The beginning of the next leg, or of none.
                if let Some([square, ..]) = speeds.get_mut(leg + 1) {
                    *square = end;
                }
                self.square = speeds[leg][0];
                self.pass = leg.checked_sub(1).map_or(Pass::Forward(0), Pass::Backward);
                Ok(None)
            }
            Pass::Forward(leg) if leg + 1 < N => {
                if leg == 0 {
                    let allowed = self.square.min(leg::speed_squared(self.waypoints, 0));
                    if self.start > allowed {
                        return Err(PlanError::TooFast { allowed: maths::fast_sqrt(allowed) });
                    }
                    self.square = self.start;
                }
                let end = speeds.get(leg + 1).map_or(0.0, |[square, ..]| *square);
                let (square, time) =
                    speed::forward(&self.bounds, &legs[leg], &mut speeds[leg], self.square, end);
                self.square = square;
                *duration += time;
                self.pass = Pass::Forward(leg + 1);
                Ok((leg + 2 == N).then_some(self.plan))
            }
            Pass::Forward(_) => Ok(Some(self.plan)),
        }
    }
}

/// The part of a plan that a follower needs, whatever its size.
#[derive(Clone, Copy)]
pub(super) struct Track<'a> {
    legs: &'a [Leg],
    speeds: &'a [Squares],
    end: Pose,
    pub(super) limits: TwistLimits,
}

impl Track<'_> {
    fn speeds(&self, leg: usize, cell: usize) -> Option<(f32, f32)> {
        let speeds = self.speeds.get(leg)?;
        let next = match speeds.get(cell + 1) {
            Some(next) => *next,
            None => self.speeds.get(leg + 1).map_or(0.0, |[first, ..]| *first),
        };
        Some((*speeds.get(cell)?, next))
    }
}

/// A time on a plan: a cell, and the time since its beginning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cursor {
    leg: usize,
    cell: usize,
    time: f32,
}

impl Cursor {
    pub(super) const START: Self = Self { leg: 0, cell: 0, time: 0.0 };

    pub(super) fn is_at_end(&self, track: Track<'_>) -> bool {
        self.leg >= track.legs.len()
    }

    /// Goes on by a time in seconds, to the end at most. A negative or NaN time counts as zero.
    pub(super) fn advance(&mut self, track: Track<'_>, time: f32) {
        self.time += time.max(0.0);
        while let (Some(leg), Some((from, to))) =
            (track.legs.get(self.leg), track.speeds(self.leg, self.cell))
        {
            let duration = speed::duration(leg.cell(self.cell).length, from, to);
            if self.time < duration {
                return;
            }
            self.time -= duration;
            self.cell += 1;
            if self.cell == CELLS {
                (self.leg, self.cell) = (self.leg + 1, 0);
            }
        }
        self.time = 0.0;
    }

    /// The motion at this time; `direction` becomes the path's, but stays at its end.
    pub(super) fn motion(&self, track: Track<'_>, direction: &mut [f32; 2]) -> PlannedMotion {
        let leg_and_speeds = track.legs.get(self.leg).zip(track.speeds(self.leg, self.cell));
        let Some((leg, (from, to))) = leg_and_speeds else {
            return PlannedMotion {
                pose: track.end,
                twist: Twist::STOP,
                acceleration: Twist::STOP,
            };
        };
        let cell = leg.cell(self.cell);
        // Constant in the cell, by the squares of the speeds.
        let rise = 0.5 * (to - from) * (to + from);
        let rise = if cell.length > 0.0 { rise / cell.length } else { 0.0 };
        let speed = from + rise * self.time;
        let way = (from + 0.5 * rise * self.time) * self.time;
        let spot = leg.spot(cell.start + way, cell.curvature);
        let ([x, y], heading) = (spot.along, spot.heading);
        *direction = spot.along;
        let across = cell.curvature * speed * speed;
        let angle = Radians::new(shortest_way_f32(0.0, heading.angle, TAU));
        PlannedMotion {
            pose: Pose::new(spot.x, spot.y, angle),
            twist: Twist::new(speed * x, speed * y, speed * heading.slope),
            acceleration: Twist::new(
                rise * x - across * y,
                rise * y + across * x,
                rise * heading.slope + heading.bend * speed * speed,
            ),
        }
    }
}
