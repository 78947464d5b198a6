//! A path, and the speeds of the wheels along it.

use core::f32::consts::FRAC_PI_2;

use plotters::chart::SeriesLabelPosition::{LowerLeft, UpperLeft, UpperRight};
use rc10_app::path::{Path, PathLimits, Plan, Waypoint};
use rc10_app::{Base, Radians, Rpm, Seconds, TwistLimits};

use super::drawing::{BLUE, GREEN, GREY, ORANGE, PURPLE, Panel, level, line};

const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
const AHEAD: Radians = Radians::new(0.0);
const LEFT: Radians = Radians::new(FRAC_PI_2);
const PATH: Path<4> = Path::sound([
    Waypoint::new(0.0, 0.0, AHEAD),
    Waypoint::new(3.0, 0.0, AHEAD).rounded(0.6),
    Waypoint::new(3.0, 1.5, LEFT).rounded(0.4),
    Waypoint::new(5.5, 1.5, LEFT),
]);
const LIMITS: PathLimits = PathLimits {
    twist: TwistLimits { linear_m_s2: 4.0, angular_rad_s2: 15.0 },
    max_speed_m_s: f32::INFINITY,
    wheel_share: 0.9,
};

pub fn panels() -> Vec<Panel> {
    let plan = Plan::new(&PATH, &BASE, &LIMITS, 0.0).unwrap();
    let (mut places, mut noses) = (Vec::new(), Vec::new());
    let mut wheels = [const { Vec::new() }; 4];
    let mut speeds = Vec::new();
    for step in 0..=300_u16 {
        let time = plan.duration() * (f32::from(step) / 300.0);
        let motion = plan.at(time);
        let (place, heading) = (motion.pose.origin(), motion.pose.heading);
        places.push((place.x, place.y));
        if step % 15 == 0 {
            let (sin, cos) = heading.get().sin_cos();
            noses.push(vec![(place.x, place.y), (place.x + 0.15 * cos, place.y + 0.15 * sin)]);
        }
        let twist = motion.twist.into_frame(heading);
        speeds.push((time.get(), twist.vx.hypot(twist.vy)));
        for (points, speed) in wheels.iter_mut().zip(BASE.inverse(twist).unwrap().speeds) {
            points.push((time.get(), speed.get()));
        }
    }
    let waypoints = PATH.waypoints().iter().map(|point| (point.pose.x, point.pose.y)).collect();
    let mut path = vec![
        line("waypoints", GREY, waypoints),
        line("path, and where the robot looks", BLUE, places),
    ];
    path.extend(noses.into_iter().map(|points| line("", BLUE, points)));

    let end: Seconds = plan.duration();
    let time = 0.0..end.get();
    let limit = LIMITS.wheel_share * BASE.max_wheel_speed().get();
    let [front_left, front_right, rear_left, rear_right] = wheels;
    vec![
        Panel {
            x: ("x, m", -0.3..5.88),
            y: ("y, m", -0.35..2.15),
            legend: UpperLeft,
            height: 300,
            lines: path,
        },
        Panel {
            x: ("time, s", time.clone()),
            y: ("wheels, rpm", -600.0..500.0),
            legend: LowerLeft,
            height: 280,
            lines: vec![
                level("90 % of what they can do", &time, limit),
                level("", &time, -limit),
                line("front left", BLUE, front_left),
                line("front right", ORANGE, front_right),
                line("rear left", GREEN, rear_left),
                line("rear right", PURPLE, rear_right),
            ],
        },
        Panel {
            x: ("time, s", time),
            y: ("speed, m/s", 0.0..4.0),
            legend: UpperRight,
            height: 170,
            lines: vec![line("", BLUE, speeds)],
        },
    ]
}
