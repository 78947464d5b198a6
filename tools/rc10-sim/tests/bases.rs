//! Bases on every kind of wheel, against the closed forms of their motion.
#![expect(clippy::unwrap_used, clippy::cast_possible_truncation, reason = "a test may panic")]

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::{
    Base, Bus, BusConfig, Chassis, Esc, EscConfig, Model, Mounting, Plant, Steering, WheelError,
    WheelMotors, World,
};
use rc10_time::Micros;

const GRAVITY: f64 = 9.806_65;
const RADIUS: f64 = 0.076;
/// N·m at the shaft per step of a C620's command.
const PER_RAW: f64 = 0.3 * 20.0 / 16384.0;

/// A base whose motors are C620s (identifiers 1 to 4), and C610s to steer it (5 to 8).
struct Bench {
    world: World,
    bus: Bus,
    base: Base,
    drives: Vec<Esc>,
    steers: Vec<Esc>,
}

/// Nothing is lost in the motor.
fn frictionless() -> Plant {
    Plant { viscous_friction: 0.0, coulomb_friction: 0.0, static_friction: 0.0, ..Plant::m3508() }
}

fn without_resistance(chassis: Chassis) -> Chassis {
    Chassis { rolling_resistance: 0.0, ..chassis }
}

impl Bench {
    fn new(chassis: Chassis, plant: Plant) -> Self {
        let mut world = World::new(11);
        let bus = world.add_bus(BusConfig::default());
        let add = |model, id, plant| {
            bus.add_esc(EscConfig { plant, ..EscConfig::new(model, id) }).unwrap()
        };
        let count = u8::try_from(chassis.wheels.len()).unwrap();
        let drives: Vec<_> = (1..=count).map(|id| add(Model::C620, id, plant)).collect();
        let steered = chassis.wheels.iter().zip(5..).filter(|(wheel, _)| wheel.steering.is_some());
        let steers: Vec<_> = steered.map(|(_, id)| add(Model::C610, id, Plant::m2006())).collect();
        let motors = drives.iter().enumerate().map(|(index, drive)| WheelMotors {
            drive: (drive, Mounting::Normal),
            steering: steers.get(index).map(|esc| (esc, Mounting::Normal)),
        });
        let base = world.add_base(chassis, motors).unwrap();
        Self { world, bus, base, drives, steers }
    }

    fn send(&self, id: u16, raw: &[i16]) {
        let mut data = [0; 8];
        for (index, raw) in raw.iter().enumerate() {
            data[2 * index..][..2].copy_from_slice(&raw.to_be_bytes());
        }
        let frame = CanFrame::eight_bytes(StandardId::new(id).unwrap(), data);
        let _ = self.bus.port().submit(&frame);
    }

    fn wait(&mut self, micros: u64) {
        self.world.advance(self.world.now() + Micros::new(micros));
    }

    /// Drives with these raw currents for a time.
    fn drive(&mut self, raw: &[i16], millis: u64) {
        self.send(0x200, raw);
        self.wait(1000 * millis);
    }

    /// Turns each steering motor to this angle of its shaft, degrees: proportional to the error, and
    /// against the speed.
    fn steer(&mut self, degrees: f64, millis: u64) {
        for _ in 0..millis {
            let raw = |esc: &Esc| {
                let state = esc.state();
                let amps = 0.25 * (degrees - state.output_degrees) - 0.05 * state.output_rpm;
                (amps.clamp(-10.0, 10.0) * 1000.0) as i16
            };
            let raw: Vec<i16> = self.steers.iter().map(raw).collect();
            self.send(0x1FF, &raw);
            self.wait(1000);
        }
    }

    /// Rim speeds, m/s.
    fn rims(&self) -> Vec<f64> {
        let rim = |esc: &Esc| esc.state().output_rpm / 60.0 * TAU * RADIUS;
        self.drives.iter().map(rim).collect()
    }

    /// Energy of the body and all that turns in it, J.
    fn energy(&self, chassis: &Chassis) -> f64 {
        let twist = self.base.twist();
        let turning = |esc: &Esc| {
            let speed = esc.state().output_rpm / 60.0 * TAU;
            0.5 * esc.plant().inertia() * speed * speed
        };
        let body = chassis.mass * (twist.x * twist.x + twist.y * twist.y);
        0.5 * (body + chassis.yaw_inertia * twist.yaw * twist.yaw)
            + self.drives.iter().chain(&self.steers).map(turning).sum::<f64>()
    }
}

fn near(value: f64, expected: f64, share: f64) {
    assert!((value - expected).abs() <= share * expected.abs(), "{value}, not {expected}");
}

fn raws(shares: &[f64], most: f64) -> Vec<i16> {
    shares.iter().map(|share| (share * most).round() as i16).collect()
}

