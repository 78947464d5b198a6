//! The path of a base: the true one, the robot's estimate, and the reference.
//!
//! A robot counts in axes of its own: they are laid so that its first estimate is right
//! ([`Robot::estimate`](crate::world::robot::Robot::estimate)).

use rc10_time::Micros;
use serde_json::{Value, json};

use crate::recording::sample::{PathPoint, seconds, time_of};
use crate::recording::{BaseTrack, Recording};

/// The distance between two poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Time of the sample.
    pub at: Micros,
    /// Distance in m.
    pub metres: f64,
    /// Angle in degrees, up to 180.
    pub degrees: f64,
}

/// The figures of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathFigures {
    /// Whether the path is the world's; else it is the robot's own estimate.
    pub is_true: bool,
    /// Largest distance from the reference of the same moment.
    pub furthest: Option<Apart>,
    /// Distance from the reference at the end.
    pub end: Option<Apart>,
    /// Distance from the estimate at the end; `None` where the estimate is all that is known.
    pub estimate: Option<Apart>,
}

/// The poses of a base in the world's axes, a point per sample, NaN without a pose; empty without
/// any.
pub struct Paths {
    /// The robot's estimate.
    pub estimate: Vec<PathPoint>,
    /// The poses that the base should have.
    pub reference: Vec<PathPoint>,
}

fn is_known(pose: &PathPoint) -> bool {
    [pose.x, pose.y, pose.yaw].iter().all(|value| value.is_finite())
}

fn apart(one: &PathPoint, other: &PathPoint, sample: usize) -> Option<Apart> {
    let turn = (one.yaw - other.yaw).to_degrees();
    (is_known(one) && is_known(other)).then(|| Apart {
        at: time_of(sample),
        metres: (one.x - other.x).hypot(one.y - other.y),
        degrees: (turn - 360.0 * (turn / 360.0).round()).abs(),
    })
}

/// The same pose in other axes, in which `from` is at `to`.
pub(crate) fn laid(pose: &PathPoint, from: &PathPoint, to: &PathPoint) -> PathPoint {
    let (sin, cos) = (to.yaw - from.yaw).sin_cos();
    let (x, y) = (pose.x - from.x, pose.y - from.y);
    PathPoint {
        x: to.x + x * cos - y * sin,
        y: to.y + x * sin + y * cos,
        yaw: pose.yaw + to.yaw - from.yaw,
    }
}

impl Paths {
    /// Lays the paths of a base into the axes of the world.
    pub fn of(base: &BaseTrack) -> Self {
        let mut pairs = base.estimate.iter().zip(&base.path);
        let first = pairs.find(|(estimate, path)| is_known(estimate) && is_known(path));
        let lay = |poses: &[PathPoint]| -> Vec<PathPoint> {
            if !poses.iter().any(is_known) {
                return Vec::new();
            }
            let lay = |pose: &PathPoint| first.map_or(*pose, |(from, to)| laid(pose, from, to));
            poses.iter().map(lay).collect()
        };
        Self { estimate: lay(&base.estimate), reference: lay(&base.reference) }
    }
}

impl PathFigures {
    /// Figures of a run; `None` if its robot has neither estimate nor reference.
    pub fn of(recording: &Recording) -> Option<Self> {
        let base = recording.base.as_ref()?;
        let Paths { estimate, reference } = Paths::of(base);
        let is_true = base.path.iter().any(is_known);
        let path = if is_true { &base.path } else { &estimate };
        let all_apart = |from: &[PathPoint]| -> Vec<Apart> {
            let pairs = path.iter().zip(from).enumerate();
            pairs.filter_map(|(sample, (path, other))| apart(path, other, sample)).collect()
        };
        let from_reference = all_apart(&reference);
        let further =
            |most: Apart, next: Apart| if next.metres > most.metres { next } else { most };
        let furthest = from_reference.iter().copied().reduce(further);
        let end = from_reference.last().copied();
        let estimate = all_apart(&estimate).last().copied().filter(|_| is_true);
        (end.is_some() || estimate.is_some()).then_some(Self { is_true, furthest, end, estimate })
    }

    /// The figures as text, a line each.
    pub fn lines(&self) -> String {
        let by = if self.is_true { "" } else { ", by its own estimate" };
        let mut text = String::new();
        if let (Some(furthest), Some(end)) = (self.furthest, self.end) {
            text += &format!(
                "path  at most {:.3} m from its reference (at {:.2} s), at the end {:.3} m and {:.1} \
                 deg{by}\n",
                furthest.metres,
                seconds(furthest.at),
                end.metres,
                end.degrees
            );
        }
        if let Some(Apart { metres, degrees, .. }) = self.estimate {
            text += &format!(
                "odometry  at the end {metres:.3} m and {degrees:.1} deg from where it is\n"
            );
        }
        text
    }

