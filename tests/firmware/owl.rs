//! The firmware of `examples/owl` on both boards: a range finder, a switch, a voltage, a servo, absolute encoders, and a
//! remote whose channels are its own.

use owl::simulation::{LIFT_BOTTOM, START, WALL};
use owl::{Motors, Name, Ports, Robot, Shared};
use rc10_cli::run::emulation::Emulation;
use rc10_emu::{Board, Figures};
use rc10_motor::Names;

use super::{is_clean, keeps_its_period, log, millis, program, setup_on};

fn each_part_does_its_work(board: Board, file: &str) {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<Robot>(&shared, &mut motors).unwrap();
    let mut emulation = Emulation::new(&program(file), robot, &setup_on(board, &[])).unwrap();
    let turned =
        |emulation: &Emulation<'_>, name: Name| emulation.motors[name.index()].state().load_degrees;
    emulation.run(millis(250)).unwrap();
    assert_eq!(emulation.servos[0].pulse(), None, "before it is armed");
    // The shoulder rests 5 degrees below level, where its encoder says 355: armed, it stays there.
    emulation.run(millis(1000)).unwrap();
    assert!(turned(&emulation, Name::Shoulder).abs() < 1.0);
    assert!(turned(&emulation, Name::Elbow).abs() < 1.0);
    assert_eq!(emulation.servos[0].pulse(), Some(1000.0));
    emulation.run(millis(5800)).unwrap();
    // It grips, for there is air.
    assert_eq!(emulation.servos[0].pulse(), Some(2000.0));
    emulation.run(millis(8400)).unwrap();
    // 80 % of 15 rpm for a second.
    for name in [Name::Shoulder, Name::Elbow] {
        let moved = turned(&emulation, name);
        assert!((moved - 72.0).abs() < 4.0, "{name:?}: {moved} degrees from {START:?}");
    }
    let x = emulation.base().unwrap().pose().x;
    assert!(x > WALL - 1.0 && x < WALL - 0.3, "{x} m");
    // The middle of its range above the switch, which is 20 degrees above the stop.
    let height = turned(&emulation, Name::Lift) - LIFT_BOTTOM - 20.0;
    assert!((height - 855.0).abs() < 8.0, "{height} degrees");
    let figures = Figures::of(&emulation.rig);
    is_clean(&emulation.rig, &figures);
    keeps_its_period(&figures);
    let log = log(&mut emulation);
    assert!(log.lines().last().unwrap().contains("armed, 5 of 5 motors online"), "{log}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn each_part_does_its_work_on_the_h723zg() {
    each_part_does_its_work(Board::H723ZG, "owl-firmware");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn each_part_does_its_work_on_the_dm_mc02() {
    each_part_does_its_work(Board::DM_MC02, "owl-firmware-dm-mc02");
}
