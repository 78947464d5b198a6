//! A lift that gets a new target on its way.

use plotters::chart::SeriesLabelPosition::UpperRight;
use rc10_app::{Profile, ProfileLimits, Seconds};

use super::drawing::{BLUE, ORANGE, Panel, level, line};

const DT: Seconds = Seconds::new(0.001);
/// Metres.
const TRAPEZOID: ProfileLimits =
    ProfileLimits { velocity: 1.0, acceleration: 4.0, jerk: f32::INFINITY };
const S_CURVE: ProfileLimits = ProfileLimits { jerk: 40.0, ..TRAPEZOID };

/// Position, velocity and acceleration; at 0.6 s the target is another one.
fn driven(limits: &ProfileLimits) -> [Vec<(f32, f32)>; 3] {
    let mut profile = Profile::at(0.0);
    profile.set_target(limits, 1.0, 0.0).unwrap();
    let mut points = [const { Vec::new() }; 3];
    for tick in 0..2000_u16 {
        if tick == 600 {
            profile.set_target(limits, 0.2, 0.0).unwrap();
        }
        let setpoint = profile.update(DT);
        if tick % 4 == 0 {
            let time = f32::from(tick) * DT.get();
            points[0].push((time, setpoint.position));
            points[1].push((time, setpoint.velocity));
            points[2].push((time, setpoint.acceleration));
        }
    }
    points
}

pub fn panels() -> Vec<Panel> {
    let [position, velocity, acceleration] = driven(&TRAPEZOID);
    let [smooth_position, smooth_velocity, smooth_acceleration] = driven(&S_CURVE);
    let time = 0.0..2.0;
    let target = vec![(0.0, 1.0), (0.6, 1.0), (0.6, 0.2), (2.0, 0.2)];
    let panel =
        |y, lines| Panel { x: ("time, s", 0.0..2.0), y, legend: UpperRight, height: 200, lines };
    vec![
        panel(
            ("position, m", 0.0..1.2),
            vec![
                line("target", super::drawing::GREY, target),
                line("trapezoid", BLUE, position),
                line("S-curve", ORANGE, smooth_position),
            ],
        ),
        panel(
            ("velocity, m/s", -1.2..1.2),
            vec![
                level("limits", &time, 1.0),
                level("", &time, -1.0),
                line("trapezoid", BLUE, velocity),
                line("S-curve", ORANGE, smooth_velocity),
            ],
        ),
        panel(
            ("acceleration, m/s²", -5.0..5.0),
            vec![
                level("limits", &time, 4.0),
                level("", &time, -4.0),
                line("trapezoid", BLUE, acceleration),
                line("S-curve", ORANGE, smooth_acceleration),
            ],
        ),
    ]
}
