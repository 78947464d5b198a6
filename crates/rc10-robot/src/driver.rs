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
//! **It arms only by hand**: the right switch must have been seen down since power-on, since a stop,
//! and since the remote was lost. So a switch that was left up arms nothing by itself. An emergency
//! stop ends when the left switch is no longer down and the right one is.
//!
//! **It never believes in a lost remote.** Without a good frame for 100 ms, or when the receiver
//! itself says that it hears nothing, every motor takes its safe state; if frames come back within a
//! second, the robot goes on from the speed it has. After a second it is disarmed.

use embassy_time::{Duration, Ticker};
use rc10_app::{Degrees, Rpm, TotalAngle, Twist};
use rc10_can::Micros;
use rc10_message::Stamped;
use rc10_module::remote::{Remote, RemoteLink, Switch, Watch};
use rc10_motor::{ArmState, ArmSwitch};

use crate::robot::{Axes, BaseCommand, MechanismCommand, Shared};
use crate::table::{FEEDER, FULL_STICK, GIMBAL_AHEAD, GIMBAL_RATES, LIFT, LIFT_RATE, LIFT_TOP};

/// Period of the driver task.
pub const PERIOD: Micros = Micros::from_millis(10);

/// The driver's task.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut driver = Driver::new();
    let mut ticker = Ticker::every(Duration::from_micros(PERIOD.get()));
    loop {
        ticker.next().await;
        let now = rc10_message::now();
        let before = shared.switch.state();
        let wish = driver.step(shared.remote.read(), &shared.switch, now);
        shared.remote_link.set(driver.remote_link(), now);
        let Some(motion) = wish else { continue };
        if before == ArmState::Disarmed {
            driver.begin(lift_height(shared));
        }
        shared.motion.set(motion, now);
        shared.mechanisms.set(driver.mechanisms, now);
    }
}

/// Height of the lift, which stays until the stick moves it.
fn lift_height(shared: &Shared<'_>) -> TotalAngle {
    let heights =
        LIFT.map(|motor| shared.motor(motor).status().feedback.total_angle.microdegrees());
    TotalAngle::from_microdegrees(heights.iter().sum::<i64>() / heights.len() as i64)
}

/// State of the driver: its inputs, and its memory.
#[derive(Debug)]
pub struct Driver {
    watch: Watch,
    remote_link: RemoteLink,
    /// The newest frame that was looked at.
    heard: Option<Micros>,
    /// The right switch was down since the robot was last stopped: it may be armed.
    may_arm: bool,
    mechanisms: MechanismCommand,
}

impl Driver {
    /// One that has heard nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            watch: Watch::new(),
            remote_link: RemoteLink::Lost,
            heard: None,
            may_arm: false,
            mechanisms: HOME,
        }
    }

    /// Whether the remote is heard, as of the last step.
    #[must_use]
    pub const fn remote_link(&self) -> RemoteLink {
        self.remote_link
    }

    /// Command of the mechanisms, as of the last step.
    #[must_use]
    pub const fn mechanisms(&self) -> &MechanismCommand {
        &self.mechanisms
    }

    /// The robot has just been armed: the gimbal looks ahead, the lift stays where it is.
    pub const fn begin(&mut self, lift: TotalAngle) {
        self.mechanisms = MechanismCommand { lift, ..HOME };
    }

    /// Decides every [`PERIOD`], from the newest that the remote said; how the base shall move, if
    /// the robot is armed.
    pub fn step(
        &mut self,
        remote: Option<Stamped<Remote>>,
        switch: &ArmSwitch,
        now: Micros,
    ) -> Option<BaseCommand> {
        if let Some(Stamped { value, at }) = &remote
            && self.heard != Some(*at)
        {
            self.watch.heard(value, *at);
            self.heard = Some(*at);
        }
        self.remote_link = self.watch.link(now);
        let remote = match (self.remote_link, remote) {
            (RemoteLink::Online, Some(remote)) => remote.value,
            (RemoteLink::Interrupted, _) => {
                switch.suspend();
                return None;
            }
            _ => {
                switch.disarm();
                self.may_arm = false;
                return None;
            }
        };
        self.follow_switches(&remote, switch);
        if switch.state() != ArmState::Armed {
            self.mechanisms.feeder = Rpm::ZERO;
            return None;
        }
        Some(self.follow_sticks(&remote))
    }

    fn follow_switches(&mut self, remote: &Remote, switch: &ArmSwitch) {
        if remote.left_switch == Switch::Down {
            switch.emergency_stop();
            self.may_arm = false;
        } else if remote.right_switch == Switch::Down {
            switch.reset();
            switch.disarm();
            self.may_arm = true;
        } else {
            switch.resume();
            if core::mem::take(&mut self.may_arm) {
                // Refused while the robot is stopped, or unfit: the status says which.
                let _ = switch.arm();
            }
        }
    }

    fn follow_sticks(&mut self, remote: &Remote) -> BaseCommand {
        let axes = if remote.right_switch == Switch::Up { Axes::World } else { Axes::Robot };
        if remote.left_switch != Switch::Up {
            self.mechanisms.feeder = Rpm::ZERO;
            let full = FULL_STICK;
            // Sticks count to the right, the robot to the left.
            let twist = Twist::new(
                remote.left.y * full.vx,
                -remote.left.x * full.vy,
                -remote.right.x * full.wz,
            );
            return BaseCommand { twist, axes };
        }
        let seconds = PERIOD.get() as f32 * 1e-6;
        let turned = |angle: Degrees, stick: f32, rate: f32| {
            let angle = angle.get() + stick * rate * seconds;
            let turns = if angle < 0.0 { 1.0 } else { -f32::from(u8::from(angle >= 360.0)) };
            Degrees::new(angle + 360.0 * turns)
        };
        let [yaw, pitch] = GIMBAL_RATES;
        self.mechanisms.yaw = turned(self.mechanisms.yaw, -remote.right.x, yaw);
        self.mechanisms.pitch = turned(self.mechanisms.pitch, remote.right.y, pitch);
        self.mechanisms.feeder = Rpm::new(remote.left.y * FEEDER.get());
        #[expect(clippy::cast_possible_truncation, reason = "a few degrees")]
        let step = (remote.left.x * LIFT_RATE * PERIOD.get() as f32) as i64;
        let (bottom, top) = (0, TotalAngle::from_degrees(LIFT_TOP).microdegrees());
        let lift = (self.mechanisms.lift.microdegrees() + step).clamp(bottom, top);
        self.mechanisms.lift = TotalAngle::from_microdegrees(lift);
        BaseCommand { twist: Twist::STOP, axes }
    }
}

