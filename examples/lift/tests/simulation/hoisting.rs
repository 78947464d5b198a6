//! The hoist finds its bottom by a switch that is closed over all turns below it, and stays within its range.

use lift::simulation::{HOIST, HOIST_SWITCH};
use lift::table::HOIST_RANGE;
use lift::{Motors, Name, Ports, Robot, Shared};
use rc10::app::mechanism::Stage as Exact;
use rc10::motor::Names;
use rc10::sim::run::simulate::simulate;
use rc10::sim::simulator::remote::Controls;
use rc10::time::Micros;

use crate::bench::{ARMED, Bench, DISARMED, Stage, changed};

/// Runs a scenario with a robot whose hoist hangs this many degrees above its stop when it is armed.
fn hanging<R>(seed: u64, height: f64, scenario: impl FnOnce(&mut Bench<'_>) -> R) -> R {
    let change = |world: &mut rc10::sim::Description| {
        let plant = &mut world.motors[Name::Hoist.index()].plant;
        (plant.travel, plant.load) = (Some([-height, HOIST[1] - height]), 0.0);
        world.contacts[1] = lift::simulation::hoist_switch(-height);
    };
    changed(seed, [30.0, 20.0], change, |bench| {
        bench.arm();
        bench.motor(Name::Hoist).set_load(0.4);
        scenario(bench)
    })
}

fn dialled(share: f64) -> Controls {
    Controls { dial: share, ..ARMED }
}

#[test]
fn it_finds_its_bottom_from_wherever_it_hangs_and_stays_within_its_range() {
    let (mut worst, mut longest) = (0.0_f64, 0);
    for seed in 1..=3 {
        // On its stop, where the switch is pressed; at its edge; many turns above; at the top.
        for height in [0.0, 10.0, 19.9, 20.1, 45.0, 380.0, 1100.0, 1899.0] {
            hanging(seed, height, |bench| {
                longest = longest.max(bench.until(12, |bench| bench.hoist() == Stage::Ready));
                bench.run(200);
                let above = |bench: &Bench<'_>| {
                    let [turned, believed] = bench.hoisted();
                    (turned + height - HOIST_SWITCH, believed)
                };
                let (is, believed) = above(bench);
                worst = worst.max((is - believed).abs());
                // It has let go by now, or stands on its switch, and is not on its stop.
                assert!(is > -HOIST_SWITCH + 1.0, "{is}");
                for (share, end) in [(1.0, HOIST_RANGE.upper), (-1.0, HOIST_RANGE.lower)] {
                    bench.hands(dialled(share), 5000);
                    let (is, _) = above(bench);
                    let end = f64::from(end.degrees().get());
                    assert!((is - end).abs() < 3.0, "seed {seed}, {height}: {is}, not {end}");
                }
            });
        }
    }
    println!("bottom within {worst:.3} degrees, {longest} ms");
    assert!(worst < 1.0, "{worst}");
}

#[test]
fn armed_again_it_knows_its_bottom_unless_turns_were_estimated() {
    hanging(1, 400.0, |bench| {
        bench.until(12, |bench| bench.hoist() == Stage::Ready);
        bench.hands(dialled(1.0), 1000);
        bench.hands(DISARMED, 100);
        bench.hands(ARMED, 90);
        assert_eq!(bench.hoist(), Stage::Ready);
        bench.motor(Name::Hoist).set_power(false);
        bench.run(500);
        bench.motor(Name::Hoist).set_power(true);
        bench.until(1, |bench| bench.hoist() == Stage::Homing);
        bench.until(12, |bench| bench.hoist() == Stage::Ready);
    });
}

/// A torn wire looks like a pressed switch: it moves up a little and gives up, and does not run onto a stop.
#[test]
fn a_switch_with_a_defect_is_named() {
    for (fault, wanted) in [
        ("bounces:hoist@0s", Exact::Ready),
        ("torn:hoist@0s", Exact::NeverOpened),
        ("stuck:hoist@0s", Exact::NeverOpened),
    ] {
        let ports = Ports::new();
        let (shared, mut motors) = (Shared::new(&ports), Motors::new());
        let mut robot = rc10::sim::robot_of::<Robot>(&shared, &mut motors).unwrap();
        robot.set_faults(&[fault.parse().unwrap()]).unwrap();
        let recording = simulate(robot, 1, Micros::from_millis(10_000)).unwrap();
        let told = recording.signals.iter().find(|it| it.label == "hoist").unwrap().last;
        assert_eq!(told, Some(f64::from(wanted as u8)), "{fault}");
        let speeds = recording.motors[Name::Hoist.index()].samples.iter().map(|sample| sample.rpm);
        // It stands where it gave up, whatever the dial says: 6 degrees a second are 1 rpm, a sample is 10 ms.
        let way: f64 = speeds.map(|rpm| rpm * 0.06).sum();
        assert!(!wanted.gave_up() || way.abs() < 150.0, "{fault}: {way} degrees");
    }
}
