//! The firmware of `examples/two-boards`: two chips on one wire.

use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_emu::Figures;
use rc10_emu::fault::ChipFault;
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_sim::{Nanos, TraceEntry};
use two_boards::gimbal::{Motors, Ports, Robot, Shared};
use two_boards::simulation::ARMED;

use super::{is_clean, is_zero, keeps_its_period, log, micros, millis, program, setup};

/// What is done with both chips; each run has new ones.
type Scenario<'a> = &'a mut dyn FnMut(&mut Emulation<'_>);

/// The gimbal's chip, with that of the chassis.
fn run(faults: &[&str], scenario: impl FnOnce(&mut Emulation<'_>)) {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let setup = Setup { partner: Some(program("two-boards-chassis")), ..setup(faults) };
    scenario(&mut Emulation::new(&program("two-boards-gimbal"), robot, &setup).unwrap());
}

/// How long the wheels are commanded from now on, for at most 40 ms.
fn driven(emulation: &mut Emulation<'_>) -> Nanos {
    let wheels = emulation.partner.as_ref().unwrap().wires[0].clone();
    let begin = emulation.rig.machine.now();
    let _ = wheels.take_trace();
    emulation.run(begin + millis(40)).unwrap();
    last_command(&wheels.take_trace()).map_or(Nanos::ZERO, |end| end.since(begin))
}

/// The end of the chip's last frame that asks for torque.
fn last_command(frames: &[TraceEntry]) -> Option<Nanos> {
    let mut of_chip = frames.iter().rev().filter(|entry| entry.from_controller);
    of_chip.find(|entry| !is_zero(entry)).map(|entry| entry.end)
}

/// Neither chip has complained or restarted; their logs say this, of the other one and of this one.
pub(super) fn both_say(emulation: &mut Emulation<'_>, others: &str, own: &str) -> String {
    let other = emulation.rig.partner.as_mut().unwrap();
    assert!(other.reports.is_empty() && other.restarts.is_empty(), "{:?}", other.reports);
    let told: String = other.take_log().iter().map(|line| line.text.clone() + "\n").collect();
    assert!(told.contains(others), "{told}");
    let text = log(emulation);
    assert!(text.contains(own), "{text}");
    told
}

/// Driving forward, both are cut apart in 50 phases and joined again.
pub(super) fn cut_in_phases(emulation: &mut Emulation<'_>, set_cut: impl Fn(bool)) {
    let mut longest = Nanos::ZERO;
    emulation.run(millis(500)).unwrap();
    for phase in 0..50 {
        let now = emulation.rig.machine.now();
        let forward = Controls { left: Stick { x: 0.0, y: 0.5 }, ..ARMED };
        emulation.operator().unwrap().hold(forward, None);
        emulation.run(now + millis(100) + Nanos::new(101_003 * phase)).unwrap();
        set_cut(true);
        let time = driven(emulation);
        longest = longest.max(time);
        set_cut(false);
        assert!(time > Nanos::ZERO, "it drove, in phase {phase}");
    }
    println!("behind a cut the wheels are commanded for {:.1} us", micros(longest));
    assert!(longest > millis(10) && longest <= millis(20), "{longest}");
}

/// The leading chip has no power, or is masked, in phases so many nanoseconds apart.
pub(super) fn without_leader(run: impl Fn(Scenario<'_>), phases: u64, step: u64) {
    let mut longest = Nanos::ZERO;
    for phase in 0..phases {
        run(&mut |emulation| {
            emulation.run(millis(450) + Nanos::new(step * phase)).unwrap();
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

/// The remote stops both, at times so many nanoseconds apart.
pub(super) fn stop_behind(run: impl Fn(Scenario<'_>), begin: Nanos, phases: u64, step: u64) {
    let mut longest = Nanos::ZERO;
    for phase in 0..phases {
        run(&mut |emulation| {
            let begin = begin + Nanos::new(step * phase);
            emulation.run(begin).unwrap();
            let wheels = emulation.partner.as_ref().unwrap().wires[0].clone();
            let stop = Controls { left_switch: Switch::Down, ..ARMED };
            emulation.operator().unwrap().hold(stop, None);
            let _ = wheels.take_trace();
            emulation.run(begin + millis(100)).unwrap();
            let [wheels, leader] = [&wheels.take_trace(), &emulation.rig.logs[0]]
                .map(|frames| last_command(frames).unwrap());
            assert!(wheels < begin + millis(60), "it stopped");
            longest = longest.max(wheels.since(leader));
        });
    }
    println!("the wheels are commanded for {:.1} us behind the leading chip's", micros(longest));
    assert!(longest <= millis(5), "{longest}");
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
        both_say(emulation, "armed, 4 of 4 motors online", "armed, 1 of 1 motors online");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn behind_a_cut_wire_the_wheels_are_free_within_20_ms_in_50_phases() {
    run(&[], |emulation| {
        let wire = emulation.partner.as_ref().unwrap().wires[1].clone();
        cut_in_phases(emulation, |cut| wire.set_cut(cut));
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn without_power_of_the_leading_chip_the_wheels_are_free_within_20_ms() {
    without_leader(|scenario| run(&[], scenario), 50, 101_003);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_stop_by_the_remote_is_at_the_wheels_5_ms_behind_the_gimbal() {
    stop_behind(|scenario| run(&[], scenario), millis(800), 10, 1_301_003);
}
