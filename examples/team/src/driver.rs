//! The driver task: a remote control decides what the robot does.
//!
//! | right switch | the robot is |
//! |---|---|
//! | down | disarmed |
//! | middle | armed, and drives in its own axes |
//! | up | armed, and drives in the world's axes |
//!
//! | left switch | the sticks |
//! |---|---|
//! | up | mechanisms: right stick gimbal, left stick feeder (away) and lift (right is up) |
//! | middle | drive: left stick moves, right stick turns |
//! | down | emergency stop, whatever the rest says |
//!
//! [`rc10::tasks::arming`] says how the robot is armed, and what happens when the remote is lost.

use rc10::app::angle::shortest_way_degrees;
use rc10::prelude::*;

use crate::robot::{BaseCommand, Goal, MechanismCommand};
use crate::table::{
    BASE, FEEDER, GIMBAL_AHEAD, GIMBAL_RATES, LIFT, LIFT_RATE, LIFT_TOP, Name, Robot, Shared,
};

/// Period of the driver task.
pub const PERIOD: Micros = Micros::from_millis(10);

/// The driver's task.
pub async fn run(shared: &Shared<'_>) -> ! {
    let (mut arming, mut driver) = (Arming::of::<Robot>(), Driver::new());
    let mut every = Every::new(PERIOD);
    loop {
        let now = every.next().await.now;
        let before = shared.switch.state();
        let Some(motion) = driver.step(shared.obey(&mut arming)) else { continue };
        if before == ArmState::Disarmed {
            let angle = |motor| shared.motor(motor).status().feedback.total_angle;
            driver.begin([angle(Name::GimbalYaw), angle(Name::GimbalPitch)], lift_height(shared));
        }
        shared.own.motion.set(motion, now);
        shared.own.mechanisms.set(driver.mechanisms, now);
    }
}

/// Height of the lift, which stays until the stick moves it.
fn lift_height(shared: &Shared<'_>) -> TotalAngle {
    let heights =
        LIFT.map(|motor| shared.motor(motor).status().feedback.total_angle.microdegrees());
    TotalAngle::from_microdegrees(heights.iter().sum::<i64>() / heights.len() as i64)
}

/// Memory of the driver.
#[derive(Debug)]
pub struct Driver {
    mechanisms: MechanismCommand,
}

impl Driver {
    /// One that has heard nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { mechanisms: HOME }
    }

    /// Command of the mechanisms, as of the last step.
    #[must_use]
    pub const fn mechanisms(&self) -> &MechanismCommand {
        &self.mechanisms
    }

    /// The robot has just been armed: the gimbal, which stands at these angles, looks ahead by the
    /// shorter way; the lift stays where it is.
    pub fn begin(&mut self, gimbal: [TotalAngle; 2], lift: TotalAngle) {
        let [yaw, pitch] = gimbal.map(|angle| {
            let way = shortest_way_degrees(angle.within_turn(), GIMBAL_AHEAD);
            stands(angle.plus(TotalAngle::try_from_degrees(way).unwrap_or_default()))
        });
        self.mechanisms = MechanismCommand { yaw, pitch, lift: stands(lift), ..HOME };
    }

    /// Decides every [`PERIOD`], from the remote that the robot obeys: how the base shall move, if there
    /// is one.
    pub fn step(&mut self, obeyed: Option<Remote>) -> Option<BaseCommand> {
        if obeyed.is_none() {
            self.rest();
        }
        obeyed.map(|remote| self.follow_sticks(&remote))
    }

    /// No stick moves a mechanism.
    const fn rest(&mut self) {
        let MechanismCommand { yaw, pitch, lift, .. } = self.mechanisms;
        let [yaw, pitch, lift] = [stands(yaw.angle), stands(pitch.angle), stands(lift.angle)];
        self.mechanisms = MechanismCommand { yaw, pitch, lift, feeder: Rpm::ZERO };
    }

    fn follow_sticks(&mut self, remote: &Remote) -> BaseCommand {
        let command = |wish: Twist| match remote.right_switch {
            Switch::Up => BaseCommand::World(Twist::new(wish.vx, wish.vy, wish.wz)),
            _ => BaseCommand::Robot(wish),
        };
        if remote.left_switch != Switch::Up {
            self.rest();
            return command(BASE.sticks(remote));
        }
        // Degrees a second and microseconds make microdegrees.
        #[expect(clippy::cast_possible_truncation, reason = "a few degrees")]
        let moved = |goal: Goal, stick: f32, rate: f32| {
            let step = (stick * rate * PERIOD.get() as f32) as i64;
            let angle = goal.angle.plus(TotalAngle::from_microdegrees(step));
            // 6 degrees a second are 1 rpm.
            Goal { angle, speed: Rpm::new(stick * rate / 6.0) }
        };
        let [yaw, pitch] = GIMBAL_RATES;
        self.mechanisms.yaw = moved(self.mechanisms.yaw, -remote.right.x, yaw);
        self.mechanisms.pitch = moved(self.mechanisms.pitch, remote.right.y, pitch);
        self.mechanisms.feeder = Rpm::new(remote.left.y * FEEDER.get());
        let lift = moved(self.mechanisms.lift, remote.left.x, LIFT_RATE);
        let within = lift.angle.clamp(TotalAngle::ZERO, TotalAngle::from_degrees(LIFT_TOP));
        self.mechanisms.lift = if within == lift.angle { lift } else { stands(within) };
        command(Twist::STOP)
    }
}

