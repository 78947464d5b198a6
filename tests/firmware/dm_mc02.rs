//! The firmware for the DM-MC02, on that board: what `docs/dm-mc02.md` promises of it.

use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_emu::parts::Thermal;
use rc10_emu::peripherals::{ResetCause, Width};
use rc10_emu::strip::pictures;
use rc10_emu::{Board, Figures};
use rc10_sim::Nanos;

use super::live::Watched;
use super::{
    crashes_safely_on, is_clean, keeps_its_period, log, millis, omni_robot, remote, run, setup_on,
};

const BOARD: Board = Board::DM_MC02;

fn on_board<R>(faults: &[&str], scenario: impl FnOnce(&mut Emulation<'_>) -> R) -> R {
    run(&setup_on(BOARD, faults), scenario)
}

/// Boots, is armed by its remote, drives, and keeps the period of every bus while it reads its IMU a thousand times a
/// second.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_drives_by_its_own_imu() {
    let setup = Setup {
        console: Some(<team::Robot as rc10_tasks::Program>::CONSOLE),
        ..setup_on(BOARD, &[])
    };
    run(&setup, |emulation| {
        let mut pc = Watched::new(emulation);
        let (heading, _) = pc.client.signals().find(|(_, it)| it.label == "heading").unwrap();
        pc.client.watch(0, 2, [heading].into_iter());
        // The gyroscope is selected once for every sample.
        pc.emulation.rig.machine.watch_pin('C', 3).unwrap();
        let (mut worst, mut turned) = (0.0_f64, 0.0_f64);
        // It spins from 3.8 s on.
        for _ in 0..82 {
            pc.run(50);
            let Some(sample) = pc.samples.last() else { continue };
            let told = f64::from(sample.values[0].1);
            let yaw = pc.emulation.base().unwrap().pose().yaw.to_degrees();
            worst = worst.max((told - yaw).abs());
            turned = turned.max(yaw.abs());
        }
        println!("heading at most {worst:.2} degrees off, after {turned:.1} degrees");
        assert!(turned > 90.0, "the robot turned by {turned} degrees only");
        assert!(worst < 2.0, "{worst} degrees");
        let samples = emulation.rig.machine.take_pin_time('C', 3).unwrap().rises;
        println!("{samples} samples in 4.1 s");
        assert!((4095..=4101).contains(&samples), "{samples}");
        let figures = Figures::of(&emulation.rig);
        keeps_its_period(&figures);
        is_clean(&emulation.rig, &figures);
        let log = log(emulation);
        let last = log.lines().last().unwrap();
        assert!(last.contains("armed, 11 of 11 motors online, 24.0 V; bus 1"), "{last}");
    });
}

