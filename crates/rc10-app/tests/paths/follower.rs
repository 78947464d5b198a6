//! A base that follows a plan: as told, with wheels that slip, pushed away, blocked.

use core::f32::consts::TAU;

use rc10_app::path::{
    Follower, FollowerConfig, FollowerOutput, Path, PathLimits, PathStatus, Plan,
};
use rc10_app::{Pose, Radians, Seconds, Twist};

use super::{COURSE, LIMITS, MECANUM, course, off, waypoint};

const TICK: f32 = 0.005;

/// A base that does what its wheels are told, but for a share that each has of its own.
struct Robot {
    pose: [f64; 3],
    wheels: [f32; 4],
    worst: f32,
}

impl Robot {
    fn at(pose: Pose, wheels: [f32; 4]) -> Self {
        let pose = [pose.x, pose.y, pose.heading.get()].map(f64::from);
        Self { pose, wheels, worst: 0.0 }
    }

    fn pose(&self) -> Pose {
        let [x, y, heading] = self.pose.map(|one| one as f32);
        Pose::new(x, y, Radians::new(heading))
    }

    fn drive(&mut self, twist: Twist) {
        let mut speeds = MECANUM.inverse(twist).unwrap().speeds;
        for (speed, share) in speeds.iter_mut().zip(self.wheels) {
            *speed = *speed * share;
        }
        let moved = MECANUM.forward(speeds).twist;
        let [vx, vy, wz] = [moved.vx, moved.vy, moved.wz].map(f64::from);
        // In a hundred steps, as if it were continuous.
        for _ in 0..100 {
            let dt = f64::from(TICK) / 100.0;
            let (sin, cos) = (self.pose[2] + 0.5 * dt * wz).sin_cos();
            self.pose[0] += dt * (vx * cos - vy * sin);
            self.pose[1] += dt * (vx * sin + vy * cos);
            self.pose[2] += dt * wz;
        }
    }

    /// Follows the plan for some ticks, or to its end.
    fn follow<const N: usize>(
        &mut self,
        follower: &mut Follower,
        plan: &Plan<N>,
        ticks: u16,
    ) -> FollowerOutput {
        let mut step = FollowerOutput::default();
        for _ in 0..ticks {
            let config = &FollowerConfig::DEFAULT;
            step = follower.update(config, plan, self.pose(), Seconds::new(TICK)).unwrap();
            self.worst = self.worst.max(off(step.target, self.pose()));
            self.drive(step.twist);
            if step.status == PathStatus::Done {
                break;
            }
        }
        step
    }
}

const LONG: u16 = 3000;
const START: Pose = COURSE.waypoints()[0].pose;

#[test]
fn a_base_that_obeys_is_where_it_shall_be() {
    let plan = course();
    let (mut robot, mut follower) = (Robot::at(START, [1.0; 4]), Follower::new());
    let step = robot.follow(&mut follower, &plan, LONG);
    println!("ideal base: {:.2} mm", 1000.0 * robot.worst);
    assert_eq!(step.status, PathStatus::Done);
    // What is left is what acceleration changes within a tick.
    assert!(robot.worst < 0.0005, "{} m", robot.worst);
    assert!(off(robot.pose(), plan.end()) < 1e-4, "{:?}", robot.pose());
    // Nor does it wait there.
    let at_end = robot.follow(&mut follower, &plan, 1);
    assert!(at_end.twist.vx.abs() < 1e-3 && at_end.acceleration == Twist::STOP, "{at_end:?}");
}

