//! A base keeps the referee's limit of power by [`BaseDriver::within`]: its motors and their loops in the simulator, a
//! referee that takes what they draw out of its buffer, and a model that is off by up to 50 %.
//! `RC10_POWER=100 cargo test --test all power:: -- --nocapture` prints the figures of that number of drives.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of a simulation"
)]

use std::cell::Cell;
use std::collections::VecDeque;
use std::f64::consts::PI;
use std::rc::Rc;

use rc10_app::{
    Body, Joules, PowerConfig, PowerModel, Radians, Rpm, Seconds, Twist, TwistLimits, Watts,
};
use rc10_cli::world::environment::Environment;
use rc10_cli::{Base, Description, Plant, Robot, Simulated as _};
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, M3508};
use rc10_motor::embassy::Ports;
use rc10_motor::{Entry, Link, Names};
use rc10_sim::referee::{Referee, Season};
use rc10_sim::{Esc, Nanos, SerialDevice as _};
use rc10_tasks::live::Live;
use rc10_tasks::{BaseDriver, BasePower, Common, Drive, DrivenBase, DrivenSwerve, Limit};
use rc10_time::Micros;

rc10_motor::motors! {
    enum Name;
    struct Motors;
    FrontLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
    RearLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 2)),
    RearRight: Dji = Entry::new(Bus(1), Config::new(&M3508, 3)),
    FrontRight: Dji = Entry::new(Bus(1), Config::new(&M3508, 4)),
}

/// As heavy and as eager as a RoboMaster infantry robot: it takes 400 W if nothing limits it.
const BASE: DrivenBase<Name, 4> = DrivenBase {
    wheels: [Name::FrontLeft, Name::RearLeft, Name::RearRight, Name::FrontRight],
    geometry: rc10_app::Base::omni_4(0.076, 0.25, Rpm::new(420.0)),
    body: Body { mass_kg: 18.0, yaw_inertia_kg_m2: 0.8 },
    torque_constant: Config::new(&M3508, 1).torque_constant(),
    limits: TwistLimits { linear_m_s2: 4.0, angular_rad_s2: 16.0 },
    full_stick: Twist::new(2.5, 2.5, 7.0),
};

/// What the team believes.
const POWER: PowerConfig = PowerConfig {
    model: PowerModel {
        mechanical: 1.0,
        per_speed: 0.22,
        per_torque: 1.2,
        idle: 2.78,
        returned: 0.0,
    },
    uncertainty: 2.2,
    limits: [Watts::new(45.0), Watts::new(120.0)],
    buffer: Joules::new(60.0),
};
const _: () = assert!(POWER.validate().is_ok());

/// What came of a drive.
#[derive(Debug, Default)]
struct Driven {
    /// The lowest energy of the buffer, J.
    lowest: f64,
    /// The highest mean power of 100 ms, and the last one, W.
    highest: f64,
    last: f64,
    /// Speed of the base ahead each 100 ms, m/s.
    speeds: Vec<f64>,
    /// Way of the base, m, with a turn of 1 rad as 0.3 m.
    way: f64,
    /// Pose at the end.
    yaw: f64,
    ahead: f64,
    aside: f64,
    /// The least torque of a motor at the end, by the greatest.
    torques: f64,
    health: u16,
}

/// Numbers of a drive from -1 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    }
}

/// What is wished for, and the limit of the referee, W; `None`: it is silent.
type Wish<'w> = &'w mut dyn FnMut(u64) -> (Twist, Option<u16>);

/// Where a base drives.
#[derive(Clone, Copy, PartialEq)]
enum On {
    Floor,
    /// By the axes of the field, in which its heading is known.
    Field,
    /// Its wheels cannot turn.
    Wall,
}

/// Drives the omni base for some seconds by this driver; `truth` is what the motors take.
fn omni<L: Limit>(
    driver: BaseDriver<'_, DrivenBase<Name, 4>, L>,
    hear: impl Fn(&mut L, Watts, Joules),
    truth: &PowerModel,
    seconds: u64,
    wish: Wish<'_>,
    on: On,
) -> Driven {
    let description = Description {
        base: Some(Base::of(BASE.wheels, &BASE.geometry).with_mass(18.0)),
        ..Description::of(|_: Name| Plant::default())
    };
    let ports = Ports::<Name, 1>::new();
    let shared = Common::<_>::new(&ports);
    let mut motors = Motors::new();
    let around = Environment::new(&description, 1).unwrap();
    let buses = motors.start(&shared.switch).unwrap().buses;
    let robot = Robot::on(description, buses, [], &shared);
    drive(robot, around, &shared, driver, hear, truth, seconds, wish, on)
}

