//! How right the attitude is: true rotations in f64, a sensor with the noise and bias of a data
//! sheet, and another filter beside ours.
#![cfg(test)]
#![expect(clippy::cast_possible_truncation, reason = "from the truth's f64 to a sensor's f32")]

mod robot;

use fusion_ahrs::{Ahrs, AhrsSettings, Bias, BiasSettings, Vector as Fused};
use rc10_app::{Radians, Seconds};
use rc10_module::imu::Sample;
use rc10_module::imu::attitude::{Attitude, Refused};
use robot::{DT, Faults, Random, Robot, Vector, off};

const STEP: Seconds = Seconds::new(0.001);

fn yaw_error(attitude: &Attitude, robot: &Robot) -> f64 {
    off(f64::from(attitude.yaw().get()).to_degrees(), robot.heading())
}

fn tilt_error(attitude: &Attitude, robot: &Robot) -> f64 {
    robot.tilt_error(attitude.quaternion().map(f64::from))
}

/// Milliseconds of one motion; what both take of it.
fn go(attitude: &mut Attitude, robot: &mut Robot, ms: u32, turn: Vector, push: Vector) {
    for _ in 0..ms {
        let sample = robot.step(turn, push);
        attitude.update(&sample, STEP).unwrap();
    }
}

fn rest(attitude: &mut Attitude, robot: &mut Robot, ms: u32) {
    go(attitude, robot, ms, [0.0; 3], [0.0; 3]);
}

/// The moves of a robot in a match, a new idea each 0.2 to 1 s: up to 3 m/s² and 5 rad/s, changed
/// at no more than 30 rad/s², shaken by its wheels.
fn drive(robot: &mut Robot, ms: u32, mut take: impl FnMut(&Sample, &Robot)) {
    let (mut left, mut wanted, mut turn, mut push) = (0, 0.0, 0.0_f64, [0.0; 3]);
    for _ in 0..ms {
        if left == 0 {
            left = 200 + (robot.random.unit() * 800.0) as u32;
            wanted = robot.random.within(5.0);
            push = [robot.random.within(3.0), robot.random.within(3.0), 0.0];
        }
        left -= 1;
        turn += (wanted - turn).clamp(-30.0 * DT, 30.0 * DT);
        let shake = [0; 3].map(|_| robot.random.within(0.05));
        let shaken = [shake[0], shake[1], turn];
        let bumps = [0, 1, 2].map(|axis| push[axis] + robot.random.normal(1.0));
        let sample = robot.step(shaken, bumps);
        take(&sample, robot);
    }
}

#[test]
fn rotations_are_integrated_without_an_error_of_their_own() {
    // Ten turns about each axis at the end of the range, and with few samples.
    for axis in 0..3 {
        for (rate, each) in [(34.0, 1), (-34.0, 1), (6.0, 10), (0.01, 1)] {
            let mut robot = Robot::new(1, Faults::default());
            let mut attitude = Attitude::new();
            let turn: Vector = core::array::from_fn(|it| if it == axis { rate } else { 0.0 });
            for _ in 0..2000 / each {
                let sample = (0..each).map(|_| robot.step(turn, [0.0; 3])).last().unwrap();
                let step = Seconds::new(0.001 * each as f32);
                // No help from the accelerometer.
                let sample = Sample { acceleration_is_saturated: true, ..sample };
                attitude.update(&sample, step).unwrap();
            }
            let [w, x, y, z] = attitude.quaternion().map(f64::from);
            let [a, b, c, d] = robot.quaternion;
            let off = 2.0 * (1.0 - (w * a + x * b + y * c + z * d).abs()).max(0.0).sqrt();
            assert!(off.to_degrees() < 0.1, "axis {axis}, {rate} rad/s: {}", off.to_degrees());
        }
    }
}

