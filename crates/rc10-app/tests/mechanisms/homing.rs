//! Homing from random places, with every fault.

use std::collections::BTreeMap;

use rc10_app::mechanism::{
    Health, Homing, HomingConfig, HomingFailure, HomingStatus, MotorCommand, Reference, Stall,
    Trouble,
};
use rc10_app::{Degrees, Direction, Rpm, Seconds, TotalAngle};

use super::axis::{Axis, BRAKING, FULL, Random, Stop};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    None,
    /// Never closed.
    ContactDead,
    /// Closed from the beginning.
    ContactClosed,
    /// Closes and never opens again.
    ContactSticks,
    /// Single wrong samples.
    ContactNoise,
    NoReference,
    StopSoft,
    BeltSlips,
    ThresholdLow,
    ThresholdHigh,
    Offline,
    Faulty,
    AngleGap,
    NotFinite,
}

const ALWAYS: [Fault; 6] = [
    Fault::None,
    Fault::NoReference,
    Fault::Offline,
    Fault::Faulty,
    Fault::AngleGap,
    Fault::NotFinite,
];
const STOPS: [Fault; 4] =
    [Fault::StopSoft, Fault::BeltSlips, Fault::ThresholdLow, Fault::ThresholdHigh];
const CONTACTS: [Fault; 4] =
    [Fault::ContactDead, Fault::ContactClosed, Fault::ContactSticks, Fault::ContactNoise];

/// A contact that closes at `at` in the direction of homing, over a width, with hysteresis.
struct Contact {
    at: f64,
    width: f64,
    hysteresis: f64,
    is_closed: bool,
    bounces_for: u32,
    stuck: bool,
}

impl Contact {
    /// A millisecond. `at`: in the direction of homing.
    fn step(&mut self, at: f64, fault: Fault, random: &mut Random) -> bool {
        let from = if self.is_closed { self.at - self.hysteresis } else { self.at };
        let is_closed = (from..self.at + self.width).contains(&at);
        if is_closed != self.is_closed {
            (self.is_closed, self.bounces_for) = (is_closed, random.below(6) as u32);
        }
        self.stuck |= is_closed && fault == Fault::ContactSticks;
        let bounces = self.bounces_for > 0 && random.chance(0.5);
        self.bounces_for = self.bounces_for.saturating_sub(1);
        match fault {
            Fault::ContactDead | Fault::NoReference => false,
            Fault::ContactClosed => true,
            Fault::ContactNoise if random.chance(0.002) => !is_closed,
            _ => self.stuck || (is_closed != bounces),
        }
    }
}

const SLOW: f64 = 60.0;

fn config(reference: Reference, direction: Direction, touch_at: i32) -> HomingConfig {
    HomingConfig {
        reference,
        direction,
        fast: Rpm::new(60.0),
        slow: Rpm::new(10.0),
        back_off: Degrees::new(30.0),
        tolerance: Degrees::new(10.0),
        touch_at: TotalAngle::from_degrees(touch_at),
        travel: Degrees::new(1100.0),
        braking: BRAKING,
        phase_timeout: Seconds::new(6.0),
        timeout: Seconds::new(9.0),
    }
}

fn outcome(status: HomingStatus) -> &'static str {
    use HomingFailure::{Motor, NeverOpened, PhaseTimeout, Timeout, TouchesDiffer, Travel};
    match status {
        HomingStatus::Running(_) => "runs",
        HomingStatus::Done { .. } => "done",
        HomingStatus::Failed(Motor(Trouble::Offline)) => "offline",
        HomingStatus::Failed(Motor(Trouble::Faulty)) => "faulty",
        HomingStatus::Failed(Motor(Trouble::NotFinite)) => "not finite",
        HomingStatus::Failed(Motor(Trouble::AngleGap)) => "gap",
        HomingStatus::Failed(PhaseTimeout(_)) => "phase timeout",
        HomingStatus::Failed(Timeout(_)) => "timeout",
        HomingStatus::Failed(Travel(_)) => "travel",
        HomingStatus::Failed(NeverOpened) => "never opened",
        HomingStatus::Failed(TouchesDiffer { .. }) => "touches differ",
    }
}