impl Default for Driver {
    fn default() -> Self {
        Self::new()
    }
}

/// Before anybody has moved anything.
const HOME: MechanismCommand = MechanismCommand {
    yaw: GIMBAL_AHEAD,
    pitch: GIMBAL_AHEAD,
    feeder: Rpm::ZERO,
    lift: TotalAngle::ZERO,
};

#[cfg(test)]
mod tests {
    use rc10_module::remote::Stick;
    use rc10_motor::Unfit;

    use super::*;

    /// A driver, and a remote whose frames come with every step until it is cut.
    struct Scene {
        driver: Driver,
        switch: ArmSwitch,
        now: Micros,
        remote: Remote,
        newest: Option<Stamped<Remote>>,
        is_cut: bool,
    }

    impl Scene {
        fn new(right: Switch) -> Self {
            Self {
                driver: Driver::new(),
                switch: ArmSwitch::new(),
                now: Micros::from_millis(1000),
                remote: Remote { right_switch: right, ..Remote::default() },
                newest: None,
                is_cut: false,
            }
        }

        fn armed() -> Self {
            let mut scene = Self::new(Switch::Down);
            scene.step(2);
            scene.remote.right_switch = Switch::Middle;
            scene.step(1);
            assert_eq!(scene.switch.state(), ArmState::Armed);
            scene
        }

        fn step(&mut self, times: u32) -> Option<BaseCommand> {
            let mut wish = None;
            for _ in 0..times {
                self.now += PERIOD;
                if !self.is_cut {
                    self.newest = Some(Stamped { value: self.remote, at: self.now });
                }
                wish = self.driver.step(self.newest, &self.switch, self.now);
            }
            wish
        }
    }

    #[test]
    fn a_switch_that_was_left_up_arms_nothing() {
        for right in [Switch::Middle, Switch::Up] {
            let mut scene = Scene::new(right);
            assert_eq!(scene.step(500), None);
            assert_eq!(scene.switch.state(), ArmState::Disarmed);
            scene.remote.right_switch = Switch::Down;
            scene.step(1);
            assert_eq!(scene.switch.state(), ArmState::Disarmed);
            scene.remote.right_switch = right;
            assert!(scene.step(1).is_some());
            assert_eq!(scene.switch.state(), ArmState::Armed);
            scene.remote.right_switch = Switch::Down;
            assert_eq!(scene.step(1), None);
            assert_eq!(scene.switch.state(), ArmState::Disarmed);
        }
    }

    /// It was down before the remote was lost, or before a stop: that counts no more.
    #[test]
    fn a_switch_that_was_down_before_arms_nothing_after() {
        let mut scene = Scene::new(Switch::Down);
        scene.step(2);
        scene.is_cut = true;
        scene.step(100);
        scene.remote.right_switch = Switch::Middle;
        scene.is_cut = false;
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed, "lost");

