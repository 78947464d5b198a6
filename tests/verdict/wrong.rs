//! Wrong robots: each is refused, or ends with exit code 3 and the sentence that names the cause.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use embassy_time::Timer;
use rc10_app::{NewtonMetres, Rpm};
use rc10_cli::{CommandLine, Description, Motor, Place, Plant, Robot};
use rc10_motor::dji::{self, Dji, FeedbackRate, M3508};
use rc10_motor::embassy::BusPort;
use rc10_motor::{ArmSwitch, MotorBus, Safety, Target};
use serde_json::Value;

use super::scratch::Scratch;

const LABELS: [&str; 8] =
    ["wheel a", "wheel b", "wheel c", "wheel d", "arm a", "arm b", "arm c", "arm d"];

/// A robot of one's own: M3508 on one bus, and a task that gives all of them a target every 10 ms.
struct Own {
    motors: u8,
    rate: FeedbackRate,
    arms: bool,
    /// `None`: no command.
    target: fn(usize) -> Option<Target>,
}

const SOUND: Own = Own {
    motors: 2,
    rate: FeedbackRate::Hz1000,
    arms: true,
    target: |_| Some(Target::Speed(Rpm::new(60.0))),
};

/// The same folder for all runs of one test, each of which has a thread of its own.
fn folder() -> PathBuf {
    thread_local! {
        static FOLDER: Scratch = {
            let thread = std::thread::current();
            Scratch::new(&thread.name().unwrap().replace("::", "_"))
        };
    }
    FOLDER.with(|folder| folder.to_path_buf())
}

impl Own {
    /// Exit code and output of `run`, or what it says before it ends with exit code 2.
    fn end(&self, arguments: &[&str]) -> Result<(u8, String), String> {
        let folder = folder();
        let out = ["--out", folder.to_str().unwrap()];
        self.command(&[&["run", "--seconds", "1.5"][..], &out, arguments].concat())
    }

    /// The same of any command.
    fn command(&self, arguments: &[&str]) -> Result<(u8, String), String> {
        let (switch, port) = (ArmSwitch::new(), BusPort::new());
        let mut motors: Vec<Dji> = (1..=self.motors)
            .map(|id| Dji::new(dji::Config::new(&M3508, id).with_feedback_rate(self.rate)).unwrap())
            .collect();
        let mut bus = MotorBus::new(&switch);
        for motor in &mut motors {
            bus.attach(motor, Safety::COAST).unwrap();
        }
        let described = (1..).zip(LABELS).take(self.motors.into()).map(|(id, label)| {
            let config = dji::Config::new(&M3508, id).with_feedback_rate(self.rate);
            let plant = Plant::inertia(0.029);
            Motor { plant, ..Motor::new(label, Place::Bus(1), config.device()) }
        });
        let motors = described.collect();
        let task = async {
            Timer::after_millis(10).await;
            if self.arms {
                // Refused if the bus does not fit.
                let _ = switch.arm();
            }
            loop {
                for (motor, id) in rc10_motor::numbers([rc10_motor::Place::Bus(1); 8])
                    .take(self.motors.into())
                    .enumerate()
                {
                    if let Some(target) = (self.target)(motor) {
                        let _ = port.motor(id).command(target);
                    }
                }
                Timer::after_millis(10).await;
            }
        };
        let description = Description { motors, buses: 1, ..Description::default() };
        let robot = Robot::new(description).bus(bus, &port).switch(&switch).task(task);
        let line = CommandLine::parse([&["own"][..], arguments].concat()).unwrap();
        let mut text = Vec::new();
        match line.run_to(robot, &mut text) {
            Ok(code) => Ok((code, String::from_utf8(text).unwrap())),
            Err(error) => Err(format!("{error:#}")),
        }
    }
}

#[test]
fn a_sound_robot_has_no_problem() {
    let (code, text) = SOUND.end(&["--strict"]).unwrap();
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("✓ All 2 motors online · no frame lost · no overruns"), "{text}");
}