/// One that does not answer is told, and costs the buses nothing; when it is back, it is read as often as before and no
/// more.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_imu_that_does_not_answer_is_told() {
    on_board(&[], |emulation| {
        emulation.rig.machine.parts.imu.as_ref().unwrap().with(|imu| imu.gyroscope.id = 0);
        emulation.run(millis(800)).unwrap();
        let figures = Figures::of(&emulation.rig);
        keeps_its_period(&figures);
        is_clean(&emulation.rig, &figures);
        let text = log(emulation);
        let words = "armed, 11 of 11 motors online, IMU does not answer, 24.0 V, IMU: ";
        assert!(text.lines().last().unwrap().contains(words), "{text}");
        emulation.rig.machine.parts.imu.as_ref().unwrap().with(|imu| imu.gyroscope.id = 0x0F);
        // It is set up, and then selected once a millisecond: none of those missed is made up for.
        emulation.run(millis(1000)).unwrap();
        emulation.rig.machine.watch_pin('C', 3).unwrap();
        let _ = emulation.rig.machine.take_pin_time('C', 3);
        emulation.run(millis(1210)).unwrap();
        let samples = emulation.rig.machine.take_pin_time('C', 3).unwrap().rises;
        assert!((209..=211).contains(&samples), "{samples} samples in 210 ms");
        assert!(!log(emulation).lines().last().unwrap().contains("does not answer"));
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_bus_that_is_cut_comes_back() {
    on_board(&["cut:1@0.25s..0.45s"], |emulation| {
        emulation.run(millis(900)).unwrap();
        keeps_its_period(&Figures::of(&emulation.rig));
        let log = log(emulation);
        assert!(log.contains("armed, 7 of 11 motors online"), "{log}");
        assert!(log.lines().last().unwrap().contains("armed, 11 of 11 motors online"), "{log}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn crashes_make_every_bus_safe() {
    let (soft, watchdog) = (ResetCause::Software, ResetCause::Watchdog);
    crashes_safely_on(BOARD, "panic@0.4s", millis(2), soft, &["ended in a crash: Panic"]);
    crashes_safely_on(BOARD, "hardfault@0.4s", millis(2), soft, &["ended in a crash: Fault"]);
    crashes_safely_on(BOARD, "hang@0.4s", millis(10), watchdog, &["ended in a crash: Watchdog"]);
    let stopped = ["ended in a crash: CrystalStopped", "the crystal does not start"];
    crashes_safely_on(BOARD, "crystal-stops@0.4s", millis(2), soft, &stopped);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_remote_that_is_lost_stops_it() {
    remote::is_lost_and_comes_back(&setup_on(BOARD, &["remote-lost@0.6s..1s"]));
}

/// Off until everything else runs, on then, 100 ms after each other, 5 V first; off while the chip restarts.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn outputs_come_on_last() {
    on_board(&["panic@0.4s"], |emulation| {
        let pins = [('C', 14, millis(100)), ('C', 13, millis(200))];
        for (port, pin) in [('C', 14), ('C', 13), ('C', 15)] {
            emulation.rig.machine.record_pin(port, pin).unwrap();
        }
        emulation.run(millis(700)).unwrap();
        // The program says that the switched 5 V stay off.
        assert!(emulation.rig.machine.soc().take_edges('C', 15).is_empty());
        let struck = emulation.rig.machine.struck.unwrap();
        let restart = emulation.rig.machine.restarts[0].at;
        for (port, pin, later) in pins {
            let edges = emulation.rig.machine.soc().take_edges(port, pin);
            let [on, off, again] = edges[..] else { panic!("P{port}{pin}: {edges:?}") };
            assert!(on.high && !off.high && again.high, "{edges:?}");
            for log in &emulation.rig.logs {
                let first = log.iter().find(|entry| entry.from_controller).unwrap();
                assert!(on.at > first.start, "on after {}, before a bus", on.at);
            }
            assert_eq!(off.at, restart, "struck at {struck}");
            let without = again.at.since(off.at);
            println!("P{port}{pin}: on after {}, off for {without} in a restart", on.at);
            assert!(on.at >= later && on.at < later + millis(10), "{}", on.at);
            assert!(without < later + millis(20), "{without}");
        }
        // Its pins alone are no reason to say anything.
        assert!(emulation.rig.machine.reports.is_empty(), "{:?}", emulation.rig.machine.reports);
    });
}

/// The share of time, in thousandths, for which the heater was on in each of these hundreds of milliseconds.
fn heated(emulation: &mut Emulation<'_>, tenths: u64) -> Vec<f64> {
    let begin = emulation.rig.machine.now();
    (1..=tenths)
        .map(|tenth| {
            let _ = emulation.rig.machine.take_pin_time('B', 1);
            emulation.run(begin + millis(100 * tenth)).unwrap();
            emulation.rig.machine.take_pin_time('B', 1).unwrap().share() * 1000.0
        })
        .collect()
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_heater_keeps_its_bounds() {
    on_board(&[], |emulation| {
        // A die that gets warm a hundred times as fast as a real one.
        let thermal = Thermal { ambient: 30.0, kelvin_per_watt: 12.0, time_constant: 0.3 };
        emulation.rig.machine.parts.thermal = thermal;
        emulation.rig.machine.watch_pin('B', 1).unwrap();
        let shares = heated(emulation, 30);
        let most = shares.iter().copied().fold(0.0, f64::max);
        println!("heater: {shares:.0?}");
        // Nothing before the supply and the IMU are known; a quarter at most; less as it gets warm.
        assert!(shares[0] < 1.0 && most > 200.0 && most <= 250.5, "{shares:?}");
        assert!(shares.iter().skip(10).any(|share| *share < 50.0), "{shares:?}");
        // 30 V: less than a quarter, by the bound of the power.
        emulation.rig.machine.parts.imu.as_ref().unwrap().with(|imu| imu.celsius = 20.0);
        let cold = Thermal { ambient: 10.0, kelvin_per_watt: 0.1, time_constant: 0.3 };
        emulation.rig.machine.parts.thermal = cold;
        emulation.rig.machine.set_supply(30_000).unwrap();
        let shares = heated(emulation, 16);
        println!("heater at 30 V: {shares:.0?}");
        assert!((170.0..=178.0).contains(shares.last().unwrap()), "{shares:?}");
        // No supply, or one that cannot be: off.
        emulation.rig.machine.set_supply(5_000).unwrap();
        let shares = heated(emulation, 3);
        assert!(shares.last().unwrap() < &0.1, "{shares:?}");
        emulation.rig.machine.set_supply(24_000).unwrap();
        assert!(heated(emulation, 3).last().unwrap() > &200.0);
        // The IMU falls silent: off within 0.7 s.
        emulation.rig.machine.parts.imu.as_ref().unwrap().with(|imu| imu.accelerometer.id = 0);
        let shares = heated(emulation, 8);
        println!("heater without IMU: {shares:.0?}");
        assert!(shares[7] < 0.1, "{shares:?}");
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
    });
}

/// The heater is off without it, and it is told again when the ADC works again.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_adc_that_fails_is_no_voltage() {
    on_board(&[], |emulation| {
        emulation.rig.machine.watch_pin('B', 1).unwrap();
        emulation.run(millis(400)).unwrap();
        assert!(log(emulation).lines().last().unwrap().contains("online, 24.0 V;"));
        emulation.rig.machine.set_adc_fails(true);
        let shares = heated(emulation, 8);
        println!("heater without a voltage: {shares:.0?}");
        assert!(shares[0] > 200.0 && shares[7] < 0.1, "{shares:?}");
        assert!(log(emulation).lines().last().unwrap().contains("armed, 11 of 11 motors online;"));
        emulation.rig.machine.set_adc_fails(false);
        let shares = heated(emulation, 4);
        assert!(shares[3] > 200.0, "{shares:?}");
        assert!(log(emulation).lines().last().unwrap().contains("online, 24.0 V;"));
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
    });
}

/// A calibration may take longer than most do: it is waited for, and not begun again.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_adc_that_calibrates_slowly_is_waited_for() {
    const ADC1_CR: u32 = 0x4002_2008;
    on_board(&[], |emulation| {
        emulation.rig.machine.set_adc_fails(true);
        emulation.run(millis(20)).unwrap();
        emulation.rig.machine.set_adc_fails(false);
        emulation.run(millis(30)).unwrap();
        let machine = &emulation.rig.machine;
        let control = machine.soc().read(ADC1_CR, Width::Word, machine.now()).unwrap();
        assert_eq!(control & 1, 1, "ADEN, CR is {control:#x}");
    });
}

/// What a peripheral does not do costs that, and not the robot: on a chip, or an emulator, on which these say nothing.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_drives_without_what_is_no_motor() {
    on_board(&[], |emulation| {
        for name in ["TIM17", "ADC1", "SPI2", "TIM3", "TIM8", "TIM12"] {
            assert!(emulation.rig.machine.soc().silence(name), "{name}");
        }
        emulation.run(millis(900)).unwrap();
        keeps_its_period(&Figures::of(&emulation.rig));
        assert!(emulation.rig.machine.restarts.is_empty());
        let log = log(emulation);
        assert!(log.contains("the crystal could not be measured"), "{log}");
        let last = log.lines().last().unwrap();
        assert!(last.contains("armed, 11 of 11 motors online, IMU does not"), "{last}");
    });
}

/// The pads of PC2 and PC3 are connected by the program, whatever they are after a reset.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_closes_the_switches_of_its_imu() {
    on_board(&[], |emulation| {
        emulation.rig.machine.soc().set_switches_closed(false, Nanos::ZERO);
        emulation.run(millis(400)).unwrap();
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
        let log = log(emulation);
        assert!(log.lines().last().unwrap().contains("online, 24.0 V;"), "{log}");
    });
}

/// In a hang it goes on as it was, until the watchdog restarts the chip.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_hang_does_not_heat_more() {
    on_board(&["mask@0.5s"], |emulation| {
        emulation.rig.machine.watch_pin('B', 1).unwrap();
        let shares = heated(emulation, 8);
        println!("heater, hung at 0.5 s: {shares:.0?}");
        assert!(shares[4] > 200.0 && shares.iter().all(|share| *share <= 250.5), "{shares:?}");
        assert_eq!(emulation.rig.machine.restarts.len(), 1);
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_buzzer_is_never_held_high() {
    on_board(&["panic@0.4s"], |emulation| {
        emulation.rig.machine.watch_pin('B', 15).unwrap();
        let mut beeps = Vec::new();
        for step in 1..=100_u64 {
            let _ = emulation.rig.machine.take_pin_time('B', 15);
            emulation.run(millis(10 * step)).unwrap();
            let time = emulation.rig.machine.take_pin_time('B', 15).unwrap();
            // Half of a period of 4 kHz.
            assert!(time.longest_high <= Nanos::new(126_000), "{time:?}");
            beeps.push(time.share() > 0.4);
        }
        beeps.dedup();
        // One at the start; three after the crash.
        let count = beeps.iter().filter(|beep| **beep).count();
        assert_eq!(count, 4, "{beeps:?}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_lamp_shows_the_state() {
    on_board(&[], |emulation| {
        emulation.rig.machine.record_pin('A', 7).unwrap();
        let mut colours = Vec::new();
        for number in 0..28 {
            if number == 6 {
                emulation.rig.machine.set_supply(20_000).unwrap();
            }
            emulation.run(millis(60 + 100 * number)).unwrap();
            let edges = emulation.rig.machine.soc().take_edges('A', 7);
            for picture in pictures(&edges).unwrap() {
                assert_eq!(picture.len(), 1);
                assert!(picture[0].iter().all(|channel| *channel <= 24), "{picture:?}");
                if picture[0] != [0; 3] {
                    colours.push(picture[0].map(|channel| channel > 0));
                }
            }
        }
        colours.dedup();
        // No remote for a moment, disarmed, armed, and then the battery is nearly empty.
        let [magenta, blue, green, yellow] =
            [[true, false, true], [false, false, true], [false, true, false], [true, true, false]];
        assert_eq!(colours, [magenta, blue, green, yellow]);
        assert!(log(emulation).contains("20.0 V (low)"));
    });
}

/// A motor that has not been heard yet is not missing while its ESC starts, and is after 3 s.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_motor_that_starts_slowly_is_no_fault_at_first() {
    // Never any power for those of bus 2.
    on_board(&["power:2@0s..9s"], |emulation| {
        emulation.rig.machine.record_pin('A', 7).unwrap();
        let mut white_at = None;
        // It flashes in the first half of every second second.
        for tenth in 1..=43 {
            emulation.run(millis(100 * tenth)).unwrap();
            let edges = emulation.rig.machine.soc().take_edges('A', 7);
            let is_white = |picture: &Vec<[u8; 3]>| picture[0].iter().all(|channel| *channel > 0);
            if white_at.is_none() && pictures(&edges).unwrap().iter().any(is_white) {
                white_at = Some(tenth);
            }
        }
        let white_at = white_at.expect("it shows the fault");
        println!("the lamp shows a motor that was never heard after {white_at}00 ms");
        assert!((31..=43).contains(&white_at), "{white_at}");
        assert!(log(emulation).contains("8 of 11 motors online"));
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_key_stops() {
    on_board(&[], |emulation| {
        emulation.run(millis(400)).unwrap();
        emulation.rig.machine.press_key(true).unwrap();
        emulation.run(millis(420)).unwrap();
        emulation.rig.machine.press_key(false).unwrap();
        emulation.run(millis(700)).unwrap();
        let log = log(emulation);
        assert!(log.lines().any(|line| line.contains(" armed, 11 of 11")), "{log}");
        assert!(log.lines().last().unwrap().contains("emergency stop"), "{log}");
    });
}

/// The omni robot, by the same ten lines as on the team's board.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_omni_robot_drives_on_it() {
    omni_robot::drives("omni-firmware-dm-mc02", BOARD);
}