/// The same of the example's swerve base, whose steering counts as others.
fn swerve<L: Limit>(
    driver: BaseDriver<'static, DrivenSwerve<swerve::Name, 4>, L>,
    hear: impl Fn(&mut L, Watts, Joules),
    seed: u64,
) -> Driven {
    let ports = swerve::Ports::new();
    let shared = swerve::Shared::new(&ports);
    let mut motors = swerve::Motors::new();
    let description = Description { remote: None, ..swerve::Robot::description() };
    let around = Environment::new(&description, 1).unwrap();
    let buses = motors.start(&shared.switch).unwrap().buses;
    let robot = Robot::on(description, buses, [], &shared);
    drive(robot, around, &shared, driver, hear, &truth(seed), 20, &mut any(seed), On::Floor)
}

#[expect(clippy::too_many_arguments, reason = "of two robots whose names are other types")]
fn drive<'r, N: Names + 'r, B: Drive<Name = N>, L: Limit + 'r>(
    robot: Robot<'r>,
    mut around: Environment,
    shared: &'r Common<'_, N, impl Live>,
    mut driver: BaseDriver<'r, B, L>,
    hear: impl Fn(&mut L, Watts, Joules) + 'r,
    truth: &PowerModel,
    seconds: u64,
    wish: Wish<'_>,
    on: On,
) -> Driven {
    if on == On::Wall {
        around.motors.iter().for_each(|motor| motor.set_travel(Some([0.0, 0.0])));
    }
    let heading = Rc::new(Cell::new(Radians::new(0.0)));
    let faces = heading.clone();
    let (wished, said) = (Rc::new(Cell::new(Twist::STOP)), Rc::new(Cell::new(None)));
    let (wishes, sayings) = (wished.clone(), said.clone());
    let mut tasks = robot
        .task(async move {
            loop {
                embassy_time::Timer::after_millis(10).await;
                if let Some((limit, buffer)) = sayings.take() {
                    hear(&mut driver.limit, limit, buffer);
                }
                if N::ALL.iter().any(|name| shared.motor(*name).status().link != Link::Online) {
                    continue;
                }
                let _ = shared.switch.arm();
                let (wish, dt) = (wishes.get(), Seconds::new(0.01));
                match on {
                    On::Field => {
                        let wish = Twist::new(wish.vx, wish.vy, wish.wz);
                        driver.drive_in_field(shared, wish, faces.get(), dt);
                    }
                    _ => driver.drive(shared, wish, dt),
                }
            }
        })
        .tasks(&around)
        .unwrap();
    let mut referee = Referee::new(45, Season::June2026);
    let mut driven = Driven { lowest: referee.buffer, ..Driven::default() };
    let (mut drawn, mut sent) = (0.0, VecDeque::new());
    let [mechanical, per_speed, per_torque, idle] =
        [truth.mechanical, truth.per_speed, truth.per_torque, truth.idle].map(f64::from);
    for millis in 1..=1000 * seconds {
        let (twist, limit) = wish(millis);
        wished.set(twist);
        around.run(&mut tasks, Micros::from_millis(millis));
        let one = |motor: &Esc| {
            let (torque, speed) = (motor.state().torque, motor.state().output_rpm * PI / 30.0);
            let power = mechanical * torque * speed + per_torque * torque * torque;
            // No other wheel gets what it gives.
            (power + per_speed * speed.abs()).max(0.0)
        };
        drawn += 1e-3 * (idle + around.motors.iter().map(one).sum::<f64>());
        let base = around.base.as_ref().unwrap();
        heading.set(Radians::new(base.pose().yaw as f32));
        let at = base.twist();
        driven.way += 1e-3 * (at.x.hypot(at.y) + 0.3 * at.yaw.abs());
        if millis % 100 == 0 {
            referee.limit = limit.unwrap_or(referee.limit);
            referee.power = 10.0 * std::mem::take(&mut drawn);
            referee.advance(Nanos::new(millis * 1_000_000), &mut sent);
            driven.highest = driven.highest.max(referee.power);
            driven.last = referee.power;
            driven.speeds.push(at.x);
            driven.lowest = driven.lowest.min(referee.buffer);
            if let Some(limit) = limit {
                let whole = Joules::new(referee.buffer.floor() as f32);
                said.set(Some((Watts::new(limit.into()), whole)));
            }
        }
    }
    let pose = around.base.as_ref().unwrap().pose();
    (driven.yaw, driven.ahead, driven.aside) = (pose.yaw, pose.x, pose.y);
    driven.health = referee.health;
    let torques = around.motors.iter().map(|motor| motor.state().torque.abs());
    driven.torques = torques.clone().fold(f64::INFINITY, f64::min);
    driven.torques /= torques.fold(0.0, f64::max);
    driven
}

