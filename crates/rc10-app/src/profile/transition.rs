//! From one velocity to another in the shortest time.

use crate::maths;

/// Limits of one axis in the form in which the formulas use them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Largest acceleration, either way.
    pub(super) acceleration: f32,
    /// Largest jerk, either way; may be infinite.
    pub(super) jerk: f32,
    /// The limit's reciprocal: 0 without a limit.
    pub(super) per_jerk: f32,
}

/// The shortest change of velocity that ends without acceleration: three pieces at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transition {
    /// Velocity and acceleration at the beginning.
    pub(super) velocity: f32,
    pub(super) acceleration: f32,
    /// Velocity at the end.
    pub(super) to: f32,
    /// Peak of the acceleration, with its sign.
    pub(super) peak: f32,
    /// Duration of each piece.
    pub(super) times: [f32; 3],
    /// Velocity at the end of the first piece, and of the second.
    pub(super) velocities: [f32; 2],
    /// Distance covered in each.
    pub(super) ways: [f32; 3],
}

impl Transition {
    /// From a velocity and an acceleration to the velocity `to`. `excess` is how far that is beyond
    /// the velocity at which the acceleration could be brought to 0 at once, which is [`natural`]:
    /// the caller knows it without the rounding of a difference, of which a root is taken here.
    ///
    /// The formulas are those of R. Haschke, E. Weitnauer and H. Ritter, On-line planning of
    /// time-optimal, jerk-limited trajectories, IROS 2008.
    #[inline(always)]
    pub(super) fn new(
        bounds: &Bounds,
        velocity: f32,
        acceleration: f32,
        excess: f32,
        to: f32,
    ) -> Self {
        let Bounds { acceleration: limit, jerk, per_jerk } = *bounds;
        let sign = 1.0_f32.copysign(excess);
        let size = excess.abs();
        // An acceleration that has the right direction is a part of the peak.
        let ahead = if acceleration * sign > 0.0 { acceleration * acceleration } else { 0.0 };
        // Without this, no change at an infinite jerk is not a number.
        let square = if size > 0.0 { size * jerk + ahead } else { ahead };
        let (height, hold) = if square > limit * limit {
            let ramps = (limit * limit - ahead) * per_jerk;
            // An acceleration beyond the limit, because the limit was lowered, only falls.
            let rest = if ramps > 0.0 { size - ramps } else { size };
            (limit, if rest > 0.0 { rest / limit } else { 0.0 })
        } else {
            (maths::near_sqrt(square), 0.0)
        };
        let peak = height * sign;
        let first = (peak - acceleration).abs() * per_jerk;
        let last = height * per_jerk;
        let begin = velocity + first * 0.5 * (acceleration + peak);
        let end = to - last * 0.5 * peak;
        let ways = [
            first * (velocity + first * (2.0 * acceleration + peak) * (1.0 / 6.0)),
            hold * 0.5 * (begin + end),
            last * (to - last * peak * (1.0 / 6.0)),
        ];
        let times = [first, hold, last];
        Self { velocity, acceleration, to, peak, times, velocities: [begin, end], ways }
    }

    /// Distance covered.
    #[inline(always)]
    pub(super) fn way(&self) -> f32 {
        let [first, second, third] = self.ways;
        first + second + third
    }

    /// Sum of the distances forwards and backwards: the scale of the rounding errors.
    pub(super) fn distance(&self) -> f32 {
        let [first, second, third] = self.ways;
        first.abs() + second.abs() + third.abs()
    }

    /// Time taken.
    pub(super) fn duration(&self) -> f32 {
        let [first, second, third] = self.times;
        first + second + third
    }
}

/// The velocity that is left once the jerk limit has brought the acceleration to 0.
pub(super) fn natural(bounds: &Bounds, velocity: f32, acceleration: f32) -> f32 {
    velocity + 0.5 * acceleration * acceleration.abs() * bounds.per_jerk
}
