use rc10_motor::Unfit;

use super::*;
use SwitchName::{Fourth, Left, Right, Third};

/// How often a robot looks.
const PERIOD: Micros = Micros::from_millis(10);

/// Two switches; one for everything; one, and no stop.
const CONFIGS: [ArmingConfig; 3] = [
    ArmingConfig::DEFAULT,
    ArmingConfig {
        disarm: SwitchAt::new(Third, Switch::Middle),
        stop: Some(SwitchAt::new(Third, Switch::Down)),
        at_rest: &[Axis::RightX, Axis::Dial],
    },
    ArmingConfig { disarm: SwitchAt::new(Left, Switch::Up), stop: None, at_rest: Axis::STICKS },
];

/// Steps after which a position counts: the fifth frame comes 40 ms after the first.
const COUNTS: u32 = 5;

/// Arming, and a remote whose frames come with every step until it is cut.
struct Scene {
    arming: Arming,
    switch: ArmSwitch,
    now: Micros,
    remote: Remote,
    newest: Option<Stamped<Remote>>,
    is_cut: bool,
}

impl Scene {
    /// The remote's switches arm and do not stop.
    fn new(config: ArmingConfig) -> Self {
        let mut scene = Self {
            arming: Arming::new(config),
            switch: ArmSwitch::new(),
            now: Micros::from_millis(1000),
            remote: Remote::default(),
            newest: None,
            is_cut: false,
        };
        let ArmingConfig { disarm, stop, .. } = config;
        if let Some(stop) = stop {
            scene.turn(stop.switch, Switch::Up);
        }
        scene.turn(disarm.switch, scene.arms());
        scene
    }

    fn armed(config: ArmingConfig) -> Self {
        let mut scene = Self::new(config);
        scene.disarm();
        scene.step(COUNTS);
        scene.arm();
        scene.step(COUNTS);
        assert_eq!(scene.switch.state(), ArmState::Armed);
        scene
    }

    fn turn(&mut self, switch: SwitchName, to: Switch) {
        *match switch {
            Left => &mut self.remote.left_switch,
            Right => &mut self.remote.right_switch,
            Third => &mut self.remote.more_switches[0],
            Fourth => &mut self.remote.more_switches[1],
        } = to;
    }

    /// A position that arms.
    fn arms(&self) -> Switch {
        let ArmingConfig { disarm, stop, .. } = self.arming.config;
        let is_free = |position: &Switch| {
            let at = SwitchAt::new(disarm.switch, *position);
            at != disarm && Some(at) != stop
        };
        [Switch::Middle, Switch::Up, Switch::Down].into_iter().find(is_free).unwrap()
    }

    fn arm(&mut self) {
        self.turn(self.arming.config.disarm.switch, self.arms());
    }

    fn disarm(&mut self) {
        let SwitchAt { switch, position } = self.arming.config.disarm;
        self.turn(switch, position);
    }

    /// The remote, if the robot does what it says.
    fn step(&mut self, times: u32) -> Option<Remote> {
        let mut obeyed = None;
        for _ in 0..times {
            self.now += PERIOD;
            if !self.is_cut {
                self.newest = Some(Stamped { value: self.remote, at: self.now });
            }
            obeyed = self.arming.step(self.newest, &self.switch, self.now);
        }
        obeyed
    }
}