/// A driver at random, and a referee whose limit rises with the robot's level, and that is silent at times.
fn any(seed: u64) -> impl FnMut(u64) -> (Twist, Option<u16>) {
    let mut random = Random(seed);
    let (mut until, mut twist, mut limit, mut silent) = (500, Twist::STOP, 45, 0);
    move |millis| {
        if millis >= until {
            until = millis + 250 + (700.0 * random.next().abs()) as u64;
            let [x, y, turn] = [0; 3].map(|_| random.next() as f32);
            // A stick is at its end more often than not.
            twist = Twist::new(3.5 * x, 3.5 * y, 8.0 * turn);
            if random.next() > 0.6 {
                limit = 45 + 5 * (15.0 * random.next().abs()) as u16;
            }
            if random.next() > 0.9 {
                silent = millis + 3000;
            }
        }
        (twist, (millis >= silent).then_some(limit))
    }
}

/// What the motors take in truth.
fn truth(seed: u64) -> PowerModel {
    let mut random = Random(seed ^ 0x5EED);
    let mut off = |number: f32| number * (1.0 + 0.5 * random.next() as f32);
    let PowerModel { mechanical, per_speed, per_torque, idle, returned } = POWER.model;
    PowerModel {
        mechanical: off(mechanical),
        per_speed: off(per_speed),
        per_torque: off(per_torque),
        idle: off(idle),
        returned,
    }
}

fn number_of_drives() -> u64 {
    std::env::var("RC10_POWER").map_or(3, |number| number.parse().unwrap())
}

#[test]
fn the_buffer_keeps_5_j_whatever_is_driven() {
    let (mut lowest, mut ways) = (f64::INFINITY, [0.0; 3]);
    for seed in 0..number_of_drives() {
        let (truth, driver) = (truth(seed), || BaseDriver::new(&BASE));
        let hear = |limit: &mut BasePower<'_>, watts, joules| limit.hear(watts, joules);
        let within = omni(driver().within(&POWER), hear, &truth, 30, &mut any(seed), On::Floor);
        let known = PowerConfig { model: truth, uncertainty: 1.01, ..POWER };
        let knows = omni(driver().within(&known), hear, &truth, 30, &mut any(seed), On::Floor);
        let free = omni(driver(), |(), _, _| {}, &truth, 30, &mut any(seed), On::Floor);
        println!(
            "drive {seed}: lowest {:.1} J, without a limit {:.1}; at most {:.0} W and {:.0}; way {:.1} m, \
             {:.1} with the true model, {:.1} without a limit",
            within.lowest,
            free.lowest,
            within.highest,
            free.highest,
            within.way,
            knows.way,
            free.way
        );
        assert_eq!((within.health, free.lowest), (200, 0.0), "drive {seed} needs a limit");
        lowest = lowest.min(within.lowest);
        for (sum, driven) in ways.iter_mut().zip([within, knows, free]) {
            *sum += driven.way;
        }
    }
    let share = ways[0] / ways[1];
    println!("lowest {lowest:.1} J; {:.1} % of the way with the true model", 100.0 * share);
    assert!(lowest >= 5.0 && share >= 0.97, "{lowest} J, {share}");
    assert!(ways[0] > 0.8 * ways[2], "{ways:?}");
}

