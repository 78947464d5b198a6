//! The matrices of a base, solved in `const` f64: an unsound base does not compile.

use super::error::BaseError;
use super::wheel::{Tread, Wheel};
use crate::config::{ConfigError, finite, radius};
use crate::ok;
use crate::transform::Point;

/// Sine of the smallest angle of rollers to the axle, 5 degrees: the rim is eleven times as fast.
const LEAST_GRIP: f64 = 0.087;
/// Sine of the largest angle of plain wheels that count as parallel: 0.1 degrees, as built.
const PARALLEL: f64 = 0.0018;
/// Smallest eigenvalue by trace: below, 1 % of a wheel speed is more than all of the motion.
const SOUND: f64 = 1e-4;

/// The matrices of a base, in m/s at the rims.
pub(super) struct Solution<const N: usize> {
    /// Rim speeds of a twist, after what plain wheels refuse is taken out of it.
    pub(super) inverse: [[f64; 3]; N],
    /// The twist that explains rim speeds best: the sum over the wheels of column times speed.
    pub(super) forward: [[f64; 3]; N],
    /// The row of the sideways speed that plain wheels refuse, and its unit vector; or zero.
    pub(super) refused: ([f64; 3], [f64; 2]),
}

/// Checks each wheel, then all of them together.
pub(super) const fn solve<const N: usize>(wheels: &[Wheel; N]) -> Result<Solution<N>, BaseError> {
    let mut at = 0;
    while at < N {
        if let Err(error) = check(&wheels[at]) {
            return Err(BaseError::Wheel { wheel: at, error });
        }
        if wheels[at].grip() < LEAST_GRIP {
            return Err(BaseError::RollersAlongAxle { wheel: at });
        }
        at += 1;
    }
    let size = size(wheels);
    let plain = ok!(Plain::of(wheels));
    // Rows in the coordinates (along d, along e, wz · size), all metres a second.
    let mut rows = [[0.0; 3]; N];
    let mut normal = [[0.0; 3]; 3];
    at = 0;
    while at < N {
        rows[at] = plain.row(wheels[at].rim_row(), size);
        (normal, at) = (plus_square(normal, rows[at]), at + 1);
    }
    if plain.is_there {
        // Nothing moves along e. A number of the size of the others keeps the matrix regular.
        normal[1][1] = N as f64;
    }
    let adjugate = adjugate(&normal);
    let determinant = dot(normal[0], [adjugate[0][0], adjugate[1][0], adjugate[2][0]]);
    let minors = adjugate[0][0] + adjugate[1][1] + adjugate[2][2];
    let trace = normal[0][0] + normal[1][1] + normal[2][2];
    // determinant / minors is the smallest eigenvalue, or down to a third of it.
    let is_sound = determinant > SOUND * trace * minors && minors > SOUND * trace * trace;
    if !is_sound {
        return Err(plain.reason(free_motion(&normal, &adjugate, minors, trace), size));
    }
    let mut solution =
        Solution { inverse: [[0.0; 3]; N], forward: [[0.0; 3]; N], refused: plain.refused() };
    at = 0;
    while at < N {
        solution.inverse[at] = plain.twist_row(rows[at], size);
        let column = [
            dot(adjugate[0], rows[at]) / determinant,
            dot(adjugate[1], rows[at]) / determinant,
            dot(adjugate[2], rows[at]) / determinant,
        ];
        solution.forward[at] = plain.twist(column, size);
        at += 1;
    }
    Ok(solution)
}

/// Whether the numbers of a wheel can be used.
const fn check(wheel: &Wheel) -> Result<(), ConfigError> {
    ok!(wheel.place.check());
    ok!(finite("direction", wheel.direction.get()));
    if let Tread::Rollers(angle) = wheel.tread {
        ok!(finite("tread", angle.get()));
    }
    radius(wheel.radius)
}

/// Distance of the farthest wheel from the origin; 1 if all stand there.
const fn size<const N: usize>(wheels: &[Wheel; N]) -> f64 {
    let (mut most, mut at) = (0.0, 0);
    while at < N {
        let (x, y) = (wheels[at].place.x as f64, wheels[at].place.y as f64);
        let distance = sqrt(x * x + y * y);
        most = if distance > most { distance } else { most };
        at += 1;
    }
    if most > 0.0 { most } else { 1.0 }
}

/// The plain wheels of a base: together they do not move along `e`, their axles.
///
/// Two on one axle keep that exactly; one behind the other slips least about the middle.
struct Plain {
    is_there: bool,
    d: [f64; 2],
    e: [f64; 2],
    /// Speed along `e` of their middle, by a turn of 1 rad/s: metres.
    lever: f64,
}

impl Plain {
    const fn of<const N: usize>(wheels: &[Wheel; N]) -> Result<Self, BaseError> {
        let mut plain = Self { is_there: false, d: [1.0, 0.0], e: [0.0, 1.0], lever: 0.0 };
        let (mut first, mut count, mut at) = (0, 0.0, 0);
        while at < N {
            if let Tread::Plain = wheels[at].tread {
                let (d, e) = wheels[at].axes();
                if !plain.is_there {
                    (plain.is_there, plain.d, plain.e, first) = (true, d, e, at);
                }
                if (plain.e[0] * d[0] + plain.e[1] * d[1]).abs() > PARALLEL {
                    return Err(BaseError::AtOdds { wheels: [first, at] });
                }
                plain.lever += wheels[at].with_lever(plain.e)[2];
                count += 1.0;
            }
            at += 1;
        }
        if plain.is_there {
            plain.lever /= count;
        }
        Ok(plain)
    }

