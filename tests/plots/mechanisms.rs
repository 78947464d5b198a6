//! Homing against a hard stop, and a lift on two motors of which one is weak.

use plotters::chart::SeriesLabelPosition::UpperRight;
use rc10_app::mechanism::{Axes, AxesConfig, Homing, HomingConfig, HomingStatus, Reference, Stall};
use rc10_app::{
    AngleLimits, AngleProfile, Degrees, Direction, Rpm, RpmPerSecond, RpmPerSecondSquared, Seconds,
    TotalAngle,
};

use super::axis::{Axis, BRAKING, Random, Stop};
use super::drawing::{BLUE, GREEN, GREY, ORANGE, Panel, line};

const DT: Seconds = Seconds::new(0.001);

const HOMING: HomingConfig = HomingConfig {
    reference: Reference::Stop(Stall {
        effort: 10.0,
        standstill: Rpm::new(3.0),
        time: Seconds::new(0.1),
    }),
    direction: Direction::Reversed,
    fast: Rpm::new(60.0),
    slow: Rpm::new(10.0),
    back_off: Degrees::new(30.0),
    tolerance: Degrees::new(10.0),
    touch_at: TotalAngle::ZERO,
    travel: Degrees::new(1100.0),
    braking: BRAKING,
    phase_timeout: Seconds::new(6.0),
    timeout: Seconds::new(9.0),
};

#[expect(clippy::cast_possible_truncation, reason = "to be drawn")]
const fn narrow(value: f64) -> f32 {
    value as f32
}

/// Angle, speed and effort of an axis that begins 250 degrees above its stop.
fn homed() -> [Vec<(f32, f32)>; 3] {
    let mut random = Random(3);
    let mut axis = Axis::random(&mut random, 250.0);
    axis.stops.push(Stop { at: 0.0, direction: -1.0, stiffness: 15.0 });
    let mut homing = Homing::new();
    let mut points = [const { Vec::new() }; 3];
    for tick in 0..2200_u16 {
        let measured = axis.measured();
        axis.command(homing.update(&HOMING, &measured, false, DT));
        axis.step(&mut random);
        if tick % 4 == 0 {
            let time = f32::from(tick) * DT.get();
            points[0].push((time, measured.angle.degrees().get()));
            points[1].push((time, measured.speed.get()));
            points[2].push((time, measured.effort));
        }
    }
    assert!(matches!(homing.status(), HomingStatus::Done { .. }), "{:?}", homing.status());
    points
}

/// The difference of two motors in degrees, on a lift that goes up by 1000. The second gives 22 % of
/// its effort.
fn lifted(config: &AxesConfig) -> Vec<(f32, f32)> {
    let mut random = Random(3);
    let mut motors: [Axis; 2] = std::array::from_fn(|_| Axis::random(&mut random, 0.0));
    for motor in &mut motors {
        (motor.gain, motor.load, motor.friction) = (600.0, 3.0, 0.5);
    }
    motors[1].strength = 0.22;
    let limits = AngleLimits {
        velocity: Rpm::new(80.0),
        acceleration: RpmPerSecond::new(333.0),
        jerk: RpmPerSecondSquared::new(f32::INFINITY),
    };
    let mut profile = AngleProfile::at(TotalAngle::ZERO);
    profile.set_target(&limits, TotalAngle::from_degrees(1000), Rpm::ZERO).unwrap();
    let mut axes = Axes::<2>::new();
    let mut points = Vec::new();
    for tick in 0..3500_u16 {
        let setpoint = profile.update(DT * axes.pace());
        let measured = std::array::from_fn(|at: usize| motors[at].measured());
        let commands = axes.update(config, &setpoint, &measured, DT);
        for (motor, command) in motors.iter_mut().zip(commands) {
            motor.command(command);
            motor.step(&mut random);
        }
        if tick % 5 == 0 {
            let difference = narrow(motors[0].angle - motors[1].angle);
            points.push((f32::from(tick) * DT.get(), difference));
        }
    }
    assert!(
        axes.failure().is_none() && motors.iter().all(|motor| (motor.angle - 1000.0).abs() < 2.0)
    );
    points
}

pub fn panels() -> Vec<Panel> {
    let [angle, speed, effort] = homed();
    let axes = AxesConfig {
        wait: Degrees::new(10.0),
        stop: Degrees::new(30.0),
        patience: Seconds::new(0.5),
        coupling: 0.5,
        correction: Degrees::new(10.0),
    };
    let apart =
        AxesConfig { wait: Degrees::new(1e5), stop: Degrees::new(1e6), coupling: 0.0, ..axes };
    let panel = |x, y, lines| Panel { x, y, legend: UpperRight, height: 175, lines };
    let time = ("time, s: homing", 0.0..2.2);
    vec![
        panel(time.clone(), ("angle, degrees", -50.0..300.0), vec![line("angle", BLUE, angle)]),
        panel(time.clone(), ("speed, rpm", -80.0..80.0), vec![line("speed", ORANGE, speed)]),
        panel(
            time,
            ("effort, A", -25.0..25.0),
            vec![
                line("10 A: it pushes", GREY, vec![(0.0, -10.0), (2.2, -10.0)]),
                line("effort", GREEN, effort),
            ],
        ),
        panel(
            ("time, s: a lift", 0.0..3.5),
            ("difference, degrees", 0.0..400.0),
            vec![
                line("each motor by itself", ORANGE, lifted(&apart)),
                line("Axes", BLUE, lifted(&axes)),
            ],
        ),
    ]
}
