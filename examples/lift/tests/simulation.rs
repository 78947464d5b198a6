//! The robot in simulation: it finds its bottom, does not tilt, and counts what it feeds.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "simulation/bench.rs"]
mod bench;
#[path = "simulation/hoisting.rs"]
mod hoisting;
#[path = "simulation/indexing.rs"]
mod indexing;

use bench::{ARMED, Bench, DISARMED, FEED, HIGHEST, LOWEST, MIDDLE, STOPPED, Stage, armed, moved};
use lift::Name;
use lift::table::{FEEDER, HEIGHTS, LIFT, RANGE};
use rc10::sim::simulator::Scale;

fn height(number: usize) -> f64 {
    HEIGHTS[number].microdegrees() as f64 * 1e-6
}

fn is_at(bench: &Bench<'_>, height: f64) -> bool {
    bench.heights().iter().all(|at| (at - height).abs() < 1.0)
}

/// To the middle and to the top, down by the stick, to the bottom.
fn ride(bench: &mut Bench<'_>) {
    for (hands, height) in [(MIDDLE, height(1)), (HIGHEST, height(2))] {
        bench.hands(hands, 50);
        bench.hands(ARMED, 100);
        bench.until(4, |bench| is_at(bench, height));
        bench.run(200);
    }
    bench.hands(moved(-0.5), 1000);
    bench.hands(ARMED, 300);
    bench.hands(LOWEST, 50);
    bench.hands(ARMED, 100);
    bench.until(6, |bench| is_at(bench, height(0)));
    bench.run(200);
}

#[test]
fn it_finds_its_bottom_from_wherever_it_begins() {
    let (mut worst, mut longest, mut tilt) = (0.0_f64, 0, 0.0_f64);
    for seed in 1..=5 {
        for heights in [[0.0, 0.0], [3.0, 0.0], [25.0, 45.0], [300.0, 280.0], [1090.0, 1095.0]] {
            armed(seed, heights, |bench| {
                bench.forget();
                let took = bench.until(20, |bench| bench.stage() == Stage::Ready);
                bench.hands(MIDDLE, 50);
                bench.until(4, |bench| is_at(bench, height(1)));
                bench.run(200);
                let errors = [0, 1].map(|motor| bench.believed()[motor] - bench.heights()[motor]);
                worst = errors.iter().fold(worst, |worst, error| worst.max(error.abs()));
                longest = longest.max(took);
                tilt = tilt.max(bench.tilt - (heights[0] - heights[1]).abs());
                assert_eq!(bench.blamed(), None);
            });
        }
    }
    // The play of the gearbox is 0.3 degrees: on the stop its shaft is at one end, with the weight on it
    // at the other.
    println!("bottom within {worst:.4} degrees, {longest} ms, tilted {tilt:.2} degrees more");
    assert!(worst < 0.4, "{worst}");
    assert!(tilt < 3.0, "{tilt}");
}

#[test]
fn it_follows_its_profile_and_stays_level_whatever_it_weighs() {
    let (mut rms, mut tilt) = (0.0_f64, 0.0_f64);
    let off = [0.7, 1.3];
    for inertia in off {
        for weight in off {
            for friction in off {
                for is_opposite in [false, true] {
                    let of = |motor: usize| {
                        let turned = |factor| {
                            if is_opposite && motor == 1 { 2.0 - factor } else { factor }
                        };
                        [inertia, weight, friction].map(turned)
                    };
                    armed(1, [60.0, 45.0], |bench| {
                        for (motor, name) in LIFT.into_iter().enumerate() {
                            let [inertia, weight, friction] = of(motor);
                            let esc = bench.motor(name);
                            let by = Scale { inertia, friction, ..Scale::default() };
                            esc.set_plant(esc.plant().scaled(by));
                            bench.set_weight(motor, weight);
                        }
                        bench.home();
                        bench.forget();
                        ride(bench);
                        rms = rms.max(bench.rms());
                        tilt = tilt.max(bench.tilt);
                    });
                }
            }
        }
    }
    println!("{rms:.2} degrees RMS, tilt {tilt:.2} degrees");
    assert!(rms < 2.0, "{rms}");
    assert!(tilt < 5.0, "{tilt}");
}

