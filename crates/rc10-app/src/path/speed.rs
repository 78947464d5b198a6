//! The highest speed along a leg: a pass backwards over its cells, then one forwards.
//!
//! In each cell the acceleration `u` along the path is constant: the square `x` of the speed is
//! linear. With θ', θ'' the heading's slope and bend over the way, κ the curvature:
//!
//! * the acceleration of the yaw rate is θ'' x + θ' u,
//! * the acceleration along and across the path is (u, κ x),
//! * the speed of a wheel is √x (row · (cos φ, sin φ, θ')), φ the path's direction to the robot.
//!
//! All of it holds for the whole cell, not at its ends only. κ x is linear within it. θ'' x + θ' u is
//! a parabola, which stays within its three control values. What the speed of a wheel may exceed the
//! straight line between both ends by is bounded by its second derivative.
//!
//! No speed is allowed where `u = 0` would break a limit: slowing down is always possible, and two
//! passes are enough, as all is convex in x at both ends, and lower speeds are allowed too. (Pham
//! and Pham, TOPP-RA, IEEE Trans. Robotics 34, 2018.)

use super::leg::{CELLS, Cell, Heading, Leg, Spot};
use crate::maths;

/// A little below one: what [`maths::fast_sqrt`] may be off.
const BELOW_ONE: f32 = 1.0 - 1e-5;

#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<'a> {
    /// rpm of each wheel for (vx, vy, wz).
    pub(super) rows: &'a [[f32; 3]],
    pub(super) wheel_speed: f32,
    /// m/s, squared.
    pub(super) speed_squared: f32,
    /// m/s².
    pub(super) acceleration: f32,
    /// rad/s².
    pub(super) angular_acceleration: f32,
}

/// The squares of the speeds at the beginnings of a leg's cells.
pub(super) type Squares = [f32; CELLS];

/// A cell's numbers to change the speed: the headings at its ends, the known end first.
#[derive(Clone, Copy)]
struct Ends {
    cell: Cell,
    slopes: [f32; 2],
    bends: [f32; 2],
}

impl Ends {
    fn new(cell: Cell, first: Heading, last: Heading) -> Self {
        Self { cell, slopes: [first.slope, last.slope], bends: [first.bend, last.bend] }
    }

    fn reversed(self) -> Self {
        let ([first, last], [at_first, at_last]) = (self.slopes, self.bends);
        Self { cell: self.cell, slopes: [-last, -first], bends: [at_last, at_first] }
    }

    /// The square at the other end after the most increase from `square`, which may be kept.
    fn rise(&self, bounds: &Bounds<'_>, square: f32) -> f32 {
        let Cell { length, curvature, .. } = self.cell;
        // u² + κ² (x + 2 l u)² = a² at the end where the speed is higher.
        let bent = curvature * curvature;
        let factor = 1.0 + 4.0 * length * length * bent;
        let most = bounds.acceleration;
        let root = maths::fast_sqrt(most * most * factor - bent * square * square);
        let mut rise = ((root * BELOW_ONE - 2.0 * length * bent * square) / factor).max(0.0);
        let ([slope, end_slope], [bend, end_bend]) = (self.slopes, self.bends);
        for (constant, factor) in [
            (bend, slope),
            (end_bend, end_slope + 2.0 * length * end_bend),
            (0.5 * (bend + end_bend), slope + 1.5 * length * bend),
        ] {
            // |constant x + factor u| ≤ the limit, of which u = 0 leaves something.
            let left = bounds.angular_acceleration - constant * square * 1.0_f32.copysign(factor);
            if factor.abs() * rise > left {
                rise = (left / factor.abs()).max(0.0);
            }
        }
        square + 2.0 * length * rise
    }

