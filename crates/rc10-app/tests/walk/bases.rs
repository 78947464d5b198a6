//! Drives bases, twists, poses, swerve, heading hold and odometry with random input, and gives away
//! every result: the chip's bits shall be the PC's.

use rc10_app::base::{Base, BaseMotion, Body, Tread, Wheel};
use rc10_app::swerve::{Module, Steering, Swerve, SwerveState};
use rc10_app::{
    Degrees, Direction, FieldFrame, HeadingHold, HeadingHoldConfig, Odometry, OdometryConfig,
    OdometryInput, Point, Pose, Radians, RobotFrame, Rpm, Seconds, TotalAngle, Twist, TwistLimiter,
    TwistLimits, maths,
};

const LIMIT: Rpm = Rpm::new(400.0);
const MECANUM: Base<4> = Base::mecanum(0.076, 0.20, 0.22, LIMIT);
const OMNI_4: Base<4> = Base::omni_4(0.076, 0.25, LIMIT);
const OMNI_3: Base<3> = Base::omni_3(0.05, 0.2, LIMIT);
const DIFFERENTIAL: Base<2> = Base::differential(0.05, 0.2, LIMIT);
/// Four plain wheels: a base by its list.
pub const SKID_STEER: Base<4> = Base::sound(
    [plain(0.15, 0.2), plain(0.15, -0.2), plain(-0.15, 0.2), plain(-0.15, -0.2)],
    LIMIT,
);

const fn plain(x: f32, y: f32) -> Wheel {
    Wheel {
        place: Point::new(x, y),
        direction: Degrees::ZERO,
        tread: Tread::Plain,
        radius: 0.05,
        turns: Direction::Forward,
    }
}
const LIMITS: TwistLimits = TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 };
const HOLD: HeadingHoldConfig = HeadingHoldConfig {
    kp: 6.0,
    kd: 0.1,
    max_rate_rad_s: 3.0,
    deceleration_rad_s2: 12.0,
    deadband_rad_s: 0.05,
};
const STEPS: u32 = 1000;

/// A small repeatable generator (`SplitMix64`).
struct Random(u64);

impl Random {
    fn within(&mut self, size: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let top = u16::try_from((bits ^ (bits >> 31)) >> 48).unwrap_or(0);
        size * (f32::from(top) / 32768.0 - 1.0)
    }

    fn twist(&mut self) -> Twist {
        Twist::new(self.within(3.0), self.within(3.0), self.within(8.0))
    }

    fn pose<Of: rc10_app::Frame, In: rc10_app::Frame>(&mut self) -> Pose<Of, In> {
        Pose::new(self.within(10.0), self.within(10.0), Radians::new(self.within(7.0)))
    }

    fn angle(&mut self) -> TotalAngle {
        let degrees = Degrees::new(self.within(100_000.0));
        TotalAngle::try_from_degrees(degrees).unwrap_or_default()
    }
}

/// Walks through the family.
pub fn walk(put: &mut dyn FnMut(f32)) {
    let mut random = Random(16);
    for _ in 0..STEPS {
        let x = random.within(9000.0);
        let (sin, cos) = maths::sin_cos(x);
        put(sin);
        put(cos);
        put(maths::atan2(random.within(2.0), random.within(2.0)));
        put(maths::fast_sqrt(x));
        put(random.angle().within_turn().get());
    }
    poses(&mut random, put);
    any(&MECANUM, &mut random, put);
    any(&OMNI_4, &mut random, put);
    any(&OMNI_3, &mut random, put);
    any(&DIFFERENTIAL, &mut random, put);
    any(&SKID_STEER, &mut random, put);
    lists(&mut random, put);
    limiters(&mut random, put);
    swerves(&mut random, put);
    odometries(&mut random, put);
}

fn put_twist<F: rc10_app::Frame>(twist: Twist<F>, put: &mut dyn FnMut(f32)) {
    put(twist.vx);
    put(twist.vy);
    put(twist.wz);
}

fn put_pose<Of: rc10_app::Frame, In: rc10_app::Frame>(
    pose: Pose<Of, In>,
    put: &mut dyn FnMut(f32),
) {
    put(pose.x);
    put(pose.y);
    put(pose.heading.get());
}

fn poses(random: &mut Random, put: &mut dyn FnMut(f32)) {
    for _ in 0..STEPS {
        let (robot, other): (Pose, Pose<FieldFrame>) = (random.pose(), random.pose());
        let on_robot: Pose<RobotFrame, RobotFrame> = random.pose();
        put_pose(robot.compose(on_robot), put);
        put_pose(robot.inverse(), put);
        put_pose(robot.between(other), put);
        let point = robot.apply(Point::new(random.within(5.0), random.within(5.0)));
        put(point.x);
        put(point.y);
    }
}

