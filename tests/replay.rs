//! Replay: what reached a robot's ticks runs again through its own code, bit for bit; and whatever is not the same is
//! named, at its tick.

use std::collections::HashMap;
use std::fs;
use std::hash::{BuildHasher as _, RandomState};
use std::path::Path;
use std::sync::LazyLock;
use std::time::Instant;

use embassy_time::{Duration, Timer};
use rc10_app::Rpm;
use rc10_cli::replay::{Told, compare, inputs_of, replayed};
use rc10_cli::{CommandLine, Robot, Simulated};
use rc10_motor::record::{KEYFRAME, STATE, TICK};
use rc10_motor::{Gains, Names as _, Request, Target};
use rc10_sim::Random;
use rc10_time::Micros;
use team::table::Name;

use crate::common::scratch::Scratch;

/// A robot of a program with these faults, handed over.
fn of<P: Simulated, R>(faults: &[&str], take: impl FnOnce(Robot<'_>) -> R) -> R {
    rc10_cli::with::<P, _>(|shared, motors| {
        let mut robot = rc10_cli::robot_of::<P>(shared, motors).unwrap();
        let faults: Vec<_> = faults.iter().map(|it| it.parse().unwrap()).collect();
        robot.set_faults(&faults).unwrap();
        take(robot)
    })
}

pub(crate) fn recorded<P: Simulated>(faults: &[&str], millis: u64) -> Vec<u32> {
    of::<P, _>(faults, |robot| inputs_of(robot, 5, Micros::from_millis(millis)).unwrap())
}

#[track_caller]
fn is_equal<P: Simulated>(words: &[u32]) -> Told {
    let (told, difference) = of::<P, _>(&[], |robot| replayed(words, robot).unwrap());
    assert_eq!(difference, None);
    told
}

/// Of every half of a tick each frame, and of every tick the state of each bus.
#[track_caller]
fn is_replayed<P: Simulated>(faults: &[&str], millis: u64) {
    let words = recorded::<P>(faults, millis);
    let told = is_equal::<P>(&words);
    let all = entries(&words);
    let count = |kind| all.iter().filter(|it| it.kind == kind).count() as u64;
    assert_eq!((told.ticks, told.unknown, told.lost), (count(STATE), 0, 0));
    assert_eq!(told.states, count(STATE) + count(KEYFRAME));
    assert!(count(STATE) > millis * 9 / 10, "{told:?}");
}

/// An entry of a record, read here a second time: its place among the words, its kind, and the time of its tick.
struct Entry {
    from: usize,
    kind: u8,
    at: u64,
}

fn entries(words: &[u32]) -> Vec<Entry> {
    let (mut all, mut from, mut ticks) = (Vec::new(), 0, [0; 16]);
    while let Some(head) = words.get(from) {
        let [kind, place, length, _] = head.to_le_bytes();
        let at = &mut ticks[usize::from(place)];
        if kind == TICK {
            *at = u64::from(words[from + 1]) | u64::from(words[from + 2]) << 32;
        }
        all.push(Entry { from, kind, at: *at });
        from += 1 + usize::from(length);
    }
    all
}

#[test]
fn every_shipped_robot_is_replayed_bit_for_bit() {
    is_replayed::<team::Robot>(&[], 4000);
    is_replayed::<omni::Robot>(&[], 4000);
    is_replayed::<lift::Robot>(&[], 4000);
    is_replayed::<swerve::Robot>(&[], 4000);
    is_replayed::<mixed::Robot>(&[], 4000);
    is_replayed::<owl::Robot>(&[], 4000);
    is_replayed::<starter::Robot>(&[], 4000);
}

/// Buses that go off and come back, motors that are pulled, come back restarted, and lines with noise.
#[test]
fn faults_are_replayed_too() {
    let on_buses = [
        "short:2@0.5s..0.7s",
        "cut:1@1s..1.2s",
        "dominant:3@1.4s..1.45s",
        "babble:2@1.6s..1.8s",
        "power:1@2s..2.3s",
        "remote-lost@2.5s..2.8s",
        "noise:3@1.1s",
    ];
    is_replayed::<team::Robot>(&on_buses, 3500);
    is_replayed::<omni::Robot>(&on_buses, 3500);
    let mixed = [
        "short:1@0.5s..0.7s",
        "cut:L1@1s..1.2s",
        "noise:L1@0.6s",
        "power:2@1.4s..1.8s",
        "power:L1@2s..2.4s",
        "load:2@2.5s..2.6s",
    ];
    is_replayed::<mixed::Robot>(&mixed, 3500);
}

/// Gains that are set while it drives, as by `rc10 set`.
#[test]
fn parameters_that_change_while_it_drives_are_replayed() {
    let words = rc10_cli::with::<team::Robot, _>(|shared, motors| {
        let robot = rc10_cli::robot_of::<team::Robot>(shared, motors).unwrap();
        let robot = robot.task(async {
            for round in 1_u8.. {
                Timer::after(Duration::from_millis(37)).await;
                let kp = 0.05 + f32::from(round) * 1e-3;
                let gains = Gains { kp, ki: 0.5, kd: 0.0 };
                let wheel = shared.ports.motor(Name::ALL[usize::from(round) % 4]);
                wheel.request(Request::SpeedGains(gains)).await.unwrap();
            }
        });
        inputs_of(robot, 1, Micros::from_millis(3000)).unwrap()
    });
    is_equal::<team::Robot>(&words);
}

/// A black box has lost its begin: from the keyframes on all is compared.
#[test]
fn a_record_that_begins_in_the_middle_is_replayed_from_its_keyframes() {
    fn check<P: Simulated>() {
        let words = recorded::<P>(&["power:1@1.2s..1.5s"], 2500);
        let all = entries(&words);
        for from in [0.3, 1.1, 1.3, 1.6] {
            let begin = all.iter().find(|it| it.at as f64 > from * 1e6).unwrap();
            let told = is_equal::<P>(&words[begin.from..]);
            // A round, and one more as they do not begin together.
            assert!(told.unknown < 3 * 2 * 448 && told.unknown > 0, "{told:?}");
            assert!(told.states > 500, "{told:?}");
        }
    }
    check::<team::Robot>();
    check::<mixed::Robot>();
}

/// Each flipped bit changes nothing that a tick reads, or is named at the tick that reads it.
#[test]
fn of_a_thousand_flipped_bits_each_is_named_at_its_tick_or_changes_nothing() {
    fn check<P: Simulated>(flips: usize) -> usize {
        let words = recorded::<P>(&["short:1@0.2s..0.25s"], 400);
        let told = is_equal::<P>(&words);
        let (all, mut random, mut unnoticed) = (entries(&words), Random::new(3), 0);
        for _ in 0..flips {
            let (word, bit) = (random.index(words.len()), random.below(32));
            let hit = all.partition_point(|it| it.from <= word) - 1;
            let mut flipped = words.clone();
            flipped[word] ^= 1 << bit;
            let outcome = of::<P, _>(&[], |robot| replayed(&flipped, robot));
            let Entry { from, kind, at } = all[hit];
            let what =
                || format!("bit {bit} of word {} of an entry of kind {kind} at {at}", word - from);
            match outcome {
                Ok((again, None)) => {
                    assert_eq!(again.hash, told.hash, "{}", what());
                    unnoticed += 1;
                }
                Ok((_, Some((found, said)))) => {
                    // Half a tick later it is read, or has shown; the bus that comes next may be the first to miss it.
                    let late = found.get().abs_diff(at);
                    assert!(
                        late <= 1_100 || kind == TICK && word > from,
                        "{late} {}\n{said}",
                        what()
                    );
                }
                Err(error) => {
                    let said = format!("{error:#}");
                    let time =
                        said.split_once("behind ").unwrap_or_else(|| panic!("{said} {}", what())).1;
                    let time: f64 = time.split_once(' ').unwrap().0.parse().unwrap();
                    let late = (time * 1e6 - at as f64).abs();
                    let is_time = kind == TICK && word > from;
                    assert!(late <= 2_100.0 || is_time, "{late} {}\n{said}", what());
                }
            }
        }
        unnoticed
    }
    let unnoticed = [check::<team::Robot>(500), check::<mixed::Robot>(500)];
    println!("of 2 x 500 flipped bits {unnoticed:?} change nothing that a tick reads");
    // Of a line: times at which there is nothing to say, and what fills words.
    assert!(unnoticed[0] < 50 && unnoticed[1] < 250, "{unnoticed:?}");
}

/// A task that reads what no port gives it: a clock of the PC, the order of a `HashMap`, a random number.
#[test]
fn a_task_that_is_not_the_same_twice_is_named_with_its_motor_and_time() {
    type Sin = fn(u32) -> f32;
    let sins: [(&str, Sin); 3] = [
        ("clock", |_| Instant::now().duration_since(*BEGAN).subsec_nanos() as f32 * 1e-9),
        ("order", |_| {
            let map: HashMap<u32, ()> = (0..64).map(|it| (it, ())).collect();
            map.into_keys().next().unwrap() as f32
        }),
        ("random", |_| (RandomState::new().hash_one(1) % 1000) as f32),
    ];
    for (name, sin) in sins {
        let run = || {
            rc10_cli::with::<team::Robot, _>(|shared, motors| {
                let robot = rc10_cli::robot_of::<team::Robot>(shared, motors).unwrap();
                let robot = robot.task(async move {
                    Timer::after(Duration::from_micros(123_250)).await;
                    loop {
                        let speed = Rpm::new(sin(3));
                        let _ = shared.ports.motor(Name::Feeder).command(Target::Speed(speed));
                        Timer::after(Duration::from_millis(5)).await;
                    }
                });
                inputs_of(robot, 1, Micros::from_millis(300)).unwrap()
            })
        };
        let (first, second) = (run(), run());
        let said = of::<team::Robot, _>(&[], |robot| compare(&first, &second, robot).unwrap_err());
        let said = said.to_string();
        println!("{name}: {said}");
        let time = said.split_once("differ at ").unwrap().1.split_once(" s").unwrap().0;
        // The order may happen to be the same now and then.
        assert!((0.123..0.2).contains(&time.parse::<f64>().unwrap()), "{said}");
        assert!(said.contains("`feeder` gets Speed(Rpm("), "{said}");
    }
}

static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);

