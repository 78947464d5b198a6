//! A crystal that is dead, or another than the program's; a chip that is off, or another.

use rc10_cli::run::emulation::Setup;
use rc10_emu::peripherals::ResetCause;
use rc10_emu::{Board, Figures, Machine, Options, Rig};
use rc10_sim::{BusConfig, EscConfig, Model, Nanos, World};

use super::{commands, interop_on, is_zero, log, micros, millis, program, run, setup, setup_on};

/// The firmware runs all the same, at the same frequencies, and reports the cause; no motor gets torque.
fn starts_and_cannot_be_armed(setup: &Setup, soon: Nanos, words: &[&str]) {
    run(setup, |emulation| {
        emulation.run(millis(700)).unwrap();
        let rig = &emulation.rig;
        let clocks = rig.machine.soc().clocks();
        assert_eq!((clocks.core, clocks.fdcan), (480_000_000, 80_000_000));
        let first = (0..3).map(|bus| commands(rig, bus, Nanos::ZERO).next().unwrap().start).max();
        println!("first frames after {:.1} ms", micros(first.unwrap()) * 1e-3);
        assert!(first <= Some(soon), "{first:?}");
        for bus in 0..3 {
            let torque = commands(rig, bus, Nanos::ZERO).find(|entry| !is_zero(entry));
            assert!(torque.is_none(), "bus {}: {torque:?}", bus + 1);
        }
        assert!(rig.machine.restarts.is_empty(), "{:?}", rig.machine.restarts);
        let log = log(emulation);
        for said in words {
            assert!(log.contains(said), "{said} is not in:\n{log}");
        }
        // All motors are heard: the buses run at their rate.
        assert!(log.lines().last().unwrap().contains("11 of 11 motors online"), "{log}");
    });
}

const CANNOT: &str = "cannot be armed: the crystal does not work or is another";

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_dead_crystal_is_told() {
    for board in Board::ALL {
        let setup = setup_on(board, &["crystal-dead"]);
        starts_and_cannot_be_armed(&setup, millis(200), &["the crystal does not start", CANNOT]);
    }
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn another_crystal_is_told() {
    let cases = [
        (Board::H723ZG, 24_000_000, "24000 kHz", "960 kbit/s"),
        (Board::DM_MC02, 25_000_000, "25000 kHz", "1041 kbit/s"),
        (Board::DM_MC02, 8_000_000, "8000 kHz", "333 kbit/s"),
    ];
    for (board, hz, seen, rate) in cases {
        let setup = Setup { crystal: Some(hz), ..setup_on(board, &[]) };
        let seen = format!("the crystal has {seen}, within 1.5 %, and this program is for one of");
        let rate = format!("with it the buses would run at {rate}");
        starts_and_cannot_be_armed(&setup, millis(20), &[&seen, &rate, CANNOT]);
    }
}

/// HSI, which measures it, may be off by 1 %, and on a hot chip by more.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_right_crystal_is_right_whatever_measures_it() {
    for deviation in [-20_000, -10_000, 10_000, 20_000] {
        for (board, name) in
            [(Board::H723ZG, "team-firmware"), (Board::DM_MC02, "team-firmware-dm-mc02")]
        {
            let told =
                alone(name, Options { board, hsi_deviation_ppm: deviation, ..Options::default() });
            assert!(!told.contains("crystal"), "{name}, {deviation} ppm: {told}");
            assert!(told.contains("start"), "{told}");
        }
    }
    // By a chip at the end of its 1 %, another one is seen too.
    for deviation in [-10_000, 10_000] {
        let board = Board { crystal_hz: 24_000_000, ..Board::H723ZG };
        let told = alone(
            "team-firmware",
            Options { board, hsi_deviation_ppm: deviation, ..Options::default() },
        );
        assert!(told.contains("the crystal has 2"), "{deviation} ppm: {told}");
    }
}

/// HSI as it really is makes the same clocks when it stands in, in the crash and in the next start: the ESCs follow its
/// bits, which they would not at 1.2 % off.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_oscillator_that_stands_in_is_as_exact_as_it_was_measured() {
    for (deviation, said) in [(12_000, "HSI is +1.20 %"), (-12_000, "HSI is -1.20 %")] {
        let options = Options { hsi_deviation_ppm: deviation, ..Options::default() };
        let mut rig = rig_of("team-firmware", options);
        rig.run(millis(300)).unwrap();
        let struck = rig.machine.now();
        rig.machine.set_crystal(false);
        rig.run(millis(310)).unwrap();
        let restart = rig.machine.restarts[0].at;
        for bus in 0..3 {
            let coast = commands(&rig, bus, struck).filter(|entry| entry.end < restart);
            assert!(coast.count() > 0, "bus {}, {deviation} ppm", bus + 1);
        }
        rig.run(millis(600)).unwrap();
        let clocks = rig.machine.soc().clocks();
        let off = clocks.core.abs_diff(480_000_000) as f64 / 480.0;
        println!("HSI {deviation} ppm off: the core's clock {off:.1} ppm, without the crystal");
        assert!(off < 50.0, "{}", clocks.core);
        for bus in 0..3 {
            assert!(commands(&rig, bus, millis(500)).count() > 0, "bus {}", bus + 1);
        }
        let log: String = rig.machine.take_log().into_iter().map(|line| line.text + "\n").collect();
        assert!(log.matches(said).count() == 1 && log.contains(CANNOT), "{log}");
    }
}

