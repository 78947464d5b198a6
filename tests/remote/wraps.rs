//! Two weeks without a power cycle: at each moment at which a counter of time begins again two robots do
//! what they do behind power-on, bit for bit.

use rc10_cli::Simulated as _;
use std::cell::Cell;
use std::collections::BTreeSet;

use embassy_time::{Duration, Ticker};
use mixed::task::SCRIPT;
use rc10_app::Rpm;
use rc10_can::CanFrame;
use rc10_cli::Robot;
use rc10_motor::embassy::MotorPort;
use rc10_motor::{DriveMode, Link, MotorStatus, Names, Request};
use rc10_sim::{Esc, EscState};
use rc10_tasks::{Arming, status};

use super::*;

const WEEKS: u64 = 14 * 86_400_000_000;

/// The first two moments, and the last one within two weeks, at which counters begin again: of 31 and 32
/// bits of microseconds, and of 16, 24, 30 and 31 bits of milliseconds; and the end.
fn wraps() -> BTreeSet<u64> {
    let steps = [1 << 31, 1 << 32, 1000 << 16, 1000 << 24, 1000 << 30, 1000 << 31];
    let wraps = steps.into_iter().flat_map(|step| [1, 2, WEEKS / step].map(|times| times * step));
    wraps.filter(|at| (1..=WEEKS).contains(at)).chain([WEEKS]).collect()
}

/// What hands do, at each millisecond: a motor is jogged up to 200, and one is without power from 450 to 600.
const ACTS: [(u64, &str); 8] = [
    (0, "switch down"),
    (300, "arm"),
    (380, "drive"),
    (450, "power off"),
    (600, "power on"),
    (700, "remote off"),
    (900, "remote on"),
    (1050, "commands end"),
];
const END: u64 = 1200;
/// Wraps fall into a jog, a drive, between the last frame of the remote and the coasting, and between the
/// last command and its expiry.
const OFFSETS: [u64; 4] = [150, 500, 760, 1075];

/// What a robot did in 10 ms, without the time of its start: frames of each bus with their end, what its
/// shafts really do, and what its motors tell.
#[derive(PartialEq)]
struct Look {
    frames: Vec<Vec<(Nanos, CanFrame)>>,
    twins: Vec<EscState>,
    motors: Vec<MotorStatus>,
}

/// What it does from its start on. It is commanded as long as it is told to.
fn life(
    mut around: Environment,
    mut tasks: Tasks<'_>,
    commands: &Cell<bool>,
    motors: &[MotorPort<'_>],
) -> Vec<Look> {
    around.operator = None;
    let start = around.world.now();
    let hands = around.remote.as_ref().unwrap().remote.clone();
    let mut acts = ACTS.into_iter().peekable();
    let look = |at: u64| {
        while let Some((_, act)) = acts.next_if(|it| it.0 <= at) {
            match act {
                "switch down" => hands.set(DOWN),
                "arm" => hands.set(Controls::REST),
                "drive" => hands.set(DRIVE),
                "power off" | "power on" => around.motors[1].set_power(act == "power on"),
                "remote off" | "remote on" => hands.set_transmitter(act == "remote on"),
                _ => commands.set(false),
            }
        }
        around.run(&mut tasks, start + millis(at + 10));
        let frame = |it: TraceEntry| (it.end.since(start.into()), it.frame);
        let frames = around.wires.iter().map(|it| it.take_trace().into_iter().map(frame).collect());
        let twin = |it: &Esc| EscState { last_command_at: None, ..it.state() };
        let told = |port: &MotorPort<'_>| {
            let mut status = port.status();
            status.feedback.at = Micros::new(status.feedback.at.get().wrapping_sub(start.get()));
            status
        };
        let twins = around.motors.iter().map(twin).collect();
        Look { frames: frames.collect(), twins, motors: motors.iter().map(told).collect() }
    };
    (0..END).step_by(10).map(look).collect()
}

