//! A PC at the robot's console, in virtual time: what it is told, what it changes, what it loses.
#![expect(clippy::float_cmp, reason = "it compares what was set")]

mod rate;
mod stops;

use crate::common::scratch::Scratch;
use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_cli::judge::problems;
use rc10_cli::live::{
    Action, Answer, Client, Judge, LiveRecord, Sample, Urgent, frame, plan, watch,
};
use rc10_cli::record::{Kit, replay};
use rc10_cli::recording::problem::Severity;
use rc10_cli::world::console::ConsoleLine;
use rc10_cli::world::environment::Environment;
use rc10_motor::rc10_app::Rpm;
use rc10_motor::{ArmState, DriveMode, Motion, Names, Target};
use rc10_sim::Tasks;
use rc10_sim::remote::{Controls, Switch};
use rc10_tasks::live;
use rc10_time::Micros;
use team::table::{BASE, Name};
use team::{Motors, Ports, Shared};

const BAUD: u32 = 921_600;

struct Scene<'r> {
    around: Environment,
    tasks: Tasks<'r>,
    client: Client,
}

impl Scene<'_> {
    fn now(&self) -> Micros {
        self.around.world.now()
    }

    fn run(&mut self, millis: u64) {
        for _ in 0..millis {
            let now = self.now();
            self.client.step(now);
            let line = self.around.console.clone().unwrap();
            line.send(&self.client.take_out());
            self.around.run(&mut self.tasks, now + Micros::from_millis(1));
            self.client.hear(&line.take(), self.now());
        }
    }

    fn ask(&mut self, id: u16) -> Answer {
        for _ in 0..100 {
            if let Some(answer) = self.client.answer(id) {
                return answer;
            }
            self.run(1);
        }
        panic!("no answer");
    }

    fn signal(&self, label: &str, name: &str) -> u16 {
        let is = |(_, it): &(u16, &rc10_cli::live::Signal)| it.label == label && it.name == name;
        self.client.signals().find(is).unwrap_or_else(|| panic!("no {label} {name}")).0
    }

    fn parameter(&self, label: &str, name: &str) -> rc10_cli::live::Parameter {
        let mut all = self.client.parameters();
        all.find(|it| it.label == label && it.name == name).unwrap().clone()
    }
}

fn with_scene(baud: u32, test: impl for<'r> FnOnce(&mut Scene<'r>, &'r Shared<'r>)) {
    with_seed(1, baud, test);
}

fn with_seed(seed: u64, baud: u32, test: impl for<'r> FnOnce(&mut Scene<'r>, &'r Shared<'r>)) {
    let ports = Ports::new();
    let shared = Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let around = Environment::new(robot.description(), seed).unwrap().with_console(baud);
    let tasks = robot.tasks(&around).unwrap();
    test(&mut Scene { around, tasks, client: Client::new() }, &shared);
}

#[test]
fn a_teams_own_values_are_shown_and_changed() {
    with_scene(BAUD, |scene, shared| {
        scene.run(3000);
        let feeder = scene.parameter("feeder speed", "value");
        assert_eq!((feeder.value, feeder.range), (300.0, [0.0, 450.0]));
        let id = scene.client.set(&[(feeder.index, 120.0)]).unwrap();
        assert_eq!(scene.ask(id), Answer::Done);
        assert_eq!(shared.own.feeder.get(), 120.0);
        let id = scene.client.set(&[(feeder.index, 451.0)]).unwrap();
        assert!(matches!(scene.ask(id), Answer::Refused(_)));
        assert_eq!(shared.own.feeder.get(), 120.0);
        let tilt = scene.signal("lift tilt", "value");
        scene.client.watch(0, 10, [tilt].into_iter());
        scene.run(100);
        let sample = scene.client.take_samples().pop().unwrap();
        assert_eq!(sample.values.len(), 1);
        assert!((sample.values[0].1 - shared.own.tilt.get()).abs() < 1.0);
    });
}

