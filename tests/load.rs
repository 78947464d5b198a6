//! The load of a bus: said before the start, and true on the simulated wire.

use crate::common::{Bench, twin};
use rc10_app::Rpm;
use rc10_motor::dji::{self, Dji, FeedbackRate};
use rc10_motor::embassy::{BusPort, Runner};
use rc10_motor::{ArmError, ArmSwitch, MotorBus, Safety, Target, Unfit, Verdict};
use rc10_sim::{BusConfig, World};
use rc10_time::Micros;

fn eight(rate: FeedbackRate) -> Vec<Dji> {
    let config = |id| dji::Config::new(&dji::M3508, id).with_feedback_rate(rate);
    (1..=8).map(|id| Dji::new(config(id)).unwrap()).collect()
}

/// Drives the motors for ten seconds; returns planned and measured load, and lost feedback frames.
fn drive(motors: &mut [Dji], rate: rc10_sim::FeedbackRate) -> (rc10_motor::BusLoad, f64, u64) {
    let switch = ArmSwitch::new();
    let mut bench = Bench::new(11, &switch);
    let devices: Vec<_> = motors
        .iter_mut()
        .zip(1..)
        .map(|(motor, id)| {
            let mut device = twin(&dji::M3508, id);
            device.rate = rate;
            bench.add(motor, Safety::COAST, device)
        })
        .collect();
    let plan = bench.bus.load(1_000_000);
    switch.arm().unwrap();
    for _ in 0..10_000 {
        for &(id, _) in &devices {
            bench.command(id, Target::Speed(Rpm::new(150.0)));
        }
        bench.tick();
    }
    let overwritten = devices.iter().map(|(_, esc)| esc.state().feedback_overwritten).sum::<u64>();
    let lost = u64::from(rc10_can::CanPort::health(&bench.port).receive_lost);
    for (id, _) in &devices {
        let counters = bench.status(*id).counters;
        assert_eq!(counters.malformed, 0);
        if overwritten == 0 {
            let period = rate.period().get();
            let expected = Micros::from_millis(10_000).get() / period;
            assert!(u64::from(counters.received) + 1 >= expected, "{counters:?}");
            assert_eq!(counters.lost, 0);
        }
    }
    (plan, bench.wire.load(), overwritten + lost + u64::from(bench.refused))
}

#[test]
fn eight_motors_at_500_hz_lose_nothing_in_ten_seconds() {
    let mut motors = eight(FeedbackRate::Hz500);
    let (plan, measured, lost) = drive(&mut motors, rc10_sim::FeedbackRate::Hz500);
    assert_eq!(plan.verdict(), Verdict::Fits);
    assert_eq!(plan.frames_per_second, 6000);
    assert_eq!(lost, 0);
    let (least, worst) = (f64::from(plan.least), f64::from(plan.worst));
    assert!((least..=worst).contains(&measured), "{plan}, measured {measured:.1} %");
}

#[test]
fn eight_motors_at_1_khz_are_said_not_to_fit_with_the_numbers_and_do_not() {
    let mut motors = eight(FeedbackRate::Hz1000);
    let (plan, measured, lost) = drive(&mut motors, rc10_sim::FeedbackRate::Hz1000);
    assert_eq!(plan.verdict(), Verdict::DoesNotFit);
    assert_eq!(
        plan.to_string(),
        "10000 frames/s: 111 % of the bus without stuff bits, 118 % typically, 135 % at worst: \
         does NOT fit, frames will be lost"
    );
    assert!(lost > 1000 && measured > 99.0, "lost {lost} at {measured:.1} %");
}

#[test]
fn a_bus_that_does_not_fit_cannot_be_armed_unless_that_is_allowed() {
    let armed = |count, allowed: bool| {
        let switch = ArmSwitch::new();
        let mut motors = eight(FeedbackRate::Hz1000);
        let mut bus = MotorBus::new(&switch);
        for motor in &mut motors[..count] {
            bus.attach(motor, Safety::COAST).unwrap();
        }
        if allowed {
            bus.allow_overload();
        }
        let wire = World::new(1).add_bus(BusConfig::default());
        let shared = BusPort::new();
        let _runner = Runner::new(wire.port(), bus, &shared, Micros::ZERO);
        switch.arm()
    };
    assert_eq!(armed(6, false), Ok(()), "tight");
    let error = armed(7, false).unwrap_err();
    assert_eq!(error, ArmError::Unfit(Unfit::Overload));
    assert_eq!(error.to_string(), "cannot be armed: the motors of a bus do not fit on it");
    assert_eq!(armed(8, true), Ok(()));
}

/// protocols of the field give 56-68 % for four and 78-95 % for five motors; six are tight.
#[test]
fn four_and_five_motors_fit_and_six_are_tight() {
    for (count, least, worst, verdict) in [
        (4, 55.5, 67.5, Verdict::Fits),
        (5, 77.7, 94.5, Verdict::Fits),
        (6, 88.8, 108.0, Verdict::Tight),
        (7, 99.9, 121.5, Verdict::DoesNotFit),
    ] {
        let switch = ArmSwitch::new();
        let mut motors = eight(FeedbackRate::Hz1000);
        let mut bus = MotorBus::new(&switch);
        for motor in &mut motors[..count] {
            bus.attach(motor, Safety::COAST).unwrap();
        }
        let plan = bus.load(1_000_000);
        assert!((plan.least - least).abs() < 0.05 && (plan.worst - worst).abs() < 0.05, "{plan}");
        assert_eq!(plan.verdict(), verdict);
    }
}