#[test]
fn a_swerve_base_keeps_it_too() {
    let mut needed = 0;
    for seed in 0..number_of_drives() {
        let driver = || BaseDriver::new(&swerve::table::BASE);
        let mut limited = driver().within(&POWER);
        limited.limit.others = Watts::new(8.0);
        let hear = |limit: &mut BasePower<'_>, watts, joules| limit.hear(watts, joules);
        let (driven, free) = (swerve(limited, hear, seed), swerve(driver(), |(), _, _| {}, seed));
        println!(
            "drive {seed}: {driven:?}, without a limit {:.1} J, {:.1} m",
            free.lowest, free.way
        );
        assert!(driven.lowest >= 5.0 && driven.way > 0.5 * free.way, "drive {seed}: {driven:?}");
        needed += u32::from(free.lowest < 5.0);
    }
    assert!(needed > 0, "these drives need no limit");
}

#[test]
fn it_keeps_its_direction() {
    // Ahead as fast as it can, at the lowest limit: all four wheels get less, and none less than another.
    let wish = &mut |_| (Twist::new(2.5, 0.0, 0.0), Some(45));
    let hear = |limit: &mut BasePower<'_>, watts, joules| limit.hear(watts, joules);
    let driver = BaseDriver::new(&BASE).within(&POWER);
    let within = omni(driver, hear, &POWER.model, 4, wish, On::Floor);
    println!("{within:?}");
    assert!(within.yaw.abs() < 0.02 && within.aside.abs() < 0.05, "{within:?}");
    assert!(within.way > 8.0 && within.lowest >= 5.0, "{within:?}");
}

#[test]
fn it_slows_down_at_once_when_the_stick_is_let_go() {
    // At the lowest limit it is far slower then than it was told to be.
    let wish = &mut |millis| (Twist::new(if millis < 800 { 2.5 } else { 0.0 }, 0.0, 0.0), Some(45));
    let hear = |limit: &mut BasePower<'_>, watts, joules| limit.hear(watts, joules);
    let power = PowerConfig { buffer: Joules::new(12.0), ..POWER };
    let driver = BaseDriver::new(&BASE).within(&power);
    let within = omni(driver, hear, &POWER.model, 3, wish, On::Floor);
    let [at_release, ahead] = [within.speeds[7], within.speeds[8]];
    println!("{within:?}");
    assert!(at_release > 0.3 && ahead < at_release, "{at_release}, then {ahead}");
    assert!(within.speeds[17].abs() < 0.02, "{within:?}");
}

#[test]
fn a_base_that_spins_goes_where_it_is_sent_in_the_field() {
    let wish = |millis| (Twist::new(if millis < 2500 { 2.5 } else { -2.5 }, 0.0, 4.0), Some(45));
    let hear = |limit: &mut BasePower<'_>, watts, joules| limit.hear(watts, joules);
    let driver = || BaseDriver::new(&BASE);
    let model = &POWER.model;
    let within = omni(driver().within(&POWER), hear, model, 5, &mut { wish }, On::Field);
    let free = omni(driver(), |(), _, _| {}, model, 5, &mut { wish }, On::Field);
    println!("{within:?}\n{free:?}");
    assert!(within.lowest >= 5.0 && free.lowest < 5.0, "{within:?}");
    // It lags behind its heading in any case.
    assert!((within.aside - free.aside).abs() < 0.1 * within.way, "{within:?} {free:?}");
}

#[test]
fn against_a_wall_it_pushes_as_hard_as_it_may_with_every_wheel_to_any_side() {
    for [x, y, turn] in [[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, -6.0]] {
        let wish = &mut |_| (Twist::new(x, y, turn), Some(60));
        let hear = |limit: &mut BasePower<'_>, watts, joules| limit.hear(watts, joules);
        let driver = BaseDriver::new(&BASE).within(&POWER);
        let within = omni(driver, hear, &POWER.model, 8, wish, On::Wall);
        println!("{within:?}");
        assert!(within.lowest >= 5.0 && within.highest > 80.0, "{x} {y} {turn}: {within:?}");
        assert!(within.torques > 0.9, "{x} {y} {turn}: {within:?}");
        // Also when its wheels shall not turn faster any more.
        assert!(within.last > 54.0, "{x} {y} {turn}: {within:?}");
    }
}
