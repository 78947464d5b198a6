//! Robots on a swerve and a differential base, from their tables to the verdict.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::cell::Cell;

use embassy_time::Timer;
use rc10_cli::recording::Recording;
use rc10_cli::recording::problem::Severity;
use rc10_cli::recording::sample::PathPoint;
use rc10_cli::run::simulate::simulate;
use rc10_cli::show::figures::{Figures, to_json};
use rc10_cli::{Base, Description, Plant, Robot};
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, M2006, M3508};
use rc10_motor::embassy::Ports;
use rc10_motor::rc10_app::{Direction, Rpm, TotalAngle};
use rc10_motor::{ArmSwitch, Entry, Names, Started, Target};
use rc10_sim::{Chassis, Steering};
use rc10_time::Micros;

const RADIUS: f64 = 0.076;

mod swerve {
    use super::*;
    rc10_motor::motors! {
        pub enum Name;
        pub struct Motors;
        buses: [100.0, 100.0];
        DriveFrontLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
        DriveFrontRight: Dji = Entry::new(Bus(1),
            Config::new(&M3508, 2).with_direction(Direction::Reversed),
        ),
        DriveRearLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 3)),
        DriveRearRight: Dji = Entry::new(Bus(1), Config::new(&M3508, 4)),
        SteerFrontLeft: Dji = Entry::new(Bus(2), Config::new(&M2006, 1)),
        SteerFrontRight: Dji = Entry::new(Bus(2),
            Config::new(&M2006, 2).with_direction(Direction::Reversed),
        ),
        SteerRearLeft: Dji = Entry::new(Bus(2), Config::new(&M2006, 3)),
        SteerRearRight: Dji = Entry::new(Bus(2), Config::new(&M2006, 4)),
    }
}

mod differential {
    use super::*;
    rc10_motor::motors! {
        pub enum Name;
        pub struct Motors;
        Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
        Right: Dji = Entry::new(Bus(1),
            Config::new(&M3508, 2).with_direction(Direction::Reversed),
        ),
    }
}

fn problems(recording: &Recording) -> String {
    let figures = Figures::of(recording);
    let lines = figures.found(Severity::Problem).map(ToString::to_string);
    lines.collect::<Vec<_>>().join("\n")
}

/// Ahead for a second, wheels turned to the left, to the left for a second. The gear to the wheels is
/// two to one.
fn swerve(mistake: Option<&str>) -> Recording {
    use swerve::{Motors, Name};
    let (switch, ports) = (ArmSwitch::new(), Ports::<Name, 2>::new());
    let mut motors = Motors::new();
    let (drives, steers) = Name::ALL.split_at(4);
    let steering = Steering { gear: 2.0, ..Steering::default() };
    let chassis = Chassis::swerve(RADIUS, 0.2, 0.15, steering);
    let base = Base::new(drives.iter().copied(), chassis).with_mass(25.0);
    let base = base.with_steering(steers.iter().copied());
    let description =
        Description { base: Some(base), ..Description::of(|_: Name| Plant::default()) };
    let task = async {
        Timer::after_millis(100).await;
        let _ = switch.arm();
        let zero: Vec<TotalAngle> =
            steers.iter().map(|name| ports.motor(*name).status().feedback.total_angle).collect();
        for millis in (0_u32..).step_by(10) {
            let (rpm, turned) = match millis {
                0..1000 => (100.0, 0),
                1000..1700 => (0.0, 90_000_000),
                1700..2700 => (100.0, 90_000_000),
                _ => (0.0, 90_000_000_i64),
            };
            for drive in drives {
                let _ = ports.motor(*drive).command(Target::Speed(Rpm::new(rpm)));
            }
            for (steer, zero) in steers.iter().zip(&zero) {
                let shaft = zero.microdegrees() + 2 * turned;
                let _ = ports
                    .motor(*steer)
                    .command(Target::TotalAngle(TotalAngle::from_microdegrees(shaft)));
            }
            Timer::after_millis(10).await;
        }
    };
    let Started { buses: [first, second], .. } = motors.start(&switch).unwrap();
    let mut robot = Robot::new(description)
        .switch(&switch)
        .bus(first, &ports.buses[0])
        .bus(second, &ports.buses[1])
        .task(task);
    robot.set_mistakes(&mistake.iter().map(|it| it.parse().unwrap()).collect::<Vec<_>>()).unwrap();
    simulate(robot, 3, Micros::from_millis(3500)).unwrap()
}

