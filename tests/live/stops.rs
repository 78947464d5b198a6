//! What must not move: a stop by a PC, a zero, a late or repeated jog, a jog with wild gains, wishes
//! that another robot was meant by, lines that damage and come back.

use rc10_cli::live::Urgency;
use rc10_link::{Ask, Declaration};
use rc10_motor::Request;

use super::*;

const DOWN: Controls = Controls { right_switch: Switch::Down, ..Controls::REST };

/// A disarmed robot whose remote lies there with its switch down, as for a jog.
fn on_blocks(scene: &mut Scene<'_>, shared: &Shared<'_>) {
    disarmed(scene, shared);
    scene.around.remote.as_ref().unwrap().remote.set(DOWN);
    scene.run(200);
    assert_eq!(shared.switch.state(), ArmState::Disarmed);
}

fn wheel_rpm(shared: &Shared<'_>) -> f32 {
    shared.motor(BASE.wheels[0]).status().feedback.speed.get().abs()
}

/// The bytes of a request that no client makes.
fn send(scene: &mut Scene<'_>, bytes: &[u8]) {
    scene.around.console.clone().unwrap().send(bytes);
}

/// The button is held on, as a page does that has not heard of the stop.
#[test]
fn a_stop_lasts_in_every_phase_of_a_held_jog_with_the_switch_down() {
    let (mut turned, mut ended) = (0, 0);
    with_scene(BAUD, |scene, shared| {
        for phase in 0..60 {
            on_blocks(scene, shared);
            assert_eq!(hold(scene, 0, 100, 500), Answer::Done, "{phase}");
            assert!(wheel_rpm(shared) > 5.0, "{phase}");
            scene.run(phase);
            let id = scene.client.urge(Urgent::Stop, scene.now());
            assert_eq!(scene.ask(id), Answer::Done);
            scene.run(50);
            ended += u32::from(shared.switch.state() != ArmState::EStopped);
            efforts(scene);
            for _ in 0..20 {
                let id = scene.client.act(Action::Jog(0, 100));
                scene.run(25);
                refused(scene.client.answer(id).unwrap(), "disarmed");
            }
            turned += u32::from(efforts(scene) != [0.0; 4]);
            ended += u32::from(shared.switch.state() != ArmState::EStopped);
            // By hand: out of the position and back.
            let hand = scene.around.remote.as_ref().unwrap().remote.clone();
            hand.set(Controls::REST);
            scene.run(100);
            assert_eq!(shared.switch.state(), ArmState::EStopped);
            hand.set(DOWN);
            scene.run(100);
            assert_eq!(shared.switch.state(), ArmState::Disarmed);
            // Armed, for the next one to begin as this one did.
            hand.set(Controls::REST);
            scene.run(100);
            assert_eq!(shared.switch.state(), ArmState::Armed);
        }
    });
    assert_eq!((turned, ended), (0, 0), "of 60");
}

/// Without a hello before, at once after power-on, and with the link long gone.
#[test]
fn a_stop_needs_no_hello() {
    with_scene(BAUD, |scene, shared| {
        let mut silent = Client::new();
        std::mem::swap(&mut scene.client, &mut silent);
        let stop = frame(&Ask::Urge { id: 7, what: Urgent::Stop });
        let until = scene.now() + Micros::from_millis(1500);
        scene.around.run(&mut scene.tasks, until);
        assert_eq!(shared.switch.state(), ArmState::Armed);
        send(scene, &stop);
        scene.around.run(&mut scene.tasks, until + Micros::from_millis(3));
        assert_eq!(shared.switch.state(), ArmState::EStopped);
    });
}

/// A PC that asks for anything else says hello first.
#[test]
fn nothing_but_a_stop_is_done_without_a_hello() {
    with_scene(BAUD, |scene, shared| {
        scene.run(1500);
        let declaration = scene.client.declaration();
        let kp = scene.parameter(Name::ALL[0].label(), "speed_kp");
        let change = rc10_link::Change { parameter: kp.index, value: 1.5 * kp.initial };
        let set = Ask::Set { id: 9, changes: [change].into_iter().collect(), declaration };
        let until = scene.now() + Micros::from_millis(1500);
        scene.around.run(&mut scene.tasks, until);
        let _ = scene.around.console.clone().unwrap().take();
        send(scene, &frame(&set));
        scene.around.run(&mut scene.tasks, until + Micros::from_millis(100));
        let tuning = || shared.motor(Name::ALL[0]).tuning().unwrap();
        assert_eq!(tuning()[1], tuning()[0]);
        // After a hello the same is done.
        scene.run(500);
        send(scene, &frame(&set));
        scene.run(20);
        assert_eq!(tuning()[1].speed.kp, 1.5 * kp.initial);
    });
}