#[test]
fn the_first_sample_says_which_way_is_up() {
    for angle in [0.0, 0.1, 1.0, 2.0, 3.1, std::f64::consts::PI] {
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, -0.8, 0.0]] {
            let mut robot = Robot::new(1, Faults::default());
            robot.put(axis, angle);
            let mut attitude = Attitude::new();
            rest(&mut attitude, &mut robot, 1);
            assert!(tilt_error(&attitude, &robot) < 0.01, "{angle} about {axis:?}");
            let tilt = f64::from(attitude.tilt().get());
            assert!((tilt - angle).abs() < 0.001, "{angle}: {tilt}");
        }
    }
}

#[test]
fn angles_have_the_signs_that_are_documented() {
    let leaned = |axis, angle| {
        let mut robot = Robot::new(1, Faults::default());
        let mut attitude = Attitude::new();
        rest(&mut attitude, &mut robot, 1);
        let turn: Vector = core::array::from_fn(|it| if it == axis { angle } else { 0.0 });
        go(&mut attitude, &mut robot, 1000, turn, [0.0; 3]);
        [attitude.roll(), attitude.pitch(), attitude.yaw()].map(Radians::get)
    };
    for axis in 0..3 {
        for angle in [0.4, -0.4] {
            let angles = leaned(axis, angle);
            for (other, value) in angles.into_iter().enumerate() {
                let wanted = if other == axis { angle as f32 } else { 0.0 };
                assert!((value - wanted).abs() < 0.002, "{axis} {angle}: {angles:?}");
            }
        }
    }
}

#[test]
fn yaw_stands_still_at_rest() {
    let mut worst: f64 = 0.0;
    for seed in 1..=10 {
        let mut random = Random::new(seed);
        let mut robot = Robot::new(seed, Faults::bmi088(&mut random));
        let mut attitude = Attitude::new();
        rest(&mut attitude, &mut robot, 10_000);
        assert!(attitude.is_at_rest());
        let before = yaw_error(&attitude, &robot);
        assert!(before.abs() < 0.15, "what it turned before it knew its bias: {before}");
        rest(&mut attitude, &mut robot, 300_000);
        let drift = (yaw_error(&attitude, &robot) - before) / 5.0;
        worst = worst.max(drift.abs());
        assert!(tilt_error(&attitude, &robot) < 0.1);
    }
    println!("yaw at rest: {worst:.3} degrees a minute at most");
    assert!(worst < 0.1, "{worst} degrees a minute");
}

#[test]
fn a_match_of_driving_leaves_yaw_and_tilt_right() {
    let (mut yaw, mut tilt): (f64, f64) = (0.0, 0.0);
    for seed in 1..=20 {
        let mut random = Random::new(seed);
        let mut robot = Robot::new(seed, Faults::bmi088(&mut random));
        let mut attitude = Attitude::new();
        rest(&mut attitude, &mut robot, 10_000);
        drive(&mut robot, 60_000, |sample, robot| {
            attitude.update(sample, STEP).unwrap();
            tilt = tilt.max(tilt_error(&attitude, robot));
        });
        yaw = yaw.max(yaw_error(&attitude, &robot).abs());
        assert_eq!(attitude.gaps(), 0);
    }
    println!("after a minute: yaw {yaw:.3} degrees off, tilt {tilt:.2} at most");
    assert!(yaw < 0.5 && tilt < 2.0, "yaw {yaw}, tilt {tilt}");
}

#[test]
fn a_long_spin_does_not_tilt_it() {
    let mut robot = Robot::new(1, Faults::bmi088(&mut Random::new(1)));
    let mut attitude = Attitude::new();
    rest(&mut attitude, &mut robot, 5000);
    // 3 rad/s at 0.15 m pull 1.35 m/s²: 8 degrees, for half a minute.
    go(&mut attitude, &mut robot, 30_000, [0.0, 0.0, 3.0], [0.0; 3]);
    let error = tilt_error(&attitude, &robot);
    assert!(error < 0.5, "{error} degrees");
}

