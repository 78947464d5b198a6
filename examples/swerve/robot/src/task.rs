//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed |
//! | left switch | down: emergency stop |
//! | left stick | moves the base |
//! | right stick | to the side: turns it |
//!
//! While the right stick is let go the robot keeps its heading. [`rc10_tasks::arming`] says how it is
//! armed, and what happens when the remote is lost.

use core::f32::consts::PI;

use embassy_time::{Duration, Ticker};
use rc10_app::swerve::Module;
use rc10_app::{
    BaseMotion, HeadingHold, Odometry, OdometryConfig, OdometryInput, Point, Pose, RobotFrame, Rpm,
    RpmPerSecond, Seconds, SwerveState, TotalAngle, Twist, TwistLimiter, maths,
};
use rc10_module::remote::Remote;
use rc10_motor::dji::{Config, M3508};
use rc10_motor::{ArmState, Link, Motion, Target};
use rc10_tasks::Arming;

use crate::Shared;
use crate::table::{
    AHEAD, ARMING, BASE, BASE_LIMITS, BODY, DRIVES, FULL_STICK, HEADING_HOLD, STEERS,
};

/// Period of the task, ms.
pub const PERIOD: u64 = 5;
const DT: Seconds = Seconds::new(PERIOD as f32 * 1e-3);

/// Revolutions per minute in 1 rad/s.
const RPM: f32 = 30.0 / PI;
/// Below this speed over the floor, m/s, the rate of its direction is not a wheel's to follow.
const SLOW: f32 = 0.3;

/// The motion that the sticks have commanded so far.
struct Drive {
    limiter: TwistLimiter,
    hold: HeadingHold,
    state: SwerveState<4>,
}

/// Arms the robot, drives it, and counts where it is, every 5 ms.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut arming = Arming::new(ARMING);
    let mut odometry = Odometry::new(Pose::IDENTITY);
    let mut drive = None;
    let mut ticker = Ticker::every(Duration::from_millis(PERIOD));
    loop {
        ticker.next().await;
        let modules = measured(shared);
        let motion = BASE.forward(modules);
        if DRIVES.into_iter().chain(STEERS).all(|name| is_heard(shared, name)) {
            count(&mut odometry, &motion, shared);
        }
        let before = shared.switch.state();
        // Without a remote no motor is commanded: 50 ms later each is safe.
        let Some(remote) = shared.obey(&mut arming) else { continue };
        if before != ArmState::Armed {
            drive = None;
        }
        let drive = drive.get_or_insert_with(|| Drive::begin(motion.twist));
        drive.follow(&remote, &modules, motion.twist, odometry.pose(), shared);
    }
}

fn is_heard(shared: &Shared<'_>, name: crate::Name) -> bool {
    shared.motor(name).status().link == Link::Online
}

/// Speeds of the wheels, and where they look.
fn measured(shared: &Shared<'_>) -> [Module; 4] {
    core::array::from_fn(|at| {
        let speed = shared.motor(DRIVES[at]).status().feedback.speed;
        let angle = shared.motor(STEERS[at]).status().feedback.total_angle.minus(AHEAD[at]);
        Module { speed, angle }
    })
}

/// Goes on with the pose, and shows it.
fn count(odometry: &mut Odometry, motion: &BaseMotion<4>, shared: &Shared<'_>) {
    let input = OdometryInput { twist: motion.twist, slip: motion.slip(), heading: None };
    odometry.update(&OdometryConfig::DEFAULT, input, DT);
    let (pose, live) = (odometry.pose(), &shared.live);
    live.x.set(pose.x);
    live.y.set(pose.y);
    live.heading.set(pose.heading.get());
    live.slip.set(motion.slip());
}

impl Drive {
    /// It may be rolling: the wheels begin with the speeds that they have.
    fn begin(twist: Twist) -> Self {
        let mut limiter = TwistLimiter::new();
        limiter.reset(twist);
        Self { limiter, hold: HeadingHold::new(), state: SwerveState::new() }
    }

