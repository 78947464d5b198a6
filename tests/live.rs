//! A PC at the robot's console, in virtual time: what it is told, what it changes, what it loses.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use rc10_can::Micros;
use rc10_cli::environment::Environment;
use rc10_cli::live::{Answer, Client, Sample};
use rc10_cli::team;
use rc10_motor::{ArmState, Names};
use rc10_robot::table::Name;
use rc10_robot::{Motors, Ports, Shared};
use rc10_sim::Tasks;

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

fn with_scene(baud: u32, test: impl FnOnce(&mut Scene<'_>, &Shared<'_>)) {
    let ports = Ports::new();
    let shared = Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = team::robot(&shared, motors.start(&shared.switch).unwrap().buses);
    let around = Environment::new(robot.description(), 1).unwrap().with_console(baud);
    let tasks = robot.tasks(&around).unwrap();
    test(&mut Scene { around, tasks, client: Client::new() }, &shared);
}

#[test]
fn a_robot_describes_itself_and_shows_what_it_does() {
    with_scene(BAUD, |scene, shared| {
        scene.run(400);
        assert!(scene.client.is_up(scene.now()) && scene.client.is_described());
        let motors = Name::ALL.len();
        let of_motors = scene.client.signals().filter(|(_, it)| it.folder == "motors");
        assert_eq!(of_motors.count() % motors, 0);
        assert_eq!(scene.client.parameters().count(), 7 * motors - 1);
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
        let id = scene.client.act(rc10_cli::live::Action::Stop);
        scene.run(2);
        assert_eq!(shared.switch.state(), ArmState::EStopped);
        assert_eq!(scene.ask(id), Answer::Done);
    });
}