#[test]
fn the_acceleration_is_the_change_of_the_twist_in_the_axes_of_the_robot() {
    let plan = course();
    let (mut robot, mut follower) = (Robot::at(START, [1.0; 4]), Follower::new());
    let mut before = robot.follow(&mut follower, &plan, 1);
    let (mut steps, mut smooth, mut turning) = (0_u16, 0_u16, 0.0_f32);
    loop {
        let now = robot.follow(&mut follower, &plan, 1);
        if now.status == PathStatus::Done {
            break;
        }
        // Both are means of a step: their mean is that of the time between.
        let change = (now.twist - before.twist) * (1.0 / TICK);
        let wrong = change - (now.acceleration + before.acceleration) * 0.5;
        smooth += u16::from(wrong.vx.hypot(wrong.vy) < 0.1 && wrong.wz.abs() < 0.2);
        turning = turning.max((now.twist.wz * now.twist.vx.hypot(now.twist.vy)).abs());
        (before, steps) = (now, steps + 1);
    }
    println!("{smooth} of {steps}, up to {turning} m/s² by turning");
    // But where cells meet; and turning has its part in it.
    assert!(smooth > steps - steps / 8 && turning > 1.0, "{smooth} of {steps}");
}

#[test]
fn feedback_makes_up_for_wheels_that_are_not_as_told() {
    // 2 m/s · 5 % / 5 s⁻¹ is 20 mm; and the heading, which turns by other wheels.
    for (name, wheels, most) in [
        ("all wheels 5 % smaller", [0.95; 4], 0.022),
        ("one wheel slips by 3 %", [0.97, 1.0, 1.0, 1.0], 0.010),
        ("left wheels slip by 3 %", [0.97, 1.0, 0.97, 1.0], 0.012),
        ("all wheels 5 % larger", [1.05; 4], 0.022),
    ] {
        let (mut robot, mut follower) = (Robot::at(START, wheels), Follower::new());
        let step = robot.follow(&mut follower, &course(), LONG);
        println!("{name}: {:.1} mm", 1000.0 * robot.worst);
        assert_eq!(step.status, PathStatus::Done, "{name}");
        assert!(robot.worst < most, "{name}: {} m", robot.worst);
        assert!(off(robot.pose(), course().end()) < 0.0101, "{name}");
    }
}

#[test]
fn from_a_wrong_pose_it_comes_back_to_the_path() {
    for (x, y, heading) in [(0.0, 0.3, 0.0), (-0.3, 0.0, 0.4), (0.25, -0.25, -1.0), (0.0, 0.0, 3.0)]
    {
        let pose = Pose::new(START.x + x, START.y + y, START.heading + Radians::new(heading));
        let (mut robot, mut follower) = (Robot::at(pose, [1.0; 4]), Follower::new());
        // At most half a metre a second, and slower near the path; where it is behind, the path
        // waits for it.
        robot.follow(&mut follower, &course(), 300);
        robot.worst = 0.0;
        let step = robot.follow(&mut follower, &course(), LONG);
        assert_eq!(step.status, PathStatus::Done);
        assert!(robot.worst < 0.005, "{x} {y} {heading}: {} m", robot.worst);
    }
}

#[test]
fn the_path_waits_for_a_base_that_is_blocked() {
    let plan = course();
    let (mut robot, mut follower) = (Robot::at(START, [1.0; 4]), Follower::new());
    assert_eq!(robot.follow(&mut follower, &plan, 150).status, PathStatus::Following);
    robot.wheels = [0.0; 4];
    let mut blocked = robot.follow(&mut follower, &plan, 1000);
    assert_eq!(blocked.status, PathStatus::Waiting);
    // The lag is bounded, the plan stands, and the rest is the correction.
    assert!(blocked.along > 0.15 && blocked.along <= 0.201, "{blocked:?}");
    assert!((blocked.twist.vx.hypot(blocked.twist.vy) - 0.5).abs() < 0.01, "{blocked:?}");
    // Free again: what the base is asked for grows within the limits, and the path goes on.
    robot.wheels = [1.0; 4];
    let mut catching_up = 0_u16;
    while blocked.status == PathStatus::Waiting && catching_up < 500 {
        let planned = |step: &FollowerOutput| step.twist.vx.hypot(step.twist.vy);
        let now = robot.follow(&mut follower, &plan, 1);
        // 3 m/s² of the plan, and 5 /s of at most 0.7 m/s of the correction.
        let change = (planned(&now) - planned(&blocked)) / TICK;
        assert!(change <= 7.0, "{change} m/s²");
        (blocked, catching_up) = (now, catching_up + 1);
    }
    println!("caught up in {} ms", f32::from(catching_up) * 5.0);
    assert_eq!(robot.follow(&mut follower, &plan, LONG).status, PathStatus::Done);
}

