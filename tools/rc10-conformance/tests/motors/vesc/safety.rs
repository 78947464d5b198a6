//! Cut wires, lost power, muted and missing reports, faults, expiry, emergency stop.

use rc10_app::{Amps, Rpm};
use rc10_motor::{Condition, DriveMode, Link, Request, Response, Target};
use rc10_sim::EscFault;
use rc10_sim::vesc::Mode;

use super::*;

const PUSH: Target = Target::Current(Amps::new(30.0));

fn mode(esc: &Esc) -> Mode {
    inside(esc, |vesc| vesc.mode())
}

#[test]
fn a_cut_wire_lets_both_sides_go() {
    armed(|bench, motor, esc| {
        bench.hold(motor, PUSH, 100).unwrap();
        bench.wire.set_cut(true);
        bench.hold(motor, PUSH, 20).unwrap();
        let status = bench.status(motor);
        assert_eq!((status.link, status.drive), (Link::Lost, DriveMode::Coast));
        // The VESC goes on until its own timeout, which cannot be shortened from here.
        assert_eq!(mode(esc), Mode::Current(30.0));
        bench.hold(motor, PUSH, 200).unwrap();
        assert_eq!(mode(esc), Mode::Released);
        // The questions are not answered: it is not known to be there.
        bench.hold(motor, PUSH, 2000).unwrap();
        assert_eq!(bench.status(motor).condition, Condition::Ready);
        bench.wire.set_cut(false);
        // No old torque waits in a buffer; and what comes, comes softly.
        let mut steepest: f64 = 0.0;
        for _ in 0..60 {
            let before = esc.state().current;
            bench.hold(motor, PUSH, 1).unwrap();
            steepest = steepest.max(esc.state().current - before);
        }
        assert!(steepest < 0.3 * 30.0, "{steepest} A in a millisecond");
        assert_eq!(mode(esc), Mode::Current(30.0));
        assert_eq!(bench.status(motor).link, Link::Online);
    });
}

/// A field that locks at once pulls the rotor up to half its turn with all its current.
#[test]
fn a_field_locks_softly() {
    let target = Target::Handbrake(Amps::new(20.0));
    for relative_to in [None, Some(Amps::new(40.0))] {
        for before in [Target::Coast, Target::Current(Amps::new(2.0))] {
            let ours = Vesc::new(Config { relative_to, ..config(1) }).unwrap();
            on_bench(ours, device(1), Safety::COAST, |bench, motor, esc, switch| {
                switch.arm().unwrap();
                bench.hold(motor, before, 250).unwrap();
                let (mut last, mut steepest) = (0.0, 0.0_f64);
                for _ in 0..40 {
                    bench.hold(motor, target, 1).unwrap();
                    if let Mode::Handbrake(amps) = mode(esc) {
                        steepest = steepest.max(amps - last);
                        last = amps;
                    }
                }
                assert_eq!(last, 20.0);
                assert!(steepest <= 0.3 * 20.0, "{relative_to:?}: {steepest} A in a millisecond");
            });
        }
    }
}

#[test]
fn a_vesc_that_only_fell_silent_lost_no_count() {
    armed(|bench, motor, esc| {
        let turn = Target::Speed(Rpm::new(2000.0));
        bench.hold(motor, turn, 1500).unwrap();
        esc.set_feedback(false);
        bench.hold(motor, turn, 100).unwrap();
        let status = bench.status(motor);
        assert_eq!((status.link, status.drive), (Link::Lost, DriveMode::Coast));
        assert_eq!(mode(esc), Mode::Released);
        esc.set_feedback(true);
        bench.hold(motor, turn, 50).unwrap();
        let status = bench.status(motor);
        assert_eq!((status.link, status.drive), (Link::Online, DriveMode::Run));
        assert_eq!(status.feedback.turn_gaps, 1);
        let told = f64::from(status.feedback.total_angle.degrees().get());
        assert!((told - esc.state().output_degrees).abs() < 120.0, "{told}");
    });
}

/// Status frames are off from the factory: that is not a cut wire, and is said.
#[test]
fn a_vesc_whose_reports_are_off_is_told_from_one_that_is_not_there() {
    let mut theirs = device(1);
    theirs.status_hz = [0; 6];
    let ours = Vesc::new(config(1)).unwrap();
    on_bench(ours, theirs, Safety::COAST, |bench, motor, esc, switch| {
        switch.arm().unwrap();
        bench.hold(motor, PUSH, 1000).unwrap();
        let status = bench.status(motor);
        assert_eq!((status.link, status.drive), (Link::NeverSeen, DriveMode::Coast));
        assert_eq!(status.condition, Condition::NoReports);
        assert_eq!(mode(esc), Mode::Released);
        let now = bench.world.now();
        inside(esc, |vesc| vesc.set_status_hz([200, 0, 0, 0, 200, 0], now));
        bench.hold(motor, PUSH, 200).unwrap();
        assert_eq!(bench.status(motor).condition, Condition::Ready);
        assert_eq!(mode(esc), Mode::Current(30.0));
        // Switched off again, and then gone. What it answered before its reports does not count.
        inside(esc, |vesc| vesc.set_status_hz([0; 6], now));
        bench.wait(50);
        assert_eq!(bench.status(motor).condition, Condition::Ready);
        bench.wait(1000);
        assert_eq!(bench.status(motor).condition, Condition::NoReports);
        esc.set_power(false);
        bench.wait(1500);
        assert_eq!(bench.status(motor).condition, Condition::Ready);
        assert_eq!(bench.status(motor).link, Link::Lost);
    });
}