/// Where omni wheels stand around the base: half a step to the left of ahead, then counter-clockwise.
fn around(count: u8) -> Vec<f64> {
    (0..count).map(|n| TAU * (0.5 + f64::from(n)) / f64::from(count)).collect()
}

#[test]
fn omni_wheels_roll_as_geometry_says_ahead_sideways_and_on_the_spot() {
    let distance = 0.25;
    for count in [3, 4] {
        let ways = around(count);
        let patterns: [Vec<f64>; 3] = [
            ways.iter().map(|at| -at.sin()).collect(),
            ways.iter().map(|at| at.cos()).collect(),
            vec![1.0; ways.len()],
        ];
        for (axis, pattern) in patterns.iter().enumerate() {
            let chassis = without_resistance(Chassis::omni(count, RADIUS, distance));
            let mut bench = Bench::new(chassis, frictionless());
            bench.drive(&raws(pattern, 3000.0), 500);
            bench.drive(&[0; 4], 500);
            let twist = bench.base.twist();
            let [ahead, left, turn] = [twist.x, twist.y, twist.yaw];
            for (other, value) in [ahead, left, turn].into_iter().enumerate() {
                if other == axis {
                    assert!(value > 0.3, "{count}: {twist:?}");
                } else {
                    // Raw commands are whole numbers.
                    assert!(value.abs() < 1e-3, "{count}: {twist:?}");
                }
            }
            for (at, rim) in ways.iter().zip(bench.rims()) {
                let rolls = -at.sin() * ahead + at.cos() * left + distance * turn;
                assert!((rim - rolls).abs() < 1e-3 * (ahead + left + turn), "{rim} {rolls}");
            }
        }
    }
}

/// The same base, turned by a quarter: what was ahead is to the left.
#[test]
fn rollers_are_where_their_wheel_looks() {
    let plain = Chassis::mecanum(RADIUS, 0.2, 0.22);
    let mut turned = plain.clone();
    for wheel in &mut turned.wheels {
        (wheel.x, wheel.y) = (-wheel.y, wheel.x);
        wheel.direction = FRAC_PI_2;
    }
    for raw in [[2000, 2000, 2000, 2000], [-2000, 2000, 2000, -2000], [-1000, 2000, 500, 900]] {
        let [pose, other] = [&plain, &turned].map(|chassis| {
            let mut bench = Bench::new(chassis.clone(), Plant::m3508());
            bench.drive(&raw, 500);
            bench.base.pose()
        });
        let off = [other.x + pose.y, other.y - pose.x, other.yaw - pose.yaw];
        assert!(off.iter().all(|off| off.abs() < 1e-9), "{pose:?} {other:?}");
        assert!(pose.x.abs() + pose.y.abs() > 0.1, "{pose:?}");
    }
}

/// Without friction and slip, force and inertia are Lagrange's: of wheels that turn with a share `c` of
/// the motion, `a = Σ c τ / r / (m + Σ c² J / r²)`.
#[test]
fn accelerations_are_those_of_force_and_inertia() {
    let swerve = || Chassis::swerve(RADIUS, 0.2, 0.22, Steering::default());
    let half = FRAC_PI_4.cos();
    for (name, chassis, shares) in [
        ("mecanum", Chassis::mecanum(RADIUS, 0.2, 0.22), vec![1.0; 4]),
        ("omni", Chassis::omni(4, RADIUS, 0.25), vec![-half, -half, half, half]),
        ("three", Chassis::omni(3, RADIUS, 0.25), around(3).iter().map(|at| -at.sin()).collect()),
        ("differential", Chassis::differential(RADIUS, 0.4), vec![1.0; 2]),
        ("swerve", swerve(), vec![1.0; 4]),
    ] {
        for mass in [6.0, 20.0, 40.0] {
            let chassis = without_resistance(chassis.clone().with_mass(mass));
            let mut bench = Bench::new(chassis, frictionless());
            let raw = raws(&shares, 1500.0);
            bench.drive(&raw, 100);
            let before = bench.base.twist().x;
            bench.drive(&raw, 200);
            let speed = bench.base.twist().x - before;
            let square: f64 = shares.iter().map(|share| share * share).sum();
            let wheel = bench.drives[0].plant().inertia();
            let force = square * 1500.0 * PER_RAW / RADIUS;
            let acceleration = force / (mass + square * wheel / (RADIUS * RADIUS));
            assert!((speed / 0.2 / acceleration - 1.0).abs() < 0.003, "{name} {mass}: {speed}");
        }
    }
    // On the spot, three wheels 0.25 m from the middle.
    let chassis = without_resistance(Chassis::omni(3, RADIUS, 0.25));
    let inertia = chassis.yaw_inertia;
    let mut bench = Bench::new(chassis, frictionless());
    bench.drive(&[1500; 3], 100);
    let before = bench.base.twist().yaw;
    bench.drive(&[1500; 3], 200);
    let arm = 0.25 / RADIUS;
    let wheel = bench.drives[0].plant().inertia();
    let expected = 3.0 * 1500.0 * PER_RAW * arm / (inertia + 3.0 * wheel * arm * arm);
    near((bench.base.twist().yaw - before) / 0.2, expected, 0.003);
}

