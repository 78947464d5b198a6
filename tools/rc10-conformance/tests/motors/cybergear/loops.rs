//! Closed loops: each sort of target is reached.

use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_motor::cybergear::{Config, CyberGear};
use rc10_motor::{CommandError, Impedance, Safety, Target, TargetError, TargetKind};
use rc10_sim::Beyond;
use rc10_sim::cybergear as sim;

use super::{ADDRESS, CONFIG, Pair, cybergear, models, with_cybergear, with_pair};

/// Ticks until `f` says so for 50 ticks on end; panics after `most`.
fn settles(pair: &mut Pair, target: Target, most: u32, f: impl Fn(&Pair) -> bool) -> u32 {
    let mut good = 0;
    for tick in 0..most {
        pair.hold(target, 1);
        good = if f(pair) { good + 1 } else { 0 };
        if good == 50 {
            return tick - 49;
        }
    }
    panic!("not within {most} ms: {} rpm, {} degrees", pair.rpm(), pair.degrees());
}

#[test]
fn speeds_are_reached_by_every_model() {
    for (ours, theirs) in models() {
        for inertia in [0.0, 0.02 * theirs.torque / 12.0] {
            let motor = CyberGear::new(Config::new(ours, ADDRESS)).unwrap();
            let device = sim::CyberGear::new(theirs, 1).with_timeout(2000);
            let plant = theirs.plant().with_load_inertia(inertia);
            with_pair(motor, (device, plant), Safety::COAST, |mut pair| {
                pair.switch.arm().unwrap();
                for wanted in [60.0, -90.0, 5.0] {
                    let target = Target::Speed(Rpm::new(wanted));
                    let wanted = f64::from(wanted);
                    let time = settles(&mut pair, target, 1000, |pair| {
                        (pair.rpm() - wanted).abs() < 0.02 * wanted.abs().max(25.0)
                    });
                    assert!(time < 500);
                    let feedback = pair.status().feedback;
                    assert!((f64::from(feedback.speed.get()) - pair.rpm()).abs() < 1.0);
                }
            });
        }
    }
}

#[test]
fn angles_are_reached_by_every_model() {
    for (ours, theirs) in models() {
        let motor = CyberGear::new(Config::new(ours, ADDRESS)).unwrap();
        let device = sim::CyberGear::new(theirs, 1).with_timeout(2000);
        let plant = theirs.plant().with_load_inertia(0.01 * theirs.torque / 12.0);
        with_pair(motor, (device, plant), Safety::COAST, |mut pair| {
            pair.switch.arm().unwrap();
            let from = pair.status().feedback.total_angle.degrees().get();
            let start = pair.degrees() - f64::from(from);
            for wanted in [90_i32, 450, -200, 10] {
                let target = Target::TotalAngle(TotalAngle::from_degrees(wanted));
                let _time = settles(&mut pair, target, 4000, |pair| {
                    (pair.degrees() - start - f64::from(wanted)).abs() < 0.5
                });
            }
            // The shorter way: back from 10 to 350.
            settles(&mut pair, Target::Angle(Degrees::new(350.0)), 2000, |pair| {
                (pair.degrees() - start + 10.0).abs() < 0.5
            });
            let feedback = pair.status().feedback;
            assert!((feedback.angle.get() - 350.0).abs() < 1.0, "{:?}", feedback.angle);
        });
    }
}

fn impedance(angle: f32, kp: f32, kd: f32) -> Impedance {
    Impedance { angle: Degrees::new(angle), kp, kd, ..Impedance::default() }
}

/// Never more than the limit, wherever the spring is.
#[test]
fn an_impedance_keeps_to_the_torque_limit() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.switch.arm().unwrap();
        let from = pair.status().feedback.total_angle.degrees().get();
        let limit = rc10_motor::Request::TorqueLimit(NewtonMetres::new(1.5));
        pair.bench.bus.request(pair.motor, limit).unwrap();
        let far = Target::Impedance(impedance(from - 120.0, 50.0, 2.0));
        for _ in 0..300 {
            pair.hold(far, 1);
            // Between two frames the device's loop goes on by itself: 50 N m/rad at 20 rad/s are
            // 1 N m a millisecond.
            assert!(pair.esc.state().torque.abs() < 2.5, "{}", pair.esc.state().torque);
        }
    });
}