#[test]
fn a_weak_motor_does_not_tilt_it() {
    let (mut rms, mut tilt) = (0.0_f64, 0.0_f64);
    for weak in LIFT {
        armed(1, [60.0, 45.0], |bench| {
            let esc = bench.motor(weak);
            esc.set_plant(esc.plant().scaled(Scale { torque_constant: 0.7, ..Scale::default() }));
            bench.home();
            bench.forget();
            ride(bench);
            rms = rms.max(bench.rms());
            tilt = tilt.max(bench.tilt);
        });
    }
    println!("{rms:.2} degrees RMS, tilt {tilt:.2} degrees");
    assert!(rms < 2.0, "{rms}");
    assert!(tilt < 5.0, "{tilt}");
}

#[test]
fn a_blocked_motor_stops_it_and_is_named() {
    let (mut tilt, mut longest) = (0.0_f64, 0);
    for blocked in 0..2 {
        for (hands, from) in [(HIGHEST, height(1)), (LOWEST, height(1))] {
            for later in [30, 150, 600] {
                armed(1, [30.0, 20.0], |bench| {
                    bench.home();
                    bench.hands(MIDDLE, 50);
                    bench.until(4, |bench| is_at(bench, from));
                    bench.hands(hands, 50 + later);
                    let at = bench.heights()[blocked];
                    bench.set_travel(blocked, Some([at, at]));
                    bench.forget();
                    longest = longest.max(bench.until(1, |bench| bench.stage() == Stage::Failed));
                    assert_eq!(bench.blamed(), Some(blocked));
                    // It stands and stays, whatever the operator does.
                    bench.hands(HIGHEST, 500);
                    let stands = bench.heights();
                    bench.hands(LOWEST, 500);
                    for (now, before) in bench.heights().into_iter().zip(stands) {
                        assert!((now - before).abs() < 1.0, "{stands:?} {:?}", bench.heights());
                    }
                    tilt = tilt.max(bench.tilt);
                    // Free again, it is armed again, and finds its bottom again.
                    bench.set_travel(blocked, Some([0.0, lift::simulation::TRAVEL]));
                    bench.hands(DISARMED, 100);
                    bench.hands(ARMED, 90);
                    assert_eq!(bench.stage(), Stage::Homing);
                    bench.home();
                    ride(bench);
                });
            }
        }
    }
    println!("tilt {tilt:.2} degrees, known after {longest} ms");
    assert!(tilt < 30.0, "{tilt}");
}

#[test]
fn one_that_is_blocked_on_the_way_to_the_bottom_is_named_too() {
    for blocked in 0..2 {
        armed(1, [300.0, 300.0], |bench| {
            bench.run(300);
            let at = bench.heights()[blocked];
            bench.set_travel(blocked, Some([at, at]));
            bench.until(2, |bench| bench.stage() == Stage::Failed);
            assert_eq!(bench.blamed(), Some(blocked));
            bench.run(500);
            println!("tilt {:.2} degrees", bench.tilt);
            assert!(bench.tilt < 40.0, "{}", bench.tilt);
        });
    }
}

#[test]
fn without_its_remote_it_hangs_where_it_is() {
    armed(1, [30.0, 20.0], |bench| {
        bench.home();
        bench.forget();
        bench.hands(HIGHEST, 50);
        bench.hands(ARMED, 950);
        let remote = bench.around.remote.as_ref().unwrap().remote.clone();
        remote.set_transmitter(false);
        bench.run(500);
        let hangs = bench.heights();
        bench.run(200);
        let fell = [0, 1].map(|motor| hangs[motor] - bench.heights()[motor]);
        assert!(fell.iter().all(|way| way.abs() < 1.0), "{fell:?}");
        remote.set_transmitter(true);
        bench.run(500);
        // It still knows its bottom, and stays until it is told where to go.
        assert_eq!(bench.stage(), Stage::Ready);
        assert!(is_at(bench, hangs[0]), "{hangs:?} {:?}", bench.heights());
        assert!(bench.tilt < 5.0, "{}", bench.tilt);
        ride(bench);
    });
}

#[test]
fn stopped_it_hangs_and_armed_again_it_knows_its_bottom() {
    armed(1, [30.0, 20.0], |bench| {
        bench.home();
        bench.hands(MIDDLE, 50);
        bench.hands(ARMED, 600);
        bench.hands(STOPPED, 500);
        let hangs = bench.heights();
        bench.hands(STOPPED, 500);
        assert!(is_at(bench, hangs[0]), "{hangs:?} {:?}", bench.heights());
        // Disarmed it sinks, and its turns are counted.
        bench.hands(DISARMED, 200);
        bench.hands(ARMED, 90);
        assert_eq!(bench.stage(), Stage::Ready);
        bench.forget();
        ride(bench);
        assert!(bench.rms() < 5.0 && bench.tilt < 5.0, "{} {}", bench.rms(), bench.tilt);
        let errors = [0, 1].map(|motor| bench.believed()[motor] - bench.heights()[motor]);
        assert!(errors.iter().all(|error| error.abs() < 0.4), "{errors:?}");
    });
}

