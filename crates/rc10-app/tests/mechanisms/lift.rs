//! A lift on two or four motors: it homes together, does not tilt, and stops before it does.

use std::collections::BTreeMap;

use rc10_app::mechanism::{
    Axes, AxesConfig, AxesFailure, AxesHoming, AxesHomingConfig, AxesHomingFailure,
    AxesHomingStatus, Health, HomingConfig, HomingFailure, MotorCommand, Reference, Stall, Trouble,
};
use rc10_app::{AngleSetpoint, Degrees, Direction, Rpm, Seconds, TotalAngle};

use super::axis::{Axis, BRAKING, Random, Stop};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    None,
    /// 30 % less effort.
    Weak,
    /// So weak that it cannot follow.
    VeryWeak,
    /// Stuck where it is.
    Blocked,
    /// No effort; its gearbox brakes and holds it.
    Dead,
    Offline,
    AngleGap,
}

const FAULTS: [Fault; 7] = [
    Fault::None,
    Fault::Weak,
    Fault::VeryWeak,
    Fault::Blocked,
    Fault::Dead,
    Fault::Offline,
    Fault::AngleGap,
];

impl Fault {
    fn strike(self, axis: &mut Axis, random: &mut Random) {
        match self {
            Self::None => {}
            Self::Weak => axis.strength = 0.7,
            Self::VeryWeak => axis.strength = random.between(0.2, 0.35),
            Self::Blocked => axis.stuck_at = Some(axis.angle),
            // Its gearbox brakes it as much as is relied on: 2400 deg/s².
            Self::Dead => {
                (axis.strength, axis.friction) = (0.0, axis.load + 2400.0 / axis.gain);
            }
            Self::Offline => {
                axis.friction = axis.load + 2400.0 / axis.gain;
                axis.health = Health::Offline;
            }
            Self::AngleGap => (axis.gaps, axis.jumped) = (axis.gaps + 1, 40.0),
        }
    }
}

/// Motors that differ by up to 30 %, under a load.
fn motors<const N: usize>(random: &mut Random, tilt: f64, at: f64) -> [Axis; N] {
    let (gain, load) = (random.between(450.0, 700.0), random.between(0.0, 4.0));
    std::array::from_fn(|_| {
        let from = at + random.between(0.0, tilt);
        let mut axis = Axis::random(random, from);
        axis.gain = gain * random.between(0.7, 1.3);
        axis.load = load * random.between(0.7, 1.3);
        axis
    })
}

fn difference(angles: impl Iterator<Item = f64> + Clone) -> f64 {
    angles.clone().fold(f64::MIN, f64::max) - angles.fold(f64::MAX, f64::min)
}

const AXES: AxesConfig = AxesConfig {
    wait: Degrees::new(10.0),
    stop: Degrees::new(30.0),
    patience: Seconds::new(0.5),
    coupling: 0.5,
    correction: Degrees::new(10.0),
};

const SPEED: f64 = 480.0;
/// Acceleration that a motor at its weakest hardly reaches upward.
const ACCELERATION: f64 = 3500.0;

/// A trapezoid whose time passes as told: angle, speed.
struct Profile {
    at: f64,
    speed: f64,
}

impl Profile {
    fn step(&mut self, target: f64, dt: f64) {
        let way = target - self.at;
        let top = SPEED.min((2.0 * ACCELERATION * way.abs()).sqrt()).copysign(way);
        self.speed += (top - self.speed).clamp(-ACCELERATION * dt, ACCELERATION * dt);
        let moved = self.speed * dt;
        self.at = if moved.abs() >= way.abs() { target } else { self.at + moved };
        if dt > 0.0 && moved.abs() >= way.abs() {
            self.speed = 0.0;
        }
    }
}

struct Ride {
    worst: f64,
    failure: Option<AxesFailure>,
    /// Seconds from the fault until all were told to stop.
    after: f64,
    arrived: bool,
    slowed: bool,
}

