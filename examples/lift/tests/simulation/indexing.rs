//! The feeder finds its index, and its pockets stand there from then on.

use core::cell::Cell;
use core::pin::Pin;

use lift::table::FEEDER;
use lift::{Motors, Name, Ports, Robot, Shared};
use rc10::motor::{Motion, Target};
use rc10::sim::simulator::{Tasks, World};
use rc10::tasks::embedded_hal::digital::{ErrorKind, ErrorType, InputPin};
use rc10::tasks::live::Contact;
use rc10::tasks::program::{Active, read_contact};
use rc10::time::Micros;

use crate::bench::{ARMED, Bench, DISARMED, FEED, Stage, indexed};
use crate::{feed, ride};

const MARKER: f64 = 6.0;
const POCKET: f64 = 45.0;

/// Where pockets are known to stand when the marker begins there.
fn with_marker_at<R>(seed: u64, at: f64, scenario: impl FnOnce(&mut Bench<'_>) -> R) -> R {
    indexed(seed, [30.0, 20.0], [at - MARKER, at], scenario)
}

/// How far the pockets truly are from the marker's beginning, to the nearest of them.
fn off(bench: &Bench<'_>, at: f64) -> f64 {
    to_a_pocket(bench.turned() - at)
}

/// The same where the robot believes that they stand.
fn zero_off(bench: &Bench<'_>, at: f64) -> f64 {
    let status = bench.shared.motor(Name::Feeder).status();
    let Target::Motion(Motion { angle: Some(zero), .. }) = status.target else {
        panic!("{:?}", status.target)
    };
    let away = zero.minus(status.feedback.total_angle).microdegrees() as f64 * 1e-6;
    to_a_pocket(bench.turned() + away - at)
}

fn to_a_pocket(degrees: f64) -> f64 {
    let off = degrees.rem_euclid(POCKET);
    off.min(POCKET - off)
}

#[test]
fn it_finds_its_index_from_wherever_it_begins() {
    let (mut zero, mut worst, mut longest, mut forward) = (0.0_f64, 0.0_f64, 0, 0.0_f64);
    let tolerance = f64::from(FEEDER.tolerance.get());
    for seed in 1..=5 {
        // The last ones begin at the marker, and just beside it.
        for at in [-359.0, -250.0, -133.3, -90.0, -17.0, -4.0, -0.1, 0.0, 0.1, 3.0, 5.9, 6.1] {
            with_marker_at(seed, at, |bench| {
                bench.arm();
                let most = Cell::new(0.0_f64);
                longest = longest.max(bench.until(8, |bench| {
                    most.set(most.get().max(bench.turned()));
                    bench.feeder() == Stage::Ready
                }));
                bench.run(300);
                forward = forward.max(most.get());
                zero = zero.max(zero_off(bench, at));
                worst = worst.max(off(bench, at));
                assert_eq!((bench.fed(), bench.jams()), (0, 0), "seed {seed}, {at}");
                // No other pocket than that of the marker.
                let turns = (bench.turned() - at) / 360.0;
                assert!((turns - turns.round()).abs() * 360.0 < tolerance, "{turns} turns");
                feed(bench, 3);
                bench.run(1500);
                worst = worst.max(off(bench, at));
                assert_eq!(bench.fed(), 3);
                let turns = (bench.turned() - 3.0 * POCKET - at) / 360.0;
                assert!((turns - turns.round()).abs() * 360.0 < tolerance, "{turns} turns");
            });
        }
    }
    println!(
        "zero within {zero:.3} degrees, pockets {worst:.3}; {longest} ms; {forward:.1} degrees forward"
    );
    assert!(zero < 0.5, "{zero}");
    assert!(worst < 1.0, "{worst}");
    assert!(longest < 4500, "{longest}");
    // Nothing is fed on the way.
    assert!(forward < POCKET / 2.0, "{forward}");
}

#[test]
fn what_is_asked_for_while_it_homes_is_fed_afterwards() {
    with_marker_at(1, -200.0, |bench| {
        bench.arm();
        feed(bench, 2);
        assert_eq!((bench.feeder(), bench.fed()), (Stage::Homing, 0));
        bench.index();
        bench.run(1000);
        assert_eq!(bench.fed(), 2);
        assert!(off(bench, -200.0) < 1.0, "{}", off(bench, -200.0));
    });
}

#[test]
fn a_marker_that_is_never_seen_ends_homing_and_the_lift_goes_on() {
    // Narrower than its way between two samples.
    indexed(1, [30.0, 20.0], [-90.001, -90.0], |bench| {
        bench.arm();
        let took = bench.until(8, |bench| bench.feeder() == Stage::Failed);
        println!("given up after {took} ms");
        // A turn and a bit, at a third of a turn a second.
        assert!((3000..3500).contains(&took), "{took}");
        feed(bench, 1);
        bench.run(300);
        // It coasts.
        let state = bench.motor(Name::Feeder).state();
        assert!(state.current.abs() < 0.05, "{} A", state.current);
        assert!(bench.turned().abs() < 400.0 + POCKET, "{}", bench.turned());
        bench.home();
        ride(bench);
        assert_eq!((bench.feeder(), bench.fed()), (Stage::Failed, 0));
        // Armed again it tries again.
        bench.hands(DISARMED, 100);
        bench.hands(ARMED, 90);
        assert_eq!(bench.feeder(), Stage::Homing);
    });
}

#[test]
fn one_that_is_always_seen_ends_homing_before_a_piece_is_fed() {
    indexed(1, [30.0, 20.0], [180.0, 539.999], |bench| {
        bench.arm();
        bench.until(8, |bench| bench.feeder() == Stage::Failed);
        bench.run(1000);
        // It has fed nothing.
        println!("{} degrees forward", bench.turned());
        assert!(bench.turned() < POCKET, "{}", bench.turned());
    });
}

#[test]
fn armed_again_it_knows_its_index_unless_turns_were_estimated() {
    with_marker_at(1, -90.0, |bench| {
        bench.arm();
        bench.index();
        feed(bench, 2);
        bench.run(1000);
        bench.hands(DISARMED, 500);
        bench.hands(ARMED, 90);
        assert_eq!(bench.feeder(), Stage::Ready);
        feed(bench, 1);
        bench.run(1000);
        assert_eq!(bench.fed(), 3);
        assert!(off(bench, -90.0) < 1.0, "{}", off(bench, -90.0));
        // While it is without power somebody turns it.
        let turn = |bench: &mut Bench<'_>| {
            bench.motor(Name::Feeder).set_power(false);
            bench.motor(Name::Feeder).set_load(0.5);
            bench.run(300);
            bench.motor(Name::Feeder).set_load(0.0);
            bench.run(500);
            bench.motor(Name::Feeder).set_power(true);
        };
        let before = bench.turned();
        turn(bench);
        assert!(bench.turned() > before + 100.0, "{}", bench.turned() - before);
        // It homes by itself, and feeds the pieces that are asked for meanwhile.
        bench.until(1, |bench| bench.feeder() == Stage::Homing);
        bench.hands(FEED, 50);
        bench.hands(ARMED, 50);
        bench.index();
        bench.run(1000);
        assert_eq!(bench.fed(), 4);
        assert!(off(bench, -90.0) < 1.0, "{}", off(bench, -90.0));
        // The same while it is disarmed.
        bench.hands(DISARMED, 100);
        turn(bench);
        bench.run(200);
        bench.hands(ARMED, 90);
        assert_eq!(bench.feeder(), Stage::Homing);
        bench.index();
        assert_eq!(bench.fed(), 4);
        assert!(off(bench, -90.0) < 1.0, "{}", off(bench, -90.0));
    });
}

