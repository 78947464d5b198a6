//! `firmware/tests/parts`, a robot with something at every kind of port, on both boards and in the simulator.

#[macro_use]
#[path = "../../firmware/tests/parts/src/robot.rs"]
mod robot_of;

use rc10_cli::robot::remote::ScriptLine;
use rc10_cli::run::emulation::Emulation;
use rc10_cli::run::simulate::simulate;
use rc10_cli::{ContactPart, Description, Plant, RemoteControl, Robot, VoltagePart};
use rc10_emu::Board;
use rc10_motor::{Names, Started};
use rc10_sim::remote::{Controls, Switch};
use rc10_sim::{Contact, Esc, Nanos, SerialConfig, Servo, Voltage};
use rc10_tasks::status;

use super::wires::Echo;
use super::{log, millis, program, setup_on};

/// The chip's divider, and what is measured, volts: a step every quarter of the first motor's turn.
const DIVIDER: f64 = 11.0;
fn volts(motors: &[Esc], _: Option<&rc10_sim::Base>) -> f64 {
    7.2 + 5.0 * quarter(&motors[0])
}

fn quarter(motor: &Esc) -> f64 {
    (motor.state().load_degrees.rem_euclid(360.0) / 90.0).floor()
}

/// Where the first switch is closed; the third one is on the other motor, and the eighth nearly always closed. The others
/// are not read.
const FIRST: [f64; 2] = [10.0, 190.0];
const THIRD: [f64; 2] = [-200.0, -50.0];
const EIGHTH: [f64; 2] = [1.0, 359.0];

const SCRIPT: [ScriptLine; 3] = [
    at(0, "disarmed", Controls { right_switch: Switch::Down, ..Controls::REST }),
    at(300, "armed", Controls::REST),
    at(2000, "disarmed", Controls { right_switch: Switch::Down, ..Controls::REST }),
];
/// The script's times in the world, with what a receiver, its failsafe and arming take.
const ARMS: Nanos = millis(300);
const IS_ARMED: Nanos = millis(450);
const DISARMS: Nanos = millis(2_000);
const END: Nanos = millis(2_200);

const fn at(millis: u64, label: &'static str, controls: Controls) -> ScriptLine {
    ScriptLine { at: rc10_time::Micros::from_millis(millis), label, controls }
}

fn description<N: Names>(names: [N; 2], voltages: usize) -> Description {
    let contact = |index| match index {
        2 => ContactPart::new(names[1], THIRD),
        7 => ContactPart::new(names[0], EIGHTH),
        _ => ContactPart::new(names[0], FIRST),
    };
    let nothing = VoltagePart { divider: 1.0, volts: |_, _| 0.0 };
    let mut voltages = vec![nothing; voltages];
    *voltages.last_mut().unwrap() = VoltagePart { divider: DIVIDER, volts };
    Description {
        remote: Some(RemoteControl::new(rc10_cli::Receiver::Ppm, &SCRIPT, None)),
        contacts: (0..8).map(contact).collect(),
        voltages,
        servos: vec!["holds", "lets go"],
        ..Description::of(|_: N| Plant::inertia(0.01))
    }
}

