//! Wheels at their limit, and wheels that contradict each other.

use plotters::chart::SeriesLabelPosition::{LowerLeft, UpperRight};
use rc10_app::{Base, Rpm, Twist};

use super::drawing::{BLUE, GREEN, GREY, ORANGE, Panel, line};

const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
/// Without a limit: what each wheel would have to do.
const UNLIMITED: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(1e6));

/// Direction of a motion in degrees, from ahead to the left.
fn direction(twist: Twist) -> f32 {
    twist.vy.atan2(twist.vx).to_degrees()
}

/// Direction in which the base drives, where it is asked to go 30 degrees to the left of ahead and to
/// turn by 2 rad/s, faster and faster. With the base's own limit, and with one for each wheel alone.
fn directions() -> [Vec<(f32, f32)>; 2] {
    let (mut kept, mut clipped) = (Vec::new(), Vec::new());
    for step in 1..=250_u16 {
        let speed = f32::from(step) * 0.02;
        let twist = Twist::new(0.866_025 * speed, 0.5 * speed, 2.0);
        let together = BASE.inverse(twist).unwrap().speeds;
        let limit = BASE.max_wheel_speed().get();
        let each = UNLIMITED.inverse(twist).unwrap().speeds;
        let each = each.map(|wheel| Rpm::new(wheel.get().clamp(-limit, limit)));
        kept.push((speed, direction(BASE.forward(together).twist)));
        clipped.push((speed, direction(BASE.forward(each).twist)));
    }
    [kept, clipped]
}

/// The largest residual while the base goes ahead, to the left, and turns, with its front left wheel's
/// speed multiplied by `share`.
fn slip(share: f32) -> Vec<(f32, f32)> {
    let mut points = Vec::new();
    for step in 0..300_u16 {
        let time = f32::from(step) * 0.01;
        let ramp = (time % 1.0 * 4.0).min((1.0 - time % 1.0) * 4.0).min(1.0);
        let twist = match step {
            0..100 => Twist::new(1.0, 0.0, 0.0),
            100..200 => Twist::new(0.0, 1.0, 0.0),
            _ => Twist::new(0.0, 0.0, 1.0),
        };
        let mut speeds = BASE.inverse(twist * ramp).unwrap().speeds;
        speeds[0] = speeds[0] * share;
        points.push((time, BASE.forward(speeds).slip()));
    }
    points
}

pub fn panels() -> Vec<Panel> {
    let [kept, clipped] = directions();
    vec![
        Panel {
            x: ("speed that is asked for, m/s", 0.0..5.0),
            y: ("direction, degrees", 0.0..40.0),
            legend: LowerLeft,
            height: 230,
            lines: vec![
                line("all wheels slowed by one factor", BLUE, kept),
                line("each wheel clipped by itself", ORANGE, clipped),
            ],
        },
        Panel {
            x: ("time, s: ahead, to the left, turning", 0.0..3.0),
            y: ("largest residual, m/s", 0.0..1.0),
            legend: UpperRight,
            height: 230,
            lines: vec![
                line("front left wheel reversed", ORANGE, slip(-1.0)),
                line("dead", GREEN, slip(0.0)),
                line("20 % too fast: it slips", BLUE, slip(1.2)),
                line("sound", GREY, slip(1.0)),
            ],
        },
    ]
}
