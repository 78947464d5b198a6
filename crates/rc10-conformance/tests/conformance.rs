//! Every motor of `rc10-motor` keeps the rules. One entry a model: put yours into [`MOTORS`].
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod conformance_of {
    pub mod cybergear;
    pub mod damiao;
    pub mod dji;
    pub mod lk;
    pub mod odrive;
    pub mod unitree_line;
    pub mod unitree_module;
    pub mod vesc;
}

use rc10_conformance::check_line;
use rc10_conformance::{Report, check};
use rc10_motor::rc10_app::Direction;

/// A model, and what its check says of one made to turn that way.
type Entry = (&'static str, fn(Direction) -> Result<(), Report>);

const MOTORS: &[Entry] = &[
    ("M3508", conformance_of::dji::m3508),
    ("M2006", conformance_of::dji::m2006),
    ("GM6020, current mode", conformance_of::dji::gm6020_current),
    ("GM6020, voltage mode", conformance_of::dji::gm6020_voltage),
    ("Damiao J4310, MIT", conformance_of::damiao::j4310_mit),
    ("Damiao J4310, velocity", conformance_of::damiao::j4310_velocity),
    ("Damiao J4310, position-velocity", conformance_of::damiao::j4310_position_velocity),
    ("Damiao J4310, force-position", conformance_of::damiao::j4310_force_position),
    ("GO-M8010-6 behind a module", conformance_of::unitree_module::go_m8010),
    ("VESC", conformance_of::vesc::vesc),
    ("VESC, relative currents", conformance_of::vesc::vesc_relative),
    ("VESC with angle loops", conformance_of::vesc::vesc_with_servo),
    ("MG4010E-i10", conformance_of::lk::mg4010e),
    ("MF9025 in the multi-motor frame", conformance_of::lk::mf9025_multi_motor),
    ("ODrive, torque", conformance_of::odrive::torque),
    ("ODrive, velocity", conformance_of::odrive::velocity),
    ("ODrive, position", conformance_of::odrive::position),
    ("CyberGear", conformance_of::cybergear::cybergear),
    ("RobStride RS04", conformance_of::cybergear::rs04),
    ("GO-M8010-6 on RS-485", conformance_of::unitree_line::go_m8010),
    // One line for each further model, one file for each vendor in `conformance_of/`.
];

#[test]
fn every_motor_keeps_the_rules() {
    keep_the_rules(Direction::Forward);
}

#[test]
fn every_reversed_motor_keeps_the_rules_in_the_mirror() {
    keep_the_rules(Direction::Reversed);
}

fn keep_the_rules(direction: Direction) {
    let report = |(model, check): &Entry| Some(format!("{model}: {}", check(direction).err()?));
    let wrong: Vec<String> = MOTORS.iter().filter_map(report).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}