/// One homing; how it ended. Everything that must hold is asserted.
fn run(seed: u64, fault: Fault, by_contact: bool) -> &'static str {
    let mut random = Random(seed);
    let period = [1, 2, 5, 10][random.below(4)];
    let dt = Seconds::new(period as f32 * 1e-3);
    let debounce = 0.012 + 1.5e-3 * f64::from(period);
    let direction = [Direction::Forward, Direction::Reversed][random.below(2)];
    let sign = f64::from(direction.sign());
    let effort = match fault {
        Fault::ThresholdLow => random.between(0.1, 2.0),
        Fault::ThresholdHigh => random.between(20.5, 40.0),
        _ => 8.0,
    };
    let reference = if by_contact {
        Reference::Contact { debounce: Seconds::new(debounce as f32) }
    } else {
        let time = Seconds::new(0.1);
        Reference::Stop(Stall { effort: effort as f32, standstill: Rpm::new(3.0), time })
    };
    let touch_at = random.between(-200.0, 200.0) as i32;
    let config = config(reference, direction, touch_at);
    assert_eq!(config.validate(), Ok(()));

    // The reference is at 0; the axis begins up to 900 degrees before it, or on it.
    let before =
        if random.chance(0.2) { random.between(0.0, 3.0) } else { random.between(3.0, 900.0) };
    let stiffness = match fault {
        Fault::StopSoft => random.between(0.3, 1.0),
        _ => random.between(8.0, 30.0),
    };
    let is_marker = random.chance(0.5);
    let mut contact = Contact {
        at: 0.0,
        width: if is_marker { random.between(15.0, 40.0) } else { f64::INFINITY },
        hysteresis: random.between(0.0, 1.0),
        is_closed: false,
        bounces_for: 0,
        stuck: false,
    };
    let on_it = random.between(0.0, contact.width.min(50.0));
    let begins_on_it = by_contact && random.chance(0.2);
    let start = sign * if begins_on_it { on_it } else { -before };
    let mut axis = Axis::random(&mut random, start);
    if by_contact {
        axis.stops.push(Stop { at: sign * 100.0, direction: sign, stiffness });
    } else if fault != Fault::NoReference {
        axis.stops.push(Stop { at: 0.0, direction: sign, stiffness });
    }
    if fault == Fault::NoReference {
        axis.stops.clear();
    }
    if fault == Fault::BeltSlips {
        axis.slips_at = random.between(2.0, 30.0);
    }
    if fault == Fault::ThresholdLow && random.chance(0.5) {
        // It begins to move only once the loop has gathered enough.
        axis.friction = random.between(12.0, 19.0);
    }
    let fault_at = random.between(0.0, 4000.0) as u32;

    let bound = f64::from(config.travel.get());
    let mut homing = Homing::new();
    let mut ended: Option<u32> = None;
    let (mut struck, mut jumped, mut before_step) = (false, 0.0, start);
    for ms in 0..11_000 {
        if ms == fault_at && ended.is_none() {
            struck = true;
            match fault {
                Fault::Offline => axis.health = Health::Offline,
                Fault::Faulty => axis.health = Health::Faulty,
                Fault::NotFinite => axis.not_finite = true,
                Fault::AngleGap => {
                    (axis.gaps, axis.jumped) = (axis.gaps + 1, random.between(-60.0, 60.0));
                }
                _ => struck = false,
            }
        }
        let closed = contact.step(sign * axis.position(), fault, &mut random);
        if ms % period == 0 {
            let command = homing.update(&config, &axis.measured(), closed, dt);
            let is_running = matches!(homing.status(), HomingStatus::Running(_));
            if ended.is_some() {
                assert_eq!(command, MotorCommand::STOP);
            } else if !is_running {
                ended = Some(ms);
                // What has happened since this measurement was made does not count.
                jumped = axis.measured().angle.microdegrees() as f64 * 1e-6 - before_step;
                assert_eq!(command, MotorCommand::Coast);
            }
            axis.command(command);
        }
        before_step = axis.angle;
        axis.step(&mut random);
        // A motor that obeys never leaves its travel; one that is not heard just coasts.
        let gone = (axis.angle - start).abs();
        assert!(gone <= bound || axis.health != Health::Ready, "{seed}: {fault:?} {gone}");
        if ended.is_some_and(|at| ms > at + 1000) {
            break;
        }
    }
    let Some(at) = ended else { panic!("{seed}: {fault:?} {homing:?}") };
    assert!(f64::from(at) <= 9000.0 + 2.0 * f64::from(period), "{seed}: {at} ms");
    // It does not go on pushing; only a soft stop still pushes it.
    let is_pushed = fault == Fault::StopSoft;
    assert!(axis.effort.abs() < 4.0 || is_pushed, "{seed}: {fault:?} {}", axis.effort);
    assert!(axis.speed.abs() < 60.0 || axis.health != Health::Ready, "{seed}: {fault:?}");

    if let HomingStatus::Done { zero } = homing.status() {
        let zero = zero.microdegrees() as f64 * 1e-6;
        // The motor's angle when the axis is at the reference.
        let actual = zero + f64::from(touch_at) - (axis.slipped + jumped);
        let late = SLOW * (f64::from(period) * 1e-3 + 0.003);
        let (early, late) = if by_contact {
            (SLOW * debounce, late + SLOW * 0.006)
        } else {
            // The stop gives way, until it pushes with the threshold and the friction. A soft one is
            // pressed in without a stall, until it pushes with all of the effort.
            let pushes = match fault {
                Fault::StopSoft | Fault::ThresholdLow => FULL,
                _ => effort + 3.0,
            };
            (0.0, late + pushes / stiffness)
        };
        let off = sign * actual;
        assert!(off >= -early - 0.3 && off <= late + 0.3, "{seed}: {fault:?} {off} {late}");
    }
    if struck && at > fault_at {
        outcome(homing.status())
    } else {
        unstruck(fault, homing.status())
    }
}