#[test]
fn reports_that_come_too_seldom_are_said_so() {
    // As the wiring says, or as it turns out.
    for (declared, comes, condition) in [
        (200, 200, Condition::Ready),
        (50, 50, Condition::SlowFeedback),
        (100, 300, Condition::SlowFeedback),
        (200, 100, Condition::SlowFeedback),
        (500, 300, Condition::Ready),
    ] {
        let (mut ours, mut theirs) = (config(1), device(1));
        (ours.status.status_1, theirs.status_hz[0]) = (declared, comes);
        ours.status.status_4 = 0;
        (ours.status.status_5, theirs.status_hz[4]) = (declared.min(50), 50);
        theirs.status_hz[3] = 0;
        on_bench(Vesc::new(ours).unwrap(), theirs, Safety::COAST, |bench, motor, _, switch| {
            switch.arm().unwrap();
            bench.hold(motor, Target::Duty(0.1), 1000).unwrap();
            assert_eq!(bench.status(motor).condition, condition, "{declared} {comes}");
        });
    }
}

/// No frame tells a fault; that the VESC does nothing can be seen.
#[test]
fn a_faulted_vesc_is_seen_not_to_follow() {
    for fault in [
        EscFault::OverTemperature,
        EscFault::OverCurrent,
        EscFault::OverVoltage,
        EscFault::UnderVoltage,
        EscFault::Encoder,
    ] {
        for target in [
            PUSH,
            Target::Duty(0.3),
            Target::Speed(Rpm::new(1500.0)),
            Target::Handbrake(Amps::new(5.0)),
        ] {
            armed(|bench, motor, esc| {
                bench.hold(motor, target, 700).unwrap();
                assert_eq!(bench.status(motor).condition, Condition::Ready, "{target:?}");
                assert!(esc.inject(fault));
                assert_eq!(inside(esc, |vesc| vesc.fault), Some(fault));
                bench.hold(motor, target, 4000).unwrap();
                assert!(esc.state().current.abs() < 1e-9);
                let status = bench.status(motor);
                assert_eq!(status.condition, Condition::NotFollowing, "{target:?}");
                assert_eq!(status.fault, None);
                let hot = status.feedback.controller_temperature().unwrap().get();
                assert_eq!(hot > 100.0, fault == EscFault::OverTemperature);
                // There is nothing to clear from here.
                assert_eq!(bench.bus.request(motor, Request::ClearFault), Ok(Response::Done));
                esc.set_power(false);
                bench.hold(motor, target, 100).unwrap();
                esc.set_power(true);
                bench.hold(motor, target, 300).unwrap();
                assert_eq!(bench.status(motor).condition, Condition::Ready);
            });
        }
    }
    armed(|_, _, esc| assert!(!esc.inject(EscFault::CommunicationLost)));
}

#[test]
fn a_motor_that_follows_is_never_said_not_to() {
    armed(|bench, motor, _| {
        for target in [
            Target::Duty(0.9),
            Target::Duty(-0.9),
            Target::Current(Amps::new(2.0)),
            Target::Current(Amps::new(-2.0)),
            Target::Speed(Rpm::new(5000.0)),
            Target::Speed(Rpm::new(-300.0)),
            Target::Brake(Amps::new(20.0)),
            Target::Coast,
            Target::Current(Amps::ZERO),
            Target::Current(Amps::new(4.0)),
        ] {
            for _ in 0..3000 {
                bench.hold(motor, target, 1).unwrap();
                assert_eq!(bench.status(motor).condition, Condition::Ready, "{target:?}");
            }
        }
    });
}

/// Somebody else may turn the shaft just as fast: then it needs no current.
#[test]
fn a_motor_that_needs_no_current_is_not_said_to_miss_its_target() {
    armed(|bench, motor, esc| {
        let (duty, speed) = (Target::Duty(0.5), Target::Speed(Rpm::new(3000.0)));
        for (target, radians) in [(duty, 339.0), (speed, 314.0)] {
            bench.hold(motor, target, 6000).unwrap();
            esc.set_load(0.02 + 5e-5 * radians);
            bench.hold(motor, target, 6000).unwrap();
            for _ in 0..3000 {
                bench.hold(motor, target, 1).unwrap();
                assert!(esc.state().current.abs() < 0.05, "{}", esc.state().current);
                assert_eq!(bench.status(motor).condition, Condition::Ready, "{target:?}");
            }
        }
    });
}

#[test]
fn each_safe_state_is_its_own_command() {
    for (safety, safe) in [
        (Safety::COAST, Mode::Released),
        (Safety::BRAKE, Mode::Brake(15.0)),
        (Safety::HOLD, Mode::Handbrake(20.0)),
    ] {
        let ours = Vesc::new(config(1)).unwrap();
        // So heavy that it hardly moves.
        let mut theirs = device(1);
        theirs.plant.load_inertia = 0.1;
        on_bench(ours, theirs, safety, |bench, motor, esc, switch| {
            bench.hold(motor, PUSH, 100).unwrap();
            assert_eq!(mode(esc), Mode::Released, "not armed");
            switch.arm().unwrap();
            bench.hold(motor, PUSH, 30).unwrap();
            assert_eq!(mode(esc), Mode::Current(30.0));
            // The command expires. A field locks softly.
            bench.wait(80);
            assert_eq!(mode(esc), safe);
            assert_eq!(bench.status(motor).counters.expired, 1);
            bench.hold(motor, PUSH, 30).unwrap();
            switch.emergency_stop();
            bench.hold(motor, PUSH, 30).unwrap();
            assert_eq!(mode(esc), safe);
            switch.reset();
            bench.hold(motor, PUSH, 10).unwrap();
            assert_eq!(mode(esc), Mode::Released);
        });
    }
}
