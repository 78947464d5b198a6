//! Geometry of a leg: from the middle of one corner to the middle of the next.
//!
//! A leg is half an arc, a line, and half the next arc: exact along the way, with constant
//! curvature in each. The heading is one cubic of the way with equal slopes at waypoints, so the
//! yaw rate is continuous.

use core::f32::consts::TAU;

use super::Waypoint;
use crate::angle::shortest_way_f32;
use crate::maths;

/// Cells of the speed's grid in each leg.
pub(super) const CELLS: usize = 24;
/// Cells in each half of an arc, if there is one.
const ARC_CELLS: u8 = 6;

/// A corner up to this, in rad, is passed straight: 3 mm/s at 3 m/s, which wheels do not feel.
const STRAIGHT: f32 = 1e-3;
/// Cosine of the sharpest corner that an arc may round off: 170 degrees.
const SHARPEST: f32 = -0.984_8;

/// Unit vector and distance in metres from one waypoint to another.
pub(super) const fn between(from: &Waypoint, to: &Waypoint) -> ([f32; 2], f32) {
    let (x, y) = (to.pose.x - from.pose.x, to.pose.y - from.pose.y);
    let square = x * x + y * y;
    if square < f32::MIN_POSITIVE {
        return ([0.0; 2], 0.0);
    }
    // Newton's root from above, to the last place or two: for a const, and once a leg.
    let mut length = if x.abs() > y.abs() { x.abs() } else { y.abs() };
    let mut step = 0;
    while step < 4 {
        length = 0.5 * (length + square / length);
        step += 1;
    }
    ([x / length, y / length], length)
}

/// A change of direction at a waypoint: its sine and cosine.
#[derive(Clone, Copy)]
pub(super) struct Turn {
    sin: f32,
    cos: f32,
}

impl Turn {
    pub(super) const fn at(before: &Waypoint, at: &Waypoint, after: &Waypoint) -> Self {
        let (([ax, ay], _), ([bx, by], _)) = (between(before, at), between(at, after));
        Self { sin: ax * by - ay * bx, cos: ax * bx + ay * by }
    }

    /// Whether it goes back by the way it came, or nearly.
    pub(super) const fn is_back(self) -> bool {
        self.cos < SHARPEST
    }

    /// Whether it is a corner, at which the path stops unless it is rounded off.
    pub(super) const fn is_corner(self) -> bool {
        self.sin.abs() > STRAIGHT || self.cos < 0.0
    }

    /// Length that an arc of this radius takes of the legs on both sides: radius · tan(turn / 2).
    pub(super) const fn takes(self, radius: f32) -> f32 {
        if radius > 0.0 && self.is_corner() {
            radius * self.sin.abs() / (1.0 + self.cos)
        } else {
            0.0
        }
    }

    /// The arc with this radius.
    fn arc(self, radius: f32) -> Arc {
        let takes = self.takes(radius);
        if takes > 0.0 {
            let angle = maths::atan2(self.sin, self.cos);
            let curvature = (1.0 / radius).copysign(self.sin);
            Arc { takes, half: 0.5 * radius * angle.abs(), curvature }
        } else {
            Arc::default()
        }
    }
}

/// The arc that rounds a corner off.
#[derive(Clone, Copy, Default)]
struct Arc {
    /// Length that the arc takes of each leg, in m.
    takes: f32,
    /// Half its length, in m.
    half: f32,
    /// 1/m, counter-clockwise positive.
    curvature: f32,
}

/// The highest speed at a waypoint, squared: 0 where it is a corner that is not rounded off.
pub(super) fn speed_squared(waypoints: &[Waypoint], at: usize) -> f32 {
    let Some(waypoint) = waypoints.get(at) else { return 0.0 };
    let around = waypoints.get(at.wrapping_sub(1)..).and_then(|rest| rest.first_chunk());
    let stops = around.is_some_and(|[before, at, after]| {
        at.radius_m <= 0.0 && Turn::at(before, at, after).is_corner()
    });
    if stops { 0.0 } else { waypoint.max_speed_m_s * waypoint.max_speed_m_s }
}

/// Slope and curvature of the heading over the way, at one place.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heading {
    /// rad
    pub(super) angle: f32,
    /// rad/m
    pub(super) slope: f32,
    /// rad/m²
    pub(super) bend: f32,
}

/// A part of a leg in which the acceleration along the path is constant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Way from the leg's beginning to the cell's, in m.
    pub(super) start: f32,
    /// In m.
    pub(super) length: f32,
    /// The path's curvature, in 1/m.
    pub(super) curvature: f32,
}