    /// The highest speeds, squared, at both ends, if they may be kept.
    fn caps(&self, bounds: &Bounds<'_>, leg: &Leg, ends: [[f32; 2]; 2]) -> [f32; 2] {
        let Cell { length, curvature, .. } = self.cell;
        // By the second derivative of a wheel's speed over the way, which is that of a twist that
        // turns by φ' = κ − θ', φ'' = −θ'' and whose turning has θ'''.
        let turns = (curvature - self.slopes[0]).abs().max((curvature - self.slopes[1]).abs());
        let bends = self.bends[0].abs().max(self.bends[1].abs());
        let eighth = 0.125 * length * length;
        let (by_moving, by_turning) =
            (eighth * (turns * turns + bends), eighth * leg.bend_slope().abs());
        let mut fastest = [0.0_f32; 2];
        for &[x, y, turn] in bounds.rows {
            let between = (x.abs() + y.abs()) * by_moving + turn.abs() * by_turning;
            for ((fastest, [along, across]), slope) in fastest.iter_mut().zip(ends).zip(self.slopes)
            {
                let wheel = (x * along + y * across + turn * slope).abs() + between;
                *fastest = if wheel > *fastest { wheel } else { *fastest };
            }
        }
        // x is linear, its bound sags between the ends: 3/8 of (ratio − 1)² is more than that.
        let [first, last] = fastest;
        let ratio = (last - first) / first.min(last);
        let sag = 1.0 + 0.375 * ratio * ratio;
        let common = bounds.speed_squared.min(bounds.acceleration * BELOW_ONE / curvature.abs());
        let mut caps = [common; 2];
        for ((cap, fastest), bend) in caps.iter_mut().zip(fastest).zip(self.bends) {
            let speed = bounds.wheel_speed / (fastest * sag);
            *cap = cap.min(speed * speed).min(bounds.angular_acceleration / bend.abs());
        }
        caps
    }
}

/// The path's direction in the robot's axes.
fn direction(spot: &Spot) -> [f32; 2] {
    let ((sin, cos), [x, y]) = (maths::sin_cos(spot.heading.angle), spot.along);
    [x * cos + y * sin, y * cos - x * sin]
}

/// The pass backwards: highest squares that can slow to `end`, which it lowers to the leg's.
pub(super) fn backward(bounds: &Bounds<'_>, leg: &Leg, squares: &mut Squares, end: &mut f32) {
    let last = leg.cell(CELLS - 1);
    let mut after = leg.spot(leg.length(), last.curvature);
    let mut after_direction = direction(&after);
    let mut next = *end;
    for at in (0..CELLS).rev() {
        let cell = leg.cell(at);
        let spot = leg.spot(cell.start, cell.curvature);
        let its_direction = direction(&spot);
        let ends = Ends::new(cell, spot.heading, after.heading);
        let [cap, next_cap] = ends.caps(bounds, leg, [its_direction, after_direction]);
        next = next.min(next_cap);
        *squares.get_mut(at + 1).unwrap_or(end) = next;
        next = if next >= cap { cap } else { ends.reversed().rise(bounds, next).min(cap) };
        (after, after_direction) = (spot, its_direction);
    }
    squares[0] = next;
}

/// The pass forwards: from the square `start` on, which is at most the first of `squares`, as fast
/// as they allow. Turns them into speeds, in m/s. Returns the square at the end, and the time.
pub(super) fn forward(
    bounds: &Bounds<'_>,
    leg: &Leg,
    speeds: &mut Squares,
    start: f32,
    end: f32,
) -> (f32, f32) {
    let (mut square, mut speed, mut time) = (start, maths::fast_sqrt(start), 0.0);
    let mut before = leg.heading(0.0);
    for at in 0..CELLS {
        let cell = leg.cell(at);
        let after = leg.heading(cell.start + cell.length);
        let most = speeds.get(at + 1).copied().unwrap_or(end);
        speeds[at] = speed;
        square = if square >= most {
            most
        } else {
            Ends::new(cell, before, after).rise(bounds, square).min(most)
        };
        let next = maths::fast_sqrt(square);
        time += duration(cell.length, speed, next);
        (speed, before) = (next, after);
    }
    (square, time)
}

/// Time for a way with a constant acceleration between two speeds.
pub(super) fn duration(way: f32, from: f32, to: f32) -> f32 {
    let sum = from + to;
    if sum > 0.0 { 2.0 * way / sum } else { 0.0 }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_sag_between_the_ends_is_less_than_what_is_taken_off() {
        // Speed² · (wheel per speed)² with a limit of 1, in f64: the first linear, the other
        // linear and squared.
        for step in 0..2000_u16 {
            let last = 1.0 + f64::from(step) * 0.002;
            let sag = 1.0 + 0.375 * (last - 1.0) * (last - 1.0);
            let [x, end_x] = [1.0, last].map(|wheel| 1.0 / (wheel * sag * wheel * sag));
            for part in 0..=200_u8 {
                let part = f64::from(part) / 200.0;
                let wheel = 1.0 + part * (last - 1.0);
                let speed_squared = x + part * (end_x - x);
                assert!(speed_squared * wheel * wheel <= 1.0 + 1e-12, "{last} {part}");
            }
        }
    }
}
