//! The firmware of `tests/two-boards-uart`: two chips, their UARTs tied together.

use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_emu::Figures;
use two_boards_uart::leader::{Motors, Ports, Robot, Shared};

use super::two_boards_robot::{both_say, cut_in_phases, stop_behind, without_leader};
use super::{is_clean, keeps_its_period, millis, program, setup};

/// The leading board's chip, with that of the following one.
fn run(scenario: impl FnOnce(&mut Emulation<'_>)) {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let setup = Setup { partner: Some(program("two-boards-uart-follower")), ..setup(&[]) };
    scenario(&mut Emulation::new(&program("two-boards-uart-leader"), robot, &setup).unwrap());
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn two_chips_on_a_uart_drive_as_two_boards() {
    run(|emulation| {
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
        let armed = "armed, 1 of 1 motors online";
        let text = both_say(emulation, armed, armed);
        assert!(!text.contains("WARN"), "{text}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn behind_a_cut_uart_the_wheel_is_free_within_20_ms_in_50_phases() {
    run(|emulation| {
        let wire = emulation.partner.as_ref().unwrap().serials[0].clone();
        cut_in_phases(emulation, |cut| wire.set_cut(cut));
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn without_power_of_the_leading_chip_on_a_uart_the_wheel_is_free_within_20_ms() {
    without_leader(|scenario| run(scenario), 20, 301_003);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_stop_by_the_remote_is_at_the_wheel_over_a_uart_5_ms_behind_the_leading_board() {
    stop_behind(|scenario| run(scenario), millis(500), 50, 301_003);
}