#[test]
fn a_switch_that_was_left_in_a_position_that_arms_arms_nothing() {
    for config in CONFIGS {
        let mut scene = Scene::new(config);
        assert_eq!(scene.step(500), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
        scene.disarm();
        scene.step(COUNTS);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
        scene.arm();
        assert_eq!(scene.step(COUNTS - 1), None);
        assert_eq!(scene.step(1), Some(scene.remote));
        assert_eq!(scene.switch.state(), ArmState::Armed);
        scene.disarm();
        assert_eq!(scene.step(1), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }
}

#[test]
fn every_position_but_the_two_that_are_named_arms() {
    for config in CONFIGS {
        for position in [Switch::Up, Switch::Middle, Switch::Down] {
            let at = SwitchAt::new(config.disarm.switch, position);
            let mut scene = Scene::new(config);
            scene.disarm();
            scene.step(COUNTS);
            let ends = [config.disarm.position, position];
            if ends.contains(&Switch::Up) && ends.contains(&Switch::Down) {
                // A switch passes its middle.
                scene.turn(at.switch, Switch::Middle);
                scene.step(3);
            }
            scene.turn(at.switch, position);
            scene.step(COUNTS);
            let expected = match at {
                at if at == config.disarm => ArmState::Disarmed,
                at if Some(at) == config.stop => ArmState::EStopped,
                _ => ArmState::Armed,
            };
            assert_eq!(scene.switch.state(), expected, "{at:?} of {config:?}");
        }
    }
}

/// A switch that disarmed before the remote was lost, or before a stop: that counts no more.
#[test]
fn a_switch_that_disarmed_before_arms_nothing_after() {
    for config in CONFIGS {
        let mut scene = Scene::new(config);
        scene.disarm();
        scene.step(COUNTS);
        scene.is_cut = true;
        scene.step(100);
        scene.arm();
        scene.is_cut = false;
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed, "lost");

        let Some(stop) = config.stop else { continue };
        let mut scene = Scene::new(config);
        scene.disarm();
        scene.step(COUNTS);
        scene.arm();
        scene.turn(stop.switch, stop.position);
        scene.step(1);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        // The stop is ended elsewhere.
        scene.turn(stop.switch, Switch::Up);
        scene.arm();
        scene.switch.reset();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed, "stopped");
    }
}

#[test]
fn an_unfit_robot_is_not_armed_by_its_switches() {
    for config in CONFIGS {
        let mut scene = Scene::new(config);
        scene.switch.forbid(Unfit::Clock);
        scene.disarm();
        scene.step(COUNTS);
        scene.arm();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }
}

