//! Bases: inverse kinematics, steered wheels, odometry.

use core::hint::black_box;

use rc10_app::base::WheelSpeeds;
use rc10_app::swerve::{Modules, Steering, Swerve, SwerveState};
use rc10_app::{
    Allocation, Base, Joules, NewtonMetres, Odometry, OdometryConfig, OdometryInput, Point, Pose,
    PowerConfig, PowerInput, PowerLimiter, PowerModel, Rpm, Seconds, TotalAngle, Twist,
    TwistNotFinite, Watts,
};

const LIMIT: Rpm = Rpm::new(400.0);

/// The last but one is limited, the last is refused.
const TWISTS: [Twist; 5] = [
    Twist::STOP,
    Twist::new(1.0, 0.5, -2.0),
    Twist::new(-0.3, 1.5, 1.0),
    Twist::new(6.0, -2.0, 8.0),
    Twist::new(1.0, f32::NAN, 0.0),
];

/// Measures all of it.
pub fn measure() {
    let (mecanum, omni) =
        (Base::mecanum(0.076, 0.20, 0.22, LIMIT), Base::omni_4(0.076, 0.25, LIMIT));
    for twist in TWISTS {
        for base in [&mecanum, &omni] {
            black_box(inverse(black_box(base), black_box(twist)).is_ok());
        }
    }
    swerves();
    odometries();
    powers();
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_base_inverse")]
#[inline(never)]
fn inverse(base: &Base<4>, twist: Twist) -> Result<WheelSpeeds<4>, TwistNotFinite> {
    base.inverse(twist)
}

/// Steered wheels: endless, and within a range that is reached.
fn swerves() {
    let place = |x, y| Point::new(x, y);
    let places = [place(0.2, 0.2), place(-0.2, 0.2), place(-0.2, -0.2), place(0.2, -0.2)];
    let quarter = |quarters| TotalAngle::from_degrees(90 * quarters);
    let cables = Steering::Between(quarter(-1), quarter(1));
    // A module that is turns beyond its range costs 120 more, until it is within.
    for (steering, turned) in [(Steering::Endless, 12_345), (cables, 1)] {
        let Ok(base) = Swerve::new(places, 0.05, LIMIT, steering) else { cortex_m::asm::udf() };
        let mut state = SwerveState::new();
        let mut measured = [quarter(0), quarter(1), quarter(-1), quarter(turned)];
        for twist in TWISTS {
            let input = black_box((twist, measured));
            if let Ok(modules) = swerve(black_box(&base), &mut state, &input) {
                measured = modules.modules.map(|module| module.angle);
            }
        }
    }
}

type SwerveInput = (Twist, [TotalAngle; 4]);

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_swerve")]
#[inline(never)]
fn swerve(
    base: &Swerve<4>,
    state: &mut SwerveState<4>,
    (twist, measured): &SwerveInput,
) -> Result<Modules<4>, TwistNotFinite> {
    state.update(base, *twist, *measured)
}

/// Arcs, with a gyro and without, with slip and without.
fn odometries() {
    let mut odometry = Odometry::new(Pose::IDENTITY);
    for step in 0..3_000_i32 {
        let twist = TWISTS[step as usize % 4];
        let heading = (step % 3 > 0).then_some(TotalAngle::from_degrees(3 * step));
        let slip = if step % 5 == 0 { 0.5 } else { 0.0 };
        let input = black_box(OdometryInput { twist, slip, heading });
        odometry_step(black_box(&mut odometry), black_box(&OdometryConfig::DEFAULT), &input);
    }
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_odometry")]
#[inline(never)]
fn odometry_step(odometry: &mut Odometry, config: &OdometryConfig, input: &OdometryInput) {
    odometry.update(config, *input, Seconds::new(0.005));
}

const POWER: PowerConfig = PowerConfig {
    model: PowerModel {
        mechanical: 1.2,
        per_speed: 0.22,
        per_torque: 1.2,
        idle: 2.78,
        returned: 0.5,
    },
    uncertainty: 2.2,
    limits: [Watts::new(45.0), Watts::new(120.0)],
    buffer: Joules::new(60.0),
};

/// Wishes that are within the limit, that drive, that brake, and some of both.
fn powers() {
    let mut limiter = PowerLimiter::new(&POWER);
    for step in 0..400_u16 {
        let size = 6.0 - 0.015 * f32::from(step);
        let signs = [
            1.0,
            if step % 3 == 0 { -1.0 } else { 1.0 },
            if step % 5 == 0 { -1.0 } else { 1.0 },
            1.0,
        ];
        let wished = signs.map(|sign: f32| NewtonMetres::new(size * sign));
        let speeds = [Rpm::new(if step % 7 == 0 { -300.0 } else { 300.0 }); 4];
        let (others, derating) = (Watts::ZERO, 1.0);
        let input = PowerInput { wished, measured: wished, speeds, others, derating };
        black_box(allocate(black_box(&POWER.model), black_box(&input)).share);
        if step % 10 == 0 {
            hear(&mut limiter, black_box(f32::from(50 - step / 10)));
        }
        black_box(limit(&mut limiter, black_box(&input)).share);
    }
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_4_allocate")]
#[inline(never)]
fn allocate(model: &PowerModel, input: &PowerInput<4>) -> Allocation<4> {
    model.allocate(input.wished, input.speeds, Watts::new(80.0))
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_limiter")]
#[inline(never)]
fn limit(limiter: &mut PowerLimiter, input: &PowerInput<4>) -> Allocation<4> {
    limiter.allocate(&POWER, input, Seconds::new(0.01))
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_limiter_hears")]
#[inline(never)]
fn hear(limiter: &mut PowerLimiter, joules: f32) {
    limiter.hear(&POWER, Watts::new(80.0), Joules::new(joules));
}
