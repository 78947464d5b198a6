//! Two weeks without a power cycle: the robot drives across each kind of moment at which a counter of time
//! begins again.

use std::collections::BTreeSet;

use rc10_can::Micros;
use rc10_motor::{ArmState, Link, Names};
use rc10_robot::table::Name;

use super::{DRIVE, Receiver, Scene, millis, scene_at};

const WEEKS: u64 = 14 * 86_400_000_000;

/// The first two moments, and the last one within two weeks, at which counters begin again: of 31 and 32
/// bits of microseconds, and of 16, 24 and 30 bits of milliseconds; and one between.
fn moments() -> BTreeSet<u64> {
    let steps = [1 << 31, 1 << 32, 1000 << 16, 1000 << 24, 1000 << 30];
    let moments = steps.into_iter().flat_map(|step| [1, 2, WEEKS / step].map(|times| times * step));
    moments.filter(|at| (1..=WEEKS).contains(at)).chain([WEEKS]).collect()
}

fn is_sound(scene: &Scene<'_>, at: u64) {
    for name in Name::ALL {
        let status = scene.shared.motor(*name).status();
        let counters = status.counters;
        let bad = (counters.lost, counters.malformed, counters.expired, status.feedback.turn_gaps);
        assert_eq!((status.link, bad), (Link::Online, (0, 0, 0, 0)), "{name:?} at {at}");
    }
    for bus in &scene.shared.ports.buses {
        let status = bus.status();
        assert_eq!((status.overruns, status.health.stalls), (0, 0), "at {at}");
        assert!(status.period.max().unwrap() <= 1000, "at {at}: {:?}", status.period);
    }
}

#[test]
fn it_drives_and_loses_its_remote_across_every_wrap() {
    for at in moments() {
        scene_at(
            Micros::new(at - 1_200_000),
            Receiver::Dr16,
            3,
            |_| (),
            |mut scene| {
                scene.run(millis(100));
                scene.arm_by_hand();
                scene.hands(DRIVE);
                for _ in 0..150 {
                    scene.run(millis(10));
                    assert_eq!(scene.arm(), ArmState::Armed, "at {at}");
                }
                // 0.6 s behind the moment.
                assert!(
                    scene.rpm(Name::FrontLeft) > 100.0,
                    "at {at}: {}",
                    scene.rpm(Name::FrontLeft)
                );
                assert!(scene.shared.heading.read().unwrap().value.total(scene.now()).is_some());
                is_sound(&scene, at);
            },
        );
        // The moment lies between the last frame and the coasting.
        scene_at(
            Micros::new(at - 1_200_000),
            Receiver::Dr16,
            4,
            |_| (),
            |mut scene| {
                scene.run(millis(100));
                scene.arm_by_hand();
                scene.hands(DRIVE);
                scene.run(millis(850));
                scene.transmitter(false);
                scene.run(millis(150));
                assert!(!scene.is_driven(Name::FrontLeft), "at {at}");
                scene.transmitter(true);
                scene.run(millis(500));
                assert!(scene.is_driven(Name::FrontLeft), "at {at}");
            },
        );
    }
}