impl Default for Driver {
    fn default() -> Self {
        Self::new()
    }
}

/// A shaft that no stick moves.
const fn stands(angle: TotalAngle) -> Goal {
    Goal { angle, speed: Rpm::ZERO }
}

/// The command before the first motion.
const HOME: MechanismCommand = MechanismCommand {
    yaw: stands(TotalAngle::ZERO),
    pitch: stands(TotalAngle::ZERO),
    feeder: Rpm::ZERO,
    lift: stands(TotalAngle::ZERO),
};

#[cfg(test)]
mod tests {
    use rc10::module::remote::Stick;

    use super::*;

    /// A driver of an armed robot, and the remote.
    struct Scene {
        driver: Driver,
        remote: Remote,
    }

    impl Scene {
        fn step(&mut self, times: u32) -> Option<BaseCommand> {
            (0..times).fold(None, |_, _| self.driver.step(Some(self.remote)))
        }
    }

    #[test]
    fn armed_the_gimbal_looks_ahead_by_the_shorter_way() {
        let mut driver = Driver::new();
        let degrees = TotalAngle::from_degrees;
        driver.begin([degrees(350), degrees(-700)], degrees(5));
        let MechanismCommand { yaw, pitch, lift, .. } = *driver.mechanisms();
        assert_eq!([yaw, pitch, lift], [180, -540, 5].map(degrees).map(stands));
    }

    #[test]
    fn sticks_move_the_base_or_the_mechanisms() {
        let mut scene = Scene { driver: Driver::new(), remote: Remote::default() };
        scene.remote.left = Stick { x: 0.5, y: 1.0 };
        scene.remote.right = Stick { x: -1.0, y: 0.0 };
        let (vx, vy, wz) = (BASE.full_stick.vx, -0.5 * BASE.full_stick.vy, BASE.full_stick.wz);
        assert_eq!(scene.step(1), Some(BaseCommand::Robot(Twist::new(vx, vy, wz))));
        scene.remote.right_switch = Switch::Up;
        assert_eq!(scene.step(1), Some(BaseCommand::World(Twist::new(vx, vy, wz))));

        scene.remote.left_switch = Switch::Up;
        scene.remote.right.y = -1.0;
        assert_eq!(scene.step(100), Some(BaseCommand::World(Twist::STOP)));
        let command = scene.driver.mechanisms();
        let [yaw, pitch] = GIMBAL_RATES;
        assert!((command.yaw.angle.degrees().get() - yaw).abs() < 0.1, "{command:?}");
        assert!((command.pitch.angle.degrees().get() + pitch).abs() < 0.1, "{command:?}");
        assert_eq!(command.feeder, FEEDER);
        assert!((command.lift.angle.degrees().get() - 0.5 * LIFT_RATE).abs() < 0.1, "{command:?}");
        scene.remote.left.x = 1.0;
        scene.step(1000);
        assert_eq!(scene.driver.mechanisms().lift, stands(TotalAngle::from_degrees(LIFT_TOP)));
        scene.remote.left.x = -1.0;
        scene.step(1000);
        assert_eq!(scene.driver.mechanisms().lift, stands(TotalAngle::ZERO));
        // The feeder stands still while driving.
        scene.remote.left_switch = Switch::Middle;
        scene.step(1);
        assert_eq!(scene.driver.mechanisms().feeder, Rpm::ZERO);
    }
}
