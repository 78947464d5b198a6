//! Odometry on whole paths: closed ones, with slip that is known, against where the robot really is.

use rc10_app::{
    Base, Odometry, OdometryConfig, OdometryInput, Pose, Radians, Rpm, Seconds, TotalAngle, Twist,
};

const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.20, Rpm::new(450.0));
const CONFIG: OdometryConfig = OdometryConfig::DEFAULT;
const DT: f64 = 0.005;

/// Where the robot really is, in f64, by small straight pieces.
struct Real {
    x: f64,
    y: f64,
    heading: f64,
}

impl Real {
    fn go(&mut self, twist: Twist) {
        const PIECES: u32 = 50;
        let dt = DT / f64::from(PIECES);
        let [vx, vy, wz] = [twist.vx, twist.vy, twist.wz].map(f64::from);
        for _ in 0..PIECES {
            let (sin, cos) = (self.heading + 0.5 * wz * dt).sin_cos();
            self.x += (vx * cos - vy * sin) * dt;
            self.y += (vx * sin + vy * cos) * dt;
            self.heading += wz * dt;
        }
    }
}

/// Drives a figure of eight that closes, twice, always looking another way. One wheel slips by a
/// speed in rpm whenever `slips` says so. What the odometry makes of it, and its error: of the
/// position (m) and of the heading (rad).
fn driven(has_gyro: bool, slips: impl Fn(u32) -> f32) -> (Odometry, f64, f64) {
    let mut odometry = Odometry::new(Pose::IDENTITY);
    let mut real = Real { x: 0.0, y: 0.0, heading: 0.0 };
    for step in 0..4000 {
        let phase = f64::from(step) * core::f64::consts::TAU / 2000.0;
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let (vx, vy) = (phase.cos() as f32, (2.0 * phase).cos() as f32);
        let wz = if step < 2000 { 0.8 } else { -0.8 };
        let world = Twist::<rc10_app::FieldFrame>::new(vx, vy, wz);
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let twist = world.into_frame(Radians::new((real.heading + 0.5 * 0.8 * DT) as f32));
        let mut speeds = BASE.inverse(twist).unwrap().speeds;
        speeds[1] = speeds[1] + Rpm::new(slips(step));
        let motion = BASE.forward(speeds);
        #[expect(clippy::cast_possible_truncation, reason = "a few turns")]
        let total = |heading: f64| {
            has_gyro.then_some(TotalAngle::from_microdegrees((heading.to_degrees() * 1e6) as i64))
        };
        if step == 0 {
            // The gyro's first reading is only where it begins.
            let still = OdometryInput { twist: Twist::STOP, slip: 0.0, heading: total(0.0) };
            odometry.update(&CONFIG, still, Seconds::new(1e-6));
        }
        real.go(twist);
        let input = OdometryInput {
            twist: motion.twist,
            slip: motion.slip(),
            heading: total(real.heading),
        };
        odometry.update(&CONFIG, input, Seconds::new(0.005));
    }
    // The real path is closed.
    assert!(real.x.hypot(real.y) < 0.02 && real.heading.abs() < 1e-5, "{} {}", real.x, real.y);
    let pose = odometry.pose();
    let off = (f64::from(pose.x) - real.x).hypot(f64::from(pose.y) - real.y);
    (odometry, off, f64::from(pose.heading.get()) - real.heading)
}

/// The position's standard deviation in the worst direction, at most, and the heading's.
fn deviation(odometry: &Odometry) -> [f64; 2] {
    let covariance = odometry.covariance();
    [f64::from(covariance.xx + covariance.yy).sqrt(), f64::from(covariance.tt).sqrt()]
}

#[test]
fn a_closed_path_ends_where_it_began() {
    for has_gyro in [false, true] {
        let (odometry, off, turned) = driven(has_gyro, |_| 0.0);
        assert!(off < 5e-4 && turned.abs() < 2e-4, "{has_gyro}: {off} m, {turned} rad");
        assert!(odometry.slipped() < 1e-6, "{odometry:?}");
        // 28 m of way: some centimetres.
        let [position, heading] = deviation(&odometry);
        assert!((0.02..0.6).contains(&position) && (0.005..0.1).contains(&heading));
    }
}

#[test]
fn known_slip_is_measured_and_the_error_is_within_the_covariance() {
    for (from, to, rpm) in [(500, 600, 100.0_f32), (100, 1500, 40.0), (1900, 2500, -150.0)] {
        let slips = |step| if (from..to).contains(&step) { rpm } else { 0.0 };
        let seconds = f64::from(to - from) * DT;
        // The rim's way, and a quarter of it in the residual of each wheel.
        let way = f64::from(rpm.abs()) * 0.076 * core::f64::consts::PI / 30.0 * seconds;
        let (odometry, off, turned) = driven(true, slips);
        // The gyro sees the same slip in the turn: 1/4 of it at a lever of 0.4 m.
        assert!((f64::from(odometry.slipped()) - way / 4.0).abs() < 0.02 * way, "{odometry:?}");
        assert!(turned.abs() < 2e-4);
        // √2 / 4 of it, less what turned round meanwhile.
        let [position, _] = deviation(&odometry);
        assert!(off > 0.01 && off < 0.36 * way && off < position, "{off} {way} {position}");

        // Without a gyro its heading is off too, by a quarter of the way at the lever of 0.4 m.
        let (odometry, off, turned) = driven(false, slips);
        let [position, heading] = deviation(&odometry);
        assert!((turned.abs() - way / 4.0 / 0.4).abs() < 1e-3 * way, "{turned} {way}");
        assert!(turned.abs() < heading && off < position, "{off} {position} {turned} {heading}");
    }
}

/// Front against rear wheels: all residual, no motion. And left against right, which is a turn that
/// only a gyro denies.
#[test]
fn slip_that_moves_nothing_is_counted_as_well() {
    let run = |speeds: [f32; 4], heading: Option<TotalAngle>| {
        let mut odometry = Odometry::new(Pose::IDENTITY);
        let motion = BASE.forward(speeds.map(Rpm::new));
        for _ in 0..200 {
            let input = OdometryInput { twist: motion.twist, slip: motion.slip(), heading };
            odometry.update(&CONFIG, input, Seconds::new(0.005));
        }
        odometry
    };
    let spin = run([50.0, 50.0, -50.0, -50.0], None);
    assert!((spin.slipped() - 0.398).abs() < 1e-3, "{spin:?}");
    assert!(spin.pose().x.abs() < 1e-6 && spin.covariance().xx > 0.3);
    let left = run([-50.0, 50.0, -50.0, 50.0], Some(TotalAngle::ZERO));
    assert!((left.slipped() - 0.398).abs() < 5e-3, "{left:?}");
    // The first step has no turn of the gyro yet.
    assert!(left.pose().heading.get().abs() < 6e-3, "{left:?}");
    assert!(run([-50.0, 50.0, -50.0, 50.0], None).slipped() < 1e-6);
}