#[test]
fn each_shipped_robot_is_the_same_twice() {
    let time = Micros::from_millis(1500);
    for said in [
        rc10_cli::replayed::<team::Robot>(3, time),
        rc10_cli::replayed::<omni::Robot>(3, time),
        rc10_cli::replayed::<lift::Robot>(3, time),
        rc10_cli::replayed::<starter::Robot>(3, time),
        rc10_cli::replayed::<swerve::Robot>(3, time),
        rc10_cli::replayed::<mixed::Robot>(3, time),
        rc10_cli::replayed::<owl::Robot>(3, time),
    ] {
        assert!(said.unwrap().starts_with("equal: "));
    }
}

/// What the loops would have commanded with another gain; and the same without one.
#[test]
fn what_if_is_open_loop_and_says_so() {
    let folder = Scratch::new("what-if");
    let path = |name: &str| folder.join(name).display().to_string();
    let [record, out] = [path("run.mcap"), path("out")];
    let rc10 = |words: &[&str]| {
        let mut said = Vec::new();
        let words = ["rc10"].iter().chain(words).copied();
        let code = of::<team::Robot, _>(&[], |robot| {
            CommandLine::parse(words).unwrap().run_to(robot, &mut said)
        });
        (code, String::from_utf8(said).unwrap())
    };
    let (code, _) = rc10(&["run", "--seconds", "3", "--record", &record, "--out", &out]);
    assert_eq!(code.unwrap(), 0);
    let (code, said) = rc10(&["replay", &record]);
    assert_eq!((code.unwrap(), said.lines().count()), (0, 1), "{said}");
    assert!(said.starts_with("equal: 8997 ticks"), "{said}");
    let set = "wheel_front_left.speed_kp=0.3";
    let (code, said) = rc10(&["replay", &record, "--set", set, "--out", &out]);
    assert_eq!(code.unwrap(), 0);
    assert!(said.starts_with(&format!("with {set}, open loop")), "{said}");
    // No other motor is concerned.
    let of_motors: Vec<_> = said.lines().filter(|it| it.contains(", RMS ")).collect();
    assert!(matches!(of_motors[..], [line] if line.starts_with("wheel front left ")), "{said}");
    let (code, said) =
        rc10(&["replay", &record, "--set", "wheel_front_left.speed_kp=0", "--until", "2"]);
    assert_eq!((code.unwrap(), said.lines().count()), (0, 12), "{said}");
    for (words, complaint) in [
        (["--set", "wheel.speed_kp=1"], "there is no motor `wheel`"),
        (["--set", "feeder.speed=1"], "no parameter of that name"),
        (["--set", "feeder_speed=200"], "only gains and limits of motors can be replayed"),
        (["--set", "feeder.speed_kp=fast"], "`fast` is no number"),
        (["--set", "feeder.speed_kp=-1"], "what is to be set is refused: "),
        (["--until", "4"], "it ends before 4 s"),
    ] {
        let (code, _) = rc10(&[&["replay", &record], &words[..]].concat());
        let said = format!("{:#}", code.unwrap_err());
        assert!(said.contains(complaint), "{said}");
    }
    // Of another robot, of no robot, and of one that tells no inputs.
    let (code, _) = rc10(&["replay", "Cargo.toml"]);
    assert!(format!("{:#}", code.unwrap_err()).contains("it is no MCAP file"));
    let other = of::<mixed::Robot, _>(&[], |robot| {
        let words = ["rc10", "replay", &record, "--out", &out];
        CommandLine::parse(words).unwrap().run_to(robot, &mut Vec::new())
    });
    let said = format!("{:#}", other.unwrap_err());
    assert!(said.contains("it is of another robot: it has no motor `"), "{said}");
}