#[test]
fn a_motor_without_power_stops_it_and_it_finds_its_bottom_again() {
    for (lost, name) in LIFT.into_iter().enumerate() {
        armed(1, [30.0, 20.0], |bench| {
            bench.home();
            bench.hands(MIDDLE, 50);
            bench.hands(ARMED, 600);
            bench.motor(name).set_power(false);
            bench.until(1, |bench| bench.stage() == Stage::Failed);
            assert_eq!(bench.blamed(), Some(lost));
            bench.hands(DISARMED, 1000);
            bench.motor(name).set_power(true);
            bench.hands(DISARMED, 200);
            bench.hands(ARMED, 90);
            assert_eq!(bench.stage(), Stage::Homing);
            bench.home();
            ride(bench);
        });
        // While it is disarmed: its turns were estimated.
        armed(1, [30.0, 20.0], |bench| {
            bench.home();
            bench.hands(DISARMED, 100);
            bench.motor(name).set_power(false);
            bench.run(1000);
            bench.motor(name).set_power(true);
            bench.run(200);
            bench.hands(ARMED, 90);
            assert_eq!(bench.stage(), Stage::Homing);
        });
    }
}

#[test]
fn the_stick_does_not_drive_it_beyond_its_range() {
    armed(1, [30.0, 20.0], |bench| {
        bench.home();
        let top = RANGE.upper.microdegrees() as f64 * 1e-6;
        for (share, end) in [(1.0, top), (-1.0, 0.0)] {
            bench.hands(moved(share), 4000);
            let heights = bench.heights();
            assert!(heights.iter().all(|at| (at - end).abs() < 0.5), "{heights:?}");
        }
    });
}

/// Feeds this number of pieces, one at a time.
fn feed(bench: &mut Bench<'_>, pieces: u32) {
    for _ in 0..pieces {
        bench.hands(FEED, 50);
        bench.hands(ARMED, 50);
    }
}

#[test]
fn ten_pieces_are_ten_pieces_with_a_jam_in_between() {
    for seed in 1..=5 {
        for jammed_at in [120.0, 135.5, 160.0, 449.0] {
            armed(seed, [30.0, 20.0], |bench| {
                bench.index();
                let began = bench.turned();
                // It cannot pass, until it has gone back.
                let at = began + jammed_at;
                bench.motor(Name::Feeder).set_travel(Some([-1e6, at]));
                feed(bench, 10);
                let is_jammed = |bench: &Bench<'_>| bench.jams() > 0;
                if jammed_at < 448.0 {
                    bench.until(6, is_jammed);
                    bench.until(1, |bench| bench.turned() < at - 10.0);
                    bench.motor(Name::Feeder).set_travel(None);
                }
                bench.run(4000);
                let pieces = (bench.turned() - began) / 45.0;
                let tolerance = f64::from(FEEDER.tolerance.get()) / 45.0;
                assert_eq!(bench.fed(), 10);
                assert!((pieces - 10.0).abs() < tolerance, "{pieces} by its shaft");
                assert_eq!(bench.jams() > 0, jammed_at < 448.0);
            });
        }
    }
}

#[test]
fn a_jam_that_does_not_clear_is_given_up_and_the_lift_goes_on() {
    armed(1, [30.0, 20.0], |bench| {
        bench.home();
        bench.index();
        let at = bench.turned() + 100.0;
        bench.motor(Name::Feeder).set_travel(Some([-1e6, at]));
        feed(bench, 3);
        bench.run(5000);
        // The first, and one for each try.
        let jams = u64::from(FEEDER.jam.tries) + 1;
        assert_eq!((bench.fed(), bench.jams()), (2, jams));
        ride(bench);
        // Armed again it finishes the third, and feeds what it is asked for from then on.
        bench.motor(Name::Feeder).set_travel(None);
        bench.hands(DISARMED, 100);
        bench.hands(ARMED, 500);
        feed(bench, 1);
        bench.run(1000);
        assert_eq!(bench.fed(), 4);
    });
}
