//! Which way is the fastest: the course from a state to a place and a velocity there.

use super::transition::{Bounds, Transition, natural};
use crate::maths;

/// A state, where it shall go, and within which limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) bounds: Bounds,
    /// Limits of the velocity: the lower one is not above 0, the upper one not below.
    pub(super) slowest: f32,
    pub(super) fastest: f32,
    /// Velocity and acceleration at the beginning.
    pub(super) velocity: f32,
    pub(super) acceleration: f32,
    pub(super) way: f32,
    /// Velocity there.
    pub(super) to: f32,
}

/// Two transitions and a part at constant velocity between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    pub(super) first: Transition,
    /// Duration of the part between, at the velocity at which `first` ends.
    pub(super) cruise: f32,
    pub(super) last: Transition,
}

impl Course {
    pub(super) fn way(&self) -> f32 {
        self.first.way() + self.cruise * self.first.to + self.last.way()
    }

    pub(super) fn duration(&self) -> f32 {
        self.first.duration() + self.cruise + self.last.duration()
    }
}

/// Evaluations of a course after which a search takes the best that it has.
const TRIES: u32 = 9;
/// A course this share of all distances off its target is exact: rounding errors are as large.
const EXACT: f32 = 1e-6;
/// One this share short covers the rest at full velocity, later by about this share.
const SHORT: f32 = 3e-5;

impl Motion {
    /// The same, seen in a mirror.
    fn mirrored(&self) -> Self {
        Self {
            bounds: self.bounds,
            slowest: -self.fastest,
            fastest: -self.slowest,
            velocity: -self.velocity,
            acceleration: -self.acceleration,
            way: -self.way,
            to: -self.to,
        }
    }

    /// The transition to the velocity `to`, wherever it ends.
    pub(super) fn direct(&self) -> Course {
        let excess = self.to - natural(&self.bounds, self.velocity, self.acceleration);
        self.course(self.to, excess, 0.0)
    }

    /// [`over`](Self::over), out of line.
    #[inline(never)]
    fn course(&self, peak: f32, rise: f32, fall: f32) -> Course {
        self.over(peak, rise, fall)
    }

    /// By way of the velocity `peak`: `rise` above the natural one, and `fall` above the last.
    #[inline(always)]
    fn over(&self, peak: f32, rise: f32, fall: f32) -> Course {
        let Self { bounds, velocity, acceleration, to, .. } = self;
        Course {
            first: Transition::new(bounds, *velocity, *acceleration, rise, peak),
            cruise: 0.0,
            last: Transition::new(bounds, peak, 0.0, fall, *to),
        }
    }

    /// How far such a course ends beyond the target.
    #[inline(never)]
    fn beyond(&self, peak: f32, rise: f32, fall: f32) -> f32 {
        self.over(peak, rise, fall).way() - self.way
    }

    /// With an acceleration that rises to `eased`, not above 0, and falls: never 0 before the end.
    #[inline(always)]
    fn easing(&self, eased: f32) -> Course {
        let Self { bounds, velocity, acceleration, to, .. } = *self;
        let time = (eased - acceleration) * bounds.per_jerk;
        let then = velocity + time * 0.5 * (acceleration + eased);
        let first = Transition {
            velocity,
            acceleration,
            to: then,
            peak: eased,
            times: [time, 0.0, 0.0],
            velocities: [then; 2],
            ways: [time * (velocity + time * (2.0 * acceleration + eased) * (1.0 / 6.0)), 0.0, 0.0],
        };
        let excess = to - natural(&bounds, velocity, acceleration);
        Course { first, cruise: 0.0, last: Transition::new(&bounds, then, eased, excess, to) }
    }

    /// The fastest course, and whether it is that of the mirrored motion.
    ///
    /// A trajectory that gives way to the direct transition later covers more distance: so the side
    /// is known, and on it the peak velocity decides. The distance grows with it (first shrinks for
    /// another sign at the target), and a root finder meets the target.
    pub(super) fn fastest(&self) -> (Course, bool) {
        let direct = self.direct();
        let short = self.way - direct.way();
        if short.abs() <= EXACT * (self.way.abs() + direct.first.distance()) {
            (direct, false)
        } else if short > 0.0 {
            (self.upwards(&direct, -short), false)
        } else {
            (self.mirrored().upwards(&direct, short), true)
        }
    }

    /// The fastest course where the direct transition ends short by `missed`, which is negative.
    fn upwards(&self, direct: &Course, missed: f32) -> Course {
        let natural = natural(&self.bounds, self.velocity, self.acceleration);
        // From this peak on more velocity is more distance; a lowered limit leaves peaks below it.
        let is_down = natural > self.to && natural <= self.fastest;
        let lower = if is_down { natural } else { self.to };
        let (rise, fall) = (lower - natural, self.to - lower);
        let peak_at = |more: f32| (lower + more, rise + more, fall - more);
        let beyond = |(peak, rise, fall)| self.beyond(peak, rise, fall);
        let over = |(peak, rise, fall)| self.course(peak, rise, fall);
        let scale = self.way.abs() + direct.first.distance();

        let room = self.fastest - lower;
        let excess = beyond(peak_at(room));
        if excess <= 0.0 {
            let mut course = over(peak_at(room));
            if self.fastest > 0.0 {
                course.cruise = -excess / self.fastest;
            }
            return course;
        }
        let mut lowest = missed;
        if self.acceleration < 0.0 && natural >= self.to && natural <= self.fastest {
            let at_natural = beyond(peak_at(0.0));
            if at_natural > 0.0 {
                let limit = -self.bounds.acceleration;
                let lowest_acceleration =
                    if self.acceleration > limit { self.acceleration } else { limit };
                let eased = root(
                    (lowest_acceleration, missed),
                    (0.0, at_natural),
                    0.5 * lowest_acceleration,
                    (EXACT * scale, EXACT * scale),
                    |eased| self.easing(eased).way() - self.way,
                );
                return self.easing(eased);
            }
            lowest = at_natural;
        }
        // The distance grows with a root of the velocity at first, so the search is for that root.
        let most = maths::near_sqrt(room);
        // Only forwards the rest can be covered at the peak.
        let short = if lower < 0.0 { EXACT } else { SHORT };
        let root = root(
            (0.0, lowest),
            (most, excess),
            self.guess(lower, -lowest).min(0.9 * most),
            (short * scale, EXACT * scale),
            |root| beyond(peak_at(root * root)),
        );
        let mut course = over(peak_at(root * root));
        let rest = self.way - course.way();
        if rest > 0.0 && course.first.to > 0.0 {
            course.cruise = rest / course.first.to;
        }
        course
    }

