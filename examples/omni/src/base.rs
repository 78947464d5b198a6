//! The base: by hand, or along [`PATH`].
//!
//! The path is driven in portions: while the base comes to a stand its plan is made, a leg a tick, and
//! then it is followed by the pose of the odometry, from where the base stands. It is given up when the
//! switch is moved back or a stick is moved, when the robot is not armed any more, when it is too far
//! from the path, and when it is later than [`PATIENCE`].

use rc10::app::maths::hypot;
use rc10::app::path::{Follower, PathStatus, Plan, Planner};
use rc10::app::{
    FieldFrame, HeadingHold, HeadingHoldConfig, Odometry, OdometryConfig, OdometryInput, Pose,
};
use rc10::prelude::*;

use crate::table::{BASE, FOLLOWER, HOLD, HOLD_GAINS, PATH, PATH_LIMITS, PATIENCE, TAKES_OVER};
use crate::{Name, Shared};

/// The activity of the base: the value of the signal "activity". It has no value unless the robot
/// is armed and its remote is heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Driven by hand.
    ByHand = 0,
    /// Coming to a stand, and planning a path.
    Planning = 1,
    /// Following the path.
    Following = 2,
    /// Behind on the path, which waits for the base.
    Waiting = 3,
    /// At the end of the path, and held there.
    Arrived = 4,
    /// It gave its path up, and stands until the switch or a stick is moved.
    GaveUp = 5,
}

/// Where it is by its wheels, and by its IMU where it has one.
#[derive(Default)]
pub struct Navigation(Odometry);

impl Navigation {
    /// A step further, in every tick. The heading is zeroed when the robot is armed: before, it does not
    /// count.
    pub fn step(&mut self, shared: &Shared<'_>, is_armed: bool, dt: Seconds) -> Pose {
        let motion = BASE.measured(shared);
        let heard = shared.heading.read();
        let heading = heard.and_then(|heading| heading.value.total(rc10::message::now()));
        shared.own.heading.set(heading.map_or(f32::NAN, |heading| heading.degrees().get()));
        let heading = heading.filter(|_| is_armed);
        let input = OdometryInput { twist: motion.twist, slip: motion.slip(), heading };
        self.0.update(&OdometryConfig::DEFAULT, input, dt);
        let pose = self.0.pose();
        shared.own.x.set(pose.x);
        shared.own.y.set(pose.y);
        shared.own.yaw.set(pose.heading.get());
        pose
    }
}

/// A base that is driven, while the robot is armed.
pub struct Driver {
    base: BaseDriver<'static, DrivenBase<Name, 4>>,
    hold: HeadingHold,
    course: Course,
}

/// The activity of the base, with its data.
enum Course {
    /// `is_ready` for a path: the switch was seen in another position.
    ByHand {
        is_ready: bool,
    },
    Planning(Planner<'static, { PATH.waypoints().len() }>),
    Along(Along),
    GaveUp,
}

/// A path that is followed.
struct Along {
    plan: Plan<{ PATH.waypoints().len() }>,
    follower: Follower,
    /// Where its axes are in those of the odometry: where the robot stood.
    start: Pose<FieldFrame>,
    /// How much later it may still become.
    patience: f32,
}

impl Default for Driver {
    /// Goes on from how the base moves.
    fn default() -> Self {
        // A switch that was left there starts nothing by itself.
        let course = Course::ByHand { is_ready: false };
        Self { base: BaseDriver::new(&BASE), hold: HeadingHold::new(), course }
    }
}

impl Driver {
    /// Drives for the coming `dt`, from this pose.
    pub fn step(&mut self, shared: &Shared<'_>, remote: &Remote, pose: Pose, dt: Seconds) {
        self.choose(remote);
        let (activity, target) = self.go_on(shared, remote, pose, dt);
        tell(shared, Some(activity), target);
    }