/// The largest step of a wheel's command from one frame to the next, as a share of full scale.
fn largest_step(scene: &Scene<'_>, last: &mut [Option<i16>; 4]) -> f64 {
    let mut largest = 0.0_f64;
    for entry in scene.around.wires[0].take_trace() {
        let id = CanFrame::key_of(StandardId::new(0x200).unwrap());
        if !entry.from_controller || entry.frame.key() != id {
            continue;
        }
        for (lane, last) in entry.frame.bytes().as_chunks::<2>().0.iter().zip(&mut *last) {
            let raw = i16::from_be_bytes(*lane);
            // The script also stops the robot: then all goes to zero at once, as it must.
            let before = last.replace(raw).filter(|_| raw != 0).unwrap_or(raw);
            largest = largest.max((f64::from(raw) - f64::from(before)).abs() / 16384.0);
        }
    }
    largest
}

/// The largest step of the wheels' commands while no gain changes, in the whole script.
fn own_steps() -> f64 {
    let mut largest = 0.0_f64;
    with_scene(BAUD, |scene, _| {
        scene.run(400);
        let mut last = [None; 4];
        for _ in 0..9600 {
            scene.run(1);
            largest = largest.max(largest_step(scene, &mut last));
        }
    });
    largest
}

#[test]
fn a_thousand_changes_of_gains_never_kick_a_wheel() {
    with_scene(BAUD, |scene, shared| {
        scene.run(400);
        let wheels = BASE.wheels.map(Name::label);
        let gains: Vec<_> = wheels
            .iter()
            .flat_map(|label| ["speed_kp", "speed_ki"].map(|name| scene.parameter(label, name)))
            .collect();
        let (mut last, mut largest, mut state) = ([None; 4], 0.0_f64, 7_u32);
        // What a base that starts and stops does to its wheels' efforts by itself.
        let own = own_steps();
        let mut changed = 0;
        while changed < 1000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let gain = &gains[(state >> 8) as usize % gains.len()];
            // Between a third and three times what it is declared as.
            let factor = (((state >> 16) as f32 / 65536.0) * 2.0 - 1.0) * 3.0_f32.ln();
            let id = scene.client.set(&[(gain.index, gain.initial * factor.exp())]).unwrap();
            assert_eq!(scene.ask(id), Answer::Done);
            largest = largest.max(largest_step(scene, &mut last));
            changed += 1;
        }
        println!(
            "largest step {:.1} % of full scale; {:.1} % without",
            100.0 * largest,
            100.0 * own
        );
        // A tenth beside them, in whole steps of the device.
        assert!(largest > 0.0 && largest <= own.max(0.1) + 1.0 / 16384.0, "{largest} {own}");
        for name in Name::ALL {
            let feedback = shared.motor(*name).status().feedback;
            assert!(feedback.speed.is_finite() && feedback.readings()[0].is_finite());
        }
    });
}

