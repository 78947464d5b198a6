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

use rc10_conformance::{RULES, Report, check, check_line};
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

/// Rules that a model does not keep yet: model, rule, and why. One that it keeps by now is an error.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    ("M3508", "target-on-new-scale", COASTS),
    ("M2006", "target-on-new-scale", COASTS),
    ("GM6020, current mode", "target-on-new-scale", COASTS),
    ("GM6020, voltage mode", "target-on-new-scale", COASTS),
    ("Damiao J4310, MIT", "target-on-new-scale", COASTS),
    ("Damiao J4310, position-velocity", "target-on-new-scale", COASTS),
    ("Damiao J4310, force-position", "target-on-new-scale", COASTS),
    ("GO-M8010-6 behind a module", "target-on-new-scale", COASTS),
    ("VESC with angle loops", "target-on-new-scale", COASTS),
    ("MG4010E-i10", "target-on-new-scale", COASTS),
    ("MF9025 in the multi-motor frame", "target-on-new-scale", COASTS),
    ("ODrive, torque", "target-on-new-scale", COASTS),
    ("ODrive, position", "target-on-new-scale", COASTS),
    ("CyberGear", "target-on-new-scale", COASTS),
    ("RobStride RS04", "target-on-new-scale", COASTS),
    ("GO-M8010-6 on RS-485", "target-on-new-scale", COASTS),
    ("CyberGear", "soft-impedance", SLOW_START),
    ("RobStride RS04", "soft-impedance", SLOW_START),
    ("GO-M8010-6 behind a module", "soft-impedance", GROWING_LIMIT),
];
const COASTS: &str =
    "a target that was moved by a new zero is told as coasting, or as it was before";
const SLOW_START: &str = "its impedance takes 100 ms to its full torque";
const GROWING_LIMIT: &str =
    "the limit grows, which is another factor for the spring and the torque";

#[test]
fn every_motor_keeps_the_rules() {
    keep_the_rules(Direction::Forward);
}

#[test]
fn every_reversed_motor_keeps_the_rules_in_the_mirror() {
    keep_the_rules(Direction::Reversed);
}

fn keep_the_rules(direction: Direction) {
    let differ = |(model, check): &Entry| unexpected(model, direction, check(direction));
    let wrong: Vec<String> = MOTORS.iter().flat_map(differ).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn every_exception_is_of_a_model_and_a_rule_and_has_a_reason() {
    for (model, rule, why) in EXCEPTIONS {
        assert!(MOTORS.iter().any(|(name, _)| name == model), "no model {model}");
        assert!(RULES.iter().any(|known| known.name == *rule), "no rule {rule}");
        assert!(!why.is_empty(), "{model}, {rule}");
    }
}

/// How a report differs from what the exceptions say.
fn unexpected(model: &str, direction: Direction, checked: Result<(), Report>) -> Vec<String> {
    let mut expected: Vec<&str> =
        EXCEPTIONS.iter().filter(|(name, ..)| *name == model).map(|(_, rule, _)| *rule).collect();
    let mut wrong = Vec::new();
    if let Err(report) = checked {
        let broken: Vec<&str> = report.broken().collect();
        if broken.iter().any(|rule| !expected.contains(rule)) || !report.unchecked().is_empty() {
            wrong.push(format!("{model}: {report}"));
        }
        expected.retain(|rule| !broken.contains(rule));
    }
    let kept = expected.into_iter();
    wrong.extend(kept.map(|rule| format!("{model}, {direction:?}: keeps {rule}: no exception")));
    wrong
}