#[test]
fn an_accelerometer_that_is_off_tilts_it_no_more_than_it_is_off() {
    let mut robot = Robot::new(1, Faults::bmi088(&mut Random::new(1)));
    robot.faults.acceleration_bias = [0.196, 0.0, 0.0]; // 20 mg
    let mut attitude = Attitude::new();
    rest(&mut attitude, &mut robot, 20_000);
    let error = tilt_error(&attitude, &robot);
    assert!((1.0..1.25).contains(&error), "{error} degrees");
    assert!(yaw_error(&attitude, &robot).abs() < 2.0);
}

#[test]
fn a_bad_start_is_forgotten_at_rest() {
    // Switched on while it was pushed: 8 degrees off.
    let mut robot = Robot::new(3, Faults::bmi088(&mut Random::new(3)));
    let mut attitude = Attitude::new();
    go(&mut attitude, &mut robot, 1, [0.0; 3], [1.4, 0.0, 0.0]);
    assert!(tilt_error(&attitude, &robot) > 7.0);
    rest(&mut attitude, &mut robot, 4000);
    let error = tilt_error(&attitude, &robot);
    assert!(error < 0.2, "{error} degrees after four seconds");
}

/// The robot above, but it drives off at once and stands only afterwards.
#[test]
fn yaw_is_mended_when_it_stands_for_the_first_time() {
    for seed in 1..=10 {
        let mut robot = Robot::new(seed, Faults::bmi088(&mut Random::new(seed)));
        robot.faults.rotation_bias[2] = 1_f64.to_radians();
        let mut attitude = Attitude::new();
        drive(&mut robot, 20_000, |sample, _| attitude.update(sample, STEP).unwrap());
        let before = yaw_error(&attitude, &robot);
        assert!(before > 15.0, "{before}");
        rest(&mut attitude, &mut robot, 10_000);
        let error = yaw_error(&attitude, &robot);
        assert!(error.abs() < 2.0, "{error} of {before} degrees are left");
    }
}

#[test]
fn bias_is_learned_in_seconds_and_not_from_a_turn() {
    for seed in 1..=10 {
        let faults = Faults::bmi088(&mut Random::new(seed));
        let mut robot = Robot::new(seed, faults);
        let mut attitude = Attitude::new();
        drive(&mut robot, 5000, |sample, _| attitude.update(sample, STEP).unwrap());
        assert_eq!(attitude.bias(), None, "while it drives");
        rest(&mut attitude, &mut robot, 3000);
        let error = |attitude: &Attitude| {
            let bias = attitude.bias().unwrap();
            let off = |axis: usize| f64::from(bias[axis]) - faults.rotation_bias[axis];
            (0..3).map(|axis| off(axis).abs().to_degrees()).fold(0.0, f64::max)
        };
        assert!(error(&attitude) < 0.04, "{}", error(&attitude));
        // It warms up: a tenth of a degree a second more, over a minute.
        for _ in 0..60_000 {
            robot.faults.rotation_bias[2] += 0.1_f64.to_radians() / 60_000.0;
            rest(&mut attitude, &mut robot, 1);
        }
        // Slow turns of ten seconds are turns.
        let (before, turned) = (yaw_error(&attitude, &robot), 1_f64.to_radians());
        go(&mut attitude, &mut robot, 10_000, [0.0, 0.0, turned], [0.0; 3]);
        assert!(!attitude.is_at_rest());
        let moved = yaw_error(&attitude, &robot) - before;
        assert!(moved.abs() < 0.8, "{moved} of 10 degrees were lost");
    }
}

#[test]
fn a_slow_steady_turn_from_power_on_is_no_bias() {
    // 5.7 degrees a second: as steady as rest, and twice as fast as the largest bias.
    for rate in [0.1, -0.1] {
        let faults = Faults { rotation_bias: [0.0; 3], ..Faults::bmi088(&mut Random::new(1)) };
        let mut robot = Robot::new(1, faults);
        let mut attitude = Attitude::new();
        go(&mut attitude, &mut robot, 20_000, [0.0, 0.0, rate], [0.0; 3]);
        assert_eq!(attitude.bias(), None, "{rate} rad/s");
        let error = yaw_error(&attitude, &robot);
        assert!(error.abs() < 0.5, "{rate} rad/s: {error} degrees");
    }
}

