//! Drives every function of [`rc10_app::path`] with numbers that look random, and gives every result
//! away: the chip and a PC must have the same bits.

use rc10_app::path::{
    Follower, FollowerConfig, FollowerOutput, Path, PathLimits, PathStatus, Plan, PlannedMotion,
    Planner, Waypoint,
};
use rc10_app::{Base, Frame, Pose, Radians, Rpm, Seconds, Twist, TwistLimits};

const MECANUM: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
const OMNI: Base<3> = Base::omni_3(0.05, 0.2, Rpm::new(450.0));

/// A linear congruential generator (Numerical Recipes).
struct Random(u32);

impl Random {
    /// −1 .. 1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let [.., low, high] = self.0.to_le_bytes();
        f32::from(i16::from_le_bytes([low, high])) / 32_768.0
    }
}

/// All of it: 24 paths, of which some cannot be driven, and about 3000 ticks.
pub fn walk(put: &mut dyn FnMut(f32)) {
    let mut random = Random(16);
    for _ in 0..24 {
        let mut waypoints = [Waypoint::new(0.0, 0.0, Radians::ZERO); 4];
        for one in &mut waypoints {
            let heading = Radians::new(4.0 * random.next());
            *one = Waypoint::new(3.0 * random.next(), 3.0 * random.next(), heading);
        }
        for one in &mut waypoints[1..3] {
            *one = one.rounded((0.5 * random.next()).max(0.0)).at_most(2.0 + random.next());
        }
        let limits = PathLimits {
            twist: TwistLimits {
                linear_m_s2: 3.0 + random.next(),
                angular_rad_s2: 10.0 + 5.0 * random.next(),
            },
            max_speed_m_s: 2.0 + random.next(),
            wheel_share: 0.9,
        };
        let Ok(path) = Path::new(waypoints) else {
            put(-1.0);
            continue;
        };
        drive(put, &mut random, Plan::new(&path, &OMNI, &limits, 0.0).ok());
        let Ok(mut planner) = Planner::new(&path, &MECANUM, &limits, 0.8 + random.next()) else {
            put(-2.0);
            continue;
        };
        let plan = loop {
            match planner.step() {
                Ok(None) => {}
                Ok(plan) => break plan,
                Err(_) => break None,
            }
        };
        drive(put, &mut random, plan);
    }
}

fn drive(put: &mut dyn FnMut(f32), random: &mut Random, plan: Option<Plan<4>>) {
    let Some(plan) = plan else {
        put(-3.0);
        return;
    };
    put(plan.duration().get());
    put_pose(put, plan.end());
    for _ in 0..10 {
        let share = 0.5 + 0.6 * random.next();
        let PlannedMotion { pose, twist, acceleration } = plan.at(plan.duration() * share);
        put_pose(put, pose);
        put_twist(put, twist);
        put_twist(put, acceleration);
    }
    let mut follower = Follower::new();
    let mut pose = plan.at(Seconds::ZERO).pose;
    for _ in 0..80 {
        let dt = Seconds::new(0.05 + 0.05 * random.next());
        let Ok(step) = follower.update(&FollowerConfig::DEFAULT, &plan, pose, dt) else {
            put(-4.0);
            return;
        };
        let FollowerOutput { twist, acceleration, target, along, across, turn, status } = step;
        put_twist(put, twist);
        put_twist(put, acceleration);
        put_pose(put, target);
        put(along);
        put(across);
        put(turn.get());
        put(match status {
            PathStatus::Following => 0.0,
            PathStatus::Waiting => 1.0,
            PathStatus::Done => 2.0,
            PathStatus::GaveUp => 3.0,
        });
        // Sometimes it is slower, and once in a while it is pushed.
        let push = if random.next() > 0.995 { 0.6 } else { 0.0 };
        let moved = twist * (dt.get() * (0.8 + 0.2 * random.next()));
        let moved = moved + Twist::new(push, 0.0, push);
        pose = pose.compose(Pose::new(moved.vx, moved.vy, Radians::new(moved.wz)));
    }
}

fn put_pose(put: &mut dyn FnMut(f32), pose: Pose) {
    put(pose.x);
    put(pose.y);
    put(pose.heading.get());
}

fn put_twist<F: Frame>(put: &mut dyn FnMut(f32), twist: Twist<F>) {
    put(twist.vx);
    put(twist.vy);
    put(twist.wz);
}