    /// A row over (vx, vy, wz) as one over (along d, along e, wz · size).
    const fn row(&self, [x, y, turn]: [f64; 3], size: f64) -> [f64; 3] {
        let along = [x * self.d[0] + y * self.d[1], x * self.e[0] + y * self.e[1]];
        if self.is_there {
            [along[0], 0.0, (turn - along[1] * self.lever) / size]
        } else {
            [along[0], along[1], turn / size]
        }
    }

    /// The inverse of [`row`](Self::row), for twists that the wheels can do.
    const fn twist_row(&self, [d, e, turn]: [f64; 3], size: f64) -> [f64; 3] {
        [self.d[0] * d + self.e[0] * e, self.d[1] * d + self.e[1] * e, turn * size]
    }

    /// The twist (vx, vy, wz) of (along d, along e, wz · size).
    const fn twist(&self, [d, e, turn]: [f64; 3], size: f64) -> [f64; 3] {
        let turn = turn / size;
        let e = if self.is_there { -self.lever * turn } else { e };
        [self.d[0] * d + self.e[0] * e, self.d[1] * d + self.e[1] * e, turn]
    }

    /// The row of [`Solution::refused`].
    const fn refused(&self) -> ([f64; 3], [f64; 2]) {
        if self.is_there {
            ([self.e[0], self.e[1], self.lever], self.e)
        } else {
            ([0.0; 3], [0.0; 2])
        }
    }

    /// Why a base is unsound that can move freely like this, in the coordinates of the rows.
    const fn reason(&self, free: [f64; 3], size: f64) -> BaseError {
        let [x, y, turn] = self.twist(free, size);
        let length = sqrt(x * x + y * y);
        #[expect(clippy::cast_possible_truncation, reason = "for a message")]
        if turn.abs() * size * 1e3 > length {
            let about = Point::new(tidy(-y / turn) as f32, tidy(x / turn) as f32);
            BaseError::CannotTurn { about }
        } else {
            BaseError::CannotMove { along: [tidy(x / length) as f32, tidy(y / length) as f32] }
        }
    }
}

/// Without rounding errors around zero.
const fn tidy(x: f64) -> f64 {
    if x.abs() < 1e-9 { 0.0 } else { x }
}

/// A motion that turns no wheel, or hardly: the eigenvector of the smallest eigenvalue.
const fn free_motion(
    normal: &[[f64; 3]; 3],
    adjugate: &[[f64; 3]; 3],
    minors: f64,
    trace: f64,
) -> [f64; 3] {
    if minors > SOUND * trace * trace {
        // The adjugate of a matrix of rank 2 is the square of that vector.
        return longest(adjugate);
    }
    // Rank 1: any vector at right angles to the rows; one without a turn if there is one.
    let [x, y, turn] = longest(normal);
    if x.abs() + y.abs() > 1e-9 * turn.abs() { [-y, x, 0.0] } else { [1.0, 0.0, 0.0] }
}

const fn longest(matrix: &[[f64; 3]; 3]) -> [f64; 3] {
    let (mut best, mut at) = (0, 1);
    while at < 3 {
        if dot(matrix[at], matrix[at]) > dot(matrix[best], matrix[best]) {
            best = at;
        }
        at += 1;
    }
    matrix[best]
}

const fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

const fn plus_square(mut sum: [[f64; 3]; 3], row: [f64; 3]) -> [[f64; 3]; 3] {
    let mut at = 0;
    while at < 9 {
        sum[at / 3][at % 3] += row[at / 3] * row[at % 3];
        at += 1;
    }
    sum
}

/// A symmetric matrix's inverse times its determinant.
const fn adjugate(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut adjugate = [[0.0; 3]; 3];
    let mut at = 0;
    while at < 9 {
        let ([r, s], [p, q]) = (others(at / 3), others(at % 3));
        adjugate[at / 3][at % 3] = m[r][p] * m[s][q] - m[r][q] * m[s][p];
        at += 1;
    }
    adjugate
}

/// The other two indices of three, in cyclic order: so minors are cofactors.
const fn others(index: usize) -> [usize; 2] {
    [(index + 1) % 3, (index + 2) % 3]
}

/// Square root by Newton's method, which doubles the digits each time; 0 below zero.
pub(super) const fn sqrt(x: f64) -> f64 {
    if x <= 0.0 || x.is_nan() {
        return 0.0;
    }
    // Half the exponent is a guess that is within 6 %.
    let mut root = f64::from_bits((x.to_bits() >> 1) + (1023 << 51));
    let mut step = 0;
    while step < 5 {
        root = 0.5 * (root + x / root);
        step += 1;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::wheel::sin_cos_degrees;

    #[test]
    fn the_functions_of_const_are_those_of_std() {
        extern crate std;
        for step in -7200..=7200_i32 {
            let degrees = f64::from(step) * 0.1;
            let (sin, cos) = sin_cos_degrees(degrees);
            let (s, c) = degrees.to_radians().sin_cos();
            assert!((sin - s).abs() < 4e-15 && (cos - c).abs() < 4e-15, "{degrees}");
        }
        let mut x = 1e-30_f64;
        while x < 1e30 {
            assert!((sqrt(x) / x.sqrt() - 1.0).abs() < 1e-15, "{x}");
            x *= 1.7;
        }
        assert_eq!(sin_cos_degrees(-270.0), (1.0, 0.0));
    }
}