#[test]
fn a_swerve_base_goes_ahead_and_to_the_left_and_its_wheels_know_it() {
    let run = swerve(None);
    assert_eq!(problems(&run), "");
    let base = run.base.as_ref().unwrap();
    let at = |path: &[PathPoint], millis: usize| path[millis / 10 - 1];
    // 100 rpm · 76 mm: 0.796 m/s, less the time to get there and to stop.
    let corner = at(&base.path, 1700);
    assert!((corner.x - 0.75).abs() < 0.08 && corner.y.abs() < 0.01, "{corner:?}");
    let end = at(&base.path, 3500);
    assert!((end.y - 0.75).abs() < 0.08 && (end.x - corner.x).abs() < 0.03, "{end:?}");
    assert!(end.yaw.abs() < 0.02, "{end:?}");
    let by_wheels = base.by_wheels();
    for millis in [1700, 3500] {
        let (path, wheels) = (at(&base.path, millis), at(&by_wheels, millis));
        let apart = (path.x - wheels.x).hypot(path.y - wheels.y);
        assert!(apart < 0.02, "at {millis} ms: {path:?}, by the wheels {wheels:?}");
    }
    let steered = base.heard.last().unwrap().wheels[1].steered;
    assert!((steered - 90.0).abs() < 2.0, "{steered}");
}

#[test]
fn mistakes_in_a_swerve_base_are_seen() {
    for mistake in ["direction:drive-rear-left", "direction:drive-front-right"] {
        let found = problems(&swerve(Some(mistake)));
        assert!(found.contains("the base does not do what its wheels say"), "{mistake}: {found}");
    }
    // Twice as far, and the wheels do not know.
    let end = |mistake| swerve(mistake).base.unwrap().path.last().unwrap().y;
    let (plain, twice) = (end(None), end(Some("radius:x2")));
    assert!((twice / plain - 2.0).abs() < 0.1, "{twice} {plain}");
}

/// It turns on the spot, and says of its pose what its wheels do; its track is wrong by a tenth.
#[test]
fn a_differential_base_s_own_odometry_is_compared_with_its_path() {
    use differential::{Motors, Name};
    let run = |mistake: Option<&str>| {
        let (switch, ports) = (ArmSwitch::new(), Ports::<Name, 1>::new());
        let mut motors = Motors::new();
        let chassis = Chassis::differential(RADIUS, 0.4).with_mass(8.0);
        let description = Description {
            base: Some(Base::new([Name::Left, Name::Right], chassis)),
            ..Description::of(|_: Name| Plant::default())
        };
        let pose = Cell::new([0.0; 3]);
        let task = async {
            Timer::after_millis(100).await;
            let _ = switch.arm();
            let degrees =
                |name| ports.motor(name).status().feedback.total_angle.microdegrees() as f64 * 1e-6;
            let zero = [Name::Left, Name::Right].map(degrees);
            for millis in (0_u32..).step_by(10) {
                let [left, right] = if millis < 800 { [-40.0, 40.0] } else { [0.0, 0.0] };
                let _ = ports.motor(Name::Left).command(Target::Speed(Rpm::new(left)));
                let _ = ports.motor(Name::Right).command(Target::Speed(Rpm::new(right)));
                let [left, right] = [(Name::Left, zero[0]), (Name::Right, zero[1])]
                    .map(|(name, zero)| (degrees(name) - zero).to_radians() * RADIUS);
                pose.set([0.0, 0.0, (right - left) / 0.4]);
                Timer::after_millis(10).await;
            }
        };
        let Started { buses: [bus], .. } = motors.start(&switch).unwrap();
        let mut robot = Robot::new(description)
            .switch(&switch)
            .bus(bus, &ports.buses[0])
            .task(task)
            .signal("odometry x", "m", |_| Some(pose.get()[0]))
            .signal("odometry y", "m", |_| Some(pose.get()[1]))
            .signal("odometry yaw", "rad", |_| Some(pose.get()[2]))
            .signal("reference yaw", "deg", |_| Some(0.0))
            .estimate(["odometry x", "odometry y", "odometry yaw"])
            .reference(["odometry x", "odometry y", "reference yaw"]);
        let mistakes: Vec<_> = mistake.iter().map(|it| it.parse().unwrap()).collect();
        robot.set_mistakes(&mistakes).unwrap();
        let run = simulate(robot, 3, Micros::from_millis(1500)).unwrap();
        assert_eq!(problems(&run), "");
        let figures = Figures::of(&run);
        let json = to_json(&run, &figures, None)["path"].clone();
        let yaw = run.base.as_ref().unwrap().path.last().unwrap().yaw.to_degrees();
        let number = |what: &str| json[what]["deg"].as_f64().unwrap();
        (yaw, number("estimate_end"), number("reference_end"))
    };
    let (yaw, estimate, reference) = run(None);
    // 2 · 0.318 m/s in 0.4 m, for 0.8 s.
    assert!((yaw - 72.0).abs() < 5.0 && estimate < 1.5, "{yaw} {estimate}");
    assert!((reference - yaw).abs() < 1e-6, "{reference} {yaw}");
    let (yaw, estimate, _) = run(Some("track:x1.1"));
    assert!((estimate - 0.1 * yaw).abs() < 1.5, "{yaw} {estimate}");
}