/// Jogs a motor, again every 40 ms, as a PC does.
async fn jog(motor: MotorPort<'_>) {
    let mut ticker = Ticker::every(Duration::from_millis(40));
    for _ in 0..5 {
        ticker.next().await;
        let _ = motor.request(Request::Jog(Rpm::new(200.0))).await;
    }
}

/// The life of the team's robot.
fn team(start: Micros) -> Vec<Look> {
    let ports = team::Ports::new();
    let shared = &Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(shared, &mut motors).unwrap();
    let robot = robot.task(jog(shared.motor(Name::WheelFrontLeft)));
    let around = Environment::starting_at(start, robot.description(), 3).unwrap();
    let tasks = robot.tasks(&around).unwrap();
    let motors: Vec<_> = Name::ALL.iter().map(|name| shared.motor(*name)).collect();
    life(around, tasks, &Cell::new(true), &motors)
}

/// The life of the robot of many vendors, with a task of its own: its script begins at power-on.
fn vendors(start: Micros) -> Vec<Look> {
    let ports = mixed::Ports::new();
    let (shared, mut motors) = (&mixed::Shared::new(&ports), mixed::Motors::new());
    let commands = Cell::new(true);
    let task = async {
        let mut arming = Arming::of::<mixed::Robot>();
        let mut ticker = Ticker::every(Duration::from_millis(10));
        loop {
            ticker.next().await;
            if shared.obey(&mut arming).is_some() && commands.get() {
                for (name, target) in SCRIPT[..3].iter().flat_map(|(_, _, targets)| *targets) {
                    shared.command(*name, *target);
                }
            }
        }
    };
    let rc10_motor::Started { buses, lines } = motors.start(&shared.switch).unwrap();
    let robot = Robot::on(mixed::Robot::description(), buses, lines, shared);
    let robot = robot.task(jog(shared.motor(mixed::Name::Wheel)));
    let robot = robot.task(task).task(status::run(shared));
    let around = Environment::starting_at(start, robot.description(), 3).unwrap();
    let tasks = robot.tasks(&around).unwrap();
    let motors: Vec<_> = mixed::Name::ALL.iter().map(|name| shared.motor(*name)).collect();
    life(around, tasks, &commands, &motors)
}

fn lives_at_every_wrap(live: impl Fn(Micros) -> Vec<Look>, expires: bool) {
    let first = live(Micros::ZERO);
    let at = |millis: usize| &first[millis / 10 - 1].motors;
    let runs = |millis| at(millis).iter().filter(|it| it.drive == DriveMode::Run).count();
    let all = at(10).len();
    // Jogged, let go, driven with one of them lost and back, without the remote, and with it again.
    let last = if expires { 0 } else { all };
    assert_eq!([200, 290, 450, 700, 830, 1050, 1140].map(runs), [1, 0, all, all, 0, all, last]);
    assert!(at(200)[0].feedback.speed.get() > 10.0 && at(690)[0].feedback.speed.get() > 100.0);
    for (number, status) in at(1190).iter().enumerate() {
        let counters = status.counters;
        let told = (status.link, counters.lost, counters.malformed, counters.expired > 0);
        assert_eq!(told, (Link::Online, u32::from(number == 1), 0, expires));
    }
    for at in wraps() {
        for offset in OFFSETS {
            // Tasks and ticks keep to multiples of 10 ms.
            let start = Micros::from_millis((at / 1000 - offset) / 10 * 10);
            for (number, (now, then)) in live(start).iter().zip(&first).enumerate() {
                let (millis, told) = (10 * number, &now.motors);
                assert!(now == then, "from {start} on, {millis} ms: {told:?}");
            }
        }
    }
}

#[test]
fn the_team_s_robot_does_at_every_wrap_what_it_does_behind_power_on() {
    lives_at_every_wrap(team, false);
}

#[test]
fn motors_of_every_vendor_do_at_every_wrap_what_they_do_behind_power_on() {
    lives_at_every_wrap(vendors, true);
}