    /// Roughly the root of the velocity to add to `lower` for `more` distance: a symmetric rise and
    /// fall, without the jerk's limit or the acceleration's.
    fn guess(&self, lower: f32, more: f32) -> f32 {
        let Bounds { acceleration, jerk, per_jerk } = self.bounds;
        // 2 lower y + y² = acceleration · more
        let product = acceleration * more;
        let root = maths::fast_sqrt(lower * lower + product);
        let square = if lower < 0.0 { root - lower } else { product / (root + lower) };
        if per_jerk <= 0.0 {
            return maths::fast_sqrt(square);
        }
        // root³ + 2 lower root = half
        let half = 0.5 * more * maths::fast_sqrt(jerk);
        let cube_root = maths::rough_cbrt(half);
        let by_jerk = if lower < 0.0 {
            maths::fast_sqrt(half / cube_root - 2.0 * lower)
        } else {
            let linear = 0.5 * half / lower.abs();
            if linear < cube_root { linear } else { cube_root }
        };
        let by_acceleration = maths::fast_sqrt(square);
        if by_jerk < by_acceleration { by_jerk } else { by_acceleration }
    }

    /// The course that takes `duration`, which is not less than that of `fastest`, at a lower
    /// velocity between. `None` without one: to brake and start again would take longer.
    pub(super) fn lasting(
        &self,
        duration: f32,
        fastest: &Course,
        is_mirrored: bool,
    ) -> Option<Course> {
        if is_mirrored {
            return self.mirrored().lasting(duration, fastest, false);
        }
        let natural = natural(&self.bounds, self.velocity, self.acceleration);
        let peak_at = |peak: f32| {
            let mut course = self.course(peak, peak - natural, self.to - peak);
            course.cruise = duration - course.duration();
            course
        };
        let beyond = |peak: f32| peak_at(peak).way() - self.way;
        let scale = self.way.abs() + fastest.first.distance() + fastest.last.distance();
        let exact = EXACT * scale;
        // The distance grows by the duration for each unit of the peak, or by less.
        let standing = beyond(0.0);
        let guess = -standing / duration;
        let (low, high) = if standing < 0.0 {
            let highest = fastest.first.to;
            ((0.0, standing), (highest, beyond(highest)))
        } else {
            let lowest = (2.0 * guess).max(self.slowest);
            ((lowest, beyond(lowest)), (0.0, standing))
        };
        let peak = if standing.abs() <= exact {
            0.0
        } else if low.1 < 0.0 && high.1 > 0.0 {
            root(low, high, guess, (exact, exact), beyond)
        } else {
            return None;
        };
        let course = peak_at(peak);
        (course.cruise >= 0.0 && beyond(peak).abs() <= 20.0 * exact).then_some(course)
    }
}

/// The root between two places with `value` negative at the first and positive at the second,
/// within `tolerance`. After [`TRIES`] the better end of the bracket.
///
/// N. Anderson and Å. Björck, A new high order method of regula falsi type, BIT 13 (1973): a secant
/// whose lasting end loses weight; halved where that is slow.
fn root(
    mut low: (f32, f32),
    mut high: (f32, f32),
    first: f32,
    tolerance: (f32, f32),
    value: impl Fn(f32) -> f32,
) -> f32 {
    let mut at = first;
    // Values at the ends, the one that stays with less weight.
    let (mut left, mut right) = (low.1, high.1);
    let mut bracket = high.0 - low.0;
    let mut was_below = None;
    for tries in 1..=TRIES {
        let new = value(at);
        if -tolerance.0 <= new && new <= tolerance.1 {
            return at;
        }
        let is_below = new < 0.0;
        let (old, stays) = if is_below { (low.1, &mut right) } else { (high.1, &mut left) };
        if was_below == Some(is_below) {
            let weight = 1.0 - new / old;
            *stays *= if weight > 0.1 { weight } else { 0.5 };
        }
        was_below = Some(is_below);
        if is_below {
            (low, left) = ((at, new), new);
        } else {
            (high, right) = ((at, new), new);
        }
        let width = high.0 - low.0;
        if width < EXACT * high.0.abs() {
            break;
        }
        at = low.0 - left * width / (right - left);
        if tries == 1 && is_below {
            // The first guess is good, so the place is near; unless it hardly made a difference.
            let near = if new < 0.5 * old { 5.0 * low.0 } else { 1.5 * low.0 };
            let middle = low.0 + 0.5 * width;
            at = if near < middle { near } else { middle };
        } else if !(low.0 < at && at < high.0) || tries % 3 == 0 && width > 0.5 * bracket {
            at = low.0 + 0.5 * width;
        }
        if tries % 3 == 0 {
            bracket = width;
        }
    }
    if -low.1 < high.1 { low.0 } else { high.0 }
}