/// A fault that came too late does not count.
fn unstruck(fault: Fault, status: HomingStatus) -> &'static str {
    match fault {
        Fault::Offline | Fault::Faulty | Fault::NotFinite | Fault::AngleGap => {
            assert!(matches!(status, HomingStatus::Done { .. }), "{status:?}");
            "too late"
        }
        _ => outcome(status),
    }
}

fn all(faults: &[Fault], by_contact: bool, runs: u64) -> BTreeMap<(Fault, &'static str), u64> {
    let mut outcomes = BTreeMap::new();
    for seed in 0..runs {
        for fault in faults {
            *outcomes.entry((*fault, run(seed, *fault, by_contact))).or_insert(0) += 1;
        }
    }
    outcomes
}

/// Which ends each fault may have.
fn allowed(fault: Fault) -> &'static [&'static str] {
    match fault {
        Fault::None => &["done"],
        Fault::ContactDead | Fault::NoReference => &["travel", "phase timeout"],
        Fault::ContactClosed | Fault::ContactSticks => &["never opened"],
        Fault::ContactNoise => &["done", "touches differ"],
        Fault::StopSoft => &["done", "touches differ"],
        Fault::BeltSlips => &["done", "travel", "touches differ", "phase timeout"],
        Fault::ThresholdLow => &["done", "touches differ", "phase timeout"],
        Fault::ThresholdHigh => &["phase timeout"],
        Fault::Offline => &["offline", "too late"],
        Fault::Faulty => &["faulty", "too late"],
        Fault::AngleGap => &["gap", "too late"],
        Fault::NotFinite => &["not finite", "too late"],
    }
}

fn check(outcomes: &BTreeMap<(Fault, &'static str), u64>) {
    for ((fault, outcome), runs) in outcomes {
        println!("{fault:?}: {outcome} {runs}");
        assert!(allowed(*fault).contains(outcome), "{fault:?} ended: {outcome}");
    }
}

#[test]
fn a_stop_is_found_or_the_reason_named() {
    check(&all(&[&ALWAYS[..], &STOPS].concat(), false, 400));
}

#[test]
fn a_contact_is_found_or_the_reason_named() {
    check(&all(&[&ALWAYS[..], &CONTACTS].concat(), true, 400));
}
