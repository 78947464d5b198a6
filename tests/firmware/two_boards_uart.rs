//! The firmware of `tests/two-boards-uart`: two chips, their UARTs tied together.

use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_emu::Figures;
use rc10_emu::fault::ChipFault;
use rc10_sim::Nanos;
use rc10_sim::remote::{Controls, Stick, Switch};
use two_boards_uart::leader::{Motors, Ports, Robot, Shared};
use two_boards_uart::simulation::ARMED;

use super::two_boards_robot::driven;
use super::{is_clean, is_zero, keeps_its_period, log, micros, millis, program, setup};

/// The leading board's chip, with that of the following one.
fn run<R>(faults: &[&str], scenario: impl FnOnce(&mut Emulation<'_>) -> R) -> R {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let setup = Setup { partner: Some(program("two-boards-uart-follower")), ..setup(faults) };
    scenario(&mut Emulation::new(&program("two-boards-uart-leader"), robot, &setup).unwrap())
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn two_chips_on_a_uart_drive_as_two_boards() {
    run(&[], |emulation| {
        emulation.run(millis(2200)).unwrap();
        let figures = Figures::of(&emulation.rig);
        is_clean(&emulation.rig, &figures);
        keeps_its_period(&figures);
        let around = emulation.partner.as_ref().unwrap();
        let speed = around.motors[0].state().output_rpm;
        assert!((speed - 60.0).abs() < 3.0, "{speed}");
        let counters = around.serials[0].counters();
        println!("{counters:?}");
        assert_eq!((counters.overrun, counters.unheard), (0, 0));
        let other = emulation.rig.partner.as_mut().unwrap();
        assert!(other.reports.is_empty() && other.restarts.is_empty(), "{:?}", other.reports);
        let text: String = other.take_log().iter().map(|line| line.text.clone() + "\n").collect();
        assert!(text.contains("armed, 1 of 1 motors online"), "{text}");
        assert!(!text.contains("WARN"), "{text}");
        let text = log(emulation);
        assert!(text.contains("armed, 1 of 1 motors online"), "{text}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn behind_a_cut_uart_the_wheel_is_free_within_20_ms_in_50_phases() {
    let mut longest = Nanos::ZERO;
    run(&[], |emulation| {
        emulation.run(millis(500)).unwrap();
        let wire = emulation.partner.as_ref().unwrap().serials[0].clone();
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
    println!("behind a cut UART the wheel is commanded for {:.1} us", micros(longest));
    assert!(longest > millis(10) && longest <= millis(20), "{longest}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn without_power_of_the_leading_chip_on_a_uart_the_wheel_is_free_within_20_ms() {
    let mut longest = Nanos::ZERO;
    for phase in 0..20 {
        run(&[], |emulation| {
            emulation.run(millis(450) + Nanos::new(301_003 * phase)).unwrap();
            let fault = if phase % 2 == 0 { ChipFault::CutPower } else { ChipFault::Mask };
            emulation.rig.machine.inject(&fault, true).unwrap();
            let time = driven(emulation);
            assert!(time > Nanos::ZERO, "it drove, in phase {phase}");
            longest = longest.max(time);
        });
    }
    println!("without the leading chip the wheel is commanded for {:.1} us", micros(longest));
    assert!(longest <= millis(20), "{longest}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_stop_by_the_remote_is_at_the_wheel_over_a_uart_5_ms_behind_the_leading_board() {
    let mut longest = Nanos::ZERO;
    for phase in 0..50 {
        run(&[], |emulation| {
            emulation.run(millis(500) + Nanos::new(301_003 * phase)).unwrap();
            let begin = emulation.rig.machine.now();
            let wheel = emulation.partner.as_ref().unwrap().wires[0].clone();
            let stop = Controls { left_switch: Switch::Down, ..ARMED };
            emulation.operator().unwrap().hold(stop, None);
            let _ = wheel.take_trace();
            emulation.run(begin + millis(100)).unwrap();
            let of_wheel = wheel.take_trace();
            let last = |entries: &[rc10_sim::TraceEntry]| {
                let mut of_chip = entries.iter().rev().filter(|entry| entry.from_controller);
                of_chip.find(|entry| !is_zero(entry)).unwrap().end
            };
            let (wheel, own) = (last(&of_wheel), last(&emulation.rig.logs[0]));
            assert!(wheel < begin + millis(60), "it stopped");
            longest = longest.max(wheel.since(own));
        });
    }
    println!(
        "the wheel is commanded for {:.1} us behind the leading board's motor",
        micros(longest)
    );
    assert!(longest <= millis(5), "{longest}");
}