/// A place on the path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) x: f32,
    pub(super) y: f32,
    /// Unit vector of the path's direction.
    pub(super) along: [f32; 2],
    pub(super) heading: Heading,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Leg {
    /// Where the line begins.
    begin: [f32; 2],
    /// The line's direction, a unit vector.
    along: [f32; 2],
    /// Arc, line, arc, in m; and the length of one cell in each.
    lengths: [f32; 3],
    cell_lengths: [f32; 3],
    /// Number of cells in the first two.
    cells: [u8; 2],
    /// The arcs' curvatures.
    curvatures: [f32; 2],
    /// The heading over the way: coefficients of its cubic polynomial.
    heading: [f32; 4],
}

impl Leg {
    /// From one waypoint to the next, with the arcs there. The heading is not set yet.
    fn new(from: &Waypoint, to: &Waypoint, first: Arc, last: Arc) -> Self {
        let (along, distance) = between(from, to);
        let line = (distance - first.takes - last.takes).max(0.0);
        let cells_of = |arc: Arc| if arc.half > 0.0 { ARC_CELLS } else { 0 };
        let (before, after) = (cells_of(first), cells_of(last));
        #[expect(clippy::cast_possible_truncation, reason = "24")]
        let between = CELLS as u8 - before - after;
        let each = |length: f32, cells: u8| length / f32::from(cells.max(1));
        Self {
            begin: [from.pose.x + along[0] * first.takes, from.pose.y + along[1] * first.takes],
            along,
            lengths: [first.half, line, last.half],
            cell_lengths: [each(first.half, before), each(line, between), each(last.half, after)],
            cells: [before, between],
            curvatures: [first.curvature, last.curvature],
            heading: [0.0; 4],
        }
    }

    pub(super) fn length(&self) -> f32 {
        let [first, line, last] = self.lengths;
        first + line + last
    }

    /// The heading from `from` by `by`, rad, with slopes at the ends, rad/m: Hermite's cubic.
    fn turn(&mut self, from: f32, by: f32, slopes: [f32; 2]) {
        let length = self.length();
        let mean = by / length;
        let [first, last] = slopes;
        self.heading = [
            from,
            first,
            (3.0 * mean - 2.0 * first - last) / length,
            (first + last - 2.0 * mean) / (length * length),
        ];
    }

    /// The heading after this way.
    pub(super) fn heading(&self, way: f32) -> Heading {
        let [angle, slope, square, cube] = self.heading;
        Heading {
            angle: angle + way * (slope + way * (square + way * cube)),
            slope: slope + way * (2.0 * square + way * (3.0 * cube)),
            bend: 2.0 * square + way * (6.0 * cube),
        }
    }

    /// Change of the heading's bend, in rad/m³: constant.
    pub(super) fn bend_slope(&self) -> f32 {
        6.0 * self.heading[3]
    }

    pub(super) fn cell(&self, cell: usize) -> Cell {
        #[expect(clippy::cast_possible_truncation, reason = "below 24")]
        let cell = cell as u8;
        let ([before, between], [arc, line, _]) = (self.cells, self.lengths);
        let (piece, start, nth, curvature) = if cell < before {
            (0, 0.0, cell, self.curvatures[0])
        } else if cell < before + between {
            (1, arc, cell - before, 0.0)
        } else {
            (2, arc + line, cell - before - between, self.curvatures[1])
        };
        let length = self.cell_lengths[piece];
        Cell { start: start + f32::from(nth) * length, length, curvature }
    }

    /// Where the path is after this way, on a piece of this curvature.
    pub(super) fn spot(&self, way: f32, curvature: f32) -> Spot {
        let ([x, y], [along, across]) = (self.begin, self.along);
        let [arc, line, _] = self.lengths;
        // Both arcs touch the line, at its beginning and at its end.
        let on_line = maths::within((way - arc).max(0.0), line);
        let (x, y) = (x + along * on_line, y + across * on_line);
        let heading = self.heading(way);
        if curvature.abs() <= 0.0 {
            return Spot { x, y, along: self.along, heading };
        }
        let beyond = way - arc - on_line;
        // The chord of the arc, with half the angle: without a difference of near cosines.
        let (sin, cos) = maths::sin_cos(0.5 * curvature * beyond);
        let chord = 2.0 * sin / curvature;
        let turned = |sin: f32, cos: f32| [along * cos - across * sin, along * sin + across * cos];
        let [to_x, to_y] = turned(sin, cos);
        let direction = turned(2.0 * sin * cos, 1.0 - 2.0 * sin * sin);
        Spot { x: x + chord * to_x, y: y + chord * to_y, along: direction, heading }
    }
}