#[test]
fn what_the_devices_loop_has_no_number_for_is_refused() {
    with_cybergear(Safety::COAST, |mut pair| {
        let now = pair.bench.world.now();
        let bus = &mut pair.bench.bus;
        let refused = |kind| Err(CommandError::Target(TargetError::OutOfRange(kind)));
        for (angle, kp, kd) in
            [(720.0, 1.0, 1.0), (0.0, 501.0, 1.0), (0.0, 1.0, 5.1), (0.0, -1.0, 1.0)]
        {
            let target = Target::Impedance(impedance(angle, kp, kd));
            assert_eq!(bus.command(pair.motor, target, now), refused(TargetKind::Impedance));
        }
        let target = Target::TotalAngle(TotalAngle::from_degrees(-720));
        assert_eq!(bus.command(pair.motor, target, now), refused(TargetKind::TotalAngle));
        let target = Target::Impedance(impedance(f32::NAN, 1.0, 1.0));
        let not_finite = TargetError::NotFinite(TargetKind::Impedance);
        assert_eq!(bus.command(pair.motor, target, now), Err(CommandError::Target(not_finite)));
        let target = Target::Duty(0.1);
        let unsupported = TargetError::Unsupported(TargetKind::Duty);
        assert_eq!(bus.command(pair.motor, target, now), Err(CommandError::Target(unsupported)));
        assert_eq!(
            bus.command(pair.motor, Target::Impedance(impedance(716.0, 500.0, 5.0)), now),
            Ok(())
        );
    });
}

/// A wheel turns out of the range of its field, whatever that shows there, and comes back.
#[test]
fn turns_are_counted_beyond_the_range_of_the_field() {
    for beyond in [Beyond::Saturates, Beyond::Wraps] {
        let mut device = sim::CyberGear::new(&sim::CYBERGEAR, 1);
        device.beyond = beyond;
        let plant = sim::CYBERGEAR.plant().with_load_inertia(0.01);
        with_pair(cybergear(), (device, plant), Safety::BRAKE, |mut pair| {
            pair.switch.arm().unwrap();
            let told = |pair: &Pair| f64::from(pair.status().feedback.total_angle.degrees().get());
            let start = pair.degrees() - told(&pair);
            pair.hold(Target::Speed(Rpm::new(120.0)), 5000);
            assert!(pair.degrees() - start > 3000.0);
            let off = told(&pair) - (pair.degrees() - start);
            assert!(off.abs() < 40.0);
            // An angle is found there too, and nothing runs away.
            let before = told(&pair);
            for _ in 0..1000 {
                pair.hold(Target::Angle(Degrees::new(0.0)), 1);
            }
            assert!((told(&pair) - before).abs() < 360.0);
            assert!(pair.rpm().abs() < 0.5, "{}", pair.rpm());
            let beyond = Target::Impedance(impedance(0.0, 1.0, 1.0));
            let now = pair.bench.world.now();
            assert!(pair.bench.bus.command(pair.motor, beyond, now).is_err());
            // And it comes all the way back, exactly.
            let home = Target::TotalAngle(TotalAngle::from_degrees(100));
            settles(&mut pair, home, 6000, |pair| (pair.degrees() - start - 100.0).abs() < 0.5);
            assert!((told(&pair) - 100.0).abs() < 0.5);
        });
    }
}

/// Both ranges that sources give a CyberGear.
#[test]
fn another_range_of_position_scales_the_angle() {
    let four_pi = 4.0 * std::f32::consts::PI;
    let motor = CyberGear::new(CONFIG.with_position_range(four_pi)).unwrap();
    let mut model = sim::CYBERGEAR;
    model.position = four_pi.into();
    let plant = model.plant().with_load_inertia(0.01);
    with_pair(motor, (sim::CyberGear::new(&model, 1), plant), Safety::COAST, |mut pair| {
        pair.switch.arm().unwrap();
        let from = pair.status().feedback.total_angle.degrees().get();
        let start = pair.degrees() - f64::from(from);
        let target = Target::TotalAngle(TotalAngle::from_degrees(700));
        settles(&mut pair, target, 3000, |pair| (pair.degrees() - start - 700.0).abs() < 0.3);
    });
}
