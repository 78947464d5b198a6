//! The motion of a base by its wheels: least squares in f64 over all their measurements.
//!
//! A plain wheel measures the floor's speed along its rolling direction, and that it does not go
//! sideways; one with rollers measures along their axes alone. These are at least as many equations
//! as a motion in the plane has components.

use rc10_sim::{Chassis, Tread, Wheel};

/// A motion: m forward, m left, and rad of turn; or per m of a rim's distance.
type Motion = [f64; 3];

/// The equations of wheels at one set of steering angles.
#[derive(Clone, Debug)]
pub struct Wheels {
    /// Each wheel's distance at the rim, by the motion.
    rims: Vec<Motion>,
    /// Each plain wheel's distance sideways, by the motion: zero.
    across: Vec<Motion>,
    /// The motion per m of each rim's distance.
    shares: Vec<Motion>,
}

fn dot(first: &Motion, second: &Motion) -> f64 {
    first.iter().zip(second).map(|(a, b)| a * b).sum()
}

impl Wheels {
    /// Creates the equations of a base; `steered` are its wheels' angles, degrees, 0 if missing.
    pub fn new(chassis: &Chassis, steered: &[f64]) -> Self {
        let (mut rims, mut across) = (Vec::new(), Vec::new());
        for (index, wheel) in chassis.wheels.iter().enumerate() {
            let turned = steered.get(index).copied().unwrap_or(0.0).to_radians();
            let (sin, cos) = (wheel.direction + turned).sin_cos();
            match wheel.tread {
                Tread::Plain => {
                    rims.push(way(wheel, [cos, sin]));
                    across.push(way(wheel, [-sin, cos]));
                }
                Tread::Rollers { slant } => {
                    rims.push(way(wheel, [cos - slant * sin, sin + slant * cos]));
                }
            }
        }
        let all = || rims.iter().chain(&across);
        let normal = [0, 1, 2].map(|i| [0, 1, 2].map(|j| all().map(|row| row[i] * row[j]).sum()));
        let shares = rims.iter().map(|row| solve(normal, *row)).collect();
        Self { rims, across, shares }
    }

    /// The motion per m of a wheel's rim, by least squares.
    pub fn share(&self, wheel: usize) -> Motion {
        self.shares[wheel]
    }

    /// The motion that fits the distances of all rims best, m and rad.
    pub fn motion(&self, rims: &[f64]) -> Motion {
        let shares = || self.shares.iter().zip(rims);
        [0, 1, 2].map(|axis| shares().fold(0.0, |sum, (share, rim)| sum + share[axis] * rim))
    }

    /// Slip that no motion of a rigid base explains: root of the mean square over the wheels, m.
    pub fn slip(&self, rims: &[f64]) -> f64 {
        let motion = self.motion(rims);
        let along = self.rims.iter().zip(rims).map(|(row, rim)| rim - dot(row, &motion));
        let across = self.across.iter().map(|row| dot(row, &motion));
        let squares: f64 = along.chain(across).map(|slip| slip * slip).sum();
        (squares / self.rims.len().max(1) as f64).sqrt()
    }

    /// Whether there are more equations than unknowns, so that rims can contradict one another.
    pub fn is_overdetermined(&self) -> bool {
        (0..self.rims.len()).any(|wheel| {
            let mut alone = vec![0.0; self.rims.len()];
            alone[wheel] = 1.0;
            self.slip(&alone) > 1e-6
        })
    }

    /// The distance of a wheel's rim by a motion.
    pub fn rim(&self, wheel: usize, motion: &[f64; 3]) -> f64 {
        self.rims.get(wheel).map_or(0.0, |row| dot(row, motion))
    }

    /// Sum of the squares of the rims' distances as the base goes one metre ahead.
    pub fn ahead(&self) -> f64 {
        self.rims.iter().map(|row| row[0] * row[0]).sum()
    }
}

/// The motion of the floor at a wheel's place along a direction.
fn way(wheel: &Wheel, [x, y]: [f64; 2]) -> Motion {
    [x, y, wheel.x * y - wheel.y * x]
}

/// Solves normal equations: elimination by the largest diagonal element; undetermined components
/// are 0.
fn solve(mut matrix: [Motion; 3], mut right: Motion) -> Motion {
    let (mut solution, mut open) = ([0.0; 3], [true; 3]);
    for _ in 0..3 {
        let pivots = (0..3).filter(|index| open[*index]);
        let Some(pivot) = pivots.max_by(|a, b| matrix[*a][*a].total_cmp(&matrix[*b][*b])) else {
            break;
        };
        if matrix[pivot][pivot] < 1e-9 {
            break;
        }
        open[pivot] = false;
        let (row, value) = (matrix[pivot], right[pivot]);
        for other in (0..3).filter(|other| *other != pivot) {
            let factor = matrix[other][pivot] / row[pivot];
            for (element, of_pivot) in matrix[other].iter_mut().zip(row) {
                *element -= factor * of_pivot;
            }
            right[other] -= factor * value;
        }
    }
    for index in (0..3).filter(|index| !open[*index]) {
        solution[index] = right[index] / matrix[index][index];
    }
    solution
}