/// All wheels slide: each pushes with grip · load, and no more.
#[test]
fn grip_limits_the_acceleration() {
    let grip = 0.6 * GRAVITY;
    let swerve = Chassis::swerve(RADIUS, 0.2, 0.22, Steering::default());
    let half = FRAC_PI_4.cos();
    for (chassis, signs, way, expected) in [
        (Chassis::mecanum(RADIUS, 0.2, 0.22), [1.0; 4], 0, grip),
        (swerve, [1.0; 4], 0, grip),
        // Half of the weight is on castors.
        (Chassis::differential(RADIUS, 0.4), [1.0; 4], 0, grip / 2.0),
        // Four forces at 45 degrees to the motion.
        (Chassis::omni(4, RADIUS, 0.25), [-1.0, -1.0, 1.0, 1.0], 0, grip * half),
        (Chassis::omni(4, RADIUS, 0.25), [1.0, -1.0, -1.0, 1.0], 1, grip * half),
    ] {
        for mass in [6.0, 20.0] {
            let count = chassis.wheels.len();
            let mut bench = Bench::new(chassis.clone().with_mass(mass), Plant::m3508());
            let raw = raws(&signs[..count], 16_384.0);
            bench.drive(&raw, 100);
            let speed = |bench: &Bench| [bench.base.twist().x, bench.base.twist().y][way];
            let before = speed(&bench);
            bench.drive(&raw, 100);
            near((speed(&bench) - before) / 0.1, expected, 1e-6);
        }
    }
}

#[test]
fn no_motor_of_a_differential_base_pushes_it_sideways() {
    let chassis = Chassis::differential(RADIUS, 0.4);
    let (mass, stiffness) = (chassis.mass, chassis.stiffness);
    let mut bench = Bench::new(chassis, Plant::m3508());
    let mut turned = 0.0_f64;
    for index in 0..40_i32 {
        let raw = [733, 2741].map(|step| (index * step % 5000 - 2000) as i16);
        bench.drive(&raw, 150);
        let twist = bench.base.twist();
        // Two wheels hold it on its circle, and creep as they push: m v w = 2 k v_y.
        let creep = mass * (twist.x * twist.yaw).abs() / (2.0 * stiffness);
        assert!(twist.y.abs() < 1.2 * creep + 0.01, "{twist:?}");
        turned = turned.max(twist.yaw.abs());
    }
    assert!(turned > 0.3, "{turned}");
    let mut spins = Bench::new(Chassis::differential(RADIUS, 0.4), Plant::m3508());
    spins.drive(&[-3000, 3000], 600);
    let (pose, twist) = (spins.base.pose(), spins.base.twist());
    assert!(pose.yaw > 0.5 && pose.x.abs() < 1e-9 && pose.y.abs() < 1e-9, "{pose:?}");
    near(spins.rims()[1], 0.2 * twist.yaw, 0.03);
}

#[test]
fn a_swerve_base_turns_its_wheels_and_goes_sideways() {
    let steering = Steering { gear: 2.0, ..Steering::default() };
    let chassis = Chassis::swerve(RADIUS, 0.2, 0.22, steering);
    let mut bench = Bench::new(chassis.clone(), Plant::m3508());
    // A quarter of a turn of the wheel is half a turn of the shaft.
    bench.steer(180.0, 600);
    let angles: Vec<_> = bench.steers.iter().map(|esc| esc.state().output_degrees).collect();
    assert!(angles.iter().all(|angle| (angle - 180.0).abs() < 4.0), "{angles:?}");
    assert!(bench.base.pose().x.abs() < 1e-9 && bench.base.pose().y.abs() < 1e-9);
    bench.drive(&[2000; 4], 1000);
    let (pose, twist) = (bench.base.pose(), bench.base.twist());
    let off = (angles[0] / 2.0).to_radians() - FRAC_PI_2;
    assert!(pose.y > 0.3 && pose.yaw.abs() < 1e-6, "{pose:?}");
    assert!((pose.x + off * pose.y).abs() < 0.01 * pose.y, "{pose:?} {off}");
    near(bench.rims()[0], twist.x.hypot(twist.y), 0.03);
    // Across their way plain wheels slide: with grip · load, and no more.
    let mut slides = Bench::new(chassis.clone(), Plant::m3508());
    slides.drive(&[6000; 4], 1200);
    slides.drive(&[0; 4], 0);
    slides.steer(180.0, 300);
    let before = slides.base.twist().x;
    slides.wait(50_000);
    let after = slides.base.twist().x;
    assert!(after > 0.3, "{before} {after}");
    near((before - after) / 0.05, 0.6 * GRAVITY, 0.01);
    // Two thirds of grip · load on the patch, by the gear, and the motor's own 0.065 N·m.
    let load = chassis.mass * GRAVITY / 4.0;
    let holds = 2.0 / 3.0 * chassis.grip * load * steering.patch / steering.gear + 0.065;
    let raw = |torque: f64| (torque / 0.18 * 1000.0) as i16;
    for (share, moves) in [(0.99, false), (1.01, true)] {
        let mut bench = Bench::new(chassis.clone(), Plant::m3508());
        bench.send(0x1FF, &[raw(share * holds); 4]);
        bench.wait(100_000);
        let turned = bench.steers[0].state().output_degrees;
        assert_eq!(turned > 0.0, moves, "{share}: {turned}");
    }
}

