//! Every motor of `rc10-motor` keeps the rules. One entry a model: put yours into [`MOTORS`].

mod cybergear;
mod damiao;
mod dji;
mod lk;
mod odrive;
mod unitree_line;
mod unitree_module;
mod vesc;

use rc10_conformance::{Report, check, check_line};
use rc10_motor::rc10_app::Direction;

/// A model, and what its check says of one made to turn that way.
type Entry = (&'static str, fn(Direction) -> Result<(), Report>);

const MOTORS: &[Entry] = &[
    ("M3508", dji::m3508),
    ("M2006", dji::m2006),
    ("GM6020, current mode", dji::gm6020_current),
    ("GM6020, voltage mode", dji::gm6020_voltage),
    ("Damiao J4310, MIT", damiao::j4310_mit),
    ("Damiao J4310, velocity", damiao::j4310_velocity),
    ("Damiao J4310, position-velocity", damiao::j4310_position_velocity),
    ("Damiao J4310, force-position", damiao::j4310_force_position),
    ("GO-M8010-6 behind a module", unitree_module::go_m8010),
    ("VESC", vesc::vesc),
    ("VESC, relative currents", vesc::vesc_relative),
    ("VESC with angle loops", vesc::vesc_with_servo),
    ("MG4010E-i10", lk::mg4010e),
    ("MF9025 in the multi-motor frame", lk::mf9025_multi_motor),
    ("ODrive, torque", odrive::torque),
    ("ODrive, velocity", odrive::velocity),
    ("ODrive, position", odrive::position),
    ("CyberGear", cybergear::cybergear),
    ("RobStride RS04", cybergear::rs04),
    ("GO-M8010-6 on RS-485", unitree_line::go_m8010),
    // One line for each further model, one file for each vendor in `conformance/`.
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
