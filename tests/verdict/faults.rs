//! The expected effect of an injected fault is no problem; its absence is one.

use rc10_cli::recording::remote::Loss;
use rc10_cli::robot::remote::Lost;
use rc10_motor::Link;

use super::robots::{Which, run};
use super::{Micros, Recording, problems};

/// A sound run of the team's robot in which `fault` is said to have happened.
fn said(fault: &str) -> Recording {
    let mut recording = run(Which::Team, 1, Micros::from_millis(1500), None);
    recording.faults = vec![fault.parse().unwrap()];
    recording
}

/// A motor is lost between two times.
fn lose(recording: &mut Recording, label: &str, from: usize, until: usize) {
    let tracks = &mut recording.motors;
    let track = tracks.iter_mut().find(|track| track.motor.label == label).unwrap();
    for (at, sample) in (10..).step_by(10).zip(&mut track.samples) {
        if (from..until).contains(&at) {
            sample.link = Link::Lost;
        }
        sample.counters.lost += u32::from(at >= from);
    }
    let last = track.samples.last().unwrap();
    (track.last.link, track.last.counters.lost) = (last.link, last.counters.lost);
}

const ON_BUS_2: [&str; 3] = ["gimbal yaw", "gimbal pitch", "feeder"];

#[test]
fn a_cut_bus_must_be_lost_and_come_back() {
    for kind in ["cut", "short", "dominant", "power"] {
        let fault = format!("{kind}:2@0.3s..0.5s");
        let mut recording = said(&fault);
        let heard = problems(&recording);
        for label in ON_BUS_2 {
            let words = format!("{label}: is heard at 0.350 s, in spite of {kind}:2");
            assert!(heard.contains(&words), "{heard}");
        }
        ON_BUS_2.iter().for_each(|label| lose(&mut recording, label, 310, 540));
        assert_eq!(problems(&recording), "", "{fault}");
        lose(&mut recording, "feeder", 310, 1400);
        let words = format!("feeder: is not back 500 ms after the end of {kind}:2");
        assert_eq!(problems(&recording), words);
    }
}

#[test]
fn for_ever_is_for_ever_and_another_bus_is_no_excuse() {
    let mut recording = said("cut:2@0.3s");
    ON_BUS_2.iter().for_each(|label| lose(&mut recording, label, 310, 9999));
    assert_eq!(problems(&recording), "");
    lose(&mut recording, "wheel rear left", 400, 600);
    assert_eq!(problems(&recording), "wheel rear left: 1 × lost during the run");
    lose(&mut recording, "wheel rear left", 1400, 9999);
    assert!(problems(&recording).contains("wheel rear left: lost at the end"));
}

#[test]
fn load_and_noise_may_cost_frames_but_no_motor() {
    for fault in ["load:2@0.3s..0.5s", "noise:2@0.3s"] {
        let mut recording = said(fault);
        let feeder = recording.motors.iter_mut().find(|track| track.motor.label == "feeder");
        let feeder = feeder.unwrap();
        for (at, sample) in (10..).step_by(10).zip(&mut feeder.samples) {
            sample.overwritten = if at < 310 { 0 } else { 300 };
        }
        feeder.overwritten = 300;
        assert_eq!(problems(&recording), "", "{fault}");
        recording.faults.clear();
        let busy = "feeder: 300 feedback frames overwritten because the bus was busy";
        assert_eq!(problems(&recording), busy);
    }
}

/// One frame overwritten in ten seconds is no red box.
#[test]
fn below_a_thousandth_it_is_information() {
    let mut recording = run(Which::Team, 1, Micros::from_millis(1500), None);
    recording.motors[0].overwritten = 1;
    assert_eq!(problems(&recording), "");
    let figures = rc10_cli::show::figures::Figures::of(&recording);
    let told: Vec<_> = figures.problems.iter().map(ToString::to_string).collect();
    let words =
        "wheel front left: 1 feedback frames overwritten because the bus was busy (0.067 %)";
    assert!(told.iter().any(|told| told == words), "{told:?}");
    recording.motors[0].overwritten = 2;
    assert!(problems(&recording).starts_with("wheel front left: 2 feedback frames overwritten"));
}

#[test]
fn motors_that_go_on_without_a_remote_are_a_problem() {
    let mut recording = said("remote-lost@0.5s");
    let at = |millis| Some(Micros::from_millis(millis));
    let loss = Loss {
        lost: Lost { from: Micros::from_millis(500), until: None },
        last_frame: at(495),
        coasting: at(600),
        back: None,
        resumed: None,
        disarmed: at(1495),
    };
    let mut judged = |loss| {
        recording.remote.as_mut().unwrap().losses = vec![loss];
        problems(&recording)
    };
    assert_eq!(judged(loss), "");
    let late = "remote: lost: the motors coasted after 205.0 ms only";
    assert_eq!(judged(Loss { coasting: at(700), ..loss }), late);
    let never = "remote: lost at 0.500 s: the motors did not coast within 120 ms of the last good \
                 frame";
    assert_eq!(judged(Loss { coasting: None, disarmed: None, ..loss }), never);
    // Back before it had to be noticed.
    let back = Loss { coasting: None, disarmed: None, back: at(560), ..loss };
    assert_eq!(judged(back), "");
}