/// The other filter with its settings for 1 kHz and robots that jolt.
struct Witness(Ahrs, Bias);

impl Witness {
    fn new() -> Self {
        let settings = AhrsSettings {
            sample_rate: 1000.0,
            gain: 0.5,
            gyroscope_range: 2000.0,
            acceleration_rejection: 10.0,
            rejection_timeout: 5.0,
            ..AhrsSettings::default()
        };
        let bias = BiasSettings { sample_rate: 1000.0, ..BiasSettings::default() };
        Self(Ahrs::with_settings(settings), Bias::with_settings(bias))
    }

    fn update(&mut self, sample: &Sample) {
        let [x, y, z] = sample.rotation.map(f32::to_degrees);
        let corrected = self.1.update(Fused::new(x, y, z));
        let [x, y, z] = sample.acceleration.map(|axis| axis / 9.80665);
        self.0.update_no_magnetometer(corrected, Fused::new(x, y, z));
    }

    fn quaternion(&self) -> [f64; 4] {
        let it = self.0.quaternion();
        [it.w, it.x, it.y, it.z].map(f64::from)
    }

    fn heading(&self) -> f64 {
        f64::from(self.0.quaternion().to_euler().yaw)
    }
}

#[test]
fn it_agrees_with_another_filter_and_is_no_worse() {
    let (mut ours, mut theirs) = ([0.0_f64; 2], [0.0_f64; 2]);
    for seed in 1..=10 {
        let mut robot = Robot::new(seed, Faults::bmi088(&mut Random::new(seed)));
        let (mut attitude, mut witness) = (Attitude::new(), Witness::new());
        for _ in 0..30_000 {
            let sample = robot.step([0.0; 3], [0.0; 3]);
            attitude.update(&sample, STEP).unwrap();
            witness.update(&sample);
        }
        assert!(robot.tilt_error(witness.quaternion()) < 0.5, "the witness is asleep");
        let before = [yaw_error(&attitude, &robot), off(witness.heading(), robot.heading())];
        drive(&mut robot, 60_000, |sample, robot| {
            attitude.update(sample, STEP).unwrap();
            witness.update(sample);
            ours[0] += tilt_error(&attitude, robot) / 600_000.0;
            theirs[0] += robot.tilt_error(witness.quaternion()) / 600_000.0;
        });
        ours[1] += (yaw_error(&attitude, &robot) - before[0]).abs() / 10.0;
        theirs[1] += off(off(witness.heading(), robot.heading()), before[1]).abs() / 10.0;
    }
    println!("mean tilt and yaw errors: ours {ours:.3?}, fusion-ahrs {theirs:.3?} degrees");
    assert!(ours[0] <= theirs[0] && ours[1] <= theirs[1] + 0.05, "{ours:?} {theirs:?}");
    assert!(theirs[0] < 10.0 && theirs[1] < 10.0, "the witness does not see the same motion");
}

#[test]
fn gaps_are_refused_and_counted() {
    let mut robot = Robot::new(1, Faults::default());
    let mut attitude = Attitude::new();
    rest(&mut attitude, &mut robot, 2000);
    let before = attitude.quaternion();
    let sample = robot.step([0.0, 0.0, 1.0], [0.0; 3]);
    for (count, step) in [0.0, -0.001, 0.021, 1e9, f32::NAN, f32::INFINITY].into_iter().enumerate()
    {
        let refused = attitude.update(&sample, Seconds::new(step));
        assert!(matches!(refused, Err(Refused::Step(_))), "{step}");
        assert_eq!((attitude.gaps() as usize, attitude.is_at_rest()), (count + 1, false));
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 51.0, -1e30] {
        for axis in 0..3 {
            let mut broken = sample;
            broken.rotation[axis] = bad;
            assert!(matches!(attitude.update(&broken, STEP), Err(Refused::Rotation(_))), "{bad}");
        }
    }
    assert_eq!(attitude.quaternion().map(f32::to_bits), before.map(f32::to_bits));
    let saturated = Sample { rotation_is_saturated: true, ..sample };
    let gaps = attitude.gaps();
    attitude.update(&saturated, STEP).unwrap();
    assert_eq!(attitude.gaps(), gaps + 1);
}

