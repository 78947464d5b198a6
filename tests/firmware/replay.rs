//! What reached the chip's ticks runs again on this PC: the state after every tick, computed here and there, is the same.
//! `RC10_REPLAY=30 cargo xtask emulate replayed` drives for 30 s.

use std::io::Cursor;

use rc10_cli::replay::{Inputs, Told, replayed};
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_cli::{Robot, Simulated, robot_for_good};
use rc10_motor::record::ring::{Memory, NEWEST, Reader, WORDS, Writer};
use rc10_motor::record::{SENT, STATE};
use rc10_sim::{Nanos, Random};
use rc10_time::Micros;

use crate::{millis, program};

pub(super) fn seconds() -> u64 {
    let asked = std::env::var("RC10_REPLAY").ok();
    asked.map_or(2, |it| it.parse().expect("RC10_REPLAY is a number of seconds"))
}

pub(super) fn robot<P: Simulated>() -> Robot<'static>
where
    P::Name: 'static,
    P::Own: 'static,
    P::Motors: 'static,
{
    robot_for_good::<P>().unwrap()
}

/// The program with a black box, whose entries are taken as they come.
fn drive<P: Simulated>(name: &str) -> Told
where
    P::Name: 'static,
    P::Own: 'static,
    P::Motors: 'static,
{
    let file = program(&format!("{name}-firmware-black-box"));
    let setup = Setup { seed: 1, record: true, ..Setup::default() };
    let mut emulation = Emulation::new(&file, robot::<P>(), &setup).unwrap();
    emulation.forgets = true;
    let mut words = Vec::new();
    for at in 1..=seconds() * 100 {
        emulation.run(millis(at * 10)).unwrap();
        drop(emulation.take_frames());
        words.extend(emulation.take_inputs());
    }
    is_packed(name, &words);
    let (told, difference) = replayed(&words, robot::<P>()).unwrap();
    assert_eq!(difference, None, "{name}");
    println!("{name}: {told:?}");
    assert_eq!((told.lost, told.unknown), (0, 0));
    told
}

/// What went into a ring comes out of it, without what only a test bench wants.
fn is_packed(name: &str, words: &[u32]) {
    let mut memory: Box<Memory> = vec![0; WORDS].try_into().unwrap();
    let (mut writer, mut reader) = (Box::new(Writer::NEW), Box::new(Reader::NEW));
    writer.clear(&mut memory, 0);
    let (mut put, mut read) = (Vec::new(), Vec::new());
    let mut rest = words;
    while let Some(head) = rest.first() {
        let [kind, _, length, more] = head.to_le_bytes();
        let (entry, behind) = rest.split_at(1 + usize::from(length));
        rest = behind;
        if kind == STATE || kind == SENT && more >> 4 == 0 {
            continue;
        }
        writer.put(&mut memory, entry);
        put.extend_from_slice(entry);
        if memory[NEWEST].is_multiple_of(16) {
            reader.read(&memory, &mut |entry| read.extend_from_slice(entry));
        }
    }
    reader.read(&memory, &mut |entry| read.extend_from_slice(entry));
    assert!(put == read, "{name}: what comes out is not what went in");
}