#[test]
fn nothing_arms_without_a_remote() {
    for config in CONFIGS {
        let mut scene = Scene::new(config);
        scene.is_cut = true;
        assert_eq!(scene.step(200), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
        assert_eq!(scene.arming.link(), RemoteLink::Lost);
    }
}

#[test]
fn an_emergency_stop_ends_by_hand_and_then_is_armed_anew() {
    for config in CONFIGS {
        let Some(stop) = config.stop else { continue };
        let mut scene = Scene::armed(config);
        scene.turn(stop.switch, stop.position);
        assert_eq!(scene.step(1), None);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        scene.turn(stop.switch, Switch::Up);
        scene.arm();
        scene.step(10);
        assert_eq!(scene.switch.state(), ArmState::EStopped, "the other switch arms yet");
        scene.disarm();
        scene.turn(stop.switch, stop.position);
        scene.step(10);
        assert_eq!(scene.switch.state(), ArmState::EStopped, "the switch stops yet");
        scene.turn(stop.switch, Switch::Up);
        scene.disarm();
        scene.step(COUNTS - 1);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        scene.step(1);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
        scene.arm();
        assert!(scene.step(COUNTS).is_some());
    }
}

#[test]
fn a_stop_from_elsewhere_is_not_undone_by_an_armed_remote() {
    for config in CONFIGS {
        let mut scene = Scene::armed(config);
        scene.switch.emergency_stop();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        let mut scene = Scene::armed(config);
        scene.switch.disarm();
        assert_eq!(scene.step(100), None);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }
}

/// After any stop a hand must move the switch, wherever it is and after any number of stops.
#[test]
fn a_stop_lasts_until_a_hand_has_moved_the_switch() {
    for config in CONFIGS {
        for lies_disarmed in [true, false] {
            for phase in 0..12 {
                let mut scene = Scene::armed(config);
                if lies_disarmed {
                    scene.disarm();
                }
                // The move before the stop may be a frame old, or long over.
                scene.step(phase);
                scene.switch.emergency_stop();
                assert_eq!(scene.step(500), None);
                assert_eq!(scene.switch.state(), ArmState::EStopped, "{config:?}, {phase}");
                scene.arm();
                scene.step(50);
                assert_eq!(scene.switch.state(), ArmState::EStopped);
                // Another one ends no sooner.
                scene.disarm();
                scene.step(COUNTS - 2);
                scene.switch.emergency_stop();
                scene.step(500);
                assert_eq!(scene.switch.state(), ArmState::EStopped, "{config:?}, {phase}");
                scene.arm();
                scene.step(COUNTS);
                scene.disarm();
                scene.step(COUNTS);
                assert_eq!(scene.switch.state(), ArmState::Disarmed, "{config:?}, {phase}");
                scene.arm();
                assert!(scene.step(COUNTS).is_some());
            }
        }
    }
}

/// The transmitter is switched off and on while it is stopped.
#[test]
fn a_remote_that_comes_back_moved_nothing() {
    for config in CONFIGS {
        let mut scene = Scene::armed(config);
        scene.switch.emergency_stop();
        scene.step(10);
        scene.is_cut = true;
        scene.step(150);
        scene.is_cut = false;
        scene.disarm();
        scene.step(500);
        assert_eq!(scene.switch.state(), ArmState::EStopped);
        scene.arm();
        scene.step(COUNTS);
        scene.disarm();
        scene.step(COUNTS);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }
}

/// A damaged frame ends no stop and arms nothing; what it stops or disarms stays so.
#[test]
fn one_frame_of_another_position_begins_nothing() {
    let bad = |scene: &mut Scene, wrong: &dyn Fn(&mut Scene), times: u32| {
        let good = scene.remote;
        wrong(scene);
        scene.step(times);
        scene.remote = good;
        scene.step(20);
    };
    for config in CONFIGS {
        for frames in 1..=2 {
            // From power-on with the switch where it arms.
            let mut scene = Scene::new(config);
            scene.step(20);
            bad(&mut scene, &Scene::disarm, frames);
            assert_eq!(scene.switch.state(), ArmState::Disarmed, "{config:?}");
            // It lies disarmed, and may be armed.
            scene.disarm();
            scene.step(20);
            bad(&mut scene, &Scene::arm, frames);
            assert_eq!(scene.switch.state(), ArmState::Disarmed, "{config:?}");
            // Stopped, wherever the switch lies.
            scene.switch.emergency_stop();
            bad(&mut scene, &Scene::arm, frames);
            assert_eq!(scene.switch.state(), ArmState::EStopped, "{config:?}");
            scene.arm();
            scene.step(20);
            bad(&mut scene, &Scene::disarm, frames);
            assert_eq!(scene.switch.state(), ArmState::EStopped, "{config:?}");
            // Armed: one frame is enough to disarm, and to stop.
            let mut scene = Scene::armed(config);
            bad(&mut scene, &Scene::disarm, frames);
            assert_eq!(scene.switch.state(), ArmState::Disarmed, "{config:?}");
            let Some(stop) = config.stop else { continue };
            let mut scene = Scene::armed(config);
            bad(&mut scene, &|scene| scene.turn(stop.switch, stop.position), frames);
            assert_eq!(scene.switch.state(), ArmState::EStopped, "{config:?}");
        }
    }
}

/// Frames that come fast need their time, and slow ones their number.
#[test]
fn a_position_needs_three_frames_and_forty_milliseconds() {
    for (period, frames) in [(4, 11), (10, 5), (14, 4), (20, 3), (22, 3), (60, 3)] {
        let mut scene = Scene::armed(ArmingConfig::DEFAULT);
        let mut until = |position, wanted| {
            scene.remote.right_switch = position;
            (1..50).find(|_| {
                scene.now += Micros::from_millis(period);
                let newest = Some(Stamped { value: scene.remote, at: scene.now });
                // Looked at twice, it is still one.
                for _ in 0..2 {
                    scene.arming.step(newest, &scene.switch, scene.now);
                }
                scene.switch.state() == wanted
            })
        };
        assert_eq!(until(Switch::Down, ArmState::Disarmed), Some(1));
        assert_eq!(until(Switch::Down, ArmState::EStopped), None);
        assert_eq!(until(Switch::Up, ArmState::Armed), Some(frames), "every {period} ms");
    }
}

fn push(remote: &mut Remote, axis: Axis, to: f32) {
    *match axis {
        Axis::LeftX => &mut remote.left.x,
        Axis::LeftY => &mut remote.left.y,
        Axis::RightX => &mut remote.right.x,
        Axis::RightY => &mut remote.right.y,
        Axis::Dial => &mut remote.dial,
    } = to;
}

#[test]
fn it_arms_only_while_what_moves_something_is_at_rest() {
    let all = [Axis::LeftX, Axis::LeftY, Axis::RightX, Axis::RightY, Axis::Dial];
    for config in CONFIGS {
        for axis in all {
            for at in [-1.0, -0.06, 0.06, 1.0, f32::NAN] {
                let mut scene = Scene::new(config);
                push(&mut scene.remote, axis, at);
                scene.disarm();
                scene.step(20);
                scene.arm();
                let is_armed = scene.step(20).is_some();
                assert_eq!(is_armed, !config.at_rest.contains(&axis), "{axis} at {at}");
                assert_eq!(scene.arming.refused(), (!is_armed).then_some(axis));
                if is_armed {
                    continue;
                }
                // At rest now; but no stick arms it, only the switch.
                push(&mut scene.remote, axis, 0.04);
                assert_eq!(scene.step(200), None);
                scene.disarm();
                scene.step(COUNTS);
                assert_eq!(scene.arming.refused(), None);
                scene.arm();
                assert!(scene.step(COUNTS).is_some());
            }
        }
    }
}

#[test]
fn a_remote_that_is_lost_for_a_moment_suspends_and_for_longer_disarms() {
    for config in CONFIGS {
        let mut scene = Scene::armed(config);
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
        scene.disarm();
        scene.step(COUNTS);
        scene.arm();
        assert!(scene.step(COUNTS).is_some());
    }
}

#[test]
fn the_receivers_own_failsafe_suspends_at_once_whatever_the_frame_says() {
    for config in CONFIGS {
        let mut scene = Scene::armed(config);
        scene.remote.left.y = 1.0;
        scene.remote.failsafe = true;
        assert_eq!(scene.step(1), None);
        assert_eq!(scene.switch.state(), ArmState::Suspended);
        scene.step(99);
        assert_eq!(scene.switch.state(), ArmState::Disarmed);
    }
}

#[test]
fn a_configuration_that_cannot_work_is_refused() {
    let down = |switch| SwitchAt::new(switch, Switch::Down);
    let config =
        |disarm, stop| ArmingConfig { disarm: down(disarm), stop: Some(down(stop)), at_rest: &[] };
    for receiver in Receiver::ALL {
        let has_four = matches!(receiver, Receiver::Sbus | Receiver::Crsf | Receiver::Ppm);
        let missing = |name| if has_four { Ok(()) } else { Err(name) };
        let refused =
            |name| missing(name).map_err(|name| ArmingError::NoSuchSwitch(name, receiver));
        assert_eq!(config(Right, Left).validate(receiver), Ok(()));
        assert_eq!(config(Third, Left).validate(receiver), refused(Third));
        assert_eq!(config(Right, Fourth).validate(receiver), refused(Fourth));
        assert_eq!(config(Right, Right).validate(receiver), Err(ArmingError::SamePosition));
    }
    for (stop, position, refused) in [
        (Switch::Middle, Switch::Down, Err(ArmingError::StopOnTheWay)),
        (Switch::Middle, Switch::Up, Err(ArmingError::StopOnTheWay)),
        (Switch::Up, Switch::Down, Ok(())),
        (Switch::Up, Switch::Middle, Ok(())),
    ] {
        let at = |position| SwitchAt::new(Right, position);
        let config = ArmingConfig { disarm: at(position), stop: Some(at(stop)), at_rest: &[] };
        assert_eq!(config.validate(Receiver::Vt03), refused, "{config:?}");
    }
    for (position, refused) in [
        (Switch::Up, Err(ArmingError::Button)),
        (Switch::Middle, Ok(())),
        (Switch::Down, Err(ArmingError::Button)),
    ] {
        let disarm = SwitchAt::new(Left, position);
        let config = ArmingConfig { disarm, stop: None, at_rest: &[] };
        assert_eq!(config.validate(Receiver::Vt03), refused);
        assert_eq!(config.validate(Receiver::Dr16), Ok(()));
    }
    let error = config(Third, Left).validate(Receiver::Vt03).unwrap_err();
    extern crate std;
    let text = "Third with vt03: the receiver's remote has no such switch: it would be in its middle \
                for ever";
    assert_eq!(std::string::ToString::to_string(&error), text);
}