/// Nothing but its arguments reaches a tick: no clock, no global, no cell, in what a motor and its bus are made of.
#[test]
fn a_tick_is_a_function_of_what_is_recorded() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files: Vec<_> =
        vec![root.join("crates/rc10-motor/src"), root.join("crates/rc10-app/src")];
    let mut seen = 0;
    while let Some(path) = files.pop() {
        if path.is_dir() {
            files.extend(fs::read_dir(path).unwrap().map(|it| it.unwrap().path()));
            continue;
        }
        // The runner has its clock from its caller, and the ports are what is recorded.
        let name = path.strip_prefix(root).unwrap().display().to_string();
        let is_outside =
            name.contains("/embassy/") || name.contains("tests") || name.ends_with("record.rs");
        if is_outside || path.extension().is_none_or(|it| it != "rs") {
            continue;
        }
        seen += 1;
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap();
        for line in code.lines().filter(|line| !line.trim_start().starts_with("//")) {
            for word in [
                "static mut",
                "Cell<",
                "Atomic",
                "Mutex",
                "Instant",
                "unsafe ",
                "asm!",
                "thread_local",
            ] {
                let is_switch = name.ends_with("/arm.rs") && word == "Atomic";
                assert!(!line.contains(word) || is_switch, "{name}: {line}");
            }
        }
    }
    assert!(seen > 80, "{seen}");
    for lib in ["rc10-motor", "rc10-app"] {
        let lib = fs::read_to_string(root.join(format!("crates/{lib}/src/lib.rs"))).unwrap();
        assert!(lib.contains("#![no_std]") && lib.contains("#![forbid(unsafe_code)]"));
    }
}
