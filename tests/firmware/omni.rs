//! The firmware of `examples/omni`: motors of three vendors on three buses, an IMU, a remote control,
//! and a path.

use rc10_cli::Simulated as _;
use rc10_cli::robot::remote::ScriptLine;
use std::fs;

use omni::simulation::{ALONG, ARMED};
use omni::{Motors, Name, Ports, Shared};
use rc10_cli::Description;
use rc10_cli::live::{Answer, BAUD, Line, Losses, plan, watch_at};
use rc10_cli::record::{RecordWriter, replay};
use rc10_cli::recording::Recording;
use rc10_cli::recording::sample::Source;
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::show::figures;
use rc10_cli::show::figures::to_json;
use rc10_emu::{Board, Figures};
use rc10_motor::{Link, Names};
use rc10_sim::remote::{Controls, Switch};
use rc10_time::Micros;

use super::live::Watched;
use super::scratch::Scratch;
use super::{is_clean, keeps_its_period, log, program, setup, setup_on};

/// Runs it with faults for a time, in milliseconds.
fn record(faults: &[&str], length: u64, judge: impl FnOnce(&mut Emulation<'_>, Recording)) {
    record_by("omni-firmware", &setup(faults), length, judge);
}

fn record_by(
    name: &str,
    setup: &Setup,
    length: u64,
    judge: impl FnOnce(&mut Emulation<'_>, Recording),
) {
    record_in(omni::Robot::description(), name, setup, length, judge);
}

fn record_in(
    world: Description,
    name: &str,
    setup: &Setup,
    length: u64,
    judge: impl FnOnce(&mut Emulation<'_>, Recording),
) {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::Robot::of::<omni::Robot>(world, &shared, &mut motors).unwrap();
    let emulation = Emulation::new(&program(name), robot, setup).unwrap();
    let (mut emulation, recording) = emulation.record(Micros::from_millis(length)).unwrap();
    judge(&mut emulation, recording);
}

/// The buses that send in every tick; the flywheel is told in every fifth.
fn is_punctual(emulation: &Emulation<'_>) {
    let mut figures = Figures::of(&emulation.rig);
    figures.buses.truncate(2);
    keeps_its_period(&figures);
}

/// The largest current of a motor in some milliseconds, A.
fn current(recording: &Recording, name: Name, millis: std::ops::Range<usize>) -> f64 {
    let samples = &recording.motors[name.index()].samples[millis.start / 10..millis.end / 10];
    samples.iter().map(|sample| sample.current.abs()).fold(0.0, f64::max)
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_drives_by_its_remote_and_keeps_its_period() {
    drives("omni-firmware", Board::H723ZG);
}

pub(super) fn drives(name: &str, board: Board) {
    record_by(name, &setup_on(board, &[]), 3600, |emulation, recording| {
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
        is_punctual(emulation);
        let rpm =
            |name: Name, millis: usize| recording.motors[name.index()].samples[millis / 10 - 1].rpm;
        // 1 m/s forward: cos 45 degrees of that at each wheel of 76 mm.
        for (name, way) in omni::table::BASE.wheels.into_iter().zip([-1.0, -1.0, 1.0, 1.0]) {
            let speed = rpm(name, 950);
            assert!((speed - way * 88.85).abs() < 4.0, "{name:?}: {speed}");
        }
        let arm = rpm(Name::Arm, 2400);
        assert!((arm - 15.0).abs() < 1.0, "90 degrees per second: {arm} rpm");
        let flywheel = rpm(Name::Flywheel, 3550);
        assert!((flywheel - 1500.0).abs() < 45.0, "{flywheel}");
        let log = log(emulation);
        assert!(log.lines().last().unwrap().contains("armed, 7 of 7 motors online"), "{log}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_follows_its_path_and_comes_back() {
    let disarmed = Controls { right_switch: Switch::Down, ..ARMED };
    let mut world = omni::Robot::description();
    let remote = world.remote.as_mut().unwrap();
    remote.script = vec![
        ScriptLine::new(0, "down", disarmed),
        ScriptLine::new(100, "arm", ARMED),
        ScriptLine::new(200, "along the path", ALONG),
    ];
    remote.repeats_after = None;
    record_in(world, "omni-firmware", &setup(&[]), 6500, |emulation, recording| {
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
        is_punctual(emulation);
        let path = &recording.base.as_ref().unwrap().path;
        let from = |millis: usize| {
            let (start, here) = (path[19], path[millis / 10 - 1]);
            (here.x - start.x).hypot(here.y - start.y)
        };
        println!("{:.3} m from where it began; {:.2} m on the way", from(6500), from(3000));
        assert!(from(6500) < 0.03 && from(3000) > 1.0, "{} {}", from(6500), from(3000));
        let turned = (path[649].yaw - path[19].yaw).to_degrees();
        assert!((turned - 360.0).abs() < 1.0, "{turned}: once around, to the left");
    });
}

/// Twelve signals every millisecond beside all topics, at 921,600 baud: not one sample is missing. Without the
/// line's rate the chip sends each frame by itself, and they are not whole.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn chosen_signals_are_whole_at_1_khz_beside_all_else() {
    for knows_line in [true, false] {
        let ports = Ports::new();
        let (shared, mut motors) = (Shared::new(&ports), Motors::new());
        let robot = rc10_cli::robot_of::<omni::Robot>(&shared, &mut motors).unwrap();
        let setup = Setup { console: Some(BAUD), ..setup(&[]) };
        let mut emulation = Emulation::new(&program("omni-firmware"), robot, &setup).unwrap();
        let mut pc = Watched::new(&mut emulation);
        let (topics, _) = plan(&pc.client);
        let line = Line::new(BAUD, &topics);
        assert!(line.most(1) >= 12);
        let signals = pc.signals(&["target", "speed", "current"]);
        if knows_line {
            pc.client.set_line(line.bytes);
        }
        pc.client.watch(0, 1, signals.iter().take(12).copied());
        let paces = if knows_line { line.beside(12, 1).unwrap() } else { [10, 100] };
        watch_at(&mut pc.client, &topics, paces);
        pc.run(500);
        pc.samples.clear();
        let before = (Figures::of(&pc.emulation.rig).instructions, pc.client.losses());
        pc.run(3000);
        let spent = (Figures::of(&pc.emulation.rig).instructions - before.0) / 3;
        let of = |group: usize| pc.samples.iter().filter(move |it| it.group == group);
        let times: Vec<_> = of(0).map(|it| it.at.get()).collect();
        let gap = times.windows(2).map(|two| two[1] - two[0]).max().unwrap();
        let rest = [1, 2, 3].map(|group| of(group).count());
        println!(
            "{}: {} samples of 12 signals in 3 s, longest gap {gap} us; all else every {paces:?} ms: {rest:?}; {spent} \
             instructions a second",
            if knows_line { "by the line's rate" } else { "frame by frame" },
            times.len()
        );
        if knows_line {
            assert!((2999..=3001).contains(&times.len()) && gap < 1100, "{gap}");
            assert_eq!(pc.client.losses().skipped, before.1.skipped);
            assert!(rest[0] >= 3000 / usize::from(paces[0]) - 2, "{rest:?}");
        } else {
            assert!(gap > 2000 && times.len() < 2900);
        }
        assert_eq!(pc.client.losses().samples, 0);
    }
}

/// A console of 921,600 baud, which every USB adapter can.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_pc_watches_and_tunes_it() {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<omni::Robot>(&shared, &mut motors).unwrap();
    let setup = Setup { console: Some(BAUD), ..setup(&[]) };
    let mut emulation = Emulation::new(&program("omni-firmware"), robot, &setup).unwrap();
    let mut pc = Watched::new(&mut emulation);
    let signals = pc.signals(&["target", "speed", "current"]);
    assert_eq!(signals.len(), 3 * Name::ALL.len());
    pc.client.watch(0, 2, signals.iter().copied());
    pc.run(100);
    pc.samples.clear();
    pc.run(1000);
    assert_eq!((pc.samples.len(), pc.client.losses()), (500, Losses::default()));
    // What it says of a wheel is what the wheel does.
    let (number, _) = pc
        .client
        .signals()
        .find(|(_, it)| it.label == "wheel front left" && it.name == "speed")
        .unwrap();
    let told = pc.samples.last().unwrap().values.iter().find(|(index, _)| *index == number);
    let told = f64::from(told.unwrap().1);
    let shaft = pc.emulation.motors[Name::WheelFrontLeft.index()].state().output_rpm;
    let difference = (told.abs() - shaft.abs()).abs();
    assert!(difference < 4.0 && told.abs() > 20.0, "{told} rpm, {shaft} by the shaft");
    let (gain, value) = pc.parameter("wheel front left", "speed_kp");
    let id = pc.client.set(&[(gain, value * 0.5)]).unwrap();
    assert_eq!(pc.ask(id), Answer::Done);
    // It hears of the change with the next hello.
    pc.run(300);
    let (_, now) = pc.parameter("wheel front left", "speed_kp");
    assert!((now - value * 0.5).abs() < 1e-6 && value > 0.0, "{value} -> {now}");
    is_clean(&emulation.rig, &Figures::of(&emulation.rig));
    is_punctual(&emulation);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_bus_that_is_cut_costs_its_motors_only_and_they_return() {
    record(&["cut:1@0.5s..0.65s"], 1200, |emulation, recording| {
        is_punctual(emulation);
        assert!(recording.motors.iter().all(|track| track.last.link == Link::Online));
        // Driven before, and again afterwards.
        for millis in [400..500, 800..1000] {
            assert!(current(&recording, Name::WheelFrontLeft, millis) > 0.1);
        }
        let log = log(emulation);
        assert!(log.contains("armed, 3 of 7 motors online;"), "{log}");
        assert!(log.lines().last().unwrap().contains("armed, 7 of 7 motors online;"), "{log}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_panic_leaves_every_motor_without_torque_until_it_is_armed_again() {
    // While all turn.
    record(&["panic@3s"], 3600, |emulation, recording| {
        let restarts = &emulation.rig.machine.restarts;
        assert_eq!(restarts.len(), 1, "{restarts:?}");
        for name in Name::ALL {
            assert!(current(&recording, *name, 2700..3000) > 0.01, "{name:?} is driven before");
            // The switch that arms has not been moved since: not before the end. At first a winding
            // without voltage brakes a turret that turns.
            let after = current(&recording, *name, 3200..3600);
            assert!(after < 0.05, "{name:?}: {after} A");
        }
        let log = log(emulation);
        assert!(log.contains("the last run ended in a crash: Panic"), "{log}");
        assert!(log.lines().last().unwrap().contains("disarmed, 7 of 7 motors online;"), "{log}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_lost_remote_stops_everything_and_disarms() {
    record(&["remote-lost@0.6s..1.8s"], 2100, |emulation, recording| {
        let [loss] = recording.remote.as_ref().unwrap().losses[..] else { panic!("one loss") };
        let reaction = loss.reaction().unwrap();
        println!("all coast {reaction} after the last good frame");
        assert!(reaction <= Micros::from_millis(120), "{reaction}");
        let disarmed = loss.disarmed.unwrap().since(loss.last_frame.unwrap());
        assert!((1000..=1030).contains(&(disarmed.get() / 1000)), "{disarmed}");
        let log = log(emulation);
        assert!(log.contains("suspended, 7 of 7 motors online, remote missing"), "{log}");
        assert!(log.lines().last().unwrap().contains("disarmed, 7 of 7 motors online"), "{log}");
    });
}

/// What is seen of an emulated chip from outside is kept in a record, and makes the same report again.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn its_record_makes_the_same_report() {
    let folder = Scratch::new("omni-record");
    let path = folder.join("run.mcap");
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<omni::Robot>(&shared, &mut motors).unwrap();
    let setup = setup(&["remote-lost@0.6s", "cut:2@0.3s..0.5s"]);
    let emulation = Emulation::new(&program("omni-firmware"), robot, &setup).unwrap();
    let record = RecordWriter::new(&path, false, &emulation.heading()).unwrap();
    let (_, mut run) = emulation.record_into(Micros::from_millis(1200), Some(record)).unwrap();
    run.faults = setup.faults;
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<omni::Robot>(&shared, &mut motors).unwrap();
    let (again, cut) = replay(&mut fs::File::open(&path).unwrap(), robot).unwrap();
    assert_eq!(cut, None);
    assert!(again.source == Source::Emulation && run.remote.as_ref().unwrap().losses.len() == 1);
    let figures = |run| to_json(run, &figures::Figures::of(run), None);
    assert_eq!(figures(&run), figures(&again));
}