#[test]
fn an_accelerometer_that_says_nonsense_is_not_asked() {
    let mut robot = Robot::new(1, Faults::default());
    let mut attitude = Attitude::new();
    rest(&mut attitude, &mut robot, 2000);
    for bad in [f32::NAN, f32::INFINITY, -1e30, 1e10, 0.0, 80.0] {
        let mut sample = robot.step([0.0; 3], [0.0; 3]);
        sample.acceleration = [bad, 0.0, bad];
        for _ in 0..1000 {
            attitude.update(&sample, STEP).unwrap();
        }
        assert!(tilt_error(&attitude, &robot) < 0.001, "{bad}");
    }
    let tilted = Sample {
        acceleration: [6.9, 0.0, 6.9],
        acceleration_is_saturated: true,
        ..robot.step([0.0; 3], [0.0; 3])
    };
    for _ in 0..5000 {
        attitude.update(&tilted, STEP).unwrap();
    }
    assert!(tilt_error(&attitude, &robot) < 0.001);
    // It does recover: the means have not been spoilt.
    rest(&mut attitude, &mut robot, 3000);
    assert!(attitude.is_at_rest());
}

#[test]
fn yaw_can_be_set_and_set_to_nonsense() {
    let mut robot = Robot::new(1, Faults::default());
    let mut attitude = Attitude::new();
    robot.put([1.0, 0.0, 0.0], 0.3);
    rest(&mut attitude, &mut robot, 10);
    for yaw in [0.0, 1.0, -3.0, 3.1] {
        attitude.set_yaw(Radians::new(yaw));
        assert!((attitude.yaw().get() - yaw).abs() < 1e-5);
        assert!((attitude.tilt().get() - 0.3).abs() < 1e-4);
    }
    attitude.set_yaw(Radians::new(f32::NAN));
    attitude.set_yaw(Radians::new(f32::INFINITY));
    assert!((attitude.yaw().get() - 3.1).abs() < 1e-5);
}

/// Any bits at all, for long: every angle stays a number, the quaternion of length 1.
#[test]
fn no_input_makes_it_no_number() {
    let mut random = Random::new(7);
    let mut any = || {
        let bits = (random.unit() * f64::from(u32::MAX)) as u32;
        match bits % 4 {
            0 => f32::from_bits(bits),
            1 => f32::from_bits(bits) % 60.0,
            _ => (bits % 100_000) as f32 / 1000.0 - 50.0,
        }
    };
    let mut attitude = Attitude::new();
    let mut used = 0;
    for _ in 0..300_000 {
        let sample = Sample {
            acceleration: [any(), any(), any()],
            rotation: [any(), any(), any()],
            temperature: None,
            acceleration_is_saturated: any() > 40.0,
            rotation_is_saturated: any() > 40.0,
        };
        used += u32::from(attitude.update(&sample, Seconds::new(any().abs() / 2000.0)).is_ok());
        let [roll, pitch, yaw, tilt] =
            [attitude.roll(), attitude.pitch(), attitude.yaw(), attitude.tilt()];
        assert!([roll, pitch, yaw, tilt].iter().all(|angle| angle.is_finite()));
        let length: f32 = attitude.quaternion().iter().map(|part| part * part).sum();
        assert!((length - 1.0).abs() < 1e-5, "{length}");
    }
    assert!(used > 50_000, "{used} were used");
}