#[test]
fn it_is_done_only_with_the_right_heading_and_at_the_right_place() {
    let (plan, config) = (course(), FollowerConfig::DEFAULT);
    let end = plan.end();
    let status = |x, y, heading| {
        let mut follower = Follower::new();
        // A step of a minute ends the path.
        follower.update(&config, &plan, START, Seconds::new(60.0)).unwrap();
        let pose = Pose::new(end.x + x, end.y + y, end.heading + Radians::new(heading));
        follower.update(&config, &plan, pose, Seconds::new(TICK)).unwrap().status
    };
    assert_eq!(status(0.0, 0.0, 0.0), PathStatus::Done);
    for sign in [1.0, -1.0] {
        for share in [0.9, 1.1] {
            let expected = if share < 1.0 { PathStatus::Done } else { PathStatus::Following };
            let (off, turn) =
                (sign * share * config.arrived_m, sign * share * config.arrived_heading.get());
            assert_eq!(status(off, 0.0, 0.0), expected, "{off} m");
            assert_eq!(status(0.0, off, 0.0), expected, "{off} m");
            assert_eq!(status(0.0, 0.0, turn), expected, "{turn} rad");
        }
        assert_eq!(status(0.0, 0.0, sign * 0.5), PathStatus::Following);
    }
}

/// Much turning on a short way: there it is the yaw rate that takes the acceleration.
#[test]
fn after_waiting_the_yaw_rate_rises_within_its_limit_to_either_side() {
    // Without gains the twist is the plan's alone.
    let gains = FollowerConfig { along: 0.0, across: 0.0, heading: 0.0, ..FollowerConfig::DEFAULT };
    let config = FollowerConfig { max_lag_m: 0.02, ..gains };
    assert_eq!(config.validate(), Ok(()));
    for turn in [3.0, -3.0] {
        let path = Path::new([waypoint(0.0, 0.0, 0.0), waypoint(0.1, 0.0, turn)]).unwrap();
        let plan = Plan::new(&path, &MECANUM, &LIMITS, 0.0).unwrap();
        let (mut follower, mut before) = (Follower::new(), FollowerOutput::default());
        let (mut waited, mut fastest) = (false, 0.0_f32);
        for tick in 0..400 {
            let mut step =
                |pose, dt: f32| follower.update(&config, &plan, pose, Seconds::new(dt)).unwrap();
            // The path's time stands still in a step of no time: it tells where the base is to be.
            let Pose { x, heading, .. } = step(before.target, 0.0).target;
            let behind = if (60..100).contains(&tick) { 0.03 } else { 0.0 };
            let now = step(Pose::new(x - behind, 0.0, heading), TICK);
            if tick > 100 {
                // As much again for the plan's own acceleration.
                let change = (now.twist.wz - before.twist.wz) / TICK;
                assert!(change.abs() <= 2.0 * 12.0 * 1.01, "{turn}, {tick}: {change} rad/s²");
                fastest = fastest.max(now.twist.wz * turn.signum());
            }
            waited |= now.status == PathStatus::Waiting && now.twist.wz.abs() < 1e-3;
            before = now;
        }
        assert!(waited && fastest > 2.0, "{turn}: {fastest} rad/s");
        assert_eq!(before.status, PathStatus::Done, "{turn}");
    }
}