/// The lift goes up and down; the motor `bad` fails.
fn ride<const N: usize>(random: &mut Random, fault: Fault, bad: usize) -> Ride {
    let period = [1, 2, 5, 10][random.below(4)];
    let dt = Seconds::new(period as f32 * 1e-3);
    let mut motors = motors::<N>(random, 2.0, 100.0);
    let mut axes = Axes::<N>::new();
    let mut profile = Profile { at: 101.0, speed: 0.0 };
    let fails_at = random.between(0.0, 1500.0) as u32;
    let mut ride = Ride { worst: 0.0, failure: None, after: 0.0, arrived: false, slowed: false };
    let mut target = 1000.0;
    for ms in 0..12_000 {
        if ms == fails_at {
            fault.strike(&mut motors[bad], random);
        }
        if ms == 6000 {
            target = random.between(0.0, 500.0);
        }
        if ms % period == 0 {
            profile.step(target, f64::from(dt.get()) * f64::from(axes.pace()));
            let angle = TotalAngle::from_microdegrees((profile.at * 1e6) as i64);
            let speed = Rpm::new((profile.speed / 6.0) as f32);
            let measured = std::array::from_fn(|motor: usize| motors[motor].measured());
            let setpoint = AngleSetpoint { speed, ..AngleSetpoint::at(angle) };
            let commands = axes.update(&AXES, &setpoint, &measured, dt);
            for (motor, command) in motors.iter_mut().zip(commands) {
                motor.command(command);
            }
            if ride.failure.is_none() && axes.failure().is_some() {
                ride.failure = axes.failure();
                ride.after = f64::from(ms.saturating_sub(fails_at)) * 1e-3;
                assert_eq!(commands, [MotorCommand::Coast; N]);
            } else if ride.failure.is_some() {
                assert_eq!(commands, [MotorCommand::STOP; N]);
            }
            ride.slowed |= axes.pace() < 1.0;
        }
        motors.iter_mut().for_each(|motor| motor.step(random));
        ride.worst = ride.worst.max(difference(motors.iter().map(|motor| motor.angle)));
    }
    ride.arrived = motors.iter().all(|motor| (motor.angle - target).abs() < 2.0);
    ride
}

#[test]
fn the_difference_never_exceeds_its_bound_and_the_way_to_brake() {
    let bound = f64::from(AXES.stop.get() + BRAKING.way(Rpm::new(80.0)).get());
    let (mut worst, mut waited) = (BTreeMap::new(), 0);
    for seed in 0..100 {
        for fault in FAULTS {
            let mut random = Random(seed);
            let (ride, bad) = if random.chance(0.5) {
                let bad = random.below(2);
                (ride::<2>(&mut random, fault, bad), bad)
            } else {
                let bad = random.below(4);
                (ride::<4>(&mut random, fault, bad), bad)
            };
            let Ride { failure, after, arrived, slowed, .. } = ride;
            // A motor that is too weak to brake sinks as it likes.
            let brakes = fault != Fault::VeryWeak;
            assert!(ride.worst <= bound || !brakes, "{seed} {fault:?}: {}", ride.worst);
            let most = worst.entry(fault).or_insert(0.0_f64);
            *most = most.max(ride.worst);
            match fault {
                Fault::None => assert!(failure.is_none() && arrived && !slowed, "{seed}"),
                Fault::Weak => assert!(failure.is_none() && arrived, "{seed} {failure:?}"),
                // It may be strong enough, or sink.
                Fault::VeryWeak => {
                    assert!(arrived || failure.is_some(), "{seed}");
                    waited += u32::from(arrived && slowed);
                }
                Fault::Blocked | Fault::Dead => {
                    let Some(AxesFailure::Lags { motor, .. }) = failure else {
                        panic!("{seed} {fault:?}: {failure:?}");
                    };
                    assert_eq!(motor, bad, "{seed} {fault:?}");
                }
                Fault::Offline => {
                    let trouble = Trouble::Offline;
                    assert_eq!(failure, Some(AxesFailure::Motor { motor: bad, trouble }));
                    assert!(after <= 0.02, "{seed}: {after}");
                }
                Fault::AngleGap => {
                    let trouble = Trouble::AngleGap;
                    assert_eq!(failure, Some(AxesFailure::Motor { motor: bad, trouble }));
                }
            }
        }
    }
    println!("{worst:?}; waited for a weak motor and arrived: {waited}");
    assert!(waited > 5, "{waited}");
}

const HOMING: AxesHomingConfig = AxesHomingConfig {
    homing: HomingConfig {
        reference: Reference::Stop(Stall {
            effort: 10.0,
            standstill: Rpm::new(3.0),
            time: Seconds::new(0.1),
        }),
        direction: Direction::Reversed,
        fast: Rpm::new(60.0),
        slow: Rpm::new(10.0),
        back_off: Degrees::new(30.0),
        tolerance: Degrees::new(10.0),
        touch_at: TotalAngle::ZERO,
        travel: Degrees::new(1100.0),
        braking: BRAKING,
        phase_timeout: Seconds::new(6.0),
        timeout: Seconds::new(9.0),
    },
    spread: Degrees::new(40.0),
};