#[test]
fn two_pcs_that_set_at_once_come_one_after_the_other_and_both_are_told() {
    let ports = Ports::new();
    let shared = Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let mut around = Environment::new(robot.description(), 1).unwrap().with_console(BAUD);
    let second = ConsoleLine::new(&mut around.world, BAUD);
    let mut tasks = robot.tasks(&around).unwrap();
    let (port, seen) = (second.port(), live::RobotView::new(&shared));
    tasks.add(async move {
        let link = live::Link::new(port.clone());
        link.serve(&seen, port, embassy_time::Instant::from_ticks(0), ()).await;
    });
    let mut scene = Scene { around, tasks, client: Client::new() };
    let mut other = Client::new();
    let run = |scene: &mut Scene<'_>, other: &mut Client, millis: u64| {
        for _ in 0..millis {
            other.step(scene.now());
            second.send(&other.take_out());
            scene.run(1);
            other.hear(&second.take(), scene.now());
        }
    };
    run(&mut scene, &mut other, 500);
    assert!(scene.client.is_described() && other.is_described());
    let label = Name::ALL[0].label();
    let all = ["speed_kp", "speed_ki", "angle_kp", "limit"];
    let indexes = all.map(|name| scene.parameter(label, name).index);
    for round in 0..50 {
        let values = |low: f32| indexes.map(|index| (index, low + round as f32 * 0.01));
        let ids = (scene.client.set(&values(1.0)).unwrap(), other.set(&values(2.0)).unwrap());
        run(&mut scene, &mut other, 30);
        assert_eq!(scene.client.answer(ids.0), Some(Answer::Done));
        assert_eq!(other.answer(ids.1), Some(Answer::Done));
        let now = shared.motor(Name::ALL[0]).tuning().unwrap()[1];
        let now = [now.speed.kp, now.speed.ki, now.angle.kp, now.limit];
        // All of one of them.
        assert!(now.iter().all(|value| value.to_bits() == now[0].to_bits()), "{now:?}");
        run(&mut scene, &mut other, 300);
        for client in [&scene.client, &other] {
            let told = client.parameters().find(|it| it.index == indexes[0]).unwrap();
            assert_eq!(told.value, now[0], "round {round}");
        }
    }
}

#[test]
fn a_robot_describes_itself_and_shows_what_it_does() {
    with_scene(BAUD, |scene, shared| {
        scene.run(400);
        assert!(scene.client.is_up(scene.now()) && scene.client.is_described());
        let motors = Name::ALL.len();
        let of_motors = scene.client.signals().filter(|(_, it)| it.folder == "motors");
        assert_eq!(of_motors.count() % motors, 0);
        // The effort of one is a share of the voltage, which nothing limits.
        let gains = scene.client.parameters().filter(|it| it.folder == "motors");
        assert_eq!(gains.count(), 7 * motors - 1);
        let label = Name::ALL[0].label();
        let (speed, target) = (scene.signal(label, "speed"), scene.signal(label, "target"));
        let arm = scene.signal("", "arm");
        assert_eq!(scene.client.watch(0, 2, [target, speed].into_iter()), 2);
        assert_eq!(scene.client.watch(1, 10, [arm].into_iter()), 1);
        scene.run(50);
        let _ = scene.client.take_samples();
        scene.run(1000);
        let samples = scene.client.take_samples();
        let fast: Vec<&Sample> = samples.iter().filter(|it| it.group == 0).collect();
        assert!((498..=501).contains(&fast.len()), "{}", fast.len());
        assert!(fast.windows(2).all(|two| two[1].at.get() - two[0].at.get() == 2000));
        let last = fast.last().unwrap();
        let status = shared.motor(Name::ALL[0]).status();
        let speed = last.values.iter().find(|it| it.0 == speed).unwrap().1;
        assert!((speed - status.feedback.speed.get()).abs() < 5.0, "{speed}");
        let arms = samples.iter().rfind(|it| it.group == 1).unwrap();
        assert_eq!(arms.values, [(arm, f32::from(shared.switch.state() as u8))]);
        assert_eq!(scene.client.losses(), <_>::default());
    });
}

#[test]
fn a_change_is_made_whole_or_not_at_all() {
    with_scene(BAUD, |scene, shared| {
        scene.run(400);
        let label = Name::ALL[0].label();
        let [kp, ki, limit] =
            ["speed_kp", "speed_ki", "limit"].map(|name| scene.parameter(label, name));
        let id = scene.client.set(&[(kp.index, 2.0 * kp.value), (ki.index, 0.5)]).unwrap();
        assert_eq!(scene.ask(id), Answer::Done);
        let [before, now] = shared.motor(Name::ALL[0]).tuning().unwrap();
        assert!((now.speed.kp - 2.0 * before.speed.kp).abs() < 1e-6, "{now:?}");
        assert!((now.speed.ki - 0.5).abs() < 1e-6 && now.angle == before.angle);
        scene.run(500);
        assert_eq!(scene.parameter(label, "speed_kp").value, now.speed.kp);
        assert_eq!(scene.parameter(label, "speed_kp").initial, before.speed.kp);
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            let id = scene.client.set(&[(kp.index, 1.0), (limit.index, bad)]).unwrap();
            let Answer::Refused(why) = scene.ask(id) else { panic!("{bad}") };
            assert!(why.contains("limit") && why.contains("range"), "{why}");
            assert_eq!(shared.motor(Name::ALL[0]).tuning().unwrap()[1], now);
        }
        let id = scene.client.set(&[(9999, 1.0)]).unwrap();
        assert!(matches!(scene.ask(id), Answer::Refused(_)));
    });
}