#[test]
fn too_far_away_it_gives_up_and_stays_so() {
    let (plan, config) = (course(), FollowerConfig::DEFAULT);
    let (mut robot, mut follower) = (Robot::at(START, [1.0; 4]), Follower::new());
    robot.follow(&mut follower, &plan, 100);
    robot.pose[1] -= 0.51;
    let step = robot.follow(&mut follower, &plan, 1);
    assert_eq!((step.status, step.twist), (PathStatus::GaveUp, Twist::STOP));
    assert!((step.across - 0.51).abs() < 0.01, "{step:?}");
    robot.pose[1] += 0.51;
    let step = robot.follow(&mut follower, &plan, 1);
    assert_eq!((step.status, step.twist), (PathStatus::GaveUp, Twist::STOP));
    let far = Pose::new(f32::MAX, -f32::MAX, Radians::ZERO);
    let step = Follower::new().update(&config, &plan, far, Seconds::new(TICK)).unwrap();
    assert_eq!((step.status, step.twist), (PathStatus::GaveUp, Twist::STOP));
}

#[test]
fn bad_input_changes_nothing() {
    let (plan, config) = (course(), FollowerConfig::DEFAULT);
    let (mut robot, mut follower) = (Robot::at(START, [1.0; 4]), Follower::new());
    robot.follow(&mut follower, &plan, 100);
    let before = follower;
    for bad in [f32::NAN, f32::INFINITY] {
        for pose in [
            Pose::new(bad, 0.0, Radians::ZERO),
            Pose::new(0.0, bad, Radians::ZERO),
            Pose::new(0.0, 0.0, Radians::new(bad)),
        ] {
            assert!(follower.update(&config, &plan, pose, Seconds::new(TICK)).is_err());
        }
    }
    assert_eq!(follower, before);
    for dt in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let step = follower.update(&config, &plan, robot.pose(), Seconds::new(dt)).unwrap();
        assert!(step.twist.is_finite() && step.acceleration.is_finite());
    }
    assert_eq!(follower, before);
    // A step of a minute ends the path.
    let step = follower.update(&config, &plan, robot.pose(), Seconds::new(60.0)).unwrap();
    assert!(step.twist.is_finite());
    let end = follower.update(&config, &plan, plan.end(), Seconds::new(TICK)).unwrap();
    assert_eq!(end.status, PathStatus::Done);
    assert_eq!(plan.at(Seconds::new(f32::NAN)), plan.at(Seconds::ZERO));
    assert_eq!(config.validate(), Ok(()));
    let field = |config: FollowerConfig| config.validate().unwrap_err().field;
    assert_eq!(field(FollowerConfig { along: -1.0, ..config }), "along");
    assert_eq!(field(FollowerConfig { max_lag_m: 0.0, ..config }), "max_lag_m");
    assert_eq!(field(FollowerConfig { max_deviation_m: 0.1, ..config }), "max_deviation_m");
    assert_eq!(field(FollowerConfig { arrived_m: f32::NAN, ..config }), "arrived_m");
}

/// A wheel at its limit: a base that is asked for more than it can do is slower, not elsewhere.
#[test]
fn without_a_share_for_the_follower_a_slower_base_stays_on_the_path() {
    let limits = PathLimits { max_speed_m_s: f32::INFINITY, wheel_share: 1.0, ..LIMITS };
    let plan = Plan::new(&COURSE, &MECANUM, &limits, 0.0).unwrap();
    let (mut robot, mut follower) = (Robot::at(START, [0.9; 4]), Follower::new());
    let mut across = 0.0_f32;
    for _ in 0..LONG {
        let step = robot.follow(&mut follower, &plan, 1);
        across = across.max(step.across.abs());
        if step.status == PathStatus::Done {
            println!("10 % slower at its limits: {:.1} mm across", 1000.0 * across);
            assert!(across < 0.1, "{across} m across");
            return;
        }
    }
    panic!("{:?} after {} turns", robot.pose(), robot.pose().heading.get() / TAU);
}