    fn follow(
        &mut self,
        remote: &Remote,
        modules: &[Module; 4],
        twist: Twist,
        pose: Pose,
        shared: &Shared<'_>,
    ) {
        // Sticks count to the right, the robot to the left.
        let stick = -remote.right.x * FULL_STICK.wz;
        let turn = self.hold.update(&HEADING_HOLD, stick, pose.heading, twist.wz);
        let wish = Twist::new(remote.left.y * FULL_STICK.vx, -remote.left.x * FULL_STICK.vy, turn);
        // From the twist of the last period to the next one, without a step. What is not finite is not
        // commanded.
        let from = self.limiter.twist();
        let Ok(to) = self.limiter.update(&BASE_LIMITS, wish, DT) else { return };
        let change = (to - from) * (1.0 / DT.get());
        let angles = modules.map(|module| module.angle);
        let Ok(wanted) = self.state.update(&BASE, from, angles) else { return };
        for (at, module) in wanted.modules.into_iter().enumerate() {
            let drive = rolling(BASE.places()[at], from, change, modules[at].angle);
            let drive = Motion { speed: module.speed, ..drive };
            let angle = Some(module.angle.plus(AHEAD[at]));
            let speed = turning(BASE.places()[at], from, change);
            let steer = Motion { angle, speed, ..Motion::default() };
            shared.command(DRIVES[at], Target::Motion(drive));
            shared.command(STEERS[at], Target::Motion(steer));
        }
    }
}

/// Acceleration and effort of the wheel at `place` that looks to `angle`, while the base has this twist,
/// and that changes by `change` a second. A wheel has to do only with what is along it.
fn rolling(place: Point<RobotFrame>, twist: Twist, change: Twist, angle: TotalAngle) -> Motion {
    let (sin, cos) = maths::sin_cos(angle.within_turn().get().to_radians());
    let [x, y] = at_place(change, place);
    let [push_x, push_y] = at_place(push(twist, change), place);
    Motion {
        acceleration: RpmPerSecond::new((x * cos + y * sin) / BASE.radius() * RPM),
        effort: 0.0,
        inertia: (push_x * cos + push_y * sin) * BASE.radius() / DRIVE_TORQUE,
        ..Motion::default()
    }
}

/// How fast the velocity of the module at `place` changes its direction: by what is added across it.
fn turning(place: Point<RobotFrame>, twist: Twist, change: Twist) -> Rpm {
    let [x, y] = at_place(twist, place);
    let [add_x, add_y] = at_place(change, place);
    let square = x * x + y * y;
    let rate = if square > SLOW * SLOW { (x * add_y - y * add_x) / square } else { 0.0 };
    Rpm::new(rate * RPM)
}

/// The force of each module on the body, N, as if it were a velocity: in this way four that stand in a
/// square share what moves the body along, and what turns it.
fn push(twist: Twist, change: Twist) -> Twist {
    // The axes turn with the robot.
    let x = change.vx - twist.wz * twist.vy;
    let y = change.vy + twist.wz * twist.vx;
    let mass = BODY.mass / 4.0;
    Twist::new(mass * x, mass * y, BODY.yaw_inertia / SQUARES * change.wz)
}

/// Sum of the squared distances of the modules from the middle, m².
const SQUARES: f32 = {
    let (mut sum, mut at) = (0.0, 0);
    while at < 4 {
        let Point { x, y, .. } = BASE.places()[at];
        (sum, at) = (sum + x * x + y * y, at + 1);
    }
    sum
};

/// N m/A.
const DRIVE_TORQUE: f32 = Config::new(&M3508, 1).torque_constant();

/// Velocity of a place on the robot, m/s.
fn at_place(twist: Twist, place: Point<RobotFrame>) -> [f32; 2] {
    [twist.vx - twist.wz * place.y, twist.vy + twist.wz * place.x]
}
