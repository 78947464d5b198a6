//! The robot in simulation: it does what the sticks say, stops when they are not heard, and follows its
//! path and comes back, whatever happens on the way.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use omni::base::Activity;
use omni::simulation::{ALONG, ARMED, stick};
use omni::{Motors, Name, Ports, Robot, Shared};
use rc10::app::mechanism::Stage;
use rc10::motor::{Link, Names};
use rc10::sim::judge::path::PathFigures;
use rc10::sim::recording::Recording;
use rc10::sim::recording::sample::PathPoint;
use rc10::sim::robot::remote::ScriptLine;
use rc10::sim::run::simulate::simulate;
use rc10::sim::simulator::remote::{Controls, Switch};
use rc10::sim::{Description, Simulated as _};
use rc10::time::Micros;

fn run(fault: Option<&str>, millis: u64) -> Recording {
    run_in(Robot::description(), 1, fault, millis)
}

fn run_in(world: Description, seed: u64, fault: Option<&str>, millis: u64) -> Recording {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let mut robot = rc10::sim::Robot::of::<Robot>(world, &shared, &mut motors).unwrap();
    let faults: Vec<_> = fault.iter().map(|fault| fault.parse().unwrap()).collect();
    robot.set_faults(&faults).unwrap();
    simulate(robot, seed, Micros::from_millis(millis)).unwrap()
}

const ARM_UP: Controls = Controls { right: stick(0.0, 90.0), ..ARMED };
const DISARMED: Controls = Controls { right_switch: Switch::Down, ..ARMED };

/// Nothing but the path, from 0.3 s on.
const PATH: [ScriptLine; 3] = [
    ScriptLine::new(0, "switches down", DISARMED),
    ScriptLine::new(100, "arm", ARMED),
    ScriptLine::new(300, "along the path", ALONG),
];

/// The robot with another operator.
fn operated(script: &[ScriptLine]) -> Description {
    let mut world = Robot::description();
    let remote = world.remote.as_mut().unwrap();
    (remote.script, remote.repeats_after) = (script.to_vec(), None);
    world
}

/// The robot's last activity before a time.
fn activity(run: &Recording, millis: usize) -> Option<f32> {
    let signal = run.signals.iter().find(|signal| signal.label == "activity").unwrap();
    signal.samples[millis / 10 - 1].map(|cell| cell.max)
}

fn does(run: &Recording, millis: usize, what: Activity) -> bool {
    activity(run, millis).is_some_and(|is| (is - f32::from(what as u8)).abs() < 0.5)
}

/// When it first does that, ms.
fn first(run: &Recording, what: Activity) -> Option<usize> {
    let samples = usize::try_from(run.length.get() / 10_000).unwrap();
    (1..=samples).map(|sample| sample * 10).find(|millis| does(run, *millis, what))
}

fn pose(run: &Recording, millis: usize) -> PathPoint {
    run.base.as_ref().unwrap().path[millis / 10 - 1]
}

/// How far two poses are apart: m, and degrees without whole turns.
fn apart(one: PathPoint, other: PathPoint) -> [f64; 2] {
    let turn = (one.yaw - other.yaw).to_degrees();
    [(one.x - other.x).hypot(one.y - other.y), (turn - 360.0 * (turn / 360.0).round()).abs()]
}

/// Highest speed of a wheel in some milliseconds, rpm.
fn fastest_wheel(run: &Recording, millis: std::ops::Range<usize>) -> f64 {
    let wheels = omni::table::BASE.wheels.map(|name| &run.motors[name.index()].samples);
    let samples = wheels.iter().flat_map(|wheel| &wheel[millis.start / 10..millis.end / 10]);
    samples.map(|sample| sample.rpm.abs()).fold(0.0, f64::max)
}

#[test]
fn it_does_what_the_sticks_say() {
    let run = run(None, 4000);
    let sample = |name: Name, millis: usize| run.motors[name.index()].samples[millis / 10 - 1];
    #[expect(clippy::cast_possible_truncation, reason = "a speed")]
    let motion = |millis| {
        let rpm = |name| rc10::app::Rpm::new(sample(name, millis).rpm as f32);
        omni::table::BASE.geometry.forward(omni::table::BASE.wheels.map(rpm)).twist
    };
    for (millis, [forward, left, turn]) in
        [(950, [1.0, 0.0, 0.0]), (1750, [0.0, 1.0, 0.0]), (2550, [0.0, 0.0, 2.0])]
    {
        let real = motion(millis);
        let off = [real.vx - forward, real.vy - left, real.wz - turn].map(f32::abs);
        assert!(off.iter().all(|off| *off < 0.06), "at {millis} ms: {real:?}");
    }
    let arm = sample(Name::Arm, 2900).measured;
    assert!((arm - 72.0).abs() < 3.0, "0.8 s at 90 degrees per second: {arm}");
    let turret = [3000, 3600].map(|millis| sample(Name::Turret, millis).measured);
    let turned = (turret[0] - turret[1]).rem_euclid(360.0);
    assert!((turned - 54.0).abs() < 5.0, "0.6 s at half of 180 degrees per second: {turned}");
    let flywheel = sample(Name::Flywheel, 3900).rpm;
    // Its own speed controller overshoots, and takes seconds to settle: `s_pid_ki` as it is sold.
    assert!((flywheel - 1500.0).abs() < 30.0, "{flywheel}");
    assert!(run.motors.iter().all(|track| track.last.link == Link::Online));
    assert!(run.buses.iter().all(|bus| bus.last.refused + bus.last.replaced == 0));
}