#[test]
fn a_pc_stops_the_robot_and_never_arms_it() {
    with_scene(BAUD, |scene, shared| {
        scene.run(1500);
        assert_eq!(shared.switch.state(), ArmState::Armed);
        let id = scene.client.urge(Urgent::Stop, scene.now());
        scene.run(2);
        assert_eq!(shared.switch.state(), ArmState::EStopped);
        assert_eq!(scene.ask(id), Answer::Done);
    });
}

/// The largest current of each wheel's command since the last call, as a share of full scale.
fn efforts(scene: &Scene<'_>) -> [f64; 4] {
    let mut largest = [0.0_f64; 4];
    for entry in scene.around.wires[0].take_trace() {
        let id = CanFrame::key_of(StandardId::new(0x200).unwrap());
        if entry.from_controller && entry.frame.key() == id {
            for (lane, largest) in entry.frame.bytes().as_chunks::<2>().0.iter().zip(&mut largest) {
                *largest = largest.max(f64::from(i16::from_be_bytes(*lane)).abs() / 16384.0);
            }
        }
    }
    largest
}

/// A robot that was armed and is disarmed by the PC, and stands.
fn disarmed(scene: &mut Scene<'_>, shared: &Shared<'_>) {
    scene.run(1500);
    // The hands let go: switches as they are where it is armed, sticks in the middle.
    scene.around.operator = None;
    scene.around.remote.as_ref().unwrap().remote.set(Controls::REST);
    let id = scene.client.urge(Urgent::Disarm, scene.now());
    assert_eq!(scene.ask(id), Answer::Done);
    scene.run(2500);
    assert_eq!(shared.switch.state(), ArmState::Disarmed);
    efforts(scene);
}

/// Holds the button of a motor for some milliseconds; the last answer.
fn hold(scene: &mut Scene<'_>, motor: u8, tenths: i16, millis: u64) -> Answer {
    let mut last = Answer::Done;
    for _ in 0..millis / 25 {
        let id = scene.client.act(Action::Jog(motor, tenths));
        scene.run(25);
        last = scene.client.answer(id).expect("an answer within 25 ms");
    }
    last
}

fn refused(answer: Answer, why: &str) {
    let Answer::Refused(told) = answer else { panic!("not refused: {why}") };
    assert!(told.contains(why), "{told}");
}

#[test]
fn a_motor_turns_while_its_button_is_held_and_no_other_one() {
    with_scene(BAUD, |scene, shared| {
        disarmed(scene, shared);
        let rpm = |wheel: usize| shared.motor(BASE.wheels[wheel]).status().feedback.speed.get();
        assert_eq!(hold(scene, 0, 100, 1000), Answer::Done);
        assert!((rpm(0) - 10.0).abs() < 1.5, "{}", rpm(0));
        let efforts_now = efforts(scene);
        assert!(efforts_now[0] > 0.0 && efforts_now[1..].iter().all(|it| *it == 0.0));
        assert_eq!(shared.switch.state(), ArmState::Disarmed);
        // Released: told so, or not told any more.
        let id = scene.client.act(Action::Jog(0, 0));
        assert_eq!(scene.ask(id), Answer::Done);
        scene.run(3);
        efforts(scene);
        scene.run(50);
        assert_eq!(efforts(scene), [0.0; 4]);
        scene.run(200);
        assert_eq!(hold(scene, 0, -100, 500), Answer::Done);
        scene.run(75);
        efforts(scene);
        scene.run(50);
        assert_eq!(efforts(scene), [0.0; 4], "100 ms after the last word of a link that is lost");
    });
}

