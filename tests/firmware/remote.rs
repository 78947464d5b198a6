//! A remote control and its radio link: its receiver's bytes reach the emulated pin, a DMA takes
//! them, and the robot does what the sticks say. Then the radio link breaks, or the wire is
//! disturbed.

use rc10_cli::recording::Recording;
use rc10_cli::recording::remote::Loss;
use rc10_cli::robot::remote::ReceiverWire;
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_emu::Figures;
use rc10_sim::{Nanos, UartFault};
use rc10_time::Micros;
use team::table::{BASE, LED_BRIGHTNESS, LEDS};

use crate::{give, is_clean, keeps_its_period, log, millis, run, setup};
use rc10_emu::strip::pictures;

/// Drives forward, loses the remote for a time, and goes on until `length`, in milliseconds.
fn lose(fault: &str, length: u64, judge: impl FnOnce(Loss, Recording, String)) {
    lose_with(&setup(&[fault]), length, judge);
}

fn lose_with(setup: &Setup, length: u64, judge: impl FnOnce(Loss, Recording, String)) {
    give(setup, |emulation| {
        let (mut emulation, recording) = emulation.record(Micros::from_millis(length)).unwrap();
        let figures = Figures::of(&emulation.rig);
        is_clean(&emulation.rig, &figures);
        let [loss] = recording.remote.as_ref().unwrap().losses[..] else { panic!("one loss") };
        let reaction = loss.reaction().unwrap();
        println!("{:?}: all coast {reaction} after the last good frame; {loss:?}", setup.faults);
        assert!(reaction <= Micros::from_millis(120), "{reaction}");
        assert!(reaction >= Micros::from_millis(75), "not by every hiccup: {reaction}");
        let driven = fastest(&recording, 0..600);
        assert!(driven > 100.0, "the robot drives before: {driven} rpm");
        judge(loss, recording, log(&mut emulation));
    });
}