#[cfg(test)]
mod tests {
    use rc10_sim::Steering;

    use super::*;

    fn near(values: &[f64], expected: &[f64]) {
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-12, "{values:?}, not {expected:?}");
        }
    }

    /// The known formulas of each kind.
    #[test]
    fn a_motion_is_that_of_its_wheels() {
        let mecanum = Wheels::new(&Chassis::mecanum(0.05, 0.2, 0.3), &[]);
        near(&mecanum.motion(&[1.0; 4]), &[1.0, 0.0, 0.0]);
        near(&mecanum.motion(&[-1.0, 1.0, 1.0, -1.0]), &[0.0, 1.0, 0.0]);
        near(&mecanum.motion(&[-1.0, 1.0, -1.0, 1.0]), &[0.0, 0.0, 2.0]);
        near(&[mecanum.slip(&[1.0, 1.0, -1.0, -1.0]), mecanum.ahead()], &[1.0, 4.0]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let omni = Wheels::new(&Chassis::omni(4, 0.05, 0.25), &[]);
        near(&omni.motion(&[-half, -half, half, half]), &[1.0, 0.0, 0.0]);
        near(&omni.motion(&[half, -half, -half, half]), &[0.0, 1.0, 0.0]);
        near(&omni.motion(&[0.25; 4]), &[0.0, 0.0, 1.0]);
        near(&[omni.slip(&[1.0, -1.0, 1.0, -1.0]), omni.ahead()], &[1.0, 2.0]);
        let three = Wheels::new(&Chassis::omni(3, 0.05, 0.25), &[]);
        near(&three.motion(&[0.5, -1.0, 0.5]), &[0.0, 1.0, 0.0]);
        let differential = Wheels::new(&Chassis::differential(0.05, 0.4), &[]);
        near(&differential.motion(&[0.8, 1.2]), &[1.0, 0.0, 1.0]);
        near(&[differential.ahead()], &[2.0]);
        let swerve = Chassis::swerve(0.05, 0.2, 0.3, Steering::default());
        near(&Wheels::new(&swerve, &[90.0; 4]).motion(&[1.0; 4]), &[0.0, 1.0, 0.0]);
        // Along the circle around the middle.
        let tangent = |x: f64, y: f64| x.atan2(-y).to_degrees();
        let angles =
            [(0.2, 0.3), (0.2, -0.3), (-0.2, 0.3), (-0.2, -0.3)].map(|(x, y)| tangent(x, y));
        let far = 0.2_f64.hypot(0.3);
        let spin = Wheels::new(&swerve, &angles);
        near(&spin.motion(&[far; 4]), &[0.0, 0.0, 1.0]);
        near(&[spin.slip(&[far; 4])], &[0.0]);
        // Three go ahead, the fourth looks to the left and stands: it is dragged across.
        let dragged = Wheels::new(&swerve, &[0.0, 0.0, 0.0, 90.0]);
        assert!(dragged.slip(&[1.0, 1.0, 1.0, 0.0]) > 0.2);
    }

    #[test]
    fn three_omni_wheels_and_two_plain_ones_fit_whatever_they_do() {
        let swerve = Chassis::swerve(0.05, 0.2, 0.3, Steering::default());
        for (chassis, overdetermined) in [
            (Chassis::default(), true),
            (Chassis::omni(4, 0.05, 0.25), true),
            (swerve, true),
            (Chassis::omni(3, 0.05, 0.25), false),
            (Chassis::differential(0.05, 0.4), false),
        ] {
            assert_eq!(Wheels::new(&chassis, &[]).is_overdetermined(), overdetermined);
        }
    }

    #[test]
    fn what_wheels_do_not_determine_is_zero() {
        let mut chassis = Chassis::omni(4, 0.05, 0.25);
        chassis.wheels.truncate(1);
        let motion = Wheels::new(&chassis, &[]).motion(&[1.0]);
        assert!(motion.iter().all(|component| component.is_finite()), "{motion:?}");
        near(&Wheels::new(&Chassis::on(Vec::new()), &[]).motion(&[]), &[0.0; 3]);
    }
}