/// What a PC has watched is not sent to the next one, which may not know those signals.
#[test]
fn what_a_pc_has_watched_ends_with_it() {
    with_scene(BAUD, |scene, _| {
        scene.run(1500);
        let tilt = scene.signal("lift tilt", "value");
        scene.client.watch(0, 10, [tilt].into_iter());
        scene.run(300);
        assert!(scene.client.take_samples().len() > 20);
        let line = scene.around.console.clone().unwrap();
        let mut hello = |silent| {
            let quiet = scene.now() + Micros::from_millis(silent);
            scene.around.run(&mut scene.tasks, quiet);
            let _ = line.take();
            line.send(&frame(&Ask::Hello { version: rc10_link::VERSION }));
            scene.around.run(&mut scene.tasks, quiet + Micros::from_millis(300));
            line.take().len()
        };
        // The same PC, a little later; and one that comes when it has gone.
        assert!(hello(300) > 400);
        let told = hello(1500);
        assert!((10..100).contains(&told), "{told} bytes");
    });
}

/// Bits that flip, frames that are lost, a line that is away for a second, one that is dead in the other
/// direction: the stop is sent until it is answered.
#[test]
fn a_stop_reaches_the_robot_through_a_bad_line() {
    for phase in 0..60_u64 {
        with_scene(BAUD, |scene, shared| {
            scene.run(1500 + phase);
            let line = scene.around.console.clone().unwrap();
            let begin = scene.now();
            let id = scene.client.urge(Urgent::Stop, begin);
            let (mut stopped, mut told) = (None, None);
            for millis in 0..1500 {
                let now = scene.now();
                scene.client.step(now);
                let mut bytes = scene.client.take_out();
                match phase % 3 {
                    // The first two frames have a bit that flipped.
                    0 if millis < 40 => {
                        bytes.iter_mut().for_each(|byte| *byte ^= 1 << (phase % 8));
                    }
                    // A cable that comes back.
                    1 if millis < 1000 => bytes.clear(),
                    _ => {}
                }
                line.send(&bytes);
                scene.around.run(&mut scene.tasks, now + Micros::from_millis(1));
                let heard = line.take();
                if phase % 3 != 2 || millis >= 300 {
                    scene.client.hear(&heard, scene.now());
                }
                if shared.switch.state() == ArmState::EStopped {
                    stopped.get_or_insert(millis);
                }
                let urgency = scene.client.urgency(Urgent::Stop, scene.now());
                let expected = if millis < 149 { Urgency::Sent } else { Urgency::NotHeard };
                assert!(urgency.is_none_or(|it| it == expected), "{phase}: {urgency:?}, {millis}");
                if scene.client.answer(id).is_some() {
                    told.get_or_insert(millis);
                }
            }
            let (stopped, told) = (stopped.unwrap(), told.unwrap());
            let (stops, tells) = [(60, 65), (1025, 1030), (5, 330)][(phase % 3) as usize];
            assert!(stopped <= stops && told <= tells, "{phase}: {stopped} ms, told {told} ms");
            assert_eq!(scene.client.urgency(Urgent::Stop, scene.now()), None);
        });
    }
}