    /// Follows the operator's choice of the course.
    fn choose(&mut self, remote: &Remote) {
        let sticks = [remote.left.x, remote.left.y, remote.right.x];
        let is_by_hand = matches!(self.course, Course::ByHand { .. });
        if remote.right_switch != Switch::Up {
            self.course = Course::ByHand { is_ready: true };
        } else if !is_by_hand && sticks.iter().any(|stick| stick.abs() > TAKES_OVER) {
            self.course = Course::ByHand { is_ready: false };
        } else if matches!(self.course, Course::ByHand { is_ready: true }) {
            let planner = Planner::new(&PATH, &BASE.geometry, &PATH_LIMITS, 0.0);
            self.course = planner.map_or(Course::GaveUp, Course::Planning);
            self.hold.release();
        }
    }

    /// Moves; returns what it does, and where it is to be.
    fn go_on(
        &mut self,
        shared: &Shared<'_>,
        remote: &Remote,
        pose: Pose,
        dt: Seconds,
    ) -> (Activity, Option<Pose>) {
        let (activity, wish) = match &mut self.course {
            Course::ByHand { .. } => {
                let mut wish = BASE.sticks(remote);
                let measured = BASE.measured(shared).twist;
                let gains = HOLD_GAINS.at(hypot(measured.vx, measured.vy));
                let hold = HeadingHoldConfig { kp: gains.kp, kd: gains.kd, ..HOLD };
                wish.wz = self.hold.update(&hold, wish.wz, pose.heading, measured.wz);
                (Activity::ByHand, wish)
            }
            Course::Planning(planner) => {
                if self.base.commanded() == Twist::STOP {
                    match planner.step() {
                        Ok(None) => {}
                        Ok(Some(plan)) => self.course = Course::Along(Along::new(plan, pose)),
                        Err(_) => self.course = Course::GaveUp,
                    }
                }
                (Activity::Planning, Twist::STOP)
            }
            Course::Along(along) => match along.step(pose, dt) {
                (Activity::GaveUp, _, _) => {
                    self.course = Course::GaveUp;
                    (Activity::GaveUp, Twist::STOP)
                }
                (activity, target, motion) => {
                    self.base.follow(shared, motion, dt);
                    return (activity, Some(target));
                }
            },
            Course::GaveUp => (Activity::GaveUp, Twist::STOP),
        };
        self.base.drive(shared, wish, dt);
        (activity, None)
    }
}

impl Along {
    fn new(plan: Plan<{ PATH.waypoints().len() }>, pose: Pose) -> Self {
        let start = Pose::new(pose.x, pose.y, pose.heading);
        Self { plan, follower: Follower::new(), start, patience: PATIENCE.get() }
    }

    /// What it does, where it is to be, its mean twist in the coming step, and how that changes.
    fn step(&mut self, pose: Pose, dt: Seconds) -> (Activity, Pose, [Twist; 2]) {
        let here = self.start.between(pose);
        let Ok(step) = self.follower.update(&FOLLOWER, &self.plan, here, dt) else {
            return (Activity::GaveUp, pose, [Twist::STOP; 2]);
        };
        let activity = match step.status {
            PathStatus::Following => Activity::Following,
            PathStatus::Waiting => Activity::Waiting,
            PathStatus::Done => Activity::Arrived,
            PathStatus::GaveUp => Activity::GaveUp,
        };
        let is_at_end = activity == Activity::Following && step.target == self.plan.end();
        if is_at_end || activity == Activity::Waiting {
            self.patience -= dt.get();
        }
        let activity = if self.patience > 0.0 { activity } else { Activity::GaveUp };
        (activity, self.start.compose(step.target), [step.twist, step.acceleration])
    }
}

/// Says what the base does, and where it is to be.
pub fn tell(shared: &Shared<'_>, activity: Option<Activity>, target: Option<Pose>) {
    let own = &shared.own;
    own.activity.set(activity.map_or(f32::NAN, |activity| f32::from(activity as u8)));
    let [x, y, heading] =
        target.map_or([f32::NAN; 3], |target| [target.x, target.y, target.heading.get()]);
    own.path_x.set(x);
    own.path_y.set(y);
    own.path_yaw.set(heading);
}
