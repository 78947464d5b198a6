//! A course laid out in time.

use super::course::Course;
use super::double::Double;
use super::transition::Transition;

/// A piece of constant jerk: what holds at its beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Phase {
    /// Time since the plan's beginning.
    begin: Double,
    way: f32,
    velocity: f32,
    acceleration: f32,
    jerk: f32,
}

/// The state of a plan at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Planned {
    /// Distance from where the plan began.
    pub(super) way: f32,
    pub(super) velocity: f32,
    pub(super) acceleration: f32,
}

/// At most seven pieces of constant jerk, and the time since the first began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    phases: [Phase; 7],
    count: u8,
    present: u8,
    elapsed: Double,
    duration: f32,
    /// Velocity that is added to all: that of a target that moves.
    frame: f32,
    /// Velocity of the way alone: the frame's, and the rounding errors over the duration.
    drift: f32,
}

impl Plan {
    /// Nothing to do.
    pub(super) const DONE: Self = Self {
        phases: [Phase {
            begin: Double::ZERO,
            way: 0.0,
            velocity: 0.0,
            acceleration: 0.0,
            jerk: 0.0,
        }; 7],
        count: 0,
        present: 0,
        elapsed: Double::ZERO,
        duration: 0.0,
        frame: 0.0,
        drift: 0.0,
    };

    /// Begins `course`, the other way if `is_mirrored`, which takes `duration`; `jerk` is the
    /// limit. It ends after `way` exactly. All of it moves with the velocity `frame`.
    pub(super) fn lay(
        &mut self,
        course: &Course,
        is_mirrored: bool,
        jerk: f32,
        duration: f32,
        way: Option<f32>,
        frame: f32,
    ) {
        let sign = if is_mirrored { -1.0 } else { 1.0 };
        (self.count, self.present, self.elapsed) = (0, 0, Double::ZERO);
        (self.duration, self.frame) = (duration, frame);
        let mut end = Phase::default();
        self.transition(&mut end, &course.first, sign, jerk);
        let cruise = sign * course.first.to;
        self.push(&mut end, course.cruise, course.cruise * cruise, (cruise, 0.0, 0.0));
        self.transition(&mut end, &course.last, sign, jerk);
        let missed = way.map_or(0.0, |way| way - end.way);
        self.drift = frame + if duration > 0.0 { missed / duration } else { 0.0 };
    }

    fn transition(&mut self, end: &mut Phase, transition: &Transition, sign: f32, jerk: f32) {
        let Transition { velocity, acceleration, peak, times, velocities, ways, .. } = *transition;
        let starts = [
            (velocity, acceleration, jerk.copysign(peak - acceleration)),
            (velocities[0], peak, 0.0),
            (velocities[1], peak, -jerk.copysign(peak)),
        ];
        for ((time, way), (velocity, acceleration, jerk)) in times.into_iter().zip(ways).zip(starts)
        {
            self.push(end, time, sign * way, (sign * velocity, sign * acceleration, sign * jerk));
        }
    }

    /// Adds a piece that begins where `end` says; `end` is then its end.
    fn push(&mut self, end: &mut Phase, time: f32, way: f32, start: (f32, f32, f32)) {
        // Also keeps the infinite jerk of a piece without duration out.
        if time > 0.0
            && let Some(phase) = self.phases.get_mut(usize::from(self.count))
        {
            let (velocity, acceleration, jerk) = start;
            *phase = Phase { begin: end.begin, way: end.way, velocity, acceleration, jerk };
            self.count += 1;
            end.begin = end.begin.plus(time);
            end.way += way;
        }
    }

    pub(super) const fn elapsed(&self) -> f32 {
        self.elapsed.rounded()
    }

    pub(super) const fn is_over(&self) -> bool {
        self.remaining() <= 0.0
    }

    /// Time that is left; negative afterwards.
    pub(super) const fn remaining(&self) -> f32 {
        Double::new(self.duration).minus(self.elapsed)
    }

    pub(super) const fn advance(&mut self, dt: f32) {
        self.elapsed = self.elapsed.plus(dt);
    }

    /// The state of the plan now.
    pub(super) fn now(&mut self) -> Planned {
        while self.present + 1 < self.count
            && let Some(next) = self.phases.get(usize::from(self.present) + 1)
            && self.elapsed.minus(next.begin) >= 0.0
        {
            self.present += 1;
        }
        let Phase { begin, way, velocity, acceleration, jerk } =
            self.phases.get(usize::from(self.present)).copied().unwrap_or_default();
        let time = self.elapsed.minus(begin);
        let gained = time * (acceleration + 0.5 * time * jerk);
        let covered = time * (velocity + time * (0.5 * acceleration + time * jerk * (1.0 / 6.0)));
        Planned {
            way: way + covered + self.drift * self.elapsed.rounded(),
            velocity: velocity + gained + self.frame,
            acceleration: acceleration + time * jerk,
        }
    }
}
