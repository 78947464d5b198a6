//! Robots that a beginner writes, each wrong in one thing: it ends with exit code 3 and the sentence that
//! names the cause.

use std::process::Command;

use embassy_time::{Duration as Span, Ticker};
use rc10_app::mechanism::{Braking, Homing, HomingConfig, HomingStatus, Reference};
use rc10_app::{Degrees, Direction, FeedForward, Gravity, Rpm, RpmPerSecond, Seconds, TotalAngle};
use rc10_cli::robot::remote::ScriptLine;
use rc10_cli::{CommandLine, ContactPart, Description, Plant, RemoteControl, Robot};
use rc10_module::remote::Receiver;
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, M3508};
use rc10_motor::embassy::Ports;
use rc10_motor::{ArmState, Entry, MotorBus, Safety, Target};
use rc10_sim::Contact;
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_tasks::{Arming, ArmingConfig, Common};
use rc10_time::Micros;

use super::scratch::Scratch;

/// The weight on its shaft, N m.
const WEIGHT: f32 = 2.0;

/// The arm, with its weight as a beginner gives it: this many times the true one; and its gains.
fn config(weight: f32, gain: f32) -> Config {
    let mut config = Config::new(&M3508, 1);
    config.cascade.speed.kp *= gain;
    let gravity = Gravity::Lift(weight * WEIGHT / config.torque_constant());
    config.with_feed_forward(FeedForward { gravity, ..FeedForward::NONE })
}

rc10_motor::motors! {
    enum Name;
    struct Motors;
    Arm: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
}

rc10_tasks::live! {
    struct Own {
        mechanisms {
            arm: "arm homing";
        }
        signals {
            heading: "heading", "deg";
        }
        parameters {
            speed: "arm speed", "rpm", 10.0, [1.0, 60.0];
        }
    }
}

/// The contact is at 90 degrees and beyond.
const CLOSED: [f64; 2] = [90.0, 180.0];

const HOMING: HomingConfig = HomingConfig {
    reference: Reference::Contact { debounce: Seconds::new(0.02) },
    direction: Direction::Forward,
    fast: Rpm::new(20.0),
    slow: Rpm::new(5.0),
    back_off: Degrees::new(10.0),
    tolerance: Degrees::new(3.0),
    touch_at: TotalAngle::from_degrees(90),
    travel: Degrees::new(150.0),
    braking: Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.03) },
    phase_timeout: Seconds::new(2.0),
    timeout: Seconds::new(4.0),
};

/// The settings of a beginner's robot that may be wrong.
#[derive(Clone, Copy)]
struct Beginner {
    weight: f32,
    closed: [f64; 2],
    homes: bool,
    forgets_to_put_it_back: bool,
    reads_parameter: bool,
    has_heading: bool,
    gain: f32,
    left_y: f32,
    work: Work,
}

#[derive(Clone, Copy, PartialEq)]
enum Work {
    Good,
    ForgetsAwait,
    Blocks,
    Ends,
}

const GOOD: Beginner = Beginner {
    weight: 1.0,
    closed: CLOSED,
    homes: true,
    forgets_to_put_it_back: false,
    reads_parameter: true,
    has_heading: true,
    gain: 1.0,
    left_y: 0.0,
    work: Work::Good,
};

impl Beginner {
    async fn work(self, shared: &Common<'_, Name, Own>, contact: Contact) {
        let mut arming = Arming::new(ArmingConfig::DEFAULT);
        let mut ticker = Ticker::every(Span::from_millis(10));
        let mut homing = Homing::new();
        loop {
            ticker.next().await;
            match self.work {
                #[expect(clippy::let_underscore_future, reason = "that is the mistake")]
                Work::ForgetsAwait => loop {
                    let _ = ticker.next();
                },
                Work::Blocks => {
                    while shared.motor(Name::Arm).status().counters.received < u32::MAX {}
                }
                Work::Ends if shared.switch.state() == ArmState::Armed => return,
                _ => {}
            }
            if self.has_heading {
                shared.own.heading.set(0.0);
            }
            shared.own.arm.tell(homing.stage());
            if shared.obey(&mut arming).is_none() {
                continue;
            }
            let rpm = if self.reads_parameter { shared.own.speed.get() } else { 10.0 };
            let measured = shared.motor(Name::Arm).status().measured();
            if !self.homes {
                shared.command(Name::Arm, Target::TotalAngle(TotalAngle::from_degrees(30)));
                continue;
            }
            // A copy of it, as everything here is `Copy`.
            let mut copy = homing;
            let closed = contact.is_closed();
            let command = copy.update(&HOMING, &measured, closed, Seconds::new(0.01));
            if !self.forgets_to_put_it_back {
                homing = copy;
            }
            if let HomingStatus::Done { zero } = homing.status() {
                let up = TotalAngle::from_degrees(30).plus(zero);
                shared.command(
                    Name::Arm,
                    if rpm > 0.0 { Target::TotalAngle(up) } else { Target::Coast },
                );
            } else {
                shared.command(Name::Arm, command.into());
            }
        }
    }

