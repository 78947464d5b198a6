//! A robot with a Finch beside a DJI motor.

use rc10_app::Rpm;
use rc10_conformance::Bench;
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::{ArmSwitch, Link, Safety, Target};
use rc10_sim::{EscConfig, Model};

use crate::device::plug_in;
use crate::motor::Finch;

#[test]
fn a_finch_drives_beside_an_m3508() {
    let switch = ArmSwitch::new();
    let mut arm = Finch::new(1).unwrap();
    let mut wheel = Dji::new(dji::Config::new(&M3508, 1)).unwrap();

    let mut bench = Bench::new(7, &switch);
    let real_arm = plug_in(&bench.wire, 1);
    bench.wire.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    let arm = bench.attach(&mut arm, Safety::HOLD).unwrap();
    let wheel = bench.attach(&mut wheel, Safety::COAST).unwrap();

    bench.wait(10);
    switch.arm().unwrap();
    bench.hold(arm, Target::Speed(Rpm::new(60.0)), 500).unwrap();

    assert!((real_arm.state().output_rpm - 60.0).abs() < 1.0);
    assert_eq!(bench.status(wheel).link, Link::Online);
    assert_eq!(bench.refused, 0);
}

#[test]
fn two_with_one_identifier_are_refused_by_name() {
    let switch = ArmSwitch::new();
    let (mut one, mut two) = (Finch::new(1).unwrap(), Finch::new(1).unwrap());
    let mut bench = Bench::new(7, &switch);
    bench.attach(&mut one, Safety::HOLD).unwrap();
    let refused = bench.attach(&mut two, Safety::HOLD).unwrap_err();
    let text = "Finch F10 id 1 cannot share a bus with Finch F10 id 1: \
                both send feedback with identifier 0x381; set another on one, or plug it in elsewhere";
    assert_eq!(refused.to_string(), text);
}