        let mut scene = Scene::new(Switch::Down);
        scene.step(2);
        (scene.remote.left_switch, scene.remote.right_switch) = (Switch::Down, Switch::Up);
        scene.step(1);
        // The stop is ended elsewhere.
        scene.remote.left_switch = Switch::Middle;
        scene.switch.reset();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed, "stopped");
    }

    #[test]
    fn an_unfit_robot_is_not_armed_by_its_switches() {
        let mut scene = Scene::new(Switch::Down);
        scene.switch.forbid(Unfit::Clock);
        scene.step(2);
        scene.remote.right_switch = Switch::Middle;
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }

    #[test]
    fn nothing_arms_without_a_remote() {
        let mut scene = Scene::new(Switch::Middle);
        scene.is_cut = true;
        assert_eq!(scene.step(200), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
        assert_eq!(scene.driver.remote_link(), RemoteLink::Lost);
    }

    #[test]
    fn an_emergency_stop_ends_by_both_switches_and_then_is_armed_anew() {
        let mut scene = Scene::armed();
        scene.remote.left_switch = Switch::Down;
        assert_eq!(scene.step(1), None);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        scene.remote.left_switch = Switch::Middle;
        scene.step(10);
        assert_eq!(scene.switch.state(), ArmState::EStopped, "the right switch is up yet");
        scene.remote.left_switch = Switch::Down;
        scene.remote.right_switch = Switch::Down;
        scene.step(10);
        assert_eq!(scene.switch.state(), ArmState::EStopped, "the left switch is down yet");
        scene.remote.left_switch = Switch::Middle;
        scene.step(1);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
        scene.remote.right_switch = Switch::Middle;
        assert!(scene.step(1).is_some());
    }

    #[test]
    fn a_stop_by_somebody_else_is_not_undone_by_an_armed_remote() {
        let mut scene = Scene::armed();
        scene.switch.emergency_stop();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        let mut scene = Scene::armed();
        scene.switch.disarm();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }

    #[test]
    fn a_remote_that_is_lost_for_a_moment_suspends_and_for_longer_disarms() {
        let mut scene = Scene::armed();
        scene.is_cut = true;
        assert!(scene.step(9).is_some(), "90 ms");
        assert_eq!(scene.step(1), None, "100 ms");
        assert_eq!(scene.switch.state(), ArmState::Suspended);
        scene.step(89);
        assert_eq!(scene.switch.state(), ArmState::Suspended, "990 ms");
        scene.is_cut = false;
        assert!(scene.step(1).is_some());
        assert_eq!(scene.switch.state(), ArmState::Armed);
        scene.is_cut = true;
        scene.step(100);
        assert_eq!(scene.switch.state(), ArmState::Disarmed, "1000 ms");
        scene.is_cut = false;
        assert_eq!(scene.step(100), None, "armed only by hand");
        scene.remote.right_switch = Switch::Down;
        scene.step(1);
        scene.remote.right_switch = Switch::Middle;
        assert!(scene.step(1).is_some());
    }

    #[test]
    fn the_receivers_own_failsafe_suspends_at_once_whatever_the_frame_says() {
        let mut scene = Scene::armed();
        scene.remote.left.y = 1.0;
        scene.remote.failsafe = true;
        assert_eq!(scene.step(1), None);
        assert_eq!(scene.switch.state(), ArmState::Suspended);
        scene.step(99);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }

    #[test]
    fn sticks_move_the_base_or_the_mechanisms() {
        let mut scene = Scene::armed();
        scene.remote.left = Stick { x: 0.5, y: 1.0 };
        scene.remote.right = Stick { x: -1.0, y: 0.0 };
        let twist = Twist::new(FULL_STICK.vx, -0.5 * FULL_STICK.vy, FULL_STICK.wz);
        assert_eq!(scene.step(1), Some(BaseCommand { twist, axes: Axes::Robot }));
        scene.remote.right_switch = Switch::Up;
        assert_eq!(scene.step(1), Some(BaseCommand { twist, axes: Axes::World }));

        scene.remote.left_switch = Switch::Up;
        scene.remote.right.y = -1.0;
        assert_eq!(scene.step(100).unwrap().twist, Twist::STOP);
        let command = scene.driver.mechanisms();
        let [yaw, pitch] = GIMBAL_RATES;
        let ahead = GIMBAL_AHEAD.get();
        assert!((command.yaw.get() - (ahead + yaw) % 360.0).abs() < 0.1, "{command:?}");
        assert!((command.pitch.get() - (ahead - pitch)).abs() < 0.1, "{command:?}");
        assert_eq!(command.feeder, FEEDER);
        assert!((command.lift.degrees().get() - 0.5 * LIFT_RATE).abs() < 0.1, "{command:?}");
        scene.remote.left.x = 1.0;
        scene.step(1000);
        assert_eq!(scene.driver.mechanisms().lift, TotalAngle::from_degrees(LIFT_TOP));
        scene.remote.left.x = -1.0;
        scene.step(1000);
        assert_eq!(scene.driver.mechanisms().lift, TotalAngle::ZERO);
        let yaw = scene.driver.mechanisms().yaw.get();
        assert!((0.0..360.0).contains(&yaw), "{yaw}");
        // The feeder stands still while driving.
        scene.remote.left_switch = Switch::Middle;
        scene.step(1);
        assert_eq!(scene.driver.mechanisms().feeder, Rpm::ZERO);
    }
}
