//! Arming by any switches, with every receiver: its real bytes and pulses, from the hand to the
//! `ArmSwitch`.

use std::cell::RefCell;
use std::pin::Pin;

use rc10_cli::Receiver;
use rc10_cli::robot::remote::{ReceiverPort, ReceiverWire};
use rc10_message::{Every, Latest, now};
use rc10_module::Reception;
use rc10_module::remote::{self, Remote, RemoteLink, Switch};
use rc10_motor::{ArmState, ArmSwitch};
use rc10_sim::remote::{Controls, Switch as Position};
use rc10_sim::{Tasks, World};
use rc10_tasks::{Arming, ArmingConfig, Axis, SwitchAt, SwitchName};
use rc10_time::Micros;

use super::millis;

/// Two switches; one that arms and stops; one that arms, and no stop.
const CONFIGS: [ArmingConfig; 3] = [
    ArmingConfig::DEFAULT,
    ArmingConfig {
        disarm: SwitchAt::new(SwitchName::Right, Switch::Middle),
        stop: Some(SwitchAt::new(SwitchName::Right, Switch::Down)),
        at_rest: &[Axis::LeftY, Axis::RightX],
    },
    ArmingConfig {
        disarm: SwitchAt::new(SwitchName::Right, Switch::Up),
        stop: None,
        at_rest: Axis::STICKS,
    },
];

/// The same with the switches that a DR16 and a VT03 have not.
fn on_other_switches(config: ArmingConfig) -> ArmingConfig {
    let other = |at: SwitchAt| {
        let switch =
            if at.switch == SwitchName::Left { SwitchName::Fourth } else { SwitchName::Third };
        SwitchAt { switch, ..at }
    };
    ArmingConfig { disarm: other(config.disarm), stop: config.stop.map(other), ..config }
}

/// The hand puts a switch into a position.
fn turn(controls: &mut Controls, at: SwitchAt) {
    *match at.switch {
        SwitchName::Left => &mut controls.left_switch,
        SwitchName::Right => &mut controls.right_switch,
        SwitchName::Third => &mut controls.more_switches[0],
        SwitchName::Fourth => &mut controls.more_switches[1],
    } = match at.position {
        Switch::Up => Position::Up,
        Switch::Middle => Position::Middle,
        Switch::Down => Position::Down,
    };
}

/// A position of the switch that arms.
fn arms(config: &ArmingConfig) -> SwitchAt {
    let is_free = |at: &SwitchAt| *at != config.disarm && Some(*at) != config.stop;
    position(config.disarm.switch).into_iter().find(is_free).unwrap()
}

fn position(switch: SwitchName) -> [SwitchAt; 3] {
    [Switch::Middle, Switch::Up, Switch::Down].map(|to| SwitchAt::new(switch, to))
}

/// Lets time pass, ms.
type Run<'r> = dyn FnMut(u64) -> ArmState + 'r;

