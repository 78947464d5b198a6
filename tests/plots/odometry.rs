//! Round a square, with a wheel that slips.

use core::f32::consts::{FRAC_PI_2, TAU};

use plotters::chart::SeriesLabelPosition::UpperRight;
use rc10_app::{
    Base, Odometry, OdometryConfig, OdometryInput, Pose, Radians, Rpm, Seconds, TotalAngle, Twist,
};

use super::drawing::{BLUE, GREY, ORANGE, Panel, line};

const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
const CONFIG: OdometryConfig = OdometryConfig { lever: 0.45, ..OdometryConfig::DEFAULT };
const DT: Seconds = Seconds::new(0.005);

/// What of the pose is shown: a place, and the ellipse of two standard deviations around it.
fn ellipse(odometry: &Odometry) -> Vec<(f32, f32)> {
    let (pose, spread) = (odometry.pose(), odometry.covariance());
    // The Cholesky factor of the covariance takes a circle to the ellipse.
    let along = spread.xx.sqrt();
    let lean = spread.xy / along;
    let across = (spread.yy - lean * lean).sqrt();
    let on_circle = (0..=60_u8).map(|step| (f32::from(step) / 60.0 * TAU).sin_cos());
    let around = on_circle
        .map(|(sin, cos)| (pose.x + 2.0 * along * cos, pose.y + 2.0 * (lean * cos + across * sin)));
    around.collect()
}

struct Drive {
    real: Vec<(f32, f32)>,
    estimated: Vec<(f32, f32)>,
    ellipses: Vec<Vec<(f32, f32)>>,
}

/// Four sides of 2 m at 1 m/s, a quarter of a turn at each corner. In the second half of the second side
/// the front left wheel turns 20 % faster than the ground passes.
fn drive(has_gyro: bool) -> Drive {
    let mut real: Pose = Pose::IDENTITY;
    let mut turned = 0.0_f32;
    let mut odometry = Odometry::new(real);
    let begin = vec![(0.0, 0.0)];
    let mut drive = Drive { real: begin.clone(), estimated: begin, ellipses: Vec::new() };
    for side in 0..4 {
        for step in 0..600_u16 {
            let twist = match step {
                0..400 => Twist::new(1.0, 0.0, 0.0),
                _ => Twist::new(0.0, 0.0, FRAC_PI_2),
            };
            let mut speeds = BASE.inverse(twist).unwrap().speeds;
            if side == 1 && (200..400).contains(&step) {
                speeds[0] = speeds[0] * 1.2;
            }
            let moved = twist * DT.get();
            real = real.compose(Pose::new(moved.vx, moved.vy, Radians::new(moved.wz)));
            turned += moved.wz;
            #[expect(clippy::cast_possible_truncation, reason = "a few turns")]
            let heading = TotalAngle::from_microdegrees((turned.to_degrees() * 1e6) as i64);
            let measured = BASE.forward(speeds);
            let input = OdometryInput {
                twist: measured.twist,
                slip: measured.slip(),
                heading: has_gyro.then_some(heading),
            };
            odometry.update(&CONFIG, input, DT);
            if step % 20 == 19 {
                let pose = odometry.pose();
                drive.real.push((real.x, real.y));
                drive.estimated.push((pose.x, pose.y));
            }
            if step == 399 {
                drive.ellipses.push(ellipse(&odometry));
            }
        }
    }
    drive
}

pub fn panels() -> Vec<Panel> {
    let Drive { real, estimated: by_gyro, ellipses: gyro_ellipses } = drive(true);
    let Drive { estimated: by_wheels, ellipses: wheel_ellipses, .. } = drive(false);
    let mut lines = vec![
        line("where the robot is", GREY, real),
        line("heading by a gyro, ellipse of 2 σ", BLUE, by_gyro),
        line("heading by the wheels", ORANGE, by_wheels),
    ];
    lines.extend(gyro_ellipses.into_iter().map(|points| line("", BLUE, points)));
    lines.extend(wheel_ellipses.into_iter().map(|points| line("", ORANGE, points)));
    // 618 by 498 pixels: both axes in the same scale.
    let (width, height) = (4.944, 3.984);
    vec![Panel {
        x: ("x, m", -1.3..width - 1.3),
        y: ("y, m", -0.8..height - 0.8),
        legend: UpperRight,
        height: 548,
        lines,
    }]
}
