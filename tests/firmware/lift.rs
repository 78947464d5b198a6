//! The firmware of `examples/lift`: two motors that find the bottom together, a hoist that finds its own by a
//! switch, and a feeder that finds its index.

use lift::table::{FEEDER, HEIGHTS, LIFT};
use lift::{Motors, Name, Ports, Shared, simulation};
use rc10_cli::Simulated as _;
use rc10_cli::recording::Recording;
use rc10_cli::run::emulation::Emulation;
use rc10_cli::{ContactPart, Robot};
use rc10_emu::Figures;
use rc10_motor::Names;
use rc10_time::Micros;

use super::{is_clean, keeps_its_period, log, program, setup};

/// Runs it for a time, in milliseconds.
fn record(length: u64, judge: impl FnOnce(&mut Emulation<'_>, Recording)) {
    record_on("lift-firmware", length, judge);
}

/// The same by a program, on the board that it is for.
fn record_on(name: &str, length: u64, judge: impl FnOnce(&mut Emulation<'_>, Recording)) {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<lift::Robot>(&shared, &mut motors).unwrap();
    let emulation = Emulation::new(&program(name), robot, &setup(&[])).unwrap();
    let (mut emulation, recording) = emulation.record(Micros::from_millis(length)).unwrap();
    judge(&mut emulation, recording);
}

/// As `cargo run --package lift -- emu` does it: its settings are those of all shipped robots.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn its_program_is_built_by_its_own_command() {
    let build = lift::Robot::description().firmware.unwrap();
    assert_eq!(
        std::fs::read(build(Default::default()).unwrap()).unwrap(),
        program("lift-firmware")
    );
}

/// True heights of the lift's shafts above their bottoms, degrees.
fn heights(emulation: &Emulation<'_>) -> [f64; 2] {
    LIFT.map(|name| {
        let degrees = emulation.motors[name.index()].state().load_degrees;
        // The right one is mounted the other way round.
        let up = if name == Name::LiftLeft { degrees } else { -degrees };
        up - simulation::bottom(name)
    })
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_finds_its_bottom() {
    record(1900, |emulation, recording| {
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
        keeps_its_period(&Figures::of(&emulation.rig));
        let heights = heights(emulation);
        assert!(heights.iter().all(|height| height.abs() < 0.2), "{heights:?}");
        // It was there, let go, and came back slowly.
        for name in LIFT {
            let rpm = recording.motors[name.index()].samples.iter().map(|sample| sample.rpm);
            let [least, most] = [f64::min, f64::max].map(|of| rpm.clone().fold(0.0, of));
            assert!(least < -25.0 && most > 25.0, "{name:?}: {least} to {most} rpm");
        }
        let log = log(emulation);
        assert!(log.lines().last().unwrap().contains("armed, 4 of 4 motors online"), "{log}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn then_it_goes_to_a_height_and_is_level() {
    record(3600, |emulation, _| {
        let middle = HEIGHTS[1].microdegrees() as f64 * 1e-6;
        let heights = heights(emulation);
        assert!(heights.iter().all(|height| (height - middle).abs() < 1.0), "{heights:?}");
        assert!((heights[0] - heights[1]).abs() < 0.5, "{heights:?}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn its_hoist_finds_its_bottom_by_a_pin() {
    for name in ["lift-firmware", "lift-firmware-dm-mc02"] {
        record_on(name, 2500, |emulation, recording| {
            is_clean(&emulation.rig, &Figures::of(&emulation.rig));
            let height =
                -emulation.motors[Name::Hoist.index()].state().load_degrees - simulation::HOIST[0];
            println!("{name}: {height:.2} degrees above its stop");
            // At the edge of its switch, where it came slowly.
            assert!((height - simulation::HOIST_SWITCH).abs() < 3.0, "{height}");
            let rpm = recording.motors[Name::Hoist.index()].samples.iter().map(|sample| sample.rpm);
            let [least, most] = [f64::min, f64::max].map(|of| rpm.clone().fold(0.0, of));
            assert!(least < -30.0 && most > 30.0, "{least} to {most} rpm");
        });
    }
}

/// Pieces that the feeder's shaft has fed since a pocket stood at the marker.
fn pieces(emulation: &Emulation<'_>) -> f64 {
    let turned = emulation.motors[Name::Feeder.index()].state().load_degrees;
    (turned - simulation::INDEX[1]) / 45.0
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn its_feeder_finds_its_index_by_a_pin_and_feeds_from_there() {
    let tolerance = f64::from(FEEDER.tolerance.get()) / 45.0;
    // The script feeds from 3.6 s on, and from 4.2 s. Each board has its own pin.
    let [ours, other] = ["lift-firmware", "lift-firmware-dm-mc02"];
    for (name, until, fed) in [(ours, 3500, 0.0), (ours, 4700, 2.0), (other, 4700, 2.0)] {
        record_on(name, until, |emulation, recording| {
            is_clean(&emulation.rig, &Figures::of(&emulation.rig));
            let pieces = pieces(emulation);
            println!("{name}: {pieces:.4} pieces");
            assert!((pieces - fed).abs() < tolerance, "{pieces} pieces after {until} ms");
            // Back to the marker, forth, and slowly back again.
            let samples = &recording.motors[Name::Feeder.index()].samples;
            let rpm = samples.iter().map(|sample| sample.rpm);
            let [least, most] = [f64::min, f64::max].map(|of| rpm.clone().fold(0.0, of));
            assert!(least < -15.0 && most > 15.0, "{least} to {most} rpm");
        });
    }
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn more_contacts_than_the_board_has_inputs_are_refused() {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let mut description = lift::Robot::description();
    description.contacts = vec![ContactPart::new(Name::Feeder, simulation::INDEX); 9];
    let buses = motors.start(&shared.switch).unwrap().buses;
    let robot = Robot::on(description, buses, [], &shared).parts([0, 9, 0, 0], |_| async {});
    let error = Emulation::new(&program("lift-firmware"), robot, &setup(&[])).err().unwrap();
    assert_eq!(error.to_string(), "h723zg has 8 inputs for switches, the robot 9 contacts");
}