#[test]
fn it_keeps_its_heading_by_hand() {
    const AHEAD: [ScriptLine; 4] = [
        PATH[0],
        PATH[1],
        ScriptLine::new(300, "ahead", Controls { left: stick(0.0, 1.0), ..ARMED }),
        ScriptLine::new(2300, "stand", ARMED),
    ];
    let mut world = operated(&AHEAD);
    // A worn wheel: of itself, the base turns by 2.4 degrees on 2 m.
    world.base.as_mut().unwrap().chassis.wheels[0].radius *= 0.97;
    let run = run_in(world, 1, None, 3000);
    let [metres, degrees] = apart(pose(&run, 3000), pose(&run, 200));
    println!("{degrees:.2} degrees after {metres:.2} m");
    assert!(metres > 1.8 && degrees < 0.6, "{metres} {degrees}");
}

#[test]
fn arm_and_turret_go_where_their_profiles_do() {
    let run = run(None, 9000);
    for (name, most) in [(Name::Arm, 0.5), (Name::Turret, 1.5)] {
        let [tracking] = &run.motors[name.index()].tracking[..] else { panic!("one kind") };
        let rms = tracking.rms();
        println!("{name:?}: {rms:.2} degrees RMS");
        assert!(rms < most, "{name:?}: {rms} degrees RMS behind its profile");
    }
}

#[test]
fn an_arm_that_is_where_it_cannot_be_is_not_driven() {
    // Without its stop it hangs at 40 degrees below level, as if its encoder were mounted anew.
    let mut world = operated(&[
        PATH[0],
        ScriptLine::new(600, "arm", ARMED),
        ScriptLine::new(700, "up", ARM_UP),
    ]);
    let run = |world, told: Stage| {
        let run = run_in(world, 1, None, 2000);
        let stage = run.signals.iter().find(|signal| signal.label == "arm stage").unwrap().last;
        assert_eq!(stage, Some(f64::from(told as u8)));
        run.motors[Name::Arm.index()].last.feedback.total_angle.within_turn().get()
    };
    let up = run(world.clone(), Stage::Ready);
    assert!((up - 110.0).abs() < 5.0, "1.3 s at 90 degrees per second: {up}");
    world.motors[Name::Arm.index()].plant.travel = Some([-40.0, 130.0]);
    let hangs = run(world, Stage::OutOfTravel);
    assert!((hangs - 320.0).abs() < 1.0, "{hangs}");
}

#[test]
fn arm_and_turret_go_home_together() {
    let run = run(None, 9000);
    // From when on their profiles are there, ms: the switch is moved at 7000.
    let arrived = [Name::Arm, Name::Turret].map(|name| {
        let samples = &run.motors[name.index()].samples;
        let end = samples[samples.len() - 1];
        let off = (end.measured + 180.0).rem_euclid(360.0) - 180.0;
        let moving = samples.iter().rposition(|sample| sample.target != end.target).unwrap();
        println!("{name:?}: moves until {} ms; at last {off:.2} degrees off", (moving + 1) * 10);
        assert!(off.abs() < 0.5, "{name:?}: {off}");
        (moving + 1) * 10
    });
    assert!(arrived[0] > 7200 && arrived[0].abs_diff(arrived[1]) <= 10, "{arrived:?}");
}

#[test]
fn it_comes_back_to_where_it_began() {
    let (mut far, mut end) = (0.0_f64, [0.0_f64; 2]);
    // Masses of 8 to 20 kg and grips of 70 to 130 %, each with each other's.
    for seed in 0..16_u32 {
        let mut world = operated(&PATH);
        let base = world.base.as_mut().unwrap();
        base.chassis = base.chassis.clone().with_mass(8.0 + 0.8 * f64::from(seed));
        base.chassis.grip *= 0.7 + 0.04 * f64::from(seed * 7 % 16);
        let run = run_in(world, seed.into(), None, 8000);
        let arrived = first(&run, Activity::Arrived).expect("it arrives");
        assert!(first(&run, Activity::GaveUp).is_none() && arrived < 7000, "{seed}: {arrived}");
        let figures = PathFigures::of(&run).unwrap();
        assert!(figures.is_true);
        far = far.max(figures.furthest.unwrap().metres);
        let [metres, degrees] = apart(pose(&run, 8000), pose(&run, 200));
        end = [end[0].max(metres), end[1].max(degrees)];
        // It was somewhere.
        assert!(pose(&run, 3000).x.hypot(pose(&run, 3000).y) > 1.0, "{seed}");
    }
    println!(
        "at most {far:.3} m from the path; back within {:.3} m and {:.3} degrees",
        end[0], end[1]
    );
    // Of 5.5 m. Its wheels slip, and what all of them slip together no sensor sees.
    assert!(far < 0.04, "{far} m from where it is to be");
    assert!(end[0] < 0.04 && end[1] < 0.2, "{end:?} from where it began");
}