#[test]
fn slip_never_makes_energy() {
    for chassis in [
        Chassis::default(),
        Chassis::omni(4, RADIUS, 0.25),
        Chassis::omni(3, RADIUS, 0.25),
        Chassis::differential(RADIUS, 0.4),
        Chassis::swerve(RADIUS, 0.2, 0.22, Steering::default()),
    ] {
        // Also with a contact that is as stiff as the step allows.
        for (mass, stiffness) in [(6.0, 1000.0), (40.0, 1000.0), (6.0, 1e9), (40.0, 1e9)] {
            let chassis = without_resistance(chassis.clone()).with_mass(mass);
            let chassis = Chassis { stiffness, ..chassis };
            let mut bench = Bench::new(chassis.clone(), frictionless());
            bench.send(0x1FF, &[900, -700, 500, 1000]);
            bench.drive(&[16_000, -3000, 9000, 5000], 150);
            bench.drives.iter().chain(&bench.steers).for_each(|esc| esc.set_power(false));
            bench.wait(200);
            let mut before = bench.energy(&chassis);
            let start = before;
            for _ in 0..3000 {
                bench.wait(100);
                let now = bench.energy(&chassis);
                assert!(now <= before * (1.0 + 1e-12), "{now} {before} {mass} {stiffness}");
                before = now;
            }
            assert!(before > 0.0 && before < start, "{before} of {start}");
        }
    }
}

#[test]
fn wheels_roll_without_a_shiver_under_6_to_40_kg() {
    for chassis in [
        Chassis::omni(4, RADIUS, 0.25),
        Chassis::omni(3, RADIUS, 0.25),
        Chassis::differential(RADIUS, 0.4),
        Chassis::swerve(RADIUS, 0.2, 0.22, Steering::default()),
    ] {
        for (mass, stiffness) in [(6.0, 1000.0), (40.0, 1000.0), (6.0, 1e9), (40.0, 1e9)] {
            let chassis = Chassis { stiffness, ..chassis.clone().with_mass(mass) };
            let mut bench = Bench::new(chassis, Plant::m3508());
            bench.drive(&[1500; 4], 300);
            let mut rims = bench.rims();
            for _ in 0..50 {
                bench.wait(100);
                let now = bench.rims();
                for (now, before) in now.iter().zip(&rims) {
                    // 10 m/s² at most.
                    assert!((now - before).abs() < 1e-3, "{mass} {stiffness}: {now} {before}");
                }
                rims = now;
            }
        }
    }
}

#[test]
fn motors_that_are_not_those_of_the_wheels_are_refused() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let escs: Vec<_> =
        (1..=8).map(|id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap()).collect();
    let plain = |count: usize| escs[..count].iter().map(|esc| (esc, Mounting::Normal));
    let omni = Chassis::omni(3, RADIUS, 0.25);
    assert_eq!(world.add_base(omni, plain(4)).err(), Some(WheelError::Count));
    let swerve = || Chassis::swerve(RADIUS, 0.2, 0.2, Steering::default());
    assert_eq!(world.add_base(swerve(), plain(4)).err(), Some(WheelError::Steering));
    let steered = |first: usize| {
        escs[..4].iter().zip(&escs[first..]).map(|(drive, steering)| WheelMotors {
            drive: (drive, Mounting::Normal),
            steering: Some((steering, Mounting::Normal)),
        })
    };
    assert_eq!(world.add_base(swerve(), steered(3)).err(), Some(WheelError::Taken));
    assert!(world.add_base(swerve(), steered(4)).is_ok());
    assert_eq!(
        world.add_base(Chassis::differential(RADIUS, 0.4), plain(2)).err(),
        Some(WheelError::Taken)
    );
}