#[test]
fn a_zero_while_armed_is_refused_and_moves_nothing() {
    with_scene(BAUD, |scene, shared| {
        scene.run(1500);
        assert_eq!(shared.switch.state(), ArmState::Armed);
        for name in Name::ALL {
            let motor = u8::try_from(name.index()).unwrap();
            let before = shared.motor(*name).status().feedback.total_angle;
            let id = scene.client.act(Action::Zero(motor));
            refused(scene.ask(id), "disarmed");
            let moved = shared.motor(*name).status().feedback.total_angle.minus(before);
            assert!(moved.degrees().get().abs() < 90.0, "{name:?}");
        }
        // The motor's bus refuses a task, too: armed between the look and the tick.
        let asked = std::rc::Rc::new(std::cell::Cell::new(None));
        let tell = std::rc::Rc::clone(&asked);
        let port = shared.motor(Name::LiftFrontLeft);
        scene.tasks.add(async move { tell.set(Some(port.request(Request::SetZero).await)) });
        scene.run(5);
        assert_eq!(asked.get(), Some(Err(rc10_motor::RequestError::WhileDriven)));
        on_blocks(scene, shared);
        let lift = u8::try_from(Name::LiftFrontLeft.index()).unwrap();
        let id = scene.client.act(Action::Zero(lift));
        assert_eq!(scene.ask(id), Answer::Done);
        assert_eq!(
            shared.motor(Name::LiftFrontLeft).status().feedback.total_angle.degrees().get().round(),
            0.0
        );
    });
}

/// A jog that is 20 s old is refused, and so is a repeated one.
#[test]
fn a_late_jog_and_a_repeated_one_turn_nothing() {
    with_scene(BAUD, |scene, shared| {
        on_blocks(scene, shared);
        let jog = |scene: &mut Scene<'_>| {
            let _ = (scene.client.take_out(), scene.client.act(Action::Jog(0, 100)));
            scene.client.take_out()
        };
        let late = jog(scene);
        scene.run(20_000);
        efforts(scene);
        send(scene, &late);
        scene.run(300);
        assert_eq!(efforts(scene), [0.0; 4], "late");
        for after in [70, 90, 120, 140, 151, 200] {
            let once = jog(scene);
            send(scene, &once);
            scene.run(after);
            assert!(efforts(scene)[0] > 0.0, "{after}");
            // Over, and then the same bytes again.
            scene.run(100);
            efforts(scene);
            send(scene, &once);
            scene.run(100);
            assert_eq!(efforts(scene), [0.0; 4], "the same {after} ms later");
        }
        // Twice at once is once.
        let once = jog(scene);
        send(scene, &once);
        scene.run(70);
        send(scene, &once);
        scene.run(15);
        efforts(scene);
        scene.run(100);
        assert_eq!(efforts(scene), [0.0; 4]);
    });
}

/// Gains from a PC may be as wrong as they like.
#[test]
fn a_jog_is_gentle_and_ends_when_it_is_too_fast() {
    with_scene(BAUD, |scene, shared| {
        for (kp, ki) in [(0.0, 1000.0), (40.0, 0.0), (100.0, 1000.0), (0.0, 5.0)] {
            on_blocks(scene, shared);
            let gains = rc10_motor::Gains { kp, ki, kd: 0.0 };
            let port = shared.motor(BASE.wheels[0]);
            scene.tasks.add(async move {
                let _ = port.request(Request::SpeedGains(gains)).await;
            });
            scene.run(10);
            efforts(scene);
            let (mut fastest, mut ended) = (0.0_f32, false);
            for _ in 0..200 {
                let id = scene.client.act(Action::Jog(0, 200));
                for _ in 0..10 {
                    scene.run(1);
                    fastest = fastest.max(wheel_rpm(shared));
                }
                ended |= matches!(scene.client.answer(id), Some(Answer::Refused(_)));
            }
            let most = efforts(scene)[0];
            println!("kp {kp}, ki {ki}: {fastest} rpm, {most} of full scale, ended {ended}");
            // It coasts on from where it is ended: a step of the loop later.
            assert!(fastest <= 44.0 && most <= 0.201, "{kp} {ki}: {fastest} rpm, {most}");
            scene.run(500);
            assert_eq!(shared.switch.state(), ArmState::Disarmed);
            let hand = scene.around.remote.as_ref().unwrap().remote.clone();
            hand.set(Controls::REST);
            let declared = port.tuning().unwrap()[0].speed;
            scene.tasks.add(async move {
                let _ = port.request(Request::SpeedGains(declared)).await;
            });
            scene.run(200);
        }
    });
}