/// Where TIM17 captures nothing, nothing is known, and nothing said against the crystal.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_crystal_that_cannot_be_measured_is_taken_as_it_is() {
    let told = alone("team-firmware", Options { silent: &["TIM17"], ..Options::default() });
    assert!(told.contains("the crystal could not be measured"), "{told}");
    assert!(!told.contains("cannot be armed"), "{told}");
}

/// What a program on a chip without motors says in its first 130 ms.
fn alone(name: &str, options: Options) -> String {
    said(name, options, |_| ())
}

fn said(name: &str, options: Options, prepare: impl FnOnce(&Machine)) -> String {
    let mut rig = rig_of(name, options);
    prepare(&rig.machine);
    rig.run(millis(130)).unwrap();
    let lines = rig.machine.take_log();
    lines.iter().map(|line| format!("{} {}\n", line.at, line.text)).collect()
}

/// A chip without motors, on three buses.
fn rig_of(name: &str, options: Options) -> Rig {
    let mut world = World::new(1);
    let buses: Vec<_> = (0..3).map(|_| world.add_bus(BusConfig::default())).collect();
    // One that acknowledges.
    for bus in &buses {
        bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    }
    let machine = Machine::with(&program(name), options).unwrap();
    Rig::new(machine, world, buses, vec![], vec![], &[]).unwrap()
}

/// A dip of the supply has a name, and power that comes has another one.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_dip_of_the_supply_is_told() {
    let mut rig = rig_of("team-firmware", Options::default());
    let mut said = |cause| {
        if let Some(cause) = cause {
            rig.machine.restart(cause);
        }
        let until = rig.machine.now() + millis(20);
        rig.run(until).unwrap();
        rig.machine.take_log().remove(0).text
    };
    let last = |said: String, words: &str| assert!(said.ends_with(words), "{said}");
    last(said(None), "start, power came");
    last(said(Some(ResetCause::BrownOut)), "the last run ended in a crash: Supply");
    last(said(Some(ResetCause::Pin)), "start");
    last(said(Some(ResetCause::PowerOn)), "start, power came");
}

/// Of another line of STM32H7, with the same peripherals: `DEV_ID` 0x450 is the STM32H743's (RM0433).
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn another_chip_is_told() {
    let of = |identity| {
        said("team-firmware", Options::default(), |machine| machine.soc().set_identity(identity))
    };
    let told = of(0x2003_6450);
    let words = "this chip is no STM32H723 but has DEV_ID 0x450: the robot cannot be armed";
    assert!(
        told.contains(words) && told.contains("cannot be armed: the program is for another chip"),
        "{told}"
    );
    // One that does not say: nothing is known.
    let told = of(0);
    assert!(!told.contains("DEV_ID") && !told.contains("cannot be armed"), "{told}");
}

/// Other people's programs do not measure it: there the chip says what its buses run at.
#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn a_program_that_does_not_measure_is_told_by_its_bit_rate() {
    let board = Board { crystal_hz: 24_000_000, ..Board::H723ZG };
    let options = Options { board, calibration_needed: false, ..Options::default() };
    let mut rig = interop_on(options, "superloop-embassy", &[]);
    rig.run(millis(100)).unwrap();
    let told: Vec<_> = rig.machine.reports.iter().map(|report| report.text.as_str()).collect();
    assert_eq!(told, ["FDCAN1 runs at 960 kbit/s, its bus at 1000 kbit/s"]);
    assert_eq!(Figures::of(&rig).buses[0].received, 0);
}

/// The tool says what does not fit, and a strict run fails.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_command_says_what_does_not_fit() {
    let said = |arguments: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_rc10"))
            .args(["emu", "--strict", "--seconds", "0.2"])
            .args(arguments)
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    let _ = setup(&[]);
    let file = |name: &str| {
        let firmware = std::env::var_os("RC10_FIRMWARE").unwrap();
        std::path::PathBuf::from(firmware).with_file_name(name).display().to_string()
    };
    let (code, text) = said(&[&file("team-firmware"), "--crystal", "24"]);
    let words = "the program is for a crystal of 25 MHz, the board's has 24: buses at 1000 kbit/s would run at 960 kbit/s";
    assert!(code == Some(3) && text.contains(words), "{code:?} {text}");
    let (code, text) = said(&[&file("team-firmware-dm-mc02"), "--board", "h723zg"]);
    let words = "the program is for dm-mc02 (STM32H723VG), the board is h723zg (STM32H723ZG)";
    assert!(code == Some(3) && text.contains(words), "{code:?} {text}");
}
