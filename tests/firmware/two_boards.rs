//! The firmware of `examples/two-boards`: two chips on one wire.

use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_emu::Figures;
use rc10_emu::fault::ChipFault;
use rc10_sim::Nanos;
use rc10_sim::remote::{Controls, Stick, Switch};
use two_boards::gimbal::{Motors, Ports, Robot, Shared};
use two_boards::simulation::ARMED;

use super::{is_clean, is_zero, keeps_its_period, log, micros, millis, program, setup};

/// The gimbal's chip, with that of the chassis.
fn run<R>(faults: &[&str], scenario: impl FnOnce(&mut Emulation<'_>) -> R) -> R {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let setup = Setup { partner: Some(program("two-boards-chassis")), ..setup(faults) };
    scenario(&mut Emulation::new(&program("two-boards-gimbal"), robot, &setup).unwrap())
}

/// How long the wheels are commanded from now on, for at most 40 ms.
pub(super) fn driven(emulation: &mut Emulation<'_>) -> Nanos {
    let wheels = emulation.partner.as_ref().unwrap().wires[0].clone();
    let begin = emulation.rig.machine.now();
    let _ = wheels.take_trace();
    emulation.run(begin + millis(40)).unwrap();
    let frames = wheels.take_trace();
    let mut commands = frames.iter().rev().filter(|entry| entry.from_controller);
    commands.find(|entry| !is_zero(entry)).map_or(Nanos::ZERO, |entry| entry.end.since(begin))
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn two_chips_drive_as_two_boards() {
    run(&["load:2@0.3s..2.5s"], |emulation| {
        emulation.run(millis(2200)).unwrap();
        let mut figures = Figures::of(&emulation.rig);
        is_clean(&emulation.rig, &figures);
        // On the other one it sends when there is something to tell.
        figures.buses.truncate(1);
        keeps_its_period(&figures);
        let load = emulation.rig.buses[1].load() * 2.2 / 1.9;
        assert!(load > 99.0, "{load}");
        // As in simulation: 0.9 m/s for a second.
        let pose = emulation.partner.as_ref().unwrap().base.as_ref().unwrap().pose();
        assert!((pose.x - 0.9).abs() < 0.05 && pose.y.abs() < 0.05, "{pose:?}");
        let other = emulation.rig.partner.as_mut().unwrap();
        assert!(other.reports.is_empty() && other.restarts.is_empty(), "{:?}", other.reports);
        let text: String = other.take_log().iter().map(|line| line.text.clone() + "\n").collect();
        assert!(text.contains("armed, 4 of 4 motors online"), "{text}");
        let text = log(emulation);
        assert!(text.contains("armed, 1 of 1 motors online"), "{text}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn behind_a_cut_wire_the_wheels_are_free_within_20_ms_in_50_phases() {
    let mut longest = Nanos::ZERO;
    run(&[], |emulation| {
        emulation.run(millis(500)).unwrap();
        let wire = emulation.partner.as_ref().unwrap().wires[1].clone();
        for phase in 0..50 {
            let now = emulation.rig.machine.now();
            let forward = Controls { left: Stick { x: 0.0, y: 0.5 }, ..ARMED };
            emulation.operator().unwrap().hold(forward, None);
            emulation.run(now + millis(100) + Nanos::new(101_003 * phase)).unwrap();
            wire.set_cut(true);
            let time = driven(emulation);
            longest = longest.max(time);
            wire.set_cut(false);
            assert!(time > Nanos::ZERO, "it drove, in phase {phase}");
        }
    });
    println!("behind a cut wire the wheels are commanded for {:.1} us", micros(longest));
    assert!(longest > millis(10) && longest <= millis(20), "{longest}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn without_power_of_the_leading_chip_the_wheels_are_free_within_20_ms() {
    let mut longest = Nanos::ZERO;
    for phase in 0..50 {
        run(&[], |emulation| {
            emulation.run(millis(450) + Nanos::new(101_003 * phase)).unwrap();
            let fault = if phase % 2 == 0 { ChipFault::CutPower } else { ChipFault::Mask };
            emulation.rig.machine.inject(&fault, true).unwrap();
            let time = driven(emulation);
            assert!(time > Nanos::ZERO, "it drove, in phase {phase}");
            longest = longest.max(time);
        });
    }
    println!("without the leading chip the wheels are commanded for {:.1} us", micros(longest));
    assert!(longest <= millis(20), "{longest}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_stop_by_the_remote_is_at_the_wheels_5_ms_behind_the_gimbal() {
    let mut longest = Nanos::ZERO;
    for phase in 0..10 {
        run(&[], |emulation| {
            emulation.run(millis(800) + Nanos::new(1_301_003 * phase)).unwrap();
            let begin = emulation.rig.machine.now();
            let wheels = emulation.partner.as_ref().unwrap().wires[0].clone();
            let stop = Controls { left_switch: Switch::Down, ..ARMED };
            emulation.operator().unwrap().hold(stop, None);
            let _ = wheels.take_trace();
            emulation.run(begin + millis(100)).unwrap();
            let of_wheels = wheels.take_trace();
            let last = |entries: &[rc10_sim::TraceEntry]| {
                let mut of_chip = entries.iter().rev().filter(|entry| entry.from_controller);
                of_chip.find(|entry| !is_zero(entry)).unwrap().end
            };
            let (wheels, gimbal) = (last(&of_wheels), last(&emulation.rig.logs[0]));
            assert!(wheels < begin + millis(60), "it stopped");
            longest = longest.max(wheels.since(gimbal));
        });
    }
    println!("the wheels are commanded for {:.1} us behind the gimbal", micros(longest));
    assert!(longest <= millis(5), "{longest}");
}