#[test]
fn a_pc_sets_no_gain_above_ten_times_the_tables_and_no_limit_above_it() {
    with_scene(BAUD, |scene, shared| {
        scene.run(400);
        let all: Vec<_> = scene.client.parameters().cloned().collect();
        for it in all.iter().filter(|it| it.folder == "motors") {
            let [least, most] = it.range;
            let times = if it.name == "limit" { 1.0 } else { 10.0 };
            assert_eq!(least, 0.0);
            assert!(most > 0.0 && (it.initial == 0.0 || most == it.initial * times), "{it:?}");
            let before =
                Name::ALL.iter().map(|name| shared.motor(*name).tuning()).collect::<Vec<_>>();
            for value in [most * 1.001, 2.0 * most, 1e6, -0.001] {
                let id = scene.client.set(&[(it.index, value)]).unwrap();
                refused(scene.ask(id), "out of its range");
            }
            let after =
                Name::ALL.iter().map(|name| shared.motor(*name).tuning()).collect::<Vec<_>>();
            assert_eq!(before, after, "{it:?}");
        }
    });
}

/// A PC with a wrong time lets go of its button: the others turn the motor all the same.
#[test]
fn a_zero_from_the_future_blocks_no_jog() {
    with_scene(BAUD, |scene, shared| {
        on_blocks(scene, shared);
        let (declaration, heard, action) =
            (scene.client.declaration(), u64::MAX, Action::Jog(0, 0));
        send(scene, &frame(&Ask::Act { id: 9, declaration, heard, action }));
        scene.run(25);
        assert_eq!(hold(scene, 0, 100, 500), Answer::Done);
        assert!(wheel_rpm(shared) > 5.0);
    });
}

/// A robot that was flashed with another declaration refuses what was meant for the one before.
#[test]
fn a_wish_of_another_declaration_is_refused() {
    with_scene(BAUD, |scene, shared| {
        on_blocks(scene, shared);
        let known = scene.client.declaration();
        assert_ne!(known, Declaration::default());
        let heard = scene.now().get();
        for declaration in [Declaration(known.0 ^ 1), Declaration::default()] {
            for action in [Action::Jog(0, 100), Action::Zero(0), Action::ClearFault(0)] {
                send(scene, &frame(&Ask::Act { id: 1, declaration, heard, action }));
            }
            let change = rc10_link::Change { parameter: 0, value: 1.0 };
            let changes = [change].into_iter().collect();
            send(scene, &frame(&Ask::Set { id: 2, changes, declaration }));
            scene.run(100);
            assert_eq!(efforts(scene), [0.0; 4]);
            let [before, now] = shared.motor(Name::ALL[0]).tuning().unwrap();
            assert_eq!(before, now);
        }
        // A stop is for every robot.
        send(scene, &frame(&Ask::Urge { id: 3, what: Urgent::Stop }));
        scene.run(3);
        assert_eq!(shared.switch.state(), ArmState::EStopped);
    });
}

/// Two programs behind a serial server that admits two: each hears all.
#[test]
fn two_programs_on_one_line_take_their_own_answers() {
    with_scene(BAUD, |scene, shared| {
        let mut other = Client::with_first_id(30_000);
        let line = scene.around.console.clone().unwrap();
        let run = |scene: &mut Scene<'_>, other: &mut Client, loses: bool, millis: u64| {
            for _ in 0..millis {
                let now = scene.now();
                for client in [&mut scene.client, &mut *other] {
                    client.step(now);
                }
                let mine = scene.client.take_out();
                if !loses {
                    line.send(&mine);
                }
                line.send(&other.take_out());
                scene.around.run(&mut scene.tasks, now + Micros::from_millis(1));
                let heard = line.take();
                scene.client.hear(&heard, scene.now());
                other.hear(&heard, scene.now());
            }
        };
        run(scene, &mut other, false, 2000);
        for _ in 0..50 {
            // Mine is lost, and the other one is refused something in the same moment.
            let mine = scene.client.act(Action::ClearFault(0));
            let theirs = other.act(Action::Zero(0));
            run(scene, &mut other, true, 30);
            assert_eq!(scene.client.answer(mine), None);
            assert!(matches!(other.answer(theirs), Some(Answer::Refused(_))));
            run(scene, &mut other, false, 10);
        }
        assert_ne!(shared.switch.state(), ArmState::EStopped);
        let theirs = other.urge(Urgent::Stop, scene.now());
        run(scene, &mut other, false, 30);
        assert_eq!(other.answer(theirs), Some(Answer::Done));
        assert_eq!(scene.client.answer(theirs), None);
    });
}