/// The legs of a path: one fewer than waypoints.
pub(super) fn lay(waypoints: &[Waypoint], legs: &mut [Leg]) {
    let mut first = Arc::default();
    for (at, leg) in legs.iter_mut().enumerate() {
        let (from, to) = (&waypoints[at], &waypoints[at + 1]);
        let last = waypoints
            .get(at + 2)
            .map_or_else(Arc::default, |after| Turn::at(from, to, after).arc(to.radius_m));
        *leg = Leg::new(from, to, first, last);
        first = last;
    }
    turn(waypoints, legs);
}

/// Sets the headings of all legs, the shorter way. At a waypoint the slope is the harmonic mean of
/// both legs', and 0 where the robot turns back: it never overshoots. (Fritsch and Butland, SIAM J.
/// Sci. Stat. Comput. 5, 1984.)
fn turn(waypoints: &[Waypoint], legs: &mut [Leg]) {
    let way = |leg: usize, length: f32| {
        let heading = |at: usize| waypoints.get(at).map_or(0.0, |at| at.pose.heading.get());
        let by = shortest_way_f32(heading(leg), heading(leg + 1), TAU);
        (by, by / length)
    };
    let mut from = waypoints.first().map_or(0.0, |first| first.pose.heading.get());
    let mut before = None;
    for at in 0..legs.len() {
        let (by, mean) = way(at, legs[at].length());
        let next = legs.get(at + 1).map(|next| way(at + 1, next.length()).1);
        let last = next.map_or(mean, |next| {
            if mean * next > 0.0 { 2.0 * mean * next / (mean + next) } else { 0.0 }
        });
        legs[at].turn(from, by, [before.unwrap_or(mean), last]);
        (from, before) = (from + by, Some(last));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::tests::Random;
    use crate::units::Radians;

    fn waypoint(random: &mut Random) -> Waypoint {
        let (x, y) = (random.within(3.0), random.within(3.0));
        Waypoint::new(x, y, Radians::new(random.within(3.0)))
    }

    #[test]
    fn the_distance_is_that_of_f64() {
        let mut random = Random(41);
        for size in [1.0, 1e-3, 300.0] {
            for _ in 0..1000 {
                let end = Waypoint::new(random.within(size), random.within(size), Radians::ZERO);
                let ([x, y], length) = between(&Waypoint::new(0.0, 0.0, Radians::ZERO), &end);
                let exact = libm::hypot(end.pose.x.into(), end.pose.y.into());
                assert!((f64::from(length) / exact - 1.0).abs() < 2e-7, "{end:?}");
                assert!((x * x + y * y - 1.0).abs() < 5e-7, "{x} {y}");
            }
        }
    }

    #[test]
    fn a_path_has_no_gap_and_no_kink_and_its_way_is_its_length() {
        let (mut random, mut paths) = (Random(42), 0);
        while paths < 50 {
            let mut waypoints = [(); 4].map(|()| waypoint(&mut random));
            waypoints[1].radius_m = 0.3;
            waypoints[2].radius_m = 0.5;
            if crate::path::Path::new(waypoints).is_err() {
                continue;
            }
            paths += 1;
            let mut legs = [Leg::default(); 3];
            lay(&waypoints, &mut legs);
            let mut before = legs[0].spot(0.0, 0.0);
            assert!(
                maths::hypot(before.x - waypoints[0].pose.x, before.y - waypoints[0].pose.y) < 1e-6
            );
            for (at, leg) in legs.iter().enumerate() {
                let mut sum = 0.0;
                for cell in (0..CELLS).map(|cell| leg.cell(cell)) {
                    assert!((cell.start - sum).abs() < 1e-5, "{at}: {cell:?}");
                    sum += cell.length;
                    let begin = leg.spot(cell.start, cell.curvature);
                    let gap = maths::hypot(begin.x - before.x, begin.y - before.y);
                    let [kink_x, kink_y] =
                        [0, 1].map(|axis| begin.along[axis] - before.along[axis]);
                    assert!(gap < 2e-5 && maths::hypot(kink_x, kink_y) < 2e-5, "{at}: {gap}");
                    let turned = begin.heading.angle - before.heading.angle;
                    assert!(turned.abs() < 1e-4, "{at}: {turned}");
                    assert!((begin.heading.slope - before.heading.slope).abs() < 1e-2, "{at}");
                    // The chord is as long as the way, but for the curvature.
                    before = leg.spot(cell.start + cell.length, cell.curvature);
                    let chord = maths::hypot(before.x - begin.x, before.y - begin.y);
                    let half = 0.5 * cell.curvature * cell.length;
                    let exact = cell.length * (1.0 - half * half / 6.0);
                    assert!((chord - exact).abs() < 1e-5, "{at}: {chord} {exact}");
                }
                assert!((sum - leg.length()).abs() < 1e-5);
            }
            let end = waypoints[3].pose;
            assert!(maths::hypot(before.x - end.x, before.y - end.y) < 1e-5);
        }
    }
}