fn put_motion<const N: usize>(motion: &BaseMotion<N>, put: &mut dyn FnMut(f32)) {
    put_twist(motion.twist, put);
    motion.residual.into_iter().for_each(&mut *put);
    put(motion.slip());
}

fn any<const N: usize>(base: &Base<N>, random: &mut Random, put: &mut dyn FnMut(f32)) {
    for _ in 0..STEPS {
        let twist = random.twist();
        if let Ok(wheels) = base.inverse(twist) {
            wheels.speeds.into_iter().for_each(|speed| put(speed.get()));
            put(wheels.scale);
        }
        put(base.sideways(twist));
        let change = random.twist();
        base.accelerations(change).into_iter().for_each(|one| put(one.get()));
        let body = Body { mass_kg: 20.0, yaw_inertia_kg_m2: 1.2 };
        base.torques(&body, twist, change).into_iter().for_each(|one| put(one.get()));
        put_motion(&base.forward([(); N].map(|()| Rpm::new(random.within(400.0)))), put);
    }
}

/// Lists of wheels solved on the chip, where f64 is done in software.
fn lists(random: &mut Random, put: &mut dyn FnMut(f32)) {
    for _ in 0..20 {
        let wheels = [(); 3].map(|()| Wheel {
            place: Point::new(random.within(0.4), random.within(0.4)),
            direction: Degrees::new(random.within(180.0)),
            tread: Tread::OMNI,
            radius: 0.06 + random.within(0.02),
            turns: Direction::Reversed,
        });
        let Ok(base) = Base::new(wheels, LIMIT) else {
            put(-1.0);
            continue;
        };
        if let Ok(wheels) = base.inverse(random.twist()) {
            wheels.speeds.into_iter().for_each(|speed| put(speed.get()));
        }
        put_motion(&base.forward([(); 3].map(|()| Rpm::new(random.within(400.0)))), put);
    }
}

fn limiters(random: &mut Random, put: &mut dyn FnMut(f32)) {
    let mut limiter: TwistLimiter<FieldFrame> = TwistLimiter::new();
    let mut hold = HeadingHold::new();
    let mut target = Twist::STOP;
    let mut heading = 0.0;
    for step in 0..STEPS {
        if step % 100 == 0 {
            target = random.twist().out_of_frame(Radians::new(random.within(4.0)));
        }
        let dt = Seconds::new(0.005 + random.within(0.002));
        if let Ok(twist) = limiter.update(&LIMITS, target, dt) {
            put_twist(twist, put);
            put_twist(twist.into_frame(Radians::new(random.within(4.0))), put);
        }
        let stick = if step / 50 % 2 == 0 { 0.0 } else { random.within(2.0) };
        let rate = hold.update(&HOLD, stick, Radians::new(heading), random.within(1.0));
        heading += rate * dt.get();
        put(rate);
        put(hold.held().map_or(9.0, Radians::get));
    }
}

fn swerves(random: &mut Random, put: &mut dyn FnMut(f32)) {
    let half_turn = TotalAngle::from_degrees(180);
    for steering in [Steering::Endless, Steering::Between(half_turn.reversed(), half_turn)] {
        let places = [(); 4].map(|()| Point::new(random.within(0.3), random.within(0.3)));
        let Ok(base) = Swerve::new(places, 0.05, LIMIT, steering) else {
            put(-1.0);
            continue;
        };
        let mut state = SwerveState::new();
        for step in 0..STEPS {
            let twist = if step % 10 == 0 { Twist::STOP } else { random.twist() };
            let measured = [(); 4].map(|()| random.angle());
            if let Ok(modules) = state.update(&base, twist, measured) {
                put(modules.scale);
                for module in modules.modules {
                    put(module.speed.get());
                    put(module.angle.degrees().get());
                }
            }
            let modules =
                measured.map(|angle| Module { speed: Rpm::new(random.within(400.0)), angle });
            put_motion(&base.forward(modules), put);
        }
    }
}

fn odometries(random: &mut Random, put: &mut dyn FnMut(f32)) {
    let mut odometry = Odometry::new(random.pose());
    let mut heading = TotalAngle::ZERO;
    for step in 0..STEPS {
        let turned = Degrees::new(random.within(3.0));
        heading = heading.plus(TotalAngle::try_from_degrees(turned).unwrap_or_default());
        let input = OdometryInput {
            twist: random.twist(),
            slip: random.within(0.1),
            heading: (step % 3 > 0).then_some(heading),
        };
        odometry.update(&OdometryConfig::DEFAULT, input, Seconds::new(0.005));
        put_pose(odometry.pose(), put);
        let covariance = odometry.covariance();
        put(covariance.xx);
        put(covariance.xy);
        put(covariance.xt);
        put(covariance.yy);
        put(covariance.yt);
        put(covariance.tt);
        put(odometry.slipped());
    }
}