    /// Exit code and output of `run --strict`.
    fn run(self) -> (u8, String) {
        let hands = |millis, label, controls| ScriptLine {
            at: Micros::from_millis(millis),
            label,
            controls,
        };
        let armed = Controls { left: Stick { x: 0.0, y: self.left_y.into() }, ..Controls::REST };
        let script: &'static [ScriptLine] = Box::leak(Box::new([
            hands(0, "down", Controls { right_switch: Switch::Down, ..armed }),
            hands(100, "arm", armed),
        ]));
        let description = Description {
            remote: Some(RemoteControl::new(Receiver::Dr16, script, None)),
            contacts: vec![ContactPart::new(Name::Arm, self.closed)],
            yaw: Some("heading"),
            ..Description::of(|Name::Arm| Plant {
                load: -f64::from(WEIGHT),
                ..Plant::inertia(0.05)
            })
        };
        let ports = Ports::<Name, 1>::new();
        let shared = Common::<_, Own>::new(&ports);
        let mut motor = Dji::new(config(self.weight, self.gain)).unwrap();
        let mut bus = MotorBus::new(&shared.switch);
        bus.attach(&mut motor, Safety::HOLD).unwrap();
        let robot = Robot::on(description, [bus], [], &shared)
            .parts([0, 1, 0, 0], |mut parts| self.work(&shared, parts.contacts.remove(0)));
        let folder = Scratch::new(std::thread::current().name().unwrap_or("run"));
        let out = folder.to_str().unwrap();
        let line = ["own", "run", "--strict", "--seconds", "4", "--out", out];
        let mut text = Vec::new();
        let code = CommandLine::parse(line).unwrap().run_to(robot, &mut text).unwrap();
        (code, String::from_utf8(text).unwrap())
    }
}

#[test]
fn what_a_beginner_gets_wrong_is_named() {
    let (code, text) = GOOD.run();
    assert_eq!(code, 0, "{text}");
    let mut missed = Vec::new();
    for (beginner, cause) in [
        (
            Beginner { weight: -1.0, homes: false, ..GOOD },
            "arm: its weight takes -1.0 times what its `gravity` says",
        ),
        (
            Beginner { weight: 0.4, homes: false, ..GOOD },
            "arm: its weight takes 2.6 times what its `gravity` says",
        ),
        (
            Beginner { weight: 2.5, homes: false, ..GOOD },
            "arm: its weight takes 0.4 times what its `gravity` says",
        ),
        // Closed everywhere but where it is.
        (
            Beginner { closed: [180.0, 450.0], ..GOOD },
            "s: contact never opened while it backed off: is it inverted",
        ),
        (
            Beginner { closed: [300.0, 310.0], ..GOOD },
            "s: nothing touched on the way to the first touch",
        ),
        (
            Beginner { forgets_to_put_it_back: true, ..GOOD },
            "arm homing: never began, and the robot was armed",
        ),
        (
            Beginner { homes: false, ..GOOD },
            "arm homing: never began, and the robot was armed for 3.",
        ),
        (
            Beginner { has_heading: false, ..GOOD },
            "robot: was armed for 3.9 s without a heading, though it has an IMU",
        ),
        (Beginner { reads_parameter: false, ..GOOD }, "arm speed: no task has read this parameter"),
        (
            Beginner { left_y: -1.0, ..GOOD },
            "robot: was never armed: left stick (up and down) is not at rest",
        ),
        // 16000 of 16384 where 20 A are meant.
        (Beginner { gain: 100.0, ..GOOD }, "arm: the gain margin of its speed loop is 0."),
        (
            Beginner { work: Work::Ends, ..GOOD },
            "beginners::Beginner::work` (added in tests/verdict/beginners.rs:",
        ),
    ] {
        let (code, text) = beginner.run();
        if code != 3 || !text.contains(cause) {
            let found = text.split_once('✗').map_or(&*text, |(_, found)| found);
            missed.push(format!("{cause}: {code}, {found}"));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Not run for itself, but by the test below.
#[test]
#[ignore = "never ends"]
fn forgets_an_await() {
    Beginner { work: Work::ForgetsAwait, ..GOOD }.run();
}

/// The same.
#[test]
#[ignore = "never ends"]
fn blocks() {
    Beginner { work: Work::Blocks, ..GOOD }.run();
}

#[test]
fn a_robot_that_hangs_ends_with_the_name_of_its_task() {
    for name in ["verdict::beginners::forgets_an_await", "verdict::beginners::blocks"] {
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", name, "--ignored", "--nocapture"])
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{name}: {said}");
        let task = "in its task `all::verdict::beginners::Beginner::work` (added in tests/verdict/beginners.rs:";
        assert!(said.contains(task) && said.contains(".await"), "{name}: {said}");
    }
}