/// A robot that does nothing but to be armed: a receiver, and a task that looks every 10 ms.
fn with_arming(
    receiver: Receiver,
    config: ArmingConfig,
    seed: u64,
    test: impl FnOnce(&mut Run<'_>, &rc10_sim::remote::Remote, &ArmSwitch, &RefCell<Arming>),
) {
    config.validate(receiver).unwrap();
    let hand = rc10_sim::remote::Remote::new();
    let mut world = World::new(seed);
    let port = ReceiverWire::new(receiver, &mut world, &hand).port();
    let (switch, reception) = (ArmSwitch::new(), Reception::new());
    let newest = Latest::<Remote, 1>::new();
    let arming = RefCell::new(Arming::new(config));
    let mut tasks = Tasks::new();
    tasks.add(async {
        let hear = |remote, at| newest.set(remote, at);
        match port {
            ReceiverPort::Serial(port) => {
                let _ = remote::listen(receiver, receiver.channels(), port, &reception, hear).await;
            }
            ReceiverPort::Pulses(mut port) => {
                let edges = async || port.rising_edge().await;
                remote::listen_pulses(receiver.channels(), edges, &reception, hear).await;
            }
        }
    });
    tasks.add(async {
        let mut every = Every::millis(10);
        loop {
            every.next().await;
            arming.borrow_mut().step(newest.read(), &switch, now());
        }
    });
    let mut clock = Micros::ZERO;
    let mut run = |time: u64| {
        clock += millis(time);
        let _ = world.run(Pin::new(&mut tasks), clock);
        switch.state()
    };
    test(&mut run, &hand, &switch, &arming);
}

fn play(receiver: Receiver, config: ArmingConfig, seed: u64) {
    with_arming(receiver, config, seed, |run, hand, _, arming| {
        follow_hands(receiver, config, run, hand, arming);
    });
}

fn follow_hands(
    receiver: Receiver,
    config: ArmingConfig,
    run: &mut Run<'_>,
    hand: &rc10_sim::remote::Remote,
    arming: &RefCell<Arming>,
) {
    let what = format!("{receiver} {config:?}");
    // A position that arms, and one of the stop switch that does not stop.
    let ArmingConfig { disarm, stop, .. } = config;
    let is_free = |at: &SwitchAt| *at != disarm && Some(*at) != stop;
    let arm = arms(&config);
    let mut controls = Controls::REST;
    let mut put = |at: SwitchAt| {
        turn(&mut controls, at);
        hand.set(controls);
    };

    put(arm);
    assert_eq!(run(500), ArmState::Disarmed, "{what}: left there, it arms nothing");
    put(disarm);
    assert_eq!(run(100), ArmState::Disarmed, "{what}");
    put(arm);
    assert_eq!(run(100), ArmState::Armed, "{what}");
    if let Some(stop) = stop {
        put(stop);
        assert_eq!(run(100), ArmState::EStopped, "{what}");
        put(position(stop.switch).into_iter().find(is_free).unwrap());
        put(arm);
        assert_eq!(run(100), ArmState::EStopped, "{what}: the other switch arms yet");
        put(disarm);
        assert_eq!(run(100), ArmState::Disarmed, "{what}");
        put(arm);
        assert_eq!(run(100), ArmState::Armed, "{what}");
    }

    // The failsafe in two steps: back in time it goes on, later only a hand arms it.
    hand.set_transmitter(false);
    assert_eq!(run(500), ArmState::Suspended, "{what}");
    hand.set_transmitter(true);
    assert_eq!(run(100), ArmState::Armed, "{what}");
    hand.set_transmitter(false);
    for (state, after) in [(ArmState::Armed, 100), (ArmState::Suspended, 1000)] {
        assert!((0..2000).any(|_| run(1) != state), "{what}: {state:?} for ever");
        // A step of 10 ms, and one of this loop. The time of a frame is its begin: PPM's last 22 ms.
        let silent = now().since(hand.sent().last_live.unwrap().micros());
        assert!((millis(after - 22)..millis(after + 12)).contains(&silent), "{what}: {silent}");
    }
    hand.set_transmitter(true);
    assert_eq!(run(500), ArmState::Disarmed, "{what}");
    assert_eq!(arming.borrow().link(), RemoteLink::Online, "{what}");
    put(disarm);
    run(100);
    put(arm);
    assert_eq!(run(100), ArmState::Armed, "{what}");
}

/// A hand that holds a stick, and others that stop the robot: by this receiver's bytes or pulses.
fn play_stops(receiver: Receiver, config: ArmingConfig) {
    with_arming(receiver, config, 7, |run, hand, switch, arming| {
        let what = format!("{receiver} {config:?}");
        let mut controls = Controls::REST;
        turn(&mut controls, arms(&config));
        let armed = controls;
        turn(&mut controls, config.disarm);
        let disarmed = controls;
        let arm = |run: &mut dyn FnMut(u64) -> ArmState| {
            hand.set(disarmed);
            run(130);
            hand.set(armed);
            assert_eq!(run(130), ArmState::Armed, "{what}");
        };
        // Stopped from elsewhere with the switch where it disarms: in each phase of frames and looks.
        for phase in (0..60).step_by(if config == ArmingConfig::DEFAULT { 1 } else { 7 }) {
            hand.set(disarmed);
            run(100 + phase);
            switch.emergency_stop();
            assert_eq!(run(300), ArmState::EStopped, "{what}, {phase}");
            hand.set(armed);
            assert_eq!(run(130), ArmState::EStopped, "{what}, {phase}");
            hand.set(disarmed);
            assert_eq!(run(130), ArmState::Disarmed, "{what}, {phase}");
            arm(run);
        }
        // A stick that stays where it is left.
        for axis in Axis::STICKS.iter().chain(&[Axis::Dial]) {
            let push = |mut controls: Controls| {
                *match axis {
                    Axis::LeftX => &mut controls.left.x,
                    Axis::LeftY => &mut controls.left.y,
                    Axis::RightX => &mut controls.right.x,
                    Axis::RightY => &mut controls.right.y,
                    Axis::Dial => &mut controls.dial,
                } = -1.0;
                controls
            };
            hand.set(push(disarmed));
            run(130);
            hand.set(push(armed));
            let moves = config.at_rest.contains(axis);
            let expected = if moves { ArmState::Disarmed } else { ArmState::Armed };
            assert_eq!(run(200), expected, "{what}, {axis}");
            assert_eq!(arming.borrow().refused(), moves.then_some(*axis), "{what}");
            hand.set(armed);
            assert_eq!(run(200), expected, "{what}, {axis}: let go, it arms nothing");
            arm(run);
            hand.set(push(armed));
            assert_eq!(run(130), ArmState::Armed, "{what}, {axis}: armed, it may move");
        }
    });
}

#[test]
fn stops_last_and_sticks_rest_with_every_receiver() {
    for receiver in Receiver::ALL {
        for config in CONFIGS {
            play_stops(receiver, config);
        }
    }
}

#[test]
fn any_switches_arm_disarm_and_stop_with_every_receiver() {
    for receiver in Receiver::ALL {
        for (seed, config) in (1..).zip(CONFIGS) {
            play(receiver, config, seed);
            if SwitchName::Third.exists_on(receiver) {
                play(receiver, on_other_switches(config), seed);
            }
        }
    }
}