/// The fastest wheel in some milliseconds, rpm.
fn fastest(recording: &Recording, millis: std::ops::Range<usize>) -> f64 {
    let wheels = BASE.wheels.map(|name| &recording.motors[name as usize].samples);
    let speeds = wheels.iter().flat_map(|samples| &samples[millis.start / 10..millis.end / 10]);
    speeds.map(|sample| sample.measured.abs()).fold(0.0, f64::max)
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_remote_that_comes_back_is_followed_again_without_a_jump() {
    is_lost_and_comes_back(&setup(&["remote-lost@0.6s..1s"]));
}

pub(super) fn is_lost_and_comes_back(setup: &Setup) {
    lose_with(setup, 1600, |loss, recording, log| {
        assert_eq!(loss.disarmed, None);
        let resumed = loss.resumed.unwrap().since(loss.back.unwrap());
        assert!(resumed <= Micros::from_millis(30), "{resumed}");
        let full = f64::from(BASE.full_stick.vx / BASE.geometry.wheels()[0].radius) * 30.0
            / std::f64::consts::PI;
        for name in BASE.wheels {
            for pair in recording.motors[name as usize].samples.windows(2) {
                let [before, after] = [&pair[0], &pair[1]].map(|sample| sample.measured);
                assert!((after - before).abs() <= 0.1 * full, "{name:?}: {before} to {after}");
            }
        }
        assert!(log.contains("suspended, 11 of 11 motors online, remote missing"), "{log}");
        assert!(log.lines().last().unwrap().contains("armed, 11 of 11"), "{log}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_remote_that_stays_away_disarms() {
    // It comes back after all: the switch has not been moved, and so nothing has armed.
    lose("remote-lost@0.6s..1.8s", 2100, |loss, recording, log| {
        let disarmed = loss.disarmed.unwrap().since(loss.last_frame.unwrap());
        assert!(disarmed >= Micros::from_millis(1000), "{disarmed}");
        assert!(disarmed <= Micros::from_millis(1030), "{disarmed}");
        assert_eq!(loss.resumed, None);
        // The base may still roll.
        let currents = BASE.wheels.map(|name| &recording.motors[name as usize].samples[170..]);
        assert!(
            currents.iter().all(|samples| samples.iter().all(|sample| sample.current.abs() < 0.01))
        );
        assert!(log.contains("disarmed, 11 of 11 motors online, no remote"), "{log}");
        assert!(log.lines().last().unwrap().contains("disarmed, 11 of 11"), "{log}");
    });
}

/// Behind every error on its wire the next frame arrives: the robot is never without its remote.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_disturbed_wire_costs_frames_and_not_the_remote() {
    run(&setup(&[]), |emulation| {
        emulation.run(millis(300)).unwrap();
        let faults = UartFault::ALL.into_iter().cycle().take(20);
        let mut count = 0;
        for (number, fault) in (0..).zip(faults) {
            wire(emulation).inject(fault);
            count += 1;
            // Never twice in one frame.
            emulation.run(millis(340 + 40 * number)).unwrap();
        }
        emulation.run(millis(1250)).unwrap();
        let figures = Figures::of(&emulation.rig);
        is_clean(&emulation.rig, &figures);
        let sent = emulation.remote.as_ref().unwrap().remote.sent();
        let log = log(emulation);
        let last = log.lines().last().unwrap();
        assert!(last.contains("armed, 11 of 11 motors online, remote: "), "{last}");
        assert!(!log.contains("missing") && !log.contains("suspended"), "{log}");
        // And one for the byte in the middle of which the UART began to listen, perhaps.
        let (_, told) = last.split_once("remote: ").unwrap();
        let (told, _) = told.split_once(" port errors").unwrap();
        let errors: u32 = told.rsplit(' ').next().unwrap().parse().unwrap();
        println!("{count} faults in {} frames, {errors} errors told", sent.frames);
        assert!((count..=count + 1).contains(&errors), "{last}");
    });
}

/// The LEDs at pin PF9 meanwhile.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_strip_shows_how_the_robot_is() {
    run(&setup(&["remote-lost@0.85s..1.3s"]), |emulation| {
        emulation.rig.machine.record_pin('F', 9).unwrap();
        let mut seen = Vec::new();
        // A picture every 100 ms; it takes 2 ms.
        for number in 0..16 {
            emulation.run(millis(60 + 100 * number)).unwrap();
            let edges = emulation.rig.machine.soc().take_edges('F', 9);
            seen.extend(pictures(&edges).unwrap());
        }
        is_clean(&emulation.rig, &Figures::of(&emulation.rig));
        assert!(seen.iter().all(|picture| picture.len() == LEDS));
        // The lit LEDs and their number: none of them brighter than the table says.
        let lit = |picture: &Vec<[u8; 3]>| {
            let on = picture.iter().filter(|led| **led != [0; 3]);
            let most = picture.iter().flatten().max().copied().unwrap();
            assert!(most <= LED_BRIGHTNESS);
            let colour = on.clone().next().map(|led| led.map(|channel| channel > 0));
            (on.count(), colour)
        };
        const MAGENTA: Option<[bool; 3]> = Some([true, false, true]);
        const BLUE: Option<[bool; 3]> = Some([false, false, true]);
        const GREEN: Option<[bool; 3]> = Some([false, true, false]);
        const AMBER: Option<[bool; 3]> = Some([true, true, false]);
        let mut shown: Vec<_> = seen.iter().map(lit).collect();
        shown.dedup();
        println!("{shown:?}");
        // No remote yet: points that run. Disarmed for a moment, armed; flashes while it is
        // suspended, and armed again.
        let colours: Vec<_> = shown.iter().filter_map(|(_, colour)| *colour).collect();
        let mut order: Vec<_> = colours.iter().copied().map(Some).collect();
        order.dedup();
        assert_eq!(order, [MAGENTA, BLUE, GREEN, AMBER, GREEN]);
    });
}

/// Errors in every byte's time, of one kind or of all, cost less than the frames in their place do.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_line_full_of_errors_costs_little() {
    let each = UartFault::ALL.map(|fault| vec![fault]);
    for faults in each.into_iter().chain([UartFault::ALL.to_vec()]) {
        run(&setup(&[]), |emulation| {
            emulation.run(millis(300)).unwrap();
            let before = Figures::of(&emulation.rig).instructions;
            // DR16's bytes take 110 us.
            for (number, fault) in (1..=4545).zip(faults.iter().cycle()) {
                wire(emulation).inject(*fault);
                emulation.run(millis(300) + Nanos::new(110_000 * number)).unwrap();
            }
            let figures = Figures::of(&emulation.rig);
            let spent = 2 * (figures.instructions - before);
            let log = log(emulation);
            println!("{faults:?} in every byte: {spent} instructions a second");
            assert!(spent <= crate::budgets::SECOND, "{spent}");
            assert!(log.contains("suspended, 11 of 11 motors online, remote missing"), "{log}");
            keeps_its_period(&figures);
            is_clean(&emulation.rig, &figures);
        });
    }
}

fn wire<'e>(emulation: &'e Emulation<'_>) -> &'e rc10_sim::Serial {
    match &emulation.remote.as_ref().unwrap().wire {
        ReceiverWire::Serial(wire) => wire,
        ReceiverWire::Pulses(_) => panic!("the robot's receiver speaks serially"),
    }
}