/// How homing together ended; the largest difference of the ways on the way.
fn home<const N: usize>(
    random: &mut Random,
    fault: Fault,
    bad: usize,
    tilt: f64,
) -> (AxesHomingStatus<N>, f64) {
    let period = [1, 2, 5, 10][random.below(4)];
    let dt = Seconds::new(period as f32 * 1e-3);
    let from = random.between(100.0, 900.0);
    let mut motors = motors::<N>(random, tilt, from);
    for motor in &mut motors {
        motor.stops.push(Stop { at: 0.0, direction: -1.0, stiffness: random.between(8.0, 30.0) });
    }
    let began = std::array::from_fn::<f64, N, _>(|motor| motors[motor].angle);
    let fails_at = random.between(0.0, 250.0) as u32;
    let (mut homing, mut worst, mut ended) = (AxesHoming::<N>::new(), 0.0_f64, false);
    for ms in 0..10_000 {
        if ms == fails_at {
            fault.strike(&mut motors[bad], random);
        }
        if ms % period == 0 {
            let measured = std::array::from_fn(|motor: usize| motors[motor].measured());
            let commands = homing.update(&HOMING, &measured, &[false; N], dt);
            if ended {
                assert_eq!(commands, [MotorCommand::STOP; N]);
            }
            ended = homing.status() != AxesHomingStatus::Running;
            for (motor, command) in motors.iter_mut().zip(commands) {
                motor.command(command);
            }
        }
        motors.iter_mut().for_each(|motor| motor.step(random));
        let ways = motors.iter().zip(began).map(|(motor, began)| motor.angle - began);
        worst = worst.max(difference(ways));
    }
    assert!(ended, "it runs on");
    if let AxesHomingStatus::Done { zeros } = homing.status() {
        for (zero, motor) in zeros.iter().zip(&motors) {
            let zero = zero.microdegrees() as f64 * 1e-6;
            let deepest = (10.0 + 8.0) / motor.stops[0].stiffness + 0.8;
            assert!(zero <= 0.3 && zero >= -deepest, "{zero} {deepest}");
        }
    }
    (homing.status(), worst)
}

fn check_homing<const N: usize>(seed: u64, fault: Fault) -> &'static str {
    let mut random = Random(seed);
    let bad = random.below(N);
    let tilt = random.between(0.0, 60.0);
    let (status, worst) = home::<N>(&mut random, fault, bad, tilt);
    let bound = f64::from(HOMING.spread.get() + BRAKING.way(Rpm::new(60.0)).get());
    assert!(worst <= bound, "{seed} {fault:?}: {worst}");
    match (fault, status) {
        (Fault::None, AxesHomingStatus::Done { .. }) => "done",
        (Fault::None | Fault::Weak, AxesHomingStatus::Failed(AxesHomingFailure::Spread { .. })) => {
            assert!(tilt > 25.0, "{seed} {fault:?}: {status:?}");
            "tilted too far"
        }
        (Fault::Weak, AxesHomingStatus::Done { .. }) => "done",
        (
            Fault::VeryWeak | Fault::Blocked | Fault::Dead,
            AxesHomingStatus::Failed(AxesHomingFailure::Spread { behind, .. }),
        ) => {
            assert!(behind == bad || fault == Fault::VeryWeak, "{seed} {fault:?} {bad}: {behind}");
            "lags"
        }
        (Fault::VeryWeak, AxesHomingStatus::Done { .. }) => "done",
        (Fault::VeryWeak, AxesHomingStatus::Failed(AxesHomingFailure::Motor { motor, .. })) => {
            assert_eq!(motor, bad);
            "motor fails"
        }
        (
            Fault::Offline | Fault::AngleGap,
            AxesHomingStatus::Failed(AxesHomingFailure::Motor {
                motor,
                failure: HomingFailure::Motor(_),
            }),
        ) => {
            assert_eq!(motor, bad);
            "trouble"
        }
        _ => panic!("{seed} {fault:?} {bad} {tilt}: {status:?}"),
    }
}

#[test]
fn motors_home_together_or_all_stop() {
    let mut outcomes = BTreeMap::new();
    for seed in 0..100 {
        for fault in FAULTS {
            *outcomes.entry((fault, check_homing::<2>(seed, fault))).or_insert(0) += 1;
            *outcomes.entry((fault, check_homing::<4>(seed, fault))).or_insert(0) += 1;
        }
    }
    println!("{outcomes:?}");
    assert!(outcomes[&(Fault::None, "done")] > 80, "{outcomes:?}");
    assert!(outcomes[&(Fault::None, "tilted too far")] > 10, "{outcomes:?}");
}
