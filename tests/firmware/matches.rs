//! Matches in the DM-MC02's serial flash: they are there after a cut of power, and replayed.

use std::io::Cursor;

use rc10_cli::replay::{Inputs, Told, replayed};
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_emu::w25q64::W25Q64;
use rc10_emu::{Board, Figures};
use rc10_motor::record::pages::{ERASED, Head, PAGE, PAGES, Page};
use rc10_sim::remote::{Controls, Stick};
use rc10_sim::{Nanos, Random};

use super::replay::robot;
use super::{is_clean, log, millis, program, setup_on};

const PROGRAM: &str = "team-firmware-dm-mc02-black-box";

fn emulation(seed: u64, faults: &[&str]) -> Emulation<'static> {
    let setup = Setup { seed, ..setup_on(Board::DM_MC02, faults) };
    let mut emulation = Emulation::new(&program(PROGRAM), robot::<team::Robot>(), &setup).unwrap();
    emulation.forgets = true;
    emulation
}

/// The pages of a match as a PC has them in a file, read without the chip.
fn pages(memory: &W25Q64, round: u16) -> Vec<u8> {
    let mut pages = Vec::new();
    for place in 0..PAGES {
        let bytes = memory.bytes(place * 256, 256);
        let words = bytes.as_chunks().0;
        let page: Page = core::array::from_fn::<u32, PAGE, _>(|at| u32::from_le_bytes(words[at]));
        if let Some(head) = Head::of(&page, place).filter(|it| it.round == round) {
            pages.push((head.number, bytes));
        }
    }
    pages.sort();
    pages.into_iter().flat_map(|(_, bytes)| bytes).collect()
}

#[track_caller]
fn is_replayed(file: Vec<u8>) -> Told {
    let inputs = Inputs::read(&mut Cursor::new(file)).unwrap();
    let (told, difference) = replayed(&inputs.words, robot::<team::Robot>()).unwrap();
    assert_eq!((difference, told.lost), (None, 0));
    told
}

/// Of a match until the power is cut, at twenty times, all is there but some milliseconds, or what waited for an erase.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_match_is_kept_until_the_power_is_cut() {
    let mut missing = Vec::new();
    for seed in 0..20 {
        let at = 1_500_000 + Random::new(seed).below(1_500_000);
        let fault = format!("cut-power@{at}us..{}us", at + 50_000);
        let mut emulation = emulation(seed, &[&fault]);
        emulation.run(Nanos::new(at * 1000) + millis(100)).unwrap();
        let memory = emulation.rig.machine.parts.memory.clone().unwrap();
        let told = is_replayed(pages(&memory, 1));
        let [from, to] = told.times.unwrap().map(|it| it.get() as f64 / 1000.0);
        println!("cut at {:.1} ms: kept from {from:.1} to {to:.1} ms", at as f64 / 1000.0);
        assert!(from < 300.0 && told.states > 30, "{told:?}");
        missing.push(at as f64 / 1000.0 - to);
    }
    missing.sort_by(f64::total_cmp);
    let [usual, worst] = [missing[9], missing[19]];
    println!("what is missing before the cut: {usual:.1} ms of the half, {worst:.1} ms at worst");
    assert!(usual < 25.0 && worst < 2_100.0);
}

/// After a cut of power, and after a crash, the robot is armed again: that match is kept too, and nothing of the one before
/// goes. What a crash has left in RAM is between them, up to its last tick; also if the flash was erasing, which goes on.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_next_match_is_kept_behind_the_one_before() {
    for (fault, rounds) in
        [("cut-power@1.9s..1.95s", 2), ("panic@1.9s", 3), ("hang@1.53s", 3), ("hardfault@1.55s", 3)]
    {
        let mut emulation = emulation(1, &[fault]);
        emulation.run(millis(1_500)).unwrap();
        let figures = Figures::of(&emulation.rig);
        is_clean(&emulation.rig, &figures);
        let memory = emulation.rig.machine.parts.memory.clone().unwrap();
        let before = pages(&memory, 1);
        emulation.run(millis(2_000)).unwrap();
        let safe = emulation.operator().unwrap().safe();
        for (until, controls) in [(7_000, safe), (11_000, Controls::REST)] {
            emulation.operator().unwrap().hold(controls, None);
            emulation.run(millis(until)).unwrap();
        }
        let text = log(&mut emulation);
        assert!(text.contains("armed, 11 of 11 motors online"), "{text}");
        assert!(pages(&memory, 1).starts_with(&before), "{fault}");
        let told: Vec<_> = (1..=rounds).map(|round| is_replayed(pages(&memory, round))).collect();
        told.iter().for_each(|told| println!("{fault}: {:?}, {} states", told.times, told.states));
        assert!(told.iter().all(|told| told.states > 30));
        let last = |round: usize| told[round].times.unwrap()[1].get();
        assert!(last(told.len() - 1) > 3_000_000, "{told:?}");
        if rounds == 3 {
            assert!(last(1) >= last(0) && last(1) > 1_500_000, "{told:?}");
        }
        assert!(pages(&memory, rounds + 1).is_empty());
    }
}

/// What a minute of the team's robot takes: `RC10_REPLAY=60` runs for a minute.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_flash_has_minutes_of_the_teams_robot() {
    let seconds = super::replay::seconds().max(10);
    let mut emulation = emulation(1, &[]);
    // Armed all the time: the script's last stop would end the match.
    let safe = emulation.operator().unwrap().safe();
    for (until, controls) in [(300, safe), (600, Controls::REST)] {
        emulation.operator().unwrap().hold(controls, None);
        emulation.run(millis(until)).unwrap();
    }
    for at in 1..=seconds {
        emulation.operator().unwrap().hold(drives(at), None);
        emulation.run(millis(at * 1000)).unwrap();
        drop(emulation.take_frames());
    }
    let memory = emulation.rig.machine.parts.memory.clone().unwrap();
    let file = pages(&memory, 1);
    let bytes = file.len() as f64;
    let [from, to] = is_replayed(file).times.unwrap();
    let took = to.since(from).get() as f64 * 1e-6;
    let whole = f64::from(PAGES - 2 * ERASED) * 256.0 / bytes * took;
    println!(
        "{bytes} bytes in {took:.1} s, {:.2} a motor and ms: the flash has {whole:.0} s",
        bytes / took / 11_000.0
    );
    assert!(whole > 180.0, "{whole}");
}

/// Armed from the first second on; sticks that move.
fn drives(second: u64) -> Controls {
    let y = match second % 4 {
        0 => 0.5,
        1 => -0.4,
        2 => 0.8,
        _ => 0.0,
    };
    let left = Stick { x: 0.2, y };
    Controls { left, ..Controls::REST }
}