#[test]
fn what_must_not_turn_is_refused() {
    with_scene(BAUD, |scene, shared| {
        scene.run(1500);
        refused(hold(scene, 0, 50, 25), "disarmed");
        disarmed(scene, shared);
        refused(hold(scene, 0, 201, 25), "faster than the robot's table allows");
        refused(hold(scene, 0, -201, 25), "faster than the robot's table allows");
        // A lift would fall, and a motor that there is not.
        refused(
            hold(scene, u8::try_from(Name::LiftFrontLeft.index()).unwrap(), 10, 25),
            "does not allow",
        );
        refused(hold(scene, 99, 10, 25), "no motor");
        assert_eq!(efforts(scene), [0.0; 4]);
        // A second one, while the first turns.
        assert_eq!(hold(scene, 0, 50, 100), Answer::Done);
        refused(hold(scene, 1, 50, 25), "another motor turns");
        assert_eq!(efforts(scene)[1], 0.0);
        scene.run(200);
        assert_eq!(hold(scene, 1, 50, 100), Answer::Done);
        // A task of the robot commands it: that ends the jog, and the next one is refused.
        shared.command(BASE.wheels[1], Target::Speed(Rpm::new(300.0)));
        refused(hold(scene, 1, 50, 25), "carried out");
        efforts(scene);
        scene.run(60);
        assert_eq!(efforts(scene), [0.0; 4]);
        // A stop.
        scene.run(200);
        assert_eq!(hold(scene, 0, 50, 300), Answer::Done);
        shared.switch.emergency_stop();
        scene.run(2);
        efforts(scene);
        refused(hold(scene, 0, 50, 100), "disarmed");
        assert_eq!(efforts(scene), [0.0; 4]);
    });
}

#[test]
fn arming_ends_a_jog_and_follows_nothing_of_it() {
    with_scene(BAUD, |scene, shared| {
        disarmed(scene, shared);
        assert_eq!(hold(scene, 0, 100, 500), Answer::Done);
        // By hand, at the remote; the button is still held.
        let remote = scene.around.remote.as_ref().unwrap().remote.clone();
        remote.set(Controls { right_switch: Switch::Down, ..Controls::REST });
        assert_eq!(hold(scene, 0, 100, 100), Answer::Done);
        remote.set(Controls::REST);
        refused(hold(scene, 0, 100, 200), "disarmed");
        assert_eq!(shared.switch.state(), ArmState::Armed);
        // What it follows is its task: the sticks are in the middle.
        let status = shared.motor(BASE.wheels[0]).status();
        assert_eq!(
            (status.drive, status.target),
            (DriveMode::Run, Target::Motion(Motion::default()))
        );
    });
}

#[test]
fn on_a_line_that_is_too_slow_each_group_has_its_turn_and_all_is_counted() {
    with_scene(115_200, |scene, _| {
        scene.run(5000);
        assert!(scene.client.is_described());
        let signals: Vec<u16> = scene.client.signals().map(|(index, _)| index).collect();
        for (group, some) in signals.chunks(signals.len().div_ceil(4)).enumerate() {
            let period = [1, 2, 5, 10][group];
            scene.client.watch(group, period, some.iter().copied());
        }
        scene.run(500);
        let (_, before) = (scene.client.take_samples(), scene.client.losses());
        scene.run(2000);
        let samples = scene.client.take_samples();
        let counts =
            [0, 1, 2, 3].map(|group| samples.iter().filter(|it| it.group == group).count());
        let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
        println!("{counts:?}");
        assert!(*least > 10 && most - least <= 2, "{counts:?}");
        // Nothing is lost that is not counted: each is taken or skipped.
        let losses = scene.client.losses();
        let skipped = losses.skipped - before.skipped;
        let taken: usize = counts.iter().sum();
        let due = 2000 + 1000 + 400 + 200;
        assert!((skipped + taken as u64).abs_diff(due) <= 80, "{skipped} + {taken}");
        assert_eq!(losses.samples, 0);
    });
}

