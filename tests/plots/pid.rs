//! A step, one that saturates, and a motion with and without its feed-forward.

use plotters::chart::SeriesLabelPosition::{LowerRight, UpperRight};
use rc10_app::cascade::{Seek, Step};
use rc10_app::{
    AngleLimits, AngleProfile, Cascade, CascadeState, FeedForward, PidConfig, PidState, Rpm,
    RpmPerSecond, RpmPerSecondSquared, Seconds, TotalAngle,
};

use super::drawing::{BLUE, GREEN, GREY, Line, ORANGE, Panel, level, line};

const DT: Seconds = Seconds::new(0.001);

/// rpm/s per A of a motor with its load, and what viscous friction takes of a speed in a second.
const GAIN: f32 = 300.0;
const FRICTION: f32 = 2.0;

/// Largest current, A.
const LIMIT: f32 = 20.0;

/// Speed (rpm) and effort (A) on the way to a setpoint, with a load in A; from 0.7 s on it is 4 A more.
fn driven(config: &PidConfig, setpoint: f32, load: f32) -> [Vec<(f32, f32)>; 2] {
    let (mut pid, mut speed) = (PidState::new(), 0.0_f32);
    // It has held the load until now.
    pid.preset(load);
    let (mut speeds, mut efforts) = (Vec::new(), Vec::new());
    for tick in 0..1200_u16 {
        let time = f32::from(tick) * DT.get();
        let effort = pid.update(config, setpoint, speed, 0.0, DT).clamp(-LIMIT, LIMIT);
        if tick % 3 == 0 {
            speeds.push((time, speed));
            efforts.push((time, effort));
        }
        let load = if tick < 700 { load } else { load + 4.0 };
        speed += (GAIN * (effort - load) - FRICTION * speed) * DT.get();
    }
    [speeds, efforts]
}

/// rpm/s per A of a gimbal, which turns by 180 degrees on a profile.
const GIMBAL: f32 = 100.0;
const LIMITS: AngleLimits = AngleLimits {
    velocity: Rpm::new(80.0),
    acceleration: RpmPerSecond::new(400.0),
    jerk: RpmPerSecondSquared::new(8000.0),
};

/// How far it is behind, in degrees. `along`: whether it is told the motion, or angles alone.
fn behind(feed_forward: FeedForward, along: bool) -> Vec<(f32, f32)> {
    let config = Cascade {
        speed: PidConfig::within(10.0).kp(0.3).ki(1.5),
        angle: PidConfig::within(200.0).kp(1.5),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(800.0),
        feed_forward,
    };
    config.validate().unwrap();
    let (mut state, mut speed, mut angle) = (CascadeState::new(), 0.0_f32, 0.0_f32);
    let mut profile = AngleProfile::at(TotalAngle::ZERO);
    profile.set_target(&LIMITS, TotalAngle::from_degrees(180), Rpm::ZERO).unwrap();
    let mut points = Vec::new();
    for tick in 0..900_u16 {
        let setpoint = profile.update(DT);
        let way = setpoint.angle.degrees().get() - angle;
        let seek = if along {
            let (speed, acceleration) = (setpoint.speed.get(), setpoint.acceleration.get());
            Seek::Motion { way: Some(way), speed, acceleration, inertia: 0.0 }
        } else {
            Seek::Angle(way)
        };
        let step = Step { measured: speed, load: 0.0, full: 10.0, dt: DT, count: tick.into() };
        state.seek(&config, &seek, &step);
        if tick % 3 == 0 {
            points.push((f32::from(tick) * DT.get(), way));
        }
        speed += GIMBAL * state.effort() * DT.get();
        angle += 6.0 * speed * DT.get();
    }
    points
}

pub fn panels() -> Vec<Panel> {
    let time = 0.0..1.2;
    let plain = PidConfig::within(LIMIT).kp(0.08).ki(1.5);
    let weighted = PidConfig { setpoint_weight: 0.3, ..plain };
    let slow = PidConfig { ki: 0.6, ..plain };
    let tracking = PidConfig { tracking: 20.0, ..slow };
    let [step, _] = driven(&plain, 100.0, 0.0);
    let [gentle, _] = driven(&weighted, 100.0, 0.0);
    let [conditional, effort] = driven(&slow, 800.0, 8.0);
    // Its limit is somewhere behind it, where it does not see it.
    let [wound_up, wound_effort] = driven(&PidConfig::within(1e6).kp(0.08).ki(0.6), 800.0, 8.0);
    let [drawn_back, drawn_effort] = driven(&tracking, 800.0, 8.0);

    let exact = FeedForward { per_rpm_s: 1.0 / GIMBAL, ..FeedForward::NONE };
    let off = FeedForward { per_rpm_s: 0.7 / GIMBAL, ..FeedForward::NONE };
    let panel = |x, y, legend, lines: Vec<Line>| Panel { x, y, legend, height: 190, lines };
    vec![
        panel(
            ("time, s", time.clone()),
            ("speed, rpm", 0.0..140.0),
            LowerRight,
            vec![
                level("setpoint", &time, 100.0),
                line("plain", BLUE, step),
                line("setpoint weight 0.3", ORANGE, gentle),
            ],
        ),
        panel(
            ("time, s", time.clone()),
            ("speed, rpm", 0.0..1300.0),
            LowerRight,
            vec![
                level("setpoint", &time, 800.0),
                line("limited by something else", GREEN, wound_up),
                line("conditional integration", BLUE, conditional),
                line("back-calculation", ORANGE, drawn_back),
            ],
        ),
        panel(
            ("time, s", time.clone()),
            ("effort, A", 0.0..25.0),
            LowerRight,
            vec![
                level("limit", &time, LIMIT),
                line("", GREEN, wound_effort),
                line("", BLUE, effort),
                line("", ORANGE, drawn_effort),
            ],
        ),
        panel(
            ("time, s", 0.0..0.9),
            ("behind, degrees", -20.0..80.0),
            UpperRight,
            vec![
                line("angles alone", GREY, behind(FeedForward::NONE, false)),
                line("a motion, no feed-forward", BLUE, behind(FeedForward::NONE, true)),
                line("feed-forward, 30 % too low", ORANGE, behind(off, true)),
                line("feed-forward", GREEN, behind(exact, true)),
            ],
        ),
    ]
}