/// An input that cannot be read.
struct Broken;

impl ErrorType for Broken {
    type Error = ErrorKind;
}

impl InputPin for Broken {
    fn is_high(&mut self) -> Result<bool, ErrorKind> {
        Err(ErrorKind::Other)
    }

    fn is_low(&mut self) -> Result<bool, ErrorKind> {
        Err(ErrorKind::Other)
    }
}

#[test]
fn an_input_that_cannot_be_read_is_an_open_contact() {
    let contact = Contact::new("index");
    contact.set(true);
    let mut tasks = Tasks::new();
    tasks.add(async { read_contact(Broken, Active::Low, &contact).await });
    let _ = World::new(1).run(Pin::new(&mut tasks), Micros::from_millis(2));
    assert!(!contact.is_closed());
}

/// Contacts with a defect, as a run injects them: one that bounces is no trouble, of the others the run
/// says why the feeder gave up.
#[test]
fn a_contact_with_a_defect_is_named() {
    use rc10::app::mechanism::Stage;
    use rc10::sim::run::simulate::simulate;
    for (fault, wanted) in [
        ("bounces:feeder@0s", Stage::Ready),
        ("torn:feeder@0s", Stage::NotTouched),
        ("stuck:feeder@0s", Stage::NeverOpened),
    ] {
        let ports = Ports::new();
        let (shared, mut motors) = (Shared::new(&ports), Motors::new());
        let mut robot = rc10::sim::robot_of::<Robot>(&shared, &mut motors).unwrap();
        robot.set_faults(&[fault.parse().unwrap()]).unwrap();
        let recording = simulate(robot, 1, Micros::from_millis(10_000)).unwrap();
        let told = recording.signals.iter().find(|it| it.label == "feeder").unwrap().last;
        assert_eq!(told, Some(f64::from(wanted as u8)), "{fault}");
        // The fault is not told to the verdict here: it is as if the contact were so.
        let found = rc10::sim::judge::problems(&recording);
        let gave_up = found.iter().find(|it| it.kind == "gave-up").map(ToString::to_string);
        assert_eq!(gave_up.is_some(), wanted.gave_up(), "{fault}: {gave_up:?}");
        if let Some(text) = gave_up {
            assert!(text.contains("feeder: gave up at") && text.contains(wanted.name()), "{text}");
        }
    }
}