    /// The figures as JSON.
    pub fn to_json(&self) -> Value {
        let apart = |apart: Option<Apart>| {
            apart.map(|Apart { at, metres, degrees }| {
                json!({ "at_us": at.get(), "m": metres, "deg": degrees })
            })
        };
        json!({
            "is_true": self.is_true,
            "reference_furthest": apart(self.furthest),
            "reference_end": apart(self.end),
            "estimate_end": apart(self.estimate),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two seconds straight on, and what the robot says of it.
    fn recording(
        path: impl Fn(f64) -> [f64; 3],
        estimate: impl Fn(f64) -> [f64; 3],
        reference: impl Fn(f64) -> [f64; 3],
    ) -> Recording {
        let points = |of: &dyn Fn(f64) -> [f64; 3]| -> Vec<PathPoint> {
            let point = |[x, y, yaw]: [f64; 3]| PathPoint { x, y, yaw };
            (1..=200).map(|index| point(of(f64::from(index) / 100.0))).collect()
        };
        let base = BaseTrack {
            wheels: Vec::new(),
            steering: Vec::new(),
            path: points(&path),
            estimate: points(&estimate),
            reference: points(&reference),
            chassis: rc10_sim::Chassis::default(),
            heard: Vec::new(),
        };
        Recording { base: Some(base), ..Recording::default() }
    }

    const NOTHING: [f64; 3] = [f64::NAN; 3];

    #[test]
    fn a_path_is_compared_with_what_its_robot_says() {
        // It lags by 0.1 s, ends 0.1 m short and turned by 3 degrees; its odometry sees 2 % too much.
        let run = recording(
            |t| [t - 0.1, 0.0, 0.0],
            |t| [1.02 * (t - 0.1), 0.0, if t < 2.0 { 0.0 } else { 0.05 }],
            |t| [t, if t > 0.995 && t < 1.005 { 0.3 } else { 0.0 }, 0.0],
        );
        let figures = PathFigures::of(&run).unwrap();
        let (furthest, end) = (figures.furthest.unwrap(), figures.end.unwrap());
        let estimate = figures.estimate.unwrap();
        assert_eq!((furthest.at, end.at), (Micros::from_millis(1000), Micros::from_millis(2000)));
        // Laid on what it says first, at 0.01 s: 1.8 mm.
        let laid: f64 = 0.02 * 0.09;
        assert!((furthest.metres - (0.1 + laid).hypot(0.3)).abs() < 1e-9, "{furthest:?}");
        assert!((end.metres - 0.1 - laid).abs() < 1e-9 && end.degrees < 1e-9, "{end:?}");
        assert!((estimate.metres - 0.02 * 1.99).abs() < 1e-9, "{estimate:?}");
        assert!((estimate.degrees - 0.05_f64.to_degrees()).abs() < 1e-9, "{estimate:?}");
        let text = figures.lines();
        assert!(text.contains("at most 0.317 m from its reference (at 1.00 s)"), "{text}");
        assert!(text.contains("at the end 0.040 m and 2.9 deg from where it is"), "{text}");
        let json = figures.to_json();
        assert_eq!(
            (&json["is_true"], &json["reference_end"]["at_us"]),
            (&true.into(), &2_000_000.into())
        );
    }

    #[test]
    fn the_robot_s_own_axes_may_lie_anywhere() {
        // It begins at (5, 3) of its field, and looks to the left there.
        let turned = |[x, y, yaw]: [f64; 3]| [5.0 - y, 3.0 + x, yaw + std::f64::consts::FRAC_PI_2];
        let path = |t: f64| [t, t * t, 0.3 * t];
        let run =
            recording(path, |t| turned(path(t)), |t| turned([t, t * t + 0.05, 0.3 * t + 7.0]));
        let figures = PathFigures::of(&run).unwrap();
        let (furthest, end) = (figures.furthest.unwrap(), figures.end.unwrap());
        assert!(figures.estimate.unwrap().metres < 1e-9, "{figures:?}");
        assert!((furthest.metres - 0.05).abs() < 1e-9, "{furthest:?}");
        assert!((end.degrees - (7.0_f64.to_degrees() - 360.0).abs()).abs() < 1e-6, "{end:?}");
    }

    #[test]
    fn a_robot_that_really_runs_knows_its_estimate_alone() {
        let run = recording(|_| NOTHING, |t| [t, 0.0, 0.0], |t| [t, 0.1, 0.0]);
        let figures = PathFigures::of(&run).unwrap();
        assert!(!figures.is_true && figures.estimate.is_none(), "{figures:?}");
        assert!((figures.end.unwrap().metres - 0.1).abs() < 1e-12, "{figures:?}");
        assert!(figures.lines().contains("by its own estimate"), "{}", figures.lines());
        let run = recording(|t| [t, 0.0, 0.0], |_| NOTHING, |_| NOTHING);
        assert_eq!(PathFigures::of(&run), None);
        assert!(Paths::of(run.base.as_ref().unwrap()).estimate.is_empty());
    }
}