/// Motors of one bus are asked while those of another take no more requests.
#[test]
fn a_change_that_is_refused_half_way_leaves_nothing_changed() {
    with_scene(BAUD, |scene, shared| {
        scene.run(400);
        let other = Name::ALL.iter().find(|name| {
            name.slot().on != Name::ALL[0].slot().on && shared.motor(**name).tuning().is_some()
        });
        let other = *other.unwrap();
        let same = shared.motor(other).tuning().unwrap()[0].speed;
        for _ in 0..8 {
            scene.tasks.add(async move {
                loop {
                    let request = Request::SpeedGains(same);
                    if shared.motor(other).request(request).await.is_err() {
                        embassy_time::Timer::after_micros(10).await;
                    }
                }
            });
        }
        let gain = |label: &str, scene: &Scene<'_>| scene.parameter(label, "speed_kp");
        let (first, second) = (gain(Name::ALL[0].label(), scene), gain(other.label(), scene));
        let mut refusals = 0;
        for round in 1..40_u8 {
            let factor = 1.0 + f32::from(round) * 0.01;
            let changes =
                [(first.index, first.initial * factor), (second.index, second.initial * factor)];
            let before = shared.motor(Name::ALL[0]).tuning().unwrap()[1];
            let id = scene.client.set(&changes).unwrap();
            if let Answer::Refused(_) = scene.ask(id) {
                refusals += 1;
                scene.run(5);
                assert_eq!(shared.motor(Name::ALL[0]).tuning().unwrap()[1], before, "{round}");
            }
        }
        println!("{refusals} of 39 refused");
        assert!(refusals > 0);
    });
}

/// It waited behind a request that a device did not answer: its button may have been let go long ago.
#[test]
fn a_jog_that_waited_behind_a_slow_request_turns_nothing() {
    let ports = mixed::Ports::new();
    let shared = mixed::Shared::new(&ports);
    let mut motors = mixed::Motors::new();
    let robot = rc10_cli::robot_of::<mixed::Robot>(&shared, &mut motors).unwrap();
    let mut around = Environment::new(robot.description(), 1).unwrap().with_console(BAUD);
    around.operator = None;
    let line = around.console.clone().unwrap();
    let mut tasks = robot.tasks(&around).unwrap();
    let (port, seen) = (line.port(), live::RobotView::new(&shared));
    tasks.add(async move {
        let link = live::Link::new(port.clone());
        link.serve(&seen, port, embassy_time::Instant::from_ticks(0), ()).await;
    });
    let mut scene = Scene { around, tasks, client: Client::new() };
    scene.run(1500);
    let number = |name: mixed::Name| u8::try_from(name.index()).unwrap();
    let (wheel, arm) = (number(mixed::Name::Wheel), number(mixed::Name::Arm));
    // Registers are told one by one, each with its own value.
    let mut values = Vec::new();
    for register in [7, 8] {
        let asked = std::rc::Rc::new(std::cell::Cell::new(None));
        let (tell, port) = (std::rc::Rc::clone(&asked), shared.motor(mixed::Name::Arm));
        scene.tasks.add(async move {
            tell.set(Some(port.request(Request::ReadRegister(register)).await));
        });
        scene.run(50);
        let Some(Ok(rc10_motor::Response::Register(value))) = asked.get() else {
            panic!("{:?}", asked.get());
        };
        let id = scene.client.act(Action::ReadRegister(arm, register));
        assert_eq!(scene.ask(id), Answer::Register(value));
        values.push(value);
    }
    assert_ne!(values[0], values[1]);
    let rpm = || shared.motor(mixed::Name::Wheel).status().feedback.speed.get().abs();
    assert_eq!(hold(&mut scene, wheel, 3000, 500), Answer::Done);
    assert!(rpm() > 10.0, "{}", rpm());
    // Let go it runs down.
    scene.run(300);
    let before = rpm();
    scene.around.motors[usize::from(arm)].set_power(false);
    let (slow, jog) = (
        scene.client.act(Action::ReadRegister(arm, 7)),
        scene.client.act(Action::Jog(wheel, 3000)),
    );
    let mut fastest = 0.0_f32;
    for _ in 0..300 {
        scene.run(1);
        fastest = fastest.max(rpm());
    }
    refused(scene.client.answer(slow).unwrap(), "in time");
    refused(scene.client.answer(jog).unwrap(), "too many");
    assert!(fastest < before + 2.0, "{before} {fastest}");
}