/// The robot with as many lines as a board has.
macro_rules! on {
    ($board:ident, $lines:literal, $second:expr, $voltages:literal) => {
        mod $board {
            use super::*;

            robot!($lines, $second);

            pub fn with<T>(then: impl FnOnce(Robot<'_>) -> T) -> T {
                let ports = Ports::new();
                let (shared, mut motors) = (Shared::new(&ports), Motors::new());
                let Started { buses, lines } = motors.start(&shared.switch).unwrap();
                let lines = lines.map(|line| line.with_reply_timeout(REPLY).unwrap());
                let description = description([Name::First, Name::Second], $voltages);
                let robot = Robot::of(description, Started { buses, lines }, &shared);
                let robot = robot.pins(
                    |[a, _, c, .., h]: [Contact; 8],
                     voltages: [Voltage; $voltages],
                     servos: [Servo; 2]| {
                        let mut voltage = voltages[$voltages - 1].clone();
                        work(&shared, [a, c, h], async move || voltage.read().await, servos)
                    },
                );
                then(robot.task(status::run(&shared)))
            }
        }
    };
}

on!(h723zg, 1, Line(1), 4);
on!(dm_mc02, 2, Line(2), 1);

/// The pulse that the robot is to make of what is around it, µs.
fn wanted(emulation: &Emulation<'_>) -> f64 {
    let [first, second] = [0, 1].map(|motor| emulation.motors[motor].state().load_degrees);
    let closed = |[from, to]: [f64; 2], angle: f64| (angle - from).rem_euclid(360.0) < to - from;
    let switches = [(FIRST, first, 20.0), (THIRD, second, 10.0), (EIGHTH, first, 5.0)];
    let switches =
        switches.map(|(range, angle, degrees)| if closed(range, angle) { degrees } else { 0.0 });
    1000.0 + 10.0 * (volts(&emulation.motors, None) + switches.iter().sum::<f64>())
}

fn serves_every_port(board: Board, file: &str, uarts: &[(u8, u32)], robot: Robot<'_>) {
    let mut emulation = Emulation::new(&program(file), robot, &setup_on(board, &[])).unwrap();
    for &(uart, baud) in uarts {
        let config = SerialConfig { baud, ..SerialConfig::default() };
        let link = emulation.rig.world.add_serial(config, Echo::default());
        emulation.rig.machine.connect_serial(uart, &link, false).unwrap();
    }
    for (port, pin) in board.servos {
        emulation.rig.machine.watch_pin(port, pin).unwrap();
    }
    let mut pulses = Vec::new();
    // What is wanted, and since when it is.
    let (mut steady, mut judged) = ((0.0, Nanos::ZERO), 0);
    while emulation.rig.machine.now() < END {
        let now = emulation.rig.machine.now() + millis(1);
        emulation.run(now).unwrap();
        let is = [0, 1].map(|servo: usize| emulation.servos[servo].pulse());
        let wanted = wanted(&emulation);
        if wanted != steady.0 {
            steady = (wanted, now);
        }
        if now < ARMS {
            assert_eq!(is, [None; 2], "before it is armed, at {now}");
        } else if now > IS_ARMED && now < DISARMS && now.since(steady.1) > millis(45) {
            // The task's period, and two pulses.
            for pulse in is {
                let pulse = pulse.unwrap_or(0.0);
                assert!((pulse - wanted).abs() <= 1.01, "{pulse} us, not {wanted}, at {now}");
            }
            judged += 1;
            pulses.push(wanted as u32);
        }
    }
    pulses.dedup();
    println!("{file}: pulses of {pulses:?} us, {judged} ms judged");
    assert!(pulses.len() > 6 && judged > 300, "{pulses:?}");
    // Disarmed, one holds, the other one lets go.
    let [holds, lets_go] = [0, 1].map(|servo: usize| emulation.servos[servo].pulse());
    assert!(holds.is_some() && lets_go.is_none(), "{holds:?} {lets_go:?}");
    let [first, .., fourth] =
        board.servos.map(|(port, pin)| emulation.rig.machine.take_pin_time(port, pin).unwrap());
    assert!(first.rises > 80 && fourth.rises == 0, "{first:?} {fourth:?}");
    let (port, pin) = board.servos[3];
    assert_eq!(emulation.rig.machine.soc().pin_output(port, pin), Some(false));
    let turned = [0, 1].map(|motor| emulation.motors[motor].state().load_degrees);
    // 60 rpm for 1.6 s.
    assert!(turned[0] > 480.0 && turned[1] < -480.0, "{turned:?}");
    let log = log(&mut emulation);
    assert_eq!(log.matches("100 bytes, back: true").count(), uarts.len(), "{log}");
    assert!(log.contains(" armed, 2 of 2 motors online"), "{log}");
    assert_eq!(log.contains("24.0 V"), board.supply_sense.is_some(), "{log}");
    let reports = &emulation.rig.machine.reports;
    assert!(reports.is_empty() && emulation.rig.machine.restarts.is_empty(), "{reports:?}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn every_port_of_the_h723zg_is_served() {
    let uarts = [(3, 9_600), (7, 115_200), (10, 921_600)];
    h723zg::with(|robot| serves_every_port(Board::H723ZG, "parts", &uarts, robot));
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn every_port_of_the_dm_mc02_is_served_and_two_lines() {
    let uarts = [(7, 115_200), (10, 921_600)];
    dm_mc02::with(|robot| serves_every_port(Board::DM_MC02, "parts-dm-mc02", &uarts, robot));
}

/// Simulated, its servos' pulses are signals of the run.
#[test]
fn its_ports_are_there_in_simulation() {
    let recording = dm_mc02::with(|robot| simulate(robot, 1, END.micros()).unwrap());
    let of = |label| recording.signals.iter().find(|signal| signal.label == label).unwrap();
    let (holds, lets_go) = (of("holds"), of("lets go"));
    assert!(holds.last.is_some() && lets_go.last.is_none());
    let [least, _, most] = holds.range.unwrap();
    // No switch but the one that is nearly always closed, and all of them.
    assert!(
        (1072.0..=1122.0).contains(&least) && (1400.0..=1572.0).contains(&most),
        "{least} {most}"
    );
    assert_eq!(holds.unit, "us");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn more_parts_than_the_board_has_ports_are_refused() {
    h723zg::with(|robot| {
        let error = Emulation::new(&program("parts"), robot, &setup_on(Board::DM_MC02, &[]));
        let words = "dm-mc02 has 1 inputs for voltages, the robot 4 voltages";
        assert_eq!(error.err().unwrap().to_string(), words);
    });
}