/// Runs a chip that no test bench watches until its black box is full; returns the seconds in it.
fn kept<P: Simulated>(name: &str) -> f64
where
    P::Name: 'static,
    P::Own: 'static,
    P::Motors: 'static,
{
    let file = program(&format!("{name}-firmware-black-box"));
    let motors = robot::<P>().description().motors.len();
    let mut emulation = Emulation::new(&file, robot::<P>(), &Setup::default()).unwrap();
    emulation.forgets = true;
    let mut at = 0;
    let memory = loop {
        at += 500;
        emulation.run(millis(at)).unwrap();
        drop(emulation.take_frames());
        let memory = emulation.black_box().unwrap();
        if u32::from_le_bytes(*memory[4 * NEWEST..].first_chunk().unwrap()) > 33 {
            break memory;
        }
    };
    let bytes = 327_456.0 * 31.5 / 32.0;
    let words = Inputs::read(&mut Cursor::new(memory)).unwrap().words;
    let (told, difference) = replayed(&words, robot::<P>()).unwrap();
    assert_eq!(difference, None, "{name}");
    let [first, last] = told.times.unwrap();
    let millis = last.since(first).get() as f64 / 1000.0;
    let [each, plain] = [bytes, 4.0 * words.len() as f64].map(|it| it / millis / motors as f64);
    println!(
        "{name}: {:.1} s, about {each:.1} bytes a motor and ms of {plain:.1}; {} ticks before the state is known",
        millis / 1000.0,
        told.unknown
    );
    // Each bus ticks once a millisecond; its motors are all known half a second after the begin.
    assert!(told.lost == 0 && told.unknown < 3 * 500, "{told:?}");
    millis / 1000.0
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_black_box_has_eight_seconds_of_the_teams_robot() {
    assert!(kept::<team::Robot>("team") > 8.0);
    assert!(kept::<omni::Robot>("omni") > 8.0);
    assert!(kept::<lift::Robot>("lift") > 8.0);
    assert!(kept::<swerve::Robot>("swerve") > 7.0);
    assert!(kept::<mixed::Robot>("mixed") > 1.5);
}

fn is_replayed<P: Simulated>(name: &str, buses: u64)
where
    P::Name: 'static,
    P::Own: 'static,
    P::Motors: 'static,
{
    let told = drive::<P>(name);
    // Each tick of each bus, but for those before the start.
    assert!(told.states >= buses * (seconds() * 1000 - 20), "{told:?}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_teams_robot_is_replayed_bit_for_bit() {
    is_replayed::<team::Robot>("team", 3);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_omni_base_and_a_lift_are_replayed_bit_for_bit() {
    is_replayed::<omni::Robot>("omni", 3);
    is_replayed::<lift::Robot>("lift", 2);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn swerve_and_motors_of_six_vendors_are_replayed_bit_for_bit() {
    is_replayed::<swerve::Robot>("swerve", 2);
    // Its line is interrupted by its buses.
    is_replayed::<mixed::Robot>("mixed", 3);
}

/// Whatever ends the program: what is in the memory after the restart is replayed up to the last tick before.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_crash_leaves_what_is_replayed_up_to_its_tick() {
    let file = program("team-firmware-black-box");
    let last = |emulation: &Emulation<'_>| {
        let memory = emulation.black_box().expect("something is kept");
        let inputs = Inputs::read(&mut Cursor::new(memory)).unwrap();
        let (told, difference) = replayed(&inputs.words, robot::<team::Robot>()).unwrap();
        assert_eq!(difference, None);
        told
    };
    // Its clock begins some milliseconds after power-on.
    let begins = {
        let mut emulation =
            Emulation::new(&file, robot::<team::Robot>(), &Setup::default()).unwrap();
        emulation.run(millis(500)).unwrap();
        Micros::from_millis(500) - last(&emulation).times.unwrap()[1]
    };
    println!("its clock begins at most {begins} after power-on");
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let at = 600_000 + random.below(200_000);
        let kind = ["panic", "hardfault", "hang"][random.index(3)];
        let fault = format!("{kind}@{}.{:06}s", at / 1_000_000, at % 1_000_000).parse().unwrap();
        let setup = Setup { seed, faults: vec![fault], ..Setup::default() };
        let mut emulation = Emulation::new(&file, robot::<team::Robot>(), &setup).unwrap();
        // The restarted robot runs, and is not armed twice: what was is kept.
        emulation.run(Nanos::new(at * 1000) + millis(200)).unwrap();
        assert_eq!(emulation.rig.machine.restarts.len(), 1, "{kind}");
        let told = last(&emulation);
        let [from, to] = told.times.unwrap();
        println!("{kind} at {at} us: from {from} to {to} us, {} states", told.states);
        // A tick has two halves: what is missing is less than one.
        let missing = Micros::new(at).since(to + begins);
        assert!(
            missing <= Micros::from_millis(1) && to + begins <= Micros::new(at + 1000),
            "{told:?}"
        );
        assert!(to.since(from) > Micros::from_millis(500) && told.states > 20, "{told:?}");
    }
}