#[test]
fn a_base_that_cannot_move_gives_up_and_says_so() {
    let mut blocked = operated(&PATH);
    let base = blocked.base.as_mut().unwrap();
    base.chassis = base.chassis.clone().with_mass(20_000.0);
    let run = run_in(blocked, 1, None, 5000);
    let gave_up = first(&run, Activity::GaveUp).expect("it gives up");
    assert!(first(&run, Activity::Waiting).unwrap() < gave_up && gave_up < 3500, "{gave_up}");
    assert!(does(&run, 5000, Activity::GaveUp) && fastest_wheel(&run, 4500..5000) < 1.0);
    assert!(apart(pose(&run, 5000), pose(&run, 200))[0] < 0.1);
}

#[test]
fn wheels_without_power_give_the_path_up() {
    let run = run_in(operated(&PATH), 1, Some("power:1@2s..6s"), 7000);
    let gave_up = first(&run, Activity::GaveUp).expect("it gives up");
    assert!((3500..4500).contains(&gave_up), "{gave_up}");
    // It does not go on when they are back.
    assert!(does(&run, 7000, Activity::GaveUp));
    assert!(apart(pose(&run, 7000), pose(&run, 5500))[0] < 0.01);
}

#[test]
fn sticks_take_over() {
    const TAKEN: [ScriptLine; 5] = [
        PATH[0],
        PATH[1],
        PATH[2],
        ScriptLine::new(2000, "sideways", Controls { left: stick(-0.5, 0.0), ..ALONG }),
        ScriptLine::new(3000, "stand", ALONG),
    ];
    let run = run_in(operated(&TAKEN), 1, None, 5000);
    assert!(does(&run, 1950, Activity::Following));
    // Half a meter per second to the left of where it looks, and then it stands, by hand.
    let (from, to) = (pose(&run, 2900), pose(&run, 3000));
    let speed = ((to.y - from.y) * to.yaw.cos() - (to.x - from.x) * to.yaw.sin()) / 0.1;
    assert!((speed - 0.5).abs() < 0.05, "{speed}");
    for millis in [2100, 2900, 3500, 5000] {
        assert!(does(&run, millis, Activity::ByHand), "{millis}: {:?}", activity(&run, millis));
    }
    assert!(fastest_wheel(&run, 4000..5000) < 1.0);
}

#[test]
fn the_switch_gives_the_path_up_and_starts_another() {
    const TWICE: [ScriptLine; 5] = [
        PATH[0],
        PATH[1],
        PATH[2],
        ScriptLine::new(2000, "by hand", ARMED),
        ScriptLine::new(3500, "along the path again", ALONG),
    ];
    let run = run_in(operated(&TWICE), 1, None, 10_500);
    assert!(does(&run, 1950, Activity::Following) && does(&run, 2100, Activity::ByHand));
    assert!(fastest_wheel(&run, 3000..3500) < 1.0);
    // From where it then stood.
    assert!(does(&run, 10_500, Activity::Arrived));
    let [metres, degrees] = apart(pose(&run, 10_500), pose(&run, 3400));
    assert!(metres < 0.02 && degrees < 1.0, "{metres} {degrees}");
}

#[test]
fn a_lost_remote_stops_it() {
    let run = run(Some("remote-lost@1.5s"), 3000);
    for name in Name::ALL {
        let last = run.motors[name.index()].samples.last().unwrap();
        assert!(last.current.abs() < 0.05, "{name:?}: {} A", last.current);
    }
}

#[test]
fn a_remote_that_is_lost_on_the_path_ends_it() {
    let run = run_in(operated(&PATH), 1, Some("remote-lost@2s..2.6s"), 5000);
    assert!(does(&run, 1950, Activity::Following));
    assert_eq!(activity(&run, 2400), None);
    let currents =
        omni::table::BASE.wheels.map(|name| run.motors[name.index()].samples[240].current);
    assert!(currents.iter().all(|current| current.abs() < 0.05), "{currents:?}");
    // The switch is where it was: that starts nothing.
    assert!(does(&run, 3000, Activity::ByHand) && does(&run, 5000, Activity::ByHand));
    assert!(fastest_wheel(&run, 4000..5000) < 1.0);
}