/// Changes gains by these factors at a robot that drives, 3 s after its start. What is wrong with it on the
/// page, each with the milliseconds from the change on, and by its record.
fn found(
    factors: &[(&str, &str, f32)],
    seed: u64,
    millis: u64,
) -> (Vec<(u64, String)>, Vec<String>) {
    let ports = Ports::new();
    let shared = Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let kit = Kit::of(&robot);
    let (mut judge, mut page) = (Judge::new(&kit), Vec::new());
    let folder = Scratch::new(&format!("loops-{seed}-{}", factors.len()));
    let path = folder.join("live.mcap");
    with_seed(seed, BAUD, |scene, _| {
        scene.run(1500);
        let (topics, left) = plan(&scene.client);
        assert!(left.is_empty());
        watch(&mut scene.client, &topics, 10);
        let mut record =
            LiveRecord::new(&path, false, &topics, kit.description(), Default::default()).unwrap();
        scene.run(1500);
        let changes: Vec<_> = factors
            .iter()
            .map(|(label, name, factor)| {
                let it = scene.parameter(label, name);
                (it.index, it.value * factor)
            })
            .collect();
        if !changes.is_empty() {
            let id = scene.client.set(&changes).unwrap();
            assert_eq!(scene.ask(id), Answer::Done);
        }
        let changed = scene.now();
        while scene.now().since(changed).get() < millis * 1000 {
            scene.run(10);
            for sample in scene.client.take_samples() {
                judge.take(&topics, &sample).unwrap();
                record.take(&sample).unwrap();
            }
            let is_bad =
                |it: &&rc10_cli::recording::problem::Problem| it.severity == Severity::Problem;
            for problem in judge.found.iter().filter(is_bad) {
                let text = format!("{} {}", problem.about, problem.kind);
                if !page.iter().any(|(_, known)| *known == text) {
                    page.push((scene.now().since(changed).get() / 1000, text));
                }
            }
        }
        record.finish(Ok(())).unwrap();
    });
    let (recording, cut) = replay(&mut std::fs::File::open(&path).unwrap(), robot).unwrap();
    assert_eq!(cut, None);
    let told = problems(&recording).into_iter().filter(|it| it.severity == Severity::Problem);
    (page, told.map(|it| it.to_string()).collect())
}

#[test]
fn a_loop_that_shakes_is_found_on_the_page_and_in_a_record() {
    let label = "gimbal yaw";
    // It is judged once a second; and the script moves it a while later.
    for (gains, within) in [(&["speed_kp"][..], 4000), (&["speed_kp", "angle_kp"], 4000)] {
        let factors: Vec<_> = gains.iter().map(|gain| (label, *gain, 10.0)).collect();
        let (page, record) = found(&factors, 1, 5000);
        println!("{factors:?}: {page:?}, {record:?}");
        let told = page.iter().find(|it| it.1 == format!("{label} oscillation"));
        assert!(told.is_some_and(|it| it.0 < within), "{factors:?}: {page:?}");
        let shakes = format!("{label}: shakes: its effort changes direction");
        assert!(record.iter().any(|text| text.starts_with(&shakes)), "{factors:?}: {record:?}");
        // The others do not.
        assert!(page.iter().all(|(_, text)| text.starts_with(label)), "{page:?}");
    }
}

#[test]
fn a_robot_with_its_own_gains_gives_no_alarm() {
    for seed in 1..=8 {
        assert_eq!(found(&[], seed, 12_000), (vec![], vec![]), "seed {seed}");
    }
}