/// The sentence of `docs/verdict.md` about a bus that is too full.
#[test]
fn a_bus_that_is_too_full_is_refused_with_names_numbers_and_a_way_out() {
    let full = Own { motors: 8, ..SOUND };
    let refused = full.end(&[]).unwrap_err();
    let page = fs::read_to_string("docs/verdict.md").unwrap();
    let sentence = "10000 frames/s: 111 % of the bus without stuff bits, 118 % typically, 135 % at \
                    worst: does NOT fit";
    assert!(page.contains(sentence));
    let labels = LABELS.map(|label| format!("{label} (M3508 id "));
    for words in labels.iter().map(String::as_str).chain([
        &format!("bus 1: {sentence}")[..],
        "1000 feedback frames/s each: ",
        "500 Hz",
        "another bus",
        "--force",
    ]) {
        assert!(refused.contains(words), "{words}: {refused}");
    }
    // Whichever command: before a file is opened, or anything moves.
    let file = folder().join("report.html");
    let _ = fs::remove_file(&file);
    assert_eq!(full.end(&["--json"]).unwrap_err(), refused);
    assert!(!file.exists());
    assert_eq!(full.command(&["emu", "no/such.elf"]).unwrap_err(), refused);
    let missing = full.command(&["emu", "no/such.elf", "--force"]).unwrap_err();
    assert!(missing.contains("cannot read no/such.elf"), "{missing}");
    if cfg!(unix) {
        let pty = ["pty", "--bus", "1", "--seconds", "0.01"];
        assert_eq!(full.command(&pty).unwrap_err(), refused);
        assert!(full.command(&[&pty[..], &["--force"]].concat()).is_ok());
    }
    // All the same: then it is a problem.
    let (code, text) = full.end(&["--force"]).unwrap();
    assert!(code == 0 && text.contains(&format!("bus 1: {sentence}")), "{text}");
    assert_eq!(full.end(&["--force", "--strict"]).unwrap().0, 3);
    let half = Own { motors: 8, rate: FeedbackRate::Hz500, ..SOUND };
    let (code, text) = half.end(&["--strict"]).unwrap();
    assert_eq!(code, 0, "{text}");
}

#[test]
fn a_tight_bus_is_information() {
    let tight = Own { motors: 6, ..SOUND };
    let (_, text) = tight.end(&[]).unwrap();
    let (_, information) = text.split_once("Good to know").unwrap();
    assert!(information.contains("bus 1: 8000 frames/s: 89 % of the bus"), "{text}");
    assert!(information.contains("tight, fits typically"), "{text}");
}

#[test]
fn wrong_programs_end_with_3_and_the_cause() {
    const NOT_A_NUMBER: &str = "targets refused: not a number (infinite or NaN)";
    for (robot, about, kind, cause) in [
        (
            Own { target: |_| Some(Target::Speed(Rpm::new(f32::NAN))), ..SOUND },
            "wheel a",
            "refused",
            NOT_A_NUMBER,
        ),
        (
            Own { target: |_| Some(Target::Torque(NewtonMetres::new(1.0))), ..SOUND },
            "wheel b",
            "refused",
            "targets refused: of a kind that it does not take",
        ),
        (
            Own { target: |motor| (motor == 0).then_some(Target::Speed(Rpm::new(60.0))), ..SOUND },
            "wheel b",
            "never-commanded",
            "never got a target, and the robot was armed for 1.5 s",
        ),
        (
            Own { arms: false, ..SOUND },
            "robot",
            "never-armed",
            "was never armed: no motor was driven: does a task obey the remote, at least every 20 ms?",
        ),
        (
            Own { target: |_| Some(Target::Speed(Rpm::new(2000.0))), ..SOUND },
            "wheel a",
            "saturation",
            "its effort stands at its limit of 20 A",
        ),
    ] {
        let (code, json) = robot.end(&["--strict", "--json"]).unwrap();
        assert_eq!(code, 3, "{cause}");
        let figures: Value = serde_json::from_str(&json).unwrap();
        let problems = figures["problems"].as_array().unwrap();
        let is_it = |problem: &&Value| problem["about"] == about && problem["kind"] == kind;
        let problem = problems.iter().find(is_it).unwrap_or_else(|| panic!("{problems:?}"));
        assert!(problem["text"].as_str().unwrap().contains(cause), "{problem}");
        assert_eq!(problem["severity"], "problem");
        // The console and the report say the same.
        let sentence = format!("{about}: {}", problem["text"].as_str().unwrap());
        let (code, text) = robot.end(&[]).unwrap();
        assert!(code == 0 && text.contains(&sentence), "{text}");
        let report = fs::read_to_string(folder().join("report.html")).unwrap();
        assert!(report.contains(&sentence), "{sentence}");
    }
}

#[test]
fn the_shipped_robots_are_strictly_sound() {
    for robot in ["team", "mixed"] {
        let folder = Scratch::new(&format!("strict_{robot}"));
        let arguments = ["run", "--strict", "--out", folder.to_str().unwrap()];
        let (code, text) = if robot == "mixed" {
            super::common_mixed::mixed(&arguments)
        } else {
            let output = Command::new(env!("CARGO_BIN_EXE_rc10")).args(arguments).output().unwrap();
            (output.status.code(), String::from_utf8(output.stdout).unwrap())
        };
        assert_eq!(code, Some(0), "{text}");
        assert!(text.contains("motors online · no frame lost · no overruns"), "{text}");
    }
}
